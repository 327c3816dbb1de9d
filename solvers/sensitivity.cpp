#include "graybox/solvers/sensitivity.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "graybox/problems/kernels/kernels.hpp"
#include "graybox/problems/packed_matrix.hpp"

namespace graybox {

void information_matrix(const InformationSet& set, std::span<const double> weights,
                        std::span<double> packed) {
  std::ranges::fill(packed, 0.0);
  const std::size_t p = set.packed_size();
  const std::size_t count = set.candidate_count();
  const auto& kernel = kernels();
  // Runs of non-zero weights go to the kernel together; zeros cost nothing.
  for (std::size_t begin = 0; begin < count;) {
    if (weights[begin] == 0.0) {
      ++begin;
      continue;
    }
    std::size_t end = begin + 1;
    while (end < count && weights[end] != 0.0) ++end;
    kernel.accumulate(set.data() + begin * p, end - begin, p, weights.data() + begin,
                      packed.data());
    begin = end;
  }
}

bool invert(std::span<const double> packed, std::size_t dimension, InverseFactor& factor) {
  const auto d = static_cast<Eigen::Index>(dimension);
  Eigen::MatrixXd matrix(d, d);
  unpack(packed.data(), dimension, matrix.data());
  Eigen::VectorXd scale(d);
  factor.log_det = 0.0;
  for (Eigen::Index i = 0; i < d; ++i) {
    if (!(matrix(i, i) > 0.0) || !std::isfinite(matrix(i, i))) return false;
    scale(i) = 1.0 / std::sqrt(matrix(i, i));
    factor.log_det += std::log(matrix(i, i));
  }
  matrix = scale.asDiagonal() * matrix * scale.asDiagonal();
  const Eigen::LLT<Eigen::MatrixXd> cholesky(matrix);
  if (cholesky.info() != Eigen::Success) return false;
  const double smallest = cholesky.matrixLLT().diagonal().minCoeff();
  if (!(smallest * smallest >
        4.0 * static_cast<double>(d) * std::numeric_limits<double>::epsilon())) {
    return false;
  }
  factor.log_det += 2.0 * cholesky.matrixLLT().diagonal().array().log().sum();
  Eigen::MatrixXd inverse = cholesky.solve(Eigen::MatrixXd::Identity(d, d));
  inverse = scale.asDiagonal() * inverse * scale.asDiagonal();
  factor.trace_dual.resize(graybox::packed_size(dimension));
  pack_trace_dual(inverse.data(), dimension, factor.trace_dual.data());
  return true;
}

void sensitivities(const InformationSet& set, std::span<const double> trace_dual,
                   std::span<double> out) {
  kernels().price(set.data(), set.candidate_count(), set.packed_size(), trace_dual.data(),
                  out.data());
}

double duality_gap(const InformationSet& set, std::span<const double> weights) {
  std::vector<double> packed(set.packed_size());
  information_matrix(set, weights, packed);
  InverseFactor factor;
  if (!invert(packed, set.dimension(), factor)) return std::numeric_limits<double>::infinity();
  std::vector<double> sensitivity(set.candidate_count());
  sensitivities(set, factor.trace_dual, sensitivity);
  return *std::ranges::max_element(sensitivity) / static_cast<double>(set.dimension()) - 1.0;
}

}  // namespace graybox
