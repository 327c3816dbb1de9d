#include "diagnosis/proposal/robot_proposal.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>
#include <string>

#include "diagnosis/first_masses/kept_out_blocks.hpp"
#include "diagnosis/log_columns/joint_columns.hpp"
#include "diagnosis/log_columns/motion_span.hpp"
#include "diagnosis/proposal/campaign_draft.hpp"
#include "diagnosis/proposal/motion_choice.hpp"
#include "problems/base/error.hpp"
#include "problems/base/units.hpp"
#include "problems/mechanisms/rigid_chain.hpp"
#include "problems/mechanisms/urdf_chain.hpp"

namespace graybox {
namespace {

constexpr double kGravity = 9.81;       // m/s^2
constexpr double kBeyondLimits = 1.25;  // of a joint's range: no rounding and no overshoot

// A channel's name of a joint: letters, digits and _.
std::string channel_name(const std::string& quantity, const std::string& joint) {
  std::string name = quantity + "_" + joint;
  for (char& each : name) {
    if (std::isalnum(static_cast<unsigned char>(each)) == 0) each = '_';
  }
  return name;
}

// How recorded positions of joints that turn become radians.
struct AngleUnit {
  std::string name = "rad";
  double factor = 1.0;  // rad
  double centre = 0.0;  // recorded; subtracted before
};

AngleUnit in_unit(const std::string& unit) { return {unit, find_unit(unit)->factor, 0.0}; }

// "'a' to 'b'", or one of them where they are the same.
std::string from_to(const std::string& first, const std::string& last) {
  return first == last ? first : first + " to " + last;
}

// A robot with the log of its joints: which columns are whose, and the joints that move and are
// logged.
class LoggedRobot {
 public:
  LoggedRobot(const ProposalRequest& request, const LogRecording& log)
      : request_(request), log_(log), joints_(read_urdf_tree(request.urdf)) {}

  [[nodiscard]] const std::vector<UrdfJoint>& joints() const { return joints_; }
  [[nodiscard]] const std::vector<std::size_t>& chain() const { return chain_; }
  [[nodiscard]] std::string urdf_name() const { return request_.urdf.string(); }
  [[nodiscard]] std::string base() const {
    return request_.base.empty() ? joints_[first_].parent : request_.base;
  }
  [[nodiscard]] std::string tip() const { return joints_[chain_.back()].child; }

  void set_columns(const ColumnFamily* positions, const ColumnFamily* forces) {
    positions_ = positions;
    forces_ = forces;
  }
  [[nodiscard]] const LogColumn& position(std::size_t joint) const {
    return *positions_->columns.at(joint);
  }
  [[nodiscard]] const LogColumn& force(std::size_t joint) const {
    return *forces_->columns.at(joint);
  }

  // Sets the chain; joints that are logged and not in it. Throws InputError where there is none.
  std::vector<std::size_t> choose_chain() {
    std::vector<std::size_t> best;
    std::size_t most = 0;
    std::set<std::size_t> usable;
    for (std::size_t k = 0; k < joints_.size(); ++k) {
      if (!is_usable(k)) continue;
      usable.insert(k);
      if (!request_.tip.empty() && joints_[k].child != request_.tip) continue;
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
          request_.tip.empty() ? "" : fmt::format(" before link '{}' (--tip)", request_.tip)));
    }
    take_chain(best);
    std::vector<std::size_t> aside;
    for (const std::size_t joint : usable) {
      if (std::ranges::find(chain_, joint) == chain_.end()) aside.push_back(joint);
    }
    return aside;
  }

  // Whether all positions lie within their limits if they are in that unit.
  [[nodiscard]] bool fits_limits(const AngleUnit& unit) const {
    for (const std::size_t joint : chain_) {
      const UrdfJoint& each = joints_[joint];
      if (each.is_prismatic || !(each.upper > each.lower)) continue;
      const Eigen::VectorXd q = angles(joint, unit);
      const double slack = (kBeyondLimits - 1.0) * (each.upper - each.lower);
      if (q.maxCoeff() > each.upper + slack || q.minCoeff() < each.lower - slack) return false;
    }
    return true;
  }

