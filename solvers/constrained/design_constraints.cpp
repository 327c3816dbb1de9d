#include "solvers/constrained/design_constraints.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"

namespace graybox {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kSmallest = 1e-50, kLargest = 1e50;  // of numbers and costs of experiments

void require_positive(double number, const char* what) {
  if (!(number >= kSmallest && number <= kLargest)) {
    throw InputError(fmt::format("{} must be a positive number from {:g} to {:g}, is {:g}", what,
                                 kSmallest, kLargest, number));
  }
}

void require_size(const std::vector<double>& values, std::size_t count, const std::string& what) {
  if (values.size() != count) {
    throw InputError(fmt::format("{}: {} numbers for {} candidates; give one for each", what,
                                 values.size(), count));
  }
}

void require_limits(const DesignConstraints& constraints, std::size_t count) {
  if (!constraints.lower.empty()) require_size(constraints.lower, count, "lower limits");
  if (!constraints.upper.empty()) require_size(constraints.upper, count, "upper limits");
  for (std::size_t i = 0; i < count; ++i) {
    const double lower = constraints.lower_of(i), upper = constraints.upper_of(i);
    if (!(lower >= 0.0 && std::isfinite(lower)) || !(upper >= 0.0)) {
      throw InputError(fmt::format(
          "limits of candidate {}: {:g} to {:g}; they must be numbers, not negative, the lower one "
          "finite",
          i, lower, upper));
    }
    if (lower > upper) {
      throw InputError(fmt::format(
          "candidate {} is required {:g} times, but at most {:g} are allowed; change one of them",
          i, lower, upper));
    }
  }
}

void require_row(const LinearConstraint& row, std::size_t count) {
  require_size(row.coefficients, count, fmt::format("constraint '{}'", row.name));
  if (!std::ranges::all_of(row.coefficients, [](double a) { return std::isfinite(a); })) {
    throw InputError(fmt::format("constraint '{}': every coefficient must be finite", row.name));
  }
  if (std::isnan(row.lower) || std::isnan(row.upper) || row.lower > row.upper) {
    throw InputError(fmt::format("constraint '{}': at least {:g} and at most {:g} contradict",
                                 row.name, row.lower, row.upper));
  }
  if (row.lower == -kInfinity && row.upper == kInfinity) {
    throw InputError(
        fmt::format("constraint '{}' has no bound; give at_most, at_least or equal", row.name));
  }
}

void require_semidefinite(const std::vector<double>& prior, std::size_t dimension) {
  if (prior.size() != packed_size(dimension) ||
      !std::ranges::all_of(prior, [](double x) { return std::isfinite(x); })) {
    throw InputError(
        fmt::format("prior information: expected a finite {0} x {0} matrix", dimension));
  }
  const auto d = static_cast<Eigen::Index>(dimension);
  Eigen::MatrixXd full(d, d);
  unpack(prior.data(), dimension, full.data());
  const Eigen::VectorXd eigenvalues =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(full, Eigen::EigenvaluesOnly).eigenvalues();
  if (eigenvalues(0) < -1e-9 * std::max(eigenvalues(d - 1), 0.0)) {
    throw InputError(
        fmt::format("prior information: not positive semidefinite, its smallest eigenvalue is {:g}",
                    eigenvalues(0)));
  }
}

}  // namespace

double DesignConstraints::largest_effort(std::size_t i) const {
  return std::min(upper_of(i), rows.front().upper / rows.front().coefficients[i]);
}

DesignConstraints number_of_experiments(const InformationSet& set, double number) {
  require_positive(number, "the number of experiments");
  DesignConstraints constraints;
  constraints.rows.push_back({.name = "number of experiments",
                              .coefficients = std::vector<double>(set.candidate_count(), 1.0),
                              .lower = number,
                              .upper = number});
  return constraints;
}

DesignConstraints cost_budget(std::vector<double> costs, double budget) {
  require_positive(budget, "the budget");
  for (std::size_t i = 0; i < costs.size(); ++i) {
    require_positive(costs[i], fmt::format("the cost of candidate {}", i).c_str());
  }
  DesignConstraints constraints;
  constraints.rows.push_back({.name = "budget", .coefficients = std::move(costs), .upper = budget});
  return constraints;
}

void require_fits(const DesignConstraints& constraints, const InformationSet& set) {
  const std::size_t count = set.candidate_count();
  if (constraints.rows.empty()) {
    throw InputError("no row bounds the effort; give a number of experiments or a budget");
  }
  for (const LinearConstraint& row : constraints.rows) require_row(row, count);
  const LinearConstraint& total = constraints.rows.front();
  if (!std::ranges::all_of(total.coefficients, [](double a) { return a > 0.0; }) ||
      !(total.upper > 0.0 && std::isfinite(total.upper))) {
    throw InputError(fmt::format("constraint '{}' must bound the effort: all coefficients positive",
                                 total.name));
  }
  require_limits(constraints, count);
  if (!constraints.prior.empty()) require_semidefinite(constraints.prior, set.dimension());
}

double row_value(const LinearConstraint& row, std::span<const double> efforts) {
  double value = 0.0;
  for (std::size_t i = 0; i < efforts.size(); ++i) {
    if (efforts[i] != 0.0) value += row.coefficients[i] * efforts[i];
  }
  return value;
}

double largest_violation(const DesignConstraints& constraints, std::span<const double> efforts) {
  double largest = 0.0, most = 0.0;
  for (const double x : efforts) most = std::max(most, std::abs(x));
  for (std::size_t i = 0; i < efforts.size(); ++i) {
    const double lower = constraints.lower_of(i), upper = constraints.upper_of(i);
    const double outside = std::max(lower - efforts[i], efforts[i] - upper);
    if (outside <= 0.0) continue;
    const double bound = efforts[i] > upper ? upper : lower;
    largest = std::max(largest, outside / std::max(bound, 1e-3 * most));
  }
  for (const LinearConstraint& row : constraints.rows) {
    double value = 0.0, magnitude = 0.0;
    for (std::size_t i = 0; i < efforts.size(); ++i) {
      value += row.coefficients[i] * efforts[i];
      magnitude += std::abs(row.coefficients[i] * efforts[i]);
    }
    const double outside = std::max(row.lower - value, value - row.upper);
    if (outside <= 0.0) continue;
    const double bound = std::abs(value > row.upper ? row.upper : row.lower);
    largest = std::max(largest, outside / std::max({magnitude, bound, 1e-300}));
  }
  return largest;
}

}  // namespace graybox
