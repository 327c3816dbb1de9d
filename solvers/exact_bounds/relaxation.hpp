// The relaxed problem (paper, formula (9)) as every exact method needs it: weights lambda*, what
// the checker proves about them, and the bound that they put on all exact designs,
//
//   log det M(m) <= d log M + log det M(lambda) + d log(1 + duality_gap)
//   for every m, sum m_i = M,
//
// since m / M is a point of the simplex (certificate.hpp). In the paper's words, V(M lambda*) <=
// V(m*). Rounding: gap and log det are raised by the checker's own bound of their error.
//
//   const Relaxation relaxation = solve_relaxation(set, {.threads = 2});
//   const double bound = relaxation.log_det_bound(20);
//
// Cost: one run of column_generation, one certificate, one pass in extended precision for the
// sensitivities.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/conditioning/extended_information.hpp"
#include "solvers/core/design.hpp"

namespace graybox {

struct Relaxation {
  std::vector<double> weights;           // lambda, length Q
  std::vector<double> sensitivities;     // w_i = tr(M(lambda)^-1 H_i) from extended precision, Q
  std::vector<Extended> inverse_factor;  // X, lower triangular d x d, with X M(lambda) X^T = I
  Certificate certificate;               // of the weights; its status says whether all this holds
  double log_det_ceiling = 0.0;          // no approximate design has a larger log det
  std::size_t dimension = 0;
  std::size_t largest_rank = 0;  // max_i rank H_i, numerically
  double seconds = 0.0;

  // No exact design of M experiments has a larger log det.
  [[nodiscard]] double log_det_bound(std::int64_t experiments) const;
};

struct RelaxationOptions {
  double duality_gap = 1e-10;
  double time_limit = std::numeric_limits<double>::infinity();  // s; the bound is looser then
  std::uint64_t seed = 1;
  int threads = 1;
};

// What any regular design at hand proves; the better it is, the more. Throws InputError where
// M(lambda) is singular.
[[nodiscard]] Relaxation certified_relaxation(const InformationSet& set, Design design,
                                              int threads = 1);

// The same for the optimum. Throws InputError where no design is regular.
[[nodiscard]] Relaxation solve_relaxation(const InformationSet& set,
                                          const RelaxationOptions& options = {});

// A bound on the error of log det M. Let X be the computed inverse factor and ||X M X^T - I|| <=
// delta = residual(). Then log det M = -2 log det X + log det(I + E) with |log det(I + E)| <= d
// delta / (1 - delta). The weights and the result are rounded to double besides.
[[nodiscard]] double log_det_rounding(const ExtendedInformation& information,
                                      std::size_t dimension);

}  // namespace graybox
