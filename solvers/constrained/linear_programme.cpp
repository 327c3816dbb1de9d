#include "solvers/constrained/linear_programme.hpp"

#include <ClpSimplex.hpp>
#include <CoinPackedMatrix.hpp>
#include <algorithm>
#include <cmath>

#include "problems/base/stop.hpp"

namespace graybox {
namespace {

// The programme in units in which efforts and rows are about one: Clp's tolerances are absolute.
class ScaledProgramme {
 public:
  ScaledProgramme(const DesignConstraints& constraints, std::span<const std::size_t> candidates,
                  std::span<const double> gains)
      : constraints_(constraints), candidates_(candidates), unit_(gains.size()) {
    const std::size_t rows = constraints.rows.size();
    size_.assign(rows, 0.0);
    for (std::size_t k = 0; k < unit_.size(); ++k) {
      // Infinite where the first row bounds nothing (contradicting_rows).
      double effort = constraints.largest_effort(candidate(k));
      if (!std::isfinite(effort) || effort < 0.0) effort = 1.0;
      unit_[k] = effort > 0.0 ? effort : 1.0;
      gain_ = std::max(gain_, std::abs(gains[k]) * unit_[k]);
      for (std::size_t j = 0; j < rows; ++j) {
        const double a = std::abs(constraints.rows[j].coefficients[candidate(k)]);
        size_[j] = std::max(size_[j], a * effort);
      }
    }
    if (gain_ == 0.0) gain_ = 1.0;
    for (double& size : size_) size = size > 0.0 ? size : 1.0;
  }

  void load(std::span<const double> gains, ClpSimplex& simplex) const {
    const std::size_t count = unit_.size();
    std::vector<double> cost(count), lower(count), upper(count), row_lower, row_upper;
    for (std::size_t k = 0; k < count; ++k) {
      cost[k] = -gains[k] * unit_[k] / gain_;
      lower[k] = constraints_.lower_of(candidate(k)) / unit_[k];
      upper[k] = clp_bound(constraints_.upper_of(candidate(k)) / unit_[k]);
    }
    for (std::size_t j = 0; j < size_.size(); ++j) {
      row_lower.push_back(clp_bound(constraints_.rows[j].lower / size_[j]));
      row_upper.push_back(clp_bound(constraints_.rows[j].upper / size_[j]));
    }
    simplex.loadProblem(columns(), lower.data(), upper.data(), cost.data(), row_lower.data(),
                        row_upper.data());
  }

  [[nodiscard]] double effort(std::size_t k, double value) const { return value * unit_[k]; }
  [[nodiscard]] double multiplier(std::size_t j, double price) const {
    return -price * gain_ / size_[j];
  }

 private:
  [[nodiscard]] std::size_t candidate(std::size_t k) const {
    return candidates_.empty() ? k : candidates_[k];
  }
  static double clp_bound(double bound) {
    return std::isfinite(bound) ? bound : std::copysign(COIN_DBL_MAX, bound);
  }

  // By columns, without zeros.
  [[nodiscard]] CoinPackedMatrix columns() const {
    std::vector<CoinBigIndex> starts{0};
    std::vector<int> rows;
    std::vector<double> values;
    for (std::size_t k = 0; k < unit_.size(); ++k) {
      for (std::size_t j = 0; j < size_.size(); ++j) {
        const double a = constraints_.rows[j].coefficients[candidate(k)];
        if (a == 0.0) continue;
        rows.push_back(static_cast<int>(j));
        values.push_back(a * unit_[k] / size_[j]);
      }
      starts.push_back(static_cast<CoinBigIndex>(values.size()));
    }
    return {true,
            static_cast<int>(size_.size()),
            static_cast<int>(unit_.size()),
            starts.back(),
            values.data(),
            rows.data(),
            starts.data(),
            nullptr};
  }

  const DesignConstraints& constraints_;
  std::span<const std::size_t> candidates_;
  std::vector<double> unit_;  // of each effort: the largest it can be
  std::vector<double> size_;  // of each row: its largest term
  double gain_ = 0.0;         // the largest
};

}  // namespace

LinearOptimum maximise_linear(const DesignConstraints& constraints,
                              std::span<const std::size_t> candidates,
                              std::span<const double> gains) {
  constexpr double kTolerance = 1e-10;  // Clp's own is 1e-7, more than the gaps asked for
  if (!std::ranges::all_of(gains, [](double gain) { return std::isfinite(gain); })) return {};
  const ScaledProgramme programme(constraints, candidates, gains);
  ClpSimplex simplex;
  simplex.setLogLevel(0);
  programme.load(gains, simplex);
  for (const double tolerance : {kTolerance, 1e3 * kTolerance}) {
    simplex.setPrimalTolerance(tolerance);
    simplex.setDualTolerance(tolerance);
    simplex.primal();
    if (simplex.isProvenOptimal() || simplex.isProvenPrimalInfeasible()) break;
  }
  LinearOptimum optimum;
  if (simplex.isProvenPrimalInfeasible()) optimum.status = LinearStatus::kInfeasible;
  if (!simplex.isProvenOptimal()) return optimum;
  optimum.status = LinearStatus::kOptimal;
  const double* x = simplex.getColSolution();
  for (std::size_t k = 0; k < gains.size(); ++k) {
    optimum.efforts.push_back(programme.effort(k, x[k]));
  }
  const double* price = simplex.getRowPrice();
  for (std::size_t j = 0; j < constraints.rows.size(); ++j) {
    optimum.multipliers.push_back(programme.multiplier(j, price[j]));
  }
  return optimum;
}

std::vector<std::string> contradicting_rows(const DesignConstraints& constraints) {
  const std::vector<double> gains(constraints.rows.front().coefficients.size(), 0.0);
  DesignConstraints kept = constraints;
  for (std::size_t j = 0; j < kept.rows.size();) {
    stop_if_requested();
    DesignConstraints without = kept;
    without.rows.erase(without.rows.begin() + static_cast<std::ptrdiff_t>(j));
    if (maximise_linear(without, {}, gains).status == LinearStatus::kInfeasible) {
      kept = without;
    } else {
      ++j;
    }
  }
  std::vector<std::string> names;
  for (const LinearConstraint& row : kept.rows) names.push_back(row.name);
  return names;
}

}  // namespace graybox
