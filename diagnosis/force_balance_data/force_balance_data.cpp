#include "diagnosis/force_balance_data/force_balance_data.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <variant>

#include "diagnosis/force_balance_data/clipped_forces.hpp"
#include "diagnosis/force_balance_data/held_commands.hpp"
#include "diagnosis/force_balance_data/late_forces.hpp"
#include "diagnosis/force_balance_data/standstill.hpp"
#include "diagnosis/hypotheses/place_file.hpp"
#include "diagnosis/inverse_dynamics/base_parameters.hpp"
#include "diagnosis/inverse_dynamics/torque_columns.hpp"
#include "problems/base/error.hpp"
#include "problems/mechanisms/rigid_body_regressor.hpp"

namespace graybox {
namespace {

constexpr Eigen::Index kFewestSamples = 50;
constexpr double kFewestMoving = 20.0;  // samples in which a joint moves, else it is idle
// So many samples of the estimation data are used at most. Samples closer than residuals forget
// each other say little more, but laws with memory take their time for each.
constexpr Eigen::Index kMostSamples = 6000;
// Behind a low-pass so many samples to a period of its frequency hold all that is left, but no
// recording is thinned by that below this number.
constexpr double kSamplesAPeriod = 5.0;
constexpr Eigen::Index kFewestThinned = 1000;
// What is left of a column after projection on the others, below which these data can't tell it
// from them.
constexpr double kDependent = 1e-6;

// Every stride-th sample.
Motion thinned(const Motion& piece, Eigen::Index stride) {
  const auto kept = Eigen::seq(Eigen::Index{0}, Eigen::last, stride);
  Motion result{piece.time(kept),
                piece.position(kept, Eigen::all),
                piece.velocity(kept, Eigen::all),
                piece.acceleration(kept, Eigen::all),
                piece.torque(kept, Eigen::all),
                piece.filters,
                piece.position_is_recorded,
                piece.load};
  if (piece.stands.size() > 0) result.stands = piece.stands(kept, Eigen::all);
  return result;
}

// Samples between those that the low-pass of a piece leaves to be told; 1 without one.
Eigen::Index stride_behind_filters(const Motion& piece) {
  double highest = 0.0;
  for (const FilterPass& filter : piece.filters) highest = std::max(highest, filter.frequency);
  const double periods = kSamplesAPeriod * highest * piece.sample_time();
  return periods > 0.0 ? std::max(Eigen::Index{1}, static_cast<Eigen::Index>(1.0 / periods + 1e-9))
                       : 1;
}

void thin(std::vector<Motion>& pieces) {
  if (pieces.empty()) return;
  Eigen::Index samples = 0, behind_filters = kMostSamples;
  for (const Motion& piece : pieces) {
    samples += piece.samples();
    behind_filters = std::min(behind_filters, stride_behind_filters(piece));
  }
  behind_filters = std::min(behind_filters, std::max(Eigen::Index{1}, samples / kFewestThinned));
  const Eigen::Index stride = std::max(samples / kMostSamples + 1, behind_filters);
  if (stride == 1) return;
  for (Motion& piece : pieces) piece = thinned(piece, stride);
}

// Room for the rows of these pieces, with `size` columns of the model.
ForceBalanceRows empty_rows(std::vector<Motion> pieces, std::vector<std::string> names,
                            const RigidRobotModel& robot, Eigen::Index size) {
  ForceBalanceRows rows;
  rows.pieces = std::move(pieces);
  rows.names = std::move(names);
  Eigen::Index samples = 0;
  for (const Motion& piece : rows.pieces) samples += piece.samples();
  const Eigen::Index joints = robot.size();
  rows.measured.resize(samples, joints);
  rows.force.resize(samples, joints);
  rows.model = {std::vector<Eigen::MatrixXd>(static_cast<std::size_t>(joints),
                                             Eigen::MatrixXd(samples, size)),
                size};
  rows.flange_body = {std::vector<Eigen::MatrixXd>(static_cast<std::size_t>(joints),
                                                   Eigen::MatrixXd(samples, kStandardParameters)),
                      kStandardParameters};
  if (joints > 1 && robot.body_uncertainty > 0.0) {
    const Eigen::Index count = joints * kStandardParameters;
    rows.bodies = {std::vector<Eigen::MatrixXd>(static_cast<std::size_t>(joints),
                                                Eigen::MatrixXd(samples, count)),
                   count};
  }
  const bool is_any_standing =
      std::ranges::any_of(rows.pieces, [](const Motion& piece) { return piece.stands.any(); });
  if (is_any_standing) rows.counts = Eigen::MatrixXd::Ones(samples, joints);
  return rows;
}

// Rows of all pieces, in order.
ForceBalanceRows rows_of(std::vector<Motion> pieces, std::vector<std::string> names,
                         const RigidRobotModel& robot, TorqueColumns& columns) {
  ForceBalanceRows rows = empty_rows(std::move(pieces), std::move(names), robot, columns.size());
  const Eigen::Index joints = robot.size();
  RigidBodyRegressor bodies(robot);
  Eigen::Index row = 0;
  for (const Motion& piece : rows.pieces) {
    if (rows.counts.size() > 0 && piece.stands.size() > 0) {
      rows.counts.middleRows(row, piece.samples()) = (!piece.stands).cast<double>();
    }
    rows.filtered.emplace_back(piece);
    const Eigen::MatrixXd remembered = columns.remembered(piece);
    const Eigen::Index first = row;
    columns.carry(piece.load);
    for (Eigen::Index t = 0; t < piece.samples(); ++t, ++row) {
      const Eigen::VectorXd q = piece.position.row(t), velocity = piece.velocity.row(t),
                            acceleration = piece.acceleration.row(t);
      columns.evaluate(q, velocity, acceleration);
      const Eigen::MatrixXd& links = bodies.evaluate(q, velocity, acceleration);
      rows.measured.row(row) = piece.torque.row(t);
      rows.force.row(row) = piece.torque.row(t) - remembered.row(t) - columns.known().transpose();
      for (Eigen::Index j = 0; j < joints; ++j) {
        const auto at = static_cast<std::size_t>(j);
        rows.model.in[at].row(row) = columns.matrix().row(j);
        rows.flange_body.in[at].row(row) = links.row(j).tail<kStandardParameters>();
        if (!rows.bodies.in.empty()) rows.bodies.in[at].row(row) = links.row(j);
      }
    }
    for (const TorqueColumns::FilteredColumn& law : columns.filtered_columns(piece)) {
      for (Eigen::Index j = 0; j < joints; ++j) {
        rows.model.in[static_cast<std::size_t>(j)]
            .col(law.column)
            .segment(first, piece.samples()) += law.output(j) * law.change;
      }
    }
  }
  rows.leave_out_standing_forces();
  rows.laws = std::make_shared<LawSampleCache>(rows.samples());
  return rows;
}

Eigen::MatrixXd stacked(const BalanceColumns& columns) {
  Eigen::Index rows = 0;
  for (const Eigen::MatrixXd& block : columns.in) rows += block.rows();
  Eigen::MatrixXd result(rows, columns.count);
  rows = 0;
  for (const Eigen::MatrixXd& block : columns.in) {
    result.middleRows(rows, block.rows()) = block;
    rows += block.rows();
  }
  return result;
}

// What the model states of one joint: the force that an acceleration of 1 takes.
double known_inertia(TorqueColumns& columns) {
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(1), one = Eigen::VectorXd::Ones(1);
  columns.evaluate(none, none, none);
  const double at_rest = columns.known()(0);
  columns.evaluate(none, none, one);
  return columns.known()(0) - at_rest;
}

void keep(const std::vector<Eigen::Index>& chosen, BalanceColumns& columns) {
  for (Eigen::MatrixXd& block : columns.in) block = block(Eigen::all, chosen).eval();
  columns.count = static_cast<Eigen::Index>(chosen.size());
}

void keep_base_parameters(const TorqueColumns& columns, ForceBalanceData& data) {
  if (columns.size() == 0) return;
  const BaseParameters base =
      base_parameters(stacked(data.estimation.model), columns.names(), kDependent);
  for (std::size_t b = 0; b < base.columns.size(); ++b) {
    const Eigen::Index column = base.columns[b];
    data.parameter_units.push_back(columns.units()[static_cast<std::size_t>(column)]);
    data.parameter_kinds.push_back(
        base_parameter_kind(base.names[b], data.parameter_units.back(), base.relations));
  }
  data.parameter_names = base.names;
  keep(base.columns, data.estimation.model);
  keep(base.columns, data.validation.model);
  data.base_columns = base.columns;
}

// ---- places -------------------------------------------------------------------------------------

PlaceUnits units_of(const RobotJoint& joint) {
  return joint.is_prismatic ? PlaceUnits{"N", "m", "kg"} : PlaceUnits{"N m", "rad", "kg m^2"};
}

CandidatePlace place_along(std::string name, std::string yaml, const Eigen::VectorXd& direction,
                           const RobotJoint& joint) {
  CandidatePlace place;
  place.location.name = std::move(name);
  place.location.input = place.location.output = direction;
  place.location.units = units_of(joint);
  place.location.takes_inertia = true;
  place.yaml = std::move(yaml);
  place.turns = !joint.is_prismatic;
  return place;
}

bool couples_joints(const RigidRobotModel& robot, Eigen::Index motor) {
  return (robot.transmission.row(motor).array() != 0.0).count() > 1;
}

void add_joint_places(const RigidRobotModel& robot, std::vector<CandidatePlace>& places) {
  for (Eigen::Index j = 0; j < robot.size(); ++j) {
    const RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
    places.push_back(place_along(joint.name + ".arm",
                                 fmt::format("{{kind: element, joint: {}, axis: arm}}", joint.name),
                                 Eigen::VectorXd::Unit(robot.size(), j), joint));
    places.back().may_lift = robot.size() == 1 && !joint.is_prismatic;
    if (!couples_joints(robot, j)) continue;
    places.push_back(place_along(
        joint.name + ".motor", fmt::format("{{kind: element, joint: {}, axis: motor}}", joint.name),
        robot.transmission.row(j).transpose(), joint));
  }
}

void add_neighbours(const RigidRobotModel& robot, std::vector<CandidatePlace>& places) {
  for (Eigen::Index j = 0; j + 1 < robot.size(); ++j) {
    const RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
    const RobotJoint& next = robot.joints[static_cast<std::size_t>(j + 1)];
    if (joint.is_prismatic != next.is_prismatic) continue;
    for (const double sign : {1.0, -1.0}) {
      Eigen::VectorXd direction = Eigen::VectorXd::Unit(robot.size(), j);
      direction(j + 1) = sign;
      places.push_back(
          place_along(fmt::format("{}{}{}", joint.name, sign > 0.0 ? "+" : "-", next.name),
                      fmt::format("{{kind: element, deflection: {{{}: 1, {}: {:g}}}}}", joint.name,
                                  next.name, sign),
                      direction, joint));
      places.back().is_compound = true;
    }
  }
}

// The names of a joint and of a load may be any: what YAML would misread is quoted.
std::string loaded_yaml(const std::string& joint, const std::string& load) {
  YAML::Emitter emitter;
  emitter << YAML::Flow << YAML::BeginMap << YAML::Key << "kind" << YAML::Value << "element";
  if (!joint.empty()) emitter << YAML::Key << "joint" << YAML::Value << joint;
  emitter << YAML::Key << "axis" << YAML::Value << (joint.empty() ? "flange" : "arm");
  if (!load.empty()) emitter << YAML::Key << "load" << YAML::Value << load;
  emitter << YAML::EndMap;
  return emitter.c_str();
}

// The loads that some recordings of the fit carry, and not all: each tells what it adds.
std::vector<std::string> loads_of_some(const ForceBalanceData& data) {
  std::vector<std::string> loads;
  for (const Motion& piece : data.estimation.pieces) {
    const auto carried = std::ranges::count(data.estimation.pieces, piece.load, &Motion::load);
    const bool is_carried_by_all =
        static_cast<std::size_t>(carried) == data.estimation.pieces.size();
    const bool is_listed = std::ranges::find(loads, piece.load) != loads.end();
    if (!piece.load.empty() && !is_carried_by_all && !is_listed) loads.push_back(piece.load);
  }
  return loads;
}

// A payload may be there in all recordings, or in those of one load where only some carry it.
// Where drive gains are unknown, it acts on those joints whose gain is told.
void add_flanges(ForceBalanceData& data) {
  if (data.robot.channels.unknown_drive_gains && data.gain_parameters.empty()) {
    data.remarks.emplace_back(
        "no payload is sought: the drives' gains are unknown, and the model states no body or "
        "rotor that tells one");
    return;
  }
  std::vector<std::string> loads = loads_of_some(data);
  loads.insert(loads.begin(), "");
  for (const std::string& load : loads) {
    CandidatePlace place;
    place.location = flange_location(load);
    place.yaml = loaded_yaml("", load);
    data.places.push_back(std::move(place));
  }
}

// On one axis a load is a weight and an inertia, each with an amplitude of its own: mass and lever
// can't be told from one another.
void add_loads_of_joint(ForceBalanceData& data) {
  const CandidatePlace unloaded = data.places.front();
  for (const std::string& load : loads_of_some(data)) {
    CandidatePlace place = unloaded;
    place.location.load = load;
    place.location.name += " with load " + load;
    place.yaml = loaded_yaml(data.robot.joints.front().name, load);
    data.places.push_back(std::move(place));
  }
}

// Loads of recordings that are kept out alone change them, and the fit never saw them.
void remark_unseen_loads(ForceBalanceData& data) {
  std::vector<std::string> seen;
  for (const Motion& piece : data.estimation.pieces) seen.push_back(piece.load);
  for (const Motion& piece : data.validation.pieces) {
    if (std::ranges::find(seen, piece.load) != seen.end()) continue;
    seen.push_back(piece.load);
    data.remarks.push_back(fmt::format(
        "{} in recordings kept out alone: what it changes was not fitted. Put one such recording "
        "into the fit (role: estimation)",
        piece.load.empty() ? "no load is" : fmt::format("load {} is", piece.load)));
  }
}

// Where "1/gain_1" and so on are among the model's parameters, -1 for those that are not; empty if
// none is.
std::vector<Eigen::Index> gain_parameters(const ForceBalanceData& data) {
  std::vector<Eigen::Index> found;
  for (Eigen::Index j = 0; j < data.robot.size(); ++j) {
    const auto gain = std::ranges::find(data.parameter_names, fmt::format("1/gain_{}", j + 1));
    const bool is_told = gain != data.parameter_names.end();
    found.push_back(is_told ? gain - data.parameter_names.begin() : -1);
  }
  const bool is_any = std::ranges::any_of(found, [](Eigen::Index gain) { return gain >= 0; });
  return is_any ? found : std::vector<Eigen::Index>{};
}

void refuse_shared_places(const std::filesystem::path& file,
                          const std::vector<CandidatePlace>& places) {
  for (const CandidatePlace& place : places) {
    if (place.location.is_flange || (place.location.output.array() != 0.0).count() == 1) continue;
    throw InputError(
        fmt::format("{}: place {} acts on two joints, whose drives report torques in "
                    "units of their own (drive_gains: unknown); state the gains",
                    file.string(), place.location.name));
  }
}

constexpr const char* kKeptBody = "the body of joint";

// What a fit leaves as it is although a recording could tell it, so that nobody takes it for found.
void remark_what_is_kept(ForceBalanceData& data) {
  const RigidRobotModel& robot = data.robot;
  if (robot.size() == 1 && robot.joints.front().body && !robot.channels.unknown_drive_gains) {
    data.remarks.push_back(
        fmt::format("{} {} is kept as the model states it; with body: unknown it is estimated",
                    kKeptBody, robot.joints.front().name));
  }
  for (const Element& element : robot.elements) {
    if (element.use != LawUse::kPayload) continue;
    data.remarks.push_back(fmt::format(
        "payload {0} stays at the place that the model states; graybox fit --refine {0}.x moves it",
        element.name));
  }
}

// ---- standstill ---------------------------------------------------------------------------------

std::vector<bool> are_prismatic(const RigidRobotModel& robot) {
  std::vector<bool> result;
  for (const RobotJoint& joint : robot.joints) result.push_back(joint.is_prismatic);
  return result;
}

double duration_of(std::span<const Motion> pieces) {
  double duration = 0.0;
  for (const Motion& piece : pieces) duration += piece.time(piece.samples() - 1) - piece.time(0);
  return duration;
}

double moving_samples(std::span<const Motion> pieces, Eigen::Index joint) {
  double moving = 0.0;
  for (const Motion& piece : pieces) {
    moving += static_cast<double>(piece.samples());
    if (piece.stands.size() > 0) moving -= static_cast<double>(piece.stands.col(joint).count());
  }
  return moving;
}

// "joint_1 3.2 s, joint_4 5 s": how long each stands, of those that do and that move anywhere.
std::string standing_times(const RigidRobotModel& robot, std::span<const Motion> pieces,
                           const std::vector<bool>& moves) {
  std::vector<std::string> joints;
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    const auto joint = static_cast<Eigen::Index>(j);
    double samples = 0.0;
    for (const Motion& piece : pieces) samples += static_cast<double>(piece.samples());
    const double standing = samples - moving_samples(pieces, joint);
    if (standing == 0.0 || !moves[j]) continue;
    joints.push_back(
        fmt::format("{} {:.3g} s", robot.joints[j].name, duration_of(pieces) * standing / samples));
  }
  return fmt::format("{}", fmt::join(joints, ", "));
}

// Whether nothing but dry friction that the model lacks can hold the only joint.
bool stands_by_friction_alone(const RigidRobotModel& robot) {
  return robot.size() == 1 && !needs_position(robot) &&
         std::ranges::all_of(robot.elements, [](const Element& element) {
           return element.use != LawUse::kForce || element.law_name == "viscous";
         });
}

// What the drive gave while the only joint stood still, by the recordings as they are: behind a
// low-pass a motion shows before it begins.
StandingDrive drive_at_standstill(const RigidRobotModel& robot, Campaign campaign) {
  StandingDrive drive;
  if (!stands_by_friction_alone(robot)) return drive;
  std::erase_if(campaign.preprocess, [](const PreprocessStep& step) {
    return std::holds_alternative<LowPass>(step) || std::holds_alternative<Trim>(step) ||
           std::holds_alternative<Decimate>(step);
  });
  for (const MotionRecord& record : read_motion_records(robot, campaign)) {
    if (record.role != ExperimentRole::kEstimation) continue;
    const Eigen::VectorXd speeds = root_mean_square_speeds(record.pieces);
    for (const Motion& piece : record.pieces) {
      if (piece.samples() < 2) continue;
      const std::vector<Stay> still = joint_stays(piece, 0, speeds(0));
      drive = larger(drive, standing_drive(piece.time, piece.torque.col(0), still));
    }
  }
  return drive;
}

// Marks where joints stand, and cuts samples at which nothing moves from all recordings.
void leave_out_standstill(const RigidRobotModel& robot, std::vector<MotionRecord>& records,
                          ForceBalanceData& data) {
  std::vector<Motion> all;
  for (const MotionRecord& record : records) {
    all.insert(all.end(), record.pieces.begin(), record.pieces.end());
  }
  if (all.empty()) return;
  const Eigen::VectorXd speeds = root_mean_square_speeds(all);
  std::vector<bool> moves(robot.joints.size(), false);
  for (MotionRecord& record : records) {
    for (Motion& piece : record.pieces) mark_standstill(piece, speeds);
    for (std::size_t j = 0; j < moves.size(); ++j) {
      moves[j] = moves[j] || moving_samples(record.pieces, static_cast<Eigen::Index>(j)) > 0.0;
    }
  }
  for (MotionRecord& record : records) {
    const std::string times = standing_times(robot, record.pieces, moves);
    if (!times.empty()) {
      data.remarks.push_back(fmt::format(
          "{}: of {:.3g} s these joints stand still: {}. Their forces there are left out of the "
          "balance, for dry friction takes what it must at standstill",
          record.name, duration_of(record.pieces), times));
    }
    std::vector<Motion> moving;
    for (const Motion& piece : record.pieces) {
      std::vector<Motion> parts = moving_parts(piece);
      std::ranges::move(parts, std::back_inserter(moving));
    }
    record.pieces = std::move(moving);
  }
}

void leave_out_clipped(const RigidRobotModel& robot, std::vector<MotionRecord>& records,
                       ForceBalanceData& data) {
  for (MotionRecord& record : records) {
    const std::vector<Eigen::Index> clipped = mark_clipped_forces(record.pieces);
    for (std::size_t j = 0; j < clipped.size(); ++j) {
      if (clipped[j] == 0) continue;
      data.remarks.push_back(fmt::format(
          "{}: the force of {} lies at a limit in {} samples (flat tops). They are left out of the "
          "balance, for nobody knows what acted beyond",
          record.name, robot.joints[j].name, clipped[j]));
    }
  }
}

void remark_idle_joints(const RigidRobotModel& robot, ForceBalanceData& data) {
  for (std::size_t j = 0; j < data.idle.size(); ++j) {
    if (!data.idle[j]) continue;
    data.remarks.push_back(fmt::format(
        "joint {} never moves: its force may be anything that dry friction holds, and is left out",
        robot.joints[j].name));
    for (Motion& piece : data.recorded) piece.torque.col(static_cast<Eigen::Index>(j)).setZero();
  }
}

// Where no force acts in what was kept out (a drive that is off, a machine that coasts) there is
// nothing to be predicted.
void leave_out_missing_forces(ForceBalanceData& data) {
  if (data.validation.empty() || !data.validation.measured.isZero(0.0)) return;
  data.remarks.emplace_back(
      "no force acts in what was kept out, so it checks nothing: keep out recordings in which the "
      "drive works");
  data.validation = {};
}

// All forces of idle joints are zero, on both sides of the balance.
void silence(const std::vector<bool>& idle, ForceBalanceRows& rows) {
  for (std::size_t j = 0; j < idle.size(); ++j) {
    if (!idle[j]) continue;
    rows.measured.col(static_cast<Eigen::Index>(j)).setZero();
    rows.force.col(static_cast<Eigen::Index>(j)).setZero();
    rows.model.in[j].setZero();
    rows.flange_body.in[j].setZero();
    if (rows.bodies.count > 0) rows.bodies.in[j].setZero();
  }
}

void leave_out_idle_places(ForceBalanceData& data) {
  std::erase_if(data.places, [&data](const CandidatePlace& place) {
    for (Eigen::Index j = 0; j < place.location.output.size(); ++j) {
      if (place.location.output(j) != 0.0 && data.idle[static_cast<std::size_t>(j)]) return true;
    }
    return false;
  });
}

void prepare_places(const std::vector<CandidatePlace>& places, ForceBalanceRows& rows) {
  for (FilteredMotion& piece : rows.filtered) {
    for (const CandidatePlace& place : places) {
      if (!place.location.is_flange) piece.prepare(place.location.input);
    }
  }
}

}  // namespace

