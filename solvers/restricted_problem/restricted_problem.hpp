// RestrictedProblem: optimal design restricted to a few dozen candidates, for criteria other than
// D: the inner problem of criterion_column_generation.hpp. Two kinds:
//
//   smooth_restricted_problem      all but E, by Newton's method
//   eigenvalue_restricted_problem  E, by a primal-dual interior point
//
// Both hand out the matrix G whose sensitivities tr(G H_i) prove the design optimal where none
// exceeds one (certificate.hpp).
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/core/criterion.hpp"

namespace graybox {

class RestrictedProblem {
 public:
  explicit RestrictedProblem(std::size_t dimension);
  virtual ~RestrictedProblem() = default;
  RestrictedProblem(const RestrictedProblem&) = delete;
  RestrictedProblem& operator=(const RestrictedProblem&) = delete;

  // Adds a candidate with its packed matrix, which is copied. One that is there already, or whose
  // matrix equals a member's to the last bit, only has its weight added to that member's. Returns
  // true if it is new.
  bool add(std::size_t candidate, const double* information, double weight);

  // Solves, on the way to `tolerance`, over the members to a gap of about a tenth of pool_gap, or
  // of its square. Here pool_gap is the gap over the pool priced last. Then drops members that have
  // left the support and would not come back. False where no further progress is possible.
  virtual bool improve(double pool_gap, double tolerance) = 0;
  // Weights on the simplex, M and G for the present weights. False if M is singular.
  [[nodiscard]] virtual bool refresh() = 0;
  // G in trace-dual packing.
  [[nodiscard]] virtual std::span<const double> trace_dual() const = 0;
  // Criterion E: the packed dual matrix, of trace one in the set's own coordinates; else empty.
  [[nodiscard]] virtual std::vector<double> dual_matrix() const { return {}; }
  // Criterion G over a region: a weight for each point, of sum one; else empty.
  [[nodiscard]] virtual std::vector<double> dual_weights() const { return {}; }

  // M, packed, of the present weights.
  [[nodiscard]] std::vector<double> information() const;
  [[nodiscard]] std::size_t size() const { return indices_.size(); }
  [[nodiscard]] std::span<const std::size_t> indices() const { return indices_; }
  [[nodiscard]] std::span<const double> weights() const { return weights_; }

 protected:
  [[nodiscard]] const double* row(std::size_t k) const { return rows_.data() + k * packed_size_; }
  void normalise();
  void sum_information(std::span<const double> weights, std::span<double> packed) const;
  // Keeps the members marked.
  void keep(const std::vector<bool>& kept);

  std::size_t dimension_;
  std::size_t packed_size_;
  std::vector<std::size_t> indices_;
  std::vector<double> weights_;
  std::vector<double> rows_;  // copies of the members' packed matrices
};

// The problem of a criterion in the coordinates H_i -> R H_i R^T, R d x d row-major lower
// triangular (the identity if empty). K becomes R K, and lambda_min(M) the smallest generalised
// eigenvalue of M and R R^T. Not for D, nor for G without a region.
[[nodiscard]] std::unique_ptr<RestrictedProblem> make_restricted_problem(
    const Criterion& criterion, std::size_t dimension, std::span<const double> coordinates);

}  // namespace graybox
