#include "diagnosis/force_balance/rival_motions.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <set>
#include <string>
#include <utility>

#include "diagnosis/force_balance_data/force_balance_laws.hpp"
#include "problems/base/stop.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::RowVectorXd;
using Eigen::VectorXd;

constexpr std::array<double, 4> kAmplitudes{1.0, 0.5, 0.25, 2.0};
constexpr std::array<double, 5> kSpeeds{1.0, 0.5, 0.25, 2.0, 4.0};
constexpr std::size_t kMostRecordings = 3;
constexpr Index kMostSamples = 800;  // of an option
// Weak knowledge of each parameter beside the recordings: some can't be told apart by them.
constexpr double kRidge = 1e-8;
constexpr double kRounding = 1e-6;    // of positions and speeds
constexpr double kForceMargin = 0.1;  // by which a model may be wrong about the largest force

// The longest pieces, one a recording.
std::vector<std::size_t> longest_pieces(const ForceBalanceRows& rows) {
  std::vector<std::size_t> order(rows.pieces.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::ranges::stable_sort(order, std::greater<>(),
                           [&rows](std::size_t i) { return rows.pieces[i].samples(); });
  std::vector<std::size_t> chosen;
  std::set<std::string> seen;
  for (const std::size_t i : order) {
    if (chosen.size() == kMostRecordings) break;
    if (seen.insert(rows.names[i]).second) chosen.push_back(i);
  }
  return chosen;
}

// This motion with another amplitude and speed, its force left open.
Motion changed(const Motion& piece, double amplitude, double speed) {
  const Index stride = piece.samples() / kMostSamples + 1;
  const auto kept = Eigen::seq(Index{0}, Eigen::last, stride);
  Motion motion = piece;
  const RowVectorXd middle =
      0.5 * (piece.position.colwise().minCoeff() + piece.position.colwise().maxCoeff());
  motion.time = (piece.time(kept).array() - piece.time(0)) / speed;
  motion.position = amplitude * (piece.position(kept, Eigen::all).rowwise() - middle);
  motion.position.rowwise() += middle;
  motion.velocity = amplitude * speed * piece.velocity(kept, Eigen::all);
  motion.acceleration = amplitude * speed * speed * piece.acceleration(kept, Eigen::all);
  motion.torque = MatrixXd::Zero(motion.position.rows(), motion.position.cols());
  if (piece.stands.size() > 0) motion.stands = piece.stands(kept, Eigen::all).eval();
  return motion;
}

// All joints but one stand in the middle of their ranges.
Motion alone(Motion motion, Index joint) {
  const RowVectorXd middle =
      0.5 * (motion.position.colwise().minCoeff() + motion.position.colwise().maxCoeff());
  if (motion.stands.size() == 0) {
    motion.stands.setConstant(motion.position.rows(), motion.position.cols(), false);
  }
  for (Index j = 0; j < motion.position.cols(); ++j) {
    if (j == joint) continue;
    motion.position.col(j).setConstant(middle(j));
    motion.velocity.col(j).setZero();
    motion.acceleration.col(j).setZero();
    motion.stands.col(j).setConstant(true);
  }
  return motion;
}

PlannedMotion planned(const Motion& motion, const ForceBalanceData& data) {
  PlannedMotion plan;
  for (const BalanceCoordinate& coordinate : data.coordinates) {
    plan.channels.push_back(coordinate.name);
    plan.units.push_back(coordinate.units.deflection);
  }
  plan.time = motion.time;
  plan.position = motion.position;
  return plan;
}

VectorXd peaks_of(const ForceBalanceRows& rows, const MatrixXd& values) {
  const MatrixXd counted =
      rows.counts.size() > 0 ? MatrixXd(values.cwiseProduct(rows.counts)) : values;
  return counted.cwiseAbs().colwise().maxCoeff();
}

}  // namespace

bool RivalMotions::is_within_recorded(const Motion& motion) const {
  const ForceBalanceRows& rows = fitter_.data().estimation;
  for (Index j = 0; j < rows.coordinates(); ++j) {
    double low = rows.pieces.front().position(0, j), high = low, fastest = 0.0;
    for (const Motion& piece : rows.pieces) {
      low = std::min(low, piece.position.col(j).minCoeff());
      high = std::max(high, piece.position.col(j).maxCoeff());
      fastest = std::max(fastest, piece.velocity.col(j).cwiseAbs().maxCoeff());
    }
    const double slack = kRounding * (high - low);
    if (motion.position.col(j).minCoeff() < low - slack ||
        motion.position.col(j).maxCoeff() > high + slack ||
        motion.velocity.col(j).cwiseAbs().maxCoeff() > fastest * (1.0 + kRounding)) {
      return false;
    }
  }
  return true;
}

