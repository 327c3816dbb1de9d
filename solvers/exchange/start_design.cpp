#include "solvers/exchange/start_design.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "solvers/core/sensitivity.hpp"

namespace graybox {
namespace {

Eigen::MatrixXd full_matrix(std::span<const double> packed, std::size_t dimension) {
  const auto d = static_cast<Eigen::Index>(dimension);
  Eigen::MatrixXd full(d, d);
  unpack(packed.data(), dimension, full.data());
  return full;
}

// Inverse R of a Cholesky factor: R matrix R^T = I, by way of unit diagonal.
Eigen::MatrixXd whitening_factor(const Eigen::MatrixXd& matrix) {
  const Eigen::VectorXd scale = matrix.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::LLT<Eigen::MatrixXd> factor(scale.asDiagonal() * matrix * scale.asDiagonal());
  if (factor.info() != Eigen::Success) {
    throw InputError("information set: the sum of all information matrices is singular");
  }
  const Eigen::Index d = matrix.rows();
  return factor.matrixL().solve(Eigen::MatrixXd::Identity(d, d)) * scale.asDiagonal();
}

}  // namespace

std::vector<std::size_t> start_design(const ConditionedSet& conditioned, Tracer& tracer) {
  const InformationSet& set = conditioned.set();
  const std::size_t d = set.dimension();
  const Eigen::MatrixXd r = whitening_factor(full_matrix(conditioned.uniform_information(), d));
  Eigen::MatrixXd chosen = Eigen::MatrixXd::Zero(r.rows(), r.cols());  // M_k, whitened
  Eigen::MatrixXd weighing = r.transpose() * r;                        // v v^T, or I at first
  std::vector<double> dual(set.packed_size()), value(set.candidate_count());
  std::vector<std::size_t> choices;
  for (std::size_t k = 0; k < d && !tracer.out_of_time(); ++k) {
    pack_trace_dual(weighing.data(), d, dual.data());
    sensitivities(set, dual, value);
    tracer.count_passes(1.0);
    choices.push_back(static_cast<std::size_t>(std::ranges::max_element(value) - value.begin()));
    chosen += r * full_matrix(set.information(choices.back()), d) * r.transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(chosen);
    const Eigen::VectorXd v = r.transpose() * eigen.eigenvectors().col(0);
    weighing = v * v.transpose();
  }
  return choices;
}

}  // namespace graybox
