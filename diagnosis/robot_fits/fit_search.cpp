#include "diagnosis/robot_fits/fit_search.hpp"

#include <algorithm>
#include <cmath>

#include "problems/base/error.hpp"
#include "problems/base/random.hpp"

namespace graybox {
namespace {

constexpr double kRejection = 4.0;  // lack of fit, in standard deviations
constexpr double kSamePlace = 0.1;  // standard errors
constexpr double kSameChiSquare = 0.01;

Eigen::VectorXd drawn_about(const Eigen::VectorXd& start, double spread, Random& random) {
  Eigen::VectorXd other = start;
  const double limit = std::log(spread);
  for (double& value : other) value *= std::exp(random.uniform(-limit, limit));
  return other;
}

bool same_optimum(const FitResult& best, const FitStart& other) {
  if (other.parameters.size() == 0) return false;
  if (std::abs(other.chi_square - best.chi_square) <= kSameChiSquare) return true;
  const Eigen::VectorXd difference = other.parameters - best.theta;
  return std::sqrt(difference.dot(best.information * difference)) <= kSamePlace;
}

// Marks the starts that ended where the best did, and counts them.
std::ptrdiff_t mark_best(FitSearch& search) {
  for (FitStart& each : search.starts) each.best = same_optimum(search.best, each);
  return std::ranges::count_if(search.starts, &FitStart::best);
}

}  // namespace

FitSearch search_fit(const ResponseModel& model, std::span<const ResponseMeasurement> measurements,
                     const Eigen::VectorXd& start, const FitSearchOptions& options) {
  if (options.starts < 1 || !(options.spread >= 1.0)) {
    throw InputError("fit: at least one start, and a spread of at least 1");
  }
  Random random(options.seed);
  FitSearch search;
  search.best.chi_square = std::numeric_limits<double>::infinity();
  for (int k = 0; k < options.starts; ++k) {
    if (k > 0 && options.keep_going && !options.keep_going()) break;
    FitStart each;
    each.start = k == 0 ? start : drawn_about(start, options.spread, random);
    const Eigen::VectorXd near = options.approach ? options.approach(each.start) : each.start;
    FitResult result = fit_maximum_likelihood(model, measurements, near, options.fit);
    if (result.status != FitStatus::kFailed) {
      each.parameters = result.theta;
      each.chi_square = result.chi_square;
      if (result.chi_square < search.best.chi_square) search.best = std::move(result);
    }
    search.starts.push_back(std::move(each));
    if (search.best.status == FitStatus::kFailed) continue;
    const bool is_found = mark_best(search) >= 2 && search.best.lack_of_fit() < kRejection;
    if (is_found && !options.all_starts) break;
  }
  return search;
}

}  // namespace graybox
