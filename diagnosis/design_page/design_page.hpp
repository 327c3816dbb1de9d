// A design as a page (html_page.hpp): what to run and in which order, the proof as a picture, what
// will be known of every parameter, and the robot's poses.
//
//   DesignStory story{.set = &set, .schedule = design_schedule(set, design.weights), ...};
//   write_text_file("page.html", design_page(story, {.command = "graybox solve ..."}));
#pragma once

#include <string>
#include <vector>

#include "diagnosis/design_page/design_facts.hpp"
#include "diagnosis/report/html_page.hpp"
#include "problems/information/information_set.hpp"
#include "problems/mechanisms/robot_model.hpp"
#include "solvers/report/design_table.hpp"

namespace graybox {

struct DesignStory {
  const InformationSet* set = nullptr;
  std::string title;
  std::string verdict;
  PageMark tone = PageMark::kNone;
  std::vector<std::string> sentences = {};
  DesignSchedule schedule = {};
  std::vector<DesignFact> facts = {};
  std::vector<double> sensitivities = {};    // against 1; empty: no picture
  std::string sensitivity_words = {};        // what the picture says
  std::vector<double> standard_errors = {};  // empty: no table
  std::string error_words = {};              // of how many experiments they are
  const RobotModel* robot = nullptr;         // its joints' angles are the set's coordinates
};

[[nodiscard]] std::string design_page(const DesignStory& story, const PageOrigin& origin);

// The picture of the certificate. Of many candidates the largest of each run of neighbours.
[[nodiscard]] ComparisonPlot certificate_plot(const DesignStory& story);

}  // namespace graybox
