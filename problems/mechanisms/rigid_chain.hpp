// A chain of rigid bodies joined by rotations: the arm of a robot, where a joint with elastic
// bearings is several rotations about one point. Mass matrix, gravity and Coriolis torques come
// from Orocos KDL; the gravity stiffness, which KDL lacks, is derived below.
//
//   M(q) q'' + c(q, q') + g(q) = tau        (n coordinates q, one for each rotation, in rad)
//
//   graybox::RigidChain chain(rotations, {0.0, 0.0, -9.81});
//   graybox::RigidChainEvaluator evaluator(chain);       // one for each thread
//   const Eigen::MatrixXd mass = evaluator.mass_matrix(q);
//
// Gravity stiffness. With the potential U(q) = -sum_k m_k g^T r_k, r_k the centre of mass of body
// k, z_a and o_a the axis and origin of rotation a in the base frame, a at or before b in the
// chain:
//   dr_k/dq_a         = z_a x (r_k - o_a)                    for bodies k beyond a
//   d2r_k/dq_a dq_b   = z_a x (z_b x (r_k - o_b))            for bodies k beyond b
//   d2U/dq_a dq_b     = -g^T [z_a x (z_b x s_b)],  s_b = sum of m_k (r_k - o_b) over bodies beyond
//   b,
// which is dg_a/dq_b, symmetric. Cost O(n^2).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <limits>
#include <memory>
#include <string>
#include <vector>

namespace graybox {

struct RigidBody {
  double mass = 0.0;                                         // kg
  Eigen::Vector3d centre_of_mass = Eigen::Vector3d::Zero();  // m, in the body's frame
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();         // kg m^2, about the centre of mass
};

// One rotation of the chain and the body that turns with it. The body's frame is the frame of the
// rotation; at q = 0 it stands at `origin` in the frame of the rotation before.
struct ChainRotation {
  std::string name;
  Eigen::Isometry3d origin = Eigen::Isometry3d::Identity();
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();          // of any length but zero
  RigidBody body;                                           // mass 0 for an intermediate rotation
  double lower = -std::numeric_limits<double>::infinity();  // limits of the joint, rad
  double upper = std::numeric_limits<double>::infinity();
};

class RigidChain {
 public:
  // gravity: m/s^2, in the base frame. Throws InputError for an empty chain or a zero axis.
  RigidChain(std::vector<ChainRotation> rotations, const Eigen::Vector3d& gravity);

  [[nodiscard]] Eigen::Index size() const { return static_cast<Eigen::Index>(rotations_.size()); }
  [[nodiscard]] const std::vector<ChainRotation>& rotations() const { return rotations_; }
  [[nodiscard]] const Eigen::Vector3d& gravity() const { return gravity_; }

 private:
  std::vector<ChainRotation> rotations_;
  Eigen::Vector3d gravity_;
};

// Where the bodies of a chain are, in the base frame, m.
struct BodyPlaces {
  std::vector<Eigen::Vector3d> origins;          // of each rotation's frame
  std::vector<Eigen::Vector3d> centres_of_mass;  // of each body; its frame's origin where massless
};

// Evaluates a chain at any q. Holds KDL's workspace, so each thread needs its own.
class RigidChainEvaluator {
 public:
  explicit RigidChainEvaluator(const RigidChain& chain);
  ~RigidChainEvaluator();
  RigidChainEvaluator(RigidChainEvaluator&&) noexcept;
  RigidChainEvaluator& operator=(RigidChainEvaluator&&) noexcept;

  // Each returns a reference to the evaluator's own storage, valid until the same function runs
  // again.
  const Eigen::MatrixXd& mass_matrix(const Eigen::VectorXd& q);     // n x n, kg m^2
  const Eigen::VectorXd& gravity_torque(const Eigen::VectorXd& q);  // g(q) = dU/dq, N m
  const Eigen::VectorXd& coriolis_torque(const Eigen::VectorXd& q,  // c(q, q'), N m
                                         const Eigen::VectorXd& velocity);
  const Eigen::MatrixXd& gravity_stiffness(const Eigen::VectorXd& q);  // dg/dq, N m/rad
  double potential_energy(const Eigen::VectorXd& q);                   // U(q), J
  BodyPlaces body_places(const Eigen::VectorXd& q);

 private:
  struct Workspace;
  std::unique_ptr<Workspace> workspace_;
};

}  // namespace graybox
