#include "problems/mechanisms/rigid_chain.hpp"

#include <fmt/format.h>

#include <kdl/chain.hpp>
#include <kdl/chaindynparam.hpp>
#include <utility>

#include "problems/base/error.hpp"

namespace graybox {
namespace {

KDL::Vector to_kdl(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }
Eigen::Vector3d to_eigen(const KDL::Vector& v) { return {v.x(), v.y(), v.z()}; }

KDL::Frame to_kdl(const Eigen::Isometry3d& pose) {
  const Eigen::Matrix3d r = pose.linear();
  return {KDL::Rotation(r(0, 0), r(0, 1), r(0, 2), r(1, 0), r(1, 1), r(1, 2), r(2, 0), r(2, 1),
                        r(2, 2)),
          to_kdl(Eigen::Vector3d(pose.translation()))};
}

KDL::RigidBodyInertia to_kdl(const RigidBody& body) {
  const Eigen::Matrix3d& i = body.inertia;
  return KDL::RigidBodyInertia(
      body.mass, to_kdl(body.centre_of_mass),
      KDL::RotationalInertia(i(0, 0), i(1, 1), i(2, 2), i(0, 1), i(0, 2), i(1, 2)));
}

// Rotations about a coordinate axis are cheaper in KDL than those about a general one.
KDL::Joint kdl_joint(const std::string& name, const Eigen::Vector3d& axis) {
  if (axis == Eigen::Vector3d::UnitX()) return KDL::Joint(name, KDL::Joint::RotX);
  if (axis == Eigen::Vector3d::UnitY()) return KDL::Joint(name, KDL::Joint::RotY);
  if (axis == Eigen::Vector3d::UnitZ()) return KDL::Joint(name, KDL::Joint::RotZ);
  return KDL::Joint(name, KDL::Vector::Zero(), to_kdl(axis), KDL::Joint::RotAxis);
}

// A KDL segment is a joint at its root followed by a fixed tip frame: the offset of a rotation is a
// fixed segment of its own, without inertia, where it is not the identity.
KDL::Chain kdl_chain(const RigidChain& chain) {
  KDL::Chain result;
  for (const ChainRotation& rotation : chain.rotations()) {
    if (!rotation.origin.matrix().isIdentity(0.0)) {
      result.addSegment(KDL::Segment(rotation.name + "_origin", KDL::Joint(KDL::Joint::Fixed),
                                     to_kdl(rotation.origin)));
    }
    result.addSegment(KDL::Segment(rotation.name, kdl_joint(rotation.name, rotation.axis),
                                   KDL::Frame::Identity(), to_kdl(rotation.body)));
  }
  return result;
}

}  // namespace

RigidChain::RigidChain(std::vector<ChainRotation> rotations, const Eigen::Vector3d& gravity)
    : rotations_(std::move(rotations)), gravity_(gravity) {
  if (rotations_.empty()) throw InputError("rigid chain: no rotation in the chain");
  for (ChainRotation& rotation : rotations_) {
    const double length = rotation.axis.norm();
    if (!(length > 0.0)) {
      throw InputError(fmt::format("rigid chain: the axis of '{}' has no length", rotation.name));
    }
    rotation.axis /= length;
  }
}

struct RigidChainEvaluator::Workspace {
  explicit Workspace(const RigidChain& source)
      : chain(kdl_chain(source)),
        dynamics(chain, to_kdl(source.gravity())),
        gravity(source.gravity()),
        position(chain.getNrOfJoints()),
        velocity(chain.getNrOfJoints()),
        torque(chain.getNrOfJoints()),
        mass(static_cast<int>(chain.getNrOfJoints())),
        coriolis_torque(source.size()),
        gravity_torque(source.size()),
        gravity_stiffness(source.size(), source.size()) {
    const auto n = static_cast<std::size_t>(source.size());
    axes.resize(n);
    origins.resize(n);
    centres.resize(n);
    masses.reserve(n);
    for (const ChainRotation& rotation : source.rotations()) masses.push_back(rotation.body.mass);
  }

