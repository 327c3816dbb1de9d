#include "diagnosis/inverse_dynamics/inverse_dynamics_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "diagnosis/inverse_dynamics/base_parameters.hpp"
#include "diagnosis/inverse_dynamics/torque_columns.hpp"
#include "diagnosis/inverse_dynamics/torque_refinement.hpp"
#include "diagnosis/inverse_dynamics/weighted_regression.hpp"
#include "diagnosis/recordings/preprocess.hpp"
#include "problems/base/error.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr double kParallelFilter = 0.4;  // of the sample rate after decimation
constexpr int kParallelFilterOrder = 4;
constexpr double kDataTolerance = 1e-6;   // of a column's length: not told from those before
constexpr int kMaxRounds = 20;            // of weights and refinement in turn
constexpr double kRoundTolerance = 1e-6;  // relative change of the refined values
constexpr double kSlopeStep = 1e-5;       // relative, for the covariance of refined values

// ---- rows ---------------------------------------------------------------------------------------

std::vector<const MotionRecord*> with_role(const std::vector<MotionRecord>& records,
                                           ExperimentRole role) {
  std::vector<const MotionRecord*> chosen;
  for (const MotionRecord& record : records) {
    if (record.role == role) chosen.push_back(&record);
  }
  return chosen;
}

struct ModelRows {
  TorqueRows rows;           // torque: less what is known
  Eigen::VectorXd measured;  // the torque itself
};

// The same samples, each joint's, low-passed and decimated.
Eigen::MatrixXd filtered(const Eigen::MatrixXd& values, Index joints, int decimation) {
  const Index samples = values.rows() / joints;
  const Index kept = (samples + decimation - 1) / decimation;
  Eigen::MatrixXd result(kept * joints, values.cols());
  for (Index j = 0; j < joints; ++j) {
    for (Index c = 0; c < values.cols(); ++c) {
      const Eigen::VectorXd joint = values(Eigen::seqN(j, samples, joints), c);
      const Eigen::VectorXd smooth = zero_phase_low_pass(
          joint, kParallelFilter / static_cast<double>(decimation), kParallelFilterOrder);
      result(Eigen::seqN(j, kept, joints), c) = smooth(Eigen::seqN(0, kept, Index{decimation}));
    }
  }
  return result;
}

// Columns, then torque, then torque less what is known.
Eigen::MatrixXd piece_rows(TorqueColumns& columns, const Motion& piece) {
  const Index joints = piece.position.cols();
  Eigen::MatrixXd values(piece.samples() * joints, columns.size() + 2);
  const Eigen::MatrixXd remembered = columns.remembered(piece);
  columns.carry(piece.load);
  for (Index t = 0; t < piece.samples(); ++t) {
    columns.evaluate(piece.position.row(t).transpose(), piece.velocity.row(t).transpose(),
                     piece.acceleration.row(t).transpose());
    auto rows = values.middleRows(t * joints, joints);
    rows.leftCols(columns.size()) = columns.matrix();
    rows.col(columns.size()) = piece.torque.row(t).transpose();
    rows.col(columns.size() + 1) =
        (piece.torque.row(t) - remembered.row(t)).transpose() - columns.known();
  }
  for (const TorqueColumns::FilteredColumn& law : columns.filtered_columns(piece)) {
    for (Index j = 0; j < joints; ++j) {
      values(Eigen::seqN(j, piece.samples(), joints), law.column) += law.output(j) * law.change;
    }
  }
  return values;
}

// All columns of the model at every sample.
ModelRows rows_of(const RigidRobotModel& robot, const std::vector<const MotionRecord*>& records,
                  int decimation) {
  TorqueColumns columns(robot);
  ModelRows result;
  result.rows.joints = robot.size();
  std::vector<Eigen::MatrixXd> pieces;
  Index total = 0, recording = 0;
  for (const MotionRecord* record : records) {
    for (const Motion& piece : record->pieces) {
      result.rows.piece_recordings.push_back(recording);
      pieces.push_back(piece_rows(columns, piece));
      if (decimation > 1) pieces.back() = filtered(pieces.back(), robot.size(), decimation);
      result.rows.piece_samples.push_back(pieces.back().rows() / robot.size());
      total += pieces.back().rows();
    }
    if (!record->pieces.empty()) ++recording;
  }
  result.rows.columns.resize(total, columns.size());
  result.rows.torque.resize(total);
  result.measured.resize(total);
  Index row = 0;
  for (const Eigen::MatrixXd& piece : pieces) {
    result.rows.columns.middleRows(row, piece.rows()) = piece.leftCols(columns.size());
    result.measured.segment(row, piece.rows()) = piece.col(columns.size());
    result.rows.torque.segment(row, piece.rows()) = piece.col(columns.size() + 1);
    row += piece.rows();
  }
  return result;
}

