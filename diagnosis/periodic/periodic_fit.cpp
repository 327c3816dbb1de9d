#include "diagnosis/periodic/periodic_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "diagnosis/estimation/recording_spread.hpp"
#include "diagnosis/periodic/periodic_evaluation.hpp"
#include "problems/base/array_index.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNever = std::numeric_limits<double>::infinity();

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
      : laws_(laws),
        options_(options),
        unknowns_(family, laws),
        evaluator_(family, data, unknowns_, {.freed = options.freed, .threads = options.threads}),
        expected_(data.numbers_in(data.estimation)) {
    if (options.freed != nullptr) expected_ *= share_beside_freed(data);
  }

  PeriodicFit run(const std::vector<VectorXd>& starts) {
    Iterate at;
    at.exact = std::ranges::all_of(laws_, [](const ActingLaw& law) {
      return PeriodicLaw(*law.entry, law.parameters).is_linear();
    });
    PeriodicFit result;
    at.now = best_of(starts, at.exact);
    if (!std::isfinite(at.now.chi_square)) {
      result.trouble = "no steady state of the model at the start";
      return result;
    }
    while (result.iterations < options_.iteration_limit && !result.converged) {
      if (options_.keep_going && !options_.keep_going()) {
        result.trouble = "stopped";
        break;
      }
      ++result.iterations;
      result.converged = advance(at);
      if (!result.converged && cannot_win(at, result.iterations)) {
        result.trouble = "another fit is better";
        break;
      }
    }
    if (at.small_steps > 0 && result.trouble.empty()) result.converged = true;
    conclude(at.now, result);
    return result;
  }

 private:
  // How far a fit is.
  struct Iterate {
    PeriodicEvaluation now;
    Damping damping;
    int small_steps = 0;
    bool may_leave_valley = true;  // not again where it did not help, before a step does
    // Derivatives by mean slopes at first; exact ones once they no longer lead on. Of linear laws
    // these are the same.
    bool exact = false;
    std::vector<double> gains;  // of each step that led on, since derivatives are exact

    void forget_small_steps() {
      small_steps = 0;
      may_leave_valley = true;
    }
  };

  // One step, or exact derivatives where none is left without them. Whether the fit is at its end.
  [[nodiscard]] bool advance(Iterate& at) const {
    const VectorXd step = step_of(at.now, at.damping.value);
    const double worthwhile = worthwhile_gain(at.now.chi_square);
    const double predicted = predicted_gain(at.now, step);
    const bool promises = predicted > worthwhile && at.damping.value < 1e6;
    PeriodicEvaluation next = tried(at, step);
    const double gain = gain_of(at.now, next);
    if (gain >= 0.0) {
      at.gains.push_back(gain);
      at.now = std::move(next);
      at.damping.after_gain(gain, predicted);
    } else {
      at.damping.after_loss();
    }
    if (gain > worthwhile) {
      at.forget_small_steps();
      at.damping.failed = 0.0;
      return false;
    }
    if (!at.exact) {
      become_exact(at);
      return false;
    }
    if (gain >= 0.0 && ++at.small_steps < kSmallSteps && at.damping.may_be_lifted() &&
        is_held_back(at.now, at.damping.value)) {
      at.damping.value *= kReleased;
      return false;
    }
    return !promises || (gain >= 0.0 && at.damping.value < 1e-2);
  }

  // Where a step leads, and the next one too if this one left a valley.
  [[nodiscard]] PeriodicEvaluation tried(Iterate& at, const VectorXd& step) const {
    PeriodicEvaluation next =
        evaluator_.evaluate(unknowns_.moved(at.now.values, step), &at.now.forces, at.exact);
    if (at.may_leave_valley && leaves_valley(at.now, step, next, at.damping.value)) {
      next = back_in_valley(std::move(next), at.damping.value, at.exact);
      at.may_leave_valley = next.chi_square < at.now.chi_square;
    }
    return next;
  }

  void become_exact(Iterate& at) const {
    at.exact = true;
    at.gains.clear();
    at.now = evaluator_.evaluate(at.now.values, &at.now.forces, at.exact);
    at.forget_small_steps();
    at.damping = {};
  }

  // Below options.to_beat in the steps that are left. Derivatives must be exact: with these it may
  // get out of a bend.
  [[nodiscard]] bool cannot_win(const Iterate& at, int iterations) const {
    if (!at.exact || !std::isfinite(options_.to_beat) || iterations < kStepsAtLeast) return false;
    if (at.gains.size() < kRecentSteps) return false;
    const double largest = *std::ranges::max_element(std::span(at.gains).last(kRecentSteps));
    return at.now.chi_square - (options_.iteration_limit - iterations) * largest > options_.to_beat;
  }

  [[nodiscard]] PeriodicEvaluation best_of(const std::vector<VectorXd>& starts, bool exact) const {
    PeriodicEvaluation best;
    for (const VectorXd& start : starts) {
      PeriodicEvaluation other = evaluator_.evaluate(unknowns_.start_values(start), nullptr, exact);
      if (best.values.size() == 0 || is_better(other, best)) best = std::move(other);
    }
    return best;
  }

  void conclude(const PeriodicEvaluation& now, PeriodicFit& result) const {
    if (!result.converged && result.trouble.empty()) result.trouble = "the fit did not settle";
    result.has_steady_state = is_settled(now);
    if (result.converged && !result.has_steady_state) {
      result.converged = false;
      result.trouble = "no steady state under the laws was found";
    }
    store(now, result);
  }

  // Of a model without laws the motion is its own, whatever that is worth.
  [[nodiscard]] bool is_settled(const PeriodicEvaluation& at) const {
    if (!std::isfinite(at.chi_square)) return false;
    return laws_.empty() || graybox::is_settled(at.unsettled, at.chi_square, expected_);
  }

  // In chi-square. Nothing makes up for a steady state.
  [[nodiscard]] double gain_of(const PeriodicEvaluation& from, const PeriodicEvaluation& to) const {
    const bool was_settled = is_settled(from), is_now = is_settled(to);
    if (was_settled == is_now) return from.chi_square - to.chi_square;
    return is_now ? kNever : -kNever;
  }

  [[nodiscard]] bool is_better(const PeriodicEvaluation& at, const PeriodicEvaluation& than) const {
    const bool is_there = is_settled(at);
    return is_there == is_settled(than) ? at.chi_square < than.chi_square : is_there;
  }

  [[nodiscard]] double worthwhile_gain(double chi_square) const {
    const double share = options_.tolerance * chi_square;
    if (laws_.empty()) return 0.01 + share;
    const double of_excess = chi_square > kFarOff * expected_ ? kEnoughFarOff : kEnoughOfExcess;
    return std::max(kEnough + share, of_excess * (chi_square - expected_));
  }

  [[nodiscard]] VectorXd step_of(const PeriodicEvaluation& now, double damping) const {
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
  [[nodiscard]] bool leaves_valley(const PeriodicEvaluation& from, const VectorXd& step,
                                   const PeriodicEvaluation& to, double damping) const {
    if (!std::isfinite(to.chi_square) || is_settled(from) != is_settled(to)) return false;
    const double loss = to.chi_square - from.chi_square;
    if (loss <= 0.0) return false;
    const double whole = predicted_gain(to, step_of(to, damping)) - loss;
    return whole > std::max(worthwhile_gain(from.chi_square), 0.3 * predicted_gain(from, step));
  }

  [[nodiscard]] PeriodicEvaluation back_in_valley(PeriodicEvaluation beside, double damping,
                                                  bool exact) const {
    PeriodicEvaluation back = evaluator_.evaluate(
        unknowns_.moved(beside.values, step_of(beside, damping)), &beside.forces, exact);
    return gain_of(beside, back) > 0.0 ? std::move(back) : std::move(beside);
  }

  // By its damping, along directions that the recordings hardly see.
  [[nodiscard]] bool is_held_back(const PeriodicEvaluation& now, double damping) const {
    const double held = predicted_gain(now, step_of(now, damping));
    const double released = predicted_gain(now, step_of(now, kReleased * kReleased * damping));
    return released - held > worthwhile_gain(now.chi_square);
  }

  [[nodiscard]] static double predicted_gain(const PeriodicEvaluation& now, const VectorXd& step) {
    return 2.0 * step.dot(now.gradient) - step.dot(now.information * step);
  }

  void store(const PeriodicEvaluation& now, PeriodicFit& result) const {
    result.parameters = now.values.head(unknowns_.model_size());
    result.laws = unknowns_.laws_at(now.values);
    result.chi_square = now.chi_square;
    result.imitated = now.imitated;
    VectorXd inverse(now.values.size());
    for (Index k = 0; k < inverse.size(); ++k) inverse(k) = 1.0 / unknowns_.scale(k, now.values);
    result.information = inverse.asDiagonal() * now.information * inverse.asDiagonal();
    result.record_gradients = now.record_gradients;
  }

  const std::vector<ActingLaw>& laws_;
  const PeriodicFitOptions& options_;
  FitUnknowns unknowns_;
  PeriodicEvaluator evaluator_;
  double expected_ = 0.0;  // chi-square of nothing but noise
};

}  // namespace

PeriodicFit fit_periodic(const PlantFamily& family, const PeriodicData& data,
                         const std::vector<VectorXd>& starts, const std::vector<ActingLaw>& laws,
                         const PeriodicFitOptions& options) {
  return PeriodicFitter(family, data, laws, options).run(starts);
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
