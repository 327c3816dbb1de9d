#include "problems/mechanisms/rigid_chain.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>

#include "problems/base/error.hpp"
#include "problems/base/random.hpp"
#include "problems/mechanisms/urdf_chain.hpp"
#include "tests/support/robot_test_support.hpp"

namespace graybox {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

Vector3d random_vector(Random& random) {
  return {random.normal(), random.normal(), random.normal()};
}

VectorXd random_angles(Random& random, Eigen::Index n) {
  VectorXd q(n);
  for (double& angle : q) angle = random.uniform(-3.0, 3.0);
  return q;
}

// Skew axes, turned offsets, and one rotation without a body in the middle.
RigidChain random_chain(std::uint64_t seed, int size) {
  Random random(seed);
  std::vector<ChainRotation> rotations;
  for (int i = 0; i < size; ++i) {
    ChainRotation rotation;
    rotation.name = fmt::format("r{}", i);
    rotation.origin.translation() = random_vector(random);
    rotation.origin.linear() =
        Eigen::AngleAxisd(random.uniform(0.0, 3.0), random_vector(random).normalized())
            .toRotationMatrix();
    rotation.axis = random_vector(random);
    if (i != size / 2) {
      const Matrix3d root = Matrix3d::NullaryExpr([&] { return random.normal(); });
      rotation.body = {random.uniform(0.5, 2.0), random_vector(random), root * root.transpose()};
    }
    rotations.push_back(rotation);
  }
  return RigidChain(rotations, random_vector(random));
}

// Independent kinematics with Eigen alone: pose of every body, and axis and origin of every
// rotation, in the base frame.
struct Kinematics {
  std::vector<Isometry3d> poses;
  std::vector<Vector3d> axes;

  Kinematics(const RigidChain& chain, const VectorXd& q) {
    Isometry3d pose = Isometry3d::Identity();
    for (Eigen::Index i = 0; i < chain.size(); ++i) {
      const ChainRotation& rotation = chain.rotations()[static_cast<std::size_t>(i)];
      pose = pose * rotation.origin;
      axes.push_back(pose.linear() * rotation.axis);
      pose.rotate(Eigen::AngleAxisd(q(i), rotation.axis));
      poses.push_back(pose);
    }
  }
};

// M = sum over bodies of m Jv^T Jv + Jw^T I Jw.
MatrixXd mass_by_jacobians(const RigidChain& chain, const VectorXd& q) {
  const Kinematics kinematics(chain, q);
  const auto n = static_cast<std::size_t>(chain.size());
  MatrixXd mass = MatrixXd::Zero(chain.size(), chain.size());
  for (std::size_t k = 0; k < n; ++k) {
    const RigidBody& body = chain.rotations()[k].body;
    const Isometry3d& pose = kinematics.poses[k];
    const Vector3d centre = pose * body.centre_of_mass;
    MatrixXd linear = MatrixXd::Zero(3, chain.size()), angular = linear;
    for (std::size_t a = 0; a <= k; ++a) {
      const Vector3d arm = centre - kinematics.poses[a].translation();
      linear.col(static_cast<Eigen::Index>(a)) = kinematics.axes[a].cross(arm);
      angular.col(static_cast<Eigen::Index>(a)) = kinematics.axes[a];
    }
    const Matrix3d inertia = pose.linear() * body.inertia * pose.linear().transpose();
    mass += body.mass * linear.transpose() * linear + angular.transpose() * inertia * angular;
  }
  return mass;
}

double potential_by_heights(const RigidChain& chain, const VectorXd& q) {
  const Kinematics kinematics(chain, q);
  double energy = 0.0;
  for (std::size_t k = 0; k < kinematics.poses.size(); ++k) {
    const RigidBody& body = chain.rotations()[k].body;
    energy -= body.mass * chain.gravity().dot(kinematics.poses[k] * body.centre_of_mass);
  }
  return energy;
}

VectorXd shifted(const VectorXd& q, Eigen::Index i, double step) {
  VectorXd result = q;
  result(i) += step;
  return result;
}

class RigidChainProperties : public ::testing::TestWithParam<int> {
 protected:
  RigidChainProperties()
      : chain_(GetParam() == 0 ? robot_test::paper_robot().chain
                               : random_chain(static_cast<std::uint64_t>(GetParam()), 7)),
        evaluator_(chain_),
        q_([this] {
          Random random(99);
          return random_angles(random, chain_.size());
        }()) {}

