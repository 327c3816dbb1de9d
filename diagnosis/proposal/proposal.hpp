// A first model.yaml and campaign.yaml from the columns of logs: what `graybox model` writes.
//
//   ProposalRequest request;
//   request.machine = ProposedMachine::kOneMass;
//   request.logs = {"run_1.csv", "run_2.csv"};
//   const ModelProposal proposal = propose_model(request);
//   if (proposal.questions.empty()) write_text_file("model.yaml", proposal.model_text);
//
// Every guess comes with its reason, in `guesses` and as a comment of the line it made. What can't
// be known and has no likely answer is a question. Its line is marked "# ANSWER:", and no command
// reads such a file (yaml_field.hpp).
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/log_columns/log_recordings.hpp"
#include "diagnosis/proposal/campaign_draft.hpp"

namespace graybox {

// kRecordings: a campaign alone, with every column that was recognised.
enum class ProposedMachine { kOpen, kOneMass, kTwoMasses, kRobot, kRecordings };

struct ProposalRequest {
  ProposedMachine machine = ProposedMachine::kOpen;
  std::string machine_reason = "you said so";
  std::filesystem::path urdf;  // of kRobot
  std::string base, tip;       // links; empty: from the joints that are logged
  std::vector<std::filesystem::path> logs;
  std::vector<ColumnAnswer> columns;
  std::optional<double> sample_time;  // s
  std::optional<double> counts_per_turn;
  std::optional<double> gain;         // N m or N that one of the drive's recorded unit is
  std::vector<std::string> reversed;  // columns of forces that count the other way
  bool no_drive = false;              // nothing drives: a run-down or a free swing; not of robots
  MotionKind motion = MotionKind::kOpen;
  std::filesystem::path folder;                // where the files will stand
  std::string command;                         // for the files' first line
  SplitPlan split = SplitPlan::kMovingHalves;  // not of robots
};

struct ProposedGuess {
  std::string subject, value, reason;
};

// One answer: what to say on a terminal, and the --column options it stands for.
struct AnswerChoice {
  std::string label;
  std::vector<std::string> columns;
  bool no_drive = false;  // it stands for --no-drive, too
};

struct OpenQuestion {
  enum class Kind { kChoice, kSampleTime, kCountsPerTurn, kInFile };
  Kind kind = Kind::kChoice;
  std::string text;
  std::string option;  // how to answer beforehand
  std::vector<AnswerChoice> choices = {};
  std::string about = {};  // the column whose line in campaign.yaml it marks
};

struct ModelProposal {
  std::string model_text, campaign_text;  // the model's is empty for kRecordings
  std::vector<ProposedGuess> guesses;
  std::vector<OpenQuestion> questions;
  std::vector<std::string> notes;              // what the user should know, in a sentence each
  std::map<std::string, std::string> columns;  // by channel, of a robot's drives
  bool is_too_short = false;  // a diagnosis by prediction error would refuse it, a fit would not
};

// What a proposal says of its times: a guess, or a question where they are open. `others`: what a
// column of times without a unit may be besides.
void propose_time(const LogTime& time, const std::vector<AnswerChoice>& others,
                  ModelProposal& proposal);

// Throws InputError for files that can't be read, for times that don't rise, for logs without any
// column that could be motion or drive, and for joints that the URDF and the log don't share.
[[nodiscard]] ModelProposal propose_model(const ProposalRequest& request);

}  // namespace graybox
