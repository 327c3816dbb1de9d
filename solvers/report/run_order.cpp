#include "solvers/report/run_order.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <numeric>
#include <optional>

namespace graybox {
namespace {

constexpr double kEndless = std::numeric_limits<double>::infinity();
constexpr std::size_t kMostStarts = 40;  // of nearest-neighbour paths
constexpr int kMostRounds = 200;         // of improvements of one path

using Path = std::vector<std::size_t>;

// The column of the block; the number of columns where there is none.
std::size_t block_column(const CandidateTable& table) {
  return static_cast<std::size_t>(std::ranges::find(table.names, "block") - table.names.begin());
}

// The unit of all coordinates but the block; nothing where they have several.
std::optional<std::string> common_unit(const CandidateTable& table) {
  std::optional<std::string> unit;
  const std::size_t block = block_column(table);
  for (std::size_t k = 0; k < table.units.size(); ++k) {
    if (k == block) continue;
    if (unit.has_value() && *unit != table.units[k]) return std::nullopt;
    unit = table.units[k];
  }
  return unit.value_or("");
}

// Lengths of all steps, n x n.
class StepLengths {
 public:
  StepLengths(const InformationSet& set, std::span<const std::size_t> candidates)
      : count_(candidates.size()), lengths_(count_ * count_, 0.0) {
    const std::vector<double> scale = scales(set, candidates);
    for (std::size_t i = 0; i < count_; ++i) {
      for (std::size_t j = 0; j < count_; ++j) {
        const auto a = set.coordinates(candidates[i]), b = set.coordinates(candidates[j]);
        for (std::size_t k = 0; k < scale.size(); ++k) {
          lengths_[i * count_ + j] =
              std::max(lengths_[i * count_ + j], scale[k] * std::abs(a[k] - b[k]));
        }
      }
    }
  }

  [[nodiscard]] std::size_t count() const { return count_; }
  [[nodiscard]] double operator()(std::size_t i, std::size_t j) const {
    return lengths_[i * count_ + j];
  }
  [[nodiscard]] double of(const Path& path) const {
    double length = 0.0;
    for (std::size_t k = 1; k < path.size(); ++k) length += (*this)(path[k - 1], path[k]);
    return length;
  }

 private:
  // One for coordinates of one unit, else one over the range.
  static std::vector<double> scales(const InformationSet& set,
                                    std::span<const std::size_t> candidates) {
    const CandidateTable& table = set.candidates();
    std::vector<double> scale(table.names.size(), 1.0);
    if (common_unit(table).has_value()) return scale;
    for (std::size_t k = 0; k < scale.size(); ++k) {
      double low = kEndless, high = -kEndless;
      for (const std::size_t candidate : candidates) {
        low = std::min(low, set.coordinates(candidate)[k]);
        high = std::max(high, set.coordinates(candidate)[k]);
      }
      scale[k] = high > low ? 1.0 / (high - low) : 0.0;
    }
    return scale;
  }