  // The recorded torque over the links' weight, of the joint that carries most; 0 if it can't be
  // told.
  [[nodiscard]] double share_of_weight(const AngleUnit& angle_unit) const {
    const UrdfChain links = read_urdf_joints(request_.urdf, base(), tip());
    const bool any_prismatic =
        std::ranges::find(links.is_prismatic, true) != links.is_prismatic.end();
    if (any_prismatic || links.joints.size() != chain_.size()) return 0.0;
    const RigidChain chain(links.joints, gravity());
    RigidChainEvaluator evaluator(chain);
    const auto n = static_cast<Eigen::Index>(chain_.size());
    Eigen::MatrixXd q(log_.samples(), n), torque(log_.samples(), n);
    for (Eigen::Index j = 0; j < n; ++j) {
      const std::size_t joint = chain_[static_cast<std::size_t>(j)];
      q.col(j) = angles(joint, angle_unit);
      const Unit* unit = find_unit(force(joint).words.unit);
      torque.col(j) = (unit == nullptr ? 1.0 : unit->factor) * without_gaps(force(joint).values);
    }
    Eigen::VectorXd weight = Eigen::VectorXd::Zero(n), recorded = weight;
    const Eigen::Index step = std::max<Eigen::Index>(1, log_.samples() / 100);
    for (Eigen::Index k = 0; k < log_.samples(); k += step) {
      weight += evaluator.gravity_torque(q.row(k).transpose()).cwiseAbs2();
      recorded += torque.row(k).transpose().cwiseAbs2();
    }
    Eigen::Index most = 0;
    return weight.maxCoeff(&most) > 0.0 ? std::sqrt(recorded(most) / weight(most)) : 0.0;
  }