void check_decimation(const RigidRobotModel& robot, const std::vector<MotionRecord>& records,
                      int decimation) {
  if (decimation == 1) return;
  if (decimation < 1) throw InputError("decimation must be a whole number, at least 1");
  for (const MotionRecord& record : records) {
    for (const Motion& piece : record.pieces) {
      const Eigen::VectorXd steps =
          piece.time.tail(piece.samples() - 1) - piece.time.head(piece.samples() - 1);
      if (steps.maxCoeff() - steps.minCoeff() > 1e-3 * steps.mean()) {
        throw InputError(
            fmt::format("model {}: {}: decimation needs even samples", robot.name, record.name));
      }
      if (piece.samples() < 4 * decimation) {
        throw InputError(
            fmt::format("model {}: {}: a segment of {} samples is too short to "
                        "decimate by {}",
                        robot.name, record.name, piece.samples(), decimation));
      }
    }
  }
}

void keep_columns(const std::vector<Index>& columns, TorqueRows& rows) {
  rows.columns = rows.columns(Eigen::all, columns).eval();
}

// ---- what can be seen ---------------------------------------------------------------------------

// Columns that the fit estimates, with their names after regrouping.
struct SeenColumns {
  std::vector<Index> columns;
  std::vector<std::string> names;
};

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t k = 0; k < names.size(); ++k) text += (k == 0 ? "" : ", ") + names[k];
  return text;
}

bool stands_still(const std::vector<const MotionRecord*>& records, Index joint) {
  for (const MotionRecord* record : records) {
    for (const Motion& piece : record->pieces) {
      const auto q = piece.position.col(joint);
      if (q.maxCoeff() - q.minCoeff() > 1e-9) return false;
    }
  }
  return true;
}

bool all_torques_are_zero(const std::vector<const MotionRecord*>& records) {
  return std::ranges::all_of(records, [](const MotionRecord* record) {
    return std::ranges::all_of(record->pieces,
                               [](const Motion& piece) { return piece.torque.isZero(0.0); });
  });
}

// Structural base parameters, then those of the data.
SeenColumns seen_columns(const RigidRobotModel& robot,
                         const std::vector<const MotionRecord*>& records, const TorqueRows& rows,
                         InverseDynamicsFit& fit) {
  if (rows.columns.cols() == 0) return {};
  TorqueColumns columns(robot);
  const BaseParameters structural = structural_base_parameters(columns, robot.size());
  fit.structural_parameters = structural.size();
  fit.without_effect = structural.without_effect;
  const BaseParameters seen = base_parameters(rows.columns(Eigen::all, structural.columns).eval(),
                                              structural.names, kDataTolerance);
  for (Index j = 0; j < robot.size(); ++j) {
    if (!stands_still(records, j)) continue;
    fit.unseen.push_back(fmt::format("joint {} does not move in the estimation data",
                                     robot.joints[static_cast<std::size_t>(j)].name));
  }
  if (!seen.without_effect.empty()) {
    fit.unseen.push_back("no effect in these recordings: " + joined(seen.without_effect));
  }
  for (const std::string& relation : seen.relations) {
    fit.unseen.push_back("not told apart in these recordings: " + relation);
  }
  fit.relations = structural.relations;
  SeenColumns result;
  for (Index k = 0; k < seen.size(); ++k) {
    const auto base = static_cast<std::size_t>(seen.columns[static_cast<std::size_t>(k)]);
    result.columns.push_back(structural.columns[base]);
    result.names.push_back(seen.names[static_cast<std::size_t>(k)]);
  }
  return result;
}

// ---- refinement ---------------------------------------------------------------------------------

Eigen::VectorXd refined_values(const RigidRobotModel& robot) {
  Eigen::VectorXd values(static_cast<Index>(robot.refined.size()));
  for (std::size_t k = 0; k < robot.refined.size(); ++k) {
    const ElementParameter& place = robot.refined[k];
    values(static_cast<Index>(k)) = robot.elements[place.element].parameters[place.parameter];
  }
  return values;
}

RigidRobotModel with_refined(RigidRobotModel robot, const Eigen::VectorXd& values) {
  for (std::size_t k = 0; k < robot.refined.size(); ++k) {
    set_parameter(robot, robot.refined[k], values(static_cast<Index>(k)));
  }
  return robot;
}

