#include "diagnosis/harmonic_balance/steady_state.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "diagnosis/harmonic_balance/anderson_mixing.hpp"
#include "diagnosis/harmonic_balance/real_products.hpp"
#include "problems/base/array_index.hpp"
#include "problems/base/stop.hpp"
#include "problems/mechanisms/frequency_response.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

std::size_t grid_of(const SteadyStateOptions& options, Index lines) {
  const double least = options.oversampling * static_cast<double>(lines + 1);
  return fast_grid(
      static_cast<std::size_t>(std::max(least, std::min(4.0 * least, options.grid_points))));
}

}  // namespace

SteadyStateSolver::SteadyStateSolver(const PlantFamily& family, const PeriodicData& data,
                                     const SteadyStateOptions& options)
    : family_(family),
      data_(data),
      options_(options),
      lines_(data.last_line),
      static_scale_(std::sqrt(static_cast<double>(data.period))),
      transform_(data.period, lines_, grid_of(options, lines_)),
      samples_(data.period),
      own_transform_(data.period, lines_, fast_grid(2 * at(lines_) + 2)) {
  motion_.step =
      static_cast<double>(data.period) * data.sample_time / static_cast<double>(transform_.grid());
}

// ---- the equation -------------------------------------------------------------------------------

void SteadyStateSolver::list_laws(const ModelState& model) {
  force_laws_.clear();
  for (std::size_t l = 0; l < model.laws.size(); ++l) {
    const ActingLaw& law = model.laws[l];
    if (law.place->location.kind != LocationKind::kElement || is_body(*law.place, *law.entry)) {
      continue;
    }
    force_laws_.push_back({l, &law.place->location, PeriodicLaw(*law.entry, law.parameters)});
  }
}

bool is_settled(double unsettled, double chi_square, double numbers) {
  constexpr double kUnsettled = 0.1;
  return unsettled <= kUnsettled * std::sqrt(std::max(1.0, chi_square / numbers));
}

const SteadyState& SteadyStateSolver::solve(const ModelState& model, const MeasuredRecord& record,
                                            const MatrixXcd* start) {
  model_ = &model;
  position_ = &model.positions[record.position];
  list_laws(model);
  drive(model, record);
  const Index n = position_->plant.mass.rows();
  const auto laws = static_cast<Index>(force_laws_.size());
  own_ = MatrixXcd::Zero(n, lines_ + 1);
  state_.forces = MatrixXcd::Zero(lines_ + 1, laws);
  state_.changed.clear();
  state_.unsettled = 0.0;
  find_own_forces(model, record.position);
  assemble();
  settle_own_force(record);
  couple_laws();
  if (laws == 0) {
    measure(record);
    return state_;
  }
  measure(record);
  if (start != nullptr && start->cols() == laws) {
    state_.forces = *start;
  } else {
    virtual_forces();
  }
  settle_means(record);
  iterate(record);
  change_receptance();
  measure(record);
  return state_;
}

VectorXcd SteadyStateSolver::let_act(const ModelState& model, const MeasuredRecord& record,
                                     const Location& place) {
  constexpr int kPasses = 3;
  VectorXcd force = VectorXcd::Zero(lines_ + 1);
  MatrixXcd sight;
  for (int pass = 0; pass < kPasses; ++pass) {
    answer(model, record, place.output, sight);
    for (Index k = data_.first_line; k <= lines_; ++k) {
      const double gain = sight.col(k).squaredNorm();
      if (!(gain > 0.0)) continue;
      const Complex more = -sight.col(k).dot(state_.residual.col(k)) / gain;
      force(k) += more;
      driven_.col(k).noalias() -= position_->receptance[at(k)] * (more * place.output);
    }
    assemble();
    settle_own_force(record);
    if (!force_laws_.empty()) {
      iterate(record);
      change_receptance();
    }
    measure(record);
  }
  return force;
}