  // Whether all joints that turn are logged in whole numbers, as an encoder's counts.
  [[nodiscard]] bool holds_counts() const {
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

  // Whether a title or the user says counts.
  [[nodiscard]] bool is_in_counts() const {
    return std::ranges::any_of(
        chain_, [&](std::size_t joint) { return position(joint).words.unit == "counts"; });
  }

  // m/s^2, in the base link's axes.
  [[nodiscard]] Eigen::Vector3d gravity() const {
    return joints_[first_].parent_rotation.transpose() * Eigen::Vector3d(0.0, 0.0, -kGravity);
  }

 private:
  [[nodiscard]] Eigen::VectorXd angles(std::size_t joint, const AngleUnit& unit) const {
    return unit.factor * (without_gaps(position(joint).values).array() - unit.centre);
  }

  [[nodiscard]] bool is_usable(std::size_t joint) const {
    const auto force = forces_->columns.find(joint);
    return joints_[joint].moves && positions_->columns.contains(joint) &&
           force != forces_->columns.end() && force->second->moves();
  }

  // Joints from the root to this one.
  [[nodiscard]] std::vector<std::size_t> path_to(std::size_t joint) const {
    std::vector<std::size_t> path{joint};
    for (std::size_t k = joint; k-- > 0;) {
      if (joints_[k].child == joints_[path.back()].parent) path.push_back(k);
    }
    std::ranges::reverse(path);
    return path;
  }

  void take_chain(const std::vector<std::size_t>& path) {
    bool began = !request_.base.empty();
    bool in_range = request_.base.empty();
    for (const std::size_t joint : path) {
      if (!in_range && joints_[joint].parent != request_.base) continue;
      in_range = true;
      if (is_usable(joint)) {
        if (chain_.empty() && request_.base.empty()) first_ = joint;
        if (chain_.empty() && !request_.base.empty())
          first_ = *std::ranges::find_if(
              path, [&](std::size_t each) { return joints_[each].parent == request_.base; });
        began = true;
        chain_.push_back(joint);
      } else if (began && joints_[joint].moves) {
        throw InputError(fmt::format(
            "{}: joint '{}' lies between the logged ones, and its position and force are not "
            "logged; "
            "log them, name their columns by --column NAME=position@{}, or choose --base or --tip",
            urdf_name(), joints_[joint].name, joints_[joint].name));
      }
    }
    if (chain_.empty()) {
      throw InputError(fmt::format("--base {}: no logged joint is beyond it", request_.base));
    }
    require_masses();
  }

  void require_masses() const {
    double mass = 0.0;
    for (const std::size_t joint : chain_) mass += joints_[joint].child_mass;
    if (mass > 0.0) return;
    throw InputError(fmt::format(
        "{}: no link of the logged joints has a mass; take a URDF with <inertial>", urdf_name()));
  }

  const ProposalRequest& request_;
  const LogRecording& log_;
  std::vector<UrdfJoint> joints_;
  const ColumnFamily* positions_ = nullptr;
  const ColumnFamily* forces_ = nullptr;
  std::vector<std::size_t> chain_;  // joints that move and are logged, from the base on
  std::size_t first_ = 0;           // the joint whose parent link is the base
};

// "[0, 0, -9.81]"
std::string gravity_text(const Eigen::Vector3d& gravity) {
  std::vector<std::string> parts;
  for (const double each : gravity) {
    parts.push_back(fmt::format("{:.6g}", std::abs(each) < 1e-9 ? 0.0 : each));
  }
  return fmt::format("[{}]", fmt::join(parts, ", "));
}

// What decides the text of a model besides its joints.
struct ModelDoubts {
  bool gains_known = true, beyond_limits = false;
};

std::string robot_model_text(const ProposalRequest& request, const LoggedRobot& robot,
                             const ModelDoubts& doubts) {
  std::string text = fmt::format(
      "# Proposed by `{}`: rigid links as the URDF has them, without friction.\n", request.command);
  text += "format: graybox-rigid-robot/1\n";
  if (robot.chain().empty()) return text + "# ANSWER: first the questions of campaign.yaml\n";
  std::filesystem::path urdf = request.urdf;
  if (urdf.is_relative()) {
    urdf = std::filesystem::proximate(urdf, request.folder.empty() ? "." : request.folder);
  }
  text += fmt::format("gravity: {:<37} # m/s^2, in the base link's axes\n",
                      gravity_text(robot.gravity()));
  text += fmt::format("urdf: {}\nbase: {}\ntip: {}\njoints:\n", in_quotes(urdf.string()),
                      in_quotes(robot.base()), in_quotes(robot.tip()));
  std::vector<std::string> forces, positions;
  for (const std::size_t joint : robot.chain()) {
    const std::string& name = robot.joints()[joint].name;
    text += fmt::format(
        "  - {{name: {}, gear_ratio: 1, rotor_inertia: unknown}}{}\n", in_quotes(name),
        doubts.beyond_limits ? "  # ANSWER: is the log of motors? Then their gear ratio" : "");
    forces.push_back(channel_name("force", name));
    positions.push_back(channel_name("position", name));
  }
  text += fmt::format("channels:\n  torque: [{}]\n  torque_of: arm\n", fmt::join(forces, ", "));
  text += fmt::format("  drive_gains: {:<30} # {}\n", doubts.gains_known ? "known" : "unknown",
                      doubts.gains_known ? "the titles state newton metres" : "estimated");
  text += fmt::format("  position: [{}]\n  position_of: arm\n", fmt::join(positions, ", "));
  return text;
}

// A unit that a title states and the quantity can't have.
void refuse_odd_unit(const LogColumn& column, const char* quantity, const char* unit) {
  if (column.words.odd_unit.empty()) return;
  throw InputError(fmt::format(
      "{}: column '{}': '{}' is no unit of a {} that is known ({}): say --column '{}={}:{}'",
      column.file_name, column.name, column.words.odd_unit, quantity,
      known_units_of(column.words.quantity), column.name, quantity, unit));
}

class RobotProposal {
 public:
  RobotProposal(const ProposalRequest& request, const std::vector<LogRecording>& recordings)
      : request_(request),
        recordings_(recordings),
        log_(recordings.front()),
        robot_(request, log_),
        families_(column_families(log_, robot_.joints())) {}

