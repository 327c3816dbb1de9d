#include "graybox/diagnosis/force_balance/force_balance_mismatch.hpp"

#include <fmt/format.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <utility>

#include "graybox/diagnosis/force_balance/force_balance_data.hpp"
#include "graybox/diagnosis/force_balance/force_balance_laws.hpp"
#include "graybox/diagnosis/force_balance/remaining_structure.hpp"
#include "graybox/diagnosis/inverse_dynamics/torque_refinement.hpp"
#include "graybox/problems/random.hpp"

namespace graybox {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
// Rows that score tests look at: more do not change a ranking, but take longer.
constexpr Eigen::Index kScoredRows = 20000;
constexpr std::size_t kShownCurves = 6;

// Samples over the autocorrelation time 1 + 2 sum rho, summed until rho falls below 0.05.
double effective_samples(const Eigen::VectorXd& residuals) {
  const Eigen::Index n = residuals.size();
  const Eigen::VectorXd centred = residuals.array() - residuals.mean();
  const double variance = centred.squaredNorm();
  if (!(variance > 0.0)) return static_cast<double>(n);
  double time = 1.0;
  for (Eigen::Index lag = 1; lag < n / 4; ++lag) {
    const double rho = centred.head(n - lag).dot(centred.tail(n - lag)) / variance;
    if (rho < 0.05) break;
    time += 2.0 * rho;
  }
  return static_cast<double>(n) / time;
}

// Columns joined to those of the base parameters.
TorqueRows joined(const TorqueRows& base, const std::vector<Eigen::MatrixXd>& more) {
  TorqueRows rows = base;
  for (const Eigen::MatrixXd& columns : more) {
    const Eigen::Index first = rows.columns.cols();
    rows.columns.conservativeResize(Eigen::NoChange, first + columns.cols());
    rows.columns.rightCols(columns.cols()) = columns;
  }
  return rows;
}

bool has_full_rank(const TorqueRows& rows, const Eigen::VectorXd& noise) {
  if (rows.columns.cols() == 0) return true;
  Eigen::MatrixXd scaled =
      row_weights(noise, rows.columns.rows()).asDiagonal() * rows.columns;
  for (Eigen::Index k = 0; k < scaled.cols(); ++k) {
    const double length = scaled.col(k).norm();
    if (!(length > 0.0) || !std::isfinite(length)) return false;
    scaled.col(k) /= length;
  }
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> factor;
  factor.setThreshold(1e-7);
  factor.compute(scaled);
  return factor.rank() == scaled.cols();
}

class ForceBalanceProblem : public MismatchProblem {
 public:
  ForceBalanceProblem(ForceBalanceData data, ForceBalanceOptions options)
      : data_(std::move(data)), options_(std::move(options)) {
    const WeightedRegression first = weighted_regression(data_.estimation.base);
    noise_ = first.noise;
    const Eigen::VectorXd rest = unpredicted(data_.estimation, first.residuals);
    for (Eigen::Index j = 0; j < joints(); ++j) {
      effective_.push_back(effective_samples(of_joint(rest, j)));
    }
    list_hypotheses();
  }

  [[nodiscard]] std::span<const Hypothesis> hypotheses() const override { return hypotheses_; }
  [[nodiscard]] double sample_count() const override {
    double count = 0.0;
    for (const double each : effective_) count += each;
    return count;
  }
  [[nodiscard]] bool noise_is_known() const override { return false; }

  [[nodiscard]] ExtendedFit fit(std::span<const LawStart> starts,
                                const ExtendedFit* /*nearby*/) const override {
    std::vector<PlacedLaw> laws;
    for (const LawStart& start : starts) laws.push_back(placed(start.hypothesis, start.parameters));
    ExtendedFit result;
    const auto fail = [&result](std::string trouble) {
      result.trouble = std::move(trouble);
      return result;
    };
    if (!refine(laws)) return fail("the laws' shapes could not be refined");
    const TorqueRows rows = joined(data_.estimation.base, all_linear_columns(laws));
    if (!rows.columns.allFinite()) return fail("a law's force is not a number");
    if (!has_full_rank(rows, noise_)) return fail("the data can't tell its parameters apart");
    const WeightedRegression regression = weighted_regression(rows);
    set_linear(laws, regression.parameters);
    if (!within_ranges(laws)) return fail("a law's parameter leaves its range");
    if (!slides(laws)) return fail("a friction never slides: it is a damper here");
    result.usable = true;
    describe(starts, laws, rows, regression, result);
    return result;
  }

