#include "diagnosis/robot_fits/robot_fit.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include "diagnosis/response_fits/response_model.hpp"
#include "diagnosis/responses/estimate_responses.hpp"
#include "diagnosis/robot_fits/constitutive_stage.hpp"
#include "diagnosis/robot_fits/robot_line_fit.hpp"
#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"

namespace graybox {
namespace {

std::size_t recordings_of(const Campaign& campaign, ExperimentRole role) {
  return static_cast<std::size_t>(
      std::ranges::count(campaign.experiments, role, &Experiment::role));
}

// Is it this robot that was recorded?
void check(const RobotModel& robot, const Campaign& campaign,
           const FrequencyResponseEstimate& estimate) {
  const auto fail = [&](const std::string& text) {
    throw InputError(fmt::format("{}: {}", campaign.file.string(), text));
  };
  const auto motors = static_cast<std::size_t>(robot.motor_count());
  if (estimate.inputs.size() != motors || estimate.outputs.size() != motors) {
    fail(
        fmt::format("channels: {} inputs and {} outputs; the model {} has {} motors, each with a "
                    "torque and a velocity",
                    estimate.inputs.size(), estimate.outputs.size(), robot.name, motors));
  }
  for (std::size_t i = 0; i < motors; ++i) {
    if (estimate.input_units[i] != "N m") {
      fail(fmt::format("channels: input {} is in {}; a motor torque (N m) is needed: state a gain",
                       estimate.inputs[i], estimate.input_units[i]));
    }
    if (estimate.output_units[i] != "rad/s") {
      fail(fmt::format("channels: output {} is in {}; a motor velocity (rad/s) is needed",
                       estimate.outputs[i], estimate.output_units[i]));
    }
  }
  if (estimate.position.size() != robot.joint_names.size()) {
    fail(fmt::format("experiments: positions have {} angles, the model {} has {} joints",
                     estimate.position.size(), robot.name, robot.joint_names.size()));
  }
  if (std::abs(estimate.sample_time - robot.sample_time) > 1e-9 * robot.sample_time) {
    fail(fmt::format("sample_time: {:g} s, the model {} has {:g} s", estimate.sample_time,
                     robot.name, robot.sample_time));
  }
}

std::vector<FrequencyResponseEstimate> estimates_of(const RobotModel& robot,
                                                    const Campaign& campaign, ExperimentRole role,
                                                    const RobotFitOptions& options) {
  if (campaign.hold != InputHold::kZero) {
    throw InputError(campaign.file.string() +
                     ": hold: the model takes motor torques that are held between samples "
                     "(hold: zero)");
  }
  ResponseOptions responses;
  responses.role = role;
  responses.threads = options.threads;
  responses.keep_going = options.keep_going;
  responses.report = options.report;
  std::vector<FrequencyResponseEstimate> estimates = estimate_responses(campaign, responses);
  for (const FrequencyResponseEstimate& each : estimates) check(robot, campaign, each);
  return estimates;
}

std::vector<ResponseMeasurement> measurements_of(
    const std::vector<FrequencyResponseEstimate>& estimates) {
  std::vector<ResponseMeasurement> measurements;
  for (const auto& each : estimates) measurements.push_back(response_measurement(each));
  return measurements;
}

// Sums over measurements at a fixed theta.
struct Misfit {
  double chi_square = 0.0;
  double numbers = 0.0;      // N
  double error_power = 0.0;  // of E U
  double signal_power = 0.0;
};

Misfit misfit_of(const RobotResponseModel& model, const Eigen::VectorXd& theta,
                 const std::vector<ResponseMeasurement>& measurements) {
  Misfit sum;
  Eigen::MatrixXcd response;
  for (const ResponseMeasurement& data : measurements) {
    const auto local = model.linearise(data.position, theta);
    local->set_parameters(theta);
    for (std::size_t f = 0; f < data.frequencies.size(); ++f) {
      local->evaluate(data.frequencies[f], response, nullptr);
      const ResponseNoise& noise = data.noise[f];
      const Eigen::MatrixXcd error = (data.responses[f] - response) * noise.right;
      sum.chi_square += 2.0 * data.experiments * (noise.left * error).squaredNorm();
      sum.numbers += 2.0 * static_cast<double>(response.size());
      sum.error_power += error.squaredNorm();
      sum.signal_power += (data.responses[f] * noise.right).squaredNorm();
    }
  }
  return sum;
}

FitQuality quality_of(const Misfit& misfit, double expectation, std::size_t recordings) {
  const double share = misfit.error_power / misfit.signal_power;
  return {.recordings = recordings,
          .chi_square_per_dof = misfit.chi_square / expectation,
          .nrmse = 100.0 * std::sqrt(share),
          .variance_accounted_for = 100.0 * (1.0 - share)};
}

constexpr const char* kNoValidation =
    "no recording has the role validation: how the model does on others is not known";

class RobotFit {
 public:
  RobotFit(const RobotModel& robot, const Campaign& campaign, const RobotFitOptions& options)
      : robot_(robot), campaign_(campaign), options_(options), model_(robot) {
    for (const std::size_t spring : robot.parameters) {
      nominal_.conservativeResize(nominal_.size() + 1);
      nominal_(nominal_.size() - 1) = robot.springs[spring].stiffness;
    }
  }

