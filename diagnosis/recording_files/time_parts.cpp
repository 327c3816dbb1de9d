#include "diagnosis/recording_files/time_parts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <string>
#include <string_view>

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

// The time of the seconds in column k and its rest in another, which leaves; false: there is none.
bool join_at(std::size_t k, RecordingFile& file) {
  for (const std::string_view word : kWholes) {
    std::string_view stem, other_stem;
    if (!stem_before(file.columns[k].name, word, stem)) continue;
    for (const auto& [rest, seconds] : kRests) {
      const auto other = std::ranges::find_if(file.columns, [&](const RecordedColumn& column) {
        return stem_before(column.name, rest, other_stem) && other_stem == stem;
      });
      const std::string name = name_of_time(stem);
      if (other == file.columns.end() || file.find(name) != nullptr) continue;
      RecordedColumn& whole = file.columns[k];
      if (!belong_together(whole, *other, seconds)) continue;
      const double midnight = std::floor(whole.values(0) / kSecondsOfDay) * kSecondsOfDay;
      whole.origin = fmt::format("'{}' and '{}'", whole.name, other->name);
      whole.values = (whole.values.array() - midnight) + seconds * other->values.array();
      whole.unit = "s";
      whole.name = name;
      file.columns.erase(other);
      return true;
    }
  }
  return false;
}

}  // namespace

void join_time_parts(RecordingFile& file) {
  for (std::size_t k = 0; k < file.columns.size();) k = join_at(k, file) ? 0 : k + 1;
}

}  // namespace graybox::formats
