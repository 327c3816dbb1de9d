// What of a law its score test can estimate without a refit: amplitudes, for each of several shapes.
//
// At given thresholds, transition velocities, wave lengths, frequencies a law is a sum of basis
// functions times amplitudes. Shapes are spread over the motion that was recorded: thresholds over
// quantiles of |z|, velocities over those of |z'|, frequencies over the band.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "graybox/diagnosis/hypotheses/candidate_place.hpp"
#include "graybox/problems/elements/law_catalogue.hpp"

namespace graybox {

// Of the motion at one place, all recordings together.
struct MotionScale {
  std::vector<double> deflections;     // |z|, sorted
  std::vector<double> rates;           // |z'|, sorted
  double range = 0.0;                  // of z
  double lowest = 0.0, highest = 0.0;  // Hz, band

  [[nodiscard]] double deflection(double quantile) const;
  [[nodiscard]] double rate(double quantile) const;
};

struct LawShape {
  // Parameters of the laws whose sum, weighed by the amplitudes, is this law. For laws without
  // amplitude the basis is the law itself, expected with amplitude one.
  std::vector<std::vector<double>> basis;
  // The law's parameters at given amplitudes, within their ranges; empty where none are possible
  // (a friction that drives).
  std::function<std::vector<double>(const Eigen::VectorXd&)> parameters;
};

// Empty where the law has no place in the diagnosis of this place.
[[nodiscard]] std::vector<LawShape> law_shapes(const LawEntry& entry, const CandidatePlace& place,
                                               const MotionScale& scale);

// Laws that this one is for some of its parameters.
[[nodiscard]] std::vector<std::string> special_cases_of(const LawEntry& entry);

}  // namespace graybox