std::string BalanceCoordinate::channel() const {
  return (units.force == "N m" ? "torque of " : "force of ") + name;
}

void BalanceColumns::append(const BalanceColumns& more, const std::vector<Chosen>& chosen) {
  for (std::size_t j = 0; j < in.size(); ++j) {
    Eigen::MatrixXd& block = in[j];
    block.conservativeResize(more.in[j].rows(), count + static_cast<Eigen::Index>(chosen.size()));
    Eigen::Index column = count;
    for (const Chosen& each : chosen) {
      const bool acts = each.coordinate < 0 || each.coordinate == static_cast<Eigen::Index>(j);
      if (acts) {
        block.col(column++) = more.in[j].col(each.column);
      } else {
        block.col(column++).setZero();
      }
    }
  }
  count += static_cast<Eigen::Index>(chosen.size());
}

double ForceBalanceRows::counted(Eigen::Index coordinate) const {
  return counted(coordinate, 0, samples());
}

double ForceBalanceRows::counted(Eigen::Index coordinate, Eigen::Index first,
                                 Eigen::Index rows) const {
  if (counts.size() == 0) return static_cast<double>(rows);
  return counts.col(coordinate).segment(first, rows).sum();
}

void ForceBalanceRows::leave_out_standing(BalanceColumns& columns) const {
  if (counts.size() == 0) return;
  for (std::size_t j = 0; j < columns.in.size(); ++j) {
    if (columns.in[j].size() == 0) continue;
    columns.in[j].array().colwise() *= counts.col(static_cast<Eigen::Index>(j)).array();
  }
}

