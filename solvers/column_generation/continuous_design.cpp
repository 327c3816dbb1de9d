#include "solvers/column_generation/continuous_design.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <numeric>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "problems/base/stop.hpp"
#include "solvers/column_generation/box_search.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/core/inverse_cholesky.hpp"
#include "solvers/core/sensitivity.hpp"
#include "solvers/restricted_problem/working_set.hpp"

namespace graybox {
namespace {

constexpr double kGridGap = 1e-9;
constexpr double kStartSeparation = 0.1;  // of starts from the grid, share of the box
constexpr double kSameMaximum = 1e-3;     // of the ends of searches, share of the box
constexpr int kMergeRounds = 10;

struct Maximum {
  std::vector<double> point;
  double sensitivity = 0.0;
};

// Largest distance in one coordinate, as a share of the box; fixed coordinates do not count.
double distance(const CandidateSpace& space, std::span<const double> a, std::span<const double> b) {
  double largest = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    const double width = space.upper()[k] - space.lower()[k];
    if (width > 0.0) largest = std::max(largest, std::abs(a[k] - b[k]) / width);
  }
  return largest;
}

using Count = std::function<void(std::size_t done, std::size_t total)>;

// Runs work(evaluator, index) for index < count, evaluators one a thread; rethrows the exception of
// the first index that failed.
template <class Work>
void for_each(const CandidateSpace& space, std::size_t count, int threads, const Work& work,
              const Count& on_done = {}) {
  std::exception_ptr failure;
  std::size_t failed = count, done = 0;
  if (on_done) on_done(0, count);
#pragma omp parallel num_threads(threads)
  {
    const auto evaluator = space.evaluator();
#pragma omp for schedule(dynamic, 1)
    for (std::ptrdiff_t i = 0; i < static_cast<std::ptrdiff_t>(count); ++i) {
      const auto index = static_cast<std::size_t>(i);
      try {
        stop_if_requested();
        work(*evaluator, index);
        if (on_done) {
#pragma omp critical(graybox_continuous_count)
          on_done(++done, count);
        }
      } catch (...) {
#pragma omp critical(graybox_continuous_design)
        if (index < failed) {
          failed = index;
          failure = std::current_exception();
        }
      }
    }
  }
  if (failure != nullptr) std::rethrow_exception(failure);
}

// tr(W H(x)) with W in trace-dual packing.
double sensitivity_at(InformationEvaluator& evaluator, std::span<const double> point,
                      std::span<const double> trace_dual, std::vector<double>& packed) {
  packed.resize(trace_dual.size());
  evaluator.information(point, packed);
  return std::inner_product(packed.begin(), packed.end(), trace_dual.begin(), 0.0);
}

using WritePoint = std::function<void(std::size_t, std::span<double>)>;

// The sensitivity of many points, a block of them at a time.
void price(const CandidateSpace& space, std::span<const double> trace_dual, std::size_t count,
           const WritePoint& points, int threads, std::vector<double>& out,
           const Count& on_done = {}) {
  constexpr std::size_t kBlock = 256;
  for_each(
      space, (count + kBlock - 1) / kBlock, threads,
      [&](InformationEvaluator& evaluator, std::size_t block) {
        std::vector<double> point(space.coordinate_count()), packed;
        for (std::size_t i = block * kBlock; i < std::min(count, (block + 1) * kBlock); ++i) {
          points(i, point);
          out[i] = sensitivity_at(evaluator, point, trace_dual, packed);
        }
      },
      on_done);
}

// A local maximum of the sensitivity from each start.
std::vector<Maximum> search(const CandidateSpace& space, std::span<const double> trace_dual,
                            const std::vector<std::vector<double>>& starts, double tolerance,
                            int threads, const Count& on_done = {}) {
  std::vector<Maximum> maxima(starts.size());
  const auto from_start = [&](InformationEvaluator& evaluator, std::size_t i) {
    std::vector<double> packed;
    BoxSearch box(space.lower(), space.upper());
    maxima[i].point = starts[i];
    maxima[i].sensitivity = box.maximise(
        [&](std::span<const double> point) {
          return sensitivity_at(evaluator, point, trace_dual, packed);
        },
        maxima[i].point, {.tolerance = tolerance});
  };
  for_each(space, starts.size(), threads, from_start, on_done);
  return maxima;
}

// The largest first; of those nearer than `separation` only the largest.
std::vector<Maximum> separate(const CandidateSpace& space, std::vector<Maximum> maxima,
                              double separation) {
  std::ranges::stable_sort(maxima, std::greater<>(), &Maximum::sensitivity);
  std::vector<Maximum> kept;
  for (Maximum& maximum : maxima) {
    const bool near = std::ranges::any_of(kept, [&](const Maximum& other) {
      return distance(space, maximum.point, other.point) < separation;
    });
    if (!near) kept.push_back(std::move(maximum));
  }
  return kept;
}

// A D-optimal design of the columns x_j, kept with their H and weights.
class Columns {
 public:
  explicit Columns(std::size_t dimension) : working_(dimension), packed_(packed_size(dimension)) {}

