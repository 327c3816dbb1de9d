// Diagnosis by prediction error: the physics that a lumped model lacks, from recordings of any
// motion, closed loop or open, no period needed, not every force and position measured.
//
//   const PredictionDiagnosis result = diagnose_by_prediction(model, campaign, options);
//   verdict_words(result.diagnosis, result.hypotheses);
//
// A predictor (predictor.hpp) sees the measurements for a while and then runs free for h samples.
// The search climbs a ladder of h (prediction_search.hpp). The model found is fitted in free run
// where that has skill, and judged on recordings kept out (final_fit.hpp). The mathematics and the
// limits are in docs/explanation/prediction_error.md.
//
// The verdict is `none` where nothing was found and the rest is at the sensors' noise on every
// rung. It is `explained` where laws were found and all of the following hold. The rest is at the
// noise on every rung. No output's error on recordings kept out is above 15 % of its signal (or 1.5
// times its stated noise). The model could be a machine's (plausibility.hpp). No rival stands. It
// is `ambiguous` where only the last fails, and `unknown` otherwise, with the tests that failed.
#pragma once

#include <filesystem>
#include <vector>

#include "diagnosis/evidence/diagnosis.hpp"
#include "diagnosis/evidence/search_options.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"
#include "diagnosis/recordings/campaign.hpp"

namespace graybox {

struct PredictionDiagnosis {
  std::vector<Hypothesis> hypotheses;
  Diagnosis diagnosis;
  // In one line, why another method should be asked where there is one. The reasons: no law was
  // found, the model found is not a machine's, or recordings kept out are not predicted. Empty: no
  // reason.
  std::string doubt;
};

// Throws InputError for files that are missing, wrong or do not belong together, and for models of
// another format than graybox-lumped/1. A search that is asked to stop ends with what it has.
[[nodiscard]] PredictionDiagnosis diagnose_by_prediction(const std::filesystem::path& model,
                                                         const Campaign& campaign,
                                                         const SearchOptions& options,
                                                         int threads = 1);

}  // namespace graybox
