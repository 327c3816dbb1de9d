// Frequency responses of a campaign, one for each position and level (and realisation, if asked):
// the step from recordings to a fit.
//
//   const Campaign campaign = read_campaign("campaign");
//   const auto estimates = estimate_responses(campaign);
//   std::vector<ResponseMeasurement> measurements;
//   for (const auto& estimate : estimates) measurements.push_back(response_measurement(estimate));
//   const FitResult fit = fit_maximum_likelihood(model, measurements, start);
//
// Inputs, outputs and references are the campaign's channels that are so called, in its order. The
// response relates what is recorded. With inputs held between samples (hold: zero) it is the
// discrete-time response of the plant behind its hold. That is G = j w h S D^-1 B of
// frequency_response.hpp but for aliasing. With band-limited inputs it is that of the plant alone.
//
// Recordings whose campaign states period, periods and lines go the periodic way
// (periodic_response.hpp); the others the local polynomial way (local_polynomial.hpp), every
// segment a record, all cut to the length of the shortest.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/responses/frequency_response_estimate.hpp"
#include "diagnosis/responses/local_polynomial.hpp"
#include "diagnosis/responses/periodic_response.hpp"
#include "diagnosis/signals/line_spectra.hpp"

namespace graybox {

struct ResponseOptions {
  ExperimentRole role = ExperimentRole::kEstimation;  // which experiments
  bool separate_realisations =
      false;  // an estimate for each; else one for all, with total covariance
  std::optional<ResponseMethod> method;  // none: as the campaign's excitation allows
  LeakageOptions leakage;
  PeriodicResponseOptions periodic;
  LocalPolynomialOptions local_polynomial;
  int threads = 1;                   // the result does not depend on it
  std::function<bool()> keep_going;  // asked between recordings; false: an empty result
  std::function<void(std::size_t, std::size_t)> report;  // recordings read, of all; one at a time
};

// In the order in which positions and levels come up in the campaign. Findings of the recordings
// (warnings) and of the estimate are with each. Throws InputError of one line for recordings that
// can't be used. Such are: no experiments of this role, not periodic, no inputs or outputs,
// sub-experiments that are missing or given twice. Others are other lines or periods among those of
// one response, inputs that are not independent, samples at uneven times, records too short.
[[nodiscard]] std::vector<FrequencyResponseEstimate> estimate_responses(
    const Campaign& campaign, const ResponseOptions& options = {});

}  // namespace graybox
