#include "solvers/planning/minimax_precision.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "problems/base/packed_matrix.hpp"
#include "problems/base/stop.hpp"
#include "solvers/constrained/constrained_certificate.hpp"
#include "solvers/constrained/constrained_column_generation.hpp"
#include "solvers/constrained/linear_programme.hpp"
#include "solvers/core/sensitivity.hpp"

namespace graybox {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kMostCuts = 400;

class MinimaxSearch {
 public:
  MinimaxSearch(const InformationSet& set, const DesignConstraints& constraints,
                std::span<const PrecisionTarget> targets, const MinimaxOptions& options)
      : set_(set), constraints_(constraints), targets_(targets), options_(options) {
    best_.upper = kInfinity;
    best_.mu.assign(options.start.begin(), options.start.end());
    if (best_.mu.empty()) {
      best_.mu.assign(targets.size(), 1.0 / static_cast<double>(targets.size()));
    }
  }

  MinimaxPrecision run() {
    std::vector<double> mu = best_.mu;
    for (int cut = 0; cut < kMostCuts; ++cut) {
      stop_if_requested();
      if (!solve(mu) || is_decided()) break;
      const TargetGame game = solve_target_game(ratios_);
      if (game.shares.empty()) break;
      take_mixture(game.shares);
      if (is_decided()) break;
      for (std::size_t j = 0; j < mu.size(); ++j) mu[j] = 0.5 * (game.mu[j] + best_.mu[j]);
    }
    best_.pool.assign(pool_.begin(), pool_.end());
    return std::move(best_);
  }

 private:
  [[nodiscard]] bool is_decided() const {
    if (options_.question == PrecisionQuestion::kWhether &&
        (best_.lower > 1.0 || best_.upper <= 1.0)) {
      return true;
    }
    return best_.upper <= best_.lower * (1.0 + options_.gap) || targets_.size() == 1;
  }

  // The inner problem: a new cut and bounds. False where there is none.
  bool solve(std::span<const double> mu) {
    SolveOptions options;
    options.criterion = weighted_targets(targets_, mu, set_.dimension());
    options.duality_gap = 0.05 * options_.gap;
    options.threads = options_.threads;
    ConstrainedSolution solution = try_constrained(set_, constraints_, options);
    if (solution.infeasible) {
      best_.infeasible = true;
      best_.lower = kInfinity;
      return false;
    }
    if (solution.efforts.empty()) {
      best_.singular = solution.status == SolveStatus::kUnsupported;
      best_.failed = !best_.singular;
      if (best_.singular) best_.lower = kInfinity;
      return false;
    }
    const ConstrainedCertificate proof =
        certify_constrained(set_, solution.efforts, constraints_, options.criterion);
    if (proof.certificate.status == CertificateStatus::kCertified) {
      const double slack = proof.certificate.duality_gap + proof.certificate.rounding_bound;
      take_lower(mu, proof.certificate.criterion_value / (1.0 + std::max(slack, 0.0)));
    }
    return add_cut(solution.efforts);
  }

  void take_lower(std::span<const double> mu, double bound) {
    if (!(bound > best_.lower)) return;
    best_.lower = bound;
    best_.mu.assign(mu.begin(), mu.end());
  }

  bool add_cut(const std::vector<double>& efforts) {
    const std::vector<double> ratios = take_upper(efforts);
    if (!std::ranges::all_of(ratios, [](double v) { return std::isfinite(v); })) return false;
    std::vector<std::pair<std::size_t, double>>& kept = designs_.emplace_back();
    for (std::size_t i = 0; i < efforts.size(); ++i) {
      if (efforts[i] == 0.0) continue;
      kept.emplace_back(i, efforts[i]);
      pool_.insert(i);
    }
    ratios_.push_back(ratios);
    return true;
  }

  // v_j of a design, which is kept if its worst is the best so far.
  std::vector<double> take_upper(const std::vector<double>& efforts) {
    std::vector<double> ratios = target_ratios(set_, constraints_, targets_, efforts);
    const double worst = *std::ranges::max_element(ratios);
    if (worst < best_.upper) {
      best_.upper = worst;
      best_.efforts = efforts;
    }
    return ratios;
  }

