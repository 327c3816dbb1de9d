#include "problems/mechanisms/urdf_chain.hpp"

#include <console_bridge/console.h>
#include <fmt/format.h>
#include <urdf_parser/urdf_parser.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <mutex>
#include <set>
#include <sstream>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/files/file_kind.hpp"
#include "problems/files/input_guard.hpp"

namespace graybox {
namespace {

// urdfdom reports through a global handler that prints; this one keeps the first error instead.
class FirstError : public console_bridge::OutputHandler {
 public:
  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level < console_bridge::CONSOLE_BRIDGE_LOG_ERROR || !text_.empty()) return;
    text_ = text;
    std::ranges::replace(text_, '\n', ' ');
  }
  [[nodiscard]] std::string text() const { return text_.empty() ? "unknown reason" : text_; }

 private:
  std::string text_;
};

urdf::ModelInterfaceSharedPtr parse(const std::filesystem::path& file) {
  require_file(file);
  note_input(file.string());
  std::ifstream stream(file);
  if (!stream) throw InputError(fmt::format("{}: can't be opened", file.string()));
  std::ostringstream text;
  text << stream.rdbuf();

  static std::mutex handler_is_global;
  const std::lock_guard lock(handler_is_global);
  FirstError first_error;
  console_bridge::useOutputHandler(&first_error);
  urdf::ModelInterfaceSharedPtr model;
  try {
    model = urdf::parseURDF(text.str());
  } catch (const std::exception& error) {
    console_bridge::restorePreviousOutputHandler();
    throw InputError(fmt::format("{}: not a valid URDF: {}", file.string(), error.what()));
  }
  console_bridge::restorePreviousOutputHandler();
  if (model == nullptr) {
    throw InputError(fmt::format("{}: not a valid URDF: {}", file.string(), first_error.text()));
  }
  return model;
}

Eigen::Isometry3d to_eigen(const urdf::Pose& pose) {
  Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
  double x = 0.0, y = 0.0, z = 0.0, w = 1.0;
  pose.rotation.getQuaternion(x, y, z, w);
  result.linear() = Eigen::Quaterniond(w, x, y, z).normalized().toRotationMatrix();
  result.translation() = Eigen::Vector3d(pose.position.x, pose.position.y, pose.position.z);
  return result;
}

class UrdfReader {
 public:
  explicit UrdfReader(const std::filesystem::path& file, LockedJoints locked = {})
      : file_(file.string()), model_(parse(file)), locked_(std::move(locked)) {
    require_tree();
    for (const auto& [name, place] : locked_) require_lock(name, place);
  }

  // The joints from base to tip.
  [[nodiscard]] std::vector<urdf::JointSharedPtr> path(const std::string& base,
                                                       const std::string& tip) const {
    if (model_->getLink(base) == nullptr) fail(fmt::format("no link '{}' (base)", base));
    urdf::LinkConstSharedPtr link = model_->getLink(tip);
    if (link == nullptr) fail(fmt::format("no link '{}' (tip)", tip));
    std::vector<urdf::JointSharedPtr> joints;
    while (link->name != base) {
      if (link->parent_joint == nullptr) {
        fail(fmt::format("link '{}' (tip) is not beyond link '{}' (base)", tip, base));
      }
      joints.push_back(link->parent_joint);
      link = link->getParent();
    }
    std::ranges::reverse(joints);
    return joints;
  }

  // All joints from the root on.
  [[nodiscard]] std::vector<UrdfJoint> tree() const {
    std::vector<UrdfJoint> joints;
    if (model_->getRoot() != nullptr) {
      add_joints(*model_->getRoot(), Eigen::Matrix3d::Identity(), joints);
    }
    return joints;
  }

  // A link by itself, in its frame.
  [[nodiscard]] RigidBody body_of(const std::string& link_name) const {
    const urdf::LinkConstSharedPtr link = model_->getLink(link_name);
    if (link == nullptr) fail(fmt::format("no link '{}'", link_name));
    return own_body(*link);
  }

  // A link and all that is fixed to it, in the link's frame; `next` is the joint that leads on.
  [[nodiscard]] RigidBody body(const std::string& link_name,
                               const urdf::JointSharedPtr& next) const {
    const urdf::LinkConstSharedPtr link = model_->getLink(link_name);
    RigidBody result = own_body(*link);
    for (const urdf::JointSharedPtr& joint : link->child_joints) {
      if (joint == next) continue;
      result = joined(result, moved(body(joint->child_link_name, nullptr), placed(*joint)));
    }
    return result;
  }

  // The child link's frame in the parent's; at zero where the joint is not locked.
  [[nodiscard]] Eigen::Isometry3d placed(const urdf::Joint& joint) const {
    const Eigen::Isometry3d origin = to_eigen(joint.parent_to_joint_origin_transform);
    const double place = place_of(joint);
    if (place == 0.0) return origin;
    const Eigen::Vector3d along = axis(joint).normalized();
    if (joint.type == urdf::Joint::PRISMATIC) return origin * Eigen::Translation3d(place * along);
    return origin * Eigen::AngleAxisd(place, along);
  }

