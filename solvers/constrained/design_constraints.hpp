// DesignConstraints: what a design has to obey beyond the simplex, and what is known before it.
//
//   maximise  Phi(P + sum_i x_i H_i)   subject to   l_i <= x_i <= u_i,
//                                                   L_j <= sum_i a_ji x_i <= U_j,  j = 0 .. m-1
//
// x_i is how often candidate i is run, a real number here ("effort"; exact designs round it). P is
// the information of earlier trials, and Phi a criterion of criterion.hpp. Row 0 bounds the effort:
// its coefficients are positive and its U_0 is finite, so that the set is compact. It is the number
// of experiments (a = 1, L = U = N) or a budget (a = the costs, U = B). With P = 0, N = 1 and
// nothing else this is the problem of solver.hpp.
//
//   graybox::DesignConstraints constraints = graybox::number_of_experiments(set, 20.0);
//   constraints.upper.assign(set.candidate_count(), 1.0);      // each candidate at most once
//   constraints.rows.push_back({.name = "left side", .coefficients = is_left, .upper = 6.0});
//   const auto answer = graybox::solve_constrained(set, constraints, {.duality_gap = 1e-9});
//   const auto proof = graybox::certify_constrained(set, answer.efforts, constraints);
#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "problems/information/information_set.hpp"

namespace graybox {

struct LinearConstraint {
  std::string name;                  // for messages
  std::vector<double> coefficients;  // a_j, Q numbers
  double lower = -std::numeric_limits<double>::infinity();
  double upper = std::numeric_limits<double>::infinity();
};

struct DesignConstraints {
  std::vector<LinearConstraint> rows;  // row 0 bounds the effort
  std::vector<double> lower = {};      // l, Q numbers; empty: zeros
  std::vector<double> upper = {};      // u, Q numbers, infinity allowed; empty: infinities
  std::vector<double> prior = {};      // P, packed lower triangle; empty: zero

  [[nodiscard]] double lower_of(std::size_t i) const { return lower.empty() ? 0.0 : lower[i]; }
  [[nodiscard]] double upper_of(std::size_t i) const {
    return upper.empty() ? std::numeric_limits<double>::infinity() : upper[i];
  }
  // The largest x_i that the candidate's own limit and row 0 leave.
  [[nodiscard]] double largest_effort(std::size_t i) const;
};

// Row 0 alone: sum_i x_i = N, and sum_i c_i x_i <= B. Throw InputError unless N, B and all costs
// are positive and finite.
[[nodiscard]] DesignConstraints number_of_experiments(const InformationSet& set, double number);
[[nodiscard]] DesignConstraints cost_budget(std::vector<double> costs, double budget);

// Throws InputError where sizes, signs or order of the limits are wrong, a number is not finite,
// row 0 does not bound the effort, or P is not positive semidefinite (to 1e-9 of its largest
// eigenvalue). Whether any design obeys them is linear_programme.hpp's to say.
void require_fits(const DesignConstraints& constraints, const InformationSet& set);

// a_j . x
[[nodiscard]] double row_value(const LinearConstraint& row, std::span<const double> efforts);

// How far x is outside, relative: of a row to the largest |a_ji x_i| summed and its bound, of a
// limit to max(bound, 1e-3 of the largest effort).
[[nodiscard]] double largest_violation(const DesignConstraints& constraints,
                                       std::span<const double> efforts);

}  // namespace graybox
