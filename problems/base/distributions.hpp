// Tails and quantiles of the distributions that tests use, by Boost.Math.
//
//   if (chi_square_tail(statistic, 12) < 0.05) reject();
//
// A tail is P(X > x). Throws InputError for degrees of freedom that are not positive and for
// probabilities outside (0, 1).
#pragma once

namespace graybox {

[[nodiscard]] double normal_tail(double x);
[[nodiscard]] double normal_quantile(double probability);
[[nodiscard]] double chi_square_tail(double x, double degrees_of_freedom);
[[nodiscard]] double chi_square_quantile(double probability, double degrees_of_freedom);
[[nodiscard]] double fisher_tail(double x, double numerator, double denominator);
[[nodiscard]] double fisher_quantile(double probability, double numerator, double denominator);
// P(X > x) of the non-central chi-square distribution: the power of a chi-square test.
[[nodiscard]] double noncentral_chi_square_tail(double x, double degrees_of_freedom,
                                                double noncentrality);

}  // namespace graybox
