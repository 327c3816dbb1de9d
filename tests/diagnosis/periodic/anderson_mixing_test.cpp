// Fixed points that substitution alone does not reach.
#include "diagnosis/harmonic_balance/anderson_mixing.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>

namespace graybox {
namespace {

using Eigen::MatrixXcd;
using Eigen::VectorXcd;

// x = A x + b, where one entry of A repels: 1.8 times as far each time.
struct LinearMap {
  MatrixXcd matrix = Eigen::Vector3cd(1.8, -0.9, 0.5).asDiagonal();
  VectorXcd constant = Eigen::Vector3cd(1.0, {0.0, 2.0}, -3.0);

  LinearMap() { matrix(0, 2) = {0.2, 0.4}; }
  [[nodiscard]] VectorXcd operator()(const VectorXcd& x) const { return matrix * x + constant; }
  [[nodiscard]] VectorXcd fixed_point() const {
    return (MatrixXcd::Identity(3, 3) - matrix).partialPivLu().solve(constant);
  }
};

TEST(AndersonMixing, ReachesAFixedPointThatRepels) {
  const LinearMap map;
  VectorXcd substituted = VectorXcd::Zero(3), mixed = substituted;
  AndersonMixing passes(8);
  for (int pass = 0; pass < 12; ++pass) {
    substituted = map(substituted);
    const VectorXcd reached = map(mixed);
    passes.add(reached, reached - mixed);
    mixed = passes.mixed();
  }
  EXPECT_GT((substituted - map.fixed_point()).norm(), 100.0);
  EXPECT_LT((mixed - map.fixed_point()).norm(), 1e-8);
}

TEST(AndersonMixing, IsSubstitutionAfterOnePass) {
  const LinearMap map;
  const VectorXcd start = VectorXcd::Ones(3), reached = map(start);
  AndersonMixing passes(3);
  passes.add(reached, reached - start);
  EXPECT_EQ(passes.mixed(), reached);
}

// Of a map that changed on the way only the passes that are remembered count.
TEST(AndersonMixing, ForgetsTheOldestPasses) {
  const LinearMap map;
  AndersonMixing passes(5);
  passes.add(VectorXcd::Constant(3, 1e3), VectorXcd::Constant(3, -7.0));
  VectorXcd x = VectorXcd::Zero(3);
  for (int pass = 0; pass < 5; ++pass) {
    const VectorXcd reached = map(x);
    passes.add(reached, reached - x);
    x = pass < 3 ? reached : passes.mixed().col(0);
  }
  EXPECT_LT((x - map.fixed_point()).norm(), 1e-8);
}

}  // namespace
}  // namespace graybox