  FitReport run() {
    report_.method = "frequency responses, maximum likelihood";
    report_.status = "interrupted";
    const auto estimates = estimates_of(robot_, campaign_, ExperimentRole::kEstimation, options_);
    if (estimates.empty()) return std::move(report_);
    const std::vector<ResponseMeasurement> measurements = measurements_of(estimates);
    FitSearchOptions search_options = options_.search;
    search_options.fit.threads = options_.threads;
    if (!search_options.keep_going) search_options.keep_going = options_.keep_going;
    if (!search_options.approach) {
      search_options.fit.starts = 1;  // the search's own starts are better ones
      search_options.approach = [&](const Eigen::VectorXd& start) {
        return constitutive_stage(robot_, measurements, start, {.threads = options_.threads});
      };
    }
    FitSearch search =
        search_fit(model_, measurements, Eigen::VectorXd::Ones(nominal_.size()), search_options);
    const bool has_lines = options_.lines != LineStage::kNone && search.best.theta.size() > 0 &&
                           search.best.status != FitStatus::kFailed;
    const bool went_on = has_lines && go_on_with_lines(search.best);
    fill(search);
    if (went_on) return std::move(report_);
    note_covariances(estimates);
    if (search.best.status == FitStatus::kFailed) return std::move(report_);
    assess(search.best, measurements);
    return std::move(report_);
  }

 private:
  // theta relative to the file becomes stiffness.
  void fill(const FitSearch& search) {
    const FitResult& best = search.best;
    report_.status = to_string(best.status);
    report_.starts = search.starts;
    for (FitStart& each : report_.starts) {
      each.start.array() *= nominal_.array();
      if (each.parameters.size() > 0) each.parameters.array() *= nominal_.array();
    }
    const std::vector<std::string> names = robot_.parameter_names();
    for (std::size_t p = 0; p < names.size(); ++p) {
      const auto at = static_cast<Eigen::Index>(p);
      const double factor = best.theta.size() > 0 ? best.theta(at) : 1.0;
      report_.parameters.push_back({names[p], "N m/rad", factor * nominal_(at), nominal_(at)});
    }
    if (best.status == FitStatus::kFailed) return;
    report_.chi_square = best.chi_square;
    report_.degrees_of_freedom = best.degrees_of_freedom;
    const Eigen::VectorXd inverse = nominal_.cwiseInverse();
    report_.identifiability = examine_identifiability(
        inverse.asDiagonal() * effective_information(best) * inverse.asDiagonal(),
        best.theta.cwiseProduct(nominal_), names);
  }

  // Whether it came to an end.
  bool go_on_with_lines(FitResult& best) {
    const bool is_full = options_.lines == LineStage::kFull;
    const auto family = robot_family(robot_, is_full ? PlantKind::kFull : PlantKind::kLocal);
    PeriodicDataOptions reading;
    // Forces that are not linear need the motion's harmonics as well.
    if (!is_full) reading.line_factor = 1.0;
    reading.threads = options_.threads;
    PeriodicData data = read_periodic_data(campaign_, *family, reading);
    if (data.estimation.front().output_bins.size() == 0) {
      throw InputError(campaign_.file.string() +
                       ": excitation: periods: 1; lines of single periods can't be freed of free "
                       "motion: record two or more, or fit without --lines");
    }
    LineFit lines;
    try {
      lines = fit_lines(*family, best.theta,
                        {.threads = options_.threads, .keep_going = options_.keep_going}, data);
    } catch (const Stopped&) {  // the estimates of the responses stand
    }
    if (lines.fit.status == FitStatus::kFailed) {
      best.status = FitStatus::kIterationLimit;
      add_note("the fit of the lines did not settle: these are the estimates of the responses");
      return false;
    }
    best = lines.fit;
    report_.method = fmt::format("spectral lines, maximum likelihood ({})",
                                 is_full ? "full robot" : "local models");
    assess_lines(*family, lines, data);
    return true;
  }

