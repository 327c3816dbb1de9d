// Bins of several periods, and the lines of one period among them: every P-th bin is a line.
#pragma once

#include <Eigen/Core>

#include "diagnosis/harmonic_balance/periodic_data.hpp"

namespace graybox {

// The line of the period that a bin of P periods is nearest to.
[[nodiscard]] inline Eigen::Index nearest_line(Eigen::Index bin, Eigen::Index periods) {
  return (bin + (periods - 1) / 2) / periods;
}
// Whether a bin is no line itself and lies beside one that counts.
[[nodiscard]] inline bool counts_between_lines(const PeriodicData& data, Eigen::Index bin,
                                               Eigen::Index periods) {
  const Eigen::Index line = nearest_line(bin, periods);
  return bin % periods != 0 && line >= data.first_line && line <= data.last_line;
}

}  // namespace graybox
