#include "diagnosis/predictor/predictor.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <string_view>
#include <unsupported/Eigen/MatrixFunctions>

#include "diagnosis/predictor/drive_signals.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kOutOfBounds = 1e15;  // of a state: the motion has run away
// Set-valued friction takes the catalogue's curve with a corner so sharp that it is none.
constexpr double kSharp = 1e-12;
constexpr double kBarelyMoving = 1e-6;  // of a velocity
constexpr double kResolved = 0.5;       // of a step, while a velocity passes the transition
constexpr int kMostSubsteps = 8;        // that a step may be divided into to resolve it

double dot(const std::vector<std::pair<Index, double>>& b, const VectorXd& values) {
  double sum = 0.0;
  for (const auto& [at, coefficient] : b) sum += coefficient * values(at);
  return sum;
}

std::vector<std::pair<Index, double>> sparse(const VectorXd& b) {
  std::vector<std::pair<Index, double>> list;
  for (Index i = 0; i < b.size(); ++i) {
    if (b(i) != 0.0) list.emplace_back(i, b(i));
  }
  return list;
}

const LawEntry& entry_of(const Element& part) {
  return *find_law(part.law_name, part.location.kind != LocationKind::kElement);
}

// Where a law has a transition at v = 0.
std::optional<std::size_t> transition_of(const Element& part) {
  const LawEntry& entry = entry_of(part);
  const auto at = std::ranges::find(entry.parameters, "transition_velocity", &LawParameter::name);
  if (at == entry.parameters.end() || !entry.make) return {};
  return static_cast<std::size_t>(at - entry.parameters.begin());
}

// Steps within which a velocity that passes the transition is resolved, by the step that `rate` =
// h b' M^-1 b is of. How steep it is where an input drives it, nobody knows beforehand.
double steps_to_resolve(const Element& part, std::size_t transition, double rate) {
  if (part.location.driver >= 0) return rate > 0.0 ? 1e300 : 1.0;
  const double small = kBarelyMoving * part.parameters[transition];
  const double slope = part.law->force(0.0, small, {}) / small;
  return rate * slope / kResolved;
}

// The friction with no transition at v = 0.
std::shared_ptr<const Law> without_transition(const Element& part, std::size_t transition) {
  std::vector<double> parameters = part.parameters;
  parameters[transition] *= kSharp;
  return entry_of(part).make(parameters);
}

bool is_linear_element(const Element& part) {
  return part.law_name == "stiffness" || part.law_name == "viscous";
}

}  // namespace

Predictor::Predictor(const LumpedModel& model, double sample_time, int steps_per_sample,
                     const DisturbanceForce& disturbance)
    : sample_time_(sample_time),
      step_(sample_time / steps_per_sample),
      steps_(steps_per_sample),
      mass_(model.mass),
      damping_(model.damping),
      stiffness_(model.stiffness),
      inputs_(model.inputs),
      outputs_(model.outputs),
      disturbance_(disturbance) {
  split_coordinates(model);
  Eigen::MatrixXd mass(n_, n_);
  for (Index i = 0; i < n_; ++i) {
    for (Index j = 0; j < n_; ++j) {
      mass(i, j) = mass_(free_[static_cast<std::size_t>(i)], free_[static_cast<std::size_t>(j)]);
    }
  }
  inverse_mass_ = mass.inverse();
  states_ = 2 * n_;
  place_laws(model);
  place_sensors(model);
  if (disturbance_.is_there()) {
    disturbance_state_ = states_++;
    disturbance_kept_ = std::exp(-sample_time / disturbance_.memory);
  }
  allocate();
}

void Predictor::split_coordinates(const LumpedModel& model) {
  imposed_ = model.imposed;
  m_ = static_cast<Index>(imposed_.size());
  slot_.assign(imposed_.size(), -1);
  position_ = velocity_ = acceleration_ = slot_;
  auto derived = static_cast<Index>(inputs_.size());
  for (Index i = 0; i < m_; ++i) {
    const auto at = static_cast<std::size_t>(i);
    if (!imposed_[at]) {
      slot_[at] = n_++;
      free_.push_back(i);
      continue;
    }
    for (std::size_t j = 0; j < inputs_.size(); ++j) {
      if (inputs_[j].mass != i) continue;
      const auto channel = static_cast<Index>(j);
      if (inputs_[j].kind == LumpedInput::Kind::kPosition) position_[at] = channel;
      if (inputs_[j].kind == LumpedInput::Kind::kVelocity) velocity_[at] = channel;
      if (inputs_[j].kind == LumpedInput::Kind::kAcceleration) acceleration_[at] = channel;
    }
    if (velocity_[at] < 0) velocity_[at] = derived++;
    if (acceleration_[at] < 0) acceleration_[at] = derived++;
  }
  no_inputs_.assign(static_cast<std::size_t>(derived), 0.0);
}