// Inputs behind the actuators' laws, and what they alone do.
void SteadyStateSolver::drive(const ModelState& model, const MeasuredRecord& record) {
  const LinearPlant& plant = position_->plant;
  input_ = record.input;
  VectorXcd added;
  std::map<Index, std::vector<PeriodicLaw>> filters;  // of each channel
  for (const ActingLaw& law : model.laws) {
    const Location& place = law.place->location;
    if (place.kind != LocationKind::kActuator) continue;
    const PeriodicLaw periodic(*law.entry, law.parameters);
    if (periodic.is_linear()) filters[place.channel].push_back(periodic);
    signal_lines(periodic, record, plant, place.channel, added);
    input_.row(place.channel) += added.transpose();
  }
  imaged_.setZero(plant.velocity_output.rows(), lines_ + 1);
  for (Index k = 1; k <= lines_; ++k) {
    imaged_.col(k).noalias() = position_->images[at(k)] * input_.col(k);
  }
  for (const auto& [channel, laws] : filters) {
    const auto filter = [&laws = laws](double w) {
      Complex factor = 1.0;
      for (const PeriodicLaw& law : laws) factor *= 1.0 + *law.response(w);
      return factor;
    };
    for (Index k = 1; k <= lines_; ++k) {
      const double w = data_.frequencies[at(k)];
      imaged_.col(k) +=
          position_->held_images->filtered(channel, w, filter) * (input_(channel, k) / filter(w)) -
          position_->images[at(k)].col(channel) * input_(channel, k);
    }
  }
  driven_.resize(plant.mass.rows(), lines_ + 1);
  for (Index k = 0; k <= lines_; ++k) {
    const Complex hold = k == 0 ? 1.0 : hold_factor(data_.frequencies[at(k)], data_.sample_time);
    const VectorXcd force = plant.input * (hold * input_.col(k));
    driven_.col(k).noalias() = position_->receptance[at(k)] * force;
  }
  // On average the held coordinates stand off, and the others follow: as their springs say, and
  // those without one (but a law may join them) like the held ones on average.
  if (record.mean_offset.size() > 0) {
    VectorXcd offset =
        VectorXcd::Constant(plant.mass.rows(), static_scale_ * record.mean_offset.mean());
    Index next = 0;
    for (Index i = 0; i < offset.size(); ++i) {
      if (plant.held[at(i)]) offset(i) = static_scale_ * record.mean_offset(next++);
    }
    driven_.col(0) += offset - position_->receptance[0] * (plant.stiffness * offset);
  }
  sight_.resize(at(lines_ + 1));
  for (Index k = data_.first_line; k <= lines_; ++k) {
    sight_[at(k)].noalias() = data_.whitening[record.group][at(k)] * position_->sight[at(k)];
  }
  carry_laws(plant);
}

void SteadyStateSolver::carry_laws(const LinearPlant& plant) {
  // D^-1 b_out of each law, what the sensors see of it, and D^-T b_in.
  carried_.resize(force_laws_.size());
  seen_.resize(force_laws_.size());
  heard_.resize(force_laws_.size());
  for (std::size_t l = 0; l < force_laws_.size(); ++l) {
    carried_[l].setZero(plant.mass.rows(), lines_ + 1);
    heard_[l].setZero(plant.mass.rows(), lines_ + 1);
    seen_[l].setZero(plant.velocity_output.rows(), lines_ + 1);
    const VectorXd& b = force_laws_[l].place->output;
    const VectorXd& input = force_laws_[l].place->input;
    for (Index k = 0; k <= lines_; ++k) {
      const MatrixXcd& receptance = position_->receptance[at(k)];
      for (Index i = 0; i < b.size(); ++i) {
        if (b(i) != 0.0) carried_[l].col(k) += b(i) * receptance.col(i);
        if (input(i) != 0.0) heard_[l].col(k) += input(i) * receptance.row(i).transpose();
        if (b(i) != 0.0 && k >= data_.first_line) {
          seen_[l].col(k) += b(i) * sight_[at(k)].col(i);
        }
      }
    }
  }
}

