#include "diagnosis/log_columns/logged_robot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "diagnosis/log_columns/even_samples.hpp"
#include "problems/base/error.hpp"
#include "problems/base/units.hpp"
#include "problems/mechanisms/rigid_chain.hpp"

namespace graybox {
namespace {

constexpr double kGravity = 9.81;       // m/s^2
constexpr double kBeyondLimits = 1.25;  // of a joint's range: no rounding and no overshoot

}  // namespace

std::string from_to(const std::string& first, const std::string& last) {
  return first == last ? first : first + " to " + last;
}

LoggedRobot::LoggedRobot(std::filesystem::path urdf, std::string base, std::string tip,
                         const LogRecording& log)
    : urdf_(std::move(urdf)),
      asked_base_(std::move(base)),
      asked_tip_(std::move(tip)),
      log_(log),
      joints_(read_urdf_tree(urdf_)) {}

std::string LoggedRobot::base() const {
  return asked_base_.empty() ? joints_[first_].parent : asked_base_;
}

std::vector<std::size_t> LoggedRobot::choose_chain() {
  std::vector<std::size_t> best;
  std::size_t most = 0;
  std::set<std::size_t> usable;
  for (std::size_t k = 0; k < joints_.size(); ++k) {
    if (!is_usable(k)) continue;
    usable.insert(k);
    if (!asked_tip_.empty() && joints_[k].child != asked_tip_) continue;
    const std::vector<std::size_t> path = path_to(k);
    const auto count = static_cast<std::size_t>(
        std::ranges::count_if(path, [&](std::size_t each) { return is_usable(each); }));
    if (count > most) best = path;
    most = std::max(most, count);
  }
  if (best.empty()) {
    throw InputError(fmt::format(
        "{}: {} has position and force of no joint of it{}; --column NAME=position@JOINT tells",
        urdf_name(), log_.files.front().string(),
        asked_tip_.empty() ? "" : fmt::format(" before link '{}' (--tip)", asked_tip_)));
  }
  take_chain(best);
  std::vector<std::size_t> aside;
  for (const std::size_t joint : usable) {
    if (std::ranges::find(chain_, joint) == chain_.end()) aside.push_back(joint);
  }
  return aside;
}

std::vector<Eigen::Index> LoggedRobot::rows_beyond_limits(const AngleUnit& unit) const {
  Eigen::Array<bool, Eigen::Dynamic, 1> beyond =
      Eigen::Array<bool, Eigen::Dynamic, 1>::Constant(log_.samples(), false);
  for (const std::size_t joint : chain_) {
    const UrdfJoint& each = joints_[joint];
    if (each.is_prismatic || !(each.upper > each.lower)) continue;
    const Eigen::ArrayXd q = places(joint, unit);
    const double slack = (kBeyondLimits - 1.0) * (each.upper - each.lower);
    beyond = beyond || q > each.upper + slack || q < each.lower - slack;
  }
  std::vector<Eigen::Index> rows;
  for (Eigen::Index k = 0; k < beyond.size(); ++k) {
    if (beyond(k)) rows.push_back(k);
  }
  return rows;
}

void LoggedRobot::lock_others(const AngleUnit& unit) {
  locked_.clear();
  for (const auto& [joint, column] : positions_->columns) {
    const UrdfJoint& each = joints_[joint];
    if (!each.moves || std::ranges::find(chain_, joint) != chain_.end()) continue;
    const double place = places(joint, unit).mean();
    const double slack = (kBeyondLimits - 1.0) * (each.upper - each.lower);
    const bool fits =
        !(each.upper > each.lower) || (place >= each.lower - slack && place <= each.upper + slack);
    if (place == 0.0 || !std::isfinite(place) || !fits) continue;
    locked_[each.name] =
        each.upper > each.lower ? std::clamp(place, each.lower, each.upper) : place;
  }
  joints_ = read_urdf_tree(urdf_, locked_);
}

LockedJoints LoggedRobot::locked() const {
  std::set<std::string> links{base()};
  LockedJoints result;
  for (const UrdfJoint& joint : joints_) {  // parents come before children
    if (!links.contains(joint.parent)) continue;
    if (joint.parent == base() && joint.name != joints_[first_].name) continue;
    links.insert(joint.child);
    if (const auto found = locked_.find(joint.name); found != locked_.end()) result.insert(*found);
  }
  return result;
}

double LoggedRobot::place_of(std::size_t joint) const {
  const auto found = locked_.find(joints_[joint].name);
  return found == locked_.end() ? 0.0 : found->second;
}

bool LoggedRobot::fits_limits(const AngleUnit& unit) const {
  constexpr double kDropouts = 0.005;  // of the rows
  constexpr Eigen::Index kMany = 100;  // of which a single one may be
  const Eigen::Index rows = log_.samples();
  const double most = std::max(kDropouts * static_cast<double>(rows), rows >= kMany ? 1.0 : 0.0);
  return static_cast<double>(rows_beyond_limits(unit).size()) <= most;
}

double LoggedRobot::share_of_weight(const AngleUnit& angle_unit) const {
  const UrdfChain links = read_urdf_joints(urdf_, base(), tip(), locked());
  const bool any_prismatic =
      std::ranges::find(links.is_prismatic, true) != links.is_prismatic.end();
  if (any_prismatic || links.joints.size() != chain_.size()) return 0.0;
  const RigidChain chain(links.joints, gravity());
  RigidChainEvaluator evaluator(chain);
  const auto n = static_cast<Eigen::Index>(chain_.size());
  Eigen::MatrixXd q(log_.samples(), n), torque(log_.samples(), n);
  for (Eigen::Index j = 0; j < n; ++j) {
    const std::size_t joint = chain_[static_cast<std::size_t>(j)];
    q.col(j) = places(joint, angle_unit);
    const Unit* unit = find_unit(force(joint).words.unit);
    torque.col(j) = (unit == nullptr ? 1.0 : unit->factor) * without_gaps(force(joint).values);
  }
  Eigen::VectorXd weight = Eigen::VectorXd::Zero(n), recorded = weight;
  const Eigen::Index step = std::max<Eigen::Index>(1, log_.samples() / 100);
  for (Eigen::Index k = 0; k < log_.samples(); k += step) {
    weight += evaluator.gravity_torque(q.row(k).transpose()).cwiseAbs2();
    recorded += torque.row(k).transpose().cwiseAbs2();
  }
  weight = (recorded.array() > 0.0).select(weight, 0.0);  // what nothing drives tells no unit
  Eigen::Index most = 0;
  return weight.maxCoeff(&most) > 0.0 ? std::sqrt(recorded(most) / weight(most)) : 0.0;
}

bool LoggedRobot::holds_counts() const {
  constexpr double kFewestCounts = 20.0;
  double widest = 0.0;
  for (const std::size_t joint : chain_) {
    const LogColumn& column = position(joint);
    if (joints_[joint].is_prismatic || column.words.unit == "counts") continue;
    const Eigen::ArrayXd values = without_gaps(column.values).array();
    if (!column.words.unit.empty() || (values != values.round()).any()) return false;
    widest = std::max(widest, values.maxCoeff() - values.minCoeff());
  }
  return is_in_counts() || widest >= kFewestCounts;
}

bool LoggedRobot::is_in_counts() const {
  return std::ranges::any_of(
      chain_, [&](std::size_t joint) { return position(joint).words.unit == "counts"; });
}

Eigen::Vector3d LoggedRobot::gravity() const {
  return joints_[first_].parent_rotation.transpose() * Eigen::Vector3d(0.0, 0.0, -kGravity);
}

Eigen::VectorXd LoggedRobot::places(std::size_t joint, const AngleUnit& unit) const {
  const Eigen::VectorXd values = without_gaps(position(joint).values);
  if (!joints_[joint].is_prismatic) return unit.factor * (values.array() - unit.centre);
  const Unit* length = find_unit(position(joint).words.unit);
  return (length != nullptr && length->base == "m" ? length->factor : 1.0) * values;
}

bool LoggedRobot::is_moved(std::size_t joint) const {
  constexpr double kTrembles = 0.005;
  const auto span = [](const LogColumn& column) {
    const Eigen::VectorXd values = without_gaps(column.values);
    return values.size() > 0 ? values.maxCoeff() - values.minCoeff() : 0.0;
  };
  double widest = 0.0;
  for (const auto& [other, column] : positions_->columns) {
    if (joints_[other].is_prismatic != joints_[joint].is_prismatic) continue;
    widest = std::max(widest, span(*column));
  }
  return position(joint).moves() && span(position(joint)) > kTrembles * widest;
}

bool LoggedRobot::stands_still(std::size_t joint) const {
  return positions_->columns.contains(joint) && !is_moved(joint);
}

bool LoggedRobot::is_usable(std::size_t joint) const {
  const auto force = forces_->columns.find(joint);
  return joints_[joint].moves && positions_->columns.contains(joint) &&
         force != forces_->columns.end() && (force->second->moves() || is_passive(joint));
}

bool LoggedRobot::is_passive(std::size_t joint) const {
  return force(joint).is_zero() && is_moved(joint);
}

std::vector<std::size_t> LoggedRobot::path_to(std::size_t joint) const {
  std::vector<std::size_t> path{joint};
  for (std::size_t k = joint; k-- > 0;) {
    if (joints_[k].child == joints_[path.back()].parent) path.push_back(k);
  }
  std::ranges::reverse(path);
  return path;
}

// This joint lies between the logged ones and can't be used: why, and what to do.
std::string LoggedRobot::gap_words(std::size_t joint) const {
  const std::string& name = joints_[joint].name;
  const auto logged = positions_->columns.find(joint);
  if (logged != positions_->columns.end()) {
    return fmt::format(
        "{}: joint '{}' lies between the logged ones, and its force is not logged or never "
        "changes; log it, name its column by --column NAME=torque@{}, or choose --base or --tip",
        urdf_name(), name, name);
  }
  return fmt::format(
      "{}: joint '{}' lies between the logged ones, and its position and force are not logged; "
      "log them, name their columns by --column NAME=position@{}, or choose --base or --tip",
      urdf_name(), name, name);
}

void LoggedRobot::take_chain(const std::vector<std::size_t>& path) {
  bool began = !asked_base_.empty();
  bool in_range = asked_base_.empty();
  for (const std::size_t joint : path) {
    if (!in_range && joints_[joint].parent != asked_base_) continue;
    in_range = true;
    if (is_usable(joint)) {
      if (chain_.empty() && asked_base_.empty()) first_ = joint;
      if (chain_.empty() && !asked_base_.empty())
        first_ = *std::ranges::find_if(
            path, [&](std::size_t each) { return joints_[each].parent == asked_base_; });
      began = true;
      chain_.push_back(joint);
    } else if (began && joints_[joint].moves && !stands_still(joint)) {
      throw InputError(gap_words(joint));
    }
  }
  if (chain_.empty()) {
    throw InputError(fmt::format("--base {}: no logged joint is beyond it", asked_base_));
  }
  require_masses();
}

void LoggedRobot::require_masses() const {
  double mass = 0.0;
  for (const std::size_t joint : chain_) mass += joints_[joint].child_mass;
  if (mass > 0.0) return;
  throw InputError(fmt::format(
      "{}: no link of the logged joints has a mass; take a URDF with <inertial>", urdf_name()));
}

std::string LoggedRobot::range_of(const ColumnFamily& family) const {
  return from_to("'" + family.columns.at(chain_.front())->name + "'",
                 "'" + family.columns.at(chain_.back())->name + "'");
}

}  // namespace graybox