  [[nodiscard]] ScoreTable scores(const ExtendedFit& fit, std::span<const std::size_t> asked,
                                  int null_draws, std::uint64_t seed) const override;

  [[nodiscard]] std::vector<MismatchCell> mismatch(const ExtendedFit& /*fit*/) const override {
    return {};  // cells are compared with the noise, which is not known
  }

  [[nodiscard]] std::optional<Assessment> validate(const ExtendedFit& fit) const override {
    if (data_.validation.empty()) return {};
    return assess(data_.validation, residuals(fit, data_.validation));
  }

  [[nodiscard]] std::optional<double> remaining_structure(const ExtendedFit& fit) const override {
    return graybox::remaining_structure(data_.estimation, residuals(fit, data_.estimation));
  }

  [[nodiscard]] std::vector<ForcePicture> force_pictures(const ExtendedFit& fit) const override {
    std::vector<ForcePicture> pictures;
    for (const FittedLaw& law : fit.laws) pictures.push_back(picture(fit, law));
    return pictures;
  }

  [[nodiscard]] std::vector<ResidualCurve> residual_curves(const ExtendedFit& fit) const override {
    std::vector<ResidualCurve> curves;
    if (!data_.validation.empty()) add_curves(fit, data_.validation, true, curves);
    add_curves(fit, data_.estimation, false, curves);
    return curves;
  }

 private:
  [[nodiscard]] Eigen::Index joints() const { return data_.estimation.base.joints; }

  [[nodiscard]] Eigen::VectorXd of_joint(const Eigen::VectorXd& rows, Eigen::Index joint) const {
    return rows(Eigen::seq(joint, Eigen::last, joints()));
  }

  void list_hypotheses() {
    for (const CandidatePlace& place : data_.places) {
      scales_.push_back(motion_scale(place, data_.estimation));
      for (const LawEntry* entry : force_balance_laws(place)) {
        hypotheses_.push_back({place.location.name, place.yaml, entry->name,
                               special_cases_of(*entry), entry->name == "ripple"});
        entries_.push_back(entry);
        place_of_.push_back(scales_.size() - 1);
      }
    }
  }

  [[nodiscard]] PlacedLaw placed(std::size_t hypothesis, std::vector<double> parameters) const {
    return {&data_.places[place_of_[hypothesis]], entries_[hypothesis], std::move(parameters)};
  }

  [[nodiscard]] std::vector<Eigen::MatrixXd> all_linear_columns(
      const std::vector<PlacedLaw>& laws) const {
    std::vector<Eigen::MatrixXd> columns;
    for (const PlacedLaw& law : laws) columns.push_back(linear_columns(law, data_.estimation));
    return columns;
  }

  // The parameters in which forces are not linear, by variable projection.
  bool refine(std::vector<PlacedLaw>& laws) const {
    std::vector<ParameterRange> ranges;
    std::vector<double*> values;
    for (PlacedLaw& law : laws) {
      for (const std::size_t index : law.refined()) {
        ranges.push_back(law.entry->parameters[index].range);
        values.push_back(&law.parameters[index]);
      }
    }
    if (values.empty()) return true;
    Eigen::VectorXd start(static_cast<Eigen::Index>(values.size()));
    for (std::size_t k = 0; k < values.size(); ++k)
      start(static_cast<Eigen::Index>(k)) = *values[k];
    const auto set = [&values](const Eigen::VectorXd& theta) {
      for (std::size_t k = 0; k < values.size(); ++k)
        *values[k] = theta(static_cast<Eigen::Index>(k));
    };
    const Eigen::VectorXd weights = row_weights(noise_, data_.estimation.base.torque.size());
    const auto rest = [&](const Eigen::VectorXd& theta) -> Eigen::VectorXd {
      set(theta);
      const TorqueRows rows = joined(data_.estimation.base, all_linear_columns(laws));
      if (!rows.columns.allFinite()) {
        return Eigen::VectorXd::Constant(rows.torque.size(), kUnknown);
      }
      const Eigen::VectorXd p = solve_weighted(rows, noise_);
      return weights.cwiseProduct(rows.torque - rows.columns * p);
    };
    const RefinementResult result = refine_parameters(start, ranges, rest, 60, options_.keep_going);
    if (!result.values.allFinite() || result.interrupted) return false;
    set(result.values);
    return true;
  }

