// Signals whose steps of resolution are large beside what they measure.
//
// Rule: every step is a whole number of the smallest step q (within 2 %), and the error of
// rounding, q/sqrt(12), is above 2 % of the signal's standard deviation. Signals of at most 16
// levels switch and are no matter of resolution, nor are fewer than 100 samples. A motion that was
// measured is no switch: it may have as few as five levels. With less it hardly moves, and its last
// digit flickers. Rates: docs/how_to/faulty_data.md. Cost: O(n).
#pragma once

#include <Eigen/Core>
#include <optional>

namespace graybox {

struct Quantisation {
  double step;      // q
  double error;     // q/sqrt(12) over the standard deviation
  double strength;  // error over its threshold
};

// Whether the values are of a motion that was measured, or of any signal.
enum class SignalKind { kAny, kMeasuredMotion };

[[nodiscard]] std::optional<Quantisation> find_coarse_quantisation(
    const Eigen::Ref<const Eigen::VectorXd>& values, SignalKind kind = SignalKind::kAny);

}  // namespace graybox
