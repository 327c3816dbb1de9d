// LocalModel: a flexible robot, linearised about rest at one position,
//
//   M q'' + C q' + K q = B u,   y = S q'        (motor torques u, motor velocities y)
//
// q = (arm rotations, motors), 12 + 6 = 18 degrees of freedom for the robot of the paper (Section
// VI-A); motors are counted in joint angles: motor-side angle = N * q_motor, N the transmission.
//
//   M = diag(M_a(q*), N^T J N),   C = friction + dampers,   K = springs + gravity stiffness,
//   B = (0; N^T),  S = (0, N) = B^T: u and y are motor-side.
//
// Springs and dampers are elements. An element with vector b pulls with -b (value) b^T q, so K =
// dg/dq + sum_p k_p b_p b_p^T. For a bearing about rotation i, b = e_i; for the gearbox between
// rotation i and motor m, b = e_i - e_m.
//
// Linearisation point. Motors stand at the commanded position, the arm hangs lower by its static
// deflection: k_i (q_i - q_i^0) + g_i(q*) = 0 with q^0 the commanded angles (zero at bearings). The
// paper allows q* = q^0 "with minor errors"; ignoring the sag costs 3 to 13 % of G near sharp
// lines (option gravity_deflection). q* is computed at theta_0 and does not move when stiffness
// parameters vary.
//
//   LocalModelBuilder builder(robot);                  // one for each thread
//   const LocalModel local = builder.build(position);  // commanded joint angles, rad
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "problems/mechanisms/rigid_chain.hpp"
#include "problems/mechanisms/robot_model.hpp"

namespace graybox {

// A spring or damper between the coordinates that b names.
struct LinearElement {
  enum class Kind { kSpring, kDamper };
  std::string name;
  Kind kind = Kind::kSpring;
  Eigen::VectorXd location;  // b, of the model's size
  double value = 0.0;        // N m/rad or N m s/rad
};

struct LocalModel {
  Eigen::VectorXd position;   // q*, rad: arm rotations, then motors (in joint angles)
  Eigen::MatrixXd mass;       // M
  Eigen::MatrixXd damping;    // C
  Eigen::MatrixXd stiffness;  // K
  Eigen::MatrixXd input;      // B
  Eigen::MatrixXd output;     // S
  std::vector<LinearElement> elements;
  std::vector<std::size_t> parameters;  // the element that each parameter scales

  [[nodiscard]] Eigen::Index degrees_of_freedom() const { return mass.rows(); }
  [[nodiscard]] Eigen::Index state_count() const { return 2 * mass.rows(); }

  // The same model with the parametrised elements' values multiplied by theta, at the same
  // linearisation point. Throws InputError if theta has another size than `parameters`.
  [[nodiscard]] LocalModel with_parameters(const Eigen::VectorXd& theta) const;
};

// The arm at rest at one position: all of the local model that depends on the position.
struct ArmLinearisation {
  Eigen::VectorXd rotations;          // q* of the arm, rad
  Eigen::MatrixXd mass;               // M_a(q*)
  Eigen::MatrixXd gravity_stiffness;  // dg/dq(q*)
};

struct LinearisationOptions {
  bool gravity_deflection = true;  // false: linearise at q^0, where the arm is not in equilibrium
};

class LocalModelBuilder {
 public:
  // Keeps a reference to the robot.
  explicit LocalModelBuilder(const RobotModel& robot, const LinearisationOptions& options = {});

  // `joint_angles`: commanded angle of each joint, rad. Throws InputError if their number is not
  // the robot's, or where the arm finds no static equilibrium (springs too soft to carry it).
  const ArmLinearisation& linearise(const Eigen::VectorXd& joint_angles);
  [[nodiscard]] LocalModel build(const Eigen::VectorXd& joint_angles);
  // At given rotations of the arm, where further elements hold it at rest.
  [[nodiscard]] LocalModel build_at(const Eigen::VectorXd& rotations,
                                    const Eigen::VectorXd& joint_angles);

  // M_a and dg/dq at given rotations, without looking for the equilibrium.
  const ArmLinearisation& at_rotations(const Eigen::VectorXd& rotations);

 private:
  void solve_equilibrium(const Eigen::VectorXd& commanded);
  [[nodiscard]] LocalModel model_of(const ArmLinearisation& arm,
                                    const Eigen::VectorXd& joint_angles) const;

  const RobotModel* robot_;
  LinearisationOptions options_;
  RigidChainEvaluator evaluator_;
  std::vector<Eigen::Index> gearboxes_;
  Eigen::VectorXd spring_stiffness_;
  Eigen::VectorXd commanded_;  // of each rotation
  ArmLinearisation arm_;
};

}  // namespace graybox
