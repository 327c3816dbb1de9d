#include "diagnosis/periodic/periodic_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <utility>

#include "diagnosis/estimation/recording_spread.hpp"
#include "diagnosis/harmonic_balance/place_observer.hpp"
#include "diagnosis/harmonic_balance/real_products.hpp"
#include "problems/base/array_index.hpp"
#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// How a parameter moves.
struct Unknown {
  enum class Kind : std::int8_t { kFree, kPositive, kNonNegative, kUnitInterval };
  Kind kind = Kind::kFree;
};

Unknown unknown_of(ParameterRange range) {
  switch (range) {
    case ParameterRange::kPositive:
      return {Unknown::Kind::kPositive};
    case ParameterRange::kNonNegative:
      return {Unknown::Kind::kNonNegative};
    case ParameterRange::kUnitInterval:
      return {Unknown::Kind::kUnitInterval};
    case ParameterRange::kAny:
      break;
  }
  return {};
}

constexpr double kNever = std::numeric_limits<double>::infinity();

// Everything at one value of the unknowns.
struct Evaluation {
  VectorXd values;
  double chi_square = kNever;
  MatrixXd information;
  VectorXd gradient;              // J^T r
  MatrixXd record_gradients;      // of each record (rows), by the parameters themselves
  std::vector<bool> imitated;     // PeriodicFit::imitated
  std::vector<MatrixXcd> forces;  // of each record, to start the next from
  double unsettled = 0.0;
};

// Gain in chi-square of a step that a fit with laws goes on for: laws of many parameters creep
// along valleys for dozens of dear steps, and no verdict turns on less.
constexpr double kEnough = 0.1;

// Or this share of what chi-square has beyond its expectation: laws that are not the right ones
// leave it so large that no gain of that size can make them so.
constexpr double kEnoughOfExcess = 1e-3;

// A fit ends earlier where chi-square is so many times its expectation: another law is needed there
// first, or instead, and the fits after that begin where this one ends.
constexpr double kFarOff = 100.0;
constexpr double kEnoughFarOff = 0.02;

constexpr double kFirstDamping = 1e-3;
// A small step may be small for its damping: that is lifted by this, and the fit counts as done at
// so many small steps.
constexpr double kReleased = 0.04;
constexpr int kSmallSteps = 4;

// A fit that may be given up has had so many steps; the best of the last few that led on is what
// each to come may gain.
constexpr int kStepsAtLeast = 10;
constexpr std::size_t kRecentSteps = 5;

// The damping of Levenberg and Marquardt's steps follows the share of the predicted gain that was
// found (Nielsen 1999).
struct Damping {
  double value = kFirstDamping;
  double failed = 0.0;  // the most with which a step led up since one led on

  void after_gain(double gain, double predicted) {
    const double share = predicted > 0.0 ? std::min(1.0, gain / predicted) : 1.0;
    value = std::max(value * std::clamp(1.0 - std::pow(2.0 * share - 1.0, 3), 0.2, 2.0), 1e-9);
  }
  void after_loss() {
    failed = std::max(failed, value);
    value *= value < 1e-4 ? 100.0 : 6.0;
  }
  [[nodiscard]] bool may_be_lifted() const { return kReleased * value > failed; }
};

class PeriodicFitter {
 public:
  PeriodicFitter(const PlantFamily& family, const PeriodicData& data,
                 const std::vector<ActingLaw>& laws, const PeriodicFitOptions& options)
      : family_(family), data_(data), laws_(laws), options_(options) {
    for (const ModelParameter& parameter : family.parameters()) {
      unknowns_.push_back({parameter.positive ? Unknown::Kind::kPositive : Unknown::Kind::kFree});
    }
    for (const ActingLaw& law : laws) {
      for (const LawParameter& parameter : law.entry->parameters) {
        unknowns_.push_back(unknown_of(parameter.range));
      }
    }
    expected_ = data.numbers_in(data.estimation);
    if (options.freed != nullptr) expected_ *= share_beside_freed(data);
  }

