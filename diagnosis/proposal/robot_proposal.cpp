#include "diagnosis/proposal/robot_proposal.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <string>

#include "diagnosis/log_columns/joint_columns.hpp"
#include "diagnosis/log_columns/logged_robot.hpp"
#include "diagnosis/proposal/campaign_draft.hpp"
#include "diagnosis/proposal/motion_choice.hpp"
#include "diagnosis/proposal/robot_campaign.hpp"
#include "problems/base/error.hpp"
#include "problems/base/units.hpp"

namespace graybox {
namespace {

AngleUnit in_unit(const std::string& unit) { return {unit, find_unit(unit)->factor, 0.0}; }

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

// The line "locked: {...}", if joints of the chain's links stand elsewhere than at zero.
std::string locked_text(const LoggedRobot& robot) {
  std::vector<std::string> parts;
  for (const auto& [name, place] : robot.locked()) {
    parts.push_back(fmt::format("{}: {:.6g}", in_quotes(name), place));
  }
  if (parts.empty()) return "";
  return fmt::format("locked: {{{}}}  # where the log has them; rad or m\n",
                     fmt::join(parts, ", "));
}

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
  text += fmt::format("urdf: {}\nbase: {}\ntip: {}\n", in_quotes(urdf.string()),
                      in_quotes(robot.base()), in_quotes(robot.tip()));
  text += locked_text(robot) + "joints:\n";
  std::vector<std::string> forces, positions;
  for (const std::size_t joint : robot.chain()) {
    const std::string& name = robot.joints()[joint].name;
    const bool is_passive = robot.is_passive(joint);
    text +=
        fmt::format("  - {{name: {}, gear_ratio: 1, rotor_inertia: {}}}{}\n", in_quotes(name),
                    is_passive ? "0" : "unknown",
                    doubts.beyond_limits ? "  # ANSWER: is the log of motors? Then their gear ratio"
                    : is_passive         ? "  # nothing drives it"
                                         : "");
    forces.push_back(joint_channel("force", name));
    positions.push_back(joint_channel("position", name));
  }
  text += fmt::format("channels:\n  torque: [{}]\n  torque_of: arm\n", fmt::join(forces, ", "));
  text += fmt::format("  drive_gains: {:<30} # {}\n", doubts.gains_known ? "known" : "unknown",
                      doubts.gains_known ? "the titles state newton metres" : "estimated");
  text += fmt::format("  position: [{}]\n  position_of: arm\n", fmt::join(positions, ", "));
  return text;
}

class RobotProposal {
 public:
  RobotProposal(const ProposalRequest& request, const std::vector<LogRecording>& recordings)
      : request_(request),
        recordings_(recordings),
        log_(recordings.front()),
        robot_(request.urdf, request.base, request.tip, log_),
        families_(column_families(log_, robot_.joints())) {}

  ModelProposal run() {
    time_ = find_time(log_, request_.sample_time);
    propose_time(time_, {}, proposal_);
    positions_ = choose(families_of(families_, LogQuantity::kPosition), "position");
    forces_ = choose(families_of_drive(families_), "torque, effort or current");
    robot_.set_columns(&positions_, &forces_);
    const std::vector<std::size_t> aside = choose_chain();
    choose_units();
    robot_.lock_others(angle_);
    warn_of_locked(aside);
    note_stated_friction();
    check_limits();
    const RobotCampaign campaign =
        draft_robot_campaign(request_, recordings_, robot_, angle_, time_, proposal_);
    doubts_.gains_known = campaign.gains_known;
    proposal_.model_text = robot_model_text(request_, robot_, doubts_);
    proposal_.campaign_text = campaign_text(campaign.draft, recordings_, request_.folder);
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
      throw InputError(
          fmt::format("{}: no columns {}are the {} of joints of {} ({}); say so by --column "
                      "NAME={}@JOINT",
                      log_.files.front().string(), what == "position" ? "" : "that move ", what,
                      robot_.urdf_name(), names, what == "position" ? "position" : "torque"));
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
    columns_are_open_ = true;
    return list.front();
  }

  // Joints that are logged and not in it.
  std::vector<std::size_t> choose_chain() {
    std::vector<std::size_t> aside = robot_.choose_chain();
    guess("joints",
          fmt::format("{}, {}", robot_.chain().size(),
                      from_to(robot_.joints()[robot_.chain().front()].name,
                              robot_.joints()[robot_.chain().back()].name)),
          fmt::format("position and force are logged; all others of {} stand still",
                      request_.urdf.filename().string()));
    return aside;
  }

  // "at zero", "at 0.35 rad"
  [[nodiscard]] std::string place_words(std::size_t joint) const {
    const double place = robot_.place_of(joint);
    if (place == 0.0) return "at zero";
    return fmt::format("at {:.4g} {}", place, robot_.joints()[joint].is_prismatic ? "m" : "rad");
  }

