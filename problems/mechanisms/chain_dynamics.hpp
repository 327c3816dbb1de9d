// Mass matrix and bias torque of a RigidChain together and fast: the inner loop of a simulation.
// KDL (rigid_chain.hpp) computes the same; here both share one pass, in base coordinates and
// without allocation.
//
// Spatial vectors about the base frame's origin (Featherstone 2008, Chapters 5 and 6). Rotation a
// with axis z_a through o_a moves the bodies beyond it with S_a = (z_a, o_a x z_a): angular
// velocity, and velocity of the point at the origin. A body of mass m, first moment h = m r and
// inertia I about the origin has, moving with V = (w, v), the momentum (I w + h x v, m v - h x w).
//
//   composite bodies:  M_ab = S_a . (inertia of all bodies beyond b) S_b,       a <= b
//   Newton and Euler:  V_a = V_{a-1} + S_a q_a',  A_a = A_{a-1} + V_a x S_a q_a',  A_0 = (0, -g),
//                      F_a = I_a A_a + V_a x* I_a V_a,   bias_a = S_a . sum of F_k beyond a
//
//   ChainDynamics dynamics(chain);                     // one for each thread
//   dynamics.evaluate(q, velocity);                    // dynamics.mass(), dynamics.bias()
//
// Cost O(n^2).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "problems/mechanisms/rigid_chain.hpp"

namespace graybox {

class ChainDynamics {
 public:
  explicit ChainDynamics(const RigidChain& chain);

  void evaluate(const Eigen::VectorXd& q, const Eigen::VectorXd& velocity);
  [[nodiscard]] const Eigen::MatrixXd& mass() const { return mass_; }  // n x n, kg m^2
  // c(q, q') + g(q), N m: the torques that make q'' = 0.
  [[nodiscard]] const Eigen::VectorXd& bias() const { return bias_; }

 private:
  struct Spatial {
    Eigen::Vector3d angular = Eigen::Vector3d::Zero();
    Eigen::Vector3d linear = Eigen::Vector3d::Zero();
  };
  struct Inertia {
    double mass = 0.0;
    Eigen::Vector3d moment = Eigen::Vector3d::Zero();
    Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
    [[nodiscard]] Spatial times(const Spatial& motion) const;
    void add(const Inertia& other);
  };
  // One rotation: constants in the frame before it, then where it is in the base frame.
  struct Link {
    Eigen::Matrix3d origin_rotation, axis_cross, axis_cross_squared;
    Eigen::Vector3d origin, axis;
    RigidBody body;
    bool is_massless = false;
    Spatial motion;
    Inertia inertia;  // zero, like the force, where massless
    Spatial force;
  };

  void place(const Eigen::VectorXd& q);
  void recurse_outward(const Eigen::VectorXd& velocity);
  void recurse_inward();

  Eigen::Vector3d gravity_;
  std::vector<Link> links_;
  Eigen::MatrixXd mass_;
  Eigen::VectorXd bias_;
};

}  // namespace graybox