  std::size_t count_;
  std::vector<double> lengths_;
};

// best(S, j): the shortest path through the subset S that ends at j.
Path shortest_path(const StepLengths& step) {
  const std::size_t n = step.count(), subsets = std::size_t{1} << n;
  std::vector<double> best(subsets * n, kEndless);
  std::vector<std::uint8_t> before(subsets * n, 0);
  for (std::size_t j = 0; j < n; ++j) best[(std::size_t{1} << j) * n + j] = 0.0;
  for (std::size_t subset = 1; subset < subsets; ++subset) {
    for (std::size_t last = 0; last < n; ++last) {
      const double length = best[subset * n + last];
      if (length == kEndless) continue;
      for (std::size_t next = 0; next < n; ++next) {
        const std::size_t bit = std::size_t{1} << next;
        if ((subset & bit) != 0) continue;
        const std::size_t at = (subset | bit) * n + next;
        if (length + step(last, next) < best[at]) {
          best[at] = length + step(last, next);
          before[at] = static_cast<std::uint8_t>(last);
        }
      }
    }
  }
  std::size_t subset = subsets - 1, last = 0;
  for (std::size_t j = 1; j < n; ++j) {
    if (best[subset * n + j] < best[subset * n + last]) last = j;
  }
  Path path(n);
  for (std::size_t k = n; k-- > 0;) {
    path[k] = last;
    const std::size_t left = subset & ~(std::size_t{1} << last);
    last = before[subset * n + last];
    subset = left;
  }
  return path;
}

Path nearest_neighbours(const StepLengths& step, std::size_t start) {
  std::vector<bool> seen(step.count(), false);
  Path path{start};
  seen[start] = true;
  while (path.size() < step.count()) {
    std::size_t next = step.count();
    for (std::size_t j = 0; j < step.count(); ++j) {
      if (seen[j]) continue;
      if (next == step.count() || step(path.back(), j) < step(path.back(), next)) next = j;
    }
    seen[next] = true;
    path.push_back(next);
  }
  return path;
}

// The step between two places of a path; none beyond its ends.
double between(const StepLengths& step, const Path& path, std::size_t i, std::size_t j) {
  return i >= path.size() || j >= path.size() ? 0.0 : step(path[i], path[j]);
}

// What is smaller by rounding alone is no gain.
bool gains(double before, double after) { return after < before - 1e-9 * (1.0 + before); }

// Reverses one piece where that is shorter.
bool reverse_a_piece(const StepLengths& step, Path& path) {
  const std::size_t n = path.size();
  for (std::size_t i = 0; i + 1 < n; ++i) {
    for (std::size_t j = i + 1; j < n; ++j) {
      // i - 1 is beyond the end for i = 0, as size_t wraps round.
      const double old = between(step, path, i - 1, i) + between(step, path, j, j + 1);
      const double now = between(step, path, i - 1, j) + between(step, path, i, j + 1);
      if (!gains(old, now)) continue;
      std::reverse(path.begin() + static_cast<std::ptrdiff_t>(i),
                   path.begin() + static_cast<std::ptrdiff_t>(j + 1));
      return true;
    }
  }
  return false;
}

// Moves one piece of up to three to another place where that is shorter.
bool move_a_piece(const StepLengths& step, Path& path) {
  const std::size_t n = path.size();
  const double old = step.of(path);
  for (std::size_t size = 1; size <= 3 && size < n; ++size) {
    for (std::size_t from = 0; from + size <= n; ++from) {
      Path rest = path;
      const auto first = rest.begin() + static_cast<std::ptrdiff_t>(from);
      const Path piece(first, first + static_cast<std::ptrdiff_t>(size));
      rest.erase(first, first + static_cast<std::ptrdiff_t>(size));
      const double left = step.of(rest), inside = step.of(piece);
      for (std::size_t to = 0; to <= rest.size(); ++to) {
        const double gap = to == 0 || to == rest.size() ? 0.0 : step(rest[to - 1], rest[to]);
        const double in = to == 0 ? 0.0 : step(rest[to - 1], piece.front());
        const double out = to == rest.size() ? 0.0 : step(piece.back(), rest[to]);
        if (!gains(old, left + inside - gap + in + out)) continue;
        rest.insert(rest.begin() + static_cast<std::ptrdiff_t>(to), piece.begin(), piece.end());
        path = std::move(rest);
        return true;
      }
    }
  }
  return false;
}

Path short_path(const StepLengths& step) {
  Path best;
  const std::size_t starts = std::min(step.count(), kMostStarts);
  for (std::size_t k = 0; k < starts; ++k) {
    Path path = nearest_neighbours(step, k * step.count() / starts);
    for (int round = 0; round < kMostRounds; ++round) {
      if (!reverse_a_piece(step, path) && !move_a_piece(step, path)) break;
    }
    if (best.empty() || gains(step.of(best), step.of(path))) best = std::move(path);
  }
  return best;
}

// Candidates of one block.
RunOrder order_in_block(const InformationSet& set, std::span<const std::size_t> candidates) {
  RunOrder order;
  order.places.resize(candidates.size());
  std::iota(order.places.begin(), order.places.end(), std::size_t{0});
  if (candidates.size() < 2) return order;
  const StepLengths step(set, candidates);
  order.is_shortest = candidates.size() <= kOptimalOrder;
  order.places = order.is_shortest ? shortest_path(step) : short_path(step);
  // A path is as long from either end: it begins at the end that was listed first.
  if (order.places.front() > order.places.back()) std::ranges::reverse(order.places);
  order.length = step.of(order.places);
  return order;
}

}  // namespace

RunOrder run_order(const InformationSet& set, std::span<const std::size_t> candidates) {
  const CandidateTable& table = set.candidates();
  RunOrder order;
  if (table.names.empty()) {
    order.places.resize(candidates.size());
    std::iota(order.places.begin(), order.places.end(), std::size_t{0});
    return order;
  }
  const std::size_t column = block_column(table);
  std::map<double, Path> blocks;  // places of the candidates of each
  for (std::size_t k = 0; k < candidates.size(); ++k) {
    const auto coordinates = set.coordinates(candidates[k]);
    blocks[column < coordinates.size() ? coordinates[column] : 0.0].push_back(k);
  }
  for (const auto& [block, places] : blocks) {
    Path members;
    for (const std::size_t place : places) members.push_back(candidates[place]);
    const RunOrder inside = order_in_block(set, members);
    for (const std::size_t k : inside.places) order.places.push_back(places[k]);
    order.length += inside.length;
    order.is_shortest = order.is_shortest && inside.is_shortest;
  }
  order.unit = common_unit(table).value_or("");
  return order;
}

}  // namespace graybox
