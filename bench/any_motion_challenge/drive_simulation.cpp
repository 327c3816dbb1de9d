#include "bench/any_motion_challenge/drive_simulation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <stdexcept>

#include "bench/any_motion_challenge/stiff_integrator.hpp"
#include "diagnosis/simulation/plant.hpp"

namespace graybox::bench {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using State = StiffIntegrator::State;

// ---- the machine in continuous time -------------------------------------------------------------

class Machine {
 public:
  Machine(const AnyMotionSystem& system, const std::vector<Element>& elements)
      : system_(&system), dynamics_(system.dynamics(system.true_values())) {
    state_count_ = 2 * system.mass_count();
    sensor_delays_.assign(system.outputs().size(), 0.0);
    for (const Element& element : elements) add(element);
    if (state_count_ > kMostStates) throw std::logic_error("too many states");
  }

  [[nodiscard]] State start() const {
    State state = State::Zero(state_count_);
    for (const Part& part : parts_) part.element->law->rest(0.0, states_of(state, part));
    return state;
  }

  [[nodiscard]] double actuator_delay() const { return actuator_delay_; }
  [[nodiscard]] double sensor_delay(std::size_t output) const { return sensor_delays_[output]; }

  void rate(const State& state, double torque, double force_noise, State& change) const {
    const Index n = system_->mass_count();
    const auto position = state.head(n), velocity = state.segment(n, n);
    change.setZero();
    change.head(n) = velocity;
    auto force = change.segment(n, n);
    force = -dynamics_.stiffness * position - dynamics_.damping * velocity;
    force(n - 1) += force_noise;
    for (const Part& part : parts_) {
      const Location& place = part.element->location;
      const Law& law = *part.element->law;
      double z = torque, z_rate = 0.0;
      if (place.kind == LocationKind::kSensor) {
        z = read(state, static_cast<std::size_t>(place.channel));
      } else if (place.kind == LocationKind::kElement) {
        z = place.input.dot(position);
        z_rate = place.input.dot(velocity);
      }
      const auto own = states_of(state, part);
      if (place.kind == LocationKind::kActuator) torque += law.force(z, 0.0, own);
      if (place.kind == LocationKind::kElement) force -= law.force(z, z_rate, own) * place.output;
      if (part.count > 0) law.state_rate(z, z_rate, own, states_of(change, part));
    }
    force(0) += torque;
    force.array() /= dynamics_.masses.array();
  }

  // What a sensor reads now, but for its delay.
  [[nodiscard]] double sensed(const State& state, std::size_t output) const {
    double value = read(state, output);
    for (const Part& part : parts_) {
      const Location& place = part.element->location;
      if (place.kind != LocationKind::kSensor || place.channel != static_cast<Index>(output)) {
        continue;
      }
      value += part.element->law->force(value, 0.0, states_of(state, part));
    }
    return value;
  }
  // Its slope; of sensors without laws.
  [[nodiscard]] double sensed_slope(const State& change, std::size_t output) const {
    return read(change, output);
  }

 private:
  struct Part {
    const Element* element = nullptr;
    Index first = 0, count = 0;  // states
  };

  void add(const Element& element) {
    const Location& place = element.location;
    if (element.use == LawUse::kDelay) {
      if (place.kind == LocationKind::kActuator) {
        actuator_delay_ += element.parameters[0];
      } else {
        sensor_delays_[static_cast<std::size_t>(place.channel)] += element.parameters[0];
      }
      return;
    }
    if (!element.law) throw std::logic_error("an element without a law");
    const auto count = static_cast<Index>(element.law->state_count());
    parts_.push_back({&element, state_count_, count});
    state_count_ += count;
  }

  // Position or velocity; of a rate of the state their rates.
  [[nodiscard]] double read(const State& state, std::size_t output) const {
    const DriveOutput& sensor = system_->outputs()[output];
    return state(sensor.mass + (sensor.is_velocity ? system_->mass_count() : 0));
  }

