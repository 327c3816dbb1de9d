// Candidate positions of a robot.
//
// The paper's grid (Section VI-B), all combinations in degrees, the last listed running fastest:
//   q1 in {0, 45, 90}             q2 in {-60, -45, ..., 90}     q3 in {-165, -150, ..., 60}
//   q4 in {0, 45, 90}             q5 in {-90, -45, ..., 90}     q6 = 0 (symmetric payload)
// 3 * 11 * 16 * 3 * 5 = 7920 candidates; candidate (((i1 * 11 + i2) * 16 + i3) * 3 + i4) * 5 + i5.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <vector>

namespace graybox {

// Commanded joint angles in degrees, position after position.
struct PositionTable {
  std::size_t joint_count = 0;
  std::vector<double> degrees;

  [[nodiscard]] std::size_t count() const { return degrees.size() / joint_count; }
  [[nodiscard]] std::span<const double> position(std::size_t i) const {
    return {degrees.data() + i * joint_count, joint_count};
  }
  // The positions listed, in that order. Throws InputError for an index out of range.
  [[nodiscard]] PositionTable subset(std::span<const std::size_t> indices) const;
};

inline constexpr std::size_t kPaperGridSize = 7920;

[[nodiscard]] PositionTable paper_grid();

// The smallest box around the paper's grid: of each of the 6 joints the least and the largest
// angle, degrees.
struct JointRange {
  double from = 0.0;
  double to = 0.0;
};
[[nodiscard]] std::vector<JointRange> paper_ranges();

// Exactly `count` positions in the ranges of the paper's grid. 7920 is the paper's grid itself and
// fewer are a nested random subset of it. More come from the smallest finer grid that holds at
// least `count` positions (every axis has about the same factor more intervals), thinned to `count`
// by nested_subset(). Throws InputError for 0.
[[nodiscard]] PositionTable robot_grid(std::size_t count);

// A CSV file: one position a line, `joint_count` angles in degrees, separated by commas; a header
// line, empty lines and lines starting with # are skipped. Throws InputError naming file and line.
[[nodiscard]] PositionTable read_positions(const std::filesystem::path& file,
                                           std::size_t joint_count);

}  // namespace graybox
