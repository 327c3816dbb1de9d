// report.html: a diagnosis to look at, one file that needs nothing else (html_page.hpp).
//
// First comes the verdict in three sentences with the error before and after, then its reasons,
// ticked or crossed, and what to do next with files to save. Next are traces, measured against
// predicted, and the laws with pictures and parameters. Then it shows where the model does not fit,
// what was tried and rejected, and how all of it came about.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "diagnosis/report/html_page.hpp"
#include "diagnosis/search/diagnosis_search.hpp"
#include "diagnosis/verdict/residual_maps.hpp"
#include "diagnosis/verdict/verdict_file.hpp"

namespace graybox {

// What only the command knows.
struct ReportContext {
  PageOrigin origin = {};
  std::vector<PageDownload> plans = {};   // of the next experiment
  std::vector<PageDownload> models = {};  // the model with what was found
};

[[nodiscard]] std::string report_page(const Diagnosis& diagnosis,
                                      std::span<const Hypothesis> hypotheses,
                                      const DiagnosedFiles& files,
                                      const ReportContext& context = {});

// The verdict in at most three sentences: what is missing, how well it is predicted then, and what
// keeps it from being explained.
[[nodiscard]] std::vector<std::string> verdict_in_short(const Diagnosis& diagnosis,
                                                        std::span<const Hypothesis> hypotheses);

// The figures of the page, in its order.
[[nodiscard]] std::vector<ReportFigure> report_figures(const Diagnosis& diagnosis,
                                                       std::span<const Hypothesis> hypotheses);

}  // namespace graybox
