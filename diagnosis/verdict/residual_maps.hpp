// Where a model does not fit, as maps: by channel and band where the noise is known, a map a
// position and level; by channel and time where recordings are shown along time. Maps of before and
// after have one scale of colours.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/evidence/diagnosis.hpp"
#include "diagnosis/report/svg_chart.hpp"

namespace graybox {

struct ReportFigure {
  std::string name;  // of a file, without ending
  std::string svg;
};

// `highest` of the scale of both: of the maps before.
[[nodiscard]] double highest_of(const std::vector<MismatchCell>& cells);
[[nodiscard]] std::vector<ReportFigure> band_maps(const std::vector<MismatchCell>& cells,
                                                  const std::string& when, double highest);

// Of one recording kept out and one of the fit, the first of each.
[[nodiscard]] std::vector<ReportFigure> time_maps(const Diagnosis& diagnosis);

}  // namespace graybox