void ForceBalanceRows::leave_out_standing_forces() {
  if (counts.size() == 0) return;
  force.array() *= counts.array();
  for (BalanceColumns* columns : {&model, &flange_body, &bodies}) leave_out_standing(*columns);
  for (Eigen::Index j = 0; j < coordinates(); ++j) {
    const Eigen::ArrayXd counting = counts.col(j);
    const double mean = measured.col(j).dot(counting.matrix()) / std::max(1.0, counting.sum());
    measured.col(j) = (counting > 0.0).select(measured.col(j), mean);
  }
}

Eigen::VectorXd ForceBalanceRows::root_mean_squares(const Eigen::MatrixXd& values) const {
  Eigen::VectorXd result = values.colwise().norm();
  for (Eigen::Index j = 0; j < result.size(); ++j) {
    result(j) /= std::sqrt(std::max(1.0, counted(j)));
  }
  return result;
}

namespace {

// Places of laws: at joints, between neighbours, at the flange, and those of the files.
void add_all_places(const RigidRobotModel& robot, std::span<const std::filesystem::path> files,
                    ForceBalanceData& data) {
  add_joint_places(robot, data.places);
  if (robot.channels.unknown_drive_gains) {
    data.gain_parameters = gain_parameters(data);
  } else {  // else a force on two joints is two parameters
    add_neighbours(robot, data.places);
  }
  if (robot.size() > 1) {
    add_flanges(data);
  } else {
    add_loads_of_joint(data);
  }
  remark_unseen_loads(data);
  remark_what_is_kept(data);
  for (const std::filesystem::path& file : files) {
    add_places(file, *rigid_robot_places(robot), data.places);
    if (robot.channels.unknown_drive_gains) refuse_shared_places(file, data.places);
  }
  leave_out_idle_places(data);
}

}  // namespace

