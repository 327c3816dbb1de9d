#include "diagnosis/force_balance/force_balance_mismatch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "diagnosis/force_balance/balance_errors.hpp"
#include "diagnosis/force_balance/balance_fitter.hpp"
#include "diagnosis/force_balance/balance_hypotheses.hpp"
#include "diagnosis/force_balance/balance_pictures.hpp"
#include "diagnosis/force_balance/balance_regression.hpp"
#include "diagnosis/force_balance/balance_scores.hpp"
#include "diagnosis/force_balance/balance_trends.hpp"
#include "diagnosis/force_balance/late_channels.hpp"
#include "diagnosis/force_balance/remaining_structure.hpp"
#include "diagnosis/force_balance/rival_motions.hpp"
#include "diagnosis/force_balance_data/derivative_noise.hpp"
#include "diagnosis/force_balance_data/force_balance_data.hpp"
#include "diagnosis/force_balance_data/force_balance_laws.hpp"
#include "diagnosis/force_balance_data/late_forces.hpp"
#include "diagnosis/force_balance_data/uncertain_bodies.hpp"
#include "diagnosis/hypotheses/physical_evidence.hpp"
#include "diagnosis/signals/coloured_noise.hpp"
#include "diagnosis/wiring/wiring_faults.hpp"
#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr int kLateRounds = 3;

// Whether these rows tell all parameters of the model apart.
bool determines_model(const ForceBalanceRows& rows) {
  constexpr double kIndependent = 1e-8;  // of a normal matrix of unit diagonal
  const Index count = rows.model.count;
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(count, count);
  for (const Eigen::MatrixXd& columns : rows.model.in) normal += columns.transpose() * columns;
  const Eigen::VectorXd scale = normal.diagonal().cwiseSqrt();
  if (count == 0) return true;
  if (!(scale.minCoeff() > 0.0)) return false;
  normal = scale.cwiseInverse().asDiagonal() * normal * scale.cwiseInverse().asDiagonal();
  return Eigen::LDLT<Eigen::MatrixXd>(normal).vectorD().minCoeff() > kIndependent;
}

// The recordings once more, with the forces of each joint moved by so many seconds, and bodies as
// uncertain as this if that is not 0.
using ReadAgain =
    std::function<ForceBalanceData(const Eigen::VectorXd& advance, double body_uncertainty)>;

// By so much the bodies of a drawing may be off at the worst.
constexpr double kDoubt = 0.3;

class ForceBalanceProblem : public MismatchProblem, public PhysicalEvidence {
 public:
  ForceBalanceProblem(ForceBalanceData data, ForceBalanceOptions options, ReadAgain read_again = {})
      : data_(std::move(data)),
        options_(std::move(options)),
        read_again_(std::move(read_again)),
        hypotheses_(data_),
        fitter_(data_, hypotheses_, options_.keep_going),
        late_(data_, fitter_, options_.keep_going),
        motions_(fitter_) {}

  // The fitter refers to the data beside it.
  ForceBalanceProblem(const ForceBalanceProblem&) = delete;
  ForceBalanceProblem& operator=(const ForceBalanceProblem&) = delete;
  ForceBalanceProblem(ForceBalanceProblem&&) = delete;
  ForceBalanceProblem& operator=(ForceBalanceProblem&&) = delete;
  ~ForceBalanceProblem() override = default;

  [[nodiscard]] std::span<const Hypothesis> hypotheses() const override {
    return hypotheses_.all();
  }
  [[nodiscard]] double sample_count() const override { return fitter_.sample_count(); }
  [[nodiscard]] bool noise_is_known() const override { return false; }
  [[nodiscard]] std::vector<ChannelFault> channel_faults() const override {
    return find_wiring_faults(data_.robot, data_.recorded, options_.keep_going);
  }

  [[nodiscard]] std::vector<std::string> remarks() const override { return data_.remarks; }

  [[nodiscard]] ExtendedFit fit(std::span<const LawStart> starts,
                                const ExtendedFit* nearby) const override {
    return fitter_.fit(starts, nearby);
  }

  [[nodiscard]] bool fits_at_once() const override { return true; }
  [[nodiscard]] bool holds_untouched_laws() const override {
    return coordinates() > 1 && !data_.robot.channels.unknown_drive_gains;
  }
  [[nodiscard]] std::vector<ExtendedFit> fit_each(std::span<const std::vector<LawStart>> laws,
                                                  const ExtendedFit* nearby) const override {
    std::vector<ExtendedFit> fits(laws.size());
    const StopClock clock;
#pragma omp parallel for num_threads(options_.threads) schedule(dynamic)
    for (std::size_t i = 0; i < laws.size(); ++i) {
      if (clock.stops()) continue;
      try {
        fits[i] = fit(laws[i], nearby);
      } catch (const InputError& error) {  // must not leave a thread
        fits[i].trouble = error.what();
      }
    }
    stop_if_requested();
    return fits;
  }