  PeriodicFit run(const std::vector<VectorXd>& starts) {
    // Derivatives by mean slopes at first; exact ones once they no longer lead on. Of linear laws
    // these are the same.
    bool exact = std::ranges::all_of(laws_, [](const ActingLaw& law) {
      return PeriodicLaw(*law.entry, law.parameters).is_linear();
    });
    PeriodicFit result;
    Evaluation now = best_of(starts, exact);
    if (!std::isfinite(now.chi_square)) {
      result.trouble = "no steady state of the model at the start";
      return result;
    }
    Damping damping;
    int small_steps = 0;
    bool may_leave_valley = true;  // not again where it did not help, before a step does
    while (result.iterations < options_.iteration_limit && !result.converged) {
      if (options_.keep_going && !options_.keep_going()) {
        result.trouble = "stopped";
        break;
      }
      ++result.iterations;
      const VectorXd step = step_of(now, damping.value);
      const double worthwhile = worthwhile_gain(now.chi_square);
      const double predicted = predicted_gain(now, step);
      const bool promises = predicted > worthwhile && damping.value < 1e6;
      Evaluation next = evaluate(moved(now.values, step), &now.forces, exact);
      if (may_leave_valley && leaves_valley(now, step, next, damping.value)) {
        next = back_in_valley(std::move(next), damping.value, exact);
        may_leave_valley = next.chi_square < now.chi_square;
      }
      const double gain = gain_of(now, next);
      if (gain >= 0.0) {
        gains_.push_back(gain);
        now = std::move(next);
        damping.after_gain(gain, predicted);
      } else {
        damping.after_loss();
      }
      if (gain > worthwhile) {
        small_steps = 0;
        may_leave_valley = true;
        damping.failed = 0.0;
      } else if (!exact) {
        exact = true;
        gains_.clear();
        now = evaluate(now.values, &now.forces, exact);
        small_steps = 0;
        may_leave_valley = true;
        damping = {};
      } else if (gain >= 0.0 && ++small_steps < kSmallSteps && damping.may_be_lifted() &&
                 is_held_back(now, damping.value)) {
        damping.value *= kReleased;
      } else {
        result.converged = !promises || (gain >= 0.0 && damping.value < 1e-2);
      }
      if (exact && !result.converged && cannot_win(now, result.iterations)) {
        result.trouble = "another fit is better";
        break;
      }
    }
    if (small_steps > 0 && result.trouble.empty()) result.converged = true;
    conclude(now, result);
    return result;
  }

 private:
  // Below options.to_beat in the steps that are left. Derivatives must be exact: with these it may
  // get out of a bend.
  [[nodiscard]] bool cannot_win(const Evaluation& now, int iterations) const {
    if (!std::isfinite(options_.to_beat) || iterations < kStepsAtLeast) return false;
    if (gains_.size() < kRecentSteps) return false;
    const double largest = *std::ranges::max_element(std::span(gains_).last(kRecentSteps));
    return now.chi_square - (options_.iteration_limit - iterations) * largest > options_.to_beat;
  }

  [[nodiscard]] Evaluation best_of(const std::vector<VectorXd>& starts, bool exact) {
    Evaluation best;
    for (const VectorXd& start : starts) {
      Evaluation other = evaluate(start_values(start), nullptr, exact);
      if (best.values.size() == 0 || is_better(other, best)) best = std::move(other);
    }
    return best;
  }

  void conclude(const Evaluation& now, PeriodicFit& result) const {
    if (!result.converged && result.trouble.empty()) result.trouble = "the fit did not settle";
    result.has_steady_state = is_settled(now);
    if (result.converged && !result.has_steady_state) {
      result.converged = false;
      result.trouble = "no steady state under the laws was found";
    }
    store(now, result);
  }

  [[nodiscard]] VectorXd start_values(const VectorXd& parameters) const {
    VectorXd values(static_cast<Index>(unknowns_.size()));
    values.head(parameters.size()) = parameters;
    Index k = parameters.size();
    for (const ActingLaw& law : laws_) {
      for (const double value : law.parameters) values(k++) = value;
    }
    return values;
  }

