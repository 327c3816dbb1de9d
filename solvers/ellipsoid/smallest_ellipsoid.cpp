#include "solvers/ellipsoid/smallest_ellipsoid.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "problems/base/aligned_array.hpp"
#include "problems/base/available_memory.hpp"
#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "problems/base/stop.hpp"
#include "solvers/column_generation/screening.hpp"
#include "solvers/ellipsoid/spanning_points.hpp"
#include "solvers/pricing/candidate_pool.hpp"
#include "solvers/pricing/sensitivity_sample.hpp"
#include "solvers/restricted_problem/working_set.hpp"

namespace graybox {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kRoughGap = 0.03;
constexpr double kShareForRounding = 0.1;  // of the gap, left to the certificate
constexpr int kPassesWithoutProgress = 8;

// Points that one pricing looks at, copied, with the squared distances D.
struct PointPool {
  PointSet points;
  std::vector<std::size_t> indices;
  AlignedArray distances;
};

class EllipsoidRun {
 public:
  EllipsoidRun(const PointSet& points, const EllipsoidOptions& options)
      : points_(points),
        options_(options),
        random_(options.seed),
        n_(static_cast<double>(points.dimension)),
        lifted_(points.dimension + (options.centred ? 0 : 1)),
        d_(static_cast<double>(lifted_)),
        offset_(options.centred ? 0.0 : 1.0),
        packed_(packed_size(lifted_)) {}

  EllipsoidSolution run();

 private:
  using Clock = std::chrono::steady_clock;

  [[nodiscard]] PointPool sample(std::size_t count);
  [[nodiscard]] PointPool short_list(std::span<const double> distances);
  void start(const PointPool& first);
  void warm_up();
  [[nodiscard]] bool price(const PointSet& points, std::span<double> out);
  [[nodiscard]] double gap_of(std::span<const double> distances) const;
  std::size_t add_violators(std::span<const double> distances,
                            std::span<const std::size_t> indices);
  [[nodiscard]] bool improve(double gap, double tolerance);
  void solve_pool(PointPool& pool, double tolerance, int round_limit);
  [[nodiscard]] bool find_frame() {
    return support_frame(points_, members_, options_.centred, frame_);
  }
  void find_frame_or_start_again();
  void lift(std::size_t member, ExtendedPlace& place);
  [[nodiscard]] double working_gap(double share) const;
  [[nodiscard]] EllipsoidSolution finish(EllipsoidStatus status);
  void certify_scaled(EllipsoidSolution& solution);

  const PointSet& points_;
  const EllipsoidOptions& options_;
  Random random_;
  double n_;
  std::size_t lifted_;  // d
  double d_;
  double offset_;  // sensitivity = distance + offset
  Clock::time_point start_ = Clock::now();
  WeightedPoints first_members_;  // span the space
  WeightedPoints members_;        // of the working set, some of weight zero
  Ellipsoid frame_;
  std::vector<double> packed_;  // q q^T of one point
  double best_gap_ = kInfinity;
  double best_distance_ = 0.0;
  WeightedPoints best_members_;
  Ellipsoid best_frame_;
  double passes_ = 0.0;
  std::int64_t rounds_ = 0;
};

PointPool EllipsoidRun::sample(std::size_t count) {
  PointPool pool;
  pool.indices = sample_pool(points_.count, count, random_).indices;
  pool.points = subset(points_, pool.indices);
  pool.distances = AlignedArray(count);
  return pool;
}

// The gap of the design problem (certificate.hpp) that gives the share of the gap in volume.
double EllipsoidRun::working_gap(double share) const {
  return n_ / d_ * std::expm1(2.0 * share * std::log1p(options_.gap) / n_);
}

bool EllipsoidRun::price(const PointSet& points, std::span<double> out) {
  const StopClock clock;
  passes_ += static_cast<double>(points.count) / static_cast<double>(points_.count);
  return squared_distances(points, frame_, options_.threads, clock, out);
}

double EllipsoidRun::gap_of(std::span<const double> distances) const {
  return (*std::ranges::max_element(distances) + offset_) / d_ - 1.0;
}

// `indices` empty: all points.
std::size_t EllipsoidRun::add_violators(std::span<const double> distances,
                                        std::span<const std::size_t> indices) {
  std::size_t added = 0;
  for (const std::size_t k : violators(distances, n_, 3 * lifted_, 6 * lifted_, random_)) {
    const std::size_t i = indices.empty() ? k : indices[k];
    if (std::ranges::find(members_.indices, i) != members_.indices.end()) continue;
    members_.indices.push_back(i);
    members_.weights.push_back(0.0);
    ++added;
  }
  return added;
}

void EllipsoidRun::lift(std::size_t member, ExtendedPlace& place) {
  place_in_frame(points_, members_.indices[member], frame_, place);
  if (offset_ > 0.0) place.y.push_back(1.0L);
  std::size_t k = 0;
  for (std::size_t i = 0; i < lifted_; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      packed_[k++] = static_cast<double>(place.y[i] * place.y[j]);
    }
  }
}