  void warn_of_locked(const std::vector<std::size_t>& aside) {
    std::vector<std::string> still;
    for (std::size_t joint = 0; joint < robot_.joints().size(); ++joint) {
      const bool is_used = std::ranges::find(robot_.chain(), joint) != robot_.chain().end();
      const UrdfJoint& each = robot_.joints()[joint];
      if (is_used || !each.moves) continue;
      if (robot_.locked().contains(each.name)) {
        still.push_back(fmt::format("{} {}", each.name, place_words(joint)));
      }
      if (std::ranges::find(aside, joint) == aside.end()) {
        warn_of_locked(joint);
        continue;
      }
      proposal_.notes.push_back(fmt::format(
          "joint {} is logged as '{}' and not in the chain: locked {}, its mean; --tip {} takes "
          "its branch",
          each.name, robot_.position(joint).name, place_words(joint), each.child));
    }
    if (still.empty()) return;
    guess("locked", fmt::format("{}", fmt::join(still, ", ")), "where the log has them on average");
  }

  // A joint that a column moves, and that the model holds still.
  void warn_of_locked(std::size_t joint) {
    if (columns_are_open_) return;  // the answer decides which joints move
    const std::string& name = robot_.joints()[joint].name;
    const LogColumn *motion = nullptr, *drive = nullptr, *open = nullptr;
    for (const ColumnFamily& family : families_) {
      const auto found = family.columns.find(joint);
      if (found == family.columns.end() || found->second->words.is_reference) continue;
      const LogColumn* column = found->second;
      const LogQuantity quantity = column->words.quantity;
      const bool is_moved = column->moves() && !robot_.stands_still(joint);
      if (quantity == LogQuantity::kPosition && is_moved) motion = column;
      if (drives(quantity)) drive = column;
      if (quantity == LogQuantity::kUnknown && column->moves()) open = column;
    }
    if (motion == nullptr && open == nullptr) return;
    std::string remedy = fmt::format(
        "log its force, too (zeros where nothing drives it), and name it by --column "
        "'NAME=torque@{}'",
        name);
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
    proposal_.notes.push_back(fmt::format("joint {} is locked {}, though '{}' moves it: {}", name,
                                          place_words(joint),
                                          motion != nullptr ? motion->name : open->name, remedy));
  }

  // ---- units -----------------------------------------------------------------------------------

  void choose_units() {
    if (request_.counts_per_turn) return take_counts();
    const MotionContext context{time_.sample_time,
                                EvenSamples(log_, time_),
                                MotionKind::kOpen,
                                {},
                                request_.sample_time.has_value()};
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
    guess("positions", fmt::format("{} in {}", robot_.range_of(positions_), angle_.name),
          fmt::format("{}; {}", prefix, unit_reason_));
    const bool is_open_count = angle_.name != "counts" && robot_.is_in_counts();
    if (robot_.fits_limits(angle_)) note_dropouts();
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

  // A URDF's friction is often a simulator's: a diagnosis estimates it anew.
  void note_stated_friction() {
    std::vector<std::string> stated;
    for (const std::size_t joint : robot_.chain()) {
      const UrdfJoint& each = robot_.joints()[joint];
      if (each.damping == 0.0 && each.friction == 0.0) continue;
      stated.push_back(fmt::format("{} {:g} and {:g}", each.name, each.damping, each.friction));
    }
    if (stated.empty()) return;
    proposal_.notes.push_back(fmt::format(
        "{} states damping and friction (<dynamics>: {}{}): not in the model, a diagnosis "
        "estimates them",
        request_.urdf.filename().string(), stated.front(),
        stated.size() > 1 ? fmt::format(", and of {} more", stated.size() - 1) : ""));
  }

  void note_dropouts() {
    const std::vector<Eigen::Index> rows = robot_.rows_beyond_limits(angle_);
    if (rows.empty()) return;
    proposal_.notes.push_back(fmt::format(
        "positions lie beyond the joints' limits in row {}{} alone, counted from 0: a dropout? "
        "Take it out where the recordings' checks do not",
        rows.front(), rows.size() > 1 ? " and a few others" : ""));
  }

  const ProposalRequest& request_;
  const std::vector<LogRecording>& recordings_;
  const LogRecording& log_;
  LoggedRobot robot_;
  std::vector<ColumnFamily> families_;
  ColumnFamily positions_, forces_;
  bool columns_are_open_ = false;
  LogTime time_;
  AngleUnit angle_;
  std::string unit_reason_;
  ModelDoubts doubts_;
  ModelProposal proposal_;
};

}  // namespace

ModelProposal propose_robot(const ProposalRequest& request,
                            const std::vector<LogRecording>& recordings) {
  return RobotProposal(request, recordings).run();
}

}  // namespace graybox
