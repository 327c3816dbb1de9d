#include "diagnosis/log_columns/log_time.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "diagnosis/log_columns/column_rates.hpp"
#include "diagnosis/signal_faults/sample_statistics.hpp"
#include "diagnosis/signal_faults/time_axis.hpp"
#include "problems/base/error.hpp"
#include "problems/base/units.hpp"

namespace graybox {
namespace {

// The sample before the first step that does not rise, or -1.
Eigen::Index first_fall(const Eigen::VectorXd& times) {
  for (Eigen::Index k = 0; k + 1 < times.size(); ++k) {
    if (!(times(k + 1) > times(k))) return k;
  }
  return -1;
}

// Never falls, though it doesn't rise.
bool stands_still(const Eigen::VectorXd& times) {
  const Eigen::Index n = times.size() - 1;
  return (times.tail(n).array() >= times.head(n).array()).all();
}

bool counts_samples(const Eigen::VectorXd& values) {
  return (values.tail(values.size() - 1) - values.head(values.size() - 1)).isOnes(0.0);
}

// Steps within half of their median to twice it, but for one in a hundred.
bool has_regular_steps(const Eigen::VectorXd& values) {
  const double mean =
      (values(values.size() - 1) - values(0)) / static_cast<double>(values.size() - 1);
  Eigen::Index off = 0;
  for (Eigen::Index k = 0; k + 1 < values.size(); ++k) {
    const double step = values(k + 1) - values(k);
    if (step < 0.5 * mean || step > 2.0 * mean) ++off;
  }
  return 100 * off < values.size();
}

// The steps are of one size but for the digits that are written.
bool has_equal_steps(const Eigen::VectorXd& values) {
  constexpr double kWritten = 0.02;  // of a step
  const double step =
      (values(values.size() - 1) - values(0)) / static_cast<double>(values.size() - 1);
  const Eigen::ArrayXd steps = values.tail(values.size() - 1) - values.head(values.size() - 1);
  return step > 0.0 && (steps - step).abs().maxCoeff() < kWritten * step;
}

bool is_letter_x(const LogColumn& column) {
  const std::vector<std::string> words = words_of(column.name);
  return column.words.unit.empty() && !words.empty() && words.front() == "x" &&
         (words.size() == 1 || (words.size() == 2 && words.back() == "value"));
}

// By its title: of what length is not said.
bool counts_ticks(const std::string& title) {
  const std::vector<std::string> words = words_of(title);
  return std::ranges::any_of(words, [](const std::string& word) {
    return word == "timestep" || word == "timesteps" || word == "tick" || word == "ticks" ||
           word == "cycle" || word == "cycles";
  });
}

// A counter of few bits that begins anew at its end: with its period added no fall is left, and
// these steps are as the others. `step`: the mean, in the unit of the column.
struct WrappedClock {
  double step = 0.0;
  int bits = 0;
};

std::optional<WrappedClock> wrapped_clock(const LogColumn& column) {
  constexpr std::array kBits{8, 16, 32};
  const Eigen::VectorXd counts = column.values / column.words.unit_factor;
  const bool is_whole = counts.allFinite() && (counts.array() == counts.array().round()).all();
  if (!is_whole || counts.minCoeff() < 0.0) return {};
  for (const int bits : kBits) {
    const double period = std::exp2(bits);
    if (counts.maxCoeff() >= period) continue;
    Eigen::VectorXd whole = counts;
    for (Eigen::Index k = 1; k < whole.size(); ++k) {
      whole(k) = whole(k - 1) + std::fmod(counts(k) - counts(k - 1) + period, period);
    }
    const Eigen::VectorXd steps = steps_of(whole);
    const double median = quantile(steps, 0.5);
    const Eigen::ArrayXd at_falls = (steps_of(counts).array() < 0.0).select(steps.array(), median);
    if (at_falls.minCoeff() < 0.5 * median || at_falls.maxCoeff() > 1.5 * median) continue;
    const double way = whole(whole.size() - 1) - whole(0);
    return WrappedClock{column.words.unit_factor * way / static_cast<double>(whole.size() - 1),
                        bits};
  }
  return {};
}

// A counter that wraps: its rows are as even as its steps.
void refuse_wrapped_clock(const LogRecording& recording, const LogColumn& column) {
  const std::optional<WrappedClock> clock = wrapped_clock(column);
  if (!clock) return;
  const Unit* unit = find_unit(column.words.unit);
  const double seconds = unit == nullptr || unit->base != "s" ? 0.0 : unit->factor;
  throw InputError(fmt::format(
      "{}: column '{}': the clock has {} bits and begins anew at 2^{}, {:.6g} of its unit from row "
      "to row: say --column '{}=ignore' --sample-time {}, or add 2^{} behind each fall in the file",
      recording.files[column.file].string(), column.name, clock->bits, clock->bits, clock->step,
      column.name, seconds > 0.0 ? fmt::format("{:.6g}", seconds * clock->step) : "S",
      clock->bits));
}

// Rows in the message are those of the file, from 1.
[[noreturn]] void refuse_times(const LogRecording& recording, const LogColumn& column) {
  const std::string file = recording.files[column.file].string();
  const Eigen::VectorXd& times = column.values;
  const Eigen::Index row = recording.file_row(first_fall(times)) + 1;
  if (!stands_still(times)) {
    refuse_wrapped_clock(recording, column);
    throw InputError(fmt::format(
        "{}: column '{}': times must rise, and after row {} they don't. Where another run begins "
        "there, cut the file in two behind that row and give both; else say --column '{}=ignore' "
        "and --sample-time",
        file, column.name, row, column.name));
  }
  const double mean = (times(times.size() - 1) - times(0)) / static_cast<double>(times.size() - 1);
  const Unit* unit = find_unit(column.words.unit);
  const std::string seconds = unit == nullptr ? "S" : fmt::format("{:.3g}", mean * unit->factor);
  throw InputError(fmt::format(
      "{}: column '{}': times must rise, and behind row {} they stand still, while the rows go on: "
      "the stamps are too coarse. Where the rows are even, say --column '{}=ignore' --sample-time "
      "{}; they are {:.4g} {} apart in the mean",
      file, column.name, row, column.name, seconds, mean,
      unit == nullptr ? "of its unit" : unit->name));
}

const LogColumn* time_column(const LogRecording& recording) {
  const LogColumn* falls = nullptr;
  for (const LogColumn& column : recording.columns) {
    if (column.words.quantity != LogQuantity::kTime) continue;
    if (first_fall(column.values) < 0) return &column;
    if (falls == nullptr && column.moves()) falls = &column;
  }
  if (falls != nullptr) refuse_times(recording, *falls);
  const LogColumn& first = recording.columns.front();
  // "X_Value" of LabVIEW, or x of a plot.
  const bool may_be = first.words.quantity == LogQuantity::kUnknown ||
                      (is_letter_x(first) && has_equal_steps(first.values));
  const bool is_first = may_be && !first.answered && !counts_ticks(first.name) &&
                        first_fall(first.values) < 0 && !counts_samples(first.values) &&
                        has_regular_steps(first.values);
  return is_first ? &first : nullptr;
}

// Seconds since 1970, from 2001 on.
std::string unit_of_epoch(double first) {
  constexpr std::array<std::pair<const char*, double>, 4> kUnits{
      {{"s", 1.0}, {"ms", 1e3}, {"us", 1e6}, {"ns", 1e9}}};
  for (const auto& [unit, scale] : kUnits) {
    if (first > 1e9 * scale && first < 4e9 * scale) return unit;
  }
  return "";
}

void find_unit_of_time(const LogRecording& recording, const LogColumn& column, LogTime& time) {
  time.odd_unit = column.words.odd_unit;
  if (!time.odd_unit.empty()) return;
  if (quantity_of_unit(column.words.unit) == LogQuantity::kTime) {
    time.unit = column.words.unit;
    time.why = column.answered         ? "you said so"
               : column.origin.empty() ? "its title"
                                       : column.origin;
  } else if (time.unit = unit_of_epoch(column.values(0)); !time.unit.empty()) {
    time.why = "stamps since 1970";
  } else if (time.unit = time_unit_by_rates(recording, time.median_step); !time.unit.empty()) {
    time.why = "the velocity is then the rate of the position";
  } else if (time.unit = unit_of_step(time.median_step); !time.unit.empty()) {
    time.why = fmt::format("guessed from steps of {:g}", time.median_step);
  }
}

struct UnevenStep {
  double step = 0.0;
  const char* name = "the median step";
};

// The median step, or that of the quarter of the steps that are shortest. Where a logger writes
// rows in bursts both say when it wrote: as many samples are taken as there are rows.
UnevenStep step_of_uneven(const Eigen::VectorXd& times, double median) {
  constexpr double kMuchShorter = 0.75, kBurst = 0.2;  // of the median; of a pause
  constexpr double kPauses = 0.95;                     // of the steps are no longer
  const Eigen::VectorXd steps = steps_of(times);
  const double shorter = quantile(steps, 0.25), pause = quantile(steps, kPauses);
  const bool is_shorter = shorter < kMuchShorter * median;
  if ((is_shorter ? shorter : median) < kBurst * pause) {
    return {steps.mean(), "the mean step, of rows in bursts"};
  }
  return is_shorter ? UnevenStep{shorter, "the shorter steps, of two sizes"} : UnevenStep{median};
}

double in_two_digits(double value) { return std::stod(fmt::format("{:.2g}", value)); }

}  // namespace

std::string unit_of_step(double step) {
  if (step <= 0.1) return "s";
  if (step < 2.0) return "";  // 5 Hz in s or 5 kHz in ms; samples, ms or s
  if (step < 50.0) return "ms";
  if (step < 300.0) return "";  // 10 Hz in ms or 10 kHz in us
  if (step < 1e5) return "us";
  return step < 2e5 ? "" : "ns";
}

double LogTime::seconds() const {
  const Unit* known = find_unit(unit);
  return known == nullptr ? 0.0 : known->factor;
}

std::string LogTime::question() const {
  if (odd_unit.empty()) {
    return fmt::format("Which unit has '{}', with steps of {:g}?", column, median_step);
  }
  return fmt::format(
      "{}: column '{}': '{}' is no unit of a time that is known ({}): which unit have its steps of "
      "{:g}?",
      file_name, column, odd_unit, known_units_of(LogQuantity::kTime), median_step);
}

double rounded_step(double step) {
  for (int digits = 1; digits < 8; ++digits) {
    const double rounded = std::stod(fmt::format("{:.{}g}", step, digits));
    if (std::abs(rounded - step) < 1e-4 * step) return rounded;
  }
  return step;
}

namespace {

// The stamps beside a sample time that was stated: it tells their unit where no title does. Throws
// InputError where neither their mean step nor their median is that sample time.
void agree_with_stated(const LogRecording& recording, const LogColumn& column, double stated,
                       LogTime& time) {
  const auto steps = static_cast<double>(column.values.size() - 1);
  const double mean = (column.values(column.values.size() - 1) - column.values(0)) / steps;
  const bool is_known = quantity_of_unit(column.words.unit) == LogQuantity::kTime;
  constexpr double kClose = 0.02;
  for (const Unit& unit : known_units()) {
    if (unit.base != "s" || (is_known && unit.name != column.words.unit)) continue;
    for (const double step : {mean, time.median_step}) {
      if (std::abs(unit.factor * step - stated) > kClose * stated) continue;
      if (!is_known) time.why = "by the sample time that you said";
      time.odd_unit.clear();
      time.unit = unit.name;
      time.sample_time = time.is_even ? rounded_step(unit.factor * mean) : stated;
      return;
    }
  }
  const std::string found =
      is_known ? fmt::format("{:g} s", find_unit(column.words.unit)->factor * time.median_step)
               : fmt::format("{:g} (its unit is not stated)", time.median_step);
  throw InputError(fmt::format(
      "{}: column '{}': steps of {}, and --sample-time says {:g} s: leave --sample-time out, or "
      "say --column '{}=ignore' if the stamps are wrong",
      recording.files[column.file].string(), column.name, found, stated, column.name));
}

// The sample time that was stated, or that the file states; 0: neither.
LogTime time_without_column(const LogRecording& recording, std::optional<double> stated) {
  LogTime time;
  if (!stated && !recording.sample_time) return time;
  time.sample_time = stated ? *stated : *recording.sample_time;
  time.why = stated ? "you said so" : "the file states it";
  if (stated && recording.sample_time && *stated != *recording.sample_time) {
    time.why += fmt::format(", the file says {:g} s", *recording.sample_time);
  }
  return time;
}

bool is_even(const TimeAxis& axis) {
  constexpr double kUsable = 0.09;  // of a step
  return axis.kind == TimeAxis::Kind::kEven ||
         (axis.kind == TimeAxis::Kind::kJittered && axis.jitter < kUsable);
}

// By the stamps of a column alone.
LogTime time_of_stamps(const LogRecording& recording, const LogColumn& column) {
  LogTime time;
  time.column = column.name;
  time.file = column.file;
  time.file_name = column.file_name;
  time.factor = column.words.unit_factor;
  const TimeAxis axis = examine_times(column.values);
  time.median_step = axis.step;
  time.burst = recording.burst;
  time.is_even = recording.rows.empty() && is_even(axis);
  find_unit_of_time(recording, column, time);
  if (time.is_even) {
    const auto steps = static_cast<double>(column.values.size() - 1);
    const double span = column.values(column.values.size() - 1) - column.values(0);
    time.sample_time = rounded_step(span / steps * time.seconds());
    return time;
  }
  const UnevenStep step = step_of_uneven(column.values, axis.step);
  time.of_step = step.name;
  time.sample_time = in_two_digits(step.step * time.seconds());
  return time;
}

}  // namespace

std::string likely_unit_of_step(double step) {
  if (std::string unit = unit_of_step(step); !unit.empty()) return unit;
  return step <= 1.0 ? "s" : step < 1e4 ? "ms" : "us";
}

bool rises_evenly(const Eigen::VectorXd& values) {
  return rises_as_time(values) && has_regular_steps(values);
}

bool rises_as_time(const Eigen::VectorXd& values) {
  constexpr double kFew = 0.1;
  if (values.size() < 3 || !values.allFinite() || first_fall(values) >= 0) return false;
  const Eigen::VectorXd steps = steps_of(values);
  const double median = quantile(steps, 0.5);
  return quantile(steps, kFew) > 0.5 * median && quantile(steps, 1.0 - kFew) < 2.0 * median;
}

const LogColumn* ticking_column(const LogRecording& recording) {
  const LogColumn* uneven = nullptr;
  for (const LogColumn& column : recording.columns) {
    const bool may_be = column.words.quantity == LogQuantity::kUnknown && !column.answered &&
                        column.values.size() > 2 && !column.counts_rows();
    if (!may_be) continue;
    std::vector<double> known;  // rows without a number are no ticks
    for (const double value : column.values) {
      if (std::isfinite(value)) known.push_back(value);
    }
    const Eigen::VectorXd ticks =
        Eigen::Map<const Eigen::VectorXd>(known.data(), static_cast<Eigen::Index>(known.size()));
    if (ticks.size() < 3 || first_fall(ticks) >= 0) continue;
    if (has_regular_steps(ticks)) return &column;
    if (uneven == nullptr && rises_as_time(ticks)) uneven = &column;
  }
  return uneven;
}

std::pair<double, double> steps_between_rows(const LogColumn& column) {
  constexpr double kFew = 0.01;
  std::vector<double> steps;
  for (Eigen::Index k = 1; k < column.values.size(); ++k) {
    const double step = column.values(k) - column.values(k - 1);
    if (std::isfinite(step)) steps.push_back(step);
  }
  if (steps.empty()) return {0.0, 0.0};
  const Eigen::VectorXd all =
      Eigen::Map<const Eigen::VectorXd>(steps.data(), static_cast<Eigen::Index>(steps.size()));
  return {quantile(all, kFew), quantile(all, 1.0 - kFew)};
}

LogTime find_time(const LogRecording& recording, std::optional<double> stated) {
  const LogColumn* column = time_column(recording);
  if (column == nullptr || (stated && column->words.quantity != LogQuantity::kTime)) {
    return time_without_column(recording, stated);
  }
  LogTime time = time_of_stamps(recording, *column);
  if (stated) agree_with_stated(recording, *column, *stated, time);
  return time;
}

}  // namespace graybox
