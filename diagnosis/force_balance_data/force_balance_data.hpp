// What force_balance_mismatch works on: motions and forces of several coordinates (a robot's
// joints) as rows of a linear regression, and the places at which physics may be missing.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/force_balance_data/law_sample_cache.hpp"
#include "diagnosis/hypotheses/law_shapes.hpp"
#include "diagnosis/inverse_dynamics/filtered_motion.hpp"
#include "diagnosis/inverse_dynamics/law_force.hpp"
#include "diagnosis/inverse_dynamics/motion_record.hpp"
#include "diagnosis/plausibility/fitted_physics.hpp"
#include "diagnosis/signals/standing_drive.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"

namespace graybox {

// Forces of one term of the balance, by coordinate: samples x columns, or nothing where the term
// does not act.
struct BalanceColumns {
  std::vector<Eigen::MatrixXd> in;
  Eigen::Index count = 0;  // of columns

  // A column that acts on all coordinates, or on one of them alone.
  struct Chosen {
    Eigen::Index column = 0, coordinate = -1;  // -1: on all
  };
  // These columns of another term, after those that are there.
  void append(const BalanceColumns& more, const std::vector<Chosen>& chosen);
};

// All recordings of one role. Samples of all pieces one after another.
struct ForceBalanceRows {
  Eigen::MatrixXd measured;  // force, samples x coordinates
  Eigen::MatrixXd force;     // less what is known
  BalanceColumns model;      // columns of the model's own parameters
  // Prior precision of each of these, about zero; empty: none has any (uncertain_bodies.hpp).
  Eigen::VectorXd model_precision;
  double worth = 1.0;          // of a sample, in independent ones, that the prior was weighed by
  BalanceColumns flange_body;  // of the ten standard parameters of a body at the flange, if any
  BalanceColumns bodies;       // of those of every link; none where they are not asked for
  std::vector<Motion> pieces;  // in the order of the rows
  std::vector<FilteredMotion> filtered;  // of each piece, for laws
  std::vector<std::string> names;        // of each piece's recording
  std::shared_ptr<LawSampleCache> laws;  // forces of laws in all rows
  // Samples x coordinates, 0 where a joint's force is left out (Motion::stands): all columns are
  // zero there and what was measured is its mean. Else 1. Empty: all count.
  Eigen::MatrixXd counts;

  [[nodiscard]] bool empty() const { return pieces.empty(); }
  [[nodiscard]] Eigen::Index samples() const { return measured.rows(); }
  [[nodiscard]] Eigen::Index coordinates() const { return measured.cols(); }
  // Samples of a coordinate that count.
  [[nodiscard]] double counted(Eigen::Index coordinate) const;
  [[nodiscard]] double counted(Eigen::Index coordinate, Eigen::Index first,
                               Eigen::Index rows) const;
  void leave_out_standing(BalanceColumns& columns) const;
  // What does not count becomes zero on both sides of the balance.
  void leave_out_standing_forces();
  // Root mean squares of `values` by coordinate (samples x coordinates, zero where nothing counts).
  [[nodiscard]] Eigen::VectorXd root_mean_squares(const Eigen::MatrixXd& values) const;
};

struct BalanceCoordinate {
  std::string name;
  PlaceUnits units;

  // "torque of joint_1", "force of carriage".
  [[nodiscard]] std::string channel() const;
};

// A standard inertial parameter of a link that may depart from what the model states. Where drive
// gains are unknown each joint has a departure of its own, over its gain; else `joint` is -1.
struct UncertainParameter {
  Eigen::Index link = 0, parameter = 0;
  double stated = 0.0, deviation = 0.0;  // of the prior
  Eigen::Index joint = -1;
};

struct ForceBalanceData {
  std::vector<BalanceCoordinate> coordinates;
  std::vector<std::string> parameter_names, parameter_units;  // of the model's columns
  // What each may be: a sum of masses, moments of inertia or coefficients of laws, or kOther where
  // anything is possible.
  std::vector<QuantityKind> parameter_kinds;
  std::vector<Eigen::Index> base_columns;  // of TorqueColumns, that these parameters belong to
  ForceBalanceRows estimation, validation;
  std::vector<CandidatePlace> places;
  Eigen::Isometry3d flange = Eigen::Isometry3d::Identity();  // in the last link's frame
  RigidRobotModel robot;
  // Where drive gains are unknown: which of the model's parameters is 1/gain of each joint, -1 of
  // those that nothing known acts on; empty if no gain is told.
  std::vector<Eigen::Index> gain_parameters;
  std::vector<UncertainParameter> uncertain;  // the last of the model's parameters
  // 1/gain of each joint by which the prior of these was scaled; empty where gains are known.
  Eigen::VectorXd prior_gains;
  bool position_is_recorded = true;  // else it is an integral: laws that need it are not tried
  std::vector<Motion> recorded;      // for estimation, every sample
  // What the model states of a robot of one joint, kg m^2 or kg; NaN for others.
  double known_inertia = std::numeric_limits<double>::quiet_NaN();
  // What the drive of a single joint gave while that stood still, in the recordings of the fit.
  // Where the model has springs, weights or dry friction, too, it tells nothing.
  StandingDrive standing;
  std::vector<bool> idle;            // joints that never move (standstill.hpp)
  Eigen::VectorXd advance;           // s, by which forces were moved, by joint; empty: none was
  std::vector<std::string> remarks;  // what was left out, a sentence each
};

// Reads the recordings of a rigid robot. Base parameters are those that the estimation data can
// tell apart. Forces are moved by `advance` (late_forces.hpp), if that has a time for each joint.
// Throws InputError as force_balance_problem does.
[[nodiscard]] ForceBalanceData load_force_balance_data(
    const RigidRobotModel& robot, const Campaign& campaign,
    std::span<const std::filesystem::path> place_files = {}, const Eigen::VectorXd& advance = {});

// What the model says along a motion that nobody has recorded: rows whose measured force is that of
// the motion (zero, if it has none). The model's parameters are those of `data`.
[[nodiscard]] ForceBalanceRows rows_along(const ForceBalanceData& data, Motion motion);

// Places and parameters of the only joint named as those of a mass of a lumped model.
void name_as_lumped(ForceBalanceData& data);

// Deflection and rate of a place in one piece: z = b_in^T q.
[[nodiscard]] RecordedPlaceMotion motion_at(const CandidatePlace& place, const Motion& piece);

// A law's force in all rows, as the torques' filters leave it: b_out f(z, z'), pieces one after
// another.
[[nodiscard]] Eigen::VectorXd law_samples(const CandidatePlace& place, const Law& law,
                                          const ForceBalanceRows& rows);
// The same for an inertia of one: b_out z''.
[[nodiscard]] Eigen::VectorXd inertia_samples(const CandidatePlace& place,
                                              const ForceBalanceRows& rows);

}  // namespace graybox
