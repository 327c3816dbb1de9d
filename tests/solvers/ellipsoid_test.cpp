// Smallest enclosing ellipsoids: closed forms, invariances, an independent method, and what the
// certificate refuses.
#include "solvers/ellipsoid/smallest_ellipsoid.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "problems/base/stop.hpp"
#include "solvers/kernels/distance_kernels.hpp"

namespace graybox {
namespace {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

PointSet points_of(const Matrix& rows, bool centred = false) {
  NumberTable table;
  table.path = "test";
  table.rows = static_cast<std::size_t>(rows.rows());
  table.columns = static_cast<std::size_t>(rows.cols());
  table.values.assign(rows.data(), rows.data() + rows.size());
  return point_set(table, centred);
}

Matrix random_points(Eigen::Index count, Eigen::Index dimension, Random& random) {
  Matrix rows(count, dimension);
  for (double& x : rows.reshaped()) x = random.normal();
  return rows;
}

// Solved to the gap and certified; the logarithm of the volume.
double solved_log_volume(const PointSet& points, double gap = 1e-10, bool centred = false) {
  const EllipsoidSolution found = smallest_ellipsoid(points, {.centred = centred, .gap = gap});
  EXPECT_EQ(found.status, EllipsoidStatus::kSolved);
  EXPECT_TRUE(found.certificate.contains_all());
  EXPECT_LE(found.certificate.volume_bound, gap);
  return found.certificate.log_volume;
}

Matrix cube_corners(Eigen::Index n) {
  Matrix rows(Eigen::Index{1} << n, n);
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    for (Eigen::Index j = 0; j < n; ++j) rows(i, j) = ((i >> j) & 1) != 0 ? 1.0 : -1.0;
  }
  return rows;
}

TEST(Ellipsoid, OfASimplexIsTheClosedForm) {
  Random random(1);
  for (Eigen::Index n = 1; n <= 12; ++n) {
    const Matrix rows = random_points(n + 1, n, random);
    const Matrix edges = rows.bottomRows(n).rowwise() - rows.row(0);
    const auto size = static_cast<double>(n);
    // The regular simplex of circumradius 1 has volume (n+1)^((n+1)/2) / (n! n^(n/2)).
    const double expected = log_unit_ball_volume(static_cast<std::size_t>(n)) +
                            std::log(std::abs(edges.determinant())) + 0.5 * size * std::log(size) -
                            0.5 * (size + 1) * std::log(size + 1);
    EXPECT_NEAR(solved_log_volume(points_of(rows)), expected, 1e-9) << n;
  }
}

TEST(Ellipsoid, OfCubeAndCrossPolytopeIsABall) {
  for (Eigen::Index n = 1; n <= 9; ++n) {
    const auto size = static_cast<double>(n);
    const double ball = log_unit_ball_volume(static_cast<std::size_t>(n));
    EXPECT_NEAR(solved_log_volume(points_of(cube_corners(n))), ball + 0.5 * size * std::log(size),
                1e-9);
    Matrix cross(2 * n, n);
    cross << Matrix::Identity(n, n), -Matrix::Identity(n, n);
    EXPECT_NEAR(solved_log_volume(points_of(cross)), ball, 1e-9);
    EXPECT_NEAR(solved_log_volume(points_of(Matrix::Identity(n, n), true), 1e-10, true), ball,
                1e-9);
  }
}

TEST(Ellipsoid, OfPointsOnALineIsTheInterval) {
  Matrix rows(4, 1);
  rows << 3.0, -1.0, 2.0, 7.0;
  const EllipsoidSolution found = smallest_ellipsoid(points_of(rows), {});
  EXPECT_NEAR(found.ellipsoid.centre[0], 3.0, 1e-12);
  EXPECT_NEAR(found.certificate.log_volume, std::log(8.0), 1e-12);
  EXPECT_EQ(found.support.indices, (std::vector<std::size_t>{1, 3}));
}

// Centred, the ellipsoid of x_i is the free one of x_i and -x_i.
TEST(Ellipsoid, CentredIsThatOfTheMirroredPoints) {
  Random random(2);
  for (Eigen::Index n = 2; n <= 6; ++n) {
    Matrix rows = random_points(40, n, random);
    rows.rowwise() += 0.5 * Matrix::Ones(1, n).row(0);
    Matrix mirrored(80, n);
    mirrored << rows, -rows;
    EXPECT_NEAR(solved_log_volume(points_of(rows, true), 1e-10, true),
                solved_log_volume(points_of(mirrored)), 1e-9);
  }
}

TEST(Ellipsoid, FollowsAffineMapsPermutationsAndDuplicates) {
  Random random(3);
  for (Eigen::Index n = 2; n <= 8; n += 2) {
    const Matrix rows = random_points(300, n, random);
    const double plain = solved_log_volume(points_of(rows));
    const Matrix map = random_points(n, n, random);
    Matrix mapped = rows * map.transpose();
    mapped.rowwise() += 10.0 * random_points(1, n, random).row(0);
    EXPECT_NEAR(solved_log_volume(points_of(mapped)), plain + std::log(std::abs(map.determinant())),
                1e-9);
    EXPECT_NEAR(solved_log_volume(points_of(rows.colwise().reverse())), plain, 1e-9);
    Matrix twice(600, n);
    twice << rows, rows;
    EXPECT_NEAR(solved_log_volume(points_of(twice)), plain, 1e-9);
  }
}

// Units from 1e-9 to 1e9, a common offset of 1e6 spreads, coordinates that nearly agree.
TEST(Ellipsoid, IsProvenForBadlyScaledPoints) {
  Random random(4);
  const Matrix rows = random_points(2000, 5, random);
  const double plain = solved_log_volume(points_of(rows));
  Matrix scaled = rows;
  double logarithms = 0.0;
  for (Eigen::Index j = 0; j < 5; ++j) {
    const double unit = std::pow(10.0, 4.5 * static_cast<double>(j) - 9.0);
    scaled.col(j) = unit * (rows.col(j).array() + 1e6);
    logarithms += std::log(unit);
  }
  EXPECT_NEAR(solved_log_volume(points_of(scaled), 1e-9), plain + logarithms, 1e-7);
  Matrix far = rows;
  far.col(0) = (1e-3 * rows.col(0)).array() + 1e6;
  static_cast<void>(solved_log_volume(points_of(far), 1e-12));
  Matrix thin = rows;
  thin.col(1) = rows.col(0) + 1e-6 * rows.col(1);
  EXPECT_NEAR(solved_log_volume(points_of(thin), 1e-8), plain + std::log(1e-6), 1e-6);
}

// Frank-Wolfe with away steps (Wolfe and Atwood; Todd and Yildirim 2007) on the lifted points.
struct Bounds {
  double lower;  // of the logarithm of the least volume
  double upper;
};

Bounds independent_bounds(const Matrix& rows, double tolerance) {
  const Eigen::Index count = rows.rows(), n = rows.cols(), d = n + 1;
  const auto size = static_cast<double>(n), lifted = static_cast<double>(d);
  Matrix q(count, d);
  q << rows, Eigen::VectorXd::Ones(count);
  Eigen::VectorXd u = Eigen::VectorXd::Constant(count, 1.0 / static_cast<double>(count));
  for (int iteration = 0; iteration < 200000; ++iteration) {
    const Matrix m = q.transpose() * u.asDiagonal() * q;
    const Eigen::LLT<Matrix> factor(m);
    const Eigen::VectorXd w =
        factor.matrixL().solve(Matrix(q.transpose())).colwise().squaredNorm().transpose();
    Eigen::Index up = 0, down = -1;
    const double highest = w.maxCoeff(&up);
    for (Eigen::Index i = 0; i < count; ++i) {
      if (u(i) > 1e-14 && (down < 0 || w(i) < w(down))) down = i;
    }
    if (highest / lifted - 1.0 <= tolerance) {
      const Matrix l = factor.matrixL();
      const double lower = log_unit_ball_volume(static_cast<std::size_t>(n)) +
                           0.5 * size * std::log(size) + l.diagonal().array().log().sum();
      return {lower, lower + 0.5 * size * std::log((highest - 1.0) / size)};
    }
    const bool forward = highest / lifted - 1.0 >= 1.0 - w(down) / lifted;
    const Eigen::Index i = forward ? up : down;
    double step = (w(i) - lifted) / ((w(i) - 1.0) * lifted);
    if (!forward) step = std::max(step, -u(i) / (1.0 - u(i)));
    u *= 1.0 - step;
    u(i) += step;
  }
  ADD_FAILURE() << "the independent method did not converge";
  return {0.0, 0.0};
}

TEST(Ellipsoid, AgreesWithAnIndependentMethodOn500RandomSets) {
  Random random(5);
  int false_certificates = 0;
  for (int k = 0; k < 500; ++k) {
    const auto n = static_cast<Eigen::Index>(1 + random.below(5));
    const auto count = n + 1 + static_cast<Eigen::Index>(random.below(40));
    Matrix rows = random_points(count, n, random);
    if (k % 3 == 0) rows = rows.array().cube();                                 // heavy tails
    if (k % 3 == 1) rows = (2.0 * rows).array().round() + rows.array() * 1e-3;  // clusters
    const EllipsoidSolution found = smallest_ellipsoid(points_of(rows), {.gap = 1e-9});
    ASSERT_EQ(found.status, EllipsoidStatus::kSolved) << k;
    const Bounds bounds = independent_bounds(rows, 1e-6);
    const double volume = found.certificate.log_volume;
    const bool smaller_exists = volume - std::log1p(1e-9) > bounds.upper + 1e-11;
    const bool too_small = volume < bounds.lower - 1e-11;
    if (smaller_exists || too_small || !found.certificate.contains_all()) ++false_certificates;
  }
  EXPECT_EQ(false_certificates, 0);
}

TEST(Ellipsoid, CertificateRefusesWhatLeavesAPointOutside) {
  Random random(6);
  const PointSet points = points_of(random_points(500, 4, random));
  const EllipsoidSolution found = smallest_ellipsoid(points, {.gap = 1e-9});
  Ellipsoid shrunk = found.ellipsoid;
  for (double& x : shrunk.factor) x *= 1.0 + 1e-13;
  const EllipsoidCertificate refused = certify_ellipsoid(points, shrunk, found.support, false, 1);
  EXPECT_FALSE(refused.contains_all());
  EXPECT_NEAR(refused.largest_distance, 1.0 + 1e-13, 1e-14);
  const auto& contact = found.support.indices;
  EXPECT_NE(std::ranges::find(contact, refused.farthest), contact.end());
}

// Any weights give a bound, and none that is too small.
TEST(Ellipsoid, BoundHoldsForAnyEllipsoidAndWeights) {
  Random random(7);
  const PointSet points = points_of(random_points(200, 3, random));
  const EllipsoidSolution found = smallest_ellipsoid(points, {.gap = 1e-12});
  const double least = found.certificate.log_volume - std::log1p(1e-12);
  for (int k = 0; k < 100; ++k) {
    WeightedPoints weights;
    for (std::size_t i = 0; i < 12; ++i) {
      weights.indices.push_back(random.below(points.count));
      weights.weights.push_back(random.uniform());
    }
    Ellipsoid wide = found.ellipsoid;
    for (double& x : wide.factor) x *= 0.3 + 0.6 * random.uniform();
    for (std::size_t j = 0; j < 3; ++j) wide.factor[packed_index(j, j)] *= 0.5;
    const EllipsoidCertificate certificate = certify_ellipsoid(points, wide, weights, false, 1);
    const double scaled =
        certificate.log_volume + 3.0 * std::log(std::max(certificate.largest_distance, 1.0));
    EXPECT_GE(scaled, least);
    EXPECT_GE(certificate.volume_bound, std::expm1(scaled - least) - 1e-9);
  }
  const EllipsoidCertificate without = certify_ellipsoid(points, found.ellipsoid, {}, false, 1);
  EXPECT_TRUE(without.contains_all());
  EXPECT_TRUE(std::isinf(without.volume_bound));
}

TEST(Ellipsoid, DoesNotDependOnThreads) {
  Random random(8);
  const PointSet points = points_of(random_points(30000, 7, random));
  const EllipsoidSolution one = smallest_ellipsoid(points, {.gap = 1e-9, .threads = 1});
  const EllipsoidSolution three = smallest_ellipsoid(points, {.gap = 1e-9, .threads = 3});
  EXPECT_EQ(one.ellipsoid.factor, three.ellipsoid.factor);
  EXPECT_EQ(one.ellipsoid.centre, three.ellipsoid.centre);
  EXPECT_EQ(one.support.weights, three.support.weights);
  EXPECT_EQ(one.certificate.largest_distance, three.certificate.largest_distance);
}

std::string refusal_of(const Matrix& rows, bool centred = false) {
  try {
    static_cast<void>(smallest_ellipsoid(points_of(rows, centred), {.centred = centred}));
  } catch (const InputError& error) {
    return error.what();
  }
  return {};
}

TEST(Ellipsoid, RefusesPointsInAHyperplane) {
  Random random(9);
  Matrix rows = random_points(100, 4, random);
  rows.col(2) = rows.col(0) - 3.0 * rows.col(1);
  EXPECT_NE(refusal_of(rows).find("lie in a hyperplane"), std::string::npos);
  rows.col(2).setConstant(5.0);
  EXPECT_NE(refusal_of(rows).find("column 'x3' is 5 in every row"), std::string::npos);
  EXPECT_EQ(refusal_of(rows, true), "");  // centred, a plane beside the origin will do
  EXPECT_NE(refusal_of(rows.topRows(4)).find("at least 5 are needed"), std::string::npos);
  const Matrix repeated = rows.row(0).replicate(9, 1);
  EXPECT_NE(refusal_of(repeated).find("in every row"), std::string::npos);
}

// One point of a hundred thousand leaves the plane of the others: no sample has it.
TEST(Ellipsoid, FindsTheOnePointThatLeavesThePlane) {
  Random random(10);
  Matrix rows = random_points(100000, 3, random);
  rows.col(2).setZero();
  rows(77777, 2) = 1.0;
  const EllipsoidSolution found = smallest_ellipsoid(points_of(rows), {.gap = 1e-9});
  EXPECT_EQ(found.status, EllipsoidStatus::kSolved);
  const auto& contact = found.support.indices;
  EXPECT_NE(std::ranges::find(contact, std::size_t{77777}), contact.end());
}

TEST(Ellipsoid, StopsAtOnceWhereItIsAskedTo) {
  Random random(11);
  const PointSet points = points_of(random_points(5000, 5, random));
  request_stop();
  EXPECT_THROW(static_cast<void>(smallest_ellipsoid(points, {})), Stopped);
  forget_stops();
}

TEST(Ellipsoid, AxesAndShapeAreThoseOfTheFactor) {
  Random random(12);
  const EllipsoidSolution found = smallest_ellipsoid(points_of(random_points(50, 4, random)), {});
  const std::vector<double> shape = shape_matrix(found.ellipsoid);
  const Eigen::Map<const Matrix> e(shape.data(), 4, 4);
  double product = 1.0, longest = std::numeric_limits<double>::infinity();
  for (const SemiAxis& axis : semi_axes(found.ellipsoid)) {
    const Eigen::Map<const Eigen::VectorXd> v(axis.direction.data(), 4);
    EXPECT_NEAR((e * v - v / (axis.length * axis.length)).norm(), 0.0, 1e-12 * e.norm());
    EXPECT_LE(axis.length, longest);
    longest = axis.length;
    product *= axis.length;
  }
  EXPECT_NEAR(std::log(product) + log_unit_ball_volume(4), found.certificate.log_volume, 1e-12);
  const std::vector<double> factor = factor_of_shape(shape, 4);
  for (std::size_t k = 0; k < factor.size(); ++k) {
    EXPECT_NEAR(factor[k], found.ellipsoid.factor[k], 1e-13 * e.norm());
  }
  EXPECT_TRUE(factor_of_shape({1, 2, 2, 1}, 2).empty());
}

TEST(DistanceKernels, AreTheFormula) {
  Random random(13);
  for (std::size_t n = 1; n <= 23; ++n) {
    const std::size_t count = 1 + random.below(60);
    std::vector<double> points(count * n), centre(n), remainder(n), factor(packed_size(n));
    for (auto* values : {&points, &centre, &remainder, &factor}) {
      for (double& x : *values) x = random.normal();
    }
    std::vector<double> panels(distance_panel_size(n)), workspace(distance_workspace_size(n)),
        out(count);
    pack_distance_panels(factor.data(), n, panels.data());
    distance_kernels().squared(points.data(), count, n, centre.data(), remainder.data(),
                               panels.data(), workspace.data(), out.data());
    for (std::size_t i = 0; i < count; ++i) {
      double expected = 0.0;
      for (std::size_t row = 0; row < n; ++row) {
        double y = 0.0;
        for (std::size_t j = 0; j <= row; ++j) {
          y += factor[packed_index(row, j)] * (points[i * n + j] - centre[j] - remainder[j]);
        }
        expected += y * y;
      }
      EXPECT_NEAR(out[i], expected, 1e-12 * expected) << n << " " << i;
    }
  }
}

}  // namespace
}  // namespace graybox