  void set_linear(std::vector<PlacedLaw>& laws, const Eigen::VectorXd& parameters) const {
    Eigen::Index at = data_.estimation.base.columns.cols();
    for (PlacedLaw& law : laws) {
      for (const std::size_t index : law.linear()) law.parameters[index] = parameters(at++);
    }
  }

  // Friction whose transition is wider than half of the recorded velocities is no friction.
  [[nodiscard]] bool slides(const std::vector<PlacedLaw>& laws) const {
    for (const PlacedLaw& law : laws) {
      const auto place = static_cast<std::size_t>(law.place - data_.places.data());
      for (std::size_t i = 0; i < law.parameters.size(); ++i) {
        if (law.entry->parameters[i].name == "transition_velocity" &&
            law.parameters[i] > scales_[place].rate(0.5)) {
          return false;
        }
      }
    }
    return true;
  }

  static bool within_ranges(const std::vector<PlacedLaw>& laws) {
    for (const PlacedLaw& law : laws) {
      for (std::size_t i = 0; i < law.parameters.size(); ++i) {
        const ParameterRange range = law.entry->parameters[i].range;
        const double value = law.parameters[i];
        if (range == ParameterRange::kPositive && !(value > 0.0)) return false;
        if (range == ParameterRange::kNonNegative && !(value >= 0.0)) return false;
        if (range == ParameterRange::kUnitInterval && !(value >= 0.0 && value <= 1.0)) return false;
      }
    }
    return true;
  }

  // Derivatives of all forces by the refined parameters, central differences.
  [[nodiscard]] Eigen::MatrixXd shape_slopes(const std::vector<PlacedLaw>& laws) const {
    std::vector<Eigen::VectorXd> slopes;
    for (const PlacedLaw& law : laws) {
      for (const std::size_t index : law.refined()) {
        PlacedLaw moved = law;
        const double value = law.parameters[index];
        const double step = 1e-4 * std::max(std::abs(value), 1e-6);
        moved.parameters[index] = value + step;
        const Eigen::VectorXd above = force_rows(moved, data_.estimation);
        moved.parameters[index] = value - step;
        slopes.push_back((above - force_rows(moved, data_.estimation)) / (2.0 * step));
      }
    }
    Eigen::MatrixXd result(data_.estimation.base.torque.size(),
                           static_cast<Eigen::Index>(slopes.size()));
    for (std::size_t k = 0; k < slopes.size(); ++k)
      result.col(static_cast<Eigen::Index>(k)) = slopes[k];
    return result;
  }

  // Standard deviations of all linear, then all refined parameters; NaN where the data do not see one.
  [[nodiscard]] Eigen::VectorXd deviations(const TorqueRows& rows,
                                           const std::vector<PlacedLaw>& laws,
                                           const WeightedRegression& regression) const {
    const Eigen::MatrixXd slopes = shape_slopes(laws);
    const TorqueRows all = joined(rows, {slopes});
    Eigen::VectorXd result = Eigen::VectorXd::Constant(all.columns.cols(), kUnknown);
    if (all.columns.allFinite() && has_full_rank(all, regression.noise)) {
      Eigen::Index lags = 0;
      return correlated_covariance(all, regression.residuals, regression.noise, lags)
          .diagonal()
          .cwiseSqrt();
    }
    // A shape that the data do not determine is held for the others' sake.
    result.head(rows.columns.cols()) = regression.covariance.diagonal().cwiseSqrt();
    return result;
  }

