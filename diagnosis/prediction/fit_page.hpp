// A fit as one page (html_page.hpp). It has parameters with errors and plausibility, and what the
// recordings do not tell. Where the model can be simulated, it has traces before and after.
#pragma once

#include <optional>
#include <string>

#include "diagnosis/estimation/fit_report.hpp"
#include "diagnosis/prediction/model_prediction.hpp"
#include "diagnosis/report/html_page.hpp"

namespace graybox {

struct FitPredictions {
  std::optional<ModelPrediction> before, after;  // by the model as stated, and as fitted
};

// `model_text`: the fitted model, for the reader to save; may be empty.
[[nodiscard]] std::string fit_page(const FitReport& report, const FitPredictions& predictions,
                                   const std::string& model_text, const PageOrigin& origin);

}  // namespace graybox
