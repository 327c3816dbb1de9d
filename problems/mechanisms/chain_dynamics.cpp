#include "problems/mechanisms/chain_dynamics.hpp"

#include <cmath>

#include "problems/mechanisms/cross_matrix.hpp"

namespace graybox {

ChainDynamics::Spatial ChainDynamics::Inertia::times(const Spatial& motion) const {
  return {inertia * motion.angular + moment.cross(motion.linear),
          mass * motion.linear - moment.cross(motion.angular)};
}

void ChainDynamics::Inertia::add(const Inertia& other) {
  mass += other.mass;
  moment += other.moment;
  inertia += other.inertia;
}

ChainDynamics::ChainDynamics(const RigidChain& chain)
    : gravity_(chain.gravity()), mass_(chain.size(), chain.size()), bias_(chain.size()) {
  for (const ChainRotation& rotation : chain.rotations()) {
    Link link;
    link.origin_rotation = rotation.origin.linear();
    link.origin = rotation.origin.translation();
    link.axis = rotation.axis;
    link.axis_cross = cross_matrix(rotation.axis);
    link.axis_cross_squared = link.axis_cross * link.axis_cross;
    link.body = rotation.body;
    link.is_massless = rotation.body.mass == 0.0 && rotation.body.inertia.isZero(0.0);
    links_.push_back(link);
  }
}

void ChainDynamics::evaluate(const Eigen::VectorXd& q, const Eigen::VectorXd& velocity) {
  place(q);
  recurse_outward(velocity);
  recurse_inward();
}

// Axes and inertias in the base frame.
void ChainDynamics::place(const Eigen::VectorXd& q) {
  Eigen::Matrix3d frame = Eigen::Matrix3d::Identity();
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  for (std::size_t a = 0; a < links_.size(); ++a) {
    Link& link = links_[a];
    const double angle = q(static_cast<Eigen::Index>(a));
    origin += frame * link.origin;
    // Rodrigues' formula.
    const Eigen::Matrix3d turn = Eigen::Matrix3d::Identity() + std::sin(angle) * link.axis_cross +
                                 (1.0 - std::cos(angle)) * link.axis_cross_squared;
    const Eigen::Matrix3d before = frame * link.origin_rotation;
    frame.noalias() = before * turn;
    link.motion.angular.noalias() = before * link.axis;
    link.motion.linear = origin.cross(link.motion.angular);
    if (link.is_massless) continue;
    const Eigen::Vector3d centre = origin + frame * link.body.centre_of_mass;
    link.inertia.mass = link.body.mass;
    link.inertia.moment = link.body.mass * centre;
    link.inertia.inertia.noalias() = frame * link.body.inertia * frame.transpose();
    link.inertia.inertia -= link.body.mass * centre * centre.transpose();
    link.inertia.inertia.diagonal().array() += link.body.mass * centre.squaredNorm();
  }
}

// Velocities and accelerations, and from them the forces on the bodies.
void ChainDynamics::recurse_outward(const Eigen::VectorXd& velocity) {
  Spatial v, a;
  a.linear = -gravity_;
  for (std::size_t k = 0; k < links_.size(); ++k) {
    Link& link = links_[k];
    const double rate = velocity(static_cast<Eigen::Index>(k));
    const Spatial& s = link.motion;
    v.angular += rate * s.angular;
    v.linear += rate * s.linear;
    a.angular += rate * v.angular.cross(s.angular);
    a.linear += rate * (v.angular.cross(s.linear) + v.linear.cross(s.angular));
    if (link.is_massless) continue;
    const Spatial momentum = link.inertia.times(v);
    link.force = link.inertia.times(a);
    link.force.angular += v.angular.cross(momentum.angular) + v.linear.cross(momentum.linear);
    link.force.linear += v.angular.cross(momentum.linear);
  }
}

void ChainDynamics::recurse_inward() {
  Inertia composite;
  Spatial force;
  for (std::size_t b = links_.size(); b-- > 0;) {
    const Link& link = links_[b];
    const auto column = static_cast<Eigen::Index>(b);
    if (!link.is_massless) {
      composite.add(link.inertia);
      force.angular += link.force.angular;
      force.linear += link.force.linear;
    }
    bias_(column) = link.motion.angular.dot(force.angular) + link.motion.linear.dot(force.linear);
    const Spatial momentum = composite.times(link.motion);
    for (std::size_t a = 0; a <= b; ++a) {
      const Spatial& s = links_[a].motion;
      const auto row = static_cast<Eigen::Index>(a);
      mass_(row, column) = mass_(column, row) =
          s.angular.dot(momentum.angular) + s.linear.dot(momentum.linear);
    }
  }
}

}  // namespace graybox