// r of each line, and what forces weigh.
void SteadyStateSolver::couple_laws() {
  const auto laws = static_cast<Index>(force_laws_.size());
  between_.resize(at(lines_ + 1));
  weight_.resize(lines_ + 1, laws);
  for (Index k = 0; k <= lines_; ++k) {
    between_[at(k)].resize(laws, laws);
    for (Index l = 0; l < laws; ++l) {
      const VectorXd& input = force_laws_[at(l)].place->input;
      for (Index m = 0; m < laws; ++m) {
        between_[at(k)](l, m) = input.cast<Complex>().dot(carried_[at(m)].col(k));
      }
      weight_(k, l) = seen_[at(l)].col(k).norm();
    }
  }
  // Lines that do not count, the mean among them, weigh as the next that does.
  for (Index k = data_.first_line - 1; k >= 0; --k) weight_.row(k) = weight_.row(k + 1);
}

void SteadyStateSolver::find_own_forces(const ModelState& model, std::size_t position) {
  if (own_forces_of_ != model.version) {
    own_forces_.clear();
    own_forces_of_ = model.version;
  }
  auto found = own_forces_.find(position);
  if (found == own_forces_.end()) {
    found = own_forces_.emplace(position, family_.own_force(position_->plant, model.bodies)).first;
  }
  own_force_ = found->second.get();
}

// The model's own force at the present coordinates, which follow; returns how far they moved
// (size_in_noise).
double SteadyStateSolver::renew_own_force(const MeasuredRecord& record) {
  if (own_force_ == nullptr) return 0.0;
  const Index n = position_->plant.mass.rows(), grid = own_transform_.grid();
  MatrixXd q(n, grid), velocity(n, grid), acceleration(n, grid), force;
  VectorXcd spectrum(lines_ + 1);
  VectorXd times(grid);
  for (Index i = 0; i < n; ++i) {
    spectrum = state_.coordinates.row(i).transpose();
    for (MatrixXd* target : {&q, &velocity, &acceleration}) {
      own_transform_.to_times(spectrum, times);
      target->row(i) = times.transpose();
      for (Index k = 0; k <= lines_; ++k) spectrum(k) *= Complex(0.0, data_.frequencies[at(k)]);
    }
  }
  own_force_->evaluate(q, velocity, acceleration, force);
  MatrixXcd force_lines(n, lines_ + 1);
  for (Index i = 0; i < n; ++i) {
    times = force.row(i).transpose();
    own_transform_.to_lines(times, spectrum);
    force_lines.row(i) = spectrum.transpose();
  }
  MatrixXcd change = -own_;
  for (Index k = 0; k <= lines_; ++k) {
    own_.col(k).noalias() = position_->receptance[at(k)] * force_lines.col(k);
  }
  change += own_;
  state_.coordinates += change;
  return size_of_motion(record, change);
}

// Without laws, or with the laws' forces held: substitution, and where that is slow or runs away,
// near a mode that is hardly damped, Anderson's mixing of the last passes by the change of the
// outputs in noise units.
void SteadyStateSolver::settle_own_force(const MeasuredRecord& record) {
  constexpr int kPlainPasses = 4;
  AndersonMixing passes(6);
  for (int pass = 0; pass < options_.iteration_limit; ++pass) {
    MatrixXcd change = state_.coordinates;
    state_.unsettled = renew_own_force(record);
    if (!(state_.unsettled > options_.tolerance)) return;
    change = state_.coordinates - change;
    passes.add(state_.coordinates, seen_motion(record, change));
    if (pass < kPlainPasses) continue;
    const MatrixXcd mixture = passes.mixed();
    own_ += mixture - state_.coordinates;
    state_.coordinates = mixture;
  }
}

// What coordinates do to the whitened outputs.
VectorXcd SteadyStateSolver::seen_motion(const MeasuredRecord& record,
                                         const MatrixXcd& coordinates) const {
  const LinearPlant& plant = position_->plant;
  const Index outputs = plant.velocity_output.rows();
  VectorXcd seen(outputs * data_.line_count());
  Index next = 0;
  for (Index k = data_.first_line; k <= lines_; ++k, next += outputs) {
    const Complex rate(0.0, data_.frequencies[at(k)]);
    seen.segment(next, outputs) = data_.whitening[record.group][at(k)] *
                                  (plant.position_output * coordinates.col(k) +
                                   rate * (plant.velocity_output * coordinates.col(k)));
  }
  return seen;
}

