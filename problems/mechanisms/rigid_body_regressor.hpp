// The regressor of a chain of rigid bodies: joint torques are linear in the standard inertial
// parameters of the links,
//
//   M(q) q'' + c(q, q') + g(q) = Y(q, q', q'') p,
//   p = (XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M) of link 1, then of link 2, ...
//
// (Khalil and Dombre 2002, Chapter 9; Atkeson, An and Hollerbach 1986). XX to ZZ is the inertia
// matrix about the origin of the link's frame, kg m^2 (XY = -integral of x y dm); MX, MY, MZ are
// mass times centre of mass, kg m; M is the mass, kg.
//
// Link j, whose frame turns with w and w' and whose origin accelerates with a (gravity as an
// acceleration of the base by -g), all in its own axes, needs force and moment about its origin
//   f = M a + ([w']x + [w]x[w]x) (MX, MY, MZ)
//   n = I w' + w x I w - a x (MX, MY, MZ)
// which are linear in its ten parameters: a 6 x 10 matrix. Carried inward to joint i <= j it gives
// block (i, j) of Y: the moment about the axis of a revolute, the force along that of a prismatic
// joint. Blocks with i > j are zero. Cost O(n^2), no allocation.
//
//   RigidBodyRegressor regressor(model);                 // one for each thread
//   const Eigen::MatrixXd& y = regressor.evaluate(q, velocity, acceleration);   // n x 10 n
//   torque = y * p,   p.segment<10>(10 * j) = standard_parameters(body_j)
#pragma once

#include <Eigen/Core>
#include <array>
#include <string_view>
#include <vector>

#include "problems/mechanisms/rigid_robot_model.hpp"

namespace graybox {

inline constexpr Eigen::Index kStandardParameters = 10;
inline constexpr std::array<std::string_view, 10> kStandardParameterNames = {
    "XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M"};

using StandardParameters = Eigen::Matrix<double, 10, 1>;

// Of a body given in the link's frame.
[[nodiscard]] StandardParameters standard_parameters(const RigidBody& body);

class RigidBodyRegressor {
 public:
  explicit RigidBodyRegressor(const RigidRobotModel& model);

  // The reference is to storage of the regressor, valid until the next call.
  const Eigen::MatrixXd& evaluate(const Eigen::Ref<const Eigen::VectorXd>& q,
                                  const Eigen::Ref<const Eigen::VectorXd>& velocity,
                                  const Eigen::Ref<const Eigen::VectorXd>& acceleration);

 private:
  struct Link {
    Eigen::Matrix3d origin_rotation = Eigen::Matrix3d::Identity();
    Eigen::Vector3d origin = Eigen::Vector3d::Zero(), axis = Eigen::Vector3d::UnitZ();
    Eigen::Matrix3d axis_cross = Eigen::Matrix3d::Zero();
    Eigen::Matrix3d axis_cross_squared = Eigen::Matrix3d::Zero();
    bool is_prismatic = false;
    // At the current motion: the frame in that of the link before, and its own motion.
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    Eigen::Vector3d place = Eigen::Vector3d::Zero();
    Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();
    Eigen::Vector3d angular_acceleration = Eigen::Vector3d::Zero();
    Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();
  };
  using Wrench = Eigen::Matrix<double, 6, 10>;  // moment, then force, for each parameter

  void move(const Eigen::Ref<const Eigen::VectorXd>& q,
            const Eigen::Ref<const Eigen::VectorXd>& velocity,
            const Eigen::Ref<const Eigen::VectorXd>& acceleration);
  static Wrench wrench_of(const Link& link);

  Eigen::Vector3d gravity_;
  std::vector<Link> links_;
  Eigen::MatrixXd regressor_;
};

}  // namespace graybox
