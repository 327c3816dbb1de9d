// `graybox fit` of a graybox-robot/1 model: stiffness from frequency responses.
#include <fmt/format.h>

#include <string>

#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/robot_fits/robot_fit.hpp"
#include "diagnosis/runs/model_fit.hpp"
#include "problems/base/stop.hpp"
#include "problems/mechanisms/robot_elements.hpp"

namespace graybox {

FitReport fit_robot(const ModelFitRequest& request) {
  const LinearRobot linear = load_linear_robot(request.model);
  const Campaign campaign = read_campaign(request.campaign);
  RobotFitOptions options;
  options.threads = request.threads;
  options.search.seed = request.seed;
  options.search.starts = request.starts;
  options.search.all_starts = request.all_starts;
  options.lines = request.lines == "full"    ? LineStage::kFull
                  : request.lines == "local" ? LineStage::kLocal
                                             : LineStage::kNone;
  options.keep_going = [] { return !stop_requested(); };
  options.report = request.report;
  FitReport report = fit_robot_campaign(linear.robot, campaign, options);
  for (const std::string& element : linear.left_out) {
    report.notes.push_back(
        fmt::format("the element {} is not in the fitted model, which is linear: the estimates "
                    "hold what it does to the responses",
                    element));
  }
  report.model = request.model;
  report.campaign = campaign.file.string();
  return report;
}

}  // namespace graybox