  void add(std::span<const double> point, double weight, InformationEvaluator& evaluator) {
    evaluator.information(point, packed_);
    if (working_.add(points_.size(), packed_.data(), weight)) {
      points_.emplace_back(point.begin(), point.end());
    }
  }
  WorkingSet& working() { return working_; }
  [[nodiscard]] const WorkingSet& working() const { return working_; }
  [[nodiscard]] const std::vector<double>& point(std::size_t member) const {
    return points_[working_.indices()[member]];
  }
  [[nodiscard]] std::vector<std::size_t> support() const {
    std::vector<std::size_t> members;
    for (std::size_t k = 0; k < working_.size(); ++k) {
      if (working_.weights()[k] > 0.0) members.push_back(k);
    }
    return members;
  }

 private:
  WorkingSet working_;
  std::vector<std::vector<double>> points_;  // all that were ever added
  std::vector<double> packed_;
};

class Run {
 public:
  Run(const CandidateSpace& space, const InformationSet& grid, const ContinuousOptions& options,
      const ContinuousObserver& observer)
      : space_(space),
        grid_(grid),
        options_(options),
        observer_(observer),
        evaluator_(space.evaluator()),
        random_(options.seed),
        dimension_(static_cast<double>(grid.dimension())),
        grid_sensitivity_(grid.candidate_count()) {}

  ContinuousResult run() {
    Columns columns(grid_.dimension());
    if (!start(columns)) return result_;
    result_.grid_log_det = columns.working().inverse().log_det();
    result_.status = SolveStatus::kIterationLimit;
    const bool solved = improve(columns, options_.round_limit);
    take(columns);
    result_.unmerged_support = result_.support_size();
    if (!solved) return result_;
    const ContinuousResult unmerged = result_;
    try {
      merge(columns);
    } catch (const Stopped&) {  // the design as it was found stands
      result_ = unmerged;
    }
    return result_;
  }

 private:
  // The optimal design on the grid.
  bool start(Columns& columns) {
    const Solution solution = ColumnGeneration().solve(
        grid_, {.duality_gap = kGridGap, .seed = options_.seed, .threads = options_.threads});
    if (solution.status != SolveStatus::kSolved) {
      result_.status = solution.status;
      return false;
    }
    for (std::size_t i = 0; i < solution.design.weights.size(); ++i) {
      const double weight = solution.design.weights[i];
      if (weight == 0.0) continue;
      const auto point = grid_.coordinates(i);
      columns.add(point, weight, *evaluator_);
      result_.grid_points.insert(result_.grid_points.end(), point.begin(), point.end());
      result_.grid_weights.push_back(weight);
    }
    return columns.working().refresh();
  }

  // Rounds of search and weights. True where the gap was reached.
  bool improve(Columns& columns, int round_limit) {
    double largest_of_quiet = -1.0;  // gap found by the quiet rounds up to now
    for (int round = 0, quiet = 0;; ++round) {
      std::vector<Maximum> found;
      try {
        found = search_all(columns);
      } catch (const Stopped&) {
        result_.status = SolveStatus::kTimeLimit;
        return false;
      }
      result_.gap = found.front().sensitivity / dimension_ - 1.0;
      if (result_.rounds.empty()) result_.grid_gap_in_box = result_.gap;
      if (!report(columns)) {
        result_.status = SolveStatus::kTimeLimit;
        return false;
      }
      const bool is_quiet = result_.gap <= options_.duality_gap;
      quiet = is_quiet ? quiet + 1 : 0;
      largest_of_quiet = is_quiet ? std::max(largest_of_quiet, result_.gap) : -1.0;
      if (quiet >= options_.confirmations) {
        result_.gap = largest_of_quiet;
        result_.status = SolveStatus::kSolved;
        return true;
      }
      if (round >= round_limit) return false;
      if (is_quiet) continue;  // the same design, from other random points
      for (const Maximum& maximum : found) {
        if (maximum.sensitivity > dimension_ * (1.0 + 0.1 * options_.duality_gap)) {
          columns.add(maximum.point, 0.0, *evaluator_);
        }
      }
      const WorkingSetStatus status =
          columns.working().improve(result_.gap, 0.1 * options_.duality_gap);
      if (status == WorkingSetStatus::kSingular) {
        result_.status = SolveStatus::kNumericalFailure;
        return false;
      }
    }
  }

