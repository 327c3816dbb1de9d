#include "solvers/constrained/block_sizes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/files/text_lines.hpp"

namespace graybox {
namespace {

using SizeRange = std::pair<double, double>;

double block_size(std::string_view text) {
  double value = 0.0;
  if (!parse_number(trimmed(text), value) || !(value >= 0.0) || !std::isfinite(value)) {
    throw InputError(
        fmt::format("block_sizes: '{}' is no size; write 4,4,4 or 3-5,3-5", trimmed(text)));
  }
  return value;
}

std::vector<SizeRange> size_ranges(std::string_view text) {
  std::vector<SizeRange> ranges;
  for (;;) {
    const std::size_t comma = text.find(',');
    const std::string_view part = trimmed(text.substr(0, comma));
    const std::size_t dash = part.find('-', 1);
    const double least = block_size(part.substr(0, dash));
    const double most = dash == std::string_view::npos ? least : block_size(part.substr(dash + 1));
    if (least > most || !(most > 0.0)) {
      throw InputError(fmt::format("block_sizes: '{}' leaves no size", part));
    }
    ranges.emplace_back(least, most);
    if (comma == std::string_view::npos) return ranges;
    text.remove_prefix(comma + 1);
  }
}

// The block of each candidate, counted from zero.
std::vector<std::size_t> blocks_of(const InformationSet& set, std::size_t count) {
  const CandidateTable& table = set.candidates();
  const auto found = std::ranges::find(table.names, "block");
  if (found == table.names.end()) {
    throw InputError(
        fmt::format("block_sizes: {} has no coordinate 'block'; make the set with graybox problem "
                    "from-jacobians --blocks, or give its candidates one, counted from 1",
                    set.name()));
  }
  const auto column = static_cast<std::size_t>(found - table.names.begin());
  std::vector<std::size_t> blocks(set.candidate_count());
  std::vector<bool> seen(count, false);
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    const double block = set.coordinates(i)[column];
    if (!(block >= 1.0) || block > static_cast<double>(count) || block != std::floor(block)) {
      throw InputError(fmt::format("block_sizes: {} sizes, but candidate {} of {} is in block {:g}",
                                   count, i, set.name(), block));
    }
    blocks[i] = static_cast<std::size_t>(block) - 1;
    seen[blocks[i]] = true;
  }
  const auto none = std::ranges::find(seen, false);
  if (none == seen.end()) return blocks;
  throw InputError(fmt::format("block_sizes: {} sizes, but {} has no candidate in block {}", count,
                               set.name(), none - seen.begin() + 1));
}

}  // namespace

std::optional<double> experiments_in_blocks(std::string_view text) {
  double sum = 0.0;
  for (const auto& [least, most] : size_ranges(text)) {
    if (least != most) return std::nullopt;
    sum += most;
  }
  return sum;
}

std::vector<LinearConstraint> block_size_rows(const InformationSet& set, std::string_view text) {
  const std::vector<SizeRange> ranges = size_ranges(text);
  const std::vector<std::size_t> blocks = blocks_of(set, ranges.size());
  std::vector<LinearConstraint> rows;
  for (std::size_t b = 0; b < ranges.size(); ++b) {
    LinearConstraint row{.name = fmt::format("block {}", b + 1),
                         .coefficients = std::vector<double>(blocks.size(), 0.0),
                         .lower = ranges[b].first,
                         .upper = ranges[b].second};
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      if (blocks[i] == b) row.coefficients[i] = 1.0;
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace graybox