  [[nodiscard]] std::vector<ActingLaw> laws_at(const VectorXd& values) const {
    std::vector<ActingLaw> laws = laws_;
    auto k = static_cast<Index>(family_.parameters().size());
    for (ActingLaw& law : laws) {
      for (double& value : law.parameters) value = values(k++);
    }
    return laws;
  }

  // Of a model without laws the motion is its own, whatever that is worth.
  [[nodiscard]] bool is_settled(const Evaluation& at) const {
    if (!std::isfinite(at.chi_square)) return false;
    return laws_.empty() || graybox::is_settled(at.unsettled, at.chi_square, expected_);
  }

  // In chi-square. Nothing makes up for a steady state.
  [[nodiscard]] double gain_of(const Evaluation& from, const Evaluation& to) const {
    const bool was_settled = is_settled(from), is_now = is_settled(to);
    if (was_settled == is_now) return from.chi_square - to.chi_square;
    return is_now ? kNever : -kNever;
  }

  [[nodiscard]] bool is_better(const Evaluation& at, const Evaluation& than) const {
    const bool is_there = is_settled(at);
    return is_there == is_settled(than) ? at.chi_square < than.chi_square : is_there;
  }

  [[nodiscard]] double worthwhile_gain(double chi_square) const {
    const double share = options_.tolerance * chi_square;
    if (laws_.empty()) return 0.01 + share;
    const double of_excess = chi_square > kFarOff * expected_ ? kEnoughFarOff : kEnoughOfExcess;
    return std::max(kEnough + share, of_excess * (chi_square - expected_));
  }

  // dvalue / dunknown
  [[nodiscard]] double scale(Index k, const VectorXd& values) const {
    return unknowns_[at(k)].kind == Unknown::Kind::kPositive ? values(k) : 1.0;
  }

  [[nodiscard]] VectorXd moved(const VectorXd& values, const VectorXd& step) const {
    VectorXd result = values;
    for (Index k = 0; k < values.size(); ++k) {
      switch (unknowns_[at(k)].kind) {
        case Unknown::Kind::kPositive:
          result(k) = values(k) * std::exp(std::clamp(step(k), -0.7, 0.7));
          break;
        case Unknown::Kind::kNonNegative:
          result(k) = std::max(values(k) + step(k), 0.1 * values(k));
          break;
        case Unknown::Kind::kUnitInterval:
          result(k) = std::clamp(values(k) + step(k), 0.0, 1.0);
          break;
        case Unknown::Kind::kFree:
          result(k) = values(k) + step(k);
          break;
      }
    }
    return result;
  }

  [[nodiscard]] VectorXd step_of(const Evaluation& now, double damping) const {
    VectorXd unit(now.values.size());
    for (Index k = 0; k < unit.size(); ++k) {
      const double diagonal = now.information(k, k);
      unit(k) = diagonal > 0.0 ? 1.0 / std::sqrt(diagonal) : 0.0;
    }
    MatrixXd matrix = unit.asDiagonal() * now.information * unit.asDiagonal();
    matrix.diagonal().array() += damping + 1e-12;
    return unit.cwiseProduct(matrix.ldlt().solve(unit.cwiseProduct(now.gradient)));
  }

  // A step along a valley that bends ends beside it, where the next step leads down further than
  // this one came up.
  [[nodiscard]] bool leaves_valley(const Evaluation& from, const VectorXd& step,
                                   const Evaluation& to, double damping) const {
    if (!std::isfinite(to.chi_square) || is_settled(from) != is_settled(to)) return false;
    const double loss = to.chi_square - from.chi_square;
    if (loss <= 0.0) return false;
    const double whole = predicted_gain(to, step_of(to, damping)) - loss;
    return whole > std::max(worthwhile_gain(from.chi_square), 0.3 * predicted_gain(from, step));
  }

