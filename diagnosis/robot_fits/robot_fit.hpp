// The stiffness of a robot from a campaign. First come frequency responses with their uncertainty
// (responses/estimate_responses.hpp). Then comes the maximum-likelihood fit over all positions and
// levels at once (maximum_likelihood.hpp) from several starts (fit_search.hpp). Each start is
// brought near by way of the springs' constitutive relation (constitutive_stage.hpp).
//
//   const FitReport report = fit_robot_campaign(load_robot_model("robot.yaml"),
//                                               read_campaign("campaign"), {.threads = 2});
//
// Parameters are reported as stiffness (N m/rad): theta times what the model file says; the first
// start is the file's. Covariances of responses are estimates; H^-1 S H^-1 of
// maximum_likelihood.hpp and unbiased weights take their degrees of freedom into account, so that
// chi-square / dof is 1 in the mean where the model is true.
//
// With `lines` the search ends with a fit of the lines, whose estimates, covariance and quality are
// reported.
//
// Quality (FitQuality) of responses. Error and signal at the excited lines are what the model
// leaves of the measured outputs and these outputs themselves: E U and G_hat U, E = G_hat -
// G(theta_hat), U the measured inputs. Chi-square on validation recordings is divided by its
// expectation where the model is true, N + tr(H_v C): theta_hat errs as well.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "diagnosis/estimation/fit_report.hpp"
#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/response_fits/response_measurement.hpp"
#include "diagnosis/robot_fits/fit_search.hpp"
#include "problems/mechanisms/robot_model.hpp"

namespace graybox {

// Whether the fit of responses goes on with the spectral lines themselves (robot_line_fit.hpp).
enum class LineStage : std::int8_t { kNone, kLocal, kFull };

struct RobotFitOptions {
  FitSearchOptions search;
  LineStage lines = LineStage::kNone;
  int threads = 1;                                       // the result does not depend on it
  std::function<bool()> keep_going;                      // false: hand over the best so far
  std::function<void(std::size_t, std::size_t)> report;  // recordings read, of all
};

// Model and campaign names of the report are left to the caller. Status "interrupted" where
// keep_going stopped it before there was anything. Throws InputError where recordings can't be
// used, or do not belong to this robot: other numbers of motors or joints, units, sample time or
// hold.
[[nodiscard]] FitReport fit_robot_campaign(const RobotModel& robot, const Campaign& campaign,
                                           const RobotFitOptions& options = {});

}  // namespace graybox