  [[nodiscard]] std::unique_ptr<MismatchProblem> with_uncertain_model(
      const ExtendedFit& fit) const override {
    if (!may_free_bodies(data_)) return nullptr;
    const Eigen::MatrixXd rest = residuals(fit, data_.estimation);
    double counted = 0.0, effective = 0.0;
    for (Index j = 0; j < coordinates(); ++j) {
      if (is_idle(j)) continue;
      counted += static_cast<double>(data_.estimation.samples());
      effective += ColouredNoise(rest.col(j)).effective_samples();
    }
    if (!(counted > 0.0)) return nullptr;
    std::optional<ForceBalanceData> freed =
        with_uncertain_bodies(data_, effective / counted, fitter_.inverse_gains(fit));
    if (!freed) return nullptr;
    return std::make_unique<ForceBalanceProblem>(*std::move(freed), options_, read_again_);
  }
  [[nodiscard]] std::unique_ptr<MismatchProblem> with_doubted_model(
      const ExtendedFit& fit) const override {
    const RigidRobotModel& robot = data_.robot;
    const bool states_bodies = std::ranges::any_of(
        robot.joints, [](const RobotJoint& joint) { return joint.body && joint.body->mass > 0.0; });
    if (!read_again_ || !states_bodies || robot.body_uncertainty > 0.0) return nullptr;
    if (robot.channels.unknown_drive_gains) return nullptr;  // each joint would have its own
    try {
      return ForceBalanceProblem(read_again_(data_.advance, kDoubt), options_, read_again_)
          .with_uncertain_model(fit);
    } catch (const InputError&) {
      return nullptr;  // the files have gone: what is known stands
    }
  }
  [[nodiscard]] std::vector<std::string> departures_from_stated(
      const ExtendedFit& fit) const override {
    return graybox::departures_from_stated(data_, fit.model_parameters);
  }

  [[nodiscard]] ScoreTable scores(const ExtendedFit& fit, std::span<const std::size_t> asked,
                                  int null_draws, std::uint64_t seed) const override {
    return balance_scores(fitter_, fit, asked, null_draws, seed, options_.threads);
  }

  [[nodiscard]] std::vector<MismatchCell> mismatch(const ExtendedFit& /*fit*/) const override {
    return {};  // cells are compared with the noise, which is not known
  }

  [[nodiscard]] std::optional<Assessment> validate(const ExtendedFit& fit) const override {
    if (data_.validation.empty()) return {};
    return fitter_.assess(data_.validation, residuals(fit, data_.validation));
  }

  [[nodiscard]] ExtendedFit fit_to_kept_out(const ExtendedFit& fit) const override {
    if (data_.validation.empty() || !determines_model(data_.validation)) return {};
    ForceBalanceData kept_out = data_;
    kept_out.estimation = data_.validation;
    const BalanceFitter fitter(kept_out, hypotheses_, options_.keep_going);
    return fitter.fit(starts_of(fit), nullptr);
  }

  [[nodiscard]] std::optional<double> remaining_structure(const ExtendedFit& fit) const override {
    return graybox::remaining_structure(data_.estimation, residuals(fit, data_.estimation));
  }

  [[nodiscard]] std::vector<LawTrend> trends(const ExtendedFit& fit) const override {
    std::vector<PlacedLaw> laws;
    for (const FittedLaw& law : fit.laws) laws.push_back(fitter_.placed_of(fit, law));
    return balance_trends(data_, laws, residuals(fit, data_.estimation));
  }

  [[nodiscard]] std::optional<double> autocorrelated_error(const ExtendedFit& fit) const override {
    return graybox::autocorrelated_error(fitter_, data_, fit);
  }

  [[nodiscard]] std::vector<ChannelRest> channel_rests(const ExtendedFit& fit) const override {
    return balance_rests(fitter_, data_, fit);
  }

  void find_late_channels(const ExtendedFit& fit,
                          std::vector<ChannelRest>& channels) const override {
    late_.find(fit, channels);
  }