  // Local maxima, different ones, largest first.
  std::vector<Maximum> search_all(const Columns& columns) {
    const std::span<const double> dual = columns.working().inverse().trace_dual();
    std::vector<std::vector<double>> starts;
    for (const std::size_t member : columns.support()) starts.push_back(columns.point(member));
    sensitivities(grid_, dual, grid_sensitivity_);
    add_best(grid_.candidates().values, grid_sensitivity_, options_.grid_starts, starts);
    price_random_points(dual);
    add_best(random_points_, random_sensitivity_, options_.random_starts, starts);
    const double tolerance = 0.01 * options_.duality_gap * dimension_;
    return separate(space_, search(space_, dual, starts, tolerance, options_.threads),
                    kSameMaximum);
  }

  // Of the points given, `wanted` with the largest sensitivity, apart from one another.
  void add_best(const std::vector<double>& points, const std::vector<double>& sensitivity,
                std::size_t wanted, std::vector<std::vector<double>>& starts) const {
    const std::size_t n = space_.coordinate_count();
    std::vector<std::size_t> order(sensitivity.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::stable_sort(order, std::greater<>(),
                             [&](std::size_t i) { return sensitivity[i]; });
    const std::size_t first = starts.size();
    for (const std::size_t i : order) {
      if (starts.size() - first >= wanted) break;
      const std::span point = std::span(points).subspan(i * n, n);
      bool near = false;
      for (std::size_t k = first; k < starts.size() && !near; ++k) {
        near = distance(space_, point, starts[k]) < kStartSeparation;
      }
      if (!near) starts.emplace_back(point.begin(), point.end());
    }
  }

  void price_random_points(std::span<const double> dual) {
    const std::size_t n = space_.coordinate_count();
    random_points_.resize(options_.random_points * n);
    random_sensitivity_.resize(options_.random_points);
    for (std::size_t i = 0; i < random_points_.size(); ++i) {
      random_points_[i] = random_.uniform(space_.lower()[i % n], space_.upper()[i % n]);
    }
    price(
        space_, dual, options_.random_points,
        [&](std::size_t i, std::span<double> out) {
          std::copy_n(random_points_.begin() + static_cast<std::ptrdiff_t>(i * n), n, out.begin());
        },
        options_.threads, random_sensitivity_);
  }

  bool report(const Columns& columns) {
    ContinuousRound round;
    round.round = static_cast<int>(result_.rounds.size());
    round.columns = columns.working().size();
    const std::vector<std::size_t> support = columns.support();
    round.support = support.size();
    round.log_det = columns.working().inverse().log_det();
    round.found_gap = result_.gap;
    for (const std::size_t member : support) {
      double nearest = std::numeric_limits<double>::infinity();
      for (std::size_t i = 0; i < grid_.candidate_count(); ++i) {
        nearest = std::min(nearest, distance(space_, columns.point(member), grid_.coordinates(i)));
      }
      round.farthest_from_grid = std::max(round.farthest_from_grid, nearest);
    }
    result_.rounds.push_back(round);
    return !observer_ || observer_(round);
  }

  void take(const Columns& columns) {
    result_.points.clear();
    result_.weights.clear();
    for (const std::size_t member : columns.support()) {
      const std::vector<double>& point = columns.point(member);
      result_.points.insert(result_.points.end(), point.begin(), point.end());
      result_.weights.push_back(columns.working().weights()[member]);
    }
    const double sum = std::accumulate(result_.weights.begin(), result_.weights.end(), 0.0);
    for (double& weight : result_.weights) weight /= sum;
    result_.log_det = columns.working().inverse().log_det();
  }

  // Each cluster of support points becomes the local maximum uphill of its mean; kept only if the
  // gap is reached again with fewer points.
  void merge(const Columns& columns) {
    const ContinuousResult before = result_;
    std::vector<Maximum> centres;
    std::vector<double> weights;
    for (const auto& [centre, weight] : clusters(columns)) {
      centres.push_back({centre, 0.0});
      weights.push_back(weight);
    }
    if (centres.size() == before.support_size()) return;
    for (int round = 0; round < kMergeRounds; ++round) {
      Columns merged(grid_.dimension());
      for (std::size_t k = 0; k < centres.size(); ++k) {
        merged.add(centres[k].point, weights[k], *evaluator_);
      }
      if (merged.working().optimise(0.01 * options_.duality_gap, 50) ==
              WorkingSetStatus::kSingular ||
          !merged.working().refresh()) {
        break;
      }
      const std::vector<Maximum> found = search_all(merged);
      result_.gap = found.front().sensitivity / dimension_ - 1.0;
      if (result_.gap <= options_.duality_gap) {
        take(merged);
        if (!report(merged)) break;
        return;
      }
      move_to_nearest(found, centres);
    }
    result_ = before;
  }

  // Moves every centre to the maximum that stands nearest, if one does within the merge distance.
  void move_to_nearest(const std::vector<Maximum>& found, std::vector<Maximum>& centres) const {
    for (Maximum& centre : centres) {
      const Maximum* nearest = nullptr;
      double least = options_.merge_distance;
      for (const Maximum& maximum : found) {
        const double away = distance(space_, maximum.point, centre.point);
        if (away < least) {
          least = away;
          nearest = &maximum;
        }
      }
      if (nearest != nullptr) centre = *nearest;
    }
  }

  // Support points grouped by the heaviest of each neighbourhood: weighted means and total weights.
  std::vector<std::pair<std::vector<double>, double>> clusters(const Columns& columns) const {
    std::vector<std::size_t> members = columns.support();
    const std::span<const double> weights = columns.working().weights();
    std::ranges::stable_sort(members, std::greater<>(), [&](std::size_t k) { return weights[k]; });
    std::vector<std::size_t> leaders;
    std::vector<std::pair<std::vector<double>, double>> result;
    for (const std::size_t member : members) {
      const std::vector<double>& point = columns.point(member);
      std::size_t c = 0;
      while (c < leaders.size() &&
             distance(space_, point, columns.point(leaders[c])) >= options_.merge_distance) {
        ++c;
      }
      if (c == leaders.size()) {
        leaders.push_back(member);
        result.emplace_back(std::vector<double>(point.size(), 0.0), 0.0);
      }
      auto& [sum, weight] = result[c];
      for (std::size_t k = 0; k < point.size(); ++k) sum[k] += weights[member] * point[k];
      weight += weights[member];
    }
    for (auto& [sum, weight] : result) {
      for (double& coordinate : sum) coordinate /= weight;
    }
    return result;
  }

  const CandidateSpace& space_;
  const InformationSet& grid_;
  const ContinuousOptions& options_;
  const ContinuousObserver& observer_;
  std::unique_ptr<InformationEvaluator> evaluator_;
  Random random_;
  double dimension_;
  std::vector<double> grid_sensitivity_, random_points_, random_sensitivity_;
  ContinuousResult result_;
};

void check(const CandidateSpace& space, const InformationSet& grid,
           const ContinuousOptions& options) {
  if (grid.dimension() != space.dimension() ||
      grid.candidates().names.size() != space.coordinate_count()) {
    throw InputError(fmt::format(
        "continuous design: the grid has {} parameters and {} coordinates, the space {} and {}",
        grid.dimension(), grid.candidates().names.size(), space.dimension(),
        space.coordinate_count()));
  }
  for (std::size_t k = 0; k < space.coordinate_count(); ++k) {
    const double lower = space.lower()[k], upper = space.upper()[k];
    if (!(lower <= upper) || !std::isfinite(upper - lower)) {
      throw InputError(fmt::format("continuous design: {} to {} is no range for {}", lower, upper,
                                   grid.candidates().names[k]));
    }
    for (std::size_t i = 0; i < grid.candidate_count(); ++i) {
      const double value = grid.coordinates(i)[k];
      if (!(value >= lower && value <= upper)) {
        throw InputError(
            fmt::format("continuous design: {} = {} of candidate {} is outside {} to {}",
                        grid.candidates().names[k], value, i, lower, upper));
      }
    }
  }
  if (!(options.duality_gap > 0.0) || !(options.merge_distance >= 0.0) || options.round_limit < 1 ||
      options.confirmations < 1 || options.threads < 1) {
    throw InputError(
        "continuous design: gap, round_limit, confirmations and threads must be positive");
  }
}

// W of the design, in trace-dual packing.
std::vector<double> trace_dual_of(const CandidateSpace& space, const ContinuousResult& result) {
  const std::size_t n = space.coordinate_count(), p = packed_size(space.dimension());
  const auto evaluator = space.evaluator();
  std::vector<double> matrix(p, 0.0), packed(p);
  for (std::size_t j = 0; j < result.support_size(); ++j) {
    evaluator->information(std::span(result.points).subspan(j * n, n), packed);
    for (std::size_t k = 0; k < p; ++k) matrix[k] += result.weights[j] * packed[k];
  }
  InverseFactor factor;
  if (!invert(matrix, space.dimension(), factor)) {
    throw InputError("continuous design: the design has a singular information matrix");
  }
  return factor.trace_dual;
}

}  // namespace

ContinuousResult solve_continuous(const CandidateSpace& space, const InformationSet& grid,
                                  const ContinuousOptions& options,
                                  const ContinuousObserver& observer) {
  check(space, grid, options);
  return Run(space, grid, options, observer).run();
}

DesignedSet grid_and_support(const CandidateSpace& space, const InformationSet& grid,
                             const ContinuousResult& result) {
  const std::size_t p = grid.packed_size(), n = space.coordinate_count();
  const std::size_t count = grid.candidate_count(), support = result.support_size();
  AlignedArray rows((count + support) * p);
  std::copy(grid.data(), grid.data() + count * p, rows.begin());
  CandidateTable table = grid.candidates();
  table.values.insert(table.values.end(), result.points.begin(), result.points.end());
  const auto evaluator = space.evaluator();
  for (std::size_t j = 0; j < support; ++j) {
    evaluator->information(std::span(result.points).subspan(j * n, n),
                           rows.span().subspan((count + j) * p, p));
  }
  Design design{std::vector<double>(count, 0.0)};
  design.weights.insert(design.weights.end(), result.weights.begin(), result.weights.end());
  return {InformationSet(grid.dimension(), std::move(rows), std::move(table), grid.parameters(),
                         grid.name()),
          std::move(design)};
}

RefinedBound refined_bound(const CandidateSpace& space, const ContinuousResult& result,
                           std::size_t count,
                           const std::function<void(std::size_t, std::span<double>)>& points,
                           std::size_t searches, int threads, const WorkObserver& observer) {
  const auto counted = [&](std::string_view piece) {
    if (!observer) return Count();
    return Count(
        [&observer, piece](std::size_t done, std::size_t total) { observer(piece, done, total); });
  };
  const std::vector<double> dual = trace_dual_of(space, result);
  const std::size_t n = space.coordinate_count();
  const auto d = static_cast<double>(space.dimension());
  std::vector<double> sensitivity(count);
  price(space, dual, count, points, threads, sensitivity, counted("priced block"));
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  searches = std::min(searches, count);
  std::ranges::partial_sort(order, order.begin() + static_cast<std::ptrdiff_t>(searches),
                            [&](std::size_t a, std::size_t b) {
                              return std::pair(-sensitivity[a], a) < std::pair(-sensitivity[b], b);
                            });
  RefinedBound bound{count, -1.0, -1.0, searches, 0, 0};
  if (searches == 0) return bound;
  bound.largest_priced = sensitivity[order.front()] / d - 1.0;
  std::vector<std::vector<double>> starts(searches, std::vector<double>(n));
  for (std::size_t k = 0; k < searches; ++k) points(order[k], starts[k]);
  const std::vector<Maximum> ends =
      search(space, dual, starts, 1e-9 * d, threads, counted("search"));
  const std::vector<Maximum> different = separate(space, ends, kSameMaximum);
  bound.largest_searched = different.front().sensitivity / d - 1.0;
  bound.maxima = different.size();
  for (const Maximum& maximum : different) {
    const auto seen = std::ranges::count_if(ends, [&](const Maximum& end) {
      return distance(space, end.point, maximum.point) < kSameMaximum;
    });
    bound.seen_once += seen == 1 ? 1U : 0U;
  }
  return bound;
}

}  // namespace graybox