  RigidChain chain_;
  RigidChainEvaluator evaluator_;
  VectorXd q_;
};

TEST_P(RigidChainProperties, MassMatrixIsTheSumOverBodies) {
  const MatrixXd mass = evaluator_.mass_matrix(q_);
  const MatrixXd expected = mass_by_jacobians(chain_, q_);
  EXPECT_LT((mass - expected).norm(), 1e-13 * expected.norm());
}

TEST_P(RigidChainProperties, MassMatrixIsSymmetricAndPositiveDefinite) {
  const MatrixXd mass = evaluator_.mass_matrix(q_);
  EXPECT_EQ((mass - mass.transpose()).norm(), 0.0);
  EXPECT_EQ(Eigen::LLT<MatrixXd>(mass).info(), Eigen::Success);
}

TEST_P(RigidChainProperties, PotentialEnergyIsTheSumOfHeights) {
  const double expected = potential_by_heights(chain_, q_);
  EXPECT_NEAR(evaluator_.potential_energy(q_), expected, 1e-12 * std::abs(expected));
}

TEST_P(RigidChainProperties, GravityTorqueIsTheGradientOfThePotential) {
  const VectorXd torque = evaluator_.gravity_torque(q_);
  const double h = 1e-5;
  for (Eigen::Index i = 0; i < q_.size(); ++i) {
    const double slope = (potential_by_heights(chain_, shifted(q_, i, h)) -
                          potential_by_heights(chain_, shifted(q_, i, -h))) /
                         (2.0 * h);
    EXPECT_NEAR(torque(i), slope, 1e-8 * torque.norm());
  }
}

TEST_P(RigidChainProperties, GravityStiffnessIsTheHessianOfThePotential) {
  const MatrixXd stiffness = evaluator_.gravity_stiffness(q_);
  EXPECT_EQ((stiffness - stiffness.transpose()).norm(), 0.0);
  const double h = 1e-4;
  for (Eigen::Index i = 0; i < q_.size(); ++i) {
    for (Eigen::Index j = 0; j < q_.size(); ++j) {
      double curvature = 0.0;
      for (const double a : {1.0, -1.0}) {
        for (const double b : {1.0, -1.0}) {
          curvature +=
              a * b * potential_by_heights(chain_, shifted(shifted(q_, i, a * h), j, b * h));
        }
      }
      EXPECT_NEAR(stiffness(i, j), curvature / (4.0 * h * h), 2e-7 * stiffness.norm());
    }
  }
}

// c_i = sum_jk (dM_ij/dq_k - dM_jk/dq_i / 2) v_j v_k.
TEST_P(RigidChainProperties, CoriolisTorqueFollowsFromTheMassMatrix) {
  Random random(5);
  const VectorXd velocity = random_angles(random, chain_.size());
  const Eigen::Index n = chain_.size();
  const double h = 1e-5;
  VectorXd expected = VectorXd::Zero(n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const MatrixXd slope = (mass_by_jacobians(chain_, shifted(q_, k, h)) -
                            mass_by_jacobians(chain_, shifted(q_, k, -h))) /
                           (2.0 * h);
    expected += velocity(k) * (slope * velocity);
    expected(k) -= 0.5 * velocity.dot(slope * velocity);
  }
  EXPECT_LT((evaluator_.coriolis_torque(q_, velocity) - expected).norm(), 1e-8 * expected.norm());
}

INSTANTIATE_TEST_SUITE_P(PaperRobotAndRandomChains, RigidChainProperties,
                         ::testing::Values(0, 1, 2, 3));

TEST(RigidChain, RefusesAnEmptyChainAndAZeroAxis) {
  EXPECT_THROW(RigidChain({}, Vector3d::Zero()), InputError);
  ChainRotation rotation;
  rotation.axis.setZero();
  EXPECT_THROW(RigidChain({rotation}, Vector3d::Zero()), InputError);
}

TEST(RigidBodies, JoinedBodiesKeepMassMomentAndKineticEnergy) {
  Random random(3);
  const RigidBody a{2.0, random_vector(random), Matrix3d::Identity()};
  const RigidBody b{3.0, random_vector(random), 2.0 * Matrix3d::Identity()};
  const RigidBody both = joined(a, b);
  // A twist (v, w) about the frame's origin gives the same energy to the two as to the one.
  const Vector3d v = random_vector(random), w = random_vector(random);
  const auto energy = [&](const RigidBody& body) {
    return 0.5 * body.mass * (v + w.cross(body.centre_of_mass)).squaredNorm() +
           0.5 * w.dot(body.inertia * w);
  };
  EXPECT_DOUBLE_EQ(both.mass, 5.0);
  EXPECT_LT(
      (both.mass * both.centre_of_mass - 2.0 * a.centre_of_mass - 3.0 * b.centre_of_mass).norm(),
      1e-14);
  EXPECT_NEAR(energy(both), energy(a) + energy(b), 1e-13 * energy(both));
}

TEST(RigidBodies, MovingABodyKeepsItsMoments) {
  Isometry3d pose = Isometry3d::Identity();
  pose.translate(Vector3d(1.0, 2.0, 3.0)).rotate(Eigen::AngleAxisd(M_PI / 2, Vector3d::UnitZ()));
  const Matrix3d inertia = Vector3d(1.0, 2.0, 3.0).asDiagonal();
  const RigidBody body = moved({1.0, Vector3d::UnitX(), inertia}, pose);
  EXPECT_LT((body.centre_of_mass - Vector3d(1.0, 3.0, 3.0)).norm(), 1e-15);
  const Matrix3d expected = Vector3d(2.0, 1.0, 3.0).asDiagonal();
  EXPECT_LT((body.inertia - expected).norm(), 1e-15);
}

}  // namespace
}  // namespace graybox