  [[nodiscard]] std::unique_ptr<MismatchProblem> in_time(const ExtendedFit& fit) const override {
    if (!read_again_ || data_.validation.empty()) return nullptr;
    std::vector<ChannelRest> channels = channel_rests(fit);
    find_late_channels(fit, channels);
    Eigen::VectorXd each = Eigen::VectorXd::Zero(coordinates());
    for (Index j = 0; j < coordinates(); ++j) {
      const ChannelRest& rest = channels[static_cast<std::size_t>(j)];
      if (late_.is_worth_moving(rest) && late_.has_own_force(j)) each(j) = *rest.late_by;
    }
    const bool is_new = (each.array() != 0.0).any();
    if (!is_new && !late_.is_moved_too_little(fit)) return nullptr;
    std::unique_ptr<ForceBalanceProblem> moved = moved_by(each, fit);
    const std::optional<double> common = lateness_of_all(each, channels);
    if (!moved || !common) return moved;
    std::unique_ptr<ForceBalanceProblem> together = moved_by(all_by(*common), fit);
    return together &&
                   together->error_kept_out(starts_of(fit)) < moved->error_kept_out(starts_of(fit))
               ? std::move(together)
               : std::move(moved);
  }

  [[nodiscard]] std::vector<MovedChannel> moved_channels() const override {
    std::vector<MovedChannel> moved;
    for (Index j = 0; j < data_.advance.size(); ++j) {
      if (data_.advance(j) != 0.0) moved.push_back({channel_of(j), data_.advance(j)});
    }
    return moved;
  }

  [[nodiscard]] PhysicalContext physical_context(const ExtendedFit& fit) const override {
    PhysicalContext context;
    context.kinds = data_.parameter_kinds;
    context.bodies = fitted_bodies(data_, fit.model_parameters);
    for (const FittedLaw& law : fit.laws) {
      PhysicalContext::OfLaw& own = context.laws.emplace_back();
      const PlacedLaw placed_law = fitter_.placed_of(fit, law);
      if (!placed_law.place->location.is_flange) describe_physics(data_, placed_law, own);
    }
    return context;
  }

  [[nodiscard]] CheckedRange checked_range() const override {
    return graybox::checked_range(data_);
  }

  [[nodiscard]] std::optional<RivalExperiments> experiments_between(
      const ExtendedFit& a, const ExtendedFit& b) const override {
    return motions_.between(a, b);
  }

  [[nodiscard]] std::vector<ForcePicture> force_pictures(const ExtendedFit& fit) const override {
    const Eigen::MatrixXd rest = residuals(fit, data_.estimation);
    std::vector<ForcePicture> pictures;
    for (const FittedLaw& law : fit.laws) {
      if (hypotheses_.place(law.hypothesis).location.is_flange) {
        pictures.push_back({law.hypothesis, "", "", "", {}, {}, {}, {}});
      } else {
        pictures.push_back(force_picture(data_, law.hypothesis, fitter_.placed_of(fit, law), rest));
      }
    }
    return pictures;
  }

  [[nodiscard]] std::vector<ResidualCurve> residual_curves(const ExtendedFit& fit) const override {
    std::vector<ResidualCurve> curves;
    const auto add = [&](const ForceBalanceRows& rows, bool held_out) {
      add_curves(data_, rows, residuals(fit, rows), held_out, curves);
    };
    if (!data_.validation.empty()) add(data_.validation, true);
    add(data_.estimation, false);
    return curves;
  }

 private:
  [[nodiscard]] std::unique_ptr<ForceBalanceProblem> in_time_by(
      const Eigen::VectorXd& advance) const {
    if (advance.cwiseAbs().maxCoeff() > kLongestDelay) return nullptr;
    try {
      ForceBalanceData moved = read_again_(advance, 0.0);
      if (!data_.uncertain.empty()) {
        auto freed = with_uncertain_bodies(moved, data_.estimation.worth, data_.prior_gains);
        if (!freed) return nullptr;
        moved = *std::move(freed);
      }
      return std::make_unique<ForceBalanceProblem>(std::move(moved), options_, read_again_);
    } catch (const InputError&) {
      return nullptr;  // too few samples are left, or the files have gone: what is known stands
    }
  }
  [[nodiscard]] Eigen::VectorXd all_by(double seconds) const {
    Eigen::VectorXd advance = Eigen::VectorXd::Zero(coordinates());
    for (Index j = 0; j < coordinates(); ++j) {
      if (!is_idle(j) && late_.has_own_force(j)) advance(j) = seconds;
    }
    return advance;
  }
  // Root mean square over the channels, NRMSE in %.
  [[nodiscard]] double error_kept_out(const std::vector<LawStart>& laws) const {
    const ExtendedFit again = fit(laws, nullptr);
    if (!again.usable) return std::numeric_limits<double>::infinity();
    double squares = 0.0;
    for (const ChannelRest& rest : channel_rests(again)) {
      squares += std::pow(rest.held_out_nrmse.value_or(0.0), 2);
    }
    return std::sqrt(squares / static_cast<double>(coordinates()));
  }

