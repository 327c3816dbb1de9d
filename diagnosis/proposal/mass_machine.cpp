#include "diagnosis/proposal/mass_machine.hpp"

#include <algorithm>

namespace graybox {

std::string MassMachine::motion_name(std::size_t k) const {
  const std::string name = is_linear() ? (motions[k].is_velocity ? "velocity" : "position")
                                       : (motions[k].is_velocity ? "speed" : "angle");
  return sides[k].empty() ? name : sides[k] + "_" + name;
}

MotionKind MassMachine::motion_of_drive() const {
  if (request.motion != MotionKind::kOpen) return request.motion;
  // The user's word before titles, and whole words of these before letters: an X beside Theta.
  for (const int least : {2, 1, 0}) {
    for (const LogColumn* column : columns) {
      const int sure = column->answered ? 2 : column->words.sure ? 1 : 0;
      const LogQuantity quantity = column->words.quantity;
      const bool is_motion =
          quantity == LogQuantity::kPosition || quantity == LogQuantity::kVelocity;
      if (is_motion && sure >= least && column->moves() &&
          column->words.motion != MotionKind::kOpen) {
        return column->words.motion;
      }
    }
  }
  return likely_drive == nullptr ? MotionKind::kOpen : likely_drive->words.motion;
}

Eigen::VectorXd MassMachine::driving_of(const LogRecording& recording) const {
  if (drive == nullptr) return Eigen::VectorXd::Zero(recording.samples());
  const Eigen::VectorXd values = without_gaps(recording.at(drive->file, drive->name).values);
  return !has_goal() ? values : goal_factor * values - motions[0].values(recording);
}

void add_guess(ModelProposal& proposal, const std::string& subject, const std::string& value,
               const std::string& reason) {
  proposal.guesses.push_back({subject, value, reason});
}

void ask_once(ModelProposal& proposal, const OpenQuestion& question) {
  const bool is_asked = std::ranges::any_of(
      proposal.questions, [&](const OpenQuestion& each) { return each.text == question.text; });
  if (!is_asked) proposal.questions.push_back(question);
}

}  // namespace graybox