  [[nodiscard]] Evaluation back_in_valley(Evaluation beside, double damping, bool exact) {
    Evaluation back =
        evaluate(moved(beside.values, step_of(beside, damping)), &beside.forces, exact);
    return gain_of(beside, back) > 0.0 ? std::move(back) : std::move(beside);
  }

  // By its damping, along directions that the recordings hardly see.
  [[nodiscard]] bool is_held_back(const Evaluation& now, double damping) const {
    const double held = predicted_gain(now, step_of(now, damping));
    const double released = predicted_gain(now, step_of(now, kReleased * kReleased * damping));
    return released - held > worthwhile_gain(now.chi_square);
  }

  [[nodiscard]] static double predicted_gain(const Evaluation& now, const VectorXd& step) {
    return 2.0 * step.dot(now.gradient) - step.dot(now.information * step);
  }

  [[nodiscard]] Evaluation evaluate(const VectorXd& values, const std::vector<MatrixXcd>* starts,
                                    bool exact) {
    Evaluation result;
    result.values = values;
    std::optional<ModelState> model;
    try {
      const auto own = static_cast<Index>(family_.parameters().size());
      model.emplace(evaluate_model(family_, data_, values.head(own), laws_at(values), true,
                                   options_.threads));
    } catch (const InputError&) {
      return result;  // no rest there
    }
    const std::size_t records = data_.estimation.size();
    std::vector<RecordSums> sums(records);
    const StopClock clock;
#pragma omp parallel num_threads(options_.threads)
    {
      Workspace work{SteadyStateSolver(family_, data_, {}), {}, {}, {}};
#pragma omp for schedule(dynamic)
      for (std::size_t i = 0; i < records; ++i) {
        if (clock.stops()) continue;
        sums[i] = sums_of(work, *model, data_.estimation[i],
                          starts != nullptr ? &(*starts)[i] : nullptr, exact);
      }
    }
    stop_if_requested();
    if (options_.freed != nullptr) result.imitated = imitated_by(*model, *options_.freed);
    add_up(sums, result);
    return result;
  }

  // Of one thread.
  struct Workspace {
    SteadyStateSolver solver;
    MatrixXcd jacobian, answer;
    Eigen::VectorXcd residual;
  };

  // What one recording adds.
  struct RecordSums {
    MatrixXd information;
    VectorXd gradient;
    VectorXd seen;  // squared derivatives before the freed force has taken its part
    double chi_square = 0.0, unsettled = 0.0;
    MatrixXcd forces;
  };

  [[nodiscard]] RecordSums sums_of(Workspace& work, const ModelState& model,
                                   const MeasuredRecord& record, const MatrixXcd* start,
                                   bool exact) const {
    RecordSums sums;
    const SteadyState& state = work.solver.solve(model, record, start);
    if (options_.freed != nullptr && options_.freed->kind == LocationKind::kElement) {
      work.solver.let_act(model, record, *options_.freed);
    }
    work.solver.differentiate(model, record, exact, work.jacobian);
    work.residual = state.residual.reshaped();
    if (options_.freed != nullptr) {
      sums.seen = work.jacobian.colwise().squaredNorm();
      answer_at(work.solver, model, record, *options_.freed, work.answer);
      take_out(work.answer, work.jacobian);
      take_out(work.answer, work.residual);
    }
    record.decorrelate(work.jacobian);
    record.decorrelate(work.residual);
    sums.information.noalias() = as_real(work.jacobian).transpose() * as_real(work.jacobian);
    sums.gradient.noalias() = as_real(work.jacobian).transpose() * as_real(work.residual);
    sums.chi_square = work.residual.squaredNorm();
    sums.unsettled = state.unsettled;
    sums.forces = state.forces;
    return sums;
  }

