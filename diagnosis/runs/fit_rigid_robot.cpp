// `graybox fit` of a graybox-rigid-robot/1 model: inverse-dynamics least squares.
#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/inverse_dynamics/base_parameters.hpp"
#include "diagnosis/inverse_dynamics/inverse_dynamics_fit.hpp"
#include "diagnosis/runs/model_fit.hpp"
#include "problems/base/stop.hpp"

namespace graybox {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kWeakError = 0.2;  // relative standard error above which a parameter is named

Json json_of(const TorqueErrors& errors) {
  return {{"relative_error", errors.relative},
          {"nrmse", errors.nrmse},
          {"variance_accounted_for", errors.variance_accounted_for},
          {"chi_square_per_dof", errors.chi_square_per_sample}};
}

Json records_json(const InverseDynamicsFit& fit) {
  Json list = Json::array();
  for (const RecordErrors& record : fit.records) {
    Json joints = Json::array();
    for (std::size_t j = 0; j < record.joints.size(); ++j) {
      joints.push_back({{"name", fit.robot.joints[j].name}});
      joints.back().update(json_of(record.joints[j]));
    }
    list.push_back({{"name", record.name},
                    {"role", name_of(record.role)},
                    {"samples", record.samples},
                    {"total", json_of(record.total)},
                    {"joints", std::move(joints)}});
  }
  return list;
}

Json details_of(const InverseDynamicsFit& fit) {
  return {{"base_parameters", fit.structural_parameters},
          {"relations", fit.relations},
          {"without_effect", fit.without_effect},
          {"noise", std::vector<double>(fit.noise.begin(), fit.noise.end())},
          {"condition", fit.condition},
          {"autocorrelation_lags", fit.lags},
          {"samples", fit.samples},
          {"records", records_json(fit)}};
}

// Records of one role together, by their numbers of samples.
FitQuality quality_of(const InverseDynamicsFit& fit, ExperimentRole role) {
  FitQuality quality;
  double samples = 0.0, chi_square = 0.0, nrmse = 0.0, accounted = 0.0;
  for (const RecordErrors& record : fit.records) {
    if (record.role != role) continue;
    ++quality.recordings;
    const auto weight = static_cast<double>(record.samples);
    samples += weight;
    chi_square += weight * record.total.chi_square_per_sample;
    nrmse += weight * record.total.nrmse * record.total.nrmse;
    accounted += weight * record.total.variance_accounted_for;
  }
  quality.chi_square_per_dof = chi_square / samples;
  quality.nrmse = std::sqrt(nrmse / samples);
  quality.variance_accounted_for = accounted / samples;
  return quality;
}

// Every parameter of the fit has a standard error: what has no effect in the data was left out of
// it.
Identifiability identifiability_of(const InverseDynamicsFit& fit, const Eigen::VectorXd& values) {
  Identifiability result;
  result.covariance = fit.covariance;
  if (values.size() == 0) return result;
  const Eigen::VectorXd scale = (values.array() == 0.0).select(1.0, values.cwiseAbs());
  const Eigen::MatrixXd relative =
      scale.cwiseInverse().asDiagonal() * fit.covariance * scale.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(relative, Eigen::EigenvaluesOnly);
  result.relative_standard_errors = solver.eigenvalues().reverse().cwiseMax(0.0).cwiseSqrt();
  for (const std::string& words : fit.unseen) {
    result.unseen.push_back({Eigen::VectorXd(), std::numeric_limits<double>::infinity(), words});
  }
  for (const TorqueParameter& each : fit.parameters) {
    if (each.relative_error() <= kWeakError) continue;
    if (result.weak.empty()) result.weak.emplace_back("relative standard errors:");
    result.weak.back() += fmt::format(" {} {:.3g} %", each.name, 100.0 * each.relative_error());
  }
  return result;
}

void describe_forces(const InverseDynamicsFit& fit, FitReport& report) {
  for (const RecordErrors& record : fit.records) {
    std::string line = fmt::format("{} {}: |error|/|torque| {:.4g} %, by joint",
                                   name_of(record.role), record.name, record.total.relative);
    for (const TorqueErrors& joint : record.joints) line += fmt::format(" {:.4g}", joint.relative);
    report.notes.push_back(line + "; NRMSE");
    for (const TorqueErrors& joint : record.joints) {
      report.notes.back() += fmt::format(" {:.4g}", joint.nrmse);
    }
  }
  for (const std::string& relation : fit.relations) report.notes.push_back(relation);
  report.notes.push_back(
      fmt::format("the noise of each joint is estimated; standard errors hold for residuals "
                  "correlated over {} samples and between joints",
                  fit.lags));
}

}  // namespace

FitReport fit_rigid_robot(const ModelFitRequest& request) {
  const std::vector<std::filesystem::path> physics(request.physics.begin(), request.physics.end());
  const RigidRobotModel robot = load_rigid_robot(request.model, physics, request.refine);
  const Campaign campaign = read_campaign(request.campaign);
  InverseDynamicsOptions options;
  options.decimation = request.decimation;
  if (request.equal_noise) options.noise = JointNoise::kEqual;
  options.keep_going = [] { return !stop_requested(); };
  std::vector<MotionRecord> records = read_motion_records(robot, campaign);
  FitReport report;
  for (const MotionRecord& record : records) {
    for (const std::string& remark : record.remarks) {
      report.notes.push_back(fmt::format("{}: {}", record.name, remark));
    }
  }
  const InverseDynamicsFit fit = fit_inverse_dynamics(robot, std::move(records), options);
  report.model = request.model;
  report.campaign = campaign.file.string();
  report.method = "inverse dynamics, weighted least squares of base parameters";
  report.status = name_of(fit.status);
  std::vector<std::string> names;
  Eigen::VectorXd values(static_cast<Eigen::Index>(fit.parameters.size()));
  for (const TorqueParameter& each : fit.parameters) {
    values(static_cast<Eigen::Index>(names.size())) = each.value;
    names.push_back(each.name);
    const QuantityKind kind = each.is_refined
                                  ? quantity_kind(each.name, each.unit)
                                  : base_parameter_kind(each.name, each.unit, fit.relations);
    report.parameters.push_back({each.name, each.unit, each.value, each.start, kind});
  }
  report.identifiability = identifiability_of(fit, values);
  report.chi_square = fit.chi_square;
  report.degrees_of_freedom = static_cast<std::size_t>(fit.degrees_of_freedom);
  report.estimation = quality_of(fit, ExperimentRole::kEstimation);
  const FitQuality validation = quality_of(fit, ExperimentRole::kValidation);
  if (validation.recordings > 0) report.validation = validation;
  describe_forces(fit, report);
  report.details = std::make_shared<Json>(details_of(fit));
  return report;
}

}  // namespace graybox