  void take_mixture(std::span<const double> shares) {
    double sum = 0.0;
    for (const double share : shares) sum += std::max(share, 0.0);
    if (!(sum > 0.0)) return;
    std::vector<double> mixture(set_.candidate_count(), 0.0);
    for (std::size_t t = 0; t < shares.size(); ++t) {
      const double share = std::max(shares[t], 0.0) / sum;
      for (const auto& [i, effort] : designs_[t]) mixture[i] += share * effort;
    }
    (void)take_upper(mixture);
  }

  const InformationSet& set_;
  const DesignConstraints& constraints_;
  std::span<const PrecisionTarget> targets_;
  MinimaxOptions options_;
  MinimaxPrecision best_;
  std::vector<std::vector<std::pair<std::size_t, double>>> designs_;  // x_t, without zeros
  std::vector<std::vector<double>> ratios_;                           // v_j(x_t)
  std::set<std::size_t> pool_;
};

// Divides by the sum, without what is below zero, and returns the sum.
double to_simplex(std::vector<double>& shares) {
  double sum = 0.0;
  for (double& share : shares) sum += share = std::max(share, 0.0);
  if (sum > 0.0) {
    for (double& share : shares) share /= sum;
  }
  return sum;
}

}  // namespace

std::vector<double> target_ratios(const InformationSet& set, const DesignConstraints& constraints,
                                  std::span<const PrecisionTarget> targets,
                                  std::span<const double> efforts) {
  std::vector<double> matrix(set.packed_size());
  information_matrix(set, efforts, matrix);
  for (std::size_t k = 0; k < constraints.prior.size(); ++k) matrix[k] += constraints.prior[k];
  std::vector<double> ratios = variances(targets, matrix, set.dimension());
  for (std::size_t j = 0; j < ratios.size(); ++j) {
    ratios[j] /= targets[j].standard_error * targets[j].standard_error;
  }
  return ratios;
}

// As a linear programme: maximise sum_t y_t subject to sum_t v_jt y_t <= 1. The game's value is
// 1/sum y, alpha = y / sum y, and the multipliers are mu over the value.
TargetGame solve_target_game(std::span<const std::vector<double>> ratios) {
  DesignConstraints programme;
  for (std::size_t j = 0; j < ratios.front().size(); ++j) {
    LinearConstraint row{.name = {}, .coefficients = {}, .lower = -kInfinity, .upper = 1.0};
    for (const std::vector<double>& each : ratios) row.coefficients.push_back(each[j]);
    programme.rows.push_back(std::move(row));
  }
  const std::vector<double> gains(ratios.size(), 1.0);
  const LinearOptimum optimum = maximise_linear(programme, {}, gains);
  if (optimum.status != LinearStatus::kOptimal) return {};
  TargetGame game{.value = 0.0, .shares = optimum.efforts, .mu = optimum.multipliers};
  const double effort = to_simplex(game.shares);
  if (!(effort > 0.0) || !(to_simplex(game.mu) > 0.0)) return {};
  game.value = 1.0 / effort;
  return game;
}

Criterion weighted_targets(std::span<const PrecisionTarget> targets, std::span<const double> mu,
                           std::size_t dimension) {
  std::vector<double> weights(packed_size(dimension), 0.0);
  for (std::size_t j = 0; j < targets.size(); ++j) {
    const std::vector<double>& c = targets[j].combination;
    const double share = mu[j] / (targets[j].standard_error * targets[j].standard_error);
    for (std::size_t row = 0; row < dimension; ++row) {
      for (std::size_t k = 0; k <= row; ++k) weights[packed_index(row, k)] += share * c[row] * c[k];
    }
  }
  return Criterion::l(std::move(weights));
}

MinimaxPrecision solve_minimax_precision(const InformationSet& set,
                                         const DesignConstraints& constraints,
                                         std::span<const PrecisionTarget> targets,
                                         const MinimaxOptions& options) {
  return MinimaxSearch(set, constraints, targets, options).run();
}

}  // namespace graybox
