// What force_balance_mismatch works on: motions and torques of a rigid robot as rows of a linear
// regression, and the places at which physics may be missing.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "graybox/diagnosis/force_balance/law_force.hpp"
#include "graybox/diagnosis/hypotheses/law_shapes.hpp"
#include "graybox/diagnosis/inverse_dynamics/motion_record.hpp"
#include "graybox/diagnosis/inverse_dynamics/weighted_regression.hpp"
#include "graybox/problems/mechanics/rigid_robot_model.hpp"

namespace graybox {

// All recordings of one role. Rows are time-major, a row for each joint (weighted_regression.hpp).
struct ForceBalanceRows {
  TorqueRows base;                 // columns of the base parameters; torque less what is known
  std::vector<Motion> pieces;      // in the order of the rows
  std::vector<std::string> names;  // of each piece's recording

  [[nodiscard]] bool empty() const { return pieces.empty(); }
  [[nodiscard]] Eigen::Index samples() const { return base.samples(); }
};

struct ForceBalanceData {
  RigidRobotModel robot;
  std::vector<std::string> parameter_names, parameter_units;  // of the columns
  ForceBalanceRows estimation, validation;
  std::vector<CandidatePlace> places;
};

// Base parameters are those that the estimation data can tell apart. Throws InputError as
// force_balance_problem does.
[[nodiscard]] ForceBalanceData load_force_balance_data(const std::filesystem::path& model,
                                                       const Campaign& campaign);

// Deflection and rate of a place in one piece: z = b_in^T q.
[[nodiscard]] PlaceMotion motion_at(const CandidatePlace& place, const Motion& piece);

// A law's force in all rows: b_out f(z, z'), pieces one after another.
[[nodiscard]] Eigen::VectorXd law_rows(const CandidatePlace& place, const Law& law,
                                       const ForceBalanceRows& rows);
// The same for an inertia of one: b_out z''.
[[nodiscard]] Eigen::VectorXd inertia_rows(const CandidatePlace& place,
                                           const ForceBalanceRows& rows);

}  // namespace graybox
