// A number whose sign is a bit of its own, read as one without sign: 33068 is -300 where bit 15 is
// the sign, as in the telemetry of serial-bus servos. (A two's complement is a wrap of a counter.)
//
// Rule: whole numbers from 0 on, of more than 16 levels, whose largest has one of the bits 10, 11,
// 15 and 31 as its highest. Three values or more have the bit. With the bit as the sign, the steps'
// rms is below 0.4 of what it is without; a two's complement comes to 0.5. Cost: O(n log n).
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

namespace graybox {

struct SignBit {
  int bit;
  double example;  // the largest value that has the bit

  // What the value was.
  [[nodiscard]] double signed_of(double value) const;
  [[nodiscard]] Eigen::VectorXd signed_of(const Eigen::Ref<const Eigen::VectorXd>& values) const;
  // "bit 15 as its sign, with which 33068 is -300".
  [[nodiscard]] std::string words() const;
  // "32768 - x for each x from 32768 on", which no preprocess does.
  [[nodiscard]] std::string mend() const;
};

[[nodiscard]] std::optional<SignBit> find_sign_bit(const Eigen::Ref<const Eigen::VectorXd>& values);

}  // namespace graybox