// Its rms.
double SteadyStateSolver::size_of_motion(const MeasuredRecord& record,
                                         const MatrixXcd& coordinates) const {
  const VectorXcd seen = seen_motion(record, coordinates);
  return seen.norm() / std::sqrt(2.0 * static_cast<double>(seen.size()));
}

void SteadyStateSolver::assemble() {
  state_.coordinates = driven_ + own_;
  for (std::size_t l = 0; l < force_laws_.size(); ++l) {
    state_.coordinates -= carried_[l] * state_.forces.col(static_cast<Index>(l)).asDiagonal();
  }
}

VectorXcd SteadyStateSolver::deflection_of(const Location& place) const {
  VectorXcd z = state_.coordinates.transpose() * place.input.cast<Complex>();
  z(0) += static_scale_ * place.input.dot(position_->plant.rest);
  return z;
}

// Forces that explain the residuals, from which measure() has just been left without them.
void SteadyStateSolver::virtual_forces() {
  const auto laws = static_cast<Index>(force_laws_.size());
  MatrixXcd seen(state_.residual.rows(), laws);
  for (Index k = data_.first_line; k <= lines_; ++k) {
    for (Index l = 0; l < laws; ++l) seen.col(l) = seen_[at(l)].col(k);
    MatrixXcd gram = seen.adjoint() * seen;
    const double ridge = 1e-9 * gram.diagonal().real().maxCoeff() + 1e-300;
    gram.diagonal().array() += ridge;
    const MatrixXcd covariance = 2.0 * gram.inverse();
    const VectorXcd estimate = -0.5 * covariance * (seen.adjoint() * state_.residual.col(k));
    for (Index l = 0; l < laws; ++l) {
      const double power = std::norm(estimate(l));
      const double noise = covariance(l, l).real();
      state_.forces(k, l) = power > noise ? estimate(l) * (1.0 - noise / power) : 0.0;
    }
  }
}

// What the laws hold on average. No line of the recordings shows it, but the arm hangs elsewhere
// under it, and moves otherwise there: the iteration must not start at another place.
void SteadyStateSolver::settle_means(const MeasuredRecord& record) {
  constexpr int kPasses = 4;
  constexpr double kSmall = 1e-6;
  MatrixXcd renewed;
  for (int pass = 0; pass < kPasses; ++pass) {
    assemble();
    renew_forces(renewed);
    const VectorXcd error = (renewed.row(0) - state_.forces.row(0)).transpose();
    const VectorXcd change = mean_solution_.front() * error;
    if (!change.allFinite()) break;
    state_.forces.row(0) += change.transpose();
    if (change.norm() <= kSmall * state_.forces.row(0).norm()) break;
  }
  assemble();
  settle_own_force(record);
}

// law(z) of each law, with its slopes.
void SteadyStateSolver::renew_forces(MatrixXcd& renewed) {
  renewed.resize(lines_ + 1, static_cast<Index>(force_laws_.size()));
  state_.slopes.resize(renewed.rows(), renewed.cols());
  VectorXcd force;
  for (std::size_t l = 0; l < force_laws_.size(); ++l) {
    const auto column = static_cast<Index>(l);
    ForceLaw& law = force_laws_[l];
    const VectorXcd z = deflection_of(*law.place);
    double stiffness = 0.0, damping = 0.0;
    if (!law.periodic.is_linear()) {
      motion_of(z, motion_);
      law.periodic.linearise(motion_, law.tangent);
      if (law.periodic.has_states()) {
        std::tie(stiffness, damping) = law.periodic.describing_slopes(motion_);
      } else {
        stiffness = law.tangent.by_deflection.mean();
        damping = law.tangent.by_rate.mean();
      }
    }
    force_lines(law.periodic, z, motion_, force);
    renewed.col(column) = force;
    for (Index k = 0; k <= lines_; ++k) {
      const double w = data_.frequencies[at(k)];
      state_.slopes(k, column) =
          law.periodic.is_linear() ? *law.periodic.response(w) : Complex(stiffness, w * damping);
    }
  }
  factor_mean_slopes();
}