  // By the unknowns that steps are taken in.
  void add_up(std::vector<RecordSums>& sums, Evaluation& result) const {
    const auto size = static_cast<Index>(unknowns_.size());
    VectorXd scales(size);
    for (Index k = 0; k < size; ++k) scales(k) = scale(k, result.values);
    result.chi_square = 0.0;
    result.information = MatrixXd::Zero(size, size);
    result.gradient = VectorXd::Zero(size);
    result.record_gradients.resize(static_cast<Index>(sums.size()), size);
    Index row = 0;
    for (RecordSums& record : sums) {
      result.record_gradients.row(row++) = record.gradient.transpose();
      result.chi_square += record.chi_square;
      result.unsettled += record.unsettled * record.unsettled / static_cast<double>(sums.size());
      result.information += scales.asDiagonal() * record.information * scales.asDiagonal();
      result.gradient += scales.cwiseProduct(record.gradient);
      result.forces.push_back(std::move(record.forces));
    }
    result.unsettled = std::sqrt(result.unsettled);
    // A force may be finite where its derivatives no longer are.
    if (!std::isfinite(result.chi_square) || !result.information.allFinite() ||
        !result.gradient.allFinite()) {
      result.chi_square = kNever;
    } else if (options_.freed != nullptr) {
      hold_unseen(sums, result);
    }
  }

  // What a force at the freed place can do, line by line.
  static void take_out(const MatrixXcd& answer, Eigen::Ref<MatrixXcd> columns) {
    const Index outputs = answer.rows();
    for (Index k = 0; k < answer.cols(); ++k) {
      const double size = answer.col(k).norm();
      if (!(size > 0.0)) continue;
      const Eigen::VectorXcd direction = answer.col(k) / size;
      auto rows = columns.middleRows(k * outputs, outputs);
      const Eigen::RowVectorXcd along = direction.adjoint() * rows;
      rows.noalias() -= direction * along;
    }
  }

  // Parameters of the model that act as a force at the place: springs and dampers beside it.
  [[nodiscard]] static std::vector<bool> imitated_by(const ModelState& model,
                                                     const Location& place) {
    const std::vector<PlantDerivative>& derivatives = model.positions.front().plant.derivatives;
    std::vector<bool> imitated(derivatives.size(), false);
    if (place.kind != LocationKind::kElement) return imitated;
    const VectorXd& b = place.output;
    const auto is_along = [&](const MatrixXd& matrix) {
      const MatrixXd rest = matrix - multiple_along(matrix, b) * b * b.transpose();
      return rest.norm() <= 1e-9 * matrix.norm();
    };
    for (std::size_t p = 0; p < derivatives.size(); ++p) {
      const PlantDerivative& change = derivatives[p];
      imitated[p] = change.mass.size() == 0 &&
                    (change.stiffness.size() == 0 || is_along(change.stiffness)) &&
                    (change.damping.size() == 0 || is_along(change.damping));
    }
    return imitated;
  }

  // Parameters that act as forces at the freed place stay as they are: nothing but rounding is left
  // of them, or little where laws couple lines.
  static void hold_unseen(const std::vector<RecordSums>& sums, Evaluation& result) {
    constexpr double kLeft = 1e-8;
    VectorXd left = VectorXd::Zero(result.gradient.size()), seen = left;
    for (const RecordSums& record : sums) {
      left += record.information.diagonal();
      seen += record.seen;
    }
    for (Index k = 0; k < left.size(); ++k) {
      const bool is_imitated = at(k) < result.imitated.size() && result.imitated[at(k)];
      if (!is_imitated && left(k) > kLeft * seen(k)) continue;
      result.information.row(k).setZero();
      result.information.col(k).setZero();
      result.gradient(k) = 0.0;
    }
  }

  void store(const Evaluation& now, PeriodicFit& result) const {
    result.parameters = now.values.head(static_cast<Index>(family_.parameters().size()));
    result.laws = laws_at(now.values);
    result.chi_square = now.chi_square;
    result.imitated = now.imitated;
    VectorXd inverse(now.values.size());
    for (Index k = 0; k < inverse.size(); ++k) inverse(k) = 1.0 / scale(k, now.values);
    result.information = inverse.asDiagonal() * now.information * inverse.asDiagonal();
    result.record_gradients = now.record_gradients;
  }