class Fitter {
 public:
  Fitter(const RigidRobotModel& robot, const std::vector<MotionRecord>& records,
         const InverseDynamicsOptions& options)
      : options_(options),
        records_(with_role(records, ExperimentRole::kEstimation)),
        robot_(robot),
        decimation_(options.decimation) {
    check_decimation(robot, records, decimation_);
    rows_ = rows_of(robot, records_, decimation_).rows;
    check();
    seen_ = seen_columns(robot_, records_, rows_, fit_);
    if (rows_.columns.cols() > 0 && seen_.columns.empty()) {
      throw InputError(
          fmt::format("model {}: nothing that is unknown has an effect in these data", robot.name));
    }
    keep_columns(seen_.columns, rows_);
    if (rows_.torque.size() <= rows_.columns.cols()) {
      throw InputError(
          fmt::format("model {}: {} samples of {} joints are too few for {} parameters", robot.name,
                      rows_.samples(), rows_.joints, rows_.columns.cols()));
    }
  }

  InverseDynamicsFit run(const std::vector<MotionRecord>& records) {
    const Eigen::VectorXd start = refined_values(robot_);
    regression_ = weighted_regression(rows_, options_.noise);
    if (!regression_.converged) fit_.status = InverseDynamicsStatus::kNotConverged;
    if (start.size() > 0) alternate();
    fill_parameters(start);
    fill_summary();
    for (const MotionRecord& record : records) fit_.records.push_back(errors_of(record));
    fit_.robot = robot_;
    return std::move(fit_);
  }

 private:
  void check() const {
    if (all_torques_are_zero(records_)) {
      throw InputError(fmt::format("model {}: the recorded torques are all zero", robot_.name));
    }
    if (!rows_.columns.allFinite()) {
      throw InputError(
          fmt::format("model {}: an element's force is not a number at its start", robot_.name));
    }
  }

  TorqueRows rows_at(const Eigen::VectorXd& refined) const {
    TorqueRows rows = rows_of(with_refined(robot_, refined), records_, decimation_).rows;
    keep_columns(seen_.columns, rows);
    return rows;
  }

  // Refined values for fixed weights, weights for fixed refined values, until both rest.
  void alternate() {
    std::vector<ParameterRange> ranges;
    for (const ElementParameter& place : robot_.refined) {
      const LawEntry& law = *find_law(robot_.elements[place.element].law_name, false);
      ranges.push_back(law.parameters[place.parameter].range);
    }
    const auto residuals = [&](const Eigen::VectorXd& values) -> Eigen::VectorXd {
      const TorqueRows rows = rows_at(values);
      const Eigen::VectorXd solution = solve_weighted(rows, regression_.noise);
      return (rows.torque - rows.columns * solution)
          .cwiseQuotient(regression_.noise.replicate(rows.samples(), 1));
    };
    fit_.status = InverseDynamicsStatus::kNotConverged;
    for (int round = 0; round < kMaxRounds; ++round) {
      const Eigen::VectorXd before = refined_values(robot_);
      const RefinementResult refined = refine_parameters(
          before, ranges, residuals, options_.max_refinement_steps, options_.keep_going);
      robot_ = with_refined(robot_, refined.values);
      rows_ = rows_at(refined.values);
      regression_ = weighted_regression(rows_, options_.noise);
      if (refined.interrupted) {
        fit_.status = InverseDynamicsStatus::kInterrupted;
        return;
      }
      if (name_runaways(refined.at_limit)) return;
      const double change = (refined.values - before)
                                .cwiseAbs()
                                .cwiseQuotient(before.cwiseAbs().cwiseMax(1e-12))
                                .maxCoeff();
      if (refined.converged && change < kRoundTolerance) {
        if (regression_.converged) fit_.status = InverseDynamicsStatus::kConverged;
        return;
      }
    }
  }

  bool name_runaways(const std::vector<bool>& at_limit) {
    bool any = false;
    for (std::size_t k = 0; k < at_limit.size(); ++k) {
      if (!at_limit[k]) continue;
      any = true;
      fit_.unseen.push_back(fmt::format(
          "{} leaves its start by a factor of 1000: these recordings don't determine it",
          name_of(robot_, robot_.refined[k])));
    }
    return any;
  }

  // Columns for the refined values: slopes of W p, by central differences.
  [[nodiscard]] Eigen::MatrixXd slopes() const {
    const Eigen::VectorXd values = refined_values(robot_);
    Eigen::MatrixXd result(rows_.columns.rows(), values.size());
    for (Index k = 0; k < values.size(); ++k) {
      const double step = kSlopeStep * std::max(std::abs(values(k)), 1e-3);
      const auto torque = [&](double sign) -> Eigen::VectorXd {
        Eigen::VectorXd moved = values;
        moved(k) += sign * step;
        const TorqueRows rows = rows_at(moved);
        return rows.columns * regression_.parameters - rows.torque;
      };
      result.col(k) = (torque(1.0) - torque(-1.0)) / (2.0 * step);
    }
    return result;
  }

