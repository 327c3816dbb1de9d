#include "problems/mechanisms/rigid_body_regressor.hpp"

#include <cmath>

#include "problems/mechanisms/cross_matrix.hpp"

namespace graybox {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Index = Eigen::Index;

// I v = inertia_columns(v) (XX, XY, XZ, YY, YZ, ZZ).
Eigen::Matrix<double, 3, 6> inertia_columns(const Vector3d& v) {
  Eigen::Matrix<double, 3, 6> columns;
  columns << v.x(), v.y(), v.z(), 0.0, 0.0, 0.0,  //
      0.0, v.x(), 0.0, v.y(), v.z(), 0.0,         //
      0.0, 0.0, v.x(), 0.0, v.y(), v.z();
  return columns;
}

}  // namespace

StandardParameters standard_parameters(const RigidBody& body) {
  const Vector3d& c = body.centre_of_mass;
  const Matrix3d inertia =
      body.inertia + body.mass * (c.squaredNorm() * Matrix3d::Identity() - c * c.transpose());
  StandardParameters parameters;
  parameters << inertia(0, 0), inertia(0, 1), inertia(0, 2), inertia(1, 1), inertia(1, 2),
      inertia(2, 2), body.mass * c, body.mass;
  return parameters;
}

RigidBodyRegressor::RigidBodyRegressor(const RigidRobotModel& model)
    : gravity_(model.gravity),
      regressor_(Eigen::MatrixXd::Zero(model.size(), kStandardParameters * model.size())) {
  for (const RobotJoint& joint : model.joints) {
    Link link;
    link.origin_rotation = joint.origin.linear();
    link.origin = joint.origin.translation();
    link.axis = joint.axis;
    link.axis_cross = cross_matrix(joint.axis);
    link.axis_cross_squared = link.axis_cross * link.axis_cross;
    link.is_prismatic = joint.is_prismatic;
    links_.push_back(link);
  }
}

// Velocities and accelerations outward (Luh, Walker and Paul 1980), each in its link's axes.
void RigidBodyRegressor::move(const Eigen::Ref<const Eigen::VectorXd>& q,
                              const Eigen::Ref<const Eigen::VectorXd>& velocity,
                              const Eigen::Ref<const Eigen::VectorXd>& acceleration) {
  Vector3d w = Vector3d::Zero(), dw = Vector3d::Zero(), a = -gravity_;
  for (std::size_t k = 0; k < links_.size(); ++k) {
    Link& link = links_[k];
    const auto i = static_cast<Index>(k);
    link.rotation = link.origin_rotation;
    link.place = link.origin;
    if (link.is_prismatic) {
      link.place += q(i) * (link.origin_rotation * link.axis);
    } else {
      link.rotation *= Matrix3d::Identity() + std::sin(q(i)) * link.axis_cross +
                       (1.0 - std::cos(q(i))) * link.axis_cross_squared;
    }
    const Matrix3d to_link = link.rotation.transpose();
    a = to_link * (a + dw.cross(link.place) + w.cross(w.cross(link.place)));
    w = to_link * w;
    dw = to_link * dw;
    if (link.is_prismatic) {
      a += acceleration(i) * link.axis + 2.0 * velocity(i) * w.cross(link.axis);
    } else {
      dw += acceleration(i) * link.axis + velocity(i) * w.cross(link.axis);
      w += velocity(i) * link.axis;
    }
    link.angular_velocity = w;
    link.angular_acceleration = dw;
    link.acceleration = a;
  }
}

RigidBodyRegressor::Wrench RigidBodyRegressor::wrench_of(const Link& link) {
  const Matrix3d turn = cross_matrix(link.angular_velocity);
  Wrench wrench = Wrench::Zero();
  wrench.topLeftCorner<3, 6>() =
      inertia_columns(link.angular_acceleration) + turn * inertia_columns(link.angular_velocity);
  wrench.block<3, 3>(0, 6) = -cross_matrix(link.acceleration);
  wrench.block<3, 3>(3, 6) = cross_matrix(link.angular_acceleration) + turn * turn;
  wrench.block<3, 1>(3, 9) = link.acceleration;
  return wrench;
}

const Eigen::MatrixXd& RigidBodyRegressor::evaluate(
    const Eigen::Ref<const Eigen::VectorXd>& q, const Eigen::Ref<const Eigen::VectorXd>& velocity,
    const Eigen::Ref<const Eigen::VectorXd>& acceleration) {
  move(q, velocity, acceleration);
  for (std::size_t j = 0; j < links_.size(); ++j) {
    Wrench wrench = wrench_of(links_[j]);
    const auto column = kStandardParameters * static_cast<Index>(j);
    for (std::size_t i = j + 1; i-- > 0;) {
      const Link& link = links_[i];
      const auto along = link.is_prismatic ? wrench.bottomRows<3>() : wrench.topRows<3>();
      regressor_.block<1, 10>(static_cast<Index>(i), column).noalias() =
          link.axis.transpose() * along;
      // To the frame of the link before, about its origin.
      const Eigen::Matrix<double, 3, 10> force = link.rotation * wrench.bottomRows<3>();
      wrench.topRows<3>() = (link.rotation * wrench.topRows<3>()).eval();
      wrench.topRows<3>().noalias() += cross_matrix(link.place) * force;
      wrench.bottomRows<3>() = force;
    }
  }
  return regressor_;
}

}  // namespace graybox