ForceBalanceData load_force_balance_data(const RigidRobotModel& robot, const Campaign& campaign,
                                         std::span<const std::filesystem::path> place_files,
                                         const Eigen::VectorXd& advance) {
  std::vector<Motion> fitted, held_out;
  std::vector<std::string> fitted_names, held_out_names;
  ForceBalanceData data;
  data.advance = advance;
  std::vector<MotionRecord> records = read_motion_records(robot, campaign);
  data.standing = drive_at_standstill(robot, campaign);
  const bool may_be_held = robot.channels.commanded_torque && campaign.hold == InputHold::kZero;
  if (may_be_held && are_held_commands(records)) take_means_of_held(records);
  advance_forces(advance, records);
  leave_out_standstill(robot, records, data);
  leave_out_clipped(robot, records, data);
  for (MotionRecord& record : records) {
    const bool is_fitted = record.role == ExperimentRole::kEstimation;
    for (Motion& piece : record.pieces) {
      (is_fitted ? fitted : held_out).push_back(std::move(piece));
      (is_fitted ? fitted_names : held_out_names).push_back(record.name);
    }
  }
  data.recorded = fitted;
  data.idle = idle_joints(fitted, are_prismatic(robot));
  for (Eigen::Index j = 0; j < robot.size() && robot.size() > 1; ++j) {
    if (moving_samples(fitted, j) < kFewestMoving) data.idle[static_cast<std::size_t>(j)] = true;
  }
  remark_idle_joints(robot, data);
  thin(fitted);
  TorqueColumns columns(robot);
  data.estimation = rows_of(std::move(fitted), std::move(fitted_names), robot, columns);
  data.validation = rows_of(std::move(held_out), std::move(held_out_names), robot, columns);
  if (data.estimation.samples() < kFewestSamples) {
    throw InputError(fmt::format(
        "{}: {} samples for estimation, after those at the ends of each part that the filter "
        "takes; a diagnosis needs {}: record longer, give the log at its full rate, or give the "
        "fit more of it (segments; role: validation on less)",
        campaign.file.string(), data.estimation.samples(), kFewestSamples));
  }
  if (data.estimation.measured.isZero(0.0)) {
    throw InputError(fmt::format(
        "{}: no force acts in the recordings of the fit, and a balance of forces has nothing to "
        "balance: use --method prediction_error",
        campaign.file.string()));
  }
  for (const RobotJoint& joint : robot.joints) {
    data.coordinates.push_back({joint.name, units_of(joint)});
  }
  data.flange = robot.flange;
  data.robot = robot;
  data.position_is_recorded = !robot.channels.position.empty();
  for (ForceBalanceRows* rows : {&data.estimation, &data.validation}) silence(data.idle, *rows);
  if (robot.size() == 1) data.known_inertia = known_inertia(columns);
  keep_base_parameters(columns, data);
  leave_out_missing_forces(data);
  add_all_places(robot, place_files, data);
  prepare_places(data.places, data.estimation);
  prepare_places(data.places, data.validation);
  return data;
}

