#include "diagnosis/log_columns/log_recordings.hpp"

#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "diagnosis/recording_files/recording_file.hpp"
#include "diagnosis/recording_files/title_words.hpp"
#include "diagnosis/signal_faults/sample_statistics.hpp"
#include "diagnosis/signal_faults/written_bursts.hpp"
#include "diagnosis/signal_faults/wrong_stamp.hpp"
#include "problems/base/error.hpp"
#include "problems/base/units.hpp"
#include "problems/files/text_lines.hpp"

namespace graybox {
namespace {

constexpr Eigen::Index kFewestSamples = 50;
constexpr std::size_t kMostRuns = 100;  // that are made of one file

// A file by itself.
struct LogFile {
  std::filesystem::path path;
  std::vector<LogColumn> columns;
  ColumnWords words;  // of its name
  std::optional<double> sample_time;
  std::vector<std::string> remarks = {};
  std::vector<std::string> left_out = {};
  Eigen::Index rows = 0;  // of the longest column, whether or not they are enough

  [[nodiscard]] Eigen::Index samples() const { return columns.front().values.size(); }
};

// The length that most columns have; of two, the longer.
Eigen::Index usual_length(const RecordingFile& file) {
  std::map<Eigen::Index, int> counts;
  for (const RecordedColumn& column : file.columns) ++counts[column.values.size()];
  Eigen::Index best = 0;
  int most = 0;
  for (const auto& [length, count] : counts) {
    if (length < kFewestSamples || count < most) continue;
    best = length;
    most = count;
  }
  return best;
}

ColumnWords words_with_file(const RecordedColumn& column, const ColumnWords& file) {
  ColumnWords words = read_column_words(column.name, column.unit);
  if (!column.origin.empty()) {
    words.quantity = LogQuantity::kTime;
    words.sure = true;
    words.odd_unit.clear();
    return words;
  }
  if (words.quantity != LogQuantity::kUnknown || !file.sure ||
      file.quantity == LogQuantity::kOther || file.quantity == LogQuantity::kTime) {
    return words;
  }
  words.quantity = file.quantity;
  words.motion = file.motion;
  words.sure = true;
  return words;
}

// Without columns where no recording of enough samples is in it.
LogFile read_log(const std::filesystem::path& path) {
  RecordingFile file = read_recording_file(path);
  LogFile log{path, {}, read_column_words(path.stem().string(), ""), file.sample_time};
  const Eigen::Index length = usual_length(file);
  for (const RecordedColumn& column : file.columns) {
    log.rows = std::max(log.rows, column.values.size());
  }
  for (RecordedColumn& column : file.columns) {
    if (length == 0 || column.values.size() != length) continue;
    const ColumnWords words = words_with_file(column, log.words);
    LogColumn& added = log.columns.emplace_back();
    added.name = column.name;
    added.stated_unit = column.unit;
    added.words = words;
    added.values = words.unit_factor * column.values;
    log.columns.back().number = column.number;
    log.columns.back().file_name = path.filename().string();
    log.columns.back().origin = column.origin;
  }
  log.remarks = std::move(file.remarks);
  log.left_out = std::move(file.left_out);
  return log;
}

std::set<std::string> names_but_time(const LogFile& log) {
  std::set<std::string> names;
  for (const LogColumn& column : log.columns) {
    if (column.words.quantity != LogQuantity::kTime) names.insert(column.name);
  }
  return names;
}

const LogColumn* time_of(const LogFile& log) {
  const auto found = std::ranges::find_if(log.columns, [](const LogColumn& column) {
    return column.words.quantity == LogQuantity::kTime;
  });
  return found == log.columns.end() ? nullptr : &*found;
}

// Whether two files have one length and time, and other columns or, by their names, other
// quantities.
bool complement(const LogFile& a, const LogFile& b) {
  if (a.samples() != b.samples()) return false;
  const LogColumn* one = time_of(a);
  const LogColumn* other = time_of(b);
  if (one != nullptr && other != nullptr && !one->values.isApprox(other->values, 1e-6)) {
    return false;
  }
  if (a.words.sure && b.words.sure && a.words.quantity != b.words.quantity) return true;
  const std::set<std::string> names = names_but_time(a), others = names_but_time(b);
  return std::ranges::none_of(names,
                              [&](const std::string& name) { return others.contains(name); });
}

// The files' quantities where they have different ones, else numbers.
std::vector<std::string> keys_of(const std::vector<LogFile>& files) {
  if (files.size() == 1) return {""};
  std::vector<std::string> keys;
  for (const LogFile& file : files) keys.emplace_back(name_of(file.words.quantity));
  const std::set<std::string> different(keys.begin(), keys.end());
  if (different.size() < keys.size() || different.contains("unknown")) {
    for (std::size_t k = 0; k < keys.size(); ++k) keys[k] = fmt::format("file_{}", k + 1);
  }
  return keys;
}

LogRecording joined_files(std::vector<LogFile> files) {
  LogRecording recording;
  recording.keys = keys_of(files);
  for (std::size_t k = 0; k < files.size(); ++k) {
    recording.files.push_back(files[k].path);
    if (files[k].sample_time) recording.sample_time = files[k].sample_time;
    std::ranges::move(files[k].left_out, std::back_inserter(recording.left_out));
    for (LogColumn& column : files[k].columns) {
      column.file = k;
      recording.columns.push_back(std::move(column));
    }
  }
  return recording;
}

std::optional<int> number_in(const std::string& text) {
  int number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (text.empty() || error != std::errc() || end != text.data() + text.size()) return {};
  return number;
}

// The place of the column in the answer's range or array, from 1; none if it is not meant. A name
// without any such place gives 0.
std::optional<int> place_in(const ColumnAnswer& answer, const std::string& name) {
  if (answer.names == name) return 0;
  if (name.starts_with(answer.names + "[")) {
    return number_in(name.substr(answer.names.size() + 1, name.size() - answer.names.size() - 2));
  }
  const std::size_t dots = answer.names.find("..");
  if (dots != std::string::npos) {
    const std::optional<int> first = number_in(answer.names.substr(0, dots)),
                             last = number_in(answer.names.substr(dots + 2)), at = number_in(name);
    if (first && last && at && *at >= *first && *at <= *last) return *at - *first + 1;
  }
  if (answer.names.find_first_of("*?") == std::string::npos) return {};
  if (fnmatch(answer.names.c_str(), name.c_str(), 0) == 0) return 0;
  return {};
}

// By the whole title, or by that without its unit where the answer names a range, an array or a
// pattern.
std::optional<int> place_of(const ColumnAnswer& answer, const std::string& title) {
  const std::optional<int> place = place_in(answer, title);
  if (place) return place;
  const std::string name = title_and_unit(title).first;
  return name == title || name == answer.names ? std::nullopt : place_in(answer, name);
}

// Whether two titles are one but for a unit that only one has, or that is spelled otherwise.
bool are_one_title(const std::string& a, const LogColumn& column) {
  const auto [name, unit] = title_and_unit(a);
  auto [other_name, other_unit] = title_and_unit(column.name);
  if (other_unit.empty()) other_unit = column.stated_unit;
  return name == other_name &&
         (unit.empty() || other_unit.empty() || is_same_unit(unit, other_unit));
}

// The one column in this unit: "Volt" below the number of a channel.
LogColumn* column_in_unit(const std::string& unit, LogRecording& recording) {
  if (written_unit(unit).unit.empty()) return nullptr;
  LogColumn* found = nullptr;
  for (LogColumn& column : recording.columns) {
    if (column.stated_unit != unit) continue;
    if (found != nullptr) return nullptr;
    found = &column;
  }
  return found;
}

// Columns that an answer means, with their place in its range or array. By their names; where there
// is none of that name, by their titles without a unit, and then by their unit.
std::vector<std::pair<LogColumn*, int>> meant_columns(const ColumnAnswer& answer,
                                                      LogRecording& recording) {
  std::vector<std::pair<LogColumn*, int>> meant;
  for (LogColumn& column : recording.columns) {
    std::optional<int> place = place_of(answer, column.name);
    if (!place && !column.number.empty()) place = place_in(answer, column.number);
    if (!place && is_whole_title(answer.names, column.name, column.stated_unit)) place = 0;
    if (place) meant.emplace_back(&column, *place);
  }
  if (!meant.empty()) return meant;
  for (LogColumn& column : recording.columns) {
    if (are_one_title(answer.names, column)) meant.emplace_back(&column, 0);
  }
  const bool is_one = std::ranges::all_of(
      meant, [&](const auto& each) { return each.first->name == meant.front().first->name; });
  if (!is_one) return {};
  if (LogColumn* only = meant.empty() ? column_in_unit(answer.names, recording) : nullptr) {
    meant.emplace_back(only, 0);
  }
  return meant;
}

// A motion can't be in a unit of something else, "Volt=velocity": which one it has is asked.
void doubt_unit(LogColumn& column) {
  ColumnWords& words = column.words;
  const bool is_motion = words.quantity == LogQuantity::kPosition ||
                         words.quantity == LogQuantity::kVelocity ||
                         words.quantity == LogQuantity::kAcceleration;
  if (!is_motion || words.unit.empty() || quantity_of_unit(words.unit) == words.quantity) return;
  words.odd_unit = words.unit;
  words.unit.clear();
  words.motion = MotionKind::kOpen;
  column.values /= words.unit_factor;
  words.unit_factor = 1.0;
}

void apply(const ColumnAnswer& answer, LogRecording& recording) {
  const std::vector<std::pair<LogColumn*, int>> meant = meant_columns(answer, recording);
  for (const auto& [column, place] : meant) {
    column->answered = true;
    column->is_goal = answer.is_goal;
    column->joint = answer.joint;
    column->words.quantity = answer.quantity;
    column->words.sure = true;
    column->words.is_reference = answer.is_goal;
    if (place > 0) column->words.index = place;
    if (!answer.unit.empty()) {
      column->words.odd_unit.clear();
      column->values *= answer.unit_factor / column->words.unit_factor;
      column->words.unit_factor = answer.unit_factor;
      column->words.unit = answer.unit;
      column->words.written = answer.written;
      column->words.motion = motion_of_unit(answer.unit);
    } else {
      doubt_unit(*column);
    }
  }
  const bool is_left_out = answer.quantity == LogQuantity::kOther &&
                           std::ranges::count(recording.left_out, answer.names) > 0;
  if (!meant.empty() || is_left_out) return;
  std::string names;
  for (const LogColumn& column : recording.columns) {
    names += (names.empty() ? "'" : ", '") + column.name + "'";
  }
  constexpr std::size_t kMost = 400;
  if (names.size() > kMost) names = names.substr(0, kMost) + "...";
  throw InputError(fmt::format("--column {}=...: {} has no such column; there are {}", answer.names,
                               recording.files.front().string(), names));
}

// ---- rows that are no samples -------------------------------------------------------------------

// What was measured: positions, or else velocities, or else all that is no time and moves.
std::vector<Eigen::VectorXd> measured_in(const LogRecording& recording) {
  for (const LogQuantity quantity :
       {LogQuantity::kPosition, LogQuantity::kVelocity, LogQuantity::kUnknown}) {
    std::vector<Eigen::VectorXd> values;
    for (const LogColumn& column : recording.columns) {
      if (column.words.quantity == quantity && column.moves()) values.push_back(column.values);
    }
    if (!values.empty()) return values;
  }
  return {};
}

// All that was logged but clocks and counters.
std::vector<Eigen::VectorXd> values_of_rows(const LogRecording& recording) {
  std::vector<Eigen::VectorXd> values;
  for (const LogColumn& column : recording.columns) {
    const bool is_logged =
        column.words.quantity != LogQuantity::kTime && column.words.quantity != LogQuantity::kOther;
    if (is_logged && column.moves() && !column.counts_rows()) values.push_back(column.values);
  }
  return values;
}

// Rows without a time, and those that a logger wrote again, leave. Throws InputError where too few
// are left.
void leave_out_rows(LogRecording& recording, std::vector<std::string>* remarks) {
  const auto clock = std::ranges::find_if(recording.columns, [](const LogColumn& column) {
    return column.words.quantity == LogQuantity::kTime && column.moves();
  });
  if (clock == recording.columns.end()) return;
  Eigen::VectorXd times = clock->values;
  const auto missing = static_cast<Eigen::Index>(times.array().isNaN().count());
  const std::vector<Eigen::Index> again = repeated_rows(times, values_of_rows(recording));
  for (const Eigen::Index row : again) times(row) = std::numeric_limits<double>::quiet_NaN();
  if (const auto bursts = find_bursts(times, measured_in(recording))) {
    recording.burst = bursts->within;
  }
  std::vector<Eigen::Index> rows = rows_of_samples(times, recording.burst);
  const auto all = times.size(), kept = static_cast<Eigen::Index>(rows.size());
  if (kept == all) return;
  const std::string file = recording.files[clock->file].string();
  std::string why = missing > 0 ? fmt::format("{} rows without a time are left out", missing) : "";
  if (!again.empty()) why += (why.empty() ? "" : "; ") + words_of_repeated(again);
  if (recording.burst >= 0.0) {
    why += fmt::format(
        "{}{} of {} rows are samples: the others {}", why.empty() ? "" : "; ", kept, all,
        recording.burst > 0.0
            ? fmt::format("follow one within {:.3g} {} of '{}'", recording.burst,
                          clock->words.unit.empty() ? "units" : clock->words.unit, clock->name)
            : fmt::format("repeat the '{}' of one", clock->name));
  }
  if (kept < kFewestSamples) {
    throw InputError(
        fmt::format("{}: {}; {} are left, and a recording needs {} samples at least: give a longer "
                    "log",
                    file, why, kept, kFewestSamples));
  }
  for (LogColumn& column : recording.columns) column.values = column.values(rows).eval();
  recording.rows = std::move(rows);
  recording.dropped_rows += all - kept;
  if (remarks != nullptr) {
    remarks->push_back(
        fmt::format("{}: {}", recording.files[clock->file].filename().string(), why));
  }
}

// Single stamps that the clock contradicts before and behind them.
void mend_clock(LogRecording& recording, std::vector<std::string>* remarks) {
  for (LogColumn& column : recording.columns) {
    if (column.words.quantity != LogQuantity::kTime) continue;
    const std::vector<WrongStamp> wrong = mend_stamps(column.values);
    if (wrong.empty() || remarks == nullptr) continue;
    remarks->push_back(fmt::format(
        "{}: '{}' of row {}: {}", recording.files[column.file].filename().string(), column.name,
        recording.file_row(wrong.front().sample) + 1, words_of_stamps(wrong)));
  }
}

// Rows behind which the clock begins anew: it falls by many steps. Empty where it rises all the
// way, and where it stands still or falls otherwise.
std::vector<Eigen::Index> restarts_of(const Eigen::VectorXd& times) {
  constexpr double kFarBack = 20.0;  // median steps
  if (times.size() < 2 || !times.allFinite()) return {};
  const Eigen::VectorXd steps = times.tail(times.size() - 1) - times.head(times.size() - 1);
  const double far_back = -kFarBack * std::abs(quantile(steps, 0.5));
  std::vector<Eigen::Index> restarts;
  for (Eigen::Index k = 0; k < steps.size(); ++k) {
    if (steps(k) > 0.0) continue;
    if (!(steps(k) < far_back)) return {};
    restarts.push_back(k);
  }
  return restarts;
}

// The clock that begins anew; null where there is none, or where another one rises all the way.
const LogColumn* restarting_clock(const LogRecording& recording) {
  const LogColumn* found = nullptr;
  for (const LogColumn& column : recording.columns) {
    if (column.words.quantity != LogQuantity::kTime || column.values.size() < 2) continue;
    const Eigen::Index n = column.values.size() - 1;
    if ((column.values.tail(n).array() > column.values.head(n).array()).all()) return nullptr;
    if (found == nullptr && !restarts_of(column.values).empty()) found = &column;
  }
  return found;
}

LogRecording part_of(const LogRecording& whole, Eigen::Index first, Eigen::Index last) {
  LogRecording part = whole;
  part.is_part = true;
  part.first_row = whole.file_row(first);
  if (!whole.rows.empty()) {
    part.rows.assign(whole.rows.begin() + first, whole.rows.begin() + last + 1);
  }
  for (LogColumn& column : part.columns) {
    column.values = column.values.segment(first, last - first + 1).eval();
  }
  return part;
}

struct RowSpan {
  Eigen::Index first = 0, last = 0;
  [[nodiscard]] Eigen::Index length() const { return last - first + 1; }
};

// Runs with enough samples: the longest of them where they are many, in their order.
std::vector<RowSpan> runs_between(const std::vector<Eigen::Index>& restarts, Eigen::Index samples,
                                  std::size_t& left_out) {
  std::vector<RowSpan> runs;
  Eigen::Index first = 0;
  std::vector<Eigen::Index> ends = restarts;
  ends.push_back(samples - 1);
  for (const Eigen::Index last : ends) {
    if (last - first + 1 >= kFewestSamples) runs.push_back({first, last});
    first = last + 1;
  }
  left_out = runs.size() > kMostRuns ? runs.size() - kMostRuns : 0;
  if (left_out > 0) {
    std::ranges::stable_sort(runs, std::ranges::greater(), &RowSpan::length);
    runs.resize(kMostRuns);
    std::ranges::sort(runs, {}, &RowSpan::first);
  }
  return runs;
}

// A recording in which the clock begins anew is several; those with too few samples leave.
void split_at_restarts(std::vector<LogRecording>& recordings, std::vector<std::string>* remarks) {
  std::vector<LogRecording> all;
  for (LogRecording& recording : recordings) {
    const LogColumn* clock = restarting_clock(recording);
    std::vector<LogRecording> parts;
    std::size_t left_out = 0;
    if (clock != nullptr) {
      for (const RowSpan& run :
           runs_between(restarts_of(clock->values), recording.samples(), left_out)) {
        parts.push_back(part_of(recording, run.first, run.last));
      }
    }
    if (parts.size() < 2) {
      all.push_back(std::move(recording));
      continue;
    }
    Eigen::Index used = 0;
    for (const LogRecording& part : parts) used += part.samples();
    const Eigen::Index dropped = recording.samples() - used;
    for (LogRecording& part : parts) part.dropped_rows = 0;
    parts.front().dropped_rows = recording.dropped_rows + dropped;
    if (remarks != nullptr) {
      std::string rows;
      for (const LogRecording& part : parts) {
        rows += fmt::format("{}{} to {}", rows.empty() ? "" : ", ", part.file_row(0) + 1,
                            part.file_row(part.samples() - 1) + 1);
      }
      remarks->push_back(fmt::format(
          "{}: '{}' begins anew within the file: {} recordings{}, rows {}{}",
          recording.files[clock->file].filename().string(), clock->name, parts.size(),
          left_out == 0 ? "" : fmt::format(", the longest of {}", parts.size() + left_out), rows,
          dropped == 0 ? ""
                       : fmt::format("; {} other rows are in runs that are too short", dropped)));
    }
    std::ranges::move(parts, std::back_inserter(all));
  }
  recordings = std::move(all);
}

// A drive may be constant in each log and another in the next: steps from rest.
void mark_differences(std::vector<LogRecording>& recordings) {
  const auto is_steady = [](const LogColumn& column) {
    return column.values.size() > 0 && column.values.allFinite() && !column.moves();
  };
  for (LogRecording& recording : recordings) {
    for (LogColumn& column : recording.columns) {
      if (!is_steady(column)) continue;
      for (const LogRecording& other : recordings) {
        const auto same = std::ranges::find_if(other.columns, [&](const LogColumn& each) {
          return each.file == column.file && each.name == column.name;
        });
        if (same == other.columns.end() || same->values.size() == 0) continue;
        column.differs_between_logs |= same->values(0) != column.values(0);
      }
    }
  }
}

// Equal bit for bit, gaps included.
bool is_same_value(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); }

// Whether the shorter column is the part of the longer that begins at `from`.
bool is_part(const Eigen::VectorXd& shorter, const Eigen::VectorXd& longer, Eigen::Index from) {
  constexpr Eigen::Index kProbes = 16;  // a look at a few values first: most places fail there
  const Eigen::Index count = shorter.size();
  for (Eigen::Index k = 0; k < kProbes; ++k) {
    const Eigen::Index at = k * (count - 1) / (kProbes - 1);
    if (!is_same_value(shorter(at), longer(from + at))) return false;
  }
  for (Eigen::Index k = 0; k < count; ++k) {
    if (!is_same_value(shorter(k), longer(from + k))) return false;
  }
  return true;
}

// Whether all columns but the time are those of the other log, from one row on.
bool is_contained(const LogFile& shorter, const LogFile& longer) {
  const std::set<std::string> names = names_but_time(shorter);
  if (names.empty() || names != names_but_time(longer)) return false;
  const bool are_other_quantities =
      shorter.words.sure && longer.words.sure && shorter.words.quantity != longer.words.quantity;
  if (are_other_quantities) return false;  // by the names of the files
  std::vector<std::pair<const Eigen::VectorXd*, const Eigen::VectorXd*>> pairs;
  for (const LogColumn& column : shorter.columns) {
    if (!names.contains(column.name)) continue;
    const auto same = std::ranges::find(longer.columns, column.name, &LogColumn::name);
    pairs.emplace_back(&column.values, &same->values);
  }
  // Those that move tell places apart.
  std::ranges::sort(pairs, {}, [](const auto& pair) {
    return (pair.first->array() == (*pair.first)(0)).all() ? 1 : 0;
  });
  for (Eigen::Index from = 0; from <= longer.samples() - shorter.samples(); ++from) {
    if (std::ranges::all_of(
            pairs, [&](const auto& pair) { return is_part(*pair.first, *pair.second, from); })) {
      return true;
    }
  }
  return false;
}

// Logs that another one holds leave; of equal ones the first stays.
void leave_out_copies(std::vector<LogFile>& logs, std::vector<std::string>* remarks) {
  const auto name = [](const LogFile& log) { return log.path.filename().string(); };
  const auto original_of = [&logs](std::size_t k) -> const LogFile* {
    for (std::size_t j = 0; j < logs.size(); ++j) {
      const bool comes_first = logs[j].samples() > logs[k].samples() ||
                               (logs[j].samples() == logs[k].samples() && j < k);
      if (comes_first && is_contained(logs[k], logs[j])) return &logs[j];
    }
    return nullptr;
  };
  std::vector<std::size_t> kept;
  for (std::size_t k = 0; k < logs.size(); ++k) {
    const LogFile* original = original_of(k);
    if (original == nullptr) {
      kept.push_back(k);
    } else if (remarks != nullptr) {
      remarks->push_back(
          fmt::format("{} is left out: it holds the same values as {}{}, and would check nothing",
                      name(logs[k]), original->samples() > logs[k].samples() ? "a part of " : "",
                      name(*original)));
    }
  }
  std::vector<LogFile> different;
  for (const std::size_t k : kept) different.push_back(std::move(logs[k]));
  logs = std::move(different);
}

// The files with enough samples. Throws InputError where there is none.
std::vector<LogFile> long_logs(const std::vector<std::filesystem::path>& files,
                               std::vector<std::string>* remarks) {
  std::vector<LogFile> logs;
  std::string first_short;
  for (const std::filesystem::path& path : files) {
    LogFile log = read_log(path);
    if (remarks != nullptr) {
      remarks->insert(remarks->end(), log.remarks.begin(), log.remarks.end());
    }
    if (!log.columns.empty()) {
      logs.push_back(std::move(log));
      continue;
    }
    const std::string too_few = fmt::format("{} row{}, and a recording needs {} samples at least",
                                            log.rows, log.rows == 1 ? "" : "s", kFewestSamples);
    if (first_short.empty()) first_short = fmt::format("{}: {}", path.string(), too_few);
    if (remarks == nullptr) continue;
    remarks->push_back(fmt::format("{} is left out: {}", path.filename().string(), too_few));
  }
  if (logs.empty()) {
    throw InputError(
        first_short +
        ". Log longer, or write model and campaign by hand for graybox fit, which takes less. A "
        "table of steady states, a row for each, is no recording over time: fit a curve to it");
  }
  leave_out_copies(logs, remarks);
  return logs;
}

// As --column has it; kUnknown for what is none. A word that makes a title a drive is one, too.
LogQuantity quantity_named(const std::string& word) {
  constexpr std::array<std::pair<const char*, LogQuantity>, 13> kNames{{
      {"time", LogQuantity::kTime},
      {"position", LogQuantity::kPosition},
      {"velocity", LogQuantity::kVelocity},
      {"acceleration", LogQuantity::kAcceleration},
      {"force", LogQuantity::kForce},
      {"torque", LogQuantity::kForce},
      {"effort", LogQuantity::kForce},
      {"current", LogQuantity::kCurrent},
      {"voltage", LogQuantity::kVoltage},
      {"command", LogQuantity::kCommand},
      {"ignore", LogQuantity::kOther},
      {"reference", LogQuantity::kOther},
      {"goal", LogQuantity::kPosition},
  }};
  for (const auto& [name, quantity] : kNames) {
    if (word == name) return quantity;
  }
  if (words_of(word).size() != 1) return LogQuantity::kUnknown;
  const ColumnWords title = read_column_words(word, "");
  const bool is_drive = title.sure && title.unit.empty() && drives(title.quantity);
  return is_drive ? title.quantity : LogQuantity::kUnknown;
}

}  // namespace

