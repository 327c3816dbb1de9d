// Is it this law, or only one like it? What a fit leaves at the places of its own laws.
//
// The chi-square of all residuals has power against everything, and so little against anything:
// among 8000 residuals the force k z^5 passes as play, though the two differ by 220 in -2 log
// likelihood. Where a law of the catalogue is the true one, nothing is left at its place that
// another law there would explain. Where it only stands for one that the catalogue lacks, something
// is. The score tests (score_test.hpp) of the laws at that place see it. They are asked as a
// family: the least p-value against those of draws of pure noise.
//
// No law of a catalogue is exact either: corners are rounder, dry friction has a little of
// everything. A departure is significantly more than a share `imperfection` of what the fit's laws
// explain, too (of all of them: what a large effect leaves is seen at the places of small ones).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "diagnosis/hypotheses/mismatch_problem.hpp"

namespace graybox {

// At the place of a law: the one that explains most of what that law leaves there.
struct Departure {
  LawStart start;
  double statistic = 0.0;  // chi-square of its score test, of so many degrees of freedom
  double degrees_of_freedom = 0.0;
  double p_value = 1.0;  // of that test alone
  double share = 0.0;    // statistic over what the fit's laws explain
};

struct ShapeComparison {
  bool could_tell = false;            // a law was there to ask
  std::vector<Departure> departures;  // the best of each place, the least p-value first
};

struct ShapeTest {
  double level = 0.01;  // family-wise, of all laws at all these places; and of `imperfection`
  double imperfection = 1e-3;  // share of `explained` that no law is asked to describe
  double explained = 0.0;      // deviance that the fit's laws lower
  std::uint64_t seed = 1;
};

// What of these hypotheses, each at the place of a law of the fit, departs. The noise must be
// known. Cost: a ranking of them, and only where one may depart another with 10 / level draws.
[[nodiscard]] ShapeComparison compare_shapes(const MismatchProblem& problem, const ExtendedFit& fit,
                                             std::span<const std::size_t> hypotheses,
                                             const ShapeTest& test);

}  // namespace graybox