Predictor::Placed Predictor::placed(const Element& part) const {
  Placed result;
  result.law = part.law;
  result.in = sparse(part.location.input);
  result.out = sparse(part.location.output);
  result.driver = part.location.driver;
  result.states = part.law ? part.law->state_count() : 0;
  return result;
}

void Predictor::place_laws(const LumpedModel& model) {
  for (const Element& part : model.parts) {
    const bool is_force = part.location.kind == LocationKind::kElement && part.law;
    if (!is_force || is_linear_element(part)) continue;  // those are in M, C and K
    Placed law = placed(part);
    law.is_linear = part.law_name == "mode";
    law.first_state = states_;
    states_ += static_cast<Index>(law.states);
    VectorXd b = VectorXd::Zero(n_);
    for (const auto& [at, coefficient] : law.out) {
      if (slot_[static_cast<std::size_t>(at)] >= 0)
        b(slot_[static_cast<std::size_t>(at)]) = coefficient;
    }
    law.velocity_by = inverse_mass_ * b;
    law.mobility = b.dot(law.velocity_by);
    if (const auto transition = transition_of(part); transition && law.in == law.out) {
      const double steps = steps_to_resolve(part, *transition, step_ * law.mobility);
      if (steps > kMostSubsteps) {
        law.law = without_transition(part, *transition);
        law.is_set_valued = has_set_valued_ = true;
      } else if (steps > substeps_.count) {
        substeps_.count = static_cast<int>(std::ceil(steps));
      }
    }
    laws_.push_back(std::move(law));
  }
  measured_.resize(outputs_.size());
  for (std::size_t j = 0; j < outputs_.size(); ++j) {
    using enum LumpedOutput::Quantity;
    needs_forces_ |= outputs_[j].quantity == kAcceleration || outputs_[j].quantity == kForce;
    if (outputs_[j].quantity == kElementForce) measured_[j] = placed(model.parts[outputs_[j].part]);
  }
}

void Predictor::place_sensors(const LumpedModel& model) {
  sensors_.resize(outputs_.size());
  late_.resize(outputs_.size());
  for (const Element& part : model.parts) {
    if (part.location.kind != LocationKind::kSensor) continue;
    const auto output = static_cast<std::size_t>(part.location.channel);
    if (part.use == LawUse::kDelay) {
      late_[output].samples += part.parameters[0] / sample_time_;
      continue;
    }
    Sensor sensor;
    sensor.driver = part.location.driver;
    if (part.law_name == "lag") {
      sensor.kind = Sensor::Kind::kLag;
      sensor.time_constant = part.parameters[0];
      sensor.state = states_++;
    } else if (part.law_name == "rate_limit") {
      sensor.kind = Sensor::Kind::kRateLimit;
      sensor.limit = part.parameters[0];
      sensor.time_constant = part.parameters[1];
      sensor.state = states_++;
    } else if (part.law_name == "resonance") {
      place_resonance(part, sensor);
    } else {
      sensor.law = part.law;
      if (part.law_name == "rectifier") sensor.turned_below_zero = 1.0 - 2.0 * part.parameters[0];
    }
    sensors_[output].push_back(std::move(sensor));
  }
  for (Late& late : late_) {
    if (late.samples <= 0.0) continue;
    late.first = states_;
    late.length = static_cast<Index>(late.samples) + 1;
    states_ += late.length;
  }
}

