#include "bench/study/statistics.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "problems/base/error.hpp"
#include "problems/base/quantile.hpp"
#include "problems/base/random.hpp"

namespace graybox::bench {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// The share of all values, infinite ones among them, that is at most each of the finite ones.
template <typename Step>
std::vector<Step> shares_up_to(std::vector<double> values) {
  std::ranges::sort(values);
  std::vector<Step> steps;
  for (std::size_t k = 0; k < values.size() && std::isfinite(values[k]); ++k) {
    if (k + 1 < values.size() && values[k + 1] == values[k]) continue;
    steps.push_back({values[k], static_cast<double>(k + 1) / static_cast<double>(values.size())});
  }
  return steps;
}

}  // namespace

Quartiles quartiles(std::vector<double> sample) {
  if (sample.empty()) throw InputError("quartiles of an empty sample");
  std::ranges::sort(sample);
  return {quantile(sample, 0.25), quantile(sample, 0.5), quantile(sample, 0.75)};
}

double student_975(std::size_t degrees_of_freedom) {
  constexpr std::array kTable{12.7062, 4.3027, 3.1824, 2.7764, 2.5706,
                              2.4469,  2.3646, 2.3060, 2.2622, 2.2281};
  if (degrees_of_freedom == 0) return kInfinity;
  if (degrees_of_freedom <= kTable.size()) return kTable[degrees_of_freedom - 1];
  // Expansion about the normal quantile z (Abramowitz and Stegun 26.7.5).
  constexpr double z = 1.959964;
  const auto n = static_cast<double>(degrees_of_freedom);
  return z + (std::pow(z, 3) + z) / (4 * n) +
         (5 * std::pow(z, 5) + 16 * std::pow(z, 3) + 3 * z) / (96 * n * n);
}

std::optional<PowerLaw> fit_power_law(std::span<const double> x, std::span<const double> y) {
  const std::size_t n = x.size();
  if (n != y.size()) throw InputError("a power law needs as many x as y");
  double mean_x = 0.0, mean_y = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    mean_x += std::log(x[k]) / static_cast<double>(n);
    mean_y += std::log(y[k]) / static_cast<double>(n);
  }
  double xx = 0.0, xy = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    xx += (std::log(x[k]) - mean_x) * (std::log(x[k]) - mean_x);
    xy += (std::log(x[k]) - mean_x) * (std::log(y[k]) - mean_y);
  }
  if (n < 2 || !(xx > 0.0)) return std::nullopt;
  PowerLaw law{.exponent = xy / xx, .points = n};
  law.factor = std::exp(mean_y - law.exponent * mean_x);
  if (n == 2) return law;
  double residual = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    const double error = std::log(y[k]) - mean_y - law.exponent * (std::log(x[k]) - mean_x);
    residual += error * error;
  }
  const double half = student_975(n - 2) * std::sqrt(residual / static_cast<double>(n - 2) / xx);
  law.lower = law.exponent - half;
  law.upper = law.exponent + half;
  return law;
}

std::optional<double> crossover(std::span<const double> x, std::span<const double> a,
                                std::span<const double> b) {
  std::optional<double> at;
  for (std::size_t k = 0; k < x.size(); ++k) {
    if (a[k] < b[k]) {
      at.reset();  // b is above again: only the last crossing counts
    } else if (!at && k == 0) {
      at = x[0];
    } else if (!at) {
      const double before = std::log(a[k - 1] / b[k - 1]);  // < 0
      const double after = std::log(a[k] / b[k]);           // >= 0
      const double share = before / (before - after);
      at = std::exp(std::log(x[k - 1]) + share * std::log(x[k] / x[k - 1]));
    }
  }
  return at;
}

std::vector<std::vector<ProfileStep>> performance_profiles(
    const std::vector<std::vector<double>>& times) {
  const std::vector<double> best = virtual_best(times);
  std::vector<std::vector<ProfileStep>> profiles;
  for (const auto& row : times) {
    std::vector<double> ratios;
    for (std::size_t i = 0; i < row.size(); ++i) {
      ratios.push_back(std::isfinite(row[i]) ? row[i] / best[i] : kInfinity);
    }
    profiles.push_back(shares_up_to<ProfileStep>(std::move(ratios)));
  }
  return profiles;
}

std::vector<std::vector<BudgetStep>> data_profiles(const std::vector<std::vector<double>>& costs) {
  std::vector<std::vector<BudgetStep>> profiles;
  for (const auto& row : costs) profiles.push_back(shares_up_to<BudgetStep>(row));
  return profiles;
}

double shifted_geometric_mean(std::span<const double> times, double shift, double charge) {
  if (times.empty()) throw InputError("a mean of no times");
  double sum = 0.0;
  for (const double time : times) {
    const double shifted = (std::isfinite(time) ? time : charge) + shift;
    if (!(shifted > 0.0)) throw InputError("times and shift must be positive in sum");
    sum += std::log(shifted);
  }
  return std::exp(sum / static_cast<double>(times.size())) - shift;
}

std::vector<double> virtual_best(const std::vector<std::vector<double>>& times) {
  std::vector<double> best(times.empty() ? 0 : times.front().size(), kInfinity);
  for (const auto& row : times) {
    for (std::size_t i = 0; i < best.size(); ++i) best[i] = std::min(best[i], row[i]);
  }
  return best;
}

std::optional<PairedRatio> paired_ratio(std::span<const double> a, std::span<const double> b,
                                        std::span<const std::size_t> groups) {
  constexpr std::size_t kResamples = 2000;
  struct Group {
    double sum = 0.0, count = 0.0;  // of the logarithms of ratios
  };
  const auto mean_of = [](const Group& all) { return std::exp(all.sum / all.count); };
  std::map<std::size_t, Group> found;
  Group all;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!std::isfinite(a[i]) || !std::isfinite(b[i])) continue;
    for (Group* group : {&all, &found[groups[i]]}) {
      group->sum += std::log(a[i] / b[i]);
      group->count += 1.0;
    }
  }
  if (found.empty()) return std::nullopt;
  PairedRatio result{.ratio = mean_of(all),
                     .lower = 0.0,
                     .upper = kInfinity,
                     .instances = static_cast<std::size_t>(all.count),
                     .groups = found.size()};
  if (found.size() < 2) return result;
  std::vector<Group> list;
  for (const auto& [name, group] : found) list.push_back(group);
  Random random(1);
  std::vector<double> means(kResamples);
  for (double& mean : means) {
    Group drawn;
    for (std::size_t k = 0; k < list.size(); ++k) {
      const Group& group = list[random.below(list.size())];
      drawn.sum += group.sum;
      drawn.count += group.count;
    }
    mean = mean_of(drawn);
  }
  std::ranges::sort(means);
  result.lower = means[kResamples / 40];
  result.upper = means[kResamples - 1 - kResamples / 40];
  return result;
}

}  // namespace graybox::bench
