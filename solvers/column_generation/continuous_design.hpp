// D-optimal design over a continuum of candidates (candidate_space.hpp), by column generation:
//
//   maximise log det sum_j lambda_j H(x_j)   over points x_j of the box and weights on the simplex.
//
// The optimality condition is that of certificate.hpp with the maximum over the box: for W = M^-1,
// max_x tr(W H(x)) = d. With s = the true maximum of the sensitivity tr(W H(x)) over the box,
//
//   0 <= log det M* - log det M <= d log(s / d).
//
// A round searches the largest sensitivity by local searches (box_search.hpp). They start from the
// best separate candidates of the grid, from the present support and from the best of many random
// points, fresh in each round. It then adds the maxima above d as columns and solves for the
// weights by Newton's method (working_set.hpp). It ends when `confirmations` rounds in a row find
// no more than d (1 + gap), each from its own random points. Then support points that have gathered
// about one maximum are merged.
//
// What is proven. The sensitivity is not concave in x, so a search may miss the global maximum. The
// result is therefore certified over the grid and the columns (certify() on grid_and_support()),
// and `gap` is what the searches found. The function refined_bound() prices many more points with
// the final W and searches from the best of them. Its figure is evidence for the box. It becomes a
// proof only with a bound on the slope of the sensitivity, which nothing here knows.
//
//   const ContinuousResult result = solve_continuous(space, grid, {.duality_gap = 1e-6});
//
// Cost of a round: random_points evaluations of H, and 200 to 500 for each start. Threads share
// both; the result does not depend on their number.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string_view>
#include <vector>

#include "problems/information/candidate_space.hpp"
#include "problems/information/information_set.hpp"
#include "solvers/core/solver.hpp"

namespace graybox {

struct ContinuousOptions {
  double duality_gap = 1e-6;  // > 0
  int round_limit = 60;
  std::size_t grid_starts = 30;       // searches a round from the grid
  std::size_t random_starts = 60;     // and from the best of
  std::size_t random_points = 20000;  // so many random ones
  int confirmations = 3;              // rounds without a find that end the search; >= 1
  std::uint64_t seed = 1;             // of the random points and of the design on the grid
  int threads = 1;
  // Support points nearer than this, in every coordinate and as a share of the box, are one.
  double merge_distance = 0.02;
};

struct ContinuousRound {
  int round = 0;            // 0: the optimum on the grid
  std::size_t columns = 0;  // in the working set
  std::size_t support = 0;  // with weight
  double log_det = 0.0;     // before the search
  double found_gap = 0.0;   // largest sensitivity found / d - 1
  double farthest_from_grid =
      0.0;  // of support points, from the nearest candidate: share of the box
};

struct ContinuousResult {
  SolveStatus status = SolveStatus::kNumericalFailure;
  std::vector<double> points;   // support, n numbers each
  std::vector<double> weights;  // each above 0
  double log_det = 0.0;
  double gap = 0.0;  // largest sensitivity / d - 1 that the last rounds found, grid and box
  double grid_log_det = 0.0;  // optimum on the grid (to gap 1e-9)
  // Largest sensitivity that was found for the design on the grid, / d - 1.
  double grid_gap_in_box = 0.0;
  std::vector<double> grid_points;   // support of the design on the grid
  std::vector<double> grid_weights;  //
  std::size_t unmerged_support = 0;
  std::vector<ContinuousRound> rounds;

  [[nodiscard]] std::size_t support_size() const { return weights.size(); }
};

// Watches the rounds; returning false stops with what there is (status time_limit).
using ContinuousObserver = std::function<bool(const ContinuousRound&)>;

// `grid`: an information set whose candidate coordinates are points of the box, with a regular sum.
// Throws InputError where they are not, or for options out of range. Statuses: solved (gap
// reached), iteration_limit (rounds), time_limit (observer), numerical_failure (the weights can't
// be improved).
[[nodiscard]] ContinuousResult solve_continuous(const CandidateSpace& space,
                                                const InformationSet& grid,
                                                const ContinuousOptions& options = {},
                                                const ContinuousObserver& observer = {});

// The grid with the support points behind it, and the design on this set: what certify() judges.
struct DesignedSet {
  InformationSet set;
  Design design;
};
[[nodiscard]] DesignedSet grid_and_support(const CandidateSpace& space, const InformationSet& grid,
                                           const ContinuousResult& result);

// What pricing `count` more points says of the largest sensitivity in the box.
struct RefinedBound {
  std::size_t count = 0;
  double largest_priced = 0.0;    // largest sensitivity / d - 1 over the points themselves
  double largest_searched = 0.0;  // after local searches from the best of them
  std::size_t searches = 0;
  // Different maxima that the searches ended in, and how many of those were found once only. By
  // Good (1953), seen_once / searches estimates the chance that one more search from such a start
  // ends in a maximum not yet seen.
  std::size_t maxima = 0;
  std::size_t seen_once = 0;
};
// Watches work that is counted: first with 0, then after each piece; one call at a time.
using WorkObserver =
    std::function<void(std::string_view piece, std::size_t done, std::size_t total)>;

// points(i, out) writes point i < count; it is called from several threads. The pieces of work are
// blocks of points ("priced block"), then "search".
[[nodiscard]] RefinedBound refined_bound(
    const CandidateSpace& space, const ContinuousResult& result, std::size_t count,
    const std::function<void(std::size_t, std::span<double>)>& points, std::size_t searches,
    int threads, const WorkObserver& observer = {});

}  // namespace graybox