  void assess_lines(const PlantFamily& family, const LineFit& lines, const PeriodicData& data) {
    const FitResult& fit = lines.fit;
    add_note(
        fmt::format("the noise of the lines is estimated with {:.3g} degrees of freedom or "
                    "more, which standard errors include",
                    lines.noise_samples));
    report_.estimation = line_fit_quality(family, fit.theta, data, data.estimation,
                                          -static_cast<double>(fit.theta.size()), options_.threads);
    if (data.validation.empty()) {
      add_note(kNoValidation);
      return;
    }
    double excess = 0.0;
    if (fit.covariance.size() > 0) {
      excess = (line_fit_information(family, fit.theta, data, data.validation, options_.threads) *
                fit.covariance)
                   .trace();
    }
    report_.validation =
        line_fit_quality(family, fit.theta, data, data.validation, excess, options_.threads);
  }

  // The estimates of one kind of covariance have about the same degrees of freedom.
  void note_covariances(const std::vector<FrequencyResponseEstimate>& estimates) {
    double least = std::numeric_limits<double>::infinity();
    std::size_t total = 0;
    for (const FrequencyResponseEstimate& each : estimates) {
      total += each.total.empty() ? 0U : 1U;
      for (const OutputCovariance& line : each.best_covariance()) {
        least = std::min(least, line.degrees_of_freedom);
      }
      for (const Finding& finding : each.findings) add_note(finding.message);
    }
    add_note(fmt::format(
        "covariances of the responses are estimates with {:.3g} degrees of freedom or more ({} of "
        "{} over realisations); that widens standard errors by up to {:.2g} %, which is included",
        least, total, estimates.size(),
        100.0 * (std::sqrt(weights_widening(least, robot_.motor_count())) - 1.0)));
  }

  void add_note(const std::string& text) {
    if (std::ranges::find(report_.notes, text) == report_.notes.end())
      report_.notes.push_back(text);
  }

  void assess(const FitResult& best, const std::vector<ResponseMeasurement>& measurements) {
    report_.estimation = quality_of(misfit_of(model_, best.theta, measurements),
                                    static_cast<double>(best.degrees_of_freedom),
                                    recordings_of(campaign_, ExperimentRole::kEstimation));
    const std::size_t kept = recordings_of(campaign_, ExperimentRole::kValidation);
    if (kept == 0) {
      add_note(kNoValidation);
      return;
    }
    const auto estimates = estimates_of(robot_, campaign_, ExperimentRole::kValidation, options_);
    if (estimates.empty()) return;
    const std::vector<ResponseMeasurement> validation = measurements_of(estimates);
    const Misfit misfit = misfit_of(model_, best.theta, validation);
    report_.validation =
        quality_of(misfit, misfit.numbers + share_of_errors(best, validation), kept);
  }

  // tr(H_v C): what the errors of theta_hat add to chi-square on other recordings.
  [[nodiscard]] double share_of_errors(const FitResult& best,
                                       const std::vector<ResponseMeasurement>& validation) const {
    if (best.covariance.size() == 0) return 0.0;
    return (information_at(model_, validation, best.theta) * best.covariance).trace();
  }

  const RobotModel& robot_;
  const Campaign& campaign_;
  const RobotFitOptions& options_;
  RobotResponseModel model_;
  Eigen::VectorXd nominal_;  // N m/rad
  FitReport report_;
};

}  // namespace

FitReport fit_robot_campaign(const RobotModel& robot, const Campaign& campaign,
                             const RobotFitOptions& options) {
  return RobotFit(robot, campaign, options).run();
}

}  // namespace graybox
