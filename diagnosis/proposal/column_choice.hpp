// Which of several columns is meant: the drive, the position, the velocity of one mass.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "diagnosis/proposal/log_recordings.hpp"

namespace graybox {

// `column` is null where there is none, or where `rivals` can't be told apart.
struct ColumnChoice {
  const LogColumn* column = nullptr;
  std::string reason;
  std::vector<const LogColumn*> rivals = {};
};

// Forces before currents, voltages and commands; measured before reference; whole words before
// letters. Columns that don't move are none. Of columns that are the same the first is taken.
[[nodiscard]] ColumnChoice choose_drive(const std::vector<const LogColumn*>& columns);

// Chooses among columns of one quantity: measured before reference, raw before filtered. Where two
// describe one motion without such words, the later one is measured.
[[nodiscard]] ColumnChoice choose_measured(const std::vector<const LogColumn*>& columns,
                                           LogQuantity quantity);

// Columns that move and whose quantity is that.
[[nodiscard]] std::vector<const LogColumn*> moving_columns(
    const std::vector<const LogColumn*>& columns, LogQuantity quantity);

[[nodiscard]] double correlation(const Eigen::VectorXd& a, const Eigen::VectorXd& b);

// "'a', 'b' or 'c'".
[[nodiscard]] std::string names_of(const std::vector<const LogColumn*>& columns);

}  // namespace graybox
