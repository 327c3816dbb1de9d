#include "diagnosis/log_columns/joint_columns.hpp"

#include <algorithm>
#include <cctype>
#include <limits>
#include <optional>
#include <set>

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

// The joint whose name has the most words in the title; numbers alone name none.
std::optional<std::size_t> joint_by_name(const LogColumn& column,
                                         const std::vector<UrdfJoint>& joints) {
  std::optional<std::size_t> best;
  std::size_t most = 0;
  const Words title = words_of(column.joint.empty() ? column.name : column.joint);
  for (std::size_t k = 0; k < joints.size(); ++k) {
    const Words words = words_of_joint(joints[k].name);
    if (std::ranges::all_of(words, are_digits) || !contains(title, words)) continue;
    if (words.size() <= most) continue;
    most = words.size();
    best = k;
  }
  return best;
}

// The title without its joint or number.
std::string pattern_of(const LogColumn& column, const std::string& joint) {
  std::string pattern = column.name;
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

int manner(const ColumnFamily& family) {
  const LogColumn& column = *family.columns.begin()->second;
  if (column.answered) return -100;
  int rank = column.words.sure ? 0 : 50;
  if (column.words.is_reference && column.words.quantity != LogQuantity::kCommand) rank += 20;
  if (column.words.is_measured) rank -= 2;
  if (column.words.is_filtered) rank += 1;
  return rank;
}

template <class Rank>
std::vector<const ColumnFamily*> best_of(const std::vector<const ColumnFamily*>& families,
                                         const Rank& rank) {
  int least = std::numeric_limits<int>::max();
  for (const ColumnFamily* family : families) least = std::min(least, rank(*family));
  std::vector<const ColumnFamily*> best;
  for (const ColumnFamily* family : families) {
    if (rank(*family) == least) best.push_back(family);
  }
  return best;
}

int rank_of_drive(LogQuantity quantity) {
  if (quantity == LogQuantity::kForce) return 0;
  if (quantity == LogQuantity::kCurrent) return 4;
  return quantity == LogQuantity::kVoltage ? 8 : 12;
}

int fewer_joints(const ColumnFamily& family) { return -static_cast<int>(family.columns.size()); }

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
             each.columns.begin()->second->file == column.file;
    });
    if (family == families.end()) {
      families.push_back({pattern, column.words.quantity, by_number, {}});
      family = families.end() - 1;
    }
    family->columns.try_emplace(*joint, &column);
  }
  return families;
}

std::vector<const ColumnFamily*> families_of(const std::vector<ColumnFamily>& families,
                                             LogQuantity quantity) {
  std::vector<const ColumnFamily*> list;
  for (const ColumnFamily& family : families) {
    if (family.quantity == quantity) list.push_back(&family);
  }
  return best_of(best_of(list, manner), fewer_joints);
}

std::vector<const ColumnFamily*> families_of_drive(const std::vector<ColumnFamily>& families) {
  std::vector<const ColumnFamily*> list;
  for (const ColumnFamily& family : families) {
    const bool any_moves =
        std::ranges::any_of(family.columns, [](const auto& each) { return each.second->moves(); });
    if (drives(family.quantity) && any_moves) list.push_back(&family);
  }
  const auto rank = [](const ColumnFamily& family) {
    return manner(family) + rank_of_drive(family.quantity);
  };
  return best_of(best_of(list, rank), fewer_joints);
}

}  // namespace graybox
