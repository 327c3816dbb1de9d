#include "diagnosis/proposal/robot_campaign.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <numbers>
#include <utility>

#include "diagnosis/first_masses/kept_out_blocks.hpp"
#include "diagnosis/log_columns/column_rates.hpp"
#include "diagnosis/log_columns/even_samples.hpp"
#include "diagnosis/log_columns/motion_span.hpp"
#include "problems/base/error.hpp"
#include "problems/base/units.hpp"

namespace graybox {
namespace {

// A unit that a title states and the quantity can't have.
void refuse_odd_unit(const LogColumn& column, const char* quantity, const char* unit) {
  if (column.words.odd_unit.empty()) return;
  throw InputError(fmt::format(
      "{}: column '{}': '{}' is no unit of a {} that is known ({}): say --column '{}={}:{}'",
      column.file_name, column.name, column.words.odd_unit, quantity,
      known_units_of(column.words.quantity), column.name, quantity, unit));
}

// What a joint moves by over a hundredth of each log, which passes over the steps of an encoder.
std::vector<Eigen::VectorXd> ways_of(const LogColumn& position,
                                     const std::vector<LogRecording>& recordings) {
  std::vector<Eigen::VectorXd> ways;
  for (const LogRecording& recording : recordings) {
    const Eigen::VectorXd place = without_gaps(recording.at(position.file, position.name).values);
    const Eigen::Index over = std::max<Eigen::Index>(1, place.size() / 100);
    const Eigen::Index count = std::max<Eigen::Index>(0, place.size() - over);
    ways.emplace_back(place.tail(count) - place.head(count));
  }
  return ways;
}

// The cosine between what two joints do, in all logs together; 0 where one stands still.
double cosine_between(const std::vector<Eigen::VectorXd>& one,
                      const std::vector<Eigen::VectorXd>& other) {
  double product = 0.0, squares = 0.0, squares_of_other = 0.0;
  for (std::size_t k = 0; k < one.size(); ++k) {
    product += one[k].dot(other[k]);
    squares += one[k].squaredNorm();
    squares_of_other += other[k].squaredNorm();
  }
  const double size = std::sqrt(squares * squares_of_other);
  return size > 0.0 ? product / size : 0.0;
}

// Joints that move in proportion to the first of them.
struct JointsTogether {
  std::vector<std::size_t> joints;
  double least = 1.0;  // cosine
};

// At a cosine r the sizes of two joints are told 1/sqrt(1 - r^2) times worse than where each
// moves by itself: fivefold at 0.98, of what little is a joint's own motion.
std::vector<JointsTogether> joints_together(const LoggedRobot& robot,
                                            const std::vector<LogRecording>& recordings) {
  constexpr double kInProportion = 0.98;
  std::vector<JointsTogether> groups;
  std::vector<std::vector<Eigen::VectorXd>> ways_of_first;
  for (const std::size_t joint : robot.chain()) {
    if (!robot.position(joint).moves()) continue;
    std::vector<Eigen::VectorXd> ways = ways_of(robot.position(joint), recordings);
    bool is_new = true;
    for (std::size_t k = 0; k < groups.size() && is_new; ++k) {
      const double found = std::abs(cosine_between(ways_of_first[k], ways));
      if (!(found > kInProportion)) continue;
      groups[k].joints.push_back(joint);
      groups[k].least = std::min(groups[k].least, found);
      is_new = false;
    }
    if (!is_new) continue;
    groups.push_back({{joint}});
    ways_of_first.push_back(std::move(ways));
  }
  std::erase_if(groups, [](const JointsTogether& group) { return group.joints.size() < 2; });
  return groups;
}

class RobotCampaignDraft {
 public:
  RobotCampaignDraft(const ProposalRequest& request, const std::vector<LogRecording>& recordings,
                     const LoggedRobot& robot, const AngleUnit& angle, const LogTime& time,
                     ModelProposal& proposal)
      : request_(request),
        recordings_(recordings),
        log_(recordings.front()),
        robot_(robot),
        angle_(angle),
        proposal_(proposal) {
    draft_.time = time;
  }

  RobotCampaign run() {
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
    note_proportional();
    return {std::move(draft_), gains_known_};
  }

 private:
  void guess(const std::string& subject, const std::string& value, const std::string& reason) {
    proposal_.guesses.push_back({subject, value, reason});
  }

  [[nodiscard]] std::string unit_of_force(std::size_t joint) const {
    return robot_.joints()[joint].is_prismatic ? "N" : "N m";
  }

