// ExactDesign: how often to run each candidate experiment. Counts m_i are whole numbers,
//
//   maximise  log det M(m),  M(m) = sum_i m_i H_i,   m_i in {0, 1, 2, ...},  sum_i m_i = M
//
// (paper, formula (8), with V(m) = (det M(m))^(-1/d) for the covariance, as in its Figure 4).
#pragma once

#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

#include "solvers/core/design.hpp"

namespace graybox {

struct ExactDesign {
  std::vector<std::int64_t> counts;  // length Q

  [[nodiscard]] std::int64_t experiments() const {  // M
    return std::accumulate(counts.begin(), counts.end(), std::int64_t{0});
  }
  // m / M: the same experiments as an approximate design. Counts must not all be zero.
  [[nodiscard]] Design weights() const {
    const auto total = static_cast<double>(experiments());
    Design design;
    design.weights.reserve(counts.size());
    for (const std::int64_t count : counts) {
      design.weights.push_back(static_cast<double>(count) / total);
    }
    return design;
  }
};

}  // namespace graybox