// Exact for a signal that is straight within a step: the exponential of the states, the signal
// and its change (Van Loan, IEEE Transactions on Automatic Control 23, 1978).
void Predictor::place_resonance(const Element& part, Sensor& sensor) {
  sensor.kind = Sensor::Kind::kResonance;
  sensor.resonance = part.parameters;
  sensor.state = states_;
  states_ += 2;
  const double w = 2.0 * std::numbers::pi * part.parameters[1], h = step_;
  Eigen::Matrix4d m = Eigen::Matrix4d::Zero();
  m(0, 1) = h;
  m(1, 0) = -w * w * h;
  m(1, 1) = -2.0 * part.parameters[2] * w * h;
  m(1, 2) = h;
  m(2, 3) = 1.0;
  const Eigen::Matrix4d e = m.exp();
  sensor.kept = e.topLeftCorner<2, 2>();
  sensor.by_signal = e.block<2, 1>(0, 2);
  sensor.by_change = e.block<2, 1>(0, 3);
}

double Predictor::after(const Sensor& sensor, double signal) const {
  if (sensor.kind != Sensor::Kind::kResonance) return x_(sensor.state);
  const std::vector<double>& p = sensor.resonance;
  const double w = 2.0 * std::numbers::pi * p[1];
  return signal + p[0] * (signal - w * (w * x_(sensor.state) + 2.0 * p[2] * x_(sensor.state + 1)));
}

void Predictor::follow(const Sensor& sensor, double before, double now) {
  if (sensor.kind == Sensor::Kind::kResonance) {
    x_.segment<2>(sensor.state) = (sensor.kept * x_.segment<2>(sensor.state) +
                                   sensor.by_signal * before + sensor.by_change * (now - before))
                                      .eval();
    return;
  }
  double& x = x_(sensor.state);
  if (sensor.kind == Sensor::Kind::kRateLimit) {
    x = RateLimitStep(sensor.limit, sensor.time_constant, step_).from(x, before, now);
    return;
  }
  const double r = step_ / std::max(sensor.time_constant, 1e-12 * step_);
  const double end = std::exp(-r), mean = (1.0 - end) / r;
  x = end * x + (mean - end) * before + (1.0 - mean) * now;
}

void Predictor::allocate() {
  x_.setZero(states_);
  slopes_.k1 = slopes_.k2 = slopes_.k3 = slopes_.k4 = slopes_.trial = x_;
  q_.setZero(m_);
  v_ = a_ = force_ = q_;
  y_.setZero(output_count());
  substeps_.inputs.setZero(static_cast<Index>(no_inputs_.size()), 3);
  kept_y_ = error_ = remembered_y_ = y_;
  remembered_x_ = x_;
  turned_.setOnes(output_count());
  std::size_t lags = 0;
  for (const auto& list : sensors_) {
    lags += static_cast<std::size_t>(
        std::ranges::count_if(list, [](const Sensor& sensor) { return !sensor.law; }));
  }
  followed_.reserve(lags);
  followed_before_.reserve(lags);
  remembered_followed_.reserve(lags);
}

void Predictor::spread(const double* x, const double* inputs) {
  for (Index i = 0; i < m_; ++i) {
    const auto at = static_cast<std::size_t>(i);
    if (slot_[at] >= 0) {
      q_(i) = x[slot_[at]];
      v_(i) = x[n_ + slot_[at]];
    } else if (linear_) {
      q_(i) = v_(i) = a_(i) = 0.0;
    } else {
      q_(i) = inputs[position_[at]];
      v_(i) = inputs[velocity_[at]];
      a_(i) = inputs[acceleration_[at]];
    }
  }
}

void Predictor::add_forces(const double* x, const double* inputs, double* dx) {
  for (const Placed& law : laws_) {
    if (linear_ && !law.is_linear) continue;
    const double z = law.driver >= 0 ? inputs[law.driver] : dot(law.in, q_);
    const double rate = dot(law.in, v_);
    const std::span<const double> state(x + law.first_state, law.states);
    if (law.states > 0) law.law->state_rate(z, rate, state, {dx + law.first_state, law.states});
    if (law.is_set_valued && law.mode != Placed::Mode::kSlides) continue;
    const bool goes_on = !law.is_set_valued || law.direction * rate > 0.0;
    const double force = law.law->force(z, goes_on ? rate : law.direction * kBarelyMoving, state);
    for (const auto& [at, coefficient] : law.out) force_(at) -= coefficient * force;
  }
}