bool LogColumn::moves() const {
  if (differs_between_logs) return true;
  double lowest = INFINITY, highest = -INFINITY;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    lowest = std::min(lowest, value);
    highest = std::max(highest, value);
  }
  return highest > lowest;
}

bool LogColumn::is_zero() const {
  return !moves() && std::ranges::find(values, 0.0) != values.end();
}

bool LogColumn::counts_rows() const {
  if (values.size() < 3 || !values.allFinite()) return false;
  const double step = values(1) - values(0);
  if (!(step > 0.0) || step != std::round(step)) return false;
  const Eigen::Index n = values.size() - 1;
  return ((values.tail(n) - values.head(n)).array() == step).all();
}

bool LogColumn::has_gaps() const { return !values.allFinite(); }

std::string LogRecording::label() const {
  const std::string name = files.front().filename().string();
  if (!is_part) return name;
  return fmt::format("{}, rows {} to {}", name, file_row(0) + 1, file_row(samples() - 1) + 1);
}

const LogColumn& LogRecording::at(std::size_t file, const std::string& name) const {
  for (const LogColumn& column : columns) {
    if (column.file == file && column.name == name) return column;
  }
  throw InputError(
      fmt::format("{}: has no column '{}', which an earlier log has; give logs with "
                  "the same columns",
                  files[std::min(file, files.size() - 1)].string(), name));
}

