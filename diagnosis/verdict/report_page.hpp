// report.html: a diagnosis to read, one file with its figures in it.
//
// It has, in this order, the verdict in words and the fit before and after, on recordings of the
// fit and on those kept out. Then it shows where the model does not fit: normalised residuals by
// channel and band, one map a position and level, those too large framed. Next comes each effect
// with its parameters, the picture of its law and its rivals. Last are residuals against noise
// before and after, the model's own parameters, and what would have been seen.
#pragma once

#include <span>
#include <string>

#include "diagnosis/search/diagnosis_search.hpp"
#include "diagnosis/verdict/verdict_file.hpp"

namespace graybox {

[[nodiscard]] std::string report_page(const Diagnosis& diagnosis,
                                      std::span<const Hypothesis> hypotheses,
                                      const DiagnosedFiles& files);

struct ReportFigure {
  std::string name;  // of a file, without ending
  std::string svg;
};
// The figures of the page, in its order.
[[nodiscard]] std::vector<ReportFigure> report_figures(const Diagnosis& diagnosis,
                                                       std::span<const Hypothesis> hypotheses);

}  // namespace graybox
