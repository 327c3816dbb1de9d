// WorkingSet: D-optimal design restricted to a few dozen candidates, solved by Newton's method to
// full precision: the inner problem of column_generation.
//
// Mathematics. On the working set the scale-free form of (9),
//
//   maximise  f(lambda) = log det M(lambda) - d sum_i lambda_i,   lambda >= 0,
//
// has the same optimum as the simplex form: since sum_i lambda_i w_i = tr(M^-1 M) = d, its optimum
// has sum_i lambda_i = 1 of itself. With M = L L^T and B_i = L^-1 H_i L^-T,
//
//   gradient   w_i - d,  w_i = tr(B_i)          Hessian  -S,  S_ij = tr(B_i B_j),
//
// and S lambda = w because sum_i lambda_i B_i = I. The second-order model about lambda, written in
// the new weights mu = lambda + step, is therefore
//
//   minimise  mu^T S mu / 2 - (2 w - d 1)^T mu,   mu >= 0,
//
// a non-negative least-squares problem whose warm start is the present support
// (nonnegative_quadratic.hpp). S is singular where the optimum is not unique (ties, duplicates), so
// a proximal term rho |mu - lambda|^2 / 2 with rho = min(1e-6, gap) tr(S)/n is added: it does not
// move the fixed points. It shrinks with the gap, down to 1e-9, for weight must move between close
// neighbours of a fine grid. With B_i - B_j of size delta the model's curvature is delta^2 only,
// and a larger rho would leave small steps. Far from the optimum the step is shortened until f
// increases enough; near it
// the full step converges quadratically.
//
// Near copies (entries equal to seven digits) would fill the working set with ties. A candidate
// without weight that nearly equals a member takes its place where its sensitivity is larger, and
// is left out otherwise. Is one of two enough? Let them differ by delta, relative to M. By swapping
// weight between them, their difference of sensitivities changes by the order of delta^2 only. So
// either is the better one nearly always. Where not, the candidate that was replaced comes back,
// and then both stay. In ill-conditioned coordinates digits of entries say little of delta, and
// nothing is replaced.
//
// Copies and near copies are looked for among the members whose mark, a fixed linear function of
// the matrix, is near enough. So a violator costs O(n + p), not O(n p), also where most entries are
// equal, as on the grids of a factorial design.
//
// Members without weight and with w_i <= d can't enter in the next step, so S is formed only for
// the n others. Cost of one Newton step: n d^3 (whitening) + n^2 p / 2 (S) + pivots * n^3 / 3.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "problems/base/aligned_array.hpp"
#include "solvers/core/inverse_cholesky.hpp"
#include "solvers/core/sensitivity_error.hpp"
#include "solvers/restricted_problem/nonnegative_quadratic.hpp"

namespace graybox {

enum class WorkingSetStatus {
  kConverged,   // max w_i / d - 1 over the working set is at most the tolerance
  kStopped,     // the step limit came first, or it was asked to stop
  kNoProgress,  // rounding: no step increases log det any more
  kSingular,    // M is singular on this working set
};

class WorkingSet {
 public:
  explicit WorkingSet(std::size_t dimension);

  void clear();
  // Adds a candidate with its packed matrix, which is copied. One that is there already, or whose
  // matrix equals a member's to the last bit, only has its weight added to that member's. A near
  // copy without weight may take a member's place, by inverse(). Returns true if it is new.
  bool add(std::size_t candidate, const double* information, double weight);
  // Drops members of zero weight whose sensitivity is below `sensitivity`.
  void drop_below(double sensitivity);

  // Newton steps until the gap on the working set is at most `tolerance`.
  WorkingSetStatus optimise(double tolerance, int step_limit);
  // What column generation asks after pricing a pool whose gap is `pool_gap`, on the way to
  // `tolerance`. It does optimise() a good deal more precisely than that gap, but no more than the
  // next pricing can use. Then it drops the members that have left the support and would not come
  // back.
  WorkingSetStatus improve(double pool_gap, double tolerance);
  // M, its inverse and nothing else for the present weights. False if M is singular.
  [[nodiscard]] bool refresh();

  [[nodiscard]] std::size_t size() const { return indices_.size(); }
  [[nodiscard]] std::span<const std::size_t> indices() const { return indices_; }
  [[nodiscard]] std::span<const double> weights() const { return weights_; }
  [[nodiscard]] std::size_t dimension() const { return dimension_; }
  [[nodiscard]] std::span<const double> information() const { return matrix_; }  // M, packed
  [[nodiscard]] const InverseCholesky& inverse() const { return inverse_; }
  // How far rounding can move sensitivities that are computed with inverse(), relatively.
  [[nodiscard]] double sensitivity_error() const {
    return graybox::sensitivity_error(matrix_, inverse_.trace_dual(), dimension_, size());
  }
  [[nodiscard]] double gap() const { return gap_; }
  [[nodiscard]] std::int64_t newton_steps() const { return newton_steps_; }

 private:
  struct Mark {
    double value = 0.0, slack = 0.0;
  };
  // What tells copies and near copies.
  struct Copies {
    std::vector<double> directions;     // of mark_of()
    std::vector<double> marks;          // mark_of() the members
    std::vector<std::size_t> replaced;  // candidates whose place a near copy has taken
  };
  void reserve(std::size_t members);
  void reserve_active();
  [[nodiscard]] Mark mark_of(const double* information) const;
  [[nodiscard]] std::optional<std::size_t> near_copy(std::size_t candidate,
                                                     const double* information, Mark mark) const;
  [[nodiscard]] bool take_place(std::size_t member, std::size_t candidate,
                                const double* information, Mark mark);
  void information(std::span<const double> weights, std::span<double> packed) const;
  void normalise();
  void choose_active();
  bool newton_target();
  bool multiplicative_steps(int count);
  bool search_line();

  std::size_t dimension_;
  std::size_t packed_size_;
  std::size_t stride_;  // row length of whitened_, a multiple of 8
  std::vector<std::size_t> indices_;
  std::vector<double> weights_;
  std::vector<double> rows_;  // copies of the members' packed matrices
  Copies copies_;
  AlignedArray whitened_;  // B_i, scaled so that rows multiply to tr(B_i B_j)
  std::size_t whitened_rows_ = 0;
  std::vector<double> sensitivity_;  // w_i of all members
  std::vector<std::size_t> active_;  // members with weight, or that want to enter
  std::vector<double> active_sensitivity_;
  AlignedArray hessian_;  // S, lower triangle, column-major
  std::vector<double> linear_;
  std::vector<double> target_;  // mu
  std::vector<double> trial_weights_;
  std::vector<double> regular_weights_;  // the last for which M was regular
  std::vector<double> scratch_;
  std::vector<double> matrix_;  // M, packed
  std::vector<double> target_matrix_;
  std::vector<double> trial_matrix_;
  InverseCholesky inverse_;
  InverseCholesky trial_;
  NonnegativeQuadratic quadratic_;
  double gap_ = 0.0;
  std::int64_t newton_steps_ = 0;
};

}  // namespace graybox
