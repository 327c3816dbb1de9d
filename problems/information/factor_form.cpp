#include "problems/information/factor_form.hpp"

#include <fmt/format.h>

#include <cmath>

#include "problems/base/error.hpp"

namespace graybox {

void pack_factor(const double* factor, std::size_t rank, std::size_t dimension, double* packed) {
  for (std::size_t i = 0, k = 0; i < dimension; ++i) {
    for (std::size_t j = 0; j <= i; ++j, ++k) packed[k] = factor[i] * factor[j];
  }
  for (std::size_t r = 1; r < rank; ++r) {
    const double* row = factor + r * dimension;
    for (std::size_t i = 0, k = 0; i < dimension; ++i) {
      for (std::size_t j = 0; j <= i; ++j, ++k) packed[k] += row[i] * row[j];
    }
  }
}

void require_finite_factors(const std::string& source, std::span<const double> factors,
                            std::size_t rank, std::size_t dimension) {
  const std::size_t each = rank * dimension;
  for (std::size_t from = 0; from < factors.size(); from += each) {
    double squares = 0.0;
    for (std::size_t k = 0; k < each; ++k) squares += factors[from + k] * factors[from + k];
    if (std::isfinite(squares)) continue;
    for (std::size_t k = 0; k < each; ++k) {
      if (std::isfinite(factors[from + k])) continue;
      throw InputError(
          fmt::format("{}: candidate {}: entry ({}, {}) of the factor is {}; remove or repair that "
                      "candidate",
                      source, from / each, k / dimension, k % dimension, factors[from + k]));
    }
    throw InputError(
        fmt::format("{}: candidate {}: the factor's square overflows; choose other units", source,
                    from / each));
  }
}

}  // namespace graybox
