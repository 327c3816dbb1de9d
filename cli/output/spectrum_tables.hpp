// The tables that `graybox design spectrum` writes and prints.
#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "problems/information/information_set.hpp"
#include "problems/mechanisms/robot_model.hpp"
#include "problems/robot_information/robot_grid.hpp"
#include "solvers/blocks/block_designs.hpp"

namespace graybox::cli {

// One design as the tables show it. Covariance: (det H^-1)^(1/d).
struct ComparedDesign {
  BlockDesign of;
  double log_det = 0.0;
  double covariance = 0.0;
  double joint_gap = 0.0;  // certified, against the joint optimum without limits
  std::size_t positions = 0;
  std::size_t lines = 0;
};

[[nodiscard]] ComparedDesign compared(const InformationSet& set, const CandidateBlocks& blocks,
                                      BlockDesign design);

// "joint" or "joint, at most 10 % a position" for people; `design,position_limit` for files.
[[nodiscard]] std::string describe(const BlockDesign& design);

// Columns: design, position_limit, covariance, over_first (covariance over that of the first row),
// log_det, own_gap, joint_gap, positions, lines, passes, seconds, status.
[[nodiscard]] std::string comparison_csv(const std::vector<ComparedDesign>& designs);
[[nodiscard]] std::string comparison_text(const std::vector<ComparedDesign>& designs);
[[nodiscard]] nlohmann::ordered_json comparison_json(const std::vector<ComparedDesign>& designs);

// A row for each line that carries power, of every design but `flat`: design, position_limit,
// position (its index in the grid), q1, q2, ... (deg), share (of the time), frequency (Hz), axis,
// power (rho, in the unit of Phi_r), weight (share times power over the power limit), resonance
// (the nearest natural frequency of the position with free motors, Hz).
[[nodiscard]] std::string spectra_csv(const RobotModel& robot, const InformationSet& set,
                                      const CandidateBlocks& blocks,
                                      const std::vector<ComparedDesign>& designs);

// What is left of each design where the true stiffness differs: `samples` draws of all factors,
// uniform within a deviation. Columns: design, position_limit, deviation, samples,
// covariance_median, covariance_90 (which 90 % stay below), covariance_worst.
[[nodiscard]] std::string robustness_csv(const RobotModel& robot, const PositionTable& positions,
                                         const CandidateBlocks& blocks,
                                         const std::vector<ComparedDesign>& designs,
                                         std::size_t samples, int threads);

}  // namespace graybox::cli
