#include "diagnosis/proposal/proposal.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "diagnosis/log_columns/column_copies.hpp"
#include "diagnosis/log_columns/column_rates.hpp"
#include "diagnosis/log_columns/joint_columns.hpp"
#include "diagnosis/proposal/campaign_draft.hpp"
#include "diagnosis/proposal/mass_proposal.hpp"
#include "diagnosis/proposal/motion_choice.hpp"
#include "diagnosis/proposal/robot_proposal.hpp"
#include "problems/base/error.hpp"
#include "problems/base/units.hpp"
#include "problems/mechanisms/urdf_chain.hpp"

namespace graybox {
namespace {

// Two sides if titles name both, one mass else; more than two numbered positions are a robot's.
ProposedMachine machine_of(const LogRecording& log) {
  bool has_motor = false, has_load = false;
  std::set<int> numbers;
  for (const LogColumn& column : log.columns) {
    if (column.words.quantity != LogQuantity::kPosition || column.words.is_reference) continue;
    has_motor = has_motor || column.words.side == DriveSide::kMotor;
    has_load = has_load || column.words.side == DriveSide::kLoad;
    if (column.words.index) numbers.insert(*column.words.index);
  }
  if (numbers.size() > 2) {
    throw InputError(fmt::format(
        "{}: has {} numbered positions, as of a robot: give its URDF, too, or choose one axis by "
        "--one-mass and --column NAME=ignore",
        log.files.front().string(), numbers.size()));
  }
  return has_motor && has_load ? ProposedMachine::kTwoMasses : ProposedMachine::kOneMass;
}

std::string safe_name(const std::string& title, std::set<std::string>& taken) {
  std::string name;
  for (const std::string& word : words_of(title)) name += (name.empty() ? "" : "_") + word;
  if (name.empty()) name = "column";
  std::string unique = name;
  for (int k = 2; !taken.insert(unique).second; ++k) unique = fmt::format("{}_{}", name, k);
  return unique;
}

// What titles say beside the names of the URDF's joints: "wrist_angle_effort" is an effort.
void name_beside_joints(const std::vector<UrdfJoint>& joints,
                        std::vector<LogRecording>& recordings) {
  for (LogRecording& recording : recordings) read_beside_joints(joints, recording);
}

// "load" is the word of small servos for the effort of their drive. Beside a motion it is taken for
// that; without one it may be the load's position.
void name_loads(std::vector<LogRecording>& recordings) {
  const bool has_motion =
      std::ranges::any_of(recordings.front().columns, [](const LogColumn& each) {
        return each.words.quantity == LogQuantity::kPosition ||
               each.words.quantity == LogQuantity::kVelocity;
      });
  if (!has_motion) return;
  for (LogRecording& recording : recordings) {
    for (LogColumn& column : recording.columns) {
      const std::vector<std::string> words = words_of(column.name);
      const bool is_load = std::ranges::find(words, "load") != words.end();
      if (column.words.quantity != LogQuantity::kUnknown || !is_load) continue;
      column.words.quantity = LogQuantity::kCommand;
      column.evidence = "'load', a servo's word for its drive's effort";
    }
  }
}

// Every column that was recognised, for a campaign by itself.
ModelProposal propose_recordings(const ProposalRequest& request,
                                 const std::vector<LogRecording>& recordings) {
  ModelProposal proposal;
  CampaignDraft draft;
  const LogRecording& log = recordings.front();
  draft.heading = fmt::format("# Proposed by `{}`. Change what is wrong.\n", request.command);
  draft.time = find_time(log, request.sample_time);
  if (!draft.time.is_even) draft.hold = "first";
  std::set<std::string> taken;
  std::vector<const LogColumn*> motions;
  for (const LogColumn& column : log.columns) {
    const LogQuantity quantity = column.words.quantity;
    const bool is_time = column.name == draft.time.column && column.file == draft.time.file;
    if (is_time || quantity == LogQuantity::kTime) continue;
    if (!column.moves() || column.has_gaps()) {
      draft.unused.push_back(column.name +
                             (column.has_gaps() ? ": rows without a number" : ": never changes"));
      continue;
    }
    DraftChannel channel{safe_name(column.name, taken),
                         column.file,
                         column.name,
                         column.words.unit,
                         "",
                         "other",
                         ""};
    if (!column.words.odd_unit.empty()) {
      channel.unit = "1";
      channel.comment = fmt::format("'{}' is no unit of a {}: state the right one",
                                    column.words.odd_unit, name_of(quantity));
    } else if (channel.unit.empty()) {
      channel.unit = "1";
      channel.comment = quantity == LogQuantity::kUnknown
                            ? "not recognised"
                            : fmt::format("a {} whose unit is not stated", name_of(quantity));
    }
    if (drives(quantity)) channel.is = "input";
    if (quantity == LogQuantity::kPosition || quantity == LogQuantity::kVelocity) {
      channel.is = "output";
      if (quantity == LogQuantity::kPosition) motions.push_back(&column);
    }
    if (column.words.is_reference && channel.is != "other") channel.is = "reference";
    draft.channels.push_back(channel);
  }
  draft.experiments = draft_experiments(recordings, {}, false, draft.time.sample_time);
  if (recordings.size() == 1) draft.experiments = {{0, 0, 0, true, false}};
  if (!(draft.time.sample_time > 0.0)) {
    proposal.questions.push_back(
        {OpenQuestion::Kind::kSampleTime, "The time is open", "--sample-time S", {}});
  }
  proposal.campaign_text = campaign_text(draft, recordings, request.folder);
  return proposal;
}

// Copies of other columns, but for a robot and a campaign by itself.
void set_aside(const ProposalRequest& request, std::vector<LogRecording>& recordings,
               std::vector<std::string>& remarks) {
  const bool is_of_masses =
      request.machine != ProposedMachine::kRobot && request.machine != ProposedMachine::kRecordings;
  if (!is_of_masses) return;
  const bool is_answered = std::ranges::any_of(
      recordings.front().columns,
      [](const LogColumn& column) { return column.answered && drives(column.words.quantity); });
  set_copies_aside(recordings, request.no_drive || is_answered, remarks);
}

ModelProposal propose_from(const ProposalRequest& request, std::vector<LogRecording>& recordings,
                           std::vector<std::string>& remarks) {
  if (request.machine != ProposedMachine::kRobot) {
    const LogTime time = find_time(recordings.front(), request.sample_time);
    name_by_rates(recordings, time.sample_time > 0.0 ? time.sample_time : 1.0);
    name_loads(recordings);
    set_aside(request, recordings, remarks);
  } else {
    name_beside_joints(read_urdf_tree(request.urdf), recordings);
  }
  switch (request.machine) {
    case ProposedMachine::kRobot:
      return propose_robot(request, recordings);
    case ProposedMachine::kRecordings:
      return propose_recordings(request, recordings);
    case ProposedMachine::kOpen: {
      ProposalRequest chosen = request;
      chosen.machine = machine_of(recordings.front());
      chosen.machine_reason = chosen.machine == ProposedMachine::kTwoMasses
                                  ? "titles name a motor and a load"
                                  : "guessed: nothing shows a second one; else say --two-masses";
      return propose_masses(chosen, recordings);
    }
    default:
      return propose_masses(request, recordings);
  }
}

}  // namespace

namespace {

// The unit that the first letters of an unknown one tell, as "millisek.", else the steps.
std::string likely_unit_of(const LogTime& time) {
  for (const std::string& word : words_of(time.odd_unit)) {
    if (word.starts_with("milli")) return "ms";
    if (word.starts_with("micro") || word.starts_with("mikro")) return "us";
    if (word.starts_with("nano")) return "ns";
  }
  return likely_unit_of_step(time.median_step);
}

}  // namespace

void propose_time(const LogTime& time, const std::vector<AnswerChoice>& others,
                  ModelProposal& proposal) {
  constexpr double kFastest = 1e-6;  // s: what moves is not sampled faster
  const bool is_doubtful =
      time.sample_time > 0.0 && time.sample_time < kFastest && time.why != "you said so";
  if (time.sample_time > 0.0 && !is_doubtful) {
    proposal.guesses.push_back(
        {"time",
         time.column.empty() ? "no column" : fmt::format("'{}' in {}", time.column, time.unit),
         fmt::format("{}; {}samples every {:g} s", time.why,
                     time.is_even ? "" : "uneven, resampled to ", time.sample_time)});
    return;
  }
  if (time.column.empty()) {
    proposal.questions.push_back({OpenQuestion::Kind::kSampleTime,
                                  "How many seconds lie between samples? No column has the time.",
                                  "--sample-time S",
                                  {}});
    return;
  }
  OpenQuestion question;
  question.text = is_doubtful ? fmt::format(
                                    "Is '{}' in {}, as its title says? Its samples would be {:g} s "
                                    "apart",
                                    time.column, time.unit, time.sample_time)
                              : time.question();
  const std::string likely = is_doubtful ? "ms" : likely_unit_of(time);
  question.option = fmt::format("--column '{}=time:{}', say", time.column, likely);
  for (const char* unit : {"s", "ms", "us", "ns"}) {
    question.choices.push_back({unit, {fmt::format("{}=time:{}", time.column, unit)}});
  }
  question.choices.insert(question.choices.end(), others.begin(), others.end());
  proposal.questions.push_back(question);
}

ModelProposal propose_model(const ProposalRequest& request) {
  std::vector<std::string> remarks;
  std::vector<LogRecording> recordings = read_logs(request.logs, request.columns, &remarks);
  ModelProposal proposal = propose_from(request, recordings, remarks);
  proposal.notes.insert(proposal.notes.begin(), remarks.begin(), remarks.end());
  Eigen::Index dropped = 0;
  for (const LogRecording& recording : recordings) dropped += recording.dropped_rows;
  if (dropped > 0) {
    proposal.guesses.push_back({"left out", fmt::format("{} rows", dropped), "the notes say why"});
  }
  return proposal;
}

}  // namespace graybox