void SteadyStateSolver::factor_mean_slopes() {
  const Index laws = state_.slopes.cols();
  mean_solution_.resize(at(lines_ + 1));
  for (Index k = 0; k <= lines_; ++k) {
    MatrixXcd matrix = state_.slopes.row(k).transpose().asDiagonal() * between_[at(k)];
    matrix.diagonal().array() += 1.0;
    mean_solution_[at(k)] =
        laws == 1 ? MatrixXcd(matrix.cwiseInverse()) : MatrixXcd(matrix.inverse());
  }
}

void SteadyStateSolver::precondition(MatrixXcd& change) const {
  multiply_lines(mean_solution_, change);
}

// Each line's laws by the matrix of that line, without a temporary for each.
void SteadyStateSolver::multiply_lines(const std::vector<MatrixXcd>& matrices,
                                       MatrixXcd& values) const {
  if (values.cols() == 1) {
    for (Index k = 0; k <= lines_; ++k) values(k, 0) *= matrices[at(k)](0, 0);
    return;
  }
  VectorXcd before(values.cols()), after(values.cols());
  for (Index k = 0; k <= lines_; ++k) {
    before = values.row(k).transpose();
    after.noalias() = matrices[at(k)].lazyProduct(before);
    values.row(k) = after.transpose();
  }
}

void SteadyStateSolver::apply_slopes(const MatrixXcd& deflections, MatrixXcd& forces) {
  forces.resize(deflections.rows(), deflections.cols());
  VectorXcd force(lines_ + 1);
  for (std::size_t l = 0; l < force_laws_.size(); ++l) {
    const auto column = static_cast<Index>(l);
    const ForceLaw& law = force_laws_[l];
    if (law.periodic.is_linear()) {
      forces.col(column) = state_.slopes.col(column).cwiseProduct(deflections.col(column));
      continue;
    }
    motion_of(deflections.col(column), motion_);
    law.tangent.apply(motion_, times_);
    transform_.to_lines(times_, force);
    forces.col(column) = force;
  }
}

void SteadyStateSolver::apply_equation(const MatrixXcd& forces, MatrixXcd& result) {
  deflections_ = forces;
  multiply_lines(between_, deflections_);
  apply_slopes(deflections_, result);
  result += forces;
}

double SteadyStateSolver::product(const MatrixXcd& a, const MatrixXcd& b) const {
  return (weight_.array().square() *
          (a.real().array() * b.real().array() + a.imag().array() * b.imag().array()))
      .sum();
}

// GMRES, preconditioned from the right, in the real inner product of noise units: the equation is
// linear over real numbers only.
void SteadyStateSolver::solve_equation(MatrixXcd& forces, bool exact) {
  const bool is_line_by_line = std::ranges::all_of(
      force_laws_, [](const ForceLaw& law) { return law.periodic.is_linear(); });
  if (!exact || is_line_by_line) {
    precondition(forces);
    return;
  }
  constexpr double kAccuracy = 1e-3;
  const bool remembers = std::ranges::any_of(
      force_laws_, [](const ForceLaw& law) { return law.periodic.has_states(); });
  const Index limit = remembers ? options_.subspace_with_memory : options_.subspace;
  const double size = std::sqrt(product(forces, forces));
  if (!(size > 0.0)) return;
  std::vector<MatrixXcd> basis{forces / size};
  MatrixXd hessenberg = MatrixXd::Zero(limit + 1, limit);
  VectorXd mix;
  MatrixXcd next;
  Index used = 0;
  for (; used < limit;) {
    MatrixXcd direction = basis[at(used)];
    precondition(direction);
    apply_equation(direction, next);
    for (int pass = 0; pass < 2; ++pass) {
      for (Index i = 0; i <= used; ++i) {
        const double share = product(basis[at(i)], next);
        hessenberg(i, used) += share;
        next -= share * basis[at(i)];
      }
    }
    const double rest = std::sqrt(product(next, next));
    hessenberg(used + 1, used) = rest;
    ++used;
    VectorXd right = VectorXd::Zero(used + 1);
    right(0) = size;
    const MatrixXd top = hessenberg.topLeftCorner(used + 1, used);
    mix = top.colPivHouseholderQr().solve(right);
    if ((top * mix - right).norm() < kAccuracy * size || !(rest > 1e-14 * size)) break;
    basis.push_back(next / rest);
  }
  forces.setZero();
  for (Index i = 0; i < used; ++i) forces += mix(i) * basis[at(i)];
  precondition(forces);
}

