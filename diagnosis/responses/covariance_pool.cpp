#include "diagnosis/responses/covariance_pool.hpp"

#include <algorithm>
#include <cmath>
#include <set>

namespace graybox {
namespace {

struct Window {
  std::size_t first, last;  // lines, both included
};

// Of the mean logarithm of the outputs' noise power.
double log_level(const LineScatter& line) {
  return (line.scatter.diagonal().real().array() / line.degrees_of_freedom).log().mean();
}

// Of noise power against frequency, on logarithmic scales; 0 where there is too little to see one.
double slope(const std::vector<LineScatter>& lines, const std::vector<double>& frequencies,
             const Window& window) {
  const auto count = static_cast<double>(window.last - window.first + 1);
  if (count < 3.0) return 0.0;
  double mean_x = 0.0, mean_y = 0.0, xx = 0.0, xy = 0.0;
  for (std::size_t k = window.first; k <= window.last; ++k) {
    mean_x += std::log(frequencies[k]) / count;
    mean_y += log_level(lines[k]) / count;
  }
  for (std::size_t k = window.first; k <= window.last; ++k) {
    const double x = std::log(frequencies[k]) - mean_x;
    xx += x * x;
    xy += x * (log_level(lines[k]) - mean_y);
  }
  return std::isfinite(xy) ? xy / xx : 0.0;
}

// Lines that share bins share noise: as many degrees of freedom as there are different bins.
double degrees_of_freedom(const std::vector<LineScatter>& lines, const Window& window) {
  double sum = 0.0;
  std::size_t taken = 0;
  std::set<std::size_t> different;
  for (std::size_t k = window.first; k <= window.last; ++k) {
    sum += lines[k].degrees_of_freedom;
    taken += lines[k].bins.size();
    different.insert(lines[k].bins.begin(), lines[k].bins.end());
  }
  if (taken == 0) return sum;
  return sum * static_cast<double>(different.size()) / static_cast<double>(taken);
}

Window window_around(const std::vector<LineScatter>& lines, std::size_t line, double wanted) {
  Window window{line, line};
  while (degrees_of_freedom(lines, window) < wanted &&
         (window.first > 0 || window.last + 1 < lines.size())) {
    if (window.first > 0) --window.first;
    window.last = std::min(window.last + 1, lines.size() - 1);
  }
  return window;
}

}  // namespace

double independent_samples(const std::vector<LineScatter>& lines) {
  return lines.empty() ? 0.0 : degrees_of_freedom(lines, {0, lines.size() - 1});
}

std::vector<OutputCovariance> pool_covariances(const std::vector<LineScatter>& lines,
                                               const std::vector<double>& frequencies,
                                               double wanted) {
  std::vector<OutputCovariance> pooled;
  for (std::size_t k = 0; k < lines.size(); ++k) {
    const Window window = window_around(lines, k, wanted);
    const double power = slope(lines, frequencies, window);
    OutputCovariance result{
        Eigen::MatrixXcd::Zero(lines[k].scatter.rows(), lines[k].scatter.cols()),
        degrees_of_freedom(lines, window), window.last - window.first + 1};
    double sum = 0.0;
    for (std::size_t l = window.first; l <= window.last; ++l) {
      result.covariance += std::pow(frequencies[k] / frequencies[l], power) * lines[l].scatter;
      sum += lines[l].degrees_of_freedom;
    }
    result.covariance /= sum;
    pooled.push_back(std::move(result));
  }
  return pooled;
}

}  // namespace graybox