  ModelProposal run() {
    draft_.time = find_time(log_, request_.sample_time);
    propose_time(draft_.time, {}, proposal_);
    positions_ = choose(families_of(families_, LogQuantity::kPosition), "position");
    forces_ = choose(families_of_drive(families_), "torque, effort or current");
    robot_.set_columns(&positions_, &forces_);
    choose_chain();
    choose_units();
    check_limits();
    draft_campaign();
    proposal_.model_text = robot_model_text(request_, robot_, doubts_);
    proposal_.campaign_text = campaign_text(draft_, recordings_, request_.folder);
    return std::move(proposal_);
  }

 private:
  void guess(const std::string& subject, const std::string& value, const std::string& reason) {
    proposal_.guesses.push_back({subject, value, reason});
  }

  ColumnFamily choose(const std::vector<ColumnFamily>& list, const std::string& what) {
    if (list.empty()) {
      std::string names;
      for (const UrdfJoint& joint : robot_.joints()) {
        if (joint.moves) names += (names.empty() ? "" : ", ") + joint.name;
      }
      throw InputError(fmt::format(
          "{}: no columns are the {} of joints of {} ({}); say so by --column NAME={}@JOINT",
          log_.files.front().string(), what, robot_.urdf_name(), names,
          what == "position" ? "position" : "torque"));
    }
    if (list.size() == 1) return list.front();
    OpenQuestion question;
    for (const ColumnFamily& family : list) {
      question.text += fmt::format("{}'{}'", question.text.empty() ? "" : ", ", family.pattern);
      AnswerChoice choice{family.pattern, {}};
      for (const ColumnFamily& other : list) {
        if (&other != &family) choice.columns.push_back(other.pattern + "=ignore");
      }
      question.choices.push_back(choice);
    }
    question.text = fmt::format("Which columns are the {} of the joints: {}?", what, question.text);
    question.option = fmt::format("--column '{}=ignore', say", list.back().pattern);
    proposal_.questions.push_back(question);
    return list.front();
  }

  // "'tau_1' to 'tau_6'", of the joints in the chain.
  [[nodiscard]] std::string range_of(const ColumnFamily& family) const {
    return from_to("'" + family.columns.at(robot_.chain().front())->name + "'",
                   "'" + family.columns.at(robot_.chain().back())->name + "'");
  }

  void choose_chain() {
    const std::vector<std::size_t> aside = robot_.choose_chain();
    for (std::size_t joint = 0; joint < robot_.joints().size(); ++joint) {
      const bool is_used = std::ranges::find(robot_.chain(), joint) != robot_.chain().end();
      if (is_used || !robot_.joints()[joint].moves) continue;
      if (std::ranges::find(aside, joint) == aside.end()) {
        warn_of_locked(joint);
        continue;
      }
      proposal_.notes.push_back(fmt::format(
          "joint {} is logged as '{}' and not in the chain: locked at zero; --tip {} takes its "
          "branch",
          robot_.joints()[joint].name, robot_.position(joint).name, robot_.joints()[joint].child));
    }
    guess("joints",
          fmt::format("{}, {}", robot_.chain().size(),
                      from_to(robot_.joints()[robot_.chain().front()].name,
                              robot_.joints()[robot_.chain().back()].name)),
          fmt::format("position and force are logged; all others of {} are locked at zero",
                      request_.urdf.filename().string()));
  }

