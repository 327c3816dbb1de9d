// WhitenedPool: the candidates that an exact method still considers, in coordinates where the
// relaxed optimum is the identity:
//
//   B_i = X H_i X^T,   X M(lambda) X^T = I,
//   log det sum_i m_i H_i = log det sum_i m_i B_i + shift,
//   shift = -2 log det X.
//
// Any regular X would do; this one makes plain double arithmetic accurate, since M(m)/M is close to
// the identity for every design of interest. The products are formed in extended precision, O(d^3)
// a candidate, and stored packed like an InformationSet.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "problems/base/stop.hpp"
#include "problems/information/information_set.hpp"
#include "solvers/exact_bounds/relaxation.hpp"

namespace graybox {

class WhitenedPool {
 public:
  // `candidates` of the set, in that order. Throws Stopped where the clock says so.
  WhitenedPool(const InformationSet& set, const Relaxation& relaxation,
               std::span<const std::size_t> candidates, int threads,
               StopClock clock = StopClock::never());

  [[nodiscard]] std::size_t size() const { return candidates_.size(); }
  [[nodiscard]] std::size_t dimension() const { return dimension_; }
  [[nodiscard]] std::size_t packed_size() const { return packed_size_; }
  [[nodiscard]] std::span<const std::size_t> candidates() const { return candidates_; }
  [[nodiscard]] const double* rows() const { return rows_.data(); }
  [[nodiscard]] std::span<const double> row(std::size_t k) const {
    return {rows_.data() + k * packed_size_, packed_size_};
  }
  [[nodiscard]] double largest_norm() const { return largest_norm_; }  // max_i ||B_i||_F
  [[nodiscard]] std::size_t largest_rank() const { return largest_rank_; }
  [[nodiscard]] double log_det_shift() const { return log_det_shift_; }

  // Bound on the error of tr(W B_i), for W = X^T X as computed, divided by tr(W)
  // (box_bound.hpp, "Rounding").
  [[nodiscard]] double sensitivity_rounding() const;

 private:
  std::size_t dimension_;
  std::size_t packed_size_;
  std::vector<std::size_t> candidates_;
  AlignedArray rows_;
  std::size_t largest_rank_;
  double largest_norm_ = 0.0;
  double log_det_shift_ = 0.0;
};

// sum_i counts_i B_i, packed, of all candidates of the set. The sum is formed before it is
// whitened: O(d^3) however many candidates there are.
[[nodiscard]] std::vector<double> whitened_sum(const InformationSet& set,
                                               const Relaxation& relaxation,
                                               std::span<const std::int64_t> counts);

}  // namespace graybox