  void fill_parameters(const Eigen::VectorXd& start) {
    TorqueColumns columns(robot_);
    for (std::size_t k = 0; k < seen_.columns.size(); ++k) {
      const auto column = static_cast<std::size_t>(seen_.columns[k]);
      fit_.parameters.push_back({.name = seen_.names[k],
                                 .unit = columns.units()[column],
                                 .value = regression_.parameters(static_cast<Index>(k))});
    }
    const Eigen::VectorXd values = refined_values(robot_);
    for (std::size_t k = 0; k < robot_.refined.size(); ++k) {
      fit_.parameters.push_back({.name = name_of(robot_, robot_.refined[k]),
                                 .unit = unit_of(robot_, robot_.refined[k]),
                                 .value = values(static_cast<Index>(k)),
                                 .start = start(static_cast<Index>(k)),
                                 .is_refined = true});
    }
    fit_.covariance = regression_.covariance;
    fit_.lags = regression_.lags;
    if (values.size() > 0) {
      TorqueRows all = rows_;
      all.columns.conservativeResize(Eigen::NoChange, rows_.columns.cols() + values.size());
      all.columns.rightCols(values.size()) = slopes();
      fit_.covariance =
          correlated_covariance(all, regression_.residuals, regression_.noise, fit_.lags);
    }
    for (std::size_t k = 0; k < fit_.parameters.size(); ++k) {
      const auto i = static_cast<Index>(k);
      fit_.parameters[k].standard_error = std::sqrt(fit_.covariance(i, i));
    }
  }

  void fill_summary() {
    fit_.noise = regression_.noise;
    fit_.condition = regression_.condition;
    fit_.samples = rows_.samples();
    fit_.degrees_of_freedom = rows_.torque.size() - static_cast<Index>(fit_.parameters.size());
    fit_.chi_square =
        regression_.residuals.cwiseQuotient(fit_.noise.replicate(rows_.samples(), 1)).squaredNorm();
  }

  [[nodiscard]] RecordErrors errors_of(const MotionRecord& record) const {
    ModelRows all = rows_of(robot_, {&record}, decimation_);
    TorqueRows& rows = all.rows;
    keep_columns(seen_.columns, rows);
    const Eigen::VectorXd errors = rows.torque - rows.columns * regression_.parameters;
    RecordErrors result;
    result.name = record.name;
    result.role = record.role;
    result.samples = rows.samples();
    Eigen::Array4d sums = Eigen::Array4d::Zero();
    double chi_square = 0.0;
    const Eigen::MatrixXd torque =
        Eigen::Map<const Eigen::MatrixXd>(all.measured.data(), rows.joints, rows.samples())
            .transpose();
    const Eigen::MatrixXd error =
        Eigen::Map<const Eigen::MatrixXd>(errors.data(), rows.joints, rows.samples()).transpose();
    const auto samples = static_cast<double>(rows.samples());
    for (Index j = 0; j < rows.joints; ++j) {
      const Eigen::ArrayXd e = error.col(j), y = torque.col(j);
      const Eigen::Array4d squares(e.square().sum(), y.square().sum(),
                                   (e - e.mean()).square().sum(), (y - y.mean()).square().sum());
      const double scaled = squares(0) / (fit_.noise(j) * fit_.noise(j));
      result.joints.push_back(errors_from(squares, scaled / samples));
      sums += squares;
      chi_square += scaled / (samples * static_cast<double>(rows.joints));
    }
    result.total = errors_from(sums, chi_square);
    return result;
  }

  // Sums of squares of the error, the torque, and both about their means.
  static TorqueErrors errors_from(const Eigen::Array4d& squares, double chi_square) {
    return {.relative = 100.0 * std::sqrt(squares(0) / squares(1)),
            .nrmse = 100.0 * std::sqrt(squares(0) / squares(3)),
            .variance_accounted_for = 100.0 * (1.0 - squares(2) / squares(3)),
            .chi_square_per_sample = chi_square};
  }

  const InverseDynamicsOptions& options_;
  std::vector<const MotionRecord*> records_;
  RigidRobotModel robot_;
  int decimation_;
  TorqueRows rows_;
  SeenColumns seen_;
  WeightedRegression regression_;
  InverseDynamicsFit fit_;
};

}  // namespace

const char* name_of(InverseDynamicsStatus status) {
  switch (status) {
    case InverseDynamicsStatus::kConverged:
      return "converged";
    case InverseDynamicsStatus::kNotConverged:
      return "not_converged";
    case InverseDynamicsStatus::kInterrupted:
      return "interrupted";
  }
  return "";
}

double TorqueParameter::relative_error() const {
  return value == 0.0 ? std::numeric_limits<double>::infinity() : standard_error / std::abs(value);
}

InverseDynamicsFit fit_inverse_dynamics(const RigidRobotModel& robot,
                                        const std::vector<MotionRecord>& records,
                                        const InverseDynamicsOptions& options) {
  return Fitter(robot, records, options).run(records);
}

}  // namespace graybox
