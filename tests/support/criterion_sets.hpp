// Sets whose A-, E-, L- and Ds-optimal designs are known in closed form, and plain formulas for the
// criteria, for the tests of certificates and of solvers.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "problems/base/packed_matrix.hpp"
#include "solvers/core/criterion.hpp"
#include "tests/support/design_sets.hpp"

namespace graybox::testing_sets {

inline std::vector<double> packed(const Eigen::MatrixXd& matrix) {
  std::vector<double> out(packed_size(static_cast<std::size_t>(matrix.rows())));
  pack(matrix.data(), static_cast<std::size_t>(matrix.rows()), out.data());
  return out;
}

inline Eigen::MatrixXd information_of(const InformationSet& set,
                                      const std::vector<double>& weights) {
  const auto d = static_cast<Eigen::Index>(set.dimension());
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(d, d);
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (weights[i] != 0.0) sum += weights[i] * matrix_of(set, i);
  }
  return sum;
}

inline Eigen::MatrixXd weight_matrix(const Criterion& criterion, Eigen::Index d) {
  if (criterion.kind() == CriterionKind::kA) return Eigen::MatrixXd::Identity(d, d);
  Eigen::MatrixXd w(d, d);
  unpack(criterion.weights().data(), static_cast<std::size_t>(d), w.data());
  return w;
}

// The information function of certificate.hpp, straight from its definition: larger is better and
// efficiencies are ratios. Zero where M is singular.
inline double goodness(const Eigen::MatrixXd& m, const Criterion& criterion) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(m);
  if (!(eigen.eigenvalues()(0) > 1e-13 * eigen.eigenvalues()(m.rows() - 1))) return 0.0;
  const Eigen::MatrixXd covariance = m.inverse();
  switch (criterion.kind()) {
    case CriterionKind::kD:
      return std::pow(m.determinant(), 1.0 / static_cast<double>(m.rows()));
    case CriterionKind::kE:
      return eigen.eigenvalues()(0);
    case CriterionKind::kDs: {
      std::vector<Eigen::Index> interest;
      for (const std::size_t k : criterion.interest()) {
        interest.push_back(static_cast<Eigen::Index>(k));
      }
      const Eigen::MatrixXd block = covariance(interest, interest);
      return std::pow(block.determinant(), -1.0 / static_cast<double>(interest.size()));
    }
    default:
      return 1.0 / (weight_matrix(criterion, m.rows()) * covariance).trace();
  }
}

inline std::vector<double> powers(double x, int degree) {
  std::vector<double> f(static_cast<std::size_t>(degree) + 1, 1.0);
  for (std::size_t k = 1; k < f.size(); ++k) f[k] = f[k - 1] * x;
  return f;
}

// Polynomial regression on the points given.
inline InformationSet polynomial(int degree, const std::vector<double>& points) {
  std::vector<Eigen::VectorXd> vectors;
  for (const double x : points) {
    const std::vector<double> f = powers(x, degree);
    vectors.emplace_back(Eigen::Map<const Eigen::VectorXd>(f.data(), degree + 1));
  }
  return regression(vectors);
}

// From -1 to 1 in 2 half steps.
inline std::vector<double> even_grid(int half) {
  std::vector<double> points;
  for (int k = -half; k <= half; ++k) points.push_back(static_cast<double>(k) / half);
  return points;
}

// H_i = s_i e_i e_i^T.
inline InformationSet orthogonal(const std::vector<double>& sizes) {
  const auto d = static_cast<Eigen::Index>(sizes.size());
  std::vector<Eigen::MatrixXd> all;
  for (Eigen::Index i = 0; i < d; ++i) {
    Eigen::MatrixXd h = Eigen::MatrixXd::Zero(d, d);
    h(i, i) = sizes[static_cast<std::size_t>(i)];
    all.push_back(h);
  }
  return from_matrices(all);
}

// A set, a criterion, its optimal weights and the value of Phi there (goodness()).
struct KnownOptimum {
  const char* name;
  InformationSet set;
  Criterion criterion;
  std::vector<double> weights;
  double goodness;
};

