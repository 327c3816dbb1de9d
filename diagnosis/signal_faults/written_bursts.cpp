#include "diagnosis/signal_faults/written_bursts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "diagnosis/signal_faults/sample_statistics.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr double kOfPauses = 0.98;             // quantile of the steps that is a pause
constexpr double kWithin = 0.2, kPause = 0.5;  // of that pause
constexpr double kBetween = 0.05;              // of the pauses: steps of neither size
constexpr double kFewestWithin = 0.3;          // of all steps
constexpr double kMostChanges = 0.1;           // of all, within bursts
constexpr std::size_t kFewestPauses = 12;

// This part of the median step is allowed to a logger that is late: up to it samples count as even
// ones. What is nearer to a row than that was not due.
constexpr double kNotDue = 0.1;
constexpr std::size_t kOneIn = 50;  // steps at most is so short

struct BurstSteps {
  std::size_t within = 0, between = 0;
  std::vector<double> pauses;
  double longest_burst = 0.0;
};

// By the size of a pause.
BurstSteps burst_steps(const Eigen::VectorXd& times, double pause) {
  BurstSteps result;
  double first = times(0);
  for (Index k = 1; k < times.size(); ++k) {
    const double step = times(k) - times(k - 1);
    if (step >= 0.0 && step <= kWithin * pause) {
      ++result.within;
      result.longest_burst = std::max(result.longest_burst, times(k) - first);
      continue;
    }
    first = times(k);
    if (step < 0.0) continue;
    if (step < kPause * pause) {
      ++result.between;
    } else {
      result.pauses.push_back(step);
    }
  }
  return result;
}

// Whether little of what each value changes by falls on rows that would be left out.
bool are_repetitions(const Eigen::VectorXd& times, const std::vector<Eigen::VectorXd>& values,
                     double within) {
  const std::vector<Index> kept = rows_of_samples(times, within);
  std::vector<char> is_kept(static_cast<std::size_t>(times.size()), 0);
  for (const Index row : kept) is_kept[static_cast<std::size_t>(row)] = 1;
  bool any = false;
  for (const Eigen::VectorXd& each : values) {
    double all = 0.0, again = 0.0;
    for (Index k = 1; k < each.size(); ++k) {
      const double change = std::abs(each(k) - each(k - 1));
      if (std::isnan(change)) continue;
      all += change;
      if (is_kept[static_cast<std::size_t>(k)] == 0) again += change;
    }
    if (again > kMostChanges * all) return false;
    any = any || all > 0.0;
  }
  return any;
}

// Half of the shortest usual pause; below 0 where steps are not of two sizes.
double burst_by_steps(const Eigen::VectorXd& times) {
  const Eigen::VectorXd steps = times.tail(times.size() - 1) - times.head(times.size() - 1);
  const double pause = quantile(steps, kOfPauses);
  if (!(pause > 0.0)) return -1.0;
  const BurstSteps found = burst_steps(times, pause);
  const auto pauses = static_cast<double>(found.pauses.size());
  if (found.pauses.size() < kFewestPauses ||
      static_cast<double>(found.within) < kFewestWithin * static_cast<double>(steps.size()) ||
      static_cast<double>(found.between) > kBetween * pauses) {
    return -1.0;
  }
  const double half = 0.5 * *std::ranges::min_element(found.pauses);
  return found.longest_burst < half && found.longest_burst > 0.0 ? half : -1.0;
}

// The least distance between stamps of two samples; 0 where steps below it are the log's manner.
double least_step(const Eigen::VectorXd& times) {
  std::vector<double> steps;
  for (Index k = 1; k < times.size(); ++k) {
    const double step = times(k) - times(k - 1);
    if (std::isfinite(step)) steps.push_back(step);
  }
  if (steps.empty()) return 0.0;
  const double least = kNotDue * quantile(Eigen::Map<const Eigen::VectorXd>(
                                              steps.data(), static_cast<Index>(steps.size())),
                                          0.5);
  const auto are_short = static_cast<std::size_t>(
      std::ranges::count_if(steps, [&](double step) { return step >= 0.0 && step < least; }));
  return kOneIn * are_short > steps.size() ? 0.0 : least;
}

bool hold_the_same(const std::vector<Eigen::VectorXd>& values, Index one, Index other) {
  return std::ranges::all_of(values, [&](const Eigen::VectorXd& each) {
    return each(one) == each(other) || (std::isnan(each(one)) && std::isnan(each(other)));
  });
}

}  // namespace

std::optional<WrittenBursts> find_bursts(const Eigen::VectorXd& times,
                                         const std::vector<Eigen::VectorXd>& values) {
  const std::vector<Index> timed = rows_of_samples(times, -1.0);
  if (timed.size() < kFewestPauses) return {};
  const Eigen::VectorXd finite = times(timed);
  const double within = burst_by_steps(finite);
  if (within > 0.0 && are_repetitions(times, values, within)) return WrittenBursts{within};
  const Index n = finite.size() - 1;
  const bool has_equal = (finite.tail(n).array() == finite.head(n).array()).any();
  if (has_equal && are_repetitions(times, values, 0.0)) return WrittenBursts{0.0};
  return {};
}

std::vector<Index> rows_of_samples(const Eigen::Ref<const Eigen::VectorXd>& times, double within) {
  std::vector<Index> rows;
  for (Index row = 0; row < times.size(); ++row) {
    const double here = times(row);
    if (std::isnan(here)) continue;
    const double since = rows.empty() ? -1.0 : here - times(rows.back());
    if (since >= 0.0 && since <= within) continue;
    rows.push_back(row);
  }
  return rows;
}

std::vector<Index> repeated_rows(const Eigen::VectorXd& times,
                                 const std::vector<Eigen::VectorXd>& values) {
  std::vector<Index> repeated;
  const double least = values.empty() ? 0.0 : least_step(times);
  Index before = -1, last = -1;  // the last rows that are no repetitions
  for (Index row = 0; row < times.size(); ++row) {
    if (!std::isfinite(times(row))) continue;
    const double since = last < 0 ? -1.0 : times(row) - times(last);
    if (since >= 0.0 && since < least) {
      const bool is_last_again = hold_the_same(values, row, last);
      const bool is_before_again = before >= 0 && hold_the_same(values, last, before);
      const bool is_next_again = row + 1 < times.size() && hold_the_same(values, row, row + 1);
      if (is_before_again && !is_last_again) {
        repeated.push_back(last);
        last = row;
        continue;
      }
      // What stands still repeats itself, and tells nothing of its stamps unless they are equal.
      const bool stands = is_before_again && is_last_again && is_next_again && since > 0.0;
      if ((is_last_again || is_next_again) && !stands) {
        repeated.push_back(row);
        continue;
      }
    }
    before = last;
    last = row;
  }
  return repeated;
}

std::string words_of_repeated(const std::vector<Index>& rows) {
  if (rows.empty()) return "";
  const Index first = rows.front() + 1;
  if (rows.size() == 1) {
    return fmt::format(
        "row {} holds the values of a row beside it at a stamp where no sample is due: one sample "
        "that was logged twice; it is left out",
        first);
  }
  return fmt::format(
      "{} rows hold the values of a row beside them at stamps where no sample is due (the first is "
      "row {}): samples that were logged twice; they are left out",
      rows.size(), first);
}

}  // namespace graybox
