// Which of several columns is meant: the drive, the position, the velocity of one mass.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "diagnosis/log_columns/log_recordings.hpp"
#include "diagnosis/proposal/proposal.hpp"

namespace graybox {

// `column` is null where there is none, or where `rivals` can't be told apart.
struct ColumnChoice {
  const LogColumn* column = nullptr;
  std::string reason;
  std::vector<const LogColumn*> rivals = {};
  std::string doubt = {};  // of the only rival, or of the column: what its samples say against it
};

// Forces before currents, voltages and commands; measured before reference; whole words before
// letters. Columns that don't move are none. Of columns that are the same the first is taken.
//
// The samples are heard, too (drive_manner.hpp), where the user said nothing of the column. What
// hardly moves and keeps its sign gives way to any other column, and alone it is a question. So is
// what keeps its sign while the axis moves both ways and does not follow the motion. A force and a
// current that disagree are rivals, and so is a column of one sign beside another that changes its
// sign.
[[nodiscard]] ColumnChoice choose_drive(const std::vector<const LogColumn*>& columns,
                                        const std::vector<LogRecording>& recordings);

// Chooses among columns of one quantity: raw before filtered, and none that is_wanted. Where two
// describe one motion without words for it, the later one is measured.
[[nodiscard]] ColumnChoice choose_measured(const std::vector<const LogColumn*>& columns,
                                           LogQuantity quantity);

// A reference by its title, of which the user said nothing: it is never what was measured.
[[nodiscard]] bool is_wanted(const LogColumn& column);

// A letter's guess that has no more than five values, or jumps between two levels as a switch does:
// it is no motion of a machine.
[[nodiscard]] bool is_guessed_switch(const LogColumn& column);

// Columns that move and whose quantity is that.
[[nodiscard]] std::vector<const LogColumn*> moving_columns(
    const std::vector<const LogColumn*>& columns, LogQuantity quantity);

[[nodiscard]] double correlation(const Eigen::VectorXd& a, const Eigen::VectorXd& b);

// ---- what is asked of drives ----

// What the user calls the goal of a servo; null where there is none.
[[nodiscard]] const LogColumn* goal_among(const std::vector<const LogColumn*>& columns);
// Which of several columns is the drive?
[[nodiscard]] OpenQuestion question_of_drives(const std::vector<const LogColumn*>& rivals,
                                              MotionKind motion);
// The only column that may be the drive, and hardly is; others whose titles say nothing may be.
[[nodiscard]] OpenQuestion question_of_doubt(const ColumnChoice& choice,
                                             const std::vector<const LogColumn*>& open);
// No column is a drive by its title, and something moves: nothing may drive, or what a title calls
// a reference of the position, or the acceleration of a motor.
[[nodiscard]] OpenQuestion question_of_no_drive(const std::vector<const LogColumn*>& columns);
// Adds references of a position, whose difference to it may be the drive.
void offer_goals(const std::vector<const LogColumn*>& columns, OpenQuestion& question);
// What drives, as the user says, and is a position's reference by its title.
void note_reference(const LogColumn& drive, std::vector<std::string>& notes);
// For messages: " (constant here: 'a', 'b')", or nothing; and what accelerations are worth.
[[nodiscard]] std::string still_columns(const std::vector<const LogColumn*>& columns);
[[nodiscard]] std::string words_of_accelerations(const std::vector<const LogColumn*>& columns);

// "'a', 'b' or 'c'".
[[nodiscard]] std::string names_of(const std::vector<const LogColumn*>& columns);

}  // namespace graybox