inline std::vector<double> on_grid(std::size_t size,
                                   const std::vector<std::pair<std::size_t, double>>& support) {
  std::vector<double> weights(size, 0.0);
  for (const auto& [index, weight] : support) weights[index] = weight;
  return weights;
}

// Optima with a regular information matrix.
inline std::vector<KnownOptimum> known_optima() {
  std::vector<KnownOptimum> all;
  const std::vector<double> sizes{1.0, 4.0, 0.25, 9.0, 16.0};
  const auto normalised = [](std::vector<double> weights, double& sum) {
    sum = 0.0;
    for (const double w : weights) sum += w;
    for (double& w : weights) w /= sum;
    return weights;
  };
  // min sum_i c_i/(s_i lambda_i): lambda_i as sqrt(c_i/s_i), value (sum sqrt(c_i/s_i))^2.
  const std::vector<double> costs{1.0, 2.0, 5.0, 0.5, 3.0};
  std::vector<double> a, l, e;
  Eigen::MatrixXd w = Eigen::MatrixXd::Zero(5, 5);
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    a.push_back(1.0 / std::sqrt(sizes[i]));
    l.push_back(std::sqrt(costs[i] / sizes[i]));
    e.push_back(1.0 / sizes[i]);
    w.diagonal()(static_cast<Eigen::Index>(i)) = costs[i];
  }
  double sum = 0.0;
  a = normalised(a, sum);
  all.push_back({"A, orthogonal", orthogonal(sizes), Criterion::a(), a, 1.0 / (sum * sum)});
  l = normalised(l, sum);
  all.push_back(
      {"L, orthogonal", orthogonal(sizes), Criterion::l(packed(w)), l, 1.0 / (sum * sum)});
  e = normalised(e, sum);
  all.push_back({"E, orthogonal", orthogonal(sizes), Criterion::e(), e, 1.0 / sum});

  // 1, x, x^2 on [-1, 1]. For A and E: Pukelsheim 1993, section 9.5 and exercises; the variance of
  // the prediction at x = 2 by Hoel and Levine 1964: weights as the Lagrange polynomials of the
  // Chebyshev points there, |1|, |-3|, |3|, variance 7^2.
  const InformationSet quadratic = polynomial(2, even_grid(20));
  const std::size_t count = quadratic.candidate_count();
  const auto three = [&](double left, double middle, double right) {
    return on_grid(count, {{0, left}, {count / 2, middle}, {count - 1, right}});
  };
  all.push_back({"A, quadratic", quadratic, Criterion::a(), three(0.25, 0.5, 0.25), 1.0 / 8.0});
  all.push_back({"E, quadratic", quadratic, Criterion::e(), three(0.2, 0.6, 0.2), 0.2});
  const Eigen::Vector3d at_two(1.0, 2.0, 4.0);
  all.push_back({"c, extrapolation", quadratic,
                 Criterion::l(packed(Eigen::MatrixXd(at_two * at_two.transpose()))),
                 three(1.0 / 7.0, 3.0 / 7.0, 3.0 / 7.0), 1.0 / 49.0});

  // The highest coefficient of a polynomial of degree n: the Chebyshev points cos(j pi/n) with
  // weight 1/n, half of that at the ends; its information is 4^(1-n) (Kiefer and Wolfowitz 1959).
  for (const int n : {2, 3, 5}) {
    std::vector<double> points = even_grid(15);
    std::vector<std::pair<std::size_t, double>> support;
    for (int j = 0; j <= n; ++j) {
      support.emplace_back(points.size(), (j == 0 || j == n ? 0.5 : 1.0) / n);
      points.push_back(std::cos(j * std::numbers::pi / n));
    }
    InformationSet set = polynomial(n, points);
    std::vector<double> weights = on_grid(points.size(), support);
    all.push_back({"Ds, highest coefficient", std::move(set),
                   Criterion::ds({static_cast<std::size_t>(n)}), std::move(weights),
                   std::pow(4.0, 1 - n)});
  }
  return all;
}

}  // namespace graybox::testing_sets
