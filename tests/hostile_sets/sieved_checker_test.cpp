// What the checker states with the sieve of double precision is, to the last bit, what a checker
// without one states: it takes every candidate in extended precision, and all of them again in
// quadruple precision where rounding matters.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>
#include <string>
#include <vector>

#include "problems/base/error.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/certificates/sensitivity_sieve.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/conditioning/extended_information.hpp"
#include "solvers/conditioning/quadruple.hpp"
#include "tests/hostile_sets/hostile_sets.hpp"

namespace graybox {
namespace {

using namespace testing_sets;

constexpr double kAsked = 1e-9;

struct Unsieved {
  bool regular = false;
  double gap = 0.0;
  double bound = 0.0;
  std::size_t worst = 0;
};

// Header of extended_information.hpp: each sensitivity lies between the rounded trace less its
// error, by 1 + residual, and the trace and its error, by 1 - residual.
template <class Real>
Unsieved price_all(const InformationSet& set, const std::vector<Extended>& weights) {
  using std::abs;
  const InformationIn<Real> information(set, weights);
  if (!information.regular()) return {};
  const Real d(set.dimension()), delta = information.residual(), unit = information.trace_unit(set);
  Real largest = 0, highest = 0;
  Unsieved result{.regular = true};
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    const Real sensitivity = information.sensitivity(set, i);
    if (sensitivity > largest) {
      largest = sensitivity;
      result.worst = i;
    }
    const Real above = (sensitivity + unit * information.magnitude(set, i)) / (1 - delta);
    highest = std::max<Real>(highest, above);
  }
  const Real error = unit * information.magnitude(set, result.worst);
  const Real lowest = (largest - error) / (1 + delta), gap = largest / d - 1;
  result.gap = static_cast<double>(gap);
  result.bound = static_cast<double>(std::max<Real>(highest - largest, largest - lowest) / d +
                                     Real(std::numeric_limits<double>::epsilon()) * abs(gap));
  return result;
}

bool settled(const Unsieved& first) {
  const bool open = first.gap - first.bound <= kAsked && kAsked < first.gap + first.bound;
  return first.regular && !open && first.bound <= 0.1 * std::max(first.gap, kAsked) &&
         first.gap >= -first.bound;
}

struct SieveTally {
  std::size_t certified = 0;
  std::size_t repeated = 0;  // in quadruple precision
  std::size_t sifted = 0;    // designs of which the sieve leaves less than half of the candidates
};

std::size_t left_by_sieve(const InformationSet& set, const std::vector<Extended>& weights) {
  const ExtendedInformation information(set, weights);
  if (!information.regular()) return set.candidate_count();
  std::vector<double> upper(set.candidate_count());
  const double floor = sieve_sensitivities(set, information, upper);
  return static_cast<std::size_t>(
      std::ranges::count_if(upper, [floor](double bound) { return !(bound < floor); }));
}

void compare(const InformationSet& set, const Design& design, const std::string& where,
             SieveTally& tally) {
  const Certificate proof = certify(set, design, {}, kAsked);
  const CheckedWeights checked(set, design);
  if (proof.status != CertificateStatus::kCertified || !checked.message.empty()) return;
  Unsieved expected = price_all<Extended>(set, checked.weights);
  if (!settled(expected)) {
    ++tally.repeated;
    const Unsieved again = price_all<Quadruple>(set, checked.weights);
    if (again.regular) expected = again;
  }
  ++tally.certified;
  tally.sifted += 2 * left_by_sieve(set, checked.weights) < set.candidate_count() ? 1U : 0U;
  EXPECT_EQ(proof.duality_gap, expected.gap) << where;
  EXPECT_EQ(proof.rounding_bound, expected.bound) << where;
  EXPECT_EQ(proof.worst_candidate, expected.worst) << where;
}

Design random_design(std::size_t count, Random& random) {
  Design design{std::vector<double>(count)};
  double total = 0.0;
  for (double& weight : design.weights) total += weight = std::pow(random.uniform(), 8);
  for (double& weight : design.weights) weight /= total;
  return design;
}

TEST(SievedChecker, StatesWhatOneWithoutASieveStatesOnHostileSets) {
  const std::uint64_t seed = fresh_seed();
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  SieveTally tally;
  const std::size_t kinds = hostile_kinds().size();
  for (std::size_t n = 0; n < 60 * kinds; ++n) {
    const InformationSet set = hostile_set(n % kinds, random);
    const std::string where = set.name() + ", seed " + std::to_string(seed);
    compare(set, random_design(set.candidate_count(), random), where, tally);
    try {
      set.validate();
      const Solution solution = ColumnGeneration().solve(set, {.duality_gap = kAsked});
      if (!solution.design.weights.empty()) compare(set, solution.design, where, tally);
    } catch (const InputError&) {
      continue;  // as in a command: a singular set is refused
    }
  }
  std::cout << tally.certified << " designs, " << tally.repeated << " in quadruple precision, "
            << tally.sifted << " sifted\n";
  EXPECT_GE(tally.certified, 60 * kinds);
  EXPECT_GE(tally.repeated, kinds);
  EXPECT_GE(tally.sifted, 10 * kinds);
}

}  // namespace
}  // namespace graybox