ForceBalanceRows rows_along(const ForceBalanceData& data, Motion motion) {
  TorqueColumns columns(data.robot);
  std::vector<Motion> pieces;
  pieces.push_back(std::move(motion));
  ForceBalanceRows rows = rows_of(std::move(pieces), {""}, data.robot, columns);
  silence(data.idle, rows);
  keep(data.base_columns, rows.model);
  std::vector<BalanceColumns::Chosen> departures;
  for (const UncertainParameter& parameter : data.uncertain) {
    departures.push_back(
        {parameter.link * kStandardParameters + parameter.parameter, parameter.joint});
  }
  if (!departures.empty()) rows.model.append(rows.bodies, departures);
  return rows;
}

void name_as_lumped(ForceBalanceData& data) {
  const std::string& mass = data.robot.joints.front().name;
  std::erase_if(data.places,
                [](const CandidatePlace& place) { return !place.location.load.empty(); });
  for (CandidatePlace& place : data.places) {
    place.location.name = mass;
    place.yaml = fmt::format("{{kind: element, mass: {}}}", mass);
  }
  const std::string inertia = data.robot.joints.front().is_prismatic ? ".mass" : ".inertia";
  std::ranges::replace(data.parameter_names, std::string("rotor_inertia_1"), mass + inertia);
  // A lumped model has no bodies: its mass is estimated.
  std::erase_if(data.remarks,
                [](const std::string& remark) { return remark.starts_with(kKeptBody); });
}

RecordedPlaceMotion motion_at(const CandidatePlace& place, const Motion& piece) {
  return {piece.time, piece.position * place.location.input, piece.velocity * place.location.input,
          piece.acceleration * place.location.input};
}

Eigen::VectorXd law_samples(const CandidatePlace& place, const Law& law,
                            const ForceBalanceRows& rows) {
  Eigen::VectorXd result(rows.samples());
  Eigen::Index row = 0;
  for (const FilteredMotion& piece : rows.filtered) {
    const Eigen::VectorXd force = piece.force(law, place.location.input);
    result.segment(row, force.size()) = force;
    row += force.size();
  }
  return result;
}

Eigen::VectorXd inertia_samples(const CandidatePlace& place, const ForceBalanceRows& rows) {
  Eigen::VectorXd result(rows.samples());
  Eigen::Index row = 0;
  for (const Motion& piece : rows.pieces) {
    result.segment(row, piece.samples()) = piece.acceleration * place.location.input;
    row += piece.samples();
  }
  return result;
}

}  // namespace graybox