  [[nodiscard]] static std::span<const double> states_of(const State& state, const Part& part) {
    return {state.data() + part.first, static_cast<std::size_t>(part.count)};
  }
  [[nodiscard]] static std::span<double> states_of(State& state, const Part& part) {
    return {state.data() + part.first, static_cast<std::size_t>(part.count)};
  }

  const AnyMotionSystem* system_;
  DriveDynamics dynamics_;
  std::vector<Part> parts_;
  Index state_count_ = 0;
  double actuator_delay_ = 0.0;
  std::vector<double> sensor_delays_;
};

// ---- late sensors -------------------------------------------------------------------------------

// The motion of a sensor so far, piece by piece.
class SensorHistory {
 public:
  void add(double from, double to, std::array<double, 2> values, std::array<double, 2> slopes) {
    pieces_.push_back({from, to, values, slopes});
  }

  // At a time that it covers, or before its start, where the machine stands. Forgets what is
  // earlier: times don't fall.
  [[nodiscard]] double at(double time) {
    while (pieces_.size() > 1 && pieces_.front().to < time) pieces_.pop_front();
    if (pieces_.empty() || time <= pieces_.front().from) {
      return pieces_.empty() ? 0.0 : pieces_.front().values[0];
    }
    const Piece& piece = pieces_.front();
    const double length = piece.to - piece.from, s = (time - piece.from) / length;
    const double rest = 1.0 - s;
    return (1.0 + 2.0 * s) * rest * rest * piece.values[0] +
           s * rest * rest * length * piece.slopes[0] + s * s * (3.0 - 2.0 * s) * piece.values[1] -
           s * s * rest * length * piece.slopes[1];
  }

 private:
  struct Piece {
    double from, to;
    std::array<double, 2> values, slopes;
  };
  std::deque<Piece> pieces_;
};

// ---- the controller -----------------------------------------------------------------------------

class SampledController {
 public:
  explicit SampledController(const DriveController& gains) : gains_(gains) {}

  double torque(double reference, double measured) {
    const double error = reference - measured;
    if (gains_.of_speed) return of_speed(error);
    constexpr double kFilter = 0.004;  // s
    const double share = kAnyMotionSampleTime / (kAnyMotionSampleTime + kFilter);
    rate_ += share * ((measured - before_) / kAnyMotionSampleTime - rate_);
    before_ = measured;
    return limited(gains_.proportional * error - gains_.derivative * rate_);
  }

 private:
  [[nodiscard]] double limited(double torque) const {
    return std::clamp(torque, -gains_.limit, gains_.limit);
  }
  double of_speed(double error) {
    const double wanted =
        gains_.proportional * error + integral_ + gains_.integral * kAnyMotionSampleTime * error;
    const double torque = limited(wanted);
    if (torque == wanted) integral_ += gains_.integral * kAnyMotionSampleTime * error;
    return torque;
  }

  DriveController gains_;
  double rate_ = 0.0, before_ = 0.0, integral_ = 0.0;
};

// ---- the loop -----------------------------------------------------------------------------------

class DriveRun {
 public:
  DriveRun(const AnyMotionSystem& system, const std::vector<Element>& elements,
           const DriveNoise* noise)
      : system_(&system),
        machine_(system, elements),
        noise_(noise),
        random_(noise != nullptr ? noise->seed : 1),
        integrator_({1e-7, 1e-9}),
        state_(machine_.start()),
        histories_(system.outputs().size()) {
    if (noise != nullptr) force_ = noise->force * random_.normal();
  }

  [[nodiscard]] DriveRecording run(const PlannedMotion& motion, const VectorXd& reference,
                                   const std::function<bool()>& keep_going) {
    const Index samples = reference.size(), n = system_->mass_count();
    const auto outputs = static_cast<Index>(system_->outputs().size());
    DriveRecording recording{sample_times(samples), VectorXd(samples),
                             Eigen::MatrixXd(samples, outputs), Eigen::MatrixXd(samples, n),
                             Eigen::MatrixXd(samples, n)};
    SampledController controller(system_->controller());
    const Index watched = system_->controller().of_speed ? n : 0;
    for (Index k = 0; k < samples; ++k) {
      if (k % 256 == 0 && keep_going && !keep_going()) return {};
      now_ = recording.time(k);
      recording.position.row(k) = state_.head(n).transpose();
      recording.velocity.row(k) = state_.segment(n, n).transpose();
      for (Index i = 0; i < outputs; ++i) recording.output(k, i) = measured(i);
      if (!(std::abs(state_(watched)) < 100.0 * motion.amplitude)) {
        throw UnstableMotion("the motion leaves all bounds");
      }
      recording.input(k) = controller.torque(reference(k), recording.output(k, 0));
      pending_.emplace_back(now_ + machine_.actuator_delay(), recording.input(k));
      if (k + 1 < samples) move_to(recording.time(k + 1));
    }
    return recording;
  }

