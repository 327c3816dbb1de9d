#include "problems/robot_information/stiffness_samples.hpp"

#include <fmt/format.h>

#include <numeric>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/random.hpp"

namespace graybox {
namespace {

void require_valid(const StiffnessUncertainty& options, std::size_t count, std::size_t parameters) {
  if (!(options.uncertainty >= 0.0 && options.uncertainty < 1.0)) {
    throw InputError(
        fmt::format("uncertainty {} must be at least 0 and below 1: a stiffness factor is drawn "
                    "from 1 - uncertainty to 1 + uncertainty",
                    options.uncertainty));
  }
  if (count < 1) throw InputError("at least one sample is needed");
  if (parameters < 1) throw InputError("at least one parameter is needed");
}

// x in [0, 1) to a factor.
double factor(const StiffnessUncertainty& options, double x) {
  return 1.0 + options.uncertainty * (2.0 * x - 1.0);
}

}  // namespace

std::vector<Eigen::VectorXd> random_stiffness(const StiffnessUncertainty& options,
                                              std::size_t count, std::size_t parameters) {
  require_valid(options, count, parameters);
  Random random(options.seed);
  std::vector<Eigen::VectorXd> samples(count);
  for (Eigen::VectorXd& theta : samples) {
    theta.resize(static_cast<Eigen::Index>(parameters));
    for (double& x : theta) x = factor(options, random.uniform());
  }
  return samples;
}

std::vector<Eigen::VectorXd> latin_hypercube_stiffness(const StiffnessUncertainty& options,
                                                       std::size_t count, std::size_t parameters) {
  require_valid(options, count, parameters);
  Random random(options.seed);
  std::vector<Eigen::VectorXd> samples(count,
                                       Eigen::VectorXd(static_cast<Eigen::Index>(parameters)));
  std::vector<std::size_t> interval(count);
  for (Eigen::Index p = 0; p < static_cast<Eigen::Index>(parameters); ++p) {
    std::iota(interval.begin(), interval.end(), std::size_t{0});
    for (std::size_t k = count; k > 1; --k) std::swap(interval[k - 1], interval[random.below(k)]);
    for (std::size_t k = 0; k < count; ++k) {
      const double x = static_cast<double>(interval[k]) + random.uniform();
      samples[k](p) = factor(options, x / static_cast<double>(count));
    }
  }
  return samples;
}

}  // namespace graybox
