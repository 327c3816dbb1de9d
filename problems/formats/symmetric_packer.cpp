#include "problems/formats/symmetric_packer.hpp"

#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"

namespace graybox {

std::size_t dimension_from_packed_size(std::size_t packed) {
  const auto d =
      static_cast<std::size_t>((std::sqrt(8.0 * static_cast<double>(packed) + 1.0) - 1.0) / 2.0);
  for (const std::size_t candidate : {d, d + 1}) {
    if (candidate > 0 && packed_size(candidate) == packed) return candidate;
  }
  return 0;
}

SymmetricPacker::SymmetricPacker(std::string source, std::size_t dimension, std::size_t count,
                                 double tolerance)
    : source_(std::move(source)),
      dimension_(dimension),
      tolerance_(tolerance),
      packed_(count * packed_size(dimension)) {}

void SymmetricPacker::add(const double* full, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) add_one(full + i * dimension_ * dimension_);
}

void SymmetricPacker::add_one(const double* full) {
  const std::size_t d = dimension_;
  double* packed = packed_.data() + next_ * packed_size(d);
  for (std::size_t j = 0; j < d; ++j) {
    for (std::size_t k = 0; k <= j; ++k) {
      const double lower = full[j * d + k];
      const double upper = full[k * d + j];
      const double scale = std::sqrt(std::abs(full[j * d + j] * full[k * d + k]));
      const double difference = std::abs(lower - upper);
      if (std::isfinite(lower) && std::isfinite(upper) && difference > tolerance_ * scale) {
        throw InputError(fmt::format(
            "{}: candidate {}: not symmetric: entries ({}, {}) and ({}, {}) are {:.9g} and {:.9g}, "
            "{:.1e} of the diagonal's scale apart (at most {:.0e}); store (H + H')/2",
            source_, next_, k, j, j, k, upper, lower, difference / scale, tolerance_));
      }
      // Exact where both agree; else the symmetric part. A NaN stays for require_finite to name.
      *packed++ = lower == upper ? lower : 0.5 * lower + 0.5 * upper;
    }
  }
  ++next_;
}

AlignedArray SymmetricPacker::take() { return std::move(packed_); }

void require_finite(const std::string& source, const AlignedArray& packed, std::size_t dimension) {
  const std::size_t p = packed_size(dimension);
  for (std::size_t i = 0; i < packed.size(); ++i) {
    if (std::isfinite(packed[i])) continue;
    std::size_t row = 0;
    while (packed_size(row + 1) <= i % p) ++row;
    throw InputError(
        fmt::format("{}: candidate {}: entry ({}, {}) is {}; remove or repair that "
                    "candidate",
                    source, i / p, row, i % p - packed_size(row), packed[i]));
  }
}

}  // namespace graybox