 private:
  [[nodiscard]] VectorXd sample_times(Index samples) {
    VectorXd times(samples);
    for (Index k = 0; k < samples; ++k) {
      const double jitter = noise_ != nullptr && k > 0
                                ? system_->jitter() * std::clamp(random_.normal(), -2.5, 2.5)
                                : 0.0;
      times(k) = (static_cast<double>(k) + jitter) * kAnyMotionSampleTime;
    }
    return times;
  }

  [[nodiscard]] double measured(Index output) {
    const auto i = static_cast<std::size_t>(output);
    const DriveOutput& sensor = system_->outputs()[i];
    const double delay = machine_.sensor_delay(i);
    double value = delay > 0.0 ? histories_[i].at(now_ - delay) : machine_.sensed(state_, i);
    if (noise_ == nullptr) return value;
    if (sensor.white_noise > 0.0) value += sensor.white_noise * random_.normal();
    return sensor.quantum > 0.0 ? sensor.quantum * std::round(value / sensor.quantum) : value;
  }

  // Through one sample, with a stop wherever a late torque arrives.
  void move_to(double end) {
    while (!pending_.empty() && pending_.front().first < end - 1e-12) {
      advance_to(pending_.front().first);
      torque_ = pending_.front().second;
      pending_.pop_front();
    }
    advance_to(end);
    if (noise_ == nullptr) return;
    const double keep = std::exp(-kAnyMotionSampleTime / system_->force_noise_memory());
    force_ = keep * force_ + noise_->force * std::sqrt(1.0 - keep * keep) * random_.normal();
  }

  void advance_to(double end) {
    if (end <= now_ + 1e-12) return;
    const auto rate = [this](const State& state, State& change) {
      machine_.rate(state, torque_, force_, change);
    };
    const State before = state_;
    integrator_.advance(rate, end - now_, state_);
    for (std::size_t i = 0; i < histories_.size(); ++i) {
      if (machine_.sensor_delay(i) <= 0.0) continue;
      State first(state_.size()), last(state_.size());
      rate(before, first);
      rate(state_, last);
      histories_[i].add(now_, end, {machine_.sensed(before, i), machine_.sensed(state_, i)},
                        {machine_.sensed_slope(first, i), machine_.sensed_slope(last, i)});
    }
    now_ = end;
  }

  const AnyMotionSystem* system_;
  Machine machine_;
  const DriveNoise* noise_;
  Random random_;
  StiffIntegrator integrator_;
  State state_;
  std::vector<SensorHistory> histories_;
  std::deque<std::pair<double, double>> pending_;  // when each torque arrives
  double now_ = 0.0, torque_ = 0.0, force_ = 0.0;
};

}  // namespace

double root_mean_square(const VectorXd& values) {
  return values.size() > 0 ? values.norm() / std::sqrt(static_cast<double>(values.size())) : 0.0;
}

DriveRecording simulate_drive(const AnyMotionSystem& system, const std::vector<Element>& elements,
                              std::size_t index, std::uint64_t seed, const DriveNoise* noise,
                              const std::function<bool()>& keep_going) {
  const PlannedMotion& motion = system.plan()[index];
  Random random(derived_seed(seed, {2, index}));
  const VectorXd reference = motion.amplitude * motion_reference(motion.kind, motion.samples,
                                                                 kAnyMotionSampleTime, random);
  return DriveRun(system, elements, noise).run(motion, reference, keep_going);
}

}  // namespace graybox::bench