// Newton on the members after a pricing with the given gap, in the present frame. False where no
// further step is possible.
bool EllipsoidRun::improve(double gap, double tolerance) {
  constexpr int kSteps = 30, kStepsBetweenStops = 2;
  ++rounds_;
  WorkingSet working(lifted_);
  ExtendedPlace place;
  for (std::size_t k = 0; k < members_.indices.size(); ++k) {
    lift(k, place);
    working.add(members_.indices[k], packed_.data(), members_.weights[k]);
  }
  const double target = std::max(0.3 * tolerance, std::min(0.1 * gap, gap * gap));
  WorkingSetStatus status = WorkingSetStatus::kStopped;
  for (int step = 0; step < kSteps && status == WorkingSetStatus::kStopped && !stop_requested();
       step += kStepsBetweenStops) {
    status = working.optimise(target, kStepsBetweenStops);
  }
  if (status == WorkingSetStatus::kSingular) return false;
  // Of many points nearly as far as the farthest most never return; those that do are cheap to add.
  const double own_gap = std::sqrt(std::max(working.gap(), 0.0));
  working.drop_below(d_ * (1.0 - std::max(0.3 * gap, 3.0 * own_gap)));
  members_.indices.assign(working.indices().begin(), working.indices().end());
  members_.weights.assign(working.weights().begin(), working.weights().end());
  return status != WorkingSetStatus::kNoProgress;
}

// Rounds of price, add, solve on one pool until its gap is at most `tolerance`.
void EllipsoidRun::solve_pool(PointPool& pool, double tolerance, int round_limit) {
  for (int round = 0; round < round_limit && !stop_requested(); ++round) {
    if (!find_frame() || !price(pool.points, pool.distances.span())) return;
    const double gap = gap_of(pool.distances.span());
    if (gap <= tolerance) return;
    const std::size_t added = add_violators(pool.distances.span(), pool.indices);
    if (!improve(gap, tolerance) && added == 0) return;
  }
}

// Points that span the space, from a sample or, where that lies in a hyperplane, from all.
void EllipsoidRun::start(const PointPool& first) {
  SpanningPoints spanning;
  if (!first.indices.empty()) {
    spanning = spanning_points(first.points, options_.centred);
    for (std::size_t& i : spanning.indices) i = first.indices[i];
  }
  if (first.indices.empty() || spanning.dependent < points_.dimension) {
    passes_ += 1.0;
    spanning = spanning_points(points_, options_.centred);
  }
  members_ = {spanning.indices, std::vector<double>(spanning.indices.size(), 1.0)};
  first_members_ = members_;
  if (spanning.dependent < points_.dimension || !find_frame()) {
    throw InputError(fmt::format(
        "{}: up to rounding the points lie in a hyperplane, and the smallest ellipsoid has no "
        "volume: column '{}' follows from the others; leave it out",
        points_.path, points_.names[std::min(spanning.dependent, points_.dimension - 1)]));
  }
}

void EllipsoidRun::warm_up() {
  const std::size_t total = points_.count;
  const std::size_t first = std::clamp(total / 16, std::size_t{256}, std::size_t{4096});
  PointPool pool;
  if (2 * first < total) pool = sample(first);
  start(pool);
  if (pool.indices.empty()) return;
  solve_pool(pool, kRoughGap, 6);
  for (std::size_t size = 16 * first; size * 4 < total; size *= 16) {
    pool = sample(size);
    solve_pool(pool, kRoughGap, 4);
  }
}

// Where rounding has left weights whose points lie in a hyperplane, those of the start.
void EllipsoidRun::find_frame_or_start_again() {
  if (find_frame()) return;
  members_ = first_members_;
  static_cast<void>(find_frame());  // start() has seen that it can be found
}

// The points on which to go on after a pass over all: those that can touch the smallest ellipsoid
// where they are few enough (screening.hpp), otherwise the farthest.
PointPool EllipsoidRun::short_list(std::span<const double> distances) {
  const std::size_t count = points_.count;
  const std::size_t wanted = std::clamp(count / 16, std::size_t{512}, std::size_t{65536});
  const double largest = *std::ranges::max_element(distances) + offset_;
  double threshold = harman_pronzato_threshold(largest, lifted_) - offset_;
  if (count > 2 * wanted) {
    threshold = std::max(threshold, SensitivitySample(distances).exceeded_by(wanted));
  }
  PointPool pool;
  for (std::size_t i = 0; i < count; ++i) {
    if (distances[i] >= threshold) pool.indices.push_back(i);
  }
  pool.points = subset(points_, pool.indices);
  pool.distances = AlignedArray(pool.indices.size());
  return pool;
}

