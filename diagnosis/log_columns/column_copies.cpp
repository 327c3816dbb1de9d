#include "diagnosis/log_columns/column_copies.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "diagnosis/log_columns/encoder_steps.hpp"
#include "diagnosis/log_columns/log_time.hpp"

namespace graybox {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::VectorXd;

constexpr Index kFewest = 10;

double deviation_of(const ArrayXd& values) {
  return std::sqrt((values - values.mean()).square().mean());
}

// What rounding to its grid leaves of a column, rms.
double rounding_of(const VectorXd& values) {
  constexpr double kFine = 0.01;   // of the deviation
  constexpr double kOfStep = 0.3;  // 1/sqrt(12), and a little more
  const double step = printed_step(values);
  return step <= kFine * deviation_of(values.array()) ? kOfStep * step : 0.0;
}

bool is_motion(const LogColumn& column) {
  const LogQuantity quantity = column.words.quantity;
  return (quantity == LogQuantity::kPosition || quantity == LogQuantity::kVelocity) &&
         !column.words.is_reference && column.moves();
}

bool is_command(const LogColumn& column) {
  const LogQuantity quantity = column.words.quantity;
  return (quantity == LogQuantity::kCommand || quantity == LogQuantity::kVoltage) && column.moves();
}

const LogColumn* same_in(const LogRecording& recording, const LogColumn& column) {
  const auto found = std::ranges::find_if(recording.columns, [&](const LogColumn& each) {
    return each.file == column.file && each.name == column.name;
  });
  return found == recording.columns.end() ? nullptr : &*found;
}

VectorXd as_recorded(const LogColumn& column) {
  return column.values / std::abs(column.words.unit_factor);
}

// The factor in the first recording in which the copy moves. None where it is no copy in another.
std::optional<double> factor_in_all(const std::vector<LogRecording>& recordings,
                                    const LogColumn& copy, const LogColumn& original) {
  std::optional<double> factor;
  for (const LogRecording& recording : recordings) {
    const LogColumn *const here = same_in(recording, copy), *const there =
                                                                same_in(recording, original);
    if (here == nullptr || there == nullptr || here->values.size() != there->values.size()) {
      return {};
    }
    if (here->values.maxCoeff() <= here->values.minCoeff()) continue;
    const auto own = factor_of_copy(as_recorded(*here), as_recorded(*there));
    if (!own) return {};
    if (!factor) factor = own;
  }
  return factor;
}

// Makes a column kOther in all recordings.
void set_aside(std::vector<LogRecording>& recordings, std::size_t file, const std::string& name,
               const std::string& why) {
  for (LogRecording& recording : recordings) {
    for (LogColumn& column : recording.columns) {
      if (column.file != file || column.name != name) continue;
      column.words.quantity = LogQuantity::kOther;
      column.evidence = why;
    }
  }
}

class CopySearch {
 public:
  CopySearch(std::vector<LogRecording>& recordings, std::vector<std::string>& notes)
      : recordings_(recordings), notes_(notes) {}

  // Unknown columns that are the motion again.
  void find_motions() {
    for (const LogColumn& copy : columns()) {
      const bool is_unknown = copy.words.quantity == LogQuantity::kUnknown && !copy.answered;
      if (!is_unknown || !copy.moves() || rises_as_time(copy.values)) continue;
      for (const LogColumn& motion : columns()) {
        const auto factor =
            is_motion(motion) ? factor_in_all(recordings_, copy, motion) : std::nullopt;
        if (!factor) continue;
        notes_.push_back(
            fmt::format("'{}' is a copy of '{}' (times {:.4g}): it is not taken for the drive",
                        copy.name, motion.name, *factor));
        set_aside(recordings_, copy.file, copy.name, fmt::format("a copy of '{}'", motion.name));
        break;
      }
    }
  }

  // Motions that are a command again.
  void find_commands() {
    for (const LogColumn& copy : columns()) {
      if (!is_motion(copy)) continue;
      for (const LogColumn& command : columns()) {
        const auto factor =
            is_command(command) ? factor_in_all(recordings_, copy, command) : std::nullopt;
        if (!factor || !(*factor > 0.0) || !(copy.answered || has_motion_beside(copy))) continue;
        notes_.push_back(fmt::format("'{}' is an affine copy of '{}' (times {:.4g}): a command{}",
                                     copy.name, command.name, *factor,
                                     copy.answered ? "? You said that it moves" : ", not used"));
        if (!copy.answered) {
          set_aside(recordings_, copy.file, copy.name,
                    fmt::format("a copy of '{}', a command", command.name));
        }
        break;
      }
    }
  }

 private:
  [[nodiscard]] const std::vector<LogColumn>& columns() const {
    return recordings_.front().columns;
  }

  // Another motion, that is none of its copies.
  [[nodiscard]] bool has_motion_beside(const LogColumn& copy) const {
    return std::ranges::any_of(columns(), [&](const LogColumn& other) {
      return &other != &copy && is_motion(other) && !factor_in_all(recordings_, other, copy);
    });
  }

  std::vector<LogRecording>& recordings_;
  std::vector<std::string>& notes_;
};

}  // namespace

std::optional<double> factor_of_copy(const VectorXd& copy, const VectorXd& original) {
  constexpr double kLeft = 1e-4;  // of the deviation
  if (copy.size() < kFewest || copy.size() != original.size()) return {};
  const ArrayXd x = original.array() - original.mean(), y = copy.array() - copy.mean();
  const double squares = x.square().sum();
  if (!(squares > 0.0) || !(y.square().sum() > 0.0)) return {};
  const double factor = (x * y).sum() / squares, left = deviation_of(y - factor * x);
  const double least = kLeft * deviation_of(y);
  if (left < least) return factor;
  const double rounding = rounding_of(copy) + std::abs(factor) * rounding_of(original);
  if (!(left < std::max(least, rounding))) return {};
  return factor;
}

void set_copies_aside(std::vector<LogRecording>& recordings, bool has_drive,
                      std::vector<std::string>& notes) {
  CopySearch search(recordings, notes);
  const bool is_driven =
      has_drive || std::ranges::any_of(recordings.front().columns, [](const LogColumn& column) {
        return column.is_goal || (drives(column.words.quantity) && column.moves());
      });
  if (!is_driven) search.find_motions();
  search.find_commands();
}

}  // namespace graybox