// Rms of what a change of forces does to the whitened outputs.
double SteadyStateSolver::size_in_noise(const MatrixXcd& change) const {
  MatrixXcd moved = MatrixXcd::Zero(seen_.front().rows(), lines_ + 1);
  for (std::size_t l = 0; l < seen_.size(); ++l) {
    moved += seen_[l] * change.col(static_cast<Index>(l)).asDiagonal();
  }
  const auto numbers = static_cast<double>(2 * moved.rows() * data_.line_count());
  return moved.norm() / std::sqrt(numbers);
}

void SteadyStateSolver::iterate(const MeasuredRecord& record) {
  MatrixXcd error, best = state_.forces, step, last;
  double best_size = std::numeric_limits<double>::infinity();
  double share = 1.0;
  for (int iteration = 0; iteration < options_.iteration_limit; ++iteration) {
    if (stop_requested()) break;  // whoever started this throws Stopped
    assemble();
    const double own_size = renew_own_force(record);
    renew_forces(error);
    error -= state_.forces;
    MatrixXcd moved = error;
    precondition(moved);
    const double size = std::hypot(size_in_noise(moved), own_size);
    if (!(size < best_size)) {
      // Less of the step that did not help.
      share *= 0.3;
      if (share < 0.05 || iteration == 0) break;
      state_.forces = best + share * step;
      continue;
    }
    best_size = size;
    best = state_.forces;
    if (size < options_.tolerance) {
      last = std::move(moved);
      break;
    }
    share = 1.0;
    step = error;
    solve_equation(step, true);
    if (!step.allFinite()) break;
    state_.forces = best + step;
  }
  state_.forces = best;
  state_.unsettled = best_size;
  if (last.size() > 0 && take_last_step(last, best_size)) return;
  assemble();
  renew_forces(error);
}

// By the mean slopes: where laws are far from these it may lead away, and is not taken.
bool SteadyStateSolver::take_last_step(const MatrixXcd& step, double size) {
  const MatrixXcd before = state_.forces;
  MatrixXcd error;
  state_.forces += step;
  assemble();
  renew_forces(error);
  error -= state_.forces;
  precondition(error);
  const double left = size_in_noise(error);
  if (left < size) {
    state_.unsettled = left;
    return true;
  }
  state_.forces = before;
  return false;
}

// X of every line.
void SteadyStateSolver::change_receptance() {
  const Index laws = state_.forces.cols();
  const Index n = position_->plant.mass.rows();
  MatrixXcd inputs(laws, n), carried(n, laws);
  state_.changed.resize(at(lines_ + 1));
  for (Index k = 0; k <= lines_; ++k) {
    const MatrixXcd& receptance = position_->receptance[at(k)];
    for (Index l = 0; l < laws; ++l) {
      carried.col(l) = carried_[at(l)].col(k);
      inputs.row(l).setZero();
      const VectorXd& b = force_laws_[at(l)].place->input;
      for (Index i = 0; i < n; ++i) {
        if (b(i) != 0.0) inputs.row(l) += state_.slopes(k, l) * b(i) * receptance.row(i);
      }
    }
    state_.changed[at(k)] = receptance;
    state_.changed[at(k)].noalias() -= carried * (mean_solution_[at(k)] * inputs);
  }
}

