// One moving thing of a log, a mass or a joint: its position and velocity, their units, and which
// of the two a model should be held against.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/log_columns/column_rates.hpp"
#include "diagnosis/log_columns/even_samples.hpp"
#include "diagnosis/log_columns/log_time.hpp"
#include "diagnosis/proposal/column_choice.hpp"
#include "diagnosis/proposal/proposal.hpp"

namespace graybox {

struct MotionChoice {
  const LogColumn* column = nullptr;  // what the model is held against; null: open
  bool is_velocity = false;
  std::string unit;     // recorded
  std::string gain;     // of counts: "{value: ..., unit: rad/counts}"
  double factor = 1.0;  // to SI, the gain included
  bool is_wrapped = false;
  std::string wrap_period;  // for the campaign, where it is no turn of the recorded unit
  std::string reason;       // of the column
  std::string unit_reason;
  std::vector<OpenQuestion> questions = {};
  std::vector<std::string> notes = {};  // of the other column: late, not the rate, ...
  const LogColumn* other = nullptr;     // the velocity beside a position
  double rate = 0.0;                    // of the position over `other`; 0: they were not compared

  // The motion of one of the recordings in SI, without wraps and gaps.
  [[nodiscard]] Eigen::VectorXd values(const LogRecording& recording) const;
};

struct MotionContext {
  double step = 0.0;      // s between samples; 0: not known
  EvenSamples even = {};  // of uneven times
  MotionKind motion = MotionKind::kOpen;
  std::optional<double> counts_per_turn;
  bool step_is_stated = false;       // by the user, beside no column of times
  const LogTime* time = nullptr;     // its column and unit
  const LogColumn* drive = nullptr;  // of one mass, to tell which of two axes it moves
};

// The question which unit a column has whose title states an odd one.
[[nodiscard]] OpenQuestion question_of_unit(const LogColumn& column, const std::string& quantity,
                                            const std::vector<std::string>& units);

// Chooses among columns of one thing. An open `column` without questions means that there is none.
[[nodiscard]] MotionChoice choose_motion(const std::vector<const LogColumn*>& columns,
                                         const MotionContext& context);

// The question which of these is meant, with an answer for each.
[[nodiscard]] OpenQuestion which_of(const std::vector<const LogColumn*>& columns,
                                    const std::string& what);

}  // namespace graybox