  const PlantFamily& family_;
  const PeriodicData& data_;
  const std::vector<ActingLaw>& laws_;
  const PeriodicFitOptions& options_;
  std::vector<Unknown> unknowns_;
  std::vector<double> gains_;  // of each step that led on, since derivatives are exact
  double expected_ = 0.0;      // chi-square of nothing but noise
};

}  // namespace

PeriodicFit fit_periodic(const PlantFamily& family, const PeriodicData& data,
                         const std::vector<VectorXd>& starts, const std::vector<ActingLaw>& laws,
                         const PeriodicFitOptions& options) {
  return PeriodicFitter(family, data, laws, options).run(starts);
}

double multiple_along(const MatrixXd& matrix, const VectorXd& b) {
  const double size = b.squaredNorm();
  return b.dot(matrix * b) / (size * size);
}

double share_beside_freed(const PeriodicData& data) {
  const auto outputs = static_cast<double>(data.outputs.size());
  return (outputs - 1.0) / outputs;
}

VectorXd values_of(const PeriodicFit& fit) {
  std::vector<double> values(fit.parameters.begin(), fit.parameters.end());
  for (const ActingLaw& law : fit.laws) {
    values.insert(values.end(), law.parameters.begin(), law.parameters.end());
  }
  return Eigen::Map<const VectorXd>(values.data(), static_cast<Index>(values.size()));
}

VectorXd standard_errors(const MatrixXd& information) {
  constexpr double kUnseen = 1e-10;  // eigenvalue of the information scaled to a unit diagonal
  const Index n = information.rows();
  VectorXd errors(n);
  if (n == 0) return errors;
  const VectorXd unit = information.diagonal().unaryExpr(
      [](double value) { return value > 0.0 ? 1.0 / std::sqrt(value) : 0.0; });
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(unit.asDiagonal() * information *
                                                      unit.asDiagonal());
  for (Index k = 0; k < n; ++k) {
    double variance = 0.0;
    bool is_seen = unit(k) > 0.0;
    for (Index e = 0; e < n; ++e) {
      const double share = eigen.eigenvectors()(k, e);
      if (eigen.eigenvalues()(e) > kUnseen) {
        variance += share * share / eigen.eigenvalues()(e);
      } else if (std::abs(share) > 1e-3) {
        is_seen = false;
      }
    }
    errors(k) = is_seen ? unit(k) * std::sqrt(variance) : std::numeric_limits<double>::quiet_NaN();
  }
  return errors;
}

VectorXd standard_errors(const PeriodicFit& fit) {
  const VectorXd within = standard_errors(fit.information);
  if (fit.record_gradients.rows() < kFewestRecordings ||
      fit.record_gradients.cols() != within.size() || !fit.record_gradients.allFinite()) {
    return within;
  }
  std::vector<Index> seen;
  for (Index k = 0; k < within.size(); ++k) {
    if (std::isfinite(within(k))) seen.push_back(k);
  }
  if (seen.empty()) return within;
  // By columns of length one: the inverse does not depend on units.
  const VectorXd unit = VectorXd(fit.information.diagonal())(seen).cwiseSqrt().cwiseInverse();
  const MatrixXd scaled =
      unit.asDiagonal() * MatrixXd(fit.information(seen, seen)) * unit.asDiagonal();
  const MatrixXd gradients = MatrixXd(fit.record_gradients(Eigen::all, seen)) * unit.asDiagonal();
  const MatrixXd influences =
      scaled.completeOrthogonalDecomposition().solve(gradients.transpose()).transpose() *
      unit.asDiagonal();
  const VectorXd between = deviations_between(influences);
  VectorXd errors = within;
  for (std::size_t k = 0; k < seen.size(); ++k) {
    errors(seen[k]) = std::max(within(seen[k]), between(static_cast<Index>(k)));
  }
  return errors;
}

}  // namespace graybox
