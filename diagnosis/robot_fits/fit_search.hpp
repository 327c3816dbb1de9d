// Maximum-likelihood fits from several starts, and which of them ended in the same optimum.
//
// The first start is the caller's; the others are drawn about it, each log theta_p uniform within
// log(spread), as theta may be off by that factor either way. Each start runs `approach`, where
// there is one, and from where that leads fit_maximum_likelihood() with its closed-loop stage
// (whose header says why the response itself is no guide from far). The search ends early once two
// starts agree on the best optimum and its chi-square is not rejected: (chi-square - dof) / sqrt(2
// dof) < 4.
//
// Two starts ended in the same optimum where they lie within 0.1 standard errors of each other,
// (delta^T H delta)^(1/2) <= 0.1. They also did where their chi-squares differ by less than 0.01
// (where parameters are not seen, theta is free).
//
//   const FitSearch search = search_fit(model, measurements, theta_0, {.starts = 8});
//   use(search.best.theta, search.starts);
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "diagnosis/estimation/fit_report.hpp"
#include "diagnosis/response_fits/maximum_likelihood.hpp"

namespace graybox {

struct FitSearchOptions {
  int starts = 8;           // at most
  bool all_starts = false;  // go on when two agree: how often is the optimum found?
  double spread = 3.0;      // of the further starts, at least 1
  std::uint64_t seed = 1;   // of the further starts
  FitOptions fit;           // of each
  // Carries a start towards the optimum before it is fitted (constitutive_stage.hpp).
  std::function<Eigen::VectorXd(const Eigen::VectorXd&)> approach;
  std::function<bool()> keep_going;  // asked between starts
};

struct FitSearch {
  FitResult best;                // status kFailed where no start led anywhere
  std::vector<FitStart> starts;  // in the order made
};

// Throws InputError like fit_maximum_likelihood(), and for options out of range.
[[nodiscard]] FitSearch search_fit(const ResponseModel& model,
                                   std::span<const ResponseMeasurement> measurements,
                                   const Eigen::VectorXd& start,
                                   const FitSearchOptions& options = {});

}  // namespace graybox
