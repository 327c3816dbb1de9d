// Fisher information matrices of a robot for each position, frequency and input axis. They are the
// candidates of the joint design of positions and excitation spectra. That is the "interesting
// extension" of Section II of the paper, where the spectrum of each position is chosen before the
// positions.
//
// One line. Let the reference excite one axis a at one frequency w with power rho, R R^H = rho e_a
// e_a^T. In closed loop u = F (r - y), y = G u + v, so that the torques are U = (G + F^-1)^-1 R.
// With (5), Lambda^-1 = [U U^H]^T (x) Phi_v^-1 and dG_p = -j w h k_p l_p l_p^T
// (robot_information.hpp),
//
//   vec(dG_p)^H Lambda^-1 vec(dG_q) = w^2 |h|^2 k_p k_q (l_p^H Phi_v^-1 l_q) (l_p^H [U U^H]^T l_q),
//   [U U^H]^T = rho conj(s) s^T,   s = (G + F^-1)^-1 e_a,   t_p = l_p^T s:
//
//   rho H_{i,w,a},   H_{i,w,a} = 2 w^2 |h|^2 k_p k_q Re[ (l_p^H Phi_v^-1 l_q) conj(t_p) t_q ].  (1)
//
// (Lambda itself is infinite for one axis alone: what one reference tells of G is its product with
// one direction. Its inverse, the information, is finite.) U U^H is linear in R R^H, so a reference
// with R R^H = sum_a rho_a e_a e_a^T at each frequency (axes excited in turn or uncorrelated) has
//
//   H_i(rho) = sum_{w,a} rho_{w,a} H_{i,w,a},                                                   (2)
//
// and rho_{w,a} = Phi_r / n_y gives the H_i of robot_information.hpp back.
//
// One simplex. Position i gets the share tau_i of the experiments, sum_i tau_i = 1, and there its
// spectrum has at most the total power P_i, sum_{w,a} rho_{i,w,a} <= P_i. The information of the
// whole is sum_i tau_i sum_{w,a} rho_{i,w,a} H_{i,w,a}; more power never hurts, so the limit is
// reached, and with
//
//   lambda_{i,w,a} = tau_i rho_{i,w,a} / P_i >= 0:    sum lambda = 1,                           (3)
//   M = sum lambda_{i,w,a} (P_i H_{i,w,a}),
//
// the joint design is (9) with the matrices P_i H_{i,w,a}. Conversely tau_i = sum_{w,a}
// lambda_{i,w,a} and rho_{i,w,a} = P_i lambda_{i,w,a} / tau_i. The default P_i = n_f Phi_r is the
// power of the flat spectrum (Phi_r over all axes at each frequency), so that flat spectra in any
// positions are among the designs: lambda_{i,w,a} = tau_i / (n_f n_y).
//
// A limit on the power of one axis or band in each position is sum_{w in band} rho_{i,w,a} <= beta.
// It reads sum_{w in band} lambda_{i,w,a} <= (beta / P_i) sum_{w,a} lambda_{i,w,a}. This is linear,
// but it ties candidates to their position's share and is no simplex any more. It is not offered
// here.
//
// Candidates are ordered by position, then frequency, then axis: (i n_f + f) n_y + a. The matrices
// are written once, into the one packed array of the set, by several threads; results do not depend
// on their number to the last bit. Cost O(n_f n_y d^2) a position beyond robot_information. The
// linearisation point is held (no total_derivative: (1) needs rank one).
//
//   const RobotModel robot = load_robot_model(default_robot_file());
//   const InformationSet set = robot_spectrum_set(robot, robot_grid(20), {.threads = 2});
//   assert(set.candidate_count() == 20 * line_count(robot));
#pragma once

#include <cstddef>
#include <vector>

#include "problems/information/information_set.hpp"
#include "problems/mechanisms/robot_model.hpp"
#include "problems/robot_information/robot_grid.hpp"

namespace graybox {

struct RobotSpectrumOptions {
  int threads = 1;
  // P_i in the unit of Phi_r, one number for each position; empty: n_f Phi_r for all of them.
  std::vector<double> power = {};
  bool gravity_deflection = true;  // as in RobotInformationOptions
};

// Candidates of one position: n_f n_y.
[[nodiscard]] std::size_t line_count(const RobotModel& robot);

// The power of the flat spectrum, n_f Phi_r.
[[nodiscard]] double flat_power(const RobotModel& robot);

// Bytes that the set of so many positions takes, coordinates included.
[[nodiscard]] std::size_t robot_spectrum_bytes(const RobotModel& robot, std::size_t positions);

// The matrices P_i H_{i,w,a}. Candidate coordinates: the commanded joint angles q1, q2, ... in
// degrees, the frequency in Hz, the axis counted from 1. Throws InputError if the positions do not
// fit the robot, are not finite or have no static equilibrium, for powers that are not positive or
// too many or few, and where a matrix is not finite.
[[nodiscard]] InformationSet robot_spectrum_set(const RobotModel& robot,
                                                const PositionTable& positions,
                                                const RobotSpectrumOptions& options = {});

}  // namespace graybox
