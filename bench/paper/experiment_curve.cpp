#include "bench/paper/experiment_curve.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "bench/paper/covariance_table.hpp"
#include "problems/base/error.hpp"
#include "problems/base/quantile.hpp"
#include "problems/base/random.hpp"
#include "solvers/core/inverse_cholesky.hpp"
#include "solvers/core/sensitivity.hpp"
#include "solvers/exact/rounding.hpp"

namespace graybox::bench {
namespace {

// covariances[M - 1][r]: covariance of the first M of the r-th sequence of random candidates.
std::vector<std::vector<double>> random_covariances(const InformationSet& set,
                                                    const CurveOptions& options) {
  const double d = static_cast<double>(set.dimension());
  std::vector<std::vector<double>> covariances(options.experiments,
                                               std::vector<double>(options.repetitions));
  std::vector<double> sum(set.packed_size());
  InverseCholesky factor(set.dimension());
  Random random(options.seed);
  for (std::size_t r = 0; r < options.repetitions; ++r) {
    std::ranges::fill(sum, 0.0);
    for (std::size_t m = 0; m < options.experiments; ++m) {
      const auto added = set.information(random.below(set.candidate_count()));
      std::ranges::transform(sum, added, sum.begin(), std::plus<>());
      covariances[m][r] = std::exp(-factor.log_det_of(sum) / d);
    }
  }
  return covariances;
}

std::string cell(double value) {
  return std::isfinite(value) ? fmt::format(",{:.10g}", value) : std::string(",");
}

double mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

}  // namespace

std::vector<CurvePoint> experiment_curve(const InformationSet& set, const Design& relaxed,
                                         const CurveOptions& options) {
  if (options.experiments == 0) throw InputError("number of experiments: must be at least 1");
  if (options.repetitions == 0) throw InputError("random repetitions: must be at least 1");
  const double d = static_cast<double>(set.dimension());
  const double unit = design_covariance(set, relaxed);
  const std::vector<double> single = single_candidate_covariances(set);
  const double best = *std::ranges::min_element(single) / unit;
  const double average = mean(single) / unit;
  std::vector<std::vector<double>> random = random_covariances(set, options);
  std::vector<CurvePoint> curve;
  for (std::size_t m = 1; m <= options.experiments; ++m) {
    const double count = static_cast<double>(m);
    std::vector<double>& draws = random[m - 1];
    std::ranges::sort(draws);
    CurvePoint point{.experiments = m, .relaxed = 1.0 / count};
    const auto counts = round_weights(relaxed.weights, static_cast<std::int64_t>(m));
    const std::vector<double> rounded(counts.begin(), counts.end());
    point.rounded = std::exp(-log_det_information(set, rounded) / d) / unit;
    point.best_single = best / count;
    point.random_mean = mean(draws) / unit;
    point.random_low = quantile(draws, 0.05) / unit;
    point.random_high = quantile(draws, 0.95) / unit;
    point.random_one_mean = average / count;
    curve.push_back(point);
  }
  return curve;
}

std::string to_csv(const std::vector<CurvePoint>& curve) {
  std::string text =
      "experiments,relaxed,rounded,best_single,random_mean,random_low,random_high,"
      "random_one_mean\n";
  for (const CurvePoint& point : curve) {
    text += fmt::format("{}", point.experiments) + cell(point.relaxed) + cell(point.rounded) +
            cell(point.best_single) + cell(point.random_mean) + cell(point.random_low) +
            cell(point.random_high) + cell(point.random_one_mean) + "\n";
  }
  return text;
}

}  // namespace graybox::bench
