#include "bench/paper/response_curve.hpp"

#include <fmt/format.h>

#include <Eigen/SVD>
#include <algorithm>
#include <numbers>

#include "problems/base/error.hpp"
#include "problems/mechanisms/frequency_response.hpp"
#include "problems/mechanisms/local_model.hpp"

namespace graybox::bench {

std::vector<ResponsePoint> response_curve(const RobotModel& robot,
                                          const Eigen::VectorXd& joint_angles,
                                          const std::vector<double>& frequencies) {
  const double highest = 0.5 / robot.sample_time;
  LocalModelBuilder builder(robot);
  const LocalModel model = builder.build(joint_angles);
  std::vector<ResponsePoint> curve;
  for (const double hertz : frequencies) {
    if (!(hertz > 0.0 && hertz < highest)) {
      throw InputError(
          fmt::format("frequency {} Hz: must lie between 0 and {} Hz, half the sample "
                      "rate of {}",
                      hertz, highest, robot.name));
    }
    const double w = 2.0 * std::numbers::pi * hertz;
    const Eigen::MatrixXcd g = frequency_response(model, w, robot.sample_time);
    Eigen::VectorXd inverse =
        controller_response(robot.controller, w, robot.sample_time).cwiseAbs().cwiseInverse();
    std::sort(inverse.begin(), inverse.end(), std::greater<>());
    curve.push_back({hertz, Eigen::JacobiSVD<Eigen::MatrixXcd>(g).singularValues(), inverse});
  }
  return curve;
}

std::string to_csv(const std::vector<ResponsePoint>& curve) {
  std::string text = "frequency_hz";
  if (curve.empty()) return text + "\n";
  for (Eigen::Index i = 0; i < curve.front().response.size(); ++i) {
    text += fmt::format(",response_{}", i + 1);
  }
  for (Eigen::Index i = 0; i < curve.front().inverse_controller.size(); ++i) {
    text += fmt::format(",inverse_controller_{}", i + 1);
  }
  text += "\n";
  for (const ResponsePoint& point : curve) {
    text += fmt::format("{:.10g}", point.frequency);
    for (const double value : point.response) text += fmt::format(",{:.10g}", value);
    for (const double value : point.inverse_controller) text += fmt::format(",{:.10g}", value);
    text += "\n";
  }
  return text;
}

}  // namespace graybox::bench
