// Figure 4 of the paper: the covariance (det sum_i m_i H_i)^(-1/d) against the number of
// experiments M, for several ways to spend them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/core/design.hpp"

namespace graybox::bench {

// One M. All covariances in units of the relaxed optimum's with one experiment, so that `relaxed`
// is 1/M. Infinite where the information matrix is singular.
struct CurvePoint {
  std::size_t experiments = 0;
  double relaxed = 0.0;      // V(M lambda): lower bound on all others where lambda is optimal
  double rounded = 0.0;      // the paper's footnote 3
  double best_single = 0.0;  // all in the best single candidate: best / M
  double random_mean = 0.0;  // M random candidates (with repetition): mean over the repetitions,
  double random_low = 0.0;   //   5 % and
  double random_high = 0.0;  //   95 % quantile
  double random_one_mean = 0.0;  // all in one random candidate: mean over all candidates
};

struct CurveOptions {
  std::size_t experiments = 100;  // M = 1 ... experiments
  std::size_t repetitions = 1000;
  std::uint64_t seed = 1;
};

// Throws InputError if the design does not fit the set or is singular, or a count is zero. Cost
// O(repetitions * experiments * d^3).
[[nodiscard]] std::vector<CurvePoint> experiment_curve(const InformationSet& set,
                                                       const Design& relaxed,
                                                       const CurveOptions& options);

// One column a member, named like it; infinite values are left empty.
[[nodiscard]] std::string to_csv(const std::vector<CurvePoint>& curve);

}  // namespace graybox::bench
