// Efficient rounding (Pukelsheim and Rieder 1992, Biometrika 79, 763-770): multiplier M - s/2 for s
// support points,
//
//   m_i = ceil((M - s/2) lambda_i),
//   sum(m) < M:  m_k = m_k + 1 where m_k / lambda_k is smallest,
//   sum(m) > M:  m_k = m_k - 1 where (m_k - 1) / lambda_k is largest.
//
// Among all ways of rounding it guarantees the largest min_i m_i / (M lambda_i). The theory asks
// for M >= s; with fewer experiments the same discarding goes on below one run a support point, the
// lightest first. Ties: the first index. O(Q + s^2).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "solvers/exact/exact_method.hpp"

namespace graybox {

[[nodiscard]] std::vector<std::int64_t> round_weights_efficiently(std::span<const double> weights,
                                                                  std::int64_t experiments);

class EfficientRounding : public ExactMethod {
 public:
  [[nodiscard]] std::string_view name() const override { return "efficient_rounding"; }
  [[nodiscard]] std::string_view description() const override {
    return "apportionment by ceilings and quotients (Pukelsheim and Rieder 1992)";
  }
  [[nodiscard]] ExactSolution solve(const InformationSet& set, const Relaxation& relaxation,
                                    const ExactOptions& options,
                                    ExactObserver* observer = nullptr) const override;
};

}  // namespace graybox
