// The paper's rounding (Section IV, footnote 3): m = round(M lambda), then, until the counts sum to
// M,
//
//   sum(m) > M:  m_k = m_k - 1 where m - M lambda is largest,
//   sum(m) < M:  m_k = m_k + 1 where m - M lambda is smallest.
//
// As in Matlab, halves round away from zero and ties go to the first index. Counts stay
// non-negative: where sum(m) > M some m_k > M lambda_k >= 0. O(Q) plus one search a correction.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "solvers/exact/exact_method.hpp"

namespace graybox {

[[nodiscard]] std::vector<std::int64_t> round_weights(std::span<const double> weights,
                                                      std::int64_t experiments);

class Rounding : public ExactMethod {
 public:
  [[nodiscard]] std::string_view name() const override { return "rounding"; }
  [[nodiscard]] std::string_view description() const override {
    return "round(M lambda), corrected to M experiments (the paper's footnote 3)";
  }
  [[nodiscard]] ExactSolution solve(const InformationSet& set, const Relaxation& relaxation,
                                    const ExactOptions& options,
                                    ExactObserver* observer = nullptr) const override;
};

}  // namespace graybox
