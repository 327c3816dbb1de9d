// A whole diagnosis, from files to verdict: what `graybox diagnose` does.
//
//   const DiagnosisAnswer answer = run_diagnosis({.model = "motor.yaml", .campaign = "campaign/"});
//   for (const std::string& line : answer.words()) ...
//
// The method is chosen by the model and the recordings: periodic, force_balance or
// prediction_error. Where the prediction error leaves doubt, and the drive of a lumped model is
// measured as a whole, its force balance is asked, too, and answers if it has found something
// (diagnosis/second_looks).
#pragma once

#include "diagnosis/second_looks/diagnosis_answer.hpp"

namespace graybox {

// Throws InputError for files that are missing, wrong or do not belong together. What was found
// until then is the answer once the work is to stop (stop.hpp).
[[nodiscard]] DiagnosisAnswer run_diagnosis(DiagnosisRequest request);

}  // namespace graybox