// dx of the free coordinates and of the laws; force_ is left with what acts on each coordinate
// beside its inertia.
void Predictor::rates(const double* x, const double* inputs, double* dx) {
  spread(x, inputs);
  force_.noalias() = -(stiffness_.lazyProduct(q_)) - damping_.lazyProduct(v_);
  std::fill(dx, dx + states_, 0.0);
  if (disturbance_state_ >= 0) force_(disturbance_.coordinate) += x[disturbance_state_];
  if (linear_) {
    if (pushed_ >= 0) force_(pushed_) += push_;
    add_forces(x, inputs, dx);
  } else {
    for (std::size_t j = 0; j < inputs_.size(); ++j) {
      if (inputs_[j].kind == LumpedInput::Kind::kForce) force_(inputs_[j].mass) += inputs[j];
    }
    add_forces(x, inputs, dx);
  }
  for (Index i = 0; i < n_; ++i) {
    double sum = 0.0;
    for (Index j = 0; j < n_; ++j) {
      const Index other = free_[static_cast<std::size_t>(j)];
      double push = force_(other);
      if (n_ < m_) {
        for (Index k = 0; k < m_; ++k) {
          if (imposed_[static_cast<std::size_t>(k)]) push -= mass_(other, k) * a_(k);
        }
      }
      sum += inverse_mass_(i, j) * push;
    }
    dx[i] = x[n_ + i];
    dx[n_ + i] = sum;
    a_(free_[static_cast<std::size_t>(i)]) = sum;
  }
  if (has_set_valued_ && !linear_) hold_still(dx);
}

// Frictions that hold take what would move them.
void Predictor::hold_still(double* dx) {
  for (const Placed& law : laws_) {
    if (!law.is_set_valued || law.mode != Placed::Mode::kHolds) continue;
    const double along = dot(law.in, a_) / law.mobility;
    for (Index i = 0; i < n_; ++i) {
      dx[n_ + i] -= along * law.velocity_by(i);
      a_(free_[static_cast<std::size_t>(i)]) -= along * law.velocity_by(i);
    }
  }
}

double Predictor::rate_of(const Placed& law) const {
  double rate = 0.0;
  for (const auto& [at, coefficient] : law.in) {
    const Index slot = slot_[static_cast<std::size_t>(at)];
    rate += coefficient * (slot >= 0 ? x_(n_ + slot) : v_(at));
  }
  return rate;
}

double Predictor::level_of(const Placed& law, double direction, const double* inputs) const {
  double z = 0.0;
  if (law.driver >= 0) {
    z = inputs[law.driver];
  } else {
    for (const auto& [at, coefficient] : law.in) {
      const Index slot = slot_[static_cast<std::size_t>(at)];
      z += coefficient * (slot >= 0 ? x_(slot) : q_(at));
    }
  }
  const std::span<const double> state(x_.data() + law.first_state, law.states);
  return law.mobility * std::abs(law.law->force(z, std::copysign(kBarelyMoving, direction), state));
}

void Predictor::push(const Placed& law, double change) {
  x_.segment(n_, n_) += law.velocity_by * (change / law.mobility);
}

// What moves, slides on in its direction; what rests, holds where the other forces are below the
// level, and else breaks away in theirs.
void Predictor::choose_friction(const double* inputs) {
  if (!has_set_valued_ || linear_) return;
  bool any_rests = false;
  for (Placed& law : laws_) {
    if (!law.is_set_valued) continue;
    law.rate = rate_of(law);
    law.direction = law.rate > 0.0 ? 1.0 : -1.0;
    law.mode = law.rate != 0.0 ? Placed::Mode::kSlides : Placed::Mode::kUndecided;
    any_rests |= law.mode == Placed::Mode::kUndecided;
  }
  if (!any_rests) return;
  rates(x_.data(), inputs, slopes_.k1.data());
  for (Placed& law : laws_) {
    if (!law.is_set_valued || law.mode != Placed::Mode::kUndecided) continue;
    law.pull = dot(law.in, a_);  // acceleration without this friction
    law.direction = law.pull > 0.0 ? 1.0 : -1.0;
    const bool holds = std::abs(law.pull) <= level_of(law, law.direction, inputs);
    law.mode = holds ? Placed::Mode::kHolds : Placed::Mode::kSlides;
  }
}