  void describe(std::span<const LawStart> starts, const std::vector<PlacedLaw>& laws,
                const TorqueRows& rows, const WeightedRegression& regression,
                ExtendedFit& result) const {
    const Eigen::VectorXd deviation = deviations(rows, laws, regression);
    const Eigen::Index base = data_.estimation.base.columns.cols();
    for (Eigen::Index k = 0; k < base; ++k) {
      const auto at = static_cast<std::size_t>(k);
      result.model_parameters.push_back({data_.parameter_names[at], data_.parameter_units[at],
                                         regression.parameters(k), deviation(k)});
    }
    Eigen::Index linear = base, refined = rows.columns.cols();
    std::size_t count = static_cast<std::size_t>(rows.columns.cols());
    for (std::size_t k = 0; k < laws.size(); ++k) {
      const PlacedLaw& law = laws[k];
      FittedLaw fitted{starts[k].hypothesis, {}};
      for (std::size_t i = 0; i < law.parameters.size(); ++i) {
        fitted.parameters.push_back(
            {law.entry->parameters[i].name,
             unit_at(law.entry->parameters[i].unit, law.place->location.units), law.parameters[i],
             kUnknown});
      }
      for (const std::size_t index : law.linear()) {
        fitted.parameters[index].standard_error = deviation(linear++);
      }
      for (const std::size_t index : law.refined()) {
        fitted.parameters[index].standard_error = deviation(refined++);
        ++count;
      }
      result.laws.push_back(std::move(fitted));
    }
    result.parameter_count = count;
    for (Eigen::Index j = 0; j < joints(); ++j) {
      result.deviance +=
          effective_[static_cast<std::size_t>(j)] * 2.0 * std::log(regression.noise(j));
    }
    result.estimation = assess(data_.estimation, regression.residuals);
    result.cross_validation = cross_validation(rows);
  }

  // Mean squared error over the first fit's noise, each fifth predicted by linear parameters from the
  // others.
  [[nodiscard]] double cross_validation(const TorqueRows& rows) const {
    const Eigen::Index samples = rows.samples();
    double square = 0.0;
    for (Eigen::Index fold = 0; fold < kFolds; ++fold) {
      std::vector<Eigen::Index> kept, out;
      for (Eigen::Index row = 0; row < rows.torque.size(); ++row) {
        (fold_of(row / rows.joints, samples) == fold ? out : kept).push_back(row);
      }
      TorqueRows rest;
      rest.joints = rows.joints;
      rest.columns = rows.columns(kept, Eigen::all);
      rest.torque = rows.torque(kept);
      rest.piece_samples = {rest.samples()};
      if (!has_full_rank(rest, noise_)) return std::numeric_limits<double>::infinity();
      const Eigen::VectorXd p = solve_weighted(rest, noise_);
      const Eigen::VectorXd error = rows.torque(out) - rows.columns(out, Eigen::all) * p;
      square += row_weights(noise_, error.size()).cwiseProduct(error).squaredNorm();
    }
    return square / static_cast<double>(rows.torque.size());
  }

  // Errors with given values of everything.
  [[nodiscard]] Eigen::VectorXd residuals(const ExtendedFit& fit,
                                          const ForceBalanceRows& rows) const {
    Eigen::VectorXd result = rows.base.torque;
    for (Eigen::Index k = 0; k < rows.base.columns.cols(); ++k) {
      result -= fit.model_parameters[static_cast<std::size_t>(k)].value * rows.base.columns.col(k);
    }
    for (const FittedLaw& law : fit.laws) result -= force_rows(placed_of(law), rows);
    return result;
  }

  [[nodiscard]] PlacedLaw placed_of(const FittedLaw& law) const {
    std::vector<double> parameters;
    for (const LawParameterEstimate& estimate : law.parameters)
      parameters.push_back(estimate.value);
    return placed(law.hypothesis, std::move(parameters));
  }

  // Relative errors are of all joints' rows together, as tables of published results have them.
  [[nodiscard]] Assessment assess(const ForceBalanceRows& rows,
                                  const Eigen::VectorXd& error) const {
    double variance = 0.0, error_variance = 0.0;
    const Eigen::VectorXd torque = measured_torque(rows);
    const double n = static_cast<double>(rows.samples());
    for (Eigen::Index j = 0; j < joints(); ++j) {
      const Eigen::VectorXd signal = of_joint(torque, j), rest = of_joint(error, j);
      variance += (signal.array() - signal.mean()).matrix().squaredNorm() / n;
      error_variance += (rest.array() - rest.mean()).matrix().squaredNorm() / n;
    }
    Assessment result;
    result.chi_square = row_weights(noise_, error.size()).cwiseProduct(error).squaredNorm();
    result.degrees_of_freedom = static_cast<double>(error.size());
    result.nrmse = 100.0 * std::sqrt(error.squaredNorm() / n / variance);
    result.variance_accounted_for = 100.0 * (1.0 - error_variance / variance);
    return result;
  }