  void add_force(std::size_t joint) {
    const LogColumn& column = robot_.force(joint);
    const std::string base = unit_of_force(joint);
    const std::string name = joint_channel("force", robot_.joints()[joint].name);
    if (robot_.is_passive(joint)) {  // a zero in any unit, and of either sign
      draft_.channels.push_back(
          {name, column.file, column.name, base, "", "input", "zero: nothing drives this joint"});
      return;
    }
    refuse_odd_unit(column, "torque", "N m");
    std::string unit = column.words.unit;
    const Unit* known = find_unit(unit);
    const bool is_force = known != nullptr && (known->base == "N" || known->base == "N m");
    if (is_force && known->base != base) unit = base;
    std::string gain, comment;
    if (!is_force) {
      gains_known_ = false;
      if (unit.empty()) comment = "its unit is not stated, its gain not known";
      unit = unit.empty() ? "1" : unit;
      gain = fmt::format("{{value: {:g}, unit: {}}}", column.words.unit_factor,
                         in_quotes(base + "/" + unit));
    }
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
    std::string name = joint_channel("position", robot_.joints()[joint].name);
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

  // Halves of which one shows a joint less than the other check nothing of it: then alternating
  // blocks (kept_out_blocks.hpp).
  void split_in_blocks() {
    if (recordings_.size() > 1 && draft_.experiments.size() > recordings_.size()) {
      return guess("kept out", "every second part of each recording", kOppositeWays);
    }
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

  // Questions about columns stand at the channel that they name, else at the first.
  void mark_choice() {
    for (const OpenQuestion& question : proposal_.questions) {
      if (question.kind != OpenQuestion::Kind::kChoice || draft_.channels.empty()) continue;
      const auto is_named = [&](const DraftChannel& channel) {
        return question.text.find("'" + channel.column + "'") != std::string::npos;
      };
      const auto named = std::ranges::find_if(draft_.channels, is_named);
      DraftChannel& marked = named != draft_.channels.end() ? *named : draft_.channels.front();
      marked.comment = "# ANSWER: " + question.text;
    }
  }

  // Torques that are far from what the links weigh are of motors before a gear.
  void doubt_gains() {
    constexpr double kFar = 10.0;
    const double share = robot_.share_of_weight(angle_);
    if (share == 0.0 || (share < kFar && share > 1.0 / kFar)) return;
    gains_known_ = false;
    proposal_.notes.push_back(fmt::format(
        "the torques are {:.2g} times the links' weight, as of motors before a gear or in "
        "another unit: each drive's gain is estimated",
        share));
  }

  void guess_forces() {
    if (robot_.chain().empty()) return;
    const bool were_known = gains_known_;
    if (gains_known_ && proposal_.questions.empty()) doubt_gains();
    guess("forces", robot_.range_of(robot_.forces()),
          gains_known_ ? "in newton metres, as their titles say"
          : were_known
              ? "newton metres by their titles, but not by the links' weight"
              : "no newton metres are stated: each drive's gain is unknown, and estimated");
    std::string still;
    for (const auto& [joint, column] : robot_.forces().columns) {
      if (!column->moves() && !is_passive(joint))
        still += (still.empty() ? "" : ", ") + robot_.joints()[joint].name;
    }
    if (!still.empty()) proposal_.notes.push_back("the force never changes of " + still);
    note_passive();
  }

  [[nodiscard]] bool is_passive(std::size_t joint) const {
    return std::ranges::find(robot_.chain(), joint) != robot_.chain().end() &&
           robot_.is_passive(joint);
  }

  // What nothing drives is taken so by its zeros alone.
  void note_passive() {
    for (const std::size_t joint : robot_.chain()) {
      if (!robot_.is_passive(joint)) continue;
      const std::string &name = robot_.joints()[joint].name, &force = robot_.force(joint).name;
      proposal_.notes.push_back(fmt::format(
          "joint {} moves and '{}' is zero throughout: it is taken as a joint that nothing "
          "drives; --column '{}=ignore' if zero means that nothing was measured",
          name, force, force));
      if (gains_known_) continue;
      proposal_.notes.push_back(fmt::format(
          "joint {}: zeros tell nothing of its own motion while the other drives' gains are "
          "unknown; state their unit, as in --column 'NAME=torque:N m'",
          name));
    }
  }

  // What moves together all the time can't be told apart.
  void note_proportional() {
    for (const JointsTogether& group : joints_together(robot_, recordings_)) {
      std::string names;
      for (std::size_t k = 0; k < group.joints.size(); ++k) {
        names += (k == 0                        ? ""
                  : k + 1 < group.joints.size() ? ", "
                                                : " and ") +
                 robot_.joints()[group.joints[k]].name;
      }
      const double own = 100.0 * std::sqrt(std::max(0.0, 1.0 - group.least * group.least));
      proposal_.notes.push_back(fmt::format(
          "joints {} move in proportion (to {:.0f} % of their speed): {} can't tell their friction "
          "or loads apart; move them one after another, or at different times",
          names, std::max(1.0, std::ceil(own)),
          recordings_.size() > 1 ? "these logs" : "this log"));
    }
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
  const LoggedRobot& robot_;
  const AngleUnit& angle_;
  ModelProposal& proposal_;
  CampaignDraft draft_;
  bool gains_known_ = true;
};

}  // namespace

RobotCampaign draft_robot_campaign(const ProposalRequest& request,
                                   const std::vector<LogRecording>& recordings,
                                   const LoggedRobot& robot, const AngleUnit& angle,
                                   const LogTime& time, ModelProposal& proposal) {
  return RobotCampaignDraft(request, recordings, robot, angle, time, proposal).run();
}

std::string joint_channel(const std::string& quantity, const std::string& joint) {
  std::string name = quantity + "_" + joint;
  for (char& each : name) {
    if (std::isalnum(static_cast<unsigned char>(each)) == 0) each = '_';
  }
  return name;
}

}  // namespace graybox