ColumnAnswer column_answer(const std::string& text) {
  const std::size_t equals = text.rfind('=');
  if (equals == std::string::npos || equals == 0) {
    throw InputError(
        fmt::format("--column {}: write NAME=QUANTITY, as in 'enc=position:deg'", text));
  }
  ColumnAnswer answer;
  answer.names = text.substr(0, equals);
  std::string rest = text.substr(equals + 1);
  if (const std::size_t at = rest.find('@'); at != std::string::npos) {
    answer.joint = rest.substr(at + 1);
    rest.resize(at);
  }
  if (const std::size_t colon = rest.find(':'); colon != std::string::npos) {
    const std::string_view text_of_unit = trimmed(std::string_view(rest).substr(colon + 1));
    const bool is_reversed = text_of_unit.starts_with('-') && text_of_unit.size() > 1;
    const WrittenUnit written = unit_of_quantity(text_of_unit.substr(is_reversed ? 1 : 0),
                                                 quantity_named(rest.substr(0, colon)));
    answer.unit = written.unit;
    answer.written = text_of_unit;
    answer.unit_factor = is_reversed ? -written.factor : written.factor;
    if (answer.unit.empty()) {
      throw InputError(fmt::format("--column {}: unknown unit '{}'; known: {}", text,
                                   rest.substr(colon + 1), known_unit_names()));
    }
    rest.resize(colon);
  }
  answer.quantity = quantity_named(rest);
  answer.is_goal = rest == "goal";
  if (answer.quantity == LogQuantity::kUnknown) {
    throw InputError(
        fmt::format("--column {}: unknown quantity '{}'; choose time, position, velocity, "
                    "acceleration, force, torque, current, voltage, command (pwm, duty), goal or "
                    "ignore",
                    text, rest));
  }
  const LogQuantity of_unit = quantity_of_unit(answer.unit);
  if (of_unit != LogQuantity::kUnknown && of_unit != answer.quantity &&
      answer.quantity != LogQuantity::kOther && answer.quantity != LogQuantity::kCommand) {
    const bool is_rate_of_counts =
        answer.unit == "counts" && answer.quantity == LogQuantity::kVelocity;
    throw InputError(fmt::format(
        "--column {}: {} is no unit of a {}: it has {}{}", text, answer.unit, rest,
        known_units_of(answer.quantity),
        is_rate_of_counts ? fmt::format(". At 2000 counts a turn, say, a count a second is one of "
                                        "'{}=velocity:0.0005 turn/s'",
                                        answer.names)
                          : ""));
  }
  return answer;
}

std::vector<LogRecording> read_logs(const std::vector<std::filesystem::path>& files,
                                    const std::vector<ColumnAnswer>& answers,
                                    std::vector<std::string>* remarks) {
  std::vector<std::vector<LogFile>> groups;
  for (LogFile& log : long_logs(files, remarks)) {
    const bool joins =
        !groups.empty() && std::ranges::all_of(groups.back(), [&](const LogFile& each) {
          return complement(each, log);
        });
    if (!joins) groups.emplace_back();
    groups.back().push_back(std::move(log));
  }
  std::vector<LogRecording> recordings;
  for (std::vector<LogFile>& group : groups) recordings.push_back(joined_files(std::move(group)));
  for (LogRecording& recording : recordings) {
    for (const ColumnAnswer& answer : answers) apply(answer, recording);
    mend_clock(recording, remarks);
    leave_out_rows(recording, remarks);
  }
  split_at_restarts(recordings, remarks);
  mark_differences(recordings);
  return recordings;
}

}  // namespace graybox
