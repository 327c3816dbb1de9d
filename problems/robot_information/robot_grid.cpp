#include "problems/robot_information/robot_grid.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/information/information_set.hpp"

namespace graybox {
namespace {

constexpr std::size_t kAxes = 5;
constexpr std::size_t kJoints = 6;
constexpr std::uint64_t kThinningSeed = 1;

struct Range {
  double from, to;  // degrees
  std::size_t intervals;
};
constexpr std::array<Range, kAxes> kPaperRanges = {
    {{0, 90, 2}, {-60, 90, 10}, {-165, 60, 15}, {0, 90, 2}, {-90, 90, 4}}};

using Intervals = std::array<std::size_t, kAxes>;

Intervals paper_intervals() {
  Intervals result{};
  for (std::size_t a = 0; a < kAxes; ++a) result[a] = kPaperRanges[a].intervals;
  return result;
}

std::size_t grid_size(const Intervals& intervals) {
  std::size_t size = 1;
  for (const std::size_t n : intervals) size *= n + 1;
  return size;
}

// Adds intervals one by one to the axis that has the smallest factor more than the paper's.
Intervals refine(std::size_t count) {
  Intervals intervals = paper_intervals();
  while (grid_size(intervals) < count) {
    std::size_t coarsest = 0;
    for (std::size_t a = 1; a < kAxes; ++a) {
      if (intervals[a] * kPaperRanges[coarsest].intervals <
          intervals[coarsest] * kPaperRanges[a].intervals) {
        coarsest = a;
      }
    }
    ++intervals[coarsest];
  }
  return intervals;
}

PositionTable full_grid(const Intervals& intervals) {
  const std::size_t size = grid_size(intervals);
  PositionTable table{kJoints, std::vector<double>(size * kJoints, 0.0)};
  for (std::size_t i = 0; i < size; ++i) {
    std::size_t rest = i;
    for (std::size_t a = kAxes; a-- > 0;) {  // the last axis runs fastest
      const std::size_t step = rest % (intervals[a] + 1);
      rest /= intervals[a] + 1;
      const Range& range = kPaperRanges[a];
      table.degrees[i * kJoints + a] = range.from + (range.to - range.from) *
                                                        static_cast<double>(step) /
                                                        static_cast<double>(intervals[a]);
    }
  }
  return table;
}

}  // namespace

PositionTable PositionTable::subset(std::span<const std::size_t> indices) const {
  PositionTable result{joint_count, {}};
  result.degrees.reserve(indices.size() * joint_count);
  for (const std::size_t i : indices) {
    if (i >= count()) {
      throw InputError(fmt::format("positions: index {} of {} positions", i, count()));
    }
    const auto row = position(i);
    result.degrees.insert(result.degrees.end(), row.begin(), row.end());
  }
  return result;
}

std::vector<JointRange> paper_ranges() {
  std::vector<JointRange> ranges(kJoints);
  for (std::size_t a = 0; a < kAxes; ++a) ranges[a] = {kPaperRanges[a].from, kPaperRanges[a].to};
  return ranges;
}

PositionTable paper_grid() { return full_grid(paper_intervals()); }

PositionTable robot_grid(std::size_t count) {
  if (count == 0) throw InputError("--grid 0: at least one position is needed");
  const PositionTable grid = full_grid(refine(count));
  if (grid.count() == count) return grid;
  return grid.subset(nested_subset(grid.count(), count, kThinningSeed));
}

}  // namespace graybox