  [[nodiscard]] Eigen::VectorXd measured_torque(const ForceBalanceRows& rows) const {
    Eigen::VectorXd torque(rows.base.torque.size());
    Eigen::Index row = 0;
    for (const Motion& piece : rows.pieces) {
      for (Eigen::Index t = 0; t < piece.samples(); ++t, row += joints()) {
        torque.segment(row, joints()) = piece.torque.row(t).transpose();
      }
    }
    return torque;
  }

  [[nodiscard]] ForcePicture picture(const ExtendedFit& fit, const FittedLaw& law) const {
    const PlacedLaw placed_law = placed_of(law);
    const Eigen::VectorXd own = force_rows(placed_law, data_.estimation);
    const Eigen::VectorXd asked = residuals(fit, data_.estimation) + own;
    const Eigen::VectorXd& direction = placed_law.place->location.output;
    const PlaceUnits& units = placed_law.place->location.units;
    ForcePicture result{
        law.hypothesis, units.deflection, units.deflection + "/s", units.force, {}, {}, {}, {}};
    Eigen::Index row = 0;
    for (const Motion& piece : data_.estimation.pieces) {
      const PlaceMotion motion = motion_at(*placed_law.place, piece);
      for (Eigen::Index t = 0; t < piece.samples(); ++t, row += joints()) {
        result.deflection.push_back(motion.deflection(t));
        result.rate.push_back(motion.rate(t));
        result.force.push_back(direction.dot(asked.segment(row, joints())) /
                               direction.squaredNorm());
        result.law_force.push_back(direction.dot(own.segment(row, joints())) /
                                   direction.squaredNorm());
      }
    }
    return result;
  }

  // The first recording of a role, every joint, the worst first.
  void add_curves(const ExtendedFit& fit, const ForceBalanceRows& rows, bool held_out,
                  std::vector<ResidualCurve>& curves) const {
    const Eigen::VectorXd error = residuals(fit, rows);
    const Motion& piece = rows.pieces.front();
    std::vector<ResidualCurve> own;
    for (Eigen::Index j = 0; j < joints(); ++j) {
      const RobotJoint& joint = data_.robot.joints[static_cast<std::size_t>(j)];
      ResidualCurve curve;
      curve.channel = "torque of " + joint.name;
      curve.unit = joint.is_prismatic ? "N" : "N m";
      curve.experiment = rows.names.front() + (held_out ? ", kept out of the fit" : "");
      curve.over_time = true;
      curve.held_out = held_out;
      for (Eigen::Index t = 0; t < piece.samples(); ++t) {
        curve.axis.push_back(piece.time(t));
        curve.measured.push_back(piece.torque(t, j));
        curve.residual.push_back(error(t * joints() + j));
      }
      own.push_back(std::move(curve));
    }
    for (ResidualCurve& curve : own) {
      if (curves.size() < kShownCurves) curves.push_back(std::move(curve));
    }
  }

  ForceBalanceData data_;
  ForceBalanceOptions options_;
  Eigen::VectorXd noise_;          // of the first fit, by joint
  std::vector<double> effective_;  // samples, by joint
  std::vector<Hypothesis> hypotheses_;
  std::vector<const LawEntry*> entries_;
  std::vector<std::size_t> place_of_;
  std::vector<MotionScale> scales_;  // of each place
};

// ---- scores ---------------------------------------------------------------------------------------

// Rows for the score tests: every stride-th, over the noise, with draws of pure noise beside them.
struct ScoredRows {
  std::vector<Eigen::Index> kept;
  Eigen::VectorXd weights;
  Eigen::MatrixXd right;  // residual, then draws

