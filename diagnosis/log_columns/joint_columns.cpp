#include "diagnosis/log_columns/joint_columns.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <ranges>
#include <set>
#include <utility>

#include "problems/base/error.hpp"

namespace graybox {
namespace {

using Words = std::vector<std::string>;

Words words_of_joint(const std::string& name) {
  Words words = words_of(name);
  const Words all = words;
  std::erase(words, "joint");
  return words.empty() ? all : words;
}

bool are_digits(const std::string& word) {
  return std::ranges::all_of(word, [](unsigned char c) { return std::isdigit(c) != 0; });
}

bool contains(const Words& title, const Words& part) {
  return std::ranges::search(title, part).begin() != title.end();
}

// The joint whose name has the most words there; numbers alone name none.
std::optional<std::size_t> joint_in_words(const Words& title,
                                          const std::vector<UrdfJoint>& joints) {
  std::optional<std::size_t> best;
  std::size_t most = 0;
  for (std::size_t k = 0; k < joints.size(); ++k) {
    const Words words = words_of_joint(joints[k].name);
    if (std::ranges::all_of(words, are_digits) || !contains(title, words)) continue;
    if (words.size() <= most) continue;
    most = words.size();
    best = k;
  }
  return best;
}

// The joint that the user named, by its whole name or by its words.
std::size_t joint_as_said(const LogColumn& column, const std::vector<UrdfJoint>& joints) {
  const Words said = words_of(column.joint);
  const auto is_it = [&](const UrdfJoint& joint) { return words_of(joint.name) == said; };
  auto named = std::ranges::find(joints, column.joint, &UrdfJoint::name);
  if (named == joints.end()) named = std::ranges::find_if(joints, is_it);
  if (named != joints.end()) return static_cast<std::size_t>(named - joints.begin());
  if (const std::optional<std::size_t> joint = joint_in_words(said, joints)) return *joint;
  std::string names;
  for (const UrdfJoint& joint : joints) {
    if (joint.moves) names += (names.empty() ? "" : ", ") + joint.name;
  }
  throw InputError(fmt::format("--column '{}=...@{}': the URDF has no joint '{}'; there are {}",
                               column.name, column.joint, column.joint, names));
}

std::optional<std::size_t> joint_by_name(const LogColumn& column,
                                         const std::vector<UrdfJoint>& joints) {
  if (!column.joint.empty()) return joint_as_said(column, joints);
  return joint_in_words(words_of(column.name), joints);
}

// The title without its unit, and without its joint or number.
std::string pattern_of(const LogColumn& column, const std::string& joint) {
  std::string pattern = title_and_unit(column.name).first;
  if (!joint.empty()) {
    if (const std::size_t at = pattern.find(joint); at != std::string::npos) {
      return pattern.replace(at, joint.size(), "*");
    }
  }
  const std::size_t bracket = pattern.rfind('[');
  if (bracket != std::string::npos && bracket > 0) return pattern.substr(0, bracket);
  const auto is_digit = [](unsigned char c) { return std::isdigit(c) != 0; };
  const auto first = std::ranges::find_if(pattern, is_digit);
  const auto last = std::find_if_not(first, pattern.end(), is_digit);
  return std::string(pattern.begin(), first) + "*" + std::string(last, pattern.end());
}

// Positions are read in one unit; each drive has its own.
bool have_one_unit(const ColumnFamily& family, const LogColumn& column) {
  return drives(family.quantity) || family.columns.begin()->second->words.unit == column.words.unit;
}

// Joints that move, in the URDF's order, for columns that have numbers.
std::vector<std::size_t> moving_joints(const std::vector<UrdfJoint>& joints) {
  std::vector<std::size_t> moving;
  for (std::size_t k = 0; k < joints.size(); ++k) {
    if (joints[k].moves) moving.push_back(k);
  }
  return moving;
}

// Whether numbers begin at 0, and whether there are as many as joints.
struct Numbering {
  int first = 1;
  bool fits = false;
};
Numbering numbering_of(const LogRecording& recording, std::size_t joints) {
  std::set<int> numbers;
  for (const LogColumn& column : recording.columns) {
    const bool is_signal = drives(column.words.quantity) ||
                           column.words.quantity == LogQuantity::kPosition ||
                           column.words.quantity == LogQuantity::kVelocity;
    if (is_signal && column.words.index) numbers.insert(*column.words.index);
  }
  if (numbers.empty()) return {};
  const int first = *numbers.begin();
  const auto count = static_cast<std::size_t>(*numbers.rbegin() - first + 1);
  return {first, first <= 1 && count <= joints};
}

bool is_answered(const ColumnFamily::Columns::value_type& each) { return each.second->answered; }

// By a column that the user did not name, if there is one.
int manner(const ColumnFamily& family) {
  const auto own = std::ranges::find_if_not(family.columns, is_answered);
  if (own == family.columns.end()) return -100;
  const LogColumn& column = *own->second;
  int rank = column.words.sure ? 0 : 50;
  if (column.words.is_reference && column.words.quantity != LogQuantity::kCommand) rank += 20;
  if (column.words.is_measured) rank -= 2;
  if (column.words.is_filtered) rank += 1;
  return rank;
}

template <class Rank>
std::vector<ColumnFamily> best_of(const std::vector<ColumnFamily>& families, const Rank& rank) {
  int least = std::numeric_limits<int>::max();
  for (const ColumnFamily& family : families) least = std::min(least, rank(family));
  std::vector<ColumnFamily> best;
  for (const ColumnFamily& family : families) {
    if (rank(family) == least) best.push_back(family);
  }
  return best;
}

int rank_of_drive(LogQuantity quantity) {
  if (quantity == LogQuantity::kForce) return 0;
  if (quantity == LogQuantity::kCurrent) return 4;
  return quantity == LogQuantity::kVoltage ? 8 : 12;
}

int fewer_joints(const ColumnFamily& family) { return -static_cast<int>(family.columns.size()); }

// Titles that are written otherwise for each joint: one family where no two are of one joint, since
// then nothing is to be chosen.
std::vector<ColumnFamily> joined_where_disjoint(const std::vector<ColumnFamily>& families) {
  if (families.size() < 2) return families;
  ColumnFamily all = families.front();
  for (const ColumnFamily& family : families | std::views::drop(1)) {
    for (const auto& [joint, column] : family.columns) {
      if (!have_one_unit(all, *column)) return families;
      if (!all.columns.try_emplace(joint, column).second) return families;
    }
  }
  return {all};
}

// The best of a list, each with what the user named. What was named alone wins where no other
// family has more joints.
template <class Rank>
std::vector<ColumnFamily> best_with_answers(const std::vector<ColumnFamily>& list,
                                            const Rank& rank) {
  std::vector<ColumnFamily> own;
  std::optional<ColumnFamily> named;
  for (const ColumnFamily& family : list) {
    ColumnFamily answered = family;
    std::erase_if(answered.columns, std::not_fn(is_answered));
    if (answered.columns.size() < family.columns.size()) own.push_back(family);
    if (answered.columns.empty()) continue;
    if (!named) named = answered;
    for (const auto& [joint, column] : answered.columns) {
      named->columns.try_emplace(joint, column);
    }
  }
  if (!named) return joined_where_disjoint(best_of(best_of(own, rank), fewer_joints));
  std::vector<ColumnFamily> best = best_of(own, rank);
  for (ColumnFamily& family : best) {
    for (const auto& [joint, column] : named->columns) {
      family.columns.insert_or_assign(joint, column);
    }
  }
  best = best_of(best, fewer_joints);
  const bool adds = !best.empty() && best.front().columns.size() > named->columns.size();
  return adds ? best : std::vector<ColumnFamily>{*named};
}

// Places in a title that the joint's name takes, so that the rest has the other words: (0, 0) where
// it is not there in one piece.
std::pair<std::size_t, std::size_t> place_of_joint(const std::string& title, const Words& joint) {
  constexpr std::size_t kLongestTitle = 200, kMostSigns = 8;
  const Words all = words_of(title);
  std::size_t letters = 0;
  for (const std::string& word : joint) letters += word.size();
  if (title.size() > kLongestTitle || letters == 0) return {0, 0};
  for (std::size_t from = 0; from + letters <= title.size(); ++from) {
    const Words before = words_of(title.substr(0, from));
    for (std::size_t size = letters; size <= letters + kMostSigns && from + size <= title.size();
         ++size) {
      if (words_of(title.substr(from, size)) != joint) continue;
      Words parts = before;
      parts.insert(parts.end(), joint.begin(), joint.end());
      const Words behind = words_of(title.substr(from + size));
      parts.insert(parts.end(), behind.begin(), behind.end());
      if (parts == all) return {from, size};
    }
  }
  return {0, 0};
}

// The words of a title without its joint, or of the file that it stands in.
ColumnWords words_beside(const LogColumn& column, const Words& joint,
                         const std::filesystem::path& file) {
  const auto [from, size] = place_of_joint(column.name, joint);
  if (size == 0) return column.words;
  std::string rest = column.name;
  ColumnWords words = read_column_words(rest.replace(from, size, " "), column.stated_unit);
  if (words.quantity != LogQuantity::kUnknown) return words;
  const ColumnWords of_file = read_column_words(file.stem().string(), "");
  const bool tells = of_file.sure && of_file.quantity != LogQuantity::kOther &&
                     of_file.quantity != LogQuantity::kTime;
  if (!tells) return column.words;
  words.quantity = of_file.quantity;
  words.motion = of_file.motion;
  words.sure = true;
  return words;
}

}  // namespace

std::vector<ColumnFamily> column_families(const LogRecording& recording,
                                          const std::vector<UrdfJoint>& joints) {
  const std::vector<std::size_t> moving = moving_joints(joints);
  const Numbering numbering = numbering_of(recording, moving.size());
  std::vector<ColumnFamily> families;
  for (const LogColumn& column : recording.columns) {
    std::optional<std::size_t> joint = joint_by_name(column, joints);
    const bool by_number = !joint;
    if (!joint && column.words.index && numbering.fits) {
      const int place = *column.words.index - numbering.first;
      if (place >= 0 && place < static_cast<int>(moving.size())) {
        joint = moving[static_cast<std::size_t>(place)];
      }
    }
    if (!joint) continue;
    const std::string pattern = pattern_of(column, by_number ? "" : joints[*joint].name);
    auto family = std::ranges::find_if(families, [&](const ColumnFamily& each) {
      return each.pattern == pattern && each.quantity == column.words.quantity &&
             each.columns.begin()->second->file == column.file && have_one_unit(each, column);
    });
    if (family == families.end()) {
      families.push_back({pattern, column.words.quantity, by_number, {}});
      family = families.end() - 1;
    }
    family->columns.try_emplace(*joint, &column);
  }
  for (ColumnFamily& family : families) {
    if (family.columns.size() == 1) family.pattern = family.columns.begin()->second->name;
  }
  return families;
}

void read_beside_joints(const std::vector<UrdfJoint>& joints, LogRecording& recording) {
  for (LogColumn& column : recording.columns) {
    const bool is_time = column.words.quantity == LogQuantity::kTime && !column.origin.empty();
    if (column.answered || is_time) continue;
    const std::optional<std::size_t> joint = joint_by_name(column, joints);
    if (!joint) continue;
    ColumnWords words =
        words_beside(column, words_of_joint(joints[*joint].name), recording.files[column.file]);
    words.index = column.words.index;
    column.values *= words.unit_factor / column.words.unit_factor;
    column.words = words;
  }
}

std::vector<ColumnFamily> families_of(const std::vector<ColumnFamily>& families,
                                      LogQuantity quantity) {
  std::vector<ColumnFamily> list;
  for (const ColumnFamily& family : families) {
    if (family.quantity == quantity) list.push_back(family);
  }
  return best_with_answers(list, manner);
}

std::vector<ColumnFamily> families_of_drive(const std::vector<ColumnFamily>& families) {
  const auto moves = [](const auto& each) { return each.second->moves(); };
  const auto is_told = [&](const auto& each) {
    return moves(each) || (each.second->answered && each.second->is_zero());
  };
  std::vector<ColumnFamily> list;
  for (const ColumnFamily& family : families) {
    if (drives(family.quantity) && std::ranges::any_of(family.columns, is_told)) {
      list.push_back(family);
    }
  }
  const bool any_moves = std::ranges::any_of(
      list, [&](const ColumnFamily& each) { return std::ranges::any_of(each.columns, moves); });
  if (!any_moves) return {};
  const auto rank = [](const ColumnFamily& family) {
    return manner(family) + rank_of_drive(family.quantity);
  };
  return best_with_answers(list, rank);
}

}  // namespace graybox
