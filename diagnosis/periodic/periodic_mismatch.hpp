// Periodic recordings of a robot (graybox-robot/1) or lumped model (graybox-lumped/1) as the search
// for missing physics sees them (mismatch_problem.hpp):
//
//   const Campaign campaign = read_campaign("campaign");
//   const auto problem = periodic_mismatch_problem("model.yaml", campaign, {.threads = 2});
//   const Diagnosis diagnosis = diagnose(*problem);
//
// Residuals are Y - y at all lines of the period, excited or not, whitened by the noise of the
// recordings (periodic_data.hpp). The output y is the model's steady state under the recorded
// inputs, with the laws it is given (steady_state.hpp).
//
// Hypotheses: each law of the catalogue at each place of the model. Places of a robot are
// gearboxes, bearings, motors, arm axes, the flange, actuators and sensors, and some couplings
// between joints. Places of a lumped model are masses, what elements connect, and signals. Laws
// that only change a parameter that the model leaves free are not listed (periodic_shapes.hpp).
//
// Virtual force. A force -b F adds -g F to the whitened output, g = L (S_0 + j w S_1) X b. The
// force that explains the residual r at one line is F = -(g^H g)^-1 g^H r, taken where it is
// clearly larger than its noise. With it the motion is rebuilt, q - X b F, whatever law made the
// force; where a sensor measures the place its own signal is taken. Under the motion q that really
// was, the residual is linear in what is missing and in the errors of the model's own parameters,
//
//   r = -g law(z) - sum_p L (S_0 + j w S_1) X (dD/dtheta_p) q dtheta_p,     z = b_in^T q,
//
// however large they are. The score test of a law therefore has the columns -g law(z) for a unit
// amplitude, for each of several shapes (periodic_shapes.hpp). Beside them are the parameters'
// columns under the same motion. What both explain together ranks places and laws, and both
// estimates start the refit. Where chi-square is not beyond what noise gives once in a million, the
// motion is the model's. All is then the usual score test, with its null distribution.
//
// Transients. Recordings are freed of them by polynomials first (periodic_data.hpp). Then they are
// freed with the model as it is once that has been fitted (transients.hpp), unless that is so far
// from the data that it would do harm. They are freed again with laws found (renewed()).
//
// Fit. Gauss, Newton, Levenberg and Marquardt work on the whitened residuals, by the model's
// parameters and those of the laws. Derivatives use the laws' mean slopes, at the end their exact
// ones. Positive parameters are estimated by their logarithms. The first fit begins at the model's
// own values and at those of response_starts.hpp, through data whose noise is raised
// (fit_periodic_gradually).
//
// Cost: a fit takes, for each step and recording, a few milliseconds; a ranking of 1000 shapes
// about
// 0.1 s a recording of 700 lines.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <vector>

#include "diagnosis/hypotheses/mismatch_problem.hpp"
#include "diagnosis/recordings/campaign.hpp"

namespace graybox {

struct PeriodicMismatchOptions {
  double line_factor = 2.5;          // lines up to so many times the highest excited one
  double model_accuracy = 1e-6;      // of the equations' solution, relative to the outputs
  int iteration_limit = 60;          // of a fit
  int threads = 1;                   // results do not depend on it
  std::function<bool()> keep_going;  // asked between steps of fits; false: these end unusable
  std::vector<std::filesystem::path> place_files{};  // graybox-places/1 (place_file.hpp)
};

// Throws InputError of one line for a model or a campaign that can't be used. Reasons are: not
// periodic, other sample times or numbers of channels, inputs that are not held, noise neither
// repeated nor stated.
[[nodiscard]] std::unique_ptr<MismatchProblem> periodic_mismatch_problem(
    const std::filesystem::path& model, const Campaign& campaign,
    const PeriodicMismatchOptions& options = {});

}  // namespace graybox