  // A joint that a column moves, and that the model holds still.
  void warn_of_locked(std::size_t joint) {
    const std::string& name = robot_.joints()[joint].name;
    const LogColumn *motion = nullptr, *drive = nullptr, *open = nullptr;
    for (const ColumnFamily& family : families_) {
      const auto found = family.columns.find(joint);
      if (found == family.columns.end() || found->second->words.is_reference) continue;
      const LogColumn* column = found->second;
      const LogQuantity quantity = column->words.quantity;
      if (quantity == LogQuantity::kPosition && column->moves()) motion = column;
      if (drives(quantity)) drive = column;
      if (quantity == LogQuantity::kUnknown && column->moves()) open = column;
    }
    if (motion == nullptr && open == nullptr) return;
    std::string remedy =
        fmt::format("log its force, too, and name it by --column 'NAME=torque@{}'", name);
    if (motion != nullptr && drive == nullptr && open != nullptr) {
      remedy =
          fmt::format("--column '{}=torque@{}' adds it if that is its force", open->name, name);
    } else if (motion == nullptr) {
      remedy = fmt::format(
          "--column '{}=position@{}' adds its position{}", open->name, name,
          drive == nullptr ? ", and --column 'NAME=torque@" + name + "' its force" : "");
    } else if (drive != nullptr) {
      remedy = drive->moves()
                   ? fmt::format("--column '{}={}@{}' adds it", drive->name,
                                 name_of(drive->words.quantity), name)
                   : fmt::format("'{}' never changes, so its force is not known", drive->name);
    }
    proposal_.notes.push_back(fmt::format("joint {} is locked at zero, though '{}' moves it: {}",
                                          name, motion != nullptr ? motion->name : open->name,
                                          remedy));
  }

  // ---- units -----------------------------------------------------------------------------------

  void choose_units() {
    if (request_.counts_per_turn) return take_counts();
    const MotionContext context{
        draft_.time.sample_time, EvenSamples(log_, draft_.time), MotionKind::kOpen, {}};
    const std::vector<ColumnFamily> velocities = families_of(families_, LogQuantity::kVelocity);
    std::set<std::string> found;
    std::string why, note;
    for (const std::size_t joint : robot_.chain()) {
      if (robot_.joints()[joint].is_prismatic) continue;
      std::vector<const LogColumn*> columns{&robot_.position(joint)};
      if (velocities.size() == 1 && velocities.front().columns.contains(joint)) {
        columns.push_back(velocities.front().columns.at(joint));
      }
      const MotionChoice choice = choose_motion(columns, context);
      if (!choice.notes.empty() && note.empty()) note = choice.notes.front();
      if (choice.column == nullptr || choice.is_velocity || choice.unit == "counts") continue;
      if (!choice.questions.empty() && !choice.questions.front().choices.empty() &&
          !robot_.position(joint).words.unit.empty()) {
        proposal_.questions.push_back(choice.questions.front());
        return;
      }
      const bool by_data =
          choice.unit_reason.find("guessed") == std::string::npos && choice.unit_reason != "open";
      if (!by_data) continue;
      found.insert(choice.unit);
      why = choice.unit_reason;
    }
    if (!note.empty()) {
      proposal_.notes.push_back(note + (robot_.chain().size() > 1 ? " (and others alike)" : ""));
    }
    if (found.size() == 1) {
      angle_ = in_unit(*found.begin());
      unit_reason_ = why;
    } else if (!robot_.fits_limits(in_unit("rad")) && robot_.fits_limits(in_unit("deg"))) {
      angle_ = in_unit("deg");
      unit_reason_ = "in radians they would leave the URDF's limits";
    } else {
      unit_reason_ = "guessed: no unit is stated";
      if (robot_.fits_limits(angle_)) unit_reason_ += ", and they keep within the URDF's limits";
    }
  }

  // Counts of encoders; of half a turn where zero is in the middle, as servos of one turn count.
  void take_counts() {
    const double counts = *request_.counts_per_turn;
    if (!robot_.holds_counts()) {
      const LogColumn& first = robot_.position(robot_.chain().front());
      throw InputError(
          fmt::format("--counts-per-turn: '{}' is {}, not in counts; leave it out", first.name,
                      first.words.unit.empty() ? "in no whole numbers" : "in " + first.words.unit));
    }
    angle_ = {"counts", 2.0 * std::numbers::pi / counts, 0.0};
    unit_reason_ = fmt::format("{:g} counts a turn, as you said", counts);
    if (robot_.fits_limits(angle_)) return;
    AngleUnit centred = angle_;
    centred.centre = 0.5 * counts;
    if (!robot_.fits_limits(centred)) return;
    angle_ = centred;
    unit_reason_ += fmt::format(
        "; zero at {:g}, as of servos whose middle is half a turn: from 0 "
        "on they would leave the URDF's limits",
        angle_.centre);
  }

