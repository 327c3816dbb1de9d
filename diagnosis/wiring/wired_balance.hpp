// The force balance of a rigid robot as it would be with other wires: least squares over all joints
// of
//
//   N^T u = known + W(q, q', q'') p + d q' + c tanh(q'/v) + o,
//
// p what the model does not know, and at every joint d, c, o for viscous and dry friction and a
// constant (v a twentieth of the velocity's rms), which most models leave out and all machines
// have. Each joint counts over the deviation of its own force, so that no unit matters, and one
// whose force does not change does not count. Parameters that the motion can't tell apart share
// what they explain (least norm).
//
//   WiredBalance balance(robot, pieces);
//   Wiring wiring(robot.size());
//   std::swap(wiring.force[0], wiring.force[1]);
//   balance.fit(wiring).error;
//
// Cost: O(N n p^2) for every wiring of the motions, N at most 1500 samples of n joints; n p^2
// numbers are kept of each (11 times as many where parts were left out); O(n p^2 + p^3) a fit.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <span>
#include <utility>
#include <vector>

#include "diagnosis/inverse_dynamics/torque_columns.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"

namespace graybox {

// What each joint's signals are taken to be, as they are recorded (of the motors or of the joints):
// the recorded signal of `force`[j] times a factor, and of `motion`[j], with its rates, likewise.
struct Wiring {
  std::vector<Eigen::Index> force, motion;
  Eigen::VectorXd force_factors, motion_factors;

  explicit Wiring(Eigen::Index joints);  // as they say
  [[nodiscard]] bool has_motion_of(const Wiring& other) const {
    return motion == other.motion && motion_factors == other.motion_factors;
  }
};

struct WiredFit {
  Eigen::VectorXd parameters;
  Eigen::VectorXd
      error;  // rms of each joint, over its force's deviation from the mean; 0 where that is 0
};

// Takes every so many samples of all pieces, so that about `most` or fewer are left.
[[nodiscard]] std::vector<Motion> thinned(std::span<const Motion> pieces, Eigen::Index most);

class WiredBalance {
 public:
  static constexpr Eigen::Index kBlocks = 10;  // of the recordings, for jackknives

  enum class Gains : std::int8_t { kAnySign, kPositive };  // of drives that are not known

  // Keeps a reference to the robot.
  WiredBalance(const RigidRobotModel& robot, std::span<const Motion> pieces,
               Gains gains = Gains::kAnySign);

  // `left_out`: a block, or none where negative.
  [[nodiscard]] WiredFit fit(const Wiring& wiring, Eigen::Index left_out = -1);

  // m_jj = e_j^T M(q) e_j by that fit, summed over the motion.
  [[nodiscard]] double inertia(const Wiring& wiring, const WiredFit& fit, Eigen::Index j);
  // What friction takes, (f_j(q, q') - f_j(q, -q')) q'_j / 2, laws with memory as they are, summed
  // likewise.
  [[nodiscard]] double dissipation(const Wiring& wiring, const WiredFit& fit, Eigen::Index j);

  // What is kept of other motions.
  void forget();

  // Of a joint's position, rad or m.
  [[nodiscard]] double range(const Wiring& wiring, Eigen::Index j) const;

 private:
  // Products of the balance's columns and forces at one joint, over some samples.
  struct Products {
    Eigen::MatrixXd gram;     // W^T W
    Eigen::MatrixXd moments;  // W^T [recorded forces in joint coordinates, known]
    Eigen::MatrixXd squares;  // [forces, known, 1]^T [forces, known, 1]
  };
  // c^T p + known.
  struct Functional {
    Eigen::VectorXd columns;
    double known = 0.0;
  };
  // All of one wiring of the motions, whatever the forces' wires.
  struct Sums {
    std::vector<std::vector<Products>> blocks;     // [block][joint], where they were asked for
    std::vector<Products> all;                     // of all blocks
    std::vector<Functional> inertia, dissipation;  // by joint
  };

  [[nodiscard]] Eigen::Index parameters() const;
  [[nodiscard]] Motion motion_under(const Wiring& wiring, const Motion& piece) const;
  [[nodiscard]] Eigen::VectorXd solve_with_gains(Eigen::MatrixXd gram,
                                                 Eigen::VectorXd moment) const;
  [[nodiscard]] Eigen::VectorXd force_row(const Wiring& wiring, Eigen::Index j) const;
  const Sums& sums_under(const Wiring& wiring, bool with_blocks);
  [[nodiscard]] Sums sums_of(const Wiring& wiring, bool with_blocks);
  void add_sample(const Motion& moved, const Motion& recorded, Eigen::Index t,
                  const Eigen::RowVectorXd& remembered, const Eigen::VectorXd& transition,
                  std::vector<Products>& block);
  void add_functionals(const Motion& moved, Eigen::Index t, const Eigen::RowVectorXd& remembered,
                       const Eigen::VectorXd& transition, Sums& sums);

  const RigidRobotModel& robot_;
  Gains gains_;
  Eigen::Index joints_;
  std::vector<Motion> pieces_;  // thinned
  TorqueColumns columns_;
  Eigen::MatrixXd to_motors_;  // N^-1
  std::deque<std::pair<Wiring, Sums>> known_;
};

}  // namespace graybox