EllipsoidSolution EllipsoidRun::run() {
  warm_up();
  AlignedArray distances(points_.count);
  for (int without_progress = 0;;) {
    find_frame_or_start_again();
    if (!price(points_, distances.span())) break;
    const double gap = gap_of(distances.span());
    without_progress = gap < 0.9 * best_gap_ ? 0 : without_progress + 1;
    if (gap < best_gap_) {
      best_gap_ = gap;
      best_distance_ = gap * d_ + n_;
      best_members_ = members_;
      best_frame_ = frame_;
    }
    if (gap <= working_gap(1.0 - kShareForRounding)) {
      EllipsoidSolution solution = finish(EllipsoidStatus::kSolved);
      if (solution.certificate.contains_all() &&
          solution.certificate.volume_bound <= options_.gap) {
        return solution;
      }
    }
    if (stop_requested()) break;
    if (without_progress > kPassesWithoutProgress) {
      return finish(EllipsoidStatus::kNumericalFailure);
    }
    PointPool list = short_list(distances.span());
    add_violators(distances.span(), {});
    static_cast<void>(improve(gap, working_gap(1.0)));
    solve_pool(list, working_gap(0.5), 30);
  }
  if (best_gap_ == kInfinity) stop_if_requested();
  return finish(stop_requested() ? EllipsoidStatus::kTimeLimit
                                 : EllipsoidStatus::kNumericalFailure);
}

// The best frame scaled to contain all points. What rounding of its entries adds, the certificate
// sees, and the next try takes away. The entries of a thin ellipsoid round anew with every scale,
// so the margin grows.
void EllipsoidRun::certify_scaled(EllipsoidSolution& solution) {
  constexpr int kTries = 6;
  double margin = 0x1p-50;
  double scale = (1.0 - margin) / std::sqrt(best_distance_);
  for (int k = 0; k < kTries; ++k) {
    solution.ellipsoid = best_frame_;
    for (double& entry : solution.ellipsoid.factor) entry *= scale;
    solution.certificate = certify_ellipsoid(points_, solution.ellipsoid, solution.support,
                                             options_.centred, options_.threads);
    passes_ += 1.0;
    if (solution.certificate.contains_all()) return;
    margin *= 4.0;
    scale *= (1.0 - margin) / solution.certificate.largest_distance;
  }
}

EllipsoidSolution EllipsoidRun::finish(EllipsoidStatus status) {
  EllipsoidSolution solution;
  for (std::size_t k = 0; k < best_members_.indices.size(); ++k) {
    if (!(best_members_.weights[k] > 0.0)) continue;
    solution.support.indices.push_back(best_members_.indices[k]);
    solution.support.weights.push_back(best_members_.weights[k]);
  }
  std::vector<double>& weights = solution.support.weights;
  const double total = std::accumulate(weights.begin(), weights.end(), 0.0);
  for (double& weight : weights) weight /= total;
  certify_scaled(solution);
  solution.status = status;
  solution.passes = passes_;
  solution.rounds = rounds_;
  solution.seconds = std::chrono::duration<double>(Clock::now() - start_).count();
  return solution;
}

// The working set keeps packed matrices of 8 d points twice, and more where it has to.
void require_memory_for_newton(const PointSet& points) {
  const std::size_t d = points.dimension + 1;
  require_memory(2 * 8 * d * packed_size(d) * sizeof(double),
                 fmt::format("the smallest ellipsoid in {} dimensions", points.dimension),
                 "use fewer columns");
}

void require_options(const EllipsoidOptions& options) {
  if (!(options.gap > 0.0) || !std::isfinite(options.gap)) {
    throw InputError(
        fmt::format("gap {} must be a positive number, for example 1e-6", options.gap));
  }
  if (!(options.time_limit > 0.0)) {
    throw InputError(fmt::format("time limit {} s must be positive", options.time_limit));
  }
  if (options.threads < 1) {
    throw InputError(fmt::format("thread count {} must be at least 1", options.threads));
  }
}

}  // namespace

std::string_view to_string(EllipsoidStatus status) {
  switch (status) {
    case EllipsoidStatus::kSolved:
      return "solved";
    case EllipsoidStatus::kTimeLimit:
      return "time_limit";
    case EllipsoidStatus::kNumericalFailure:
      return "numerical_failure";
  }
  return "";
}

EllipsoidSolution smallest_ellipsoid(const PointSet& points, const EllipsoidOptions& options) {
  require_options(options);
  require_memory_for_newton(points);
  const TimeLimit limit(options.time_limit);
  return EllipsoidRun(points, options).run();
}

}  // namespace graybox