void RivalMotions::make_options() const {
  const ForceBalanceData& data = fitter_.data();
  const Index joints = data.estimation.coordinates();
  const auto add = [&](const std::string& name, double amplitude, double speed, Index only,
                       const Motion& motion) {
    Option option{{}, rows_along(data, motion)};
    option.described.recording = name;
    option.described.amplitude = amplitude;
    option.described.speed = speed;
    if (only >= 0) option.described.alone = data.coordinates[static_cast<std::size_t>(only)].name;
    option.described.motion = std::make_shared<const PlannedMotion>(planned(motion, data));
    options_.push_back(std::move(option));
  };
  for (const std::size_t p : longest_pieces(data.estimation)) {
    for (const double amplitude : kAmplitudes) {
      for (const double speed : kSpeeds) {
        const Motion motion = changed(data.estimation.pieces[p], amplitude, speed);
        if (!is_within_recorded(motion)) continue;
        add(data.estimation.names[p], amplitude, speed, -1, motion);
        for (Index j = 0; j < joints && joints > 1 && p == 0; ++j) {
          if (!data.idle[static_cast<std::size_t>(j)]) {
            add(data.estimation.names[p], amplitude, speed, j, alone(motion, j));
          }
        }
      }
    }
  }
}

std::vector<MatrixXd> RivalMotions::columns_of(const ExtendedFit& fit,
                                               const ForceBalanceRows& rows) const {
  std::vector<MatrixXd> columns = rows.model.in;
  const auto append = [&](const BalanceColumns& own) {
    for (std::size_t j = 0; own.count > 0 && j < columns.size(); ++j) {
      const bool acts = own.in[j].size() > 0;
      append_columns(acts ? own.in[j] : MatrixXd(MatrixXd::Zero(rows.samples(), own.count)),
                     columns[j]);
    }
  };
  for (const FittedLaw& law : fit.laws) {
    const PlacedLaw placed = fitter_.placed_of(fit, law);
    append(law_columns(placed, fitter_.data(), rows));
    append(law_slopes(placed, placed.refined(), fitter_.data(), rows));
  }
  return columns;
}

MatrixXd RivalMotions::information(const ExtendedFit& a, const ExtendedFit& b,
                                   const ForceBalanceRows& rows, const VectorXd& weights) const {
  // What was measured cancels.
  const MatrixXd difference = fitter_.residuals(a, rows) - fitter_.residuals(b, rows);
  std::vector<MatrixXd> columns = columns_of(a, rows);
  const Index count = columns.front().cols() + 1;
  MatrixXd sum = MatrixXd::Zero(count, count);
  for (Index j = 0; j < rows.coordinates(); ++j) {
    MatrixXd& own = columns[static_cast<std::size_t>(j)];
    append_columns(difference.col(j), own);
    sum += weights(j) * own.transpose() * own;
  }
  return sum;
}

bool RivalMotions::exceeds_force(const ExtendedFit& fit, const Option& option) const {
  const ForceBalanceRows& recorded = fitter_.data().estimation;
  const VectorXd most = peaks_of(recorded, recorded.measured);
  const VectorXd asked = peaks_of(option.rows, fitter_.residuals(fit, option.rows));
  return (asked.array() > (1.0 + kForceMargin) * most.array()).any();
}

std::optional<RivalExperiments> RivalMotions::between(const ExtendedFit& a,
                                                      const ExtendedFit& b) const {
  std::call_once(is_made_, [this] { make_options(); });
  const ForceBalanceData& data = fitter_.data();
  const ForceBalanceRows& recorded = data.estimation;
  const VectorXd noise = rms_of(recorded, fitter_.residuals(a, recorded));
  const auto weights = [&](const ForceBalanceRows& rows) {
    VectorXd each = VectorXd::Zero(rows.coordinates());
    for (Index j = 0; j < rows.coordinates(); ++j) {
      if (rows.counted(j) > 0.0) {
        each(j) = fitter_.effective_samples(j) / (rows.counted(j) * noise(j) * noise(j));
      }
    }
    return each;
  };
  MatrixXd now = information(a, b, recorded, weights(recorded));
  if (recorded.model_precision.size() > 0) {
    now.diagonal().head(recorded.model_precision.size()) +=
        recorded.worth * recorded.model_precision;
  }
  now.diagonal() *= 1.0 + kRidge;
  std::vector<MatrixXd> further;
  std::vector<ExperimentOption> options;
  for (const Option& option : options_) {
    stop_if_requested();
    if (exceeds_force(a, option)) continue;
    further.push_back(information(a, b, option.rows, weights(option.rows)));
    options.push_back(option.described);
  }
  const std::set<std::string> names(recorded.names.begin(), recorded.names.end());
  return rival_experiment_set(now, further, std::move(options), static_cast<double>(names.size()));
}

}  // namespace graybox