// Outputs of the present coordinates, and the residuals.
void SteadyStateSolver::measure(const MeasuredRecord& record) {
  const LinearPlant& plant = position_->plant;
  const Index outputs = plant.velocity_output.rows();
  state_.output.setZero(outputs, lines_ + 1);
  for (Index k = 1; k <= lines_; ++k) {
    const Complex rate(0.0, data_.frequencies[at(k)]);
    state_.output.col(k) = plant.position_output * state_.coordinates.col(k) +
                           rate * (plant.velocity_output * state_.coordinates.col(k)) +
                           imaged_.col(k);
  }
  VectorXcd force;
  for (const ActingLaw& law : model_->laws) {
    const Location& place = law.place->location;
    if (place.kind != LocationKind::kSensor) continue;
    const PeriodicLaw periodic(*law.entry, law.parameters);
    const VectorXcd signal = state_.output.row(place.channel).transpose();
    if (!periodic.is_linear()) motion_of(signal, motion_);
    force_lines(periodic, signal, motion_, force);
    state_.output.row(place.channel) += force.transpose();
    if (law.entry->use == LawUse::kDelay || law.entry->name == "lag") {
      filter_images(periodic, place.channel);
    }
  }
  state_.residual.setZero(outputs, lines_ + 1);
  for (Index k = data_.first_line; k <= lines_; ++k) {
    state_.residual.col(k).noalias() =
        data_.whitening[record.group][at(k)] * (record.output.col(k) - state_.output.col(k));
  }
  VectorXcd independent = state_.residual.reshaped();
  record.decorrelate(independent);
  state_.chi_square = independent.squaredNorm();
}

// A sensor that is late or slow looks at the motion between samples: each image passes through it
// at its own frequency.
void SteadyStateSolver::filter_images(const PeriodicLaw& law, Index channel) {
  const auto filter = [&law](double w) { return 1.0 + *law.response(w); };
  for (Index k = data_.first_line; k <= lines_; ++k) {
    const double w = data_.frequencies[at(k)];
    for (Index input = 0; input < input_.rows(); ++input) {
      const Complex image = position_->held_images->filtered(input, w, filter)(channel) -
                            filter(w) * position_->images[at(k)](channel, input);
      state_.output(channel, k) += image * input_(input, k);
    }
  }
}

// ---- laws ---------------------------------------------------------------------------------------

void SteadyStateSolver::motion_of(const VectorXcd& deflection, PeriodicMotion& motion) {
  motion.step = static_cast<double>(data_.period) * data_.sample_time /
                static_cast<double>(transform_.grid());
  motion.deflection.resize(transform_.grid());
  motion.rate.resize(transform_.grid());
  transform_.to_times(deflection, motion.deflection);
  VectorXcd rate(lines_ + 1);
  for (Index k = 0; k <= lines_; ++k) {
    rate(k) = Complex(0.0, data_.frequencies[at(k)]) * deflection(k);
  }
  transform_.to_times(rate, motion.rate);
}

void SteadyStateSolver::force_lines(const PeriodicLaw& law, const VectorXcd& deflection,
                                    const PeriodicMotion& motion, VectorXcd& force) {
  force.resize(lines_ + 1);
  if (law.is_linear()) {
    for (Index k = 0; k <= lines_; ++k) {
      force(k) = *law.response(data_.frequencies[at(k)]) * deflection(k);
    }
    return;
  }
  law.force(motion, times_);
  transform_.to_lines(times_, force);
}

void SteadyStateSolver::signal_lines(const PeriodicLaw& law, const MeasuredRecord& record,
                                     const LinearPlant& plant, Index channel, VectorXcd& added) {
  added.resize(lines_ + 1);
  if (law.is_linear()) {
    for (Index k = 0; k <= lines_; ++k) {
      added(k) = *law.response(data_.frequencies[at(k)]) * record.input(channel, k);
    }
    return;
  }
  // The recorded samples themselves: between them the command is held.
  PeriodicMotion motion;
  motion.deflection =
      record.input_period.row(channel).transpose().array() + plant.holding_input(channel);
  motion.rate = VectorXd::Zero(motion.deflection.size());
  motion.step = data_.sample_time;
  law.force(motion, times_);
  added = samples_.run(times_).head(lines_ + 1);
}

}  // namespace graybox
