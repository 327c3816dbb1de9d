// What the search for missing physics may be told (diagnosis_search.hpp has the steps that these
// belong to).
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace graybox {

struct SearchOptions {
  double level = 0.05;  // alpha of detection, family-wise
  double verification_level = 0.01;
  double tolerance = 0.05;         // of the noise's variance, in verification
  double noise_floor = 1.1;        // chi-square per degree of freedom of what is predicted
  double exclusion_margin = 10.0;  // of BIC and of the evidence
  std::size_t shortlist = 8;       // refits an effect
  std::size_t effect_limit = 0;    // 0: 4, or 24 where the noise is not known
  double held_out_gain = 0.01;     // logarithmic, of the squared error
  double rare_gain = 0.1;          // likewise, of a law of kRareRank
  double held_out_errors = 3.0;    // standard errors of that gain
  double generalisation = 1.5;
  double structure_tolerance = 0.1;         // of what is left
  double structure_error = 3.0;             // % of the signal, that may depend on the motion
  double autocorrelation_tolerance = 10.0;  // % of the signal
  double channel_tolerance = 15.0;          // %, of each channel's error kept out
  int null_draws = 199;                     // at least 2 / level are taken
  std::vector<std::string> excluded_laws;   // left out of the catalogue
  double variation_level = 1e-5;            // of time variation, family-wise, beside `level`
  double detection_power = 0.9;             // of the smallest detectable effect
  bool ignore_channel_faults = false;
  std::uint64_t seed = 1;
  // Called with what is being done, for progress; may be empty. Return false to stop: the diagnosis
  // then is what has been found so far, marked `interrupted`.
  std::function<bool(const std::string& step)> proceed;
};

}  // namespace graybox
