// `graybox fit` of a graybox-robot/1 model: stiffness from frequency responses.
#include <fmt/format.h>

#include <string>

#include "cli/fit/fit_arguments.hpp"
#include "cli/output/console.hpp"
#include "cli/process/interrupt.hpp"
#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/robot_fits/robot_fit.hpp"
#include "problems/mechanisms/robot_elements.hpp"

namespace graybox::cli {

FitReport fit_robot(const FitArguments& arguments) {
  const LinearRobot linear = load_linear_robot(arguments.model);
  const Campaign campaign = read_campaign(arguments.campaign);
  CountProgress progress("recording", campaign.experiments.size());
  RobotFitOptions options;
  options.threads = arguments.threads;
  options.search.seed = arguments.seed;
  options.search.starts = arguments.starts;
  options.search.all_starts = arguments.all_starts;
  options.lines = arguments.lines == "full"    ? LineStage::kFull
                  : arguments.lines == "local" ? LineStage::kLocal
                                               : LineStage::kNone;
  options.keep_going = [] { return !interrupted(); };
  options.report = [&](std::size_t done, std::size_t) { (void)progress.update(done); };
  FitReport report = fit_robot_campaign(linear.robot, campaign, options);
  for (const std::string& element : linear.left_out) {
    report.notes.push_back(
        fmt::format("the element {} is not in the fitted model, which is linear: the estimates "
                    "hold what it does to the responses",
                    element));
  }
  report.model = arguments.model;
  report.campaign = campaign.file.string();
  return report;
}

}  // namespace graybox::cli