  void check_limits() {
    std::string prefix =
        forces_.by_number ? "numbers count the joints" : "joints' names in the titles";
    guess("positions", fmt::format("{} in {}", range_of(positions_), angle_.name),
          fmt::format("{}; {}", prefix, unit_reason_));
    const bool is_open_count = angle_.name != "counts" && robot_.is_in_counts();
    if (robot_.fits_limits(angle_) && !is_open_count) return;
    const std::string in_degrees = fmt::format("--column '{}=position:deg'", positions_.pattern);
    if (angle_.name != "counts" && robot_.holds_counts()) {
      proposal_.questions.push_back(
          {OpenQuestion::Kind::kCountsPerTurn,
           fmt::format("'{}' are whole numbers{}: how many counts of the encoders are a turn?",
                       positions_.pattern,
                       is_open_count
                           ? ""
                           : fmt::format(" that leave the joints' limits in {}", angle_.name)),
           fmt::format("--counts-per-turn N, 4096 of many servos, say; or {}", in_degrees),
           {}});
      return;
    }
    proposal_.questions.push_back(
        {OpenQuestion::Kind::kInFile,
         fmt::format(
             "'{}' leave the joints' limits in {}: are they motor angles? State gear ratios and "
             "position_of: motors in model.yaml, or another unit{}",
             positions_.pattern, angle_.name,
             angle_.centre != 0.0 || angle_.name == "counts" ? " or zero" : ""),
         in_degrees + ", say",
         {}});
    doubts_.beyond_limits = true;
  }

  // ---- the campaign ----------------------------------------------------------------------------

  [[nodiscard]] std::string unit_of_force(std::size_t joint) const {
    return robot_.joints()[joint].is_prismatic ? "N" : "N m";
  }

  void add_force(std::size_t joint) {
    const LogColumn& column = robot_.force(joint);
    refuse_odd_unit(column, "torque", "N m");
    const std::string base = unit_of_force(joint);
    std::string unit = column.words.unit;
    const Unit* known = find_unit(unit);
    const bool is_force = known != nullptr && (known->base == "N" || known->base == "N m");
    if (is_force && known->base != base) unit = base;
    std::string gain, comment;
    if (!is_force) {
      doubts_.gains_known = false;
      if (unit.empty()) comment = "its unit is not stated, its gain not known";
      unit = unit.empty() ? "1" : unit;
      gain = fmt::format("{{value: {:g}, unit: {}}}", column.words.unit_factor,
                         in_quotes(base + "/" + unit));
    }
    const std::string name = channel_name("force", robot_.joints()[joint].name);
    if (std::ranges::find(request_.reversed, column.name) != request_.reversed.end()) {
      const Unit* written = is_force ? find_unit(unit) : nullptr;
      const double size = (written == nullptr ? 1.0 : written->factor) * column.words.unit_factor;
      gain = fmt::format("{{value: {:g}, unit: {}}}", -size, in_quotes(base + "/" + unit));
      comment = "reversed: else friction would feed energy in";
    }
    proposal_.columns[name] = column.name;
    draft_.channels.push_back({name, column.file, column.name, unit, gain, "input", comment});
  }