// What came to rest within the step, or broke away in it: both where a velocity, or a force, that
// is straight within the step passes zero, or the level. So the end of a step depends on everything
// without jumps.
void Predictor::settle_friction(double step, const double* inputs) {
  if (!has_set_valued_ || linear_) return;
  bool any_holds = false;
  for (const Placed& law : laws_) {
    if (!law.is_set_valued) continue;
    any_holds |= law.mode == Placed::Mode::kHolds;
    if (law.mode != Placed::Mode::kSlides) continue;
    const double rate = rate_of(law);
    if (law.direction * rate >= 0.0) continue;
    const double crossed = law.rate / (law.rate - rate);  // share of the step
    const double back =
        (rate - law.rate) / step + 2.0 * law.direction * level_of(law, rate, inputs);
    const bool goes_back = law.direction * back < 0.0;
    push(law, (goes_back ? (1.0 - crossed) * step * back : 0.0) - rate);
  }
  if (any_holds) break_away(step, inputs);
}

void Predictor::break_away(double step, const double* inputs) {
  for (Placed& law : laws_) {
    if (law.mode == Placed::Mode::kHolds) law.mode = Placed::Mode::kUndecided;
  }
  rates(x_.data(), inputs, slopes_.k1.data());
  for (Placed& law : laws_) {
    if (!law.is_set_valued || law.mode != Placed::Mode::kUndecided) continue;
    const double pull = dot(law.in, a_);
    const double beyond = std::abs(pull) - level_of(law, pull, inputs);
    double change = -rate_of(law);  // rounding
    if (beyond > 0.0) {
      const double share = std::min(1.0, beyond / std::max(std::abs(pull - law.pull), 1e-300));
      change += std::copysign(0.5 * share * step * beyond, pull);
    }
    push(law, change);
  }
}

// The parabola through an input's three values within a step, at a share of it.
void Predictor::interpolate(const NodeInputs& drive, Index step, double share, Index column) {
  const auto start = drive.nodes.col(3 * step), middle = drive.nodes.col(3 * step + 1),
             end = drive.nodes.col(3 * step + 2);
  const double by_start = (1.0 - share) * (1.0 - 2.0 * share),
               by_middle = 4.0 * share * (1.0 - share), by_end = share * (2.0 * share - 1.0);
  substeps_.inputs.col(column) = by_start * start + by_middle * middle + by_end * end;
}

void Predictor::step(const NodeInputs& drive, Index step) {
  if (linear_) return advance(step_, no_inputs_.data(), no_inputs_.data(), no_inputs_.data());
  if (substeps_.count == 1) {
    return advance(step_, drive.nodes.col(3 * step).data(), drive.nodes.col(3 * step + 1).data(),
                   drive.nodes.col(3 * step + 2).data());
  }
  const double part = 1.0 / substeps_.count;
  for (int s = 0; s < substeps_.count; ++s) {
    for (Index node = 0; node < 3; ++node) {
      interpolate(drive, step, (s + 0.5 * static_cast<double>(node)) * part, node);
    }
    advance(step_ * part, substeps_.inputs.col(0).data(), substeps_.inputs.col(1).data(),
            substeps_.inputs.col(2).data());
  }
}

// By the classical method of Runge and Kutta.
void Predictor::advance(double h, const double* at_start, const double* at_middle,
                        const double* at_end) {
  choose_friction(at_start);
  rates(x_.data(), at_start, slopes_.k1.data());
  slopes_.trial = x_ + 0.5 * h * slopes_.k1;
  rates(slopes_.trial.data(), at_middle, slopes_.k2.data());
  slopes_.trial = x_ + 0.5 * h * slopes_.k2;
  rates(slopes_.trial.data(), at_middle, slopes_.k3.data());
  slopes_.trial = x_ + h * slopes_.k3;
  rates(slopes_.trial.data(), at_end, slopes_.k4.data());
  x_ += h / 6.0 * (slopes_.k1 + 2.0 * (slopes_.k2 + slopes_.k3) + slopes_.k4);
  settle_friction(h, at_end);
}

