#include "diagnosis/log_columns/sign_bit.hpp"

#include <fmt/format.h>

#include <cmath>

#include "diagnosis/signal_faults/sample_statistics.hpp"

namespace graybox {
namespace {

double square_of_steps(const Eigen::VectorXd& values) { return steps_of(values).squaredNorm(); }

}  // namespace

double SignBit::signed_of(double value) const {
  const double size = std::ldexp(1.0, bit);
  return value >= size ? size - value : value;
}

Eigen::VectorXd SignBit::signed_of(const Eigen::Ref<const Eigen::VectorXd>& values) const {
  return values.unaryExpr([this](double value) { return signed_of(value); });
}

std::string SignBit::words() const {
  return fmt::format("bit {} as its sign, with which {:.10g} is {:.10g}", bit, example,
                     signed_of(example));
}

std::string SignBit::mend() const {
  const double size = std::ldexp(1.0, bit);
  return fmt::format("{:.10g} - x for each x from {:.10g} on", size, size);
}

std::optional<SignBit> find_sign_bit(const Eigen::Ref<const Eigen::VectorXd>& values) {
  constexpr Eigen::Index kFewest = 3;
  constexpr double kSmoother = 0.4;  // of the steps
  if (values.size() < 2 || !values.allFinite() || values.minCoeff() < 0.0) return {};
  if (!(values.array() == values.array().round()).all() || has_few_levels(values)) return {};
  const double largest = values.maxCoeff();
  for (const int bit : {10, 11, 15, 31}) {
    const double size = std::ldexp(1.0, bit);
    if (largest < size || largest >= 2.0 * size) continue;
    if ((values.array() >= size).count() < kFewest) return {};
    const SignBit found{bit, largest};
    const double with = square_of_steps(found.signed_of(values));
    if (!(with < kSmoother * kSmoother * square_of_steps(values))) return {};
    return found;
  }
  return {};
}

}  // namespace graybox
