// `graybox fit` of a graybox-lumped/1 model: its parameters by output error in the time domain.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "diagnosis/output_error/output_error_fit.hpp"
#include "diagnosis/runs/model_fit.hpp"
#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"

namespace graybox {
namespace {

using Json = nlohmann::ordered_json;

// Residuals of a sound model of white noise have no memory; above this, say so.
constexpr double kNoticedCorrelation = 0.2;

OutputErrorOptions options_of(const ModelFitRequest& request) {
  OutputErrorOptions options;
  options.starts = request.starts;
  options.seed = request.seed;
  options.keep_going = [] { return !stop_requested(); };
  if (request.initial_state == "measured") options.initial_state = InitialState::kMeasured;
  if (request.initial_state == "rest") options.initial_state = InitialState::kRest;
  return options;
}

Json json_of(const Eigen::VectorXd& values) {
  Json list = Json::array();
  for (const double value : values) list.push_back(value);
  return list;
}

Json json_of(const OutputErrorScore& score) {
  if (!score.finite) return nullptr;
  return {{"rms", json_of(score.rms)},
          {"deviation", json_of(score.deviation)},
          {"nrmse", json_of(score.nrmse)},
          {"variance_accounted_for", json_of(score.variance_accounted_for)}};
}

// The worst output stands for all.
FitQuality quality_of(const OutputErrorScore& score, std::size_t recordings) {
  FitQuality quality;
  quality.recordings = recordings;
  quality.nrmse = score.finite ? score.nrmse.maxCoeff() : std::numeric_limits<double>::quiet_NaN();
  quality.variance_accounted_for = score.finite ? score.variance_accounted_for.minCoeff()
                                                : std::numeric_limits<double>::quiet_NaN();
  return quality;
}

Json details_of(const OutputErrorFit& fit) {
  Json details{{"outputs", fit.model.output_names},
               {"units", fit.model.output_units},
               {"noise", json_of(fit.noise)},
               {"noise_is_known", fit.noise_is_known},
               {"covariance", "robust (Newey and West)"},
               {"residual_lag_one_correlation", fit.lag_one_correlation},
               {"steps_per_sample", fit.steps_per_sample},
               {"step_error", fit.step_error},
               {"iterations", fit.iterations}};
  if (fit.white_covariance.size() > 0) {
    details["white_standard_errors"] = json_of(fit.white_covariance.diagonal().cwiseSqrt());
  }
  details["estimation"] = json_of(fit.estimation);
  details["validation"] = json_of(fit.validation);
  details["recordings"] = Json::array();
  for (const OutputErrorScore& score : fit.scores) {
    details["recordings"].push_back(
        {{"name", score.name}, {"role", name_of(score.role)}, {"score", json_of(score)}});
  }
  details["equation_error"] = Json::array();
  for (const OutputErrorStart& start : fit.starts) {
    if (!start.origin.starts_with("equation")) continue;
    details["equation_error"].push_back({{"origin", start.origin},
                                         {"parameters", json_of(start.theta)},
                                         {"estimation", json_of(start.estimation)},
                                         {"validation", json_of(start.validation)}});
  }
  return details;
}

std::vector<FitStart> starts_of(const OutputErrorFit& fit) {
  double least = std::numeric_limits<double>::infinity();
  for (const OutputErrorStart& start : fit.starts) {
    if (start.fitted > 0.0) least = std::min(least, start.fitted);
  }
  std::vector<FitStart> starts;
  for (const OutputErrorStart& start : fit.starts) {
    if (start.fitted == 0.0) continue;
    starts.push_back({.start = start.theta,
                      .parameters = start.end,
                      .chi_square = 2.0 * start.fitted,
                      .best = start.fitted <= least * (1.0 + 1e-4)});
  }
  return starts;
}

std::vector<std::string> notes_of(const OutputErrorFit& fit) {
  std::vector<std::string> notes;
  if (std::abs(fit.lag_one_correlation) > kNoticedCorrelation) {
    notes.push_back(fmt::format(
        "residuals follow each other (lag-one correlation {:.2f}): the model leaves something out, "
        "or the noise has memory; standard errors allow for it",
        fit.lag_one_correlation));
  }
  if (!fit.noise_is_known) {
    notes.emplace_back(
        "the noise is not known but taken from the residuals: chi-square is no test");
  }
  if (fit.status == OutputErrorStatus::kDiverged) {
    notes.emplace_back("no start gave a motion that stays finite; try other values in the model");
  }
  if (fit.status == OutputErrorStatus::kStepLimit) {
    notes.push_back(fmt::format("{} steps a sample are not enough: error {:.1e}",
                                fit.steps_per_sample, fit.step_error));
  }
  return notes;
}

FitReport report_of(const ModelFitRequest& request, const OutputErrorProblem& problem,
                    const OutputErrorFit& fit) {
  FitReport report;
  report.model = request.model;
  report.method = "output error, time domain";
  report.status = to_string(fit.status);
  for (std::size_t i = 0; i < fit.free.size(); ++i) {
    const LumpedParameter& parameter = problem.model().parameters[fit.free[i]];
    report.parameters.push_back(
        {parameter.name, parameter.unit, fit.theta(static_cast<Eigen::Index>(i)), parameter.value});
  }
  report.identifiability = fit.identifiability;
  if (fit.noise_is_known) report.chi_square = fit.chi_square;
  report.degrees_of_freedom = fit.degrees_of_freedom;
  report.starts = starts_of(fit);
  const auto count = [&](ExperimentRole role) { return problem.whole_recordings(role).size(); };
  report.estimation = quality_of(fit.estimation, count(ExperimentRole::kEstimation));
  if (fit.noise_is_known && fit.degrees_of_freedom > 0) {
    report.estimation.chi_square_per_dof =
        fit.chi_square / static_cast<double>(fit.degrees_of_freedom);
  }
  if (count(ExperimentRole::kValidation) > 0) {
    report.validation = quality_of(fit.validation, count(ExperimentRole::kValidation));
  }
  report.notes = problem.data().remarks;
  std::ranges::copy(notes_of(fit), std::back_inserter(report.notes));
  report.details = std::make_shared<Json>(details_of(fit));
  return report;
}

}  // namespace

FitReport fit_lumped(const ModelFitRequest& request) {
  std::optional<std::filesystem::path> physics;
  if (request.physics.size() > 1) {
    throw InputError(
        "fit: a lumped model takes one --physics file; put the elements into one list");
  }
  if (!request.physics.empty()) physics = request.physics.front();
  const LumpedModel model = load_lumped_model(request.model, physics);
  const Campaign campaign = read_campaign(request.campaign);
  OutputErrorProblem problem(model, load_output_error_data(model, campaign), request.threads);
  const OutputErrorFit fit = fit_output_error(problem, options_of(request));
  FitReport report = report_of(request, problem, fit);
  report.campaign = campaign.file.string();
  return report;
}

}  // namespace graybox
