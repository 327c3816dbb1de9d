#include "solvers/constrained/linear_programme.hpp"

#include <ClpSimplex.hpp>
#include <CoinPackedMatrix.hpp>
#include <algorithm>
#include <cmath>

#include "problems/base/stop.hpp"

namespace graybox {
namespace {

// The coefficients by columns, without zeros.
CoinPackedMatrix columns_of(const DesignConstraints& constraints,
                            std::span<const std::size_t> candidates, std::size_t count) {
  std::vector<CoinBigIndex> starts{0};
  std::vector<int> rows;
  std::vector<double> values;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = candidates.empty() ? k : candidates[k];
    for (std::size_t j = 0; j < constraints.rows.size(); ++j) {
      const double a = constraints.rows[j].coefficients[i];
      if (a == 0.0) continue;
      rows.push_back(static_cast<int>(j));
      values.push_back(a);
    }
    starts.push_back(static_cast<CoinBigIndex>(values.size()));
  }
  return {true,
          static_cast<int>(constraints.rows.size()),
          static_cast<int>(count),
          starts.back(),
          values.data(),
          rows.data(),
          starts.data(),
          nullptr};
}

double clp_bound(double bound) {
  return std::isfinite(bound) ? bound : std::copysign(COIN_DBL_MAX, bound);
}

}  // namespace

LinearOptimum maximise_linear(const DesignConstraints& constraints,
                              std::span<const std::size_t> candidates,
                              std::span<const double> gains) {
  const std::size_t count = gains.size();
  constexpr double kTolerance = 1e-10;  // Clp's own is 1e-7, more than the gaps asked for
  double scale = 0.0;
  for (const double gain : gains) scale = std::max(scale, std::abs(gain));
  if (scale == 0.0) scale = 1.0;
  std::vector<double> cost(count), lower(count), upper(count), row_lower, row_upper;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = candidates.empty() ? k : candidates[k];
    cost[k] = -gains[k] / scale;
    lower[k] = constraints.lower_of(i);
    upper[k] = clp_bound(constraints.upper_of(i));
  }
  for (const LinearConstraint& row : constraints.rows) {
    row_lower.push_back(clp_bound(row.lower));
    row_upper.push_back(clp_bound(row.upper));
  }
  ClpSimplex simplex;
  simplex.setLogLevel(0);
  simplex.setPrimalTolerance(kTolerance);
  simplex.setDualTolerance(kTolerance);
  simplex.loadProblem(columns_of(constraints, candidates, count), lower.data(), upper.data(),
                      cost.data(), row_lower.data(), row_upper.data());
  simplex.primal();
  LinearOptimum optimum;
  if (simplex.isProvenPrimalInfeasible()) {
    optimum.status = LinearStatus::kInfeasible;
  } else if (simplex.isProvenOptimal()) {
    optimum.status = LinearStatus::kOptimal;
  }
  if (optimum.status != LinearStatus::kOptimal) return optimum;
  const double* x = simplex.getColSolution();
  optimum.efforts.assign(x, x + count);
  const double* price = simplex.getRowPrice();
  for (std::size_t j = 0; j < constraints.rows.size(); ++j) {
    optimum.multipliers.push_back(-price[j] * scale);
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
