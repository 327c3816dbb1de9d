#include "diagnosis/proposal/column_choice.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "diagnosis/recordings/late_signal.hpp"

namespace graybox {
namespace {

constexpr double kSame = 0.99999;    // correlation of a copy
constexpr double kOneMotion = 0.98;  // of a reference and what follows it
constexpr Eigen::Index kFewestSamples = 200;

int rank_of(const LogColumn& column) {
  if (column.answered) return -100;
  const ColumnWords& words = column.words;
  int rank = words.sure ? 0 : 50;
  if (words.is_reference && words.quantity != LogQuantity::kCommand) rank += 20;
  if (words.is_measured) rank -= 2;
  if (words.is_filtered) rank += 1;
  if (words.quantity == LogQuantity::kCurrent) rank += 4;
  if (words.quantity == LogQuantity::kVoltage) rank += 8;
  if (words.quantity == LogQuantity::kCommand) rank += 12;
  return rank;
}

std::vector<const LogColumn*> best_of(const std::vector<const LogColumn*>& columns) {
  int least = std::numeric_limits<int>::max();
  for (const LogColumn* column : columns) least = std::min(least, rank_of(*column));
  std::vector<const LogColumn*> best;
  for (const LogColumn* column : columns) {
    if (rank_of(*column) == least) best.push_back(column);
  }
  return best;
}

bool are_copies(const std::vector<const LogColumn*>& columns) {
  return std::ranges::all_of(columns, [&](const LogColumn* column) {
    return correlation(columns.front()->values, column->values) > kSame;
  });
}

std::string reason_of(const LogColumn& column, std::size_t of) {
  if (column.answered) return "you said so";
  if (!column.evidence.empty()) return column.evidence;
  std::string reason = column.words.sure ? "its title" : "a letter that usually means that";
  if (of > 1 && column.words.is_measured) reason += ", which says measured";
  return reason;
}

// The follower of two columns, one the reference of the other; null if neither is later.
const LogColumn* follower(const LogColumn& a, const LogColumn& b) {
  if (a.values.size() < kFewestSamples || !a.values.allFinite() || !b.values.allFinite() ||
      correlation(a.values, b.values) < kOneMotion) {
    return nullptr;
  }
  const LateFit fit = compare_late(a.values, b.values, 1.0).best();
  if (std::abs(fit.late) < 4.0 * fit.late_error) return nullptr;
  return fit.late > 0.0 ? &b : &a;
}

}  // namespace

double correlation(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  if (a.size() != b.size()) return 0.0;
  const Eigen::ArrayXd x = a.array() - a.mean(), y = b.array() - b.mean();
  const double norm = std::sqrt(x.square().sum() * y.square().sum());
  return norm > 0.0 ? (x * y).sum() / norm : 0.0;
}

std::string names_of(const std::vector<const LogColumn*>& columns) {
  std::string names;
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const char* before = k == 0 ? "" : k + 1 == columns.size() ? " or " : ", ";
    names += fmt::format("{}'{}'", before, columns[k]->name);
  }
  return names;
}

std::vector<const LogColumn*> moving_columns(const std::vector<const LogColumn*>& columns,
                                             LogQuantity quantity) {
  std::vector<const LogColumn*> moving;
  for (const LogColumn* column : columns) {
    if (column->words.quantity == quantity && column->moves()) moving.push_back(column);
  }
  return moving;
}

ColumnChoice choose_drive(const std::vector<const LogColumn*>& columns) {
  std::vector<const LogColumn*> moving;
  for (const LogColumn* column : columns) {
    if (drives(column->words.quantity) && column->moves()) moving.push_back(column);
  }
  if (moving.empty()) {
    // A step that began before the log is constant in it.
    const auto stated = std::ranges::find_if(columns, [](const LogColumn* column) {
      return drives(column->words.quantity) && column->answered;
    });
    if (stated == columns.end()) return {};
    return {*stated, "you said so; it does not change in these logs", {}};
  }
  const std::vector<const LogColumn*> best = best_of(moving);
  if (best.size() > 1 && !are_copies(best)) return {nullptr, "", best};
  return {best.front(), reason_of(*best.front(), moving.size())};
}

ColumnChoice choose_measured(const std::vector<const LogColumn*>& columns, LogQuantity quantity) {
  const std::vector<const LogColumn*> moving = moving_columns(columns, quantity);
  if (moving.empty()) return {};
  const std::vector<const LogColumn*> best = best_of(moving);
  if (best.size() == 1 || are_copies(best)) {
    return {best.front(), reason_of(*best.front(), moving.size())};
  }
  if (best.size() == 2) {
    if (const LogColumn* later = follower(*best[0], *best[1]); later != nullptr) {
      const LogColumn* earlier = later == best[0] ? best[1] : best[0];
      return {later, fmt::format("it follows '{}', a reference", earlier->name)};
    }
  }
  return {nullptr, "", best};
}

}  // namespace graybox