  // By so much more than they are. With the same laws fitted again, until nothing of the lateness
  // is left.
  [[nodiscard]] std::unique_ptr<ForceBalanceProblem> moved_by(Eigen::VectorXd advance,
                                                              const ExtendedFit& fit) const {
    if (data_.advance.size() > 0) advance += data_.advance;
    const std::vector<LawStart> laws = starts_of(fit);
    std::unique_ptr<ForceBalanceProblem> moved = in_time_by(advance);
    for (int round = 0; moved && round < kLateRounds; ++round) {
      const ExtendedFit again = moved->fit(laws, nullptr);
      if (!again.usable || !moved->late_.is_moved_too_little(again)) break;
      advance += moved->late_.lateness_left(again);
      std::unique_ptr<ForceBalanceProblem> nearer = in_time_by(advance);
      if (!nearer) break;
      moved = std::move(nearer);
    }
    return moved;
  }

  [[nodiscard]] Eigen::MatrixXd residuals(const ExtendedFit& fit,
                                          const ForceBalanceRows& rows) const {
    return fitter_.residuals(fit, rows);
  }
  [[nodiscard]] std::string channel_of(Index coordinate) const {
    return data_.coordinates[static_cast<std::size_t>(coordinate)].channel();
  }
  [[nodiscard]] Index coordinates() const { return data_.estimation.coordinates(); }
  [[nodiscard]] bool is_idle(Index j) const { return data_.idle[static_cast<std::size_t>(j)]; }

  ForceBalanceData data_;
  ForceBalanceOptions options_;
  ReadAgain read_again_;
  BalanceHypotheses hypotheses_;
  BalanceFitter fitter_;
  LateChannels late_;
  RivalMotions motions_;
};

}  // namespace

std::unique_ptr<MismatchProblem> force_balance_problem(const std::filesystem::path& model,
                                                       const Campaign& campaign,
                                                       const ForceBalanceOptions& options) {
  const auto read = [robot = load_rigid_robot(model), campaign, places = options.place_files,
                     without = options.without_rotors](const Eigen::VectorXd& advance,
                                                       double body_uncertainty) {
    RigidRobotModel uncertain = robot;
    for (const std::size_t j : without) uncertain.joints.at(j).rotor_inertia = 0.0;
    if (body_uncertainty > 0.0) uncertain.body_uncertainty = body_uncertainty;
    return load_force_balance_data(uncertain, campaign, places, advance);
  };
  return std::make_unique<ForceBalanceProblem>(read({}, 0.0), options, read);
}

namespace {

// A constant is foretold by a friction or an offset of its size, whatever moves.
void require_changing_drive(const ForceBalanceData& data, const Campaign& campaign) {
  constexpr double kConstant = 0.02;  // of its rms
  const Eigen::MatrixXd& force = data.estimation.measured;
  const Eigen::MatrixXd about_mean = force.rowwise() - force.colwise().mean();
  const double mean = force.mean();
  if (!(about_mean.norm() < kConstant * force.norm())) return;
  throw InputError(fmt::format(
      "{}: the drive is about {:.3g} throughout, and a balance of forces would foretell that by a "
      "friction: say --method prediction_error, or record a drive that changes",
      campaign.file.string(), mean));
}

}  // namespace

std::unique_ptr<MismatchProblem> drive_balance_problem(const RigidRobotModel& drive,
                                                       const Campaign& campaign,
                                                       const ForceBalanceOptions& options) {
  Campaign smooth = campaign;
  const std::optional<LowPass> low_pass = missing_low_pass(drive, campaign);
  if (low_pass) smooth.preprocess.emplace_back(*low_pass);
  const auto read = [drive, smooth, low_pass](const Eigen::VectorXd& advance, double /*one body*/) {
    ForceBalanceData data = load_force_balance_data(drive, smooth, {}, advance);
    if (low_pass) {
      data.remarks.push_back(
          fmt::format("All channels went through a low-pass at {:.4g} Hz: above it the noise of "
                      "the {} hides the "
                      "acceleration (preprocess: low_pass, frequency: {:.4g})",
                      low_pass->frequency,
                      drive.channels.velocity.empty() ? "positions, differentiated twice,"
                                                      : "velocities, differentiated,",
                      low_pass->frequency));
    }
    name_as_lumped(data);
    return data;
  };
  ForceBalanceData data = read({}, 0.0);
  require_changing_drive(data, campaign);
  return std::make_unique<ForceBalanceProblem>(std::move(data), options, read);
}

}  // namespace graybox