double Predictor::output_of(std::size_t output, const double* inputs) const {
  const LumpedOutput& what = outputs_[output];
  using enum LumpedOutput::Quantity;
  switch (what.quantity) {
    case kPosition:
      return q_(what.mass);
    case kVelocity:
      return v_(what.mass);
    case kAcceleration:
      return a_(what.mass);
    case kForce:  // that the imposed motion takes
      return mass_.row(what.mass).dot(a_) - force_(what.mass);
    case kElementForce: {
      const Placed& part = measured_[output];
      const double z = part.driver >= 0 ? inputs[part.driver] : dot(part.in, q_);
      return part.law->force(z, dot(part.in, v_), {});
    }
  }
  return 0.0;
}

void Predictor::sense(const double* inputs, std::vector<double>& followed) {
  if (needs_forces_) {
    spread(x_.data(), inputs);
    choose_friction(inputs);
    rates(x_.data(), inputs, slopes_.k1.data());
  } else {
    spread(x_.data(), inputs);
  }
  followed.clear();
  for (std::size_t j = 0; j < outputs_.size(); ++j) {
    double y = output_of(j, inputs);
    double& turned = turned_(static_cast<Index>(j)) = 1.0;
    for (const Sensor& sensor : sensors_[j]) {
      if (y < 0.0 && sensor.turned_below_zero < 0.0) turned = -turned;
      if (!sensor.law) {
        followed.push_back(y);
        y = after(sensor, y);
      } else if (!linear_) {
        y += sensor.law->force(sensor.driver >= 0 ? inputs[sensor.driver] : y, 0.0, {});
      }
    }
    y_(static_cast<Index>(j)) = y;
  }
}

// Late sensors read their registers, straight between samples.
void Predictor::delay() {
  kept_y_ = y_;
  for (std::size_t j = 0; j < late_.size(); ++j) {
    const Late& late = late_[j];
    if (late.length == 0) continue;
    const auto whole = static_cast<Index>(late.samples);
    const double part = late.samples - static_cast<double>(whole);
    const auto back = [&](Index samples) {
      return samples == 0 ? kept_y_(static_cast<Index>(j)) : x_(late.first + samples - 1);
    };
    y_(static_cast<Index>(j)) = (1.0 - part) * back(whole) + part * back(whole + 1);
  }
}

void Predictor::shift_registers() {
  for (std::size_t j = 0; j < late_.size(); ++j) {
    const Late& late = late_[j];
    for (Index k = late.length - 1; k > 0; --k) x_(late.first + k) = x_(late.first + k - 1);
    if (late.length > 0) x_(late.first) = kept_y_(static_cast<Index>(j));
  }
}

void Predictor::follow_lags() {
  std::size_t next = 0;
  for (const auto& list : sensors_) {
    for (const Sensor& sensor : list) {
      if (sensor.law) continue;
      follow(sensor, followed_before_[next], followed_[next]);
      ++next;
    }
  }
}

// From the corrected state at a sample to the next one. x_, kept_y_ and followed_before_ are of
// now. An acceleration jumps where a held input does, so the end of a step is not the sample there.
void Predictor::between_samples(const NodeInputs& drive, Index sample) {
  for (Index s = 0; s < steps_; ++s) {
    const Index at = sample * steps_ + s;
    step(drive, at);
    if (followed_before_.empty()) continue;
    const double* at_end = linear_ ? no_inputs_.data() : drive.nodes.col(3 * at + 2).data();
    sense(at_end, followed_);
    follow_lags();
    sense(at_end, followed_before_);  // the lags' outputs
  }
  shift_registers();
  if (disturbance_state_ >= 0) x_(disturbance_state_) *= disturbance_kept_;
}

void Predictor::start(const VectorXd& initial, const double* inputs) {
  x_.setZero();
  x_.head(2 * n_) = initial;
  spread(x_.data(), inputs);
  for (const Placed& law : laws_) {
    if (law.states > 0) law.law->rest(dot(law.in, q_), {x_.data() + law.first_state, law.states});
  }
  // Lags and registers as if the first output had been there before: in order, since one may follow
  // another.
  for (std::size_t pass = 0; pass < 2; ++pass) {
    sense(inputs, followed_before_);
    std::size_t next = 0;
    for (const auto& list : sensors_) {
      for (const Sensor& sensor : list) {
        if (sensor.law) continue;
        const double signal = followed_before_[next++];
        const double w =
            sensor.resonance.empty() ? 1.0 : 2.0 * std::numbers::pi * sensor.resonance[1];
        x_(sensor.state) = signal / (w * w);
      }
    }
  }
  sense(inputs, followed_before_);
  for (std::size_t j = 0; j < late_.size(); ++j) {
    x_.segment(late_[j].first, late_[j].length).setConstant(y_(static_cast<Index>(j)));
  }
}

