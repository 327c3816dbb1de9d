// A design as single charts, which a page holds and `graybox plot` writes as files: the amounts and
// the sensitivities, over the candidates and over each coordinate, against the bound.
//
//   for (const DesignPicture& picture : design_pictures(story)) {
//     write_text_file(picture.name + ".svg", picture.svg);
//   }
//
// The sensitivity of a candidate is tr(G H_i), with G of certificate.hpp. For D-optimality it is
// tr(M^-1 H_i) / d, the variance of its predictions over that of the least possible maximum.
// A coordinate with more values than a chart shows is cut into pieces of equal width.
// Cost: O(Q) a chart.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/design_page/design_page.hpp"
#include "diagnosis/report/svg_chart.hpp"

namespace graybox {

// The largest and the mean sensitivity at each value of a coordinate; none for constants, and none
// where the story has no sensitivities.
[[nodiscard]] std::vector<Chart> sensitivity_charts(const DesignStory& story);

struct DesignPicture {
  std::string name;  // "weights_over_q1": letters, digits, _ and -, and no other has it
  std::string svg;   // a whole file, on white
};

// weights, weights_over_X, sensitivities, sensitivities_over_X, and sensitivity_map where exactly
// two coordinates vary on a grid. Those of whole numbers are called counts.
[[nodiscard]] std::vector<DesignPicture> design_pictures(const DesignStory& story);

}  // namespace graybox
