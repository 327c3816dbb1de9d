#include "diagnosis/recording_files/time_parts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

namespace graybox::formats {
namespace {

constexpr double kSecondsOfDay = 86400.0;

struct PartWord {
  std::string_view word;
  double seconds;  // that one is
};
constexpr auto kWholes = std::to_array<std::string_view>({"sec", "secs", "seconds"});
constexpr auto kRests = std::to_array<PartWord>({{"nanosec", 1e-9},
                                                 {"nanosecs", 1e-9},
                                                 {"nanoseconds", 1e-9},
                                                 {"nsec", 1e-9},
                                                 {"nsecs", 1e-9},
                                                 {"usec", 1e-6},
                                                 {"usecs", 1e-6}});

// "header.stamp." of "header.stamp.sec"; false where the name does not end in that word.
bool stem_before(std::string_view name, std::string_view word, std::string_view& stem) {
  if (!name.ends_with(word)) return false;
  stem = name.substr(0, name.size() - word.size());
  return stem.empty() || std::isalnum(static_cast<unsigned char>(stem.back())) == 0;
}

bool holds_whole_numbers(const Eigen::VectorXd& values) {
  return values.allFinite() && (values.array() == values.array().round()).all();
}

// Both columns are parts of one time: whole seconds, and less than a second.
bool belong_together(const RecordedColumn& whole, const RecordedColumn& rest, double seconds) {
  return whole.values.size() == rest.values.size() && whole.values.size() > 0 &&
         holds_whole_numbers(whole.values) && holds_whole_numbers(rest.values) &&
         (rest.values.array() >= 0.0).all() && (rest.values.array() * seconds < 1.0).all();
}

// "header.stamp" of "header.stamp.".
std::string name_of_time(std::string_view stem) {
  while (!stem.empty() && std::isalnum(static_cast<unsigned char>(stem.back())) == 0) {
    stem.remove_suffix(1);
  }
  return stem.empty() ? "time" : std::string(stem);
}

// Columns by name and by number, so that a file of thousands is looked through once.
class ColumnNames {
 public:
  explicit ColumnNames(const RecordingFile& file) {
    for (std::size_t k = 0; k < file.columns.size(); ++k) {
      by_name_.try_emplace(file.columns[k].name, k);
      numbers_.insert(file.columns[k].number);
    }
    numbers_.erase("");
  }
  [[nodiscard]] bool contains(const std::string& name) const {
    return by_name_.contains(name) || numbers_.contains(name);
  }
  [[nodiscard]] std::optional<std::size_t> find(const std::string& name) const {
    const auto found = by_name_.find(name);
    return found == by_name_.end() ? std::nullopt : std::optional(found->second);
  }
  void rename(const std::string& from, const std::string& to, std::size_t column) {
    by_name_.erase(from);
    by_name_.emplace(to, column);
  }
  void erase(const std::string& name) { by_name_.erase(name); }

 private:
  std::unordered_map<std::string, std::size_t> by_name_;
  std::unordered_set<std::string> numbers_;
};

// The column of the rest that belongs to the seconds in column k, which then hold both.
std::optional<std::size_t> join_at(std::size_t k, RecordingFile& file, ColumnNames& names) {
  RecordedColumn& whole = file.columns[k];
  for (const std::string_view word : kWholes) {
    std::string_view stem;
    if (!stem_before(whole.name, word, stem)) continue;
    const std::string name = name_of_time(stem);
    if (names.contains(name)) continue;
    for (const auto& [rest, seconds] : kRests) {
      const std::optional<std::size_t> other = names.find(std::string(stem).append(rest));
      if (!other || !belong_together(whole, file.columns[*other], seconds)) continue;
      const RecordedColumn& part = file.columns[*other];
      const double midnight = std::floor(whole.values(0) / kSecondsOfDay) * kSecondsOfDay;
      whole.origin = fmt::format("'{}' and '{}'", whole.name, part.name);
      whole.values = (whole.values.array() - midnight) + seconds * part.values.array();
      whole.unit = "s";
      names.rename(whole.name, name, k);
      names.erase(part.name);
      whole.name = name;
      return other;
    }
  }
  return std::nullopt;
}

}  // namespace

void join_time_parts(RecordingFile& file) {
  ColumnNames names(file);
  std::vector<bool> is_joined(file.columns.size(), false);
  for (std::size_t k = 0; k < file.columns.size(); ++k) {
    if (is_joined[k]) continue;
    if (const std::optional<std::size_t> other = join_at(k, file, names)) is_joined[*other] = true;
  }
  std::vector<RecordedColumn> kept;
  for (std::size_t k = 0; k < file.columns.size(); ++k) {
    if (!is_joined[k]) kept.push_back(std::move(file.columns[k]));
  }
  file.columns = std::move(kept);
}

}  // namespace graybox::formats