  [[nodiscard]] Eigen::MatrixXd scaled(const Eigen::MatrixXd& columns) const {
    return weights.asDiagonal() * columns(kept, Eigen::all);
  }
};

ScoredRows scored_rows(const Eigen::VectorXd& residuals, const Eigen::VectorXd& noise,
                       Eigen::Index joints, int draws, std::uint64_t seed) {
  ScoredRows rows;
  const Eigen::Index stride = residuals.size() / kScoredRows + 1;
  for (Eigen::Index sample = 0; sample < residuals.size() / joints; sample += stride) {
    for (Eigen::Index j = 0; j < joints; ++j) rows.kept.push_back(sample * joints + j);
  }
  rows.weights = row_weights(noise, residuals.size())(rows.kept);
  rows.right.resize(rows.weights.size(), 1 + draws);
  rows.right.col(0) = rows.weights.cwiseProduct(residuals(rows.kept));
  Random random(seed);
  for (Eigen::Index k = rows.right.rows(); k < rows.right.size(); ++k) {
    rows.right.data()[k] = random.normal();
  }
  return rows;
}

Eigen::VectorXd rms_by_joint(const Eigen::VectorXd& residuals, Eigen::Index joints) {
  Eigen::VectorXd rms(joints);
  for (Eigen::Index j = 0; j < joints; ++j) {
    const Eigen::VectorXd own = residuals(Eigen::seq(j, Eigen::last, joints));
    rms(j) = std::sqrt(own.squaredNorm() / static_cast<double>(own.size()));
  }
  const double floor = 1e-12 * std::max(rms.maxCoeff(), 1e-300);
  return rms.cwiseMax(floor);
}

ScoreTable ForceBalanceProblem::scores(const ExtendedFit& fit, std::span<const std::size_t> asked,
                                       int null_draws, std::uint64_t seed) const {
  const Eigen::VectorXd rest = residuals(fit, data_.estimation);
  const ScoredRows rows =
      scored_rows(rest, rms_by_joint(rest, joints()), joints(), null_draws, seed);
  std::vector<PlacedLaw> present;
  for (const FittedLaw& law : fit.laws) present.push_back(placed_of(law));
  std::vector<Eigen::MatrixXd> fitted = all_linear_columns(present);
  fitted.push_back(shape_slopes(present));
  const Eigen::MatrixXd nuisance = rows.scaled(joined(data_.estimation.base, fitted).columns);
  const double thinning = static_cast<double>(rest.size()) / static_cast<double>(rows.kept.size());
  const double square = rows.right.col(0).squaredNorm();
  const ScoreTest test({nuisance.transpose() * nuisance, nuisance.transpose() * rows.right},
                       {square, sample_count() - static_cast<double>(nuisance.cols())});
  ScoreTable table;
  table.null_minima.assign(static_cast<std::size_t>(null_draws), 1.0);
  // A sample is worth less than one where residuals are correlated, more where rows were left out.
  const double inflation = std::sqrt(static_cast<double>(rest.size()) / sample_count() / thinning);
  for (const std::size_t hypothesis : asked) {
    HypothesisScore best;
    best.start.hypothesis = hypothesis;
    const CandidatePlace& place = data_.places[place_of_[hypothesis]];
    const LawEntry& entry = *entries_[hypothesis];
    best.amplitude_unit = unit_at(entry.parameters.front().unit, place.location.units);
    best.shapes = 0;
    for (const LawShape& shape : law_shapes(entry, place, scales_[place_of_[hypothesis]])) {
      Eigen::MatrixXd columns(data_.estimation.base.torque.size(),
                              static_cast<Eigen::Index>(shape.basis.size()));
      for (std::size_t k = 0; k < shape.basis.size(); ++k) {
        columns.col(static_cast<Eigen::Index>(k)) =
            shape_rows(place, entry, shape.basis[k], data_.estimation);
      }
      const Eigen::MatrixXd scaled = rows.scaled(columns);
      if (!scaled.allFinite() || !(scaled.norm() > 0.0)) continue;
      ++best.shapes;
      const CandidateProducts products{scaled.transpose() * scaled, scaled.transpose() * nuisance,
                                       scaled.transpose() * rows.right};
      test.lower_minimum_p_values(products, table.null_minima);
      CandidateScore score = test.score(products);
      if (score.statistic <= best.score.statistic) continue;
      std::vector<double> parameters = shape.parameters(score.amplitudes);
      if (parameters.empty()) continue;
      best.start.parameters = std::move(parameters);
      best.amplitude = score.amplitudes(0);
      best.amplitude_deviation = inflation * std::sqrt(score.amplitude_covariance(0, 0));
      best.explained_share = score.statistic / square;
      best.score = std::move(score);
    }
    table.scores.push_back(std::move(best));
  }
  return table;
}

}  // namespace

std::unique_ptr<MismatchProblem> force_balance_problem(const std::filesystem::path& model,
                                                       const Campaign& campaign,
                                                       const ForceBalanceOptions& options) {
  return std::make_unique<ForceBalanceProblem>(load_force_balance_data(model, campaign), options);
}

}  // namespace graybox