  void add_position(std::size_t joint) {
    const LogColumn& column = robot_.position(joint);
    refuse_odd_unit(column, "position", "rad");
    std::string name = channel_name("position", robot_.joints()[joint].name);
    if (robot_.joints()[joint].is_prismatic) {
      const std::string unit = column.words.unit.empty() ? "m" : column.words.unit;
      draft_.channels.push_back({name, column.file, column.name, unit, "", "output", ""});
      return;
    }
    const bool is_counted = angle_.name == "counts";
    std::string gain, role = "output";
    if (is_counted) gain = fmt::format("{{value: {:.8g}, unit: rad/counts}}", angle_.factor);
    if (angle_.centre != 0.0) {
      draft_.computed.push_back(fmt::format(
          "  - {{kind: sum, of: [counts_of_{}, centre], weights: [1, -1], unit: rad, name: {}, is: "
          "output}}\n",
          name, name));
      name = "counts_of_" + name;
      role = "other";
    }
    const double turn = 2.0 * std::numbers::pi / angle_.factor;
    if (without_wraps(without_gaps(column.values), turn).second) {
      draft_.wrapped.push_back({name, is_counted ? fmt::format(", period: {:.10g}", turn) : ""});
    }
    draft_.channels.push_back({name, column.file, column.name, angle_.name, gain, role, ""});
  }

  void draft_campaign() {
    draft_.heading = fmt::format("# Proposed by `{}`. Change what is wrong.\n", request_.command);
    if (!draft_.time.is_even) draft_.hold = "first";
    std::vector<const LogColumn*> decisive;
    for (const std::size_t joint : robot_.chain()) add_force(joint);
    if (angle_.centre != 0.0) {
      draft_.computed.push_back(fmt::format(
          "  - {{kind: constant, name: centre, value: {:.8g}, unit: rad, is: other}}  # {:g} "
          "counts\n",
          angle_.factor * angle_.centre, angle_.centre));
    }
    for (const std::size_t joint : robot_.chain()) {
      add_position(joint);
      decisive.push_back(&robot_.position(joint));
    }
    mark_choice();
    note_gaps();
    note_unused();
    draft_.experiments = draft_experiments(recordings_, decisive, false, draft_.time.sample_time);
    guess_forces();
    guess_filter(decisive);
    split_in_blocks();
  }

  // Halves of which one shows a joint less than the other check nothing of it: then alternating
  // blocks (kept_out_blocks.hpp).
  void split_in_blocks() {
    if (recordings_.size() > 1 || draft_.experiments.size() != 2) {
      return guess("kept out", recordings_.back().label(), "checks the fit");
    }
    const Eigen::Index first = draft_.experiments.front().first,
                       count = draft_.experiments.back().last - first + 1;
    std::vector<DrivenAxis> axes;
    for (const std::size_t joint : robot_.chain()) {
      axes.push_back({without_gaps(robot_.force(joint).values).segment(first, count),
                      without_gaps(robot_.position(joint).values).segment(first, count)});
    }
    const KeptOutBlocks split = kept_out_blocks(axes, lost_by_filter());
    const std::string joint = axes.empty() ? "" : robot_.joints()[robot_.chain()[split.axis]].name;
    if (split.count < 3) {
      if (!split.is_fair) {
        proposal_.notes.push_back(fmt::format(
            "joint {}: {}, so the halves are not alike, and no other split of this log is better: "
            "what it shows of that joint may not hold in the other half; record another run",
            joint, split.reason));
      }
      return guess("kept out", "the second half", "checks the fit");
    }
    draft_.experiments.clear();
    for (Eigen::Index k = 0; k < split.count; ++k) {
      draft_.experiments.push_back({0, first + k * count / split.count,
                                    first + (k + 1) * count / split.count - 1, false, k % 2 == 1});
    }
    guess("kept out", fmt::format("every second of {} parts", split.count),
          fmt::format("joint {}: {}, so halves would not be alike", joint, split.reason));
  }

  // Samples at the ends of a part, within two periods of the filter's frequency.
  [[nodiscard]] Eigen::Index lost_by_filter() const {
    constexpr double kPeriods = 4.0;  // at both ends
    const double step = draft_.time.sample_time;
    if (!draft_.low_pass || !(step > 0.0)) return 0;
    return static_cast<Eigen::Index>(kPeriods / (*draft_.low_pass * step));
  }