  [[nodiscard]] bool is_fixed(const urdf::Joint& joint) const {
    if (joint.type == urdf::Joint::FIXED || locked_.contains(joint.name)) return true;
    if (joint.type != urdf::Joint::REVOLUTE && joint.type != urdf::Joint::CONTINUOUS &&
        joint.type != urdf::Joint::PRISMATIC) {
      fail(
          fmt::format("joint '{}': only revolute, continuous, prismatic and fixed joints can be in "
                      "the chain",
                      joint.name));
    }
    if (joint.mimic != nullptr) {
      fail(fmt::format("joint '{}' mimics another: describe coupled axes by a transmission matrix",
                       joint.name));
    }
    return false;
  }

  [[nodiscard]] Eigen::Vector3d axis(const urdf::Joint& joint) const {
    const Eigen::Vector3d result(joint.axis.x, joint.axis.y, joint.axis.z);
    if (!(result.norm() > 0.0)) fail(fmt::format("joint '{}': its axis has no length", joint.name));
    return result;
  }

  [[noreturn]] void fail(const std::string& message) const {
    throw InputError(fmt::format("{}: {}", file_, message));
  }

 private:
  void add_joints(const urdf::Link& link, const Eigen::Matrix3d& rotation,
                  std::vector<UrdfJoint>& joints) const {
    for (const urdf::JointSharedPtr& joint : link.child_joints) {
      UrdfJoint each{joint->name, link.name, joint->child_link_name};
      each.is_prismatic = joint->type == urdf::Joint::PRISMATIC;
      each.moves = can_move(*joint);
      if (joint->type != urdf::Joint::CONTINUOUS && joint->limits != nullptr) {
        each.lower = joint->limits->lower;
        each.upper = joint->limits->upper;
      }
      if (joint->dynamics != nullptr) {
        each.damping = joint->dynamics->damping;
        each.friction = joint->dynamics->friction;
      }
      each.parent_rotation = rotation;
      const urdf::LinkConstSharedPtr child = model_->getLink(joint->child_link_name);
      each.child_mass = child->inertial == nullptr ? 0.0 : child->inertial->mass;
      joints.push_back(each);
      add_joints(*child, rotation * placed(*joint).linear(), joints);
    }
  }

  static bool can_move(const urdf::Joint& joint) {
    return (joint.type == urdf::Joint::REVOLUTE || joint.type == urdf::Joint::CONTINUOUS ||
            joint.type == urdf::Joint::PRISMATIC) &&
           joint.mimic == nullptr;
  }

  [[nodiscard]] double place_of(const urdf::Joint& joint) const {
    if (const auto own = locked_.find(joint.name); own != locked_.end()) return own->second;
    if (joint.mimic == nullptr) return 0.0;
    const auto leader = locked_.find(joint.mimic->joint_name);
    return leader == locked_.end() ? 0.0
                                   : joint.mimic->multiplier * leader->second + joint.mimic->offset;
  }

  // A place beyond the limits by more than an encoder's zero may be off is another unit's.
  void require_lock(const std::string& name, double place) const {
    constexpr double kSlack = 0.1;  // of the range
    const urdf::JointConstSharedPtr joint = model_->getJoint(name);
    if (joint == nullptr) fail(fmt::format("no joint '{}' (locked)", name));
    if (!can_move(*joint)) fail(fmt::format("joint '{}' (locked) does not move by itself", name));
    if (!std::isfinite(place)) fail(fmt::format("joint '{}' (locked): is not finite", name));
    if (joint->type == urdf::Joint::CONTINUOUS || joint->limits == nullptr) return;
    const double lower = joint->limits->lower, upper = joint->limits->upper;
    const double slack = kSlack * (upper - lower);
    if (!(upper > lower) || (place >= lower - slack && place <= upper + slack)) return;
    fail(fmt::format("joint '{}' is locked at {:g}, beyond its limits of {:g} to {:g} {}", name,
                     place, lower, upper, joint->type == urdf::Joint::PRISMATIC ? "m" : "rad"));
  }

  // Links that form a loop hold each other in memory.
  void let_go_of_each_other() const {
    for (const auto& [name, link] : model_->links_) {
      link->child_links.clear();
      link->child_joints.clear();
    }
  }

  // Every link is moved by one joint at most, and a way down from it comes to an end: urdfdom takes
  // joints that form a loop.
  void require_tree() const {
    constexpr std::size_t kDeepest = 1000;
    std::set<std::string> moved_links;
    for (const auto& [name, joint] : model_->joints_) {
      if (!moved_links.insert(joint->child_link_name).second) {
        let_go_of_each_other();
        fail(fmt::format("link '{}' is the child of two joints", joint->child_link_name));
      }
    }
    for (const auto& [name, tip] : model_->links_) {
      std::size_t depth = 0;
      for (urdf::LinkConstSharedPtr link = tip; link->parent_joint != nullptr;
           link = link->getParent()) {
        if (++depth > kDeepest) {
          let_go_of_each_other();
          fail(fmt::format("link '{}': the joints form a loop, or a chain of more than {}", name,
                           kDeepest));
        }
      }
    }
  }