  // Axes, origins and centres of mass in the base frame.
  void forward_kinematics(const Eigen::VectorXd& q) {
    KDL::Frame frame = KDL::Frame::Identity();
    std::size_t a = 0;
    for (const KDL::Segment& segment : chain.segments) {
      const bool moves = segment.getJoint().getType() != KDL::Joint::Fixed;
      if (moves) {
        axes[a] = to_eigen(frame.M * segment.getJoint().JointAxis());
        origins[a] = to_eigen(frame.p);
      }
      frame = frame * segment.pose(moves ? q(static_cast<Eigen::Index>(a)) : 0.0);
      if (moves) centres[a++] = to_eigen(frame * segment.getInertia().getCOG());
    }
  }

  KDL::Chain chain;  // KDL caches poses in its chains, so this copy is the evaluator's own
  KDL::ChainDynParam dynamics;
  Eigen::Vector3d gravity;
  KDL::JntArray position, velocity, torque;
  KDL::JntSpaceInertiaMatrix mass;
  Eigen::VectorXd coriolis_torque, gravity_torque;
  Eigen::MatrixXd gravity_stiffness;
  std::vector<Eigen::Vector3d> axes, origins, centres;
  std::vector<double> masses;
};

RigidChainEvaluator::RigidChainEvaluator(const RigidChain& chain)
    : workspace_(std::make_unique<Workspace>(chain)) {}
RigidChainEvaluator::~RigidChainEvaluator() = default;
RigidChainEvaluator::RigidChainEvaluator(RigidChainEvaluator&&) noexcept = default;
RigidChainEvaluator& RigidChainEvaluator::operator=(RigidChainEvaluator&&) noexcept = default;

const Eigen::MatrixXd& RigidChainEvaluator::mass_matrix(const Eigen::VectorXd& q) {
  workspace_->position.data = q;
  workspace_->dynamics.JntToMass(workspace_->position, workspace_->mass);
  return workspace_->mass.data;
}

const Eigen::VectorXd& RigidChainEvaluator::gravity_torque(const Eigen::VectorXd& q) {
  workspace_->position.data = q;
  workspace_->dynamics.JntToGravity(workspace_->position, workspace_->torque);
  workspace_->gravity_torque = workspace_->torque.data;
  return workspace_->gravity_torque;
}

const Eigen::VectorXd& RigidChainEvaluator::coriolis_torque(const Eigen::VectorXd& q,
                                                            const Eigen::VectorXd& velocity) {
  workspace_->position.data = q;
  workspace_->velocity.data = velocity;
  workspace_->dynamics.JntToCoriolis(workspace_->position, workspace_->velocity,
                                     workspace_->torque);
  workspace_->coriolis_torque = workspace_->torque.data;
  return workspace_->coriolis_torque;
}

const Eigen::MatrixXd& RigidChainEvaluator::gravity_stiffness(const Eigen::VectorXd& q) {
  Workspace& w = *workspace_;
  w.forward_kinematics(q);
  double mass_beyond = 0.0;
  Eigen::Vector3d moment_beyond = Eigen::Vector3d::Zero();  // sum of m_k r_k
  for (std::size_t b = w.axes.size(); b-- > 0;) {
    mass_beyond += w.masses[b];
    moment_beyond += w.masses[b] * w.centres[b];
    const Eigen::Vector3d s = moment_beyond - mass_beyond * w.origins[b];
    const Eigen::Vector3d turned = w.axes[b].cross(s);
    for (std::size_t a = 0; a <= b; ++a) {
      const double value = -w.gravity.dot(w.axes[a].cross(turned));
      const auto row = static_cast<Eigen::Index>(a), column = static_cast<Eigen::Index>(b);
      w.gravity_stiffness(row, column) = w.gravity_stiffness(column, row) = value;
    }
  }
  return w.gravity_stiffness;
}

double RigidChainEvaluator::potential_energy(const Eigen::VectorXd& q) {
  Workspace& w = *workspace_;
  w.forward_kinematics(q);
  double energy = 0.0;
  for (std::size_t k = 0; k < w.centres.size(); ++k) {
    energy -= w.masses[k] * w.gravity.dot(w.centres[k]);
  }
  return energy;
}

BodyPlaces RigidChainEvaluator::body_places(const Eigen::VectorXd& q) {
  workspace_->forward_kinematics(q);
  return {workspace_->origins, workspace_->centres};
}

}  // namespace graybox
