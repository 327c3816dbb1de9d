// Targets of precision: how well a combination c^T theta of the parameters is to be known.
//
//   sd(k1) <= 0.02            standard error of one parameter, in the parameter's unit
//   sd(k1) <= 2 %             0.02: for parameters that are relative to their nominal values
//   sd(2*k1 - k2) <= 0.1      of a combination
//   sd(all) <= 5 %            of each parameter: d targets
//
// and, in another form, effects that a test is to see:
//
//   k1 by 0.05                a change of k1 by 0.05 is detected with the stated power
//
// The two-sided test of level a for c^T theta = nominal rejects beyond z = Phi^-1(1 - a/2) standard
// errors s. Its power against a change by delta is
//
//   power = Phi(delta/s - z) + Phi(-delta/s - z),                                             (1)
//
// for normal estimates, as those of a linear model with known noise are. A wanted power gives s.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "problems/information/information_set.hpp"

namespace graybox {

struct PrecisionTarget {
  std::string text;                 // as the user wrote it, one parameter in place of "all"
  std::vector<double> combination;  // c, d numbers
  double standard_error = 0.0;      // the largest allowed
  double effect = 0.0;              // delta; 0 where a standard error is asked for
};

// d numbers from "k1", "2*k1 - k2" or "3" (an index). `what` begins the message: throws InputError
// for names that are no parameters, and where nothing is left of the combination.
[[nodiscard]] std::vector<double> parse_combination(const InformationSet& set,
                                                    std::string_view text, std::string_view what);

// One or more targets of one text. Throws InputError naming what is wrong.
[[nodiscard]] std::vector<PrecisionTarget> parse_precision_targets(const InformationSet& set,
                                                                   std::string_view text);
[[nodiscard]] std::vector<PrecisionTarget> parse_detections(const InformationSet& set,
                                                            std::string_view text, double power,
                                                            double level);

// (1) with r = delta/s.
[[nodiscard]] double detection_power(double effect_over_error, double level);
// The r that has this power. Throws InputError unless level < power < 1.
[[nodiscard]] double effect_for_power(double power, double level);

// c^T M^-1 c for each target, M packed; infinity where M is singular. O(d^3 + d^2 targets).
[[nodiscard]] std::vector<double> variances(std::span<const PrecisionTarget> targets,
                                            std::span<const double> packed, std::size_t dimension);

}  // namespace graybox
