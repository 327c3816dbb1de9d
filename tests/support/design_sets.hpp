// Small information sets for tests, and the transformations under which a D-optimal design must not
// change.
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "problems/information/information_set.hpp"

namespace graybox::testing_sets {

inline InformationSet from_matrices(const std::vector<Eigen::MatrixXd>& matrices) {
  const auto d = static_cast<std::size_t>(matrices.at(0).rows());
  AlignedArray information(matrices.size() * packed_size(d));
  for (std::size_t i = 0; i < matrices.size(); ++i) {
    pack(matrices[i].data(), d, information.data() + i * packed_size(d));
  }
  return InformationSet(d, std::move(information));
}

inline Eigen::MatrixXd matrix_of(const InformationSet& set, std::size_t i) {
  const auto d = static_cast<Eigen::Index>(set.dimension());
  Eigen::MatrixXd full(d, d);
  unpack(set.information(i).data(), set.dimension(), full.data());
  return full;
}

inline std::vector<Eigen::MatrixXd> matrices_of(const InformationSet& set) {
  std::vector<Eigen::MatrixXd> all;
  for (std::size_t i = 0; i < set.candidate_count(); ++i) all.push_back(matrix_of(set, i));
  return all;
}

// log det sum_i weights_i H_i from the full matrices.
inline double log_det(const InformationSet& set, const std::vector<double>& weights) {
  const auto d = static_cast<Eigen::Index>(set.dimension());
  Eigen::MatrixXd m = Eigen::MatrixXd::Zero(d, d);
  for (std::size_t i = 0; i < weights.size(); ++i) m += weights[i] * matrix_of(set, i);
  return std::log(m.determinant());
}

inline Eigen::MatrixXd gaussian(Eigen::Index rows, Eigen::Index columns, Random& random) {
  Eigen::MatrixXd g(rows, columns);
  for (double& x : g.reshaped()) x = random.normal();
  return g;
}

// Wishart matrices G G^T of the given rank, times 10^(decades (u - 1)), u uniform in [0, 1).
inline InformationSet wishart(Eigen::Index d, std::size_t count, Eigen::Index rank,
                              std::uint64_t seed, double decades = 0.0) {
  Random random(seed);
  std::vector<Eigen::MatrixXd> all;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::MatrixXd g = gaussian(d, rank, random);
    all.push_back(std::pow(10.0, decades * (random.uniform() - 1.0)) * g * g.transpose());
  }
  return from_matrices(all);
}

// f(x) f(x)^T for each regression vector.
inline InformationSet regression(const std::vector<Eigen::VectorXd>& vectors) {
  std::vector<Eigen::MatrixXd> all;
  for (const Eigen::VectorXd& f : vectors) all.emplace_back(f * f.transpose());
  return from_matrices(all);
}

// H_i -> T H_i T^T.
inline InformationSet transformed(const InformationSet& set, const Eigen::MatrixXd& t) {
  std::vector<Eigen::MatrixXd> all = matrices_of(set);
  for (Eigen::MatrixXd& h : all) {
    const Eigen::MatrixXd product = t * h * t.transpose();
    h = 0.5 * (product + product.transpose());
  }
  return from_matrices(all);
}

inline InformationSet concatenated(const InformationSet& first, const InformationSet& second) {
  std::vector<Eigen::MatrixXd> all = matrices_of(first);
  for (Eigen::MatrixXd& h : matrices_of(second)) all.push_back(std::move(h));
  return from_matrices(all);
}

}  // namespace graybox::testing_sets
