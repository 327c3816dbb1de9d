// `graybox fit` of a graybox-robot/1 model: stiffness from frequency responses.
#include <fmt/format.h>

#include "fit_arguments.hpp"
#include "graybox/diagnosis/recordings/campaign.hpp"
#include "graybox/problems/error.hpp"
#include "graybox/problems/robot_model.hpp"

namespace graybox::cli {

FitReport fit_robot(const FitArguments& arguments) {
  const RobotModel robot = load_robot_model(arguments.model);
  const Campaign campaign = read_campaign(arguments.campaign);
  throw InputError(
      fmt::format("{}: frequency responses of a robot are not read yet", campaign.file.string()));
}

}  // namespace graybox::cli