void Predictor::correct(const Eigen::MatrixXd& gain) {
  for (Index j = 0; j < error_.size(); ++j) {
    const double error = turned_(j) * error_(j);
    for (Index i = 0; i < states_; ++i) x_(i) += gain(i, j) * error;
  }
}

void Predictor::store_states(Index sample, const double* inputs, Eigen::MatrixXd& states) {
  spread(x_.data(), inputs);
  states.row(sample).head(m_) = q_;
  states.row(sample).tail(m_) = v_;
}

bool Predictor::advance(const Recorded& recorded, Index from, Index to) {
  const Eigen::MatrixXd& outputs = *recorded.outputs;
  for (Index k = from; k < to; ++k) {
    const double* inputs = recorded.drive->samples.col(k).data();
    sense(inputs, followed_before_);
    delay();
    error_ = outputs.row(k).transpose() - y_;
    if (!(error_.cwiseAbs().maxCoeff() < kOutOfBounds)) return false;
    if (recorded.errors != nullptr) recorded.errors->row(k) = error_.transpose();
    if (recorded.gain != nullptr && recorded.gain->size() > 0) correct(*recorded.gain);
    if (recorded.states != nullptr) store_states(k, inputs, *recorded.states);
    if (k + 1 == outputs.rows()) break;
    sense(inputs, followed_before_);  // after the correction
    kept_y_ = y_;
    between_samples(*recorded.drive, k);
  }
  return true;
}

void Predictor::remember() {
  remembered_x_ = x_;
  remembered_y_ = kept_y_;
  remembered_followed_ = followed_before_;
}

void Predictor::return_to_remembered() {
  x_ = remembered_x_;
  kept_y_ = remembered_y_;
  followed_before_ = remembered_followed_;
}

bool Predictor::run(const NodeInputs& drive, const Eigen::MatrixXd& outputs,
                    const Forecasts& forecasts, const Eigen::MatrixXd& gain,
                    const VectorXd& initial, Eigen::MatrixXd& errors, Eigen::MatrixXd* states) {
  const Index samples = outputs.rows(), horizon = forecasts.horizon;
  errors.resize(samples, output_count());
  if (states != nullptr) states->resize(samples, 2 * m_);
  start(initial, drive.samples.col(0).data());
  const Recorded forecast{&drive, &outputs, nullptr, &errors, nullptr};
  if (horizon == 0) return advance({&drive, &outputs, nullptr, &errors, states}, 0, samples);
  const bool is_filter_alone = horizon == 1;  // its errors are the forecasts'
  const Index first = is_filter_alone ? samples : std::min(forecasts.first, samples);
  if (!advance({&drive, &outputs, &gain, &errors, states}, 0, first)) return false;
  Index number = 0;
  for (Index from = first; from < samples; from += horizon, ++number) {
    const Index to = std::min(from + horizon, samples);
    if (forecasts.skips(number)) {
      errors.middleRows(from, to - from).setZero();
    } else {
      remember();
      if (!advance(forecast, from, to)) return false;
      const bool is_last = to == samples;
      if (is_last && states == nullptr) break;
      return_to_remembered();
    }
    if (!advance({&drive, &outputs, &gain, nullptr, states}, from, to)) return false;
  }
  return true;
}

void Predictor::linear_step(VectorXd& state, Index pushed, double force) {
  linear_ = true;
  pushed_ = pushed;
  push_ = force;
  x_ = state;
  sense(no_inputs_.data(), followed_before_);
  kept_y_ = y_;
  const NodeInputs none;
  between_samples(none, 0);
  state = x_;
  linear_ = false;
  pushed_ = -1;
}

void Predictor::linear_outputs(const VectorXd& state, VectorXd& outputs) {
  linear_ = true;
  x_ = state;
  sense(no_inputs_.data(), followed_);
  delay();
  outputs = y_;
  linear_ = false;
}

}  // namespace graybox
