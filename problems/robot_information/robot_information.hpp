// Fisher information matrices of a flexible robot at many positions, exact and fast.
//
// Formula (5) of the paper with the noise (12), Phi_v = C_v w^2 I and Phi_r = C_r, is
//
//   H_pq = sum_w 2 Re{ vec(dG_p)^H Lambda^-1 vec(dG_q) },
//   Lambda^-1 = (Phi_r / n_y) (A^-T (x) Phi_v^-1),   A = (G + F^-1)^H (G + F^-1).
//
// Rank one. D = K + j w C - w^2 M is symmetric and spring p enters it as k_p theta_p b_p b_p^T. So
// dG_p = -j w h k_p l_p l_p^T with l_p = S D^-1 b_p (S, B = S^T motor-side, h the hold factor).
// Then
//
//   H_pq = sum_w (2 Phi_r / n_y) w^2 |h|^2 k_p k_q Re[ (l_p^H Phi_v^-1 l_q) (l_p^H A*^-1 l_q) ],
//
// A* the conjugate of A: each frequency adds a Hadamard product of two Gram matrices. G + F^-1 is
// symmetric, so l_p^H A*^-1 l_q = (Z^-1 l_p)^H (Z^-1 l_q) / (w^2 |h|^2) with
// Z = (G + F^-1) / (j w h) = S D^-1 S^T + F^-1 / (j w h), and the hold factor cancels elsewhere.
//
// Motors out. A motor hangs on its gearbox alone: D = [D_a, -K_g'; -K_g'^T, D_m]. There K_g, the
// gearboxes' k + j w c, couple rotation g_i of the arm with motor i. D_m = K_g + j w f - w^2 J (J,
// f: motor inertia and friction in joint angles) does not depend on the position. With W = D_m^-1
// K_g the arm alone has
//
//   E = dg/dq - w^2 M_a + (bearings) + P on the gearbox rotations,
//   P = K_g - K_g D_m^-1 K_g = K_g D_m^-1 (D_m - K_g)          (no cancellation in the last form)
//   S D^-1 S^T = N D_m^-1 N^T + U (E^-1)_gg U^T,  U = N W
//   l_p = U (E^-1)_gb                                          for a bearing
//   l_p = U (E^-1)_gg R - N D_m^-1,  R = (I - W)^T             for the gearbox columns
//
// E (12 x 12) is factored for several frequencies in one vector; only its gearbox columns are
// solved for. All that is free of the position is tabulated once.
//
// Cost: O(n_f (n_a^3 + n_a^2 n_m)) a position, plus the mass matrix and equilibrium by KDL;
// positions are shared among threads. Memory beyond the result: a few hundred kilobytes a thread.
// Results do not depend on the thread count, nor on the other positions, to the last bit (on one
// kind of processor: the kernels for other vector widths add the frequencies in another order).
//
//   const RobotModel robot = load_robot_model(default_robot_file());
//   const InformationSet set = robot_information_set(robot, paper_grid(), {.threads = 2});
#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>

#include "problems/information/information_set.hpp"
#include "problems/mechanisms/robot_model.hpp"
#include "problems/robot_information/robot_grid.hpp"

namespace graybox {

struct RobotInformationOptions {
  int threads = 1;
  // H is multiplied by this: C_r / C_v of the file times `scale` is what counts.
  double scale = 1.0;
  // Linearise where the arm hangs at rest; false: at the commanded position (local_model.hpp).
  bool gravity_deflection = true;
  // Let the linearisation point move with theta, dq*/dtheta_p = -(K_a + dg/dq)^-1 k_p b_p b_p^T (q*
  // - q0), instead of holding it. Then dG_p has full rank. M_a and dg/dq are differentiated
  // numerically along that direction; about 50 times slower. Effect on H of irb6600_like on the
  // paper's grid: 0.1 % (Frobenius norm) in the median, 1.1 % at most; the covariance (det
  // H)^(-1/d) of a position changes by less than 0.5 % for 98 % of the positions, by -2.2 to 1.9 %
  // at most.
  bool total_derivative = false;
};

// One candidate a position; candidate coordinates are the commanded joint angles q1, q2, ... in
// degrees, parameters are named like the springs. Throws InputError if the positions do not fit the
// robot, are not finite, or have no static equilibrium, and for a scale that is not positive.
[[nodiscard]] InformationSet robot_information_set(const RobotModel& robot,
                                                   const PositionTable& positions,
                                                   const RobotInformationOptions& options = {});

// H at one position (rad), d x d, by the same route.
[[nodiscard]] Eigen::MatrixXd robot_information_matrix(const RobotModel& robot,
                                                       const Eigen::VectorXd& joint_angles,
                                                       const RobotInformationOptions& options = {});

// H at one position after another, where the next position depends on the last H (an optimiser):
// what robot_information_matrix() prepares for each call is prepared once. One for each thread.
class RobotInformationEvaluator {
 public:
  // Keeps a reference to the robot. options.threads is not used; total_derivative is not supported
  // (InputError).
  explicit RobotInformationEvaluator(const RobotModel& robot,
                                     const RobotInformationOptions& options = {});
  ~RobotInformationEvaluator();
  RobotInformationEvaluator(const RobotInformationEvaluator&) = delete;
  RobotInformationEvaluator& operator=(const RobotInformationEvaluator&) = delete;

  // Writes H, packed. `joint_angles` in rad; throws InputError where there is no equilibrium.
  void compute(const Eigen::VectorXd& joint_angles, std::span<double> information);

 private:
  struct Workspace;
  std::unique_ptr<Workspace> workspace_;
};

}  // namespace graybox
