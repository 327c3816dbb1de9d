// In which order to run the experiments of a design: the shortest path through their coordinates.
//
//   const RunOrder order = run_order(set, candidates);   // indices into the set
//   set.coordinates(candidates[order.places.front()]);   // where to begin
//
// The length of a step is its largest change of one coordinate: the time of a move whose joints all
// turn at the same speed at once. Coordinates with different units are divided by their ranges over
// these candidates. A straight move between two points of a box stays in the box, so that such a
// path keeps the limits of the joints wherever the candidates do.
//
// Where candidates have a coordinate `block`, one block is run after the other. Each has a path of
// its own. What lies between two blocks is no part of the length.
//
// Up to kOptimalOrder candidates the path is the shortest there is, by dynamic programming over
// subsets (Held and Karp 1962), in O(n^2 2^n). Beyond, it is the best of nearest-neighbour paths,
// each improved by reversing pieces (2-opt) and by moving them (Or 1976).
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "problems/information/information_set.hpp"

namespace graybox {

inline constexpr std::size_t kOptimalOrder = 12;

struct RunOrder {
  std::vector<std::size_t> places;  // of the candidates given, first to last
  double length = 0.0;              // of the path
  std::string unit = {};            // of the length; empty where coordinates were scaled
  bool is_shortest = true;          // for certain, in each block
};

// As listed, with a length of zero, where the set has no coordinates.
[[nodiscard]] RunOrder run_order(const InformationSet& set,
                                 std::span<const std::size_t> candidates);

}  // namespace graybox