  // Questions about columns stand at the first channel.
  void mark_choice() {
    for (const OpenQuestion& question : proposal_.questions) {
      if (question.kind != OpenQuestion::Kind::kChoice || draft_.channels.empty()) continue;
      draft_.channels.front().comment = "# ANSWER: " + question.text;
    }
  }

  // Torques that are far from what the links weigh are of motors before a gear.
  void doubt_gains() {
    constexpr double kFar = 10.0;
    const double share = robot_.share_of_weight(angle_);
    if (share == 0.0 || (share < kFar && share > 1.0 / kFar)) return;
    doubts_.gains_known = false;
    proposal_.notes.push_back(fmt::format(
        "the torques are {:.2g} times the links' weight, as of motors before a gear or in "
        "another unit: each drive's gain is estimated",
        share));
  }

  void guess_forces() {
    if (robot_.chain().empty()) return;
    const bool were_known = doubts_.gains_known;
    if (doubts_.gains_known && proposal_.questions.empty()) doubt_gains();
    guess("forces", range_of(forces_),
          doubts_.gains_known ? "in newton metres, as their titles say"
          : were_known
              ? "newton metres by their titles, but not by the links' weight"
              : "no newton metres are stated: each drive's gain is unknown, and estimated");
    std::string still;
    for (const auto& [joint, column] : forces_.columns) {
      if (!column->moves()) still += (still.empty() ? "" : ", ") + robot_.joints()[joint].name;
    }
    if (!still.empty()) proposal_.notes.push_back("the force never changes of " + still);
  }

  void guess_filter(const std::vector<const LogColumn*>& columns) {
    const double step = draft_.time.sample_time;
    if (columns.empty() || !(step > 0.0)) return;
    const DraftExperiment& part = draft_.experiments.front();
    std::vector<Eigen::VectorXd> motions;
    for (const LogColumn* column : columns) {
      if (!column->moves()) continue;
      motions.push_back(
          without_gaps(column->values).segment(part.first, part.last - part.first + 1));
    }
    draft_.low_pass = filter_frequency(motions, false, step);
    draft_.low_pass_reason = "15 times what most joints move with; positions are differentiated";
    guess("filter", fmt::format("{:g} Hz", *draft_.low_pass), draft_.low_pass_reason);
  }

  void note_gaps() {
    for (const DraftChannel& channel : draft_.channels) {
      const bool any = std::ranges::any_of(recordings_, [&](const LogRecording& recording) {
        return recording.at(channel.file, channel.column).has_gaps();
      });
      if (any) draft_.gapped.push_back(channel.name);
    }
    if (!draft_.gapped.empty()) {
      proposal_.notes.emplace_back("rows without a number are left out");
    }
  }

  void note_unused() {
    std::string names;
    int count = 0;
    for (const LogColumn& column : log_.columns) {
      const bool is_used = std::ranges::any_of(draft_.channels, [&](const DraftChannel& channel) {
        return channel.column == column.name && channel.file == column.file;
      });
      if (is_used || column.words.quantity == LogQuantity::kTime) continue;
      draft_.unused.push_back(column.name);
      if (++count <= 2) names += (names.empty() ? "'" : "', '") + column.name;
    }
    if (count == 0) return;
    guess("not used", names + "'" + (count > 2 ? fmt::format(" and {} more", count - 2) : ""), "");
  }

  const ProposalRequest& request_;
  const std::vector<LogRecording>& recordings_;
  const LogRecording& log_;
  LoggedRobot robot_;
  std::vector<ColumnFamily> families_;
  ColumnFamily positions_, forces_;
  AngleUnit angle_;
  std::string unit_reason_;
  ModelDoubts doubts_;
  CampaignDraft draft_;
  ModelProposal proposal_;
};

}  // namespace

ModelProposal propose_robot(const ProposalRequest& request,
                            const std::vector<LogRecording>& recordings) {
  return RobotProposal(request, recordings).run();
}

}  // namespace graybox
