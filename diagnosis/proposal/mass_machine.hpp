// The machine of one mass or two that logs are of, as far as it is known: which columns drive it
// and move, how it moves, and their values in the model's units.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "diagnosis/log_columns/even_samples.hpp"
#include "diagnosis/log_columns/log_recordings.hpp"
#include "diagnosis/proposal/motion_choice.hpp"
#include "diagnosis/proposal/proposal.hpp"

namespace graybox {

struct MassMachine {
  MassMachine(const ProposalRequest& asked, const std::vector<LogRecording>& logs)
      : request(asked), recordings(logs), log(logs.front()) {
    has_two = asked.machine == ProposedMachine::kTwoMasses;
  }

  const ProposalRequest& request;
  const std::vector<LogRecording>& recordings;
  const LogRecording& log;  // the first
  bool has_two = false;
  MotionKind motion = MotionKind::kRotary;
  std::vector<const LogColumn*> columns,
      open;  // without times; those of unknown quantity that move
  const LogColumn* drive = nullptr;
  double goal_factor = 1.0;                 // of a goal that is the drive, to the model's unit
  const LogColumn* likely_drive = nullptr;  // also where a question is open
  double force_factor = 1.0;                // of the drive as recorded, to the model's unit
  std::vector<MotionChoice> motions;
  std::vector<std::string> sides;  // of each motion: "motor", "load", or empty
  EvenSamples even;
  double drive_period = 0.0;  // of its wraps, in its unit; 0: none
  std::string drive_wrap;     // for the campaign
  double speed_way = 0.0;     // of a speed without sign: 1, or -1 if never positive; 0: others
  double raw_step = 0.0;      // s between recorded samples, where values are held

  // A position servo: its goal is recorded, not the force.
  [[nodiscard]] bool has_goal() const { return drive != nullptr && drive->is_goal; }
  [[nodiscard]] bool is_linear() const { return motion == MotionKind::kLinear; }
  [[nodiscard]] std::string force_unit() const { return is_linear() ? "N" : "N m"; }
  [[nodiscard]] std::string force_name() const { return is_linear() ? "force" : "torque"; }
  [[nodiscard]] std::string motion_name(std::size_t k) const;

  // How it moves by the user's word, else by titles.
  [[nodiscard]] MotionKind motion_of_drive() const;

  // What drives in each row, before force_factor; the sum of squares is what counts.
  [[nodiscard]] Eigen::VectorXd driving() const { return driving_of(log); }
  [[nodiscard]] Eigen::VectorXd driving_of(const LogRecording& recording) const;
};

void add_guess(ModelProposal& proposal, const std::string& subject, const std::string& value,
               const std::string& reason);

// Once: both sides of a drive may have the same column.
void ask_once(ModelProposal& proposal, const OpenQuestion& question);

}  // namespace graybox