  [[nodiscard]] RigidBody own_body(const urdf::Link& link) const {
    if (link.inertial == nullptr) return {};
    const urdf::Inertial& i = *link.inertial;
    Eigen::Matrix3d inertia;
    inertia << i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz;
    if (!std::isfinite(i.mass) || i.mass < 0.0) {
      fail(fmt::format("link '{}': mass must not be negative, is {}", link.name, i.mass));
    }
    if (!inertia.allFinite()) fail(fmt::format("link '{}': inertia is not finite", link.name));
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(inertia, Eigen::EigenvaluesOnly);
    const Eigen::Vector3d moments = solver.eigenvalues();
    if (moments(0) < -1e-9 * moments.cwiseAbs().maxCoeff()) {
      fail(fmt::format("link '{}': inertia must be positive semidefinite, has the moment {}",
                       link.name, moments(0)));
    }
    const RigidBody body{i.mass, Eigen::Vector3d::Zero(), inertia};
    return moved(body, to_eigen(i.origin));
  }

  std::string file_;
  urdf::ModelInterfaceSharedPtr model_;
  LockedJoints locked_;
};

}  // namespace

RigidBody moved(const RigidBody& body, const Eigen::Isometry3d& pose) {
  return {body.mass, pose * body.centre_of_mass,
          pose.linear() * body.inertia * pose.linear().transpose()};
}

RigidBody joined(const RigidBody& a, const RigidBody& b) {
  RigidBody result;
  result.mass = a.mass + b.mass;
  if (result.mass > 0.0) {
    result.centre_of_mass = (a.mass * a.centre_of_mass + b.mass * b.centre_of_mass) / result.mass;
  }
  for (const RigidBody* body : {&a, &b}) {
    const Eigen::Vector3d r = body->centre_of_mass - result.centre_of_mass;
    result.inertia += body->inertia + body->mass * (r.squaredNorm() * Eigen::Matrix3d::Identity() -
                                                    r * r.transpose());
  }
  return result;
}

UrdfChain read_urdf_joints(const std::filesystem::path& file, const std::string& base,
                           const std::string& tip, const LockedJoints& locked) {
  const UrdfReader reader(file, locked);
  const std::vector<urdf::JointSharedPtr> path = reader.path(base, tip);
  UrdfChain chain;
  Eigen::Isometry3d offset = Eigen::Isometry3d::Identity();  // from the last joint's frame
  for (std::size_t j = 0; j < path.size(); ++j) {
    const urdf::Joint& joint = *path[j];
    const urdf::JointSharedPtr next = j + 1 < path.size() ? path[j + 1] : nullptr;
    const RigidBody body = reader.body(joint.child_link_name, next);
    offset = offset * reader.placed(joint);
    if (!reader.is_fixed(joint)) {
      chain.joints.push_back({joint.name, offset, reader.axis(joint), body});
      chain.is_prismatic.push_back(joint.type == urdf::Joint::PRISMATIC);
      if (joint.type != urdf::Joint::CONTINUOUS && joint.limits != nullptr) {
        chain.joints.back().lower = joint.limits->lower;
        chain.joints.back().upper = joint.limits->upper;
      }
      offset = Eigen::Isometry3d::Identity();
    } else if (!chain.joints.empty()) {
      chain.joints.back().body = joined(chain.joints.back().body, moved(body, offset));
    }
  }
  if (chain.joints.empty()) {
    reader.fail(fmt::format("no moving joint between '{}' and '{}'", base, tip));
  }
  return chain;
}

RigidBody read_urdf_body(const std::filesystem::path& file, const std::string& link) {
  return UrdfReader(file).body_of(link);
}

std::vector<UrdfJoint> read_urdf_tree(const std::filesystem::path& file,
                                      const LockedJoints& locked) {
  return UrdfReader(file, locked).tree();
}

std::vector<ChainRotation> read_urdf_chain(const std::filesystem::path& file,
                                           const std::string& base, const std::string& tip) {
  UrdfChain chain = read_urdf_joints(file, base, tip);
  const auto prismatic = std::ranges::find(chain.is_prismatic, true);
  if (prismatic != chain.is_prismatic.end()) {
    const auto at = static_cast<std::size_t>(prismatic - chain.is_prismatic.begin());
    throw InputError(fmt::format(
        "{}: joint '{}': only revolute, continuous and fixed joints can be in the chain",
        file.string(), chain.joints[at].name));
  }
  return std::move(chain.joints);
}

}  // namespace graybox
