// The few statistics the study needs. All are closed forms on small samples.
#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <vector>

namespace graybox::bench {

struct Quartiles {
  double lower = 0.0;
  double median = 0.0;
  double upper = 0.0;
};

// Three quantiles. Throws InputError for an empty sample.
[[nodiscard]] Quartiles quartiles(std::vector<double> sample);

// y = factor x^exponent, by least squares of log y on log x; the interval is the 95 % confidence
// interval of the exponent from Student's t with n - 2 degrees of freedom.
struct PowerLaw {
  double exponent = 0.0;
  double factor = 0.0;
  double lower = -std::numeric_limits<double>::infinity();  // infinite with two points
  double upper = std::numeric_limits<double>::infinity();
  std::size_t points = 0;
};

// Empty with fewer than two different x. x and y must be positive and of equal length.
[[nodiscard]] std::optional<PowerLaw> fit_power_law(std::span<const double> x,
                                                    std::span<const double> y);

// The 97.5 % quantile of Student's t; within 0.1 %.
[[nodiscard]] double student_975(std::size_t degrees_of_freedom);

// Where two curves sampled at the same growing x cross, straight lines in log-log between the
// points: the first x from which b is below a. Empty if that never happens.
[[nodiscard]] std::optional<double> crossover(std::span<const double> x, std::span<const double> a,
                                              std::span<const double> b);

// Dolan and More (2002): for each solver the share of instances on which its time is within a
// factor tau of the best. times[solver][instance]; infinity where not solved.
struct ProfileStep {
  double tau = 1.0;
  double share = 0.0;
};
[[nodiscard]] std::vector<std::vector<ProfileStep>> performance_profiles(
    const std::vector<std::vector<double>>& times);

// More and Wild (2009): for each solver the share of instances that it has solved within a budget,
// seconds or passes over the set. costs[solver][instance]; infinity where not solved.
struct BudgetStep {
  double budget = 0.0;
  double share = 0.0;
};
[[nodiscard]] std::vector<std::vector<BudgetStep>> data_profiles(
    const std::vector<std::vector<double>>& costs);

// exp(mean of log(t + shift)) - shift: a mean that a few very short times do not rule, as they rule
// the geometric mean. A time that is infinite counts as `charge`. Throws InputError where there are
// no times, or one with its shift is not positive.
[[nodiscard]] double shifted_geometric_mean(std::span<const double> times, double shift,
                                            double charge);

// The best time of each instance, whichever solver has it: the virtual best solver.
[[nodiscard]] std::vector<double> virtual_best(const std::vector<std::vector<double>>& times);

// The geometric mean of the ratios a_i / b_i over the instances i that both have solved. The
// interval holds 95 % of the means of samples that are drawn again with repetition (Efron's
// percentile bootstrap). What is drawn are whole groups: subsets of one set are no independent
// instances, and stay together, as the two times of an instance do.
struct PairedRatio {
  double ratio = 0.0, lower = 0.0, upper = 0.0;
  std::size_t instances = 0, groups = 0;  // that both have solved
};
// groups[i] is the group of instance i. Empty where both have solved none. The interval is from 0
// to infinity with one group.
[[nodiscard]] std::optional<PairedRatio> paired_ratio(std::span<const double> a,
                                                      std::span<const double> b,
                                                      std::span<const std::size_t> groups);

}  // namespace graybox::bench
