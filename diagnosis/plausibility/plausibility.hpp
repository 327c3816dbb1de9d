// Physical sanity of a fitted model, whatever its kind: what no machine has, or what the data can't
// have told.
//
// Rules, one function each. z is a value over its standard error.
//   sign        mass, inertia, stiffness, damping or friction below zero (with what the model
//               states there) by `sign_errors` standard errors; of a drive's gain it says so, and
//               does not exclude the model
//   zero        of these, one that is smaller than its error (so also a zero of the search with an
//               error), or below zero by fewer errors or without any: not determined
//   bound       a value at a bound of the search, or `runaway` times its start or more away from
//               it; damping and friction may vanish
//   size        a friction level, or the force of a law along the motion, that exceeds three times
//               what was ever carried there, by three errors
//   threshold   a gap, clearance or velocity that the recorded motion never reached, by three
//               errors where there is one
//   energy      unless the sizes of its laws leave it open: a passive law that gives out more than
//               2 % of the energy fed in at its place. The conservative part is left out; of the
//               rest, f z' >= 0 at each sample, and in sum for a law with memory. Laws of one place
//               count together
//   pair        two laws whose forces cancel: correlation below -0.95 and a sum of less than a
//               fifth of each; a constant force beside a spring may: it says where that rests. Two
//               springs of a machine that has none, which together pull back in the middle third of
//               the motion and push away, more than half as steeply, in an outer sixth
//   homogeneous a direction that the data do not see in which all parameters change by the same
//               share
//   poor input  two parameters that the data see in one combination only, or with errors correlated
//               by more than 0.9995 and relative errors above a fifth each
//   body        a body that can't exist: its pseudo-inertia [tr(I)/2 1 - I, m c; (m c)^T, m] is not
//               positive definite (Wensing, Kim and Slotine, IEEE Robotics and Automation Letters
//               3, 2018), or the principal moments about its centre of mass break the triangle
//               inequalities; by three errors, where they are known
// Each says which parameter, by how many standard errors, and what such a thing usually means.
//
//   for (const Implausibility& flaw : implausibilities(physics)) fmt::print("{}\n", flaw.words);
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/plausibility/fitted_physics.hpp"

namespace graybox {

enum class PlausibilityRule : std::int8_t {
  kSign,
  kZero,
  kBound,
  kSize,
  kThreshold,
  kEnergy,
  kPair,
  kHomogeneous,
  kPoorInput,
  kBody,
};
[[nodiscard]] const char* name_of(PlausibilityRule rule);

struct PlausibilityLimits {
  double sign_errors = 3.0;
  double size = 3.0;
  double energy_share = 0.02;
  double runaway = 1000.0;
};

struct Implausibility {
  PlausibilityRule rule = PlausibilityRule::kSign;
  std::string quantity;  // whose value it is
  double value = 0.0;
  double standard_errors = 0.0;  // how far beyond what is possible; infinite: no error
  std::string words;             // one sentence
  std::string remedy;            // what it usually means, another
  bool excludes = true;          // such a model can't be right; false: only not determined
};

// Those that exclude the model first.
[[nodiscard]] std::vector<Implausibility> implausibilities(const FittedPhysics& physics,
                                                           const PlausibilityLimits& limits = {});
// How many of them exclude the model.
[[nodiscard]] std::size_t excluding(std::span<const Implausibility> flaws);

// Whether a body can exist (the rule `body`), to a share of its own size.
[[nodiscard]] bool can_exist(const PhysicalBody& body, double tolerance = 1e-6);

}  // namespace graybox
