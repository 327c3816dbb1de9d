#include "diagnosis/force_balance/force_balance_mismatch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "diagnosis/force_balance/balance_fitter.hpp"
#include "diagnosis/force_balance/balance_hypotheses.hpp"
#include "diagnosis/force_balance/balance_pictures.hpp"
#include "diagnosis/force_balance/balance_regression.hpp"
#include "diagnosis/force_balance/balance_scores.hpp"
#include "diagnosis/force_balance/balance_trends.hpp"
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

constexpr double kLateStep = 0.2;  // of a lateness, by which a force is moved on
constexpr int kLateRounds = 3;
constexpr double kTurning = 0.02;  // of a joint's speed, below which it turns round

// Share of a coordinate's rest that follows from its own past. The low-pass that the forces went
// through gives any noise a past of half its period; so samples so far apart are asked.
double own_past(const ForceBalanceRows& rows, const Eigen::VectorXd& rest) {
  const Motion& piece = rows.pieces.front();
  Index stride = 1;
  for (const FilterPass& filter : piece.filters) {
    const auto most = static_cast<double>(piece.samples());
    const double apart = std::min(0.5 / (filter.frequency * piece.sample_time()), most);
    stride = std::max(stride, static_cast<Index>(apart + 1e-6));
  }
  return 1.0 - ColouredNoise(rest(Eigen::seq(Index{0}, Eigen::last, stride))).innovation_share();
}

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

bool is_told(const LatenessFit& lateness) {
  return std::abs(lateness.seconds) < kLongestDelay && lateness.share > kLeastShare &&
         lateness.share_held_out > kLeastShare;
}

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
    std::optional<ForceBalanceData> freed = with_uncertain_bodies(data_, effective / counted);
    if (!freed) return nullptr;
    return std::make_unique<ForceBalanceProblem>(*std::move(freed), options_, read_again_);
  }
  [[nodiscard]] std::unique_ptr<MismatchProblem> with_doubted_model(
      const ExtendedFit& fit) const override {
    const RigidRobotModel& robot = data_.robot;
    const bool states_bodies = std::ranges::any_of(
        robot.joints, [](const RobotJoint& joint) { return joint.body && joint.body->mass > 0.0; });
    if (!read_again_ || !states_bodies || robot.body_uncertainty > 0.0) return nullptr;
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
    const ForceBalanceRows& rows = data_.estimation;
    const Eigen::MatrixXd rest = residuals(fit, rows);
    double square = 0.0;
    for (Index j = 0; j < coordinates(); ++j) {
      square += own_past(rows, rest.col(j)) * rest.col(j).squaredNorm();
    }
    return 100.0 * std::sqrt(square / centred_square(rows.measured));
  }

  [[nodiscard]] std::vector<ChannelRest> channel_rests(const ExtendedFit& fit) const override {
    const ForceBalanceRows& rows = data_.estimation;
    const Eigen::MatrixXd rest = residuals(fit, rows), unseen = unpredicted(rows, rest);
    std::vector<ChannelRest> channels;
    for (Index j = 0; j < coordinates(); ++j) {
      const double left = rest.col(j).squaredNorm(), signal = centred_square(rows.measured.col(j));
      ChannelRest& channel = channels.emplace_back();
      channel.channel = channel_of(j);
      if (!(left > 0.0) || !(signal > 0.0)) continue;
      channel.nrmse = 100.0 * std::sqrt(left / signal);
      channel.structure = std::max(0.0, 1.0 - unseen.col(j).squaredNorm() / left);
      channel.autocorrelated_error = 100.0 * std::sqrt(own_past(rows, rest.col(j)) * left / signal);
    }
    add_held_out_errors(fit, channels);
    return channels;
  }

  void find_late_channels(const ExtendedFit& fit,
                          std::vector<ChannelRest>& channels) const override {
    if (data_.validation.empty()) return;
    const Eigen::MatrixXd rest = residuals(fit, data_.estimation),
                          held_out = residuals(fit, data_.validation);
    for (Index j = 0; j < coordinates(); ++j) {
      if (is_idle(j)) continue;
      auto late = late_force(data_.estimation, rest, data_.validation, held_out, j);
      const LatenessFit beside = lateness_beside(fit, rest, held_out, j);
      if (is_told(beside) && (!late || beside.nrmse_held_out < late->nrmse_held_out)) {
        late = {beside.seconds, beside.nrmse_held_out};
      }
      if (!late) continue;
      const LateForce whole = with_laws_refitted(fit, j, *late);
      channels[static_cast<std::size_t>(j)].late_by = whole.seconds;
      channels[static_cast<std::size_t>(j)].held_out_nrmse_in_time = whole.nrmse_held_out;
    }
  }

  [[nodiscard]] std::unique_ptr<MismatchProblem> in_time(const ExtendedFit& fit) const override {
    if (!read_again_ || data_.validation.empty()) return nullptr;
    std::vector<ChannelRest> channels = channel_rests(fit);
    find_late_channels(fit, channels);
    Eigen::VectorXd each = Eigen::VectorXd::Zero(coordinates());
    for (Index j = 0; j < coordinates(); ++j) {
      const ChannelRest& rest = channels[static_cast<std::size_t>(j)];
      if (is_worth_moving(rest) && has_own_force(j)) each(j) = *rest.late_by;
    }
    const bool is_new = (each.array() != 0.0).any();
    if (!is_new && !is_moved_too_little(fit)) return nullptr;
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
  [[nodiscard]] bool is_worth_moving(const ChannelRest& rest) const {
    if (!rest.late_by || !rest.held_out_nrmse || !rest.held_out_nrmse_in_time) return false;
    const double sample_time = data_.recorded.front().sample_time();
    if (std::abs(*rest.late_by) < kShortestMove * sample_time) return false;
    const double ratio = *rest.held_out_nrmse_in_time / *rest.held_out_nrmse;
    return ratio * ratio <= 1.0 - kWorthMoving;
  }
  // Columns of the model, of the laws found and of plain friction that act on a coordinate.
  [[nodiscard]] Eigen::MatrixXd columns_on(Index coordinate, const ExtendedFit& fit,
                                           const ForceBalanceRows& rows) const {
    const auto at = static_cast<std::size_t>(coordinate);
    Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(rows.samples(), 0);
    if (rows.model.in[at].size() > 0) append_columns(rows.model.in[at], columns);
    for (const FittedLaw& law : fit.laws) {
      const BalanceColumns own = law_columns(fitter_.placed_of(fit, law), data_, rows);
      if (own.in[at].size() > 0) append_columns(own.in[at], columns);
    }
    append_plain_friction(coordinate, rows, columns);
    return columns;
  }
  void append_plain_friction(Index coordinate, const ForceBalanceRows& rows,
                             Eigen::MatrixXd& columns) const {
    const Eigen::VectorXd own = Eigen::VectorXd::Unit(coordinates(), coordinate);
    const auto place = std::ranges::find_if(data_.places, [&](const CandidatePlace& each) {
      return each.location.input.size() == own.size() && each.location.input == own &&
             each.location.output == own;
    });
    if (place == data_.places.end()) return;
    double square = 0.0;
    for (const Motion& piece : data_.estimation.pieces) {
      square += piece.velocity.col(coordinate).squaredNorm();
    }
    const double speed = std::sqrt(square / static_cast<double>(data_.estimation.samples()));
    if (!(speed > 0.0)) return;
    append_columns(law_samples(*place, *find_law("viscous", false)->make(std::vector{1.0}), rows),
                   columns);
    append_columns(
        law_samples(*place, *find_law("coulomb", false)->make(std::vector{1.0, kTurning * speed}),
                    rows),
        columns);
  }
  [[nodiscard]] LatenessFit lateness_beside(const ExtendedFit& fit, const Eigen::MatrixXd& rest,
                                            const Eigen::MatrixXd& held_out,
                                            Index coordinate) const {
    return fit_lateness(
        {data_.estimation, rest.col(coordinate), columns_on(coordinate, fit, data_.estimation)},
        {data_.validation, held_out.col(coordinate), columns_on(coordinate, fit, data_.validation)},
        coordinate);
  }
  // What is left of the lateness of each joint that was moved.
  [[nodiscard]] Eigen::VectorXd lateness_left(const ExtendedFit& fit) const {
    Eigen::VectorXd left = Eigen::VectorXd::Zero(coordinates());
    const Eigen::MatrixXd rest = residuals(fit, data_.estimation),
                          held_out = residuals(fit, data_.validation);
    for (Index j = 0; j < data_.advance.size(); ++j) {
      if (data_.advance(j) != 0.0) left(j) = lateness_beside(fit, rest, held_out, j).seconds;
    }
    return left;
  }
  [[nodiscard]] bool is_moved_too_little(const ExtendedFit& fit) const {
    if (data_.advance.size() == 0) return false;
    const Eigen::ArrayXd left = lateness_left(fit).cwiseAbs();
    return (left > kLateStep * kLateStep * data_.advance.array().abs()).any();
  }

  [[nodiscard]] std::unique_ptr<ForceBalanceProblem> in_time_by(
      const Eigen::VectorXd& advance) const {
    if (advance.cwiseAbs().maxCoeff() > kLongestDelay) return nullptr;
    try {
      ForceBalanceData moved = read_again_(advance, 0.0);
      if (!data_.uncertain.empty()) {
        auto freed = with_uncertain_bodies(moved, data_.estimation.worth);
        if (!freed) return nullptr;
        moved = *std::move(freed);
      }
      return std::make_unique<ForceBalanceProblem>(std::move(moved), options_, read_again_);
    } catch (const InputError&) {
      return nullptr;  // too few samples are left, or the files have gone: what is known stands
    }
  }
  // Where several joints are moved one way, one clock for all positions, or all forces, may be
  // late. The median of all that come late or early at all.
  [[nodiscard]] static std::optional<double> lateness_of_all(
      const Eigen::VectorXd& each, const std::vector<ChannelRest>& channels) {
    const auto late = (each.array() > 0.0).count(), early = (each.array() < 0.0).count();
    if (late + early < 2 || (late > 0 && early > 0)) return {};
    std::vector<double> times;
    for (const ChannelRest& rest : channels) {
      if (rest.late_by) times.push_back(*rest.late_by);
    }
    const auto middle = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2);
    std::ranges::nth_element(times, middle);
    return *middle;
  }
  [[nodiscard]] Eigen::VectorXd all_by(double seconds) const {
    Eigen::VectorXd advance = Eigen::VectorXd::Zero(coordinates());
    for (Index j = 0; j < coordinates(); ++j) {
      if (!is_idle(j) && has_own_force(j)) advance(j) = seconds;
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
      if (!again.usable || !moved->is_moved_too_little(again)) break;
      advance += moved->lateness_left(again);
      std::unique_ptr<ForceBalanceProblem> nearer = in_time_by(advance);
      if (!nearer) break;
      moved = std::move(nearer);
    }
    return moved;
  }

  // Not that of motors which move other joints, too.
  [[nodiscard]] bool has_own_force(Index coordinate) const {
    if (!data_.robot.channels.motor_torque) return true;
    const auto column = data_.robot.transmission.col(coordinate).array();
    return (column != 0.0).count() == 1;
  }

  // Laws fitted to a late force take part of its lateness. So the force is moved on, and the same
  // laws are fitted again, as long as that lowers what they leave.
  [[nodiscard]] LateForce with_laws_refitted(const ExtendedFit& fit, Index coordinate,
                                             LateForce late) const {
    const std::vector<LawStart> laws = starts_of(fit);
    const double step = std::copysign(
        std::max(data_.estimation.pieces.front().sample_time(), kLateStep * std::abs(late.seconds)),
        late.seconds);
    double least = std::numeric_limits<double>::infinity();
    for (double seconds = late.seconds; std::abs(seconds) < kLongestDelay; seconds += step) {
      const auto left = left_with_force_moved(laws, coordinate, seconds);
      if (!left || left->estimation >= least) break;
      least = left->estimation;
      if (left->held_out < late.nrmse_held_out) late = {seconds, left->held_out};
    }
    return late;
  }
  // NRMSE of one coordinate, %; none where the laws can't be fitted.
  struct MovedRest {
    double estimation = 0.0, held_out = 0.0;
  };
  [[nodiscard]] std::optional<MovedRest> left_with_force_moved(std::span<const LawStart> laws,
                                                               Index coordinate,
                                                               double seconds) const {
    ForceBalanceData moved = data_;
    for (ForceBalanceRows* rows : {&moved.estimation, &moved.validation}) {
      advance_force(*rows, coordinate, seconds);
      rows->laws = std::make_shared<LawSampleCache>(rows->samples());
    }
    const ForceBalanceProblem in_time(std::move(moved), options_);
    const ExtendedFit fit = in_time.fit(laws, nullptr);
    if (!fit.usable) return {};
    const auto nrmse = [&](const ForceBalanceRows& rows) {
      const double square = in_time.residuals(fit, rows).col(coordinate).squaredNorm();
      return 100.0 * std::sqrt(square / centred_square(rows.measured.col(coordinate)));
    };
    return MovedRest{nrmse(in_time.data_.estimation), nrmse(in_time.data_.validation)};
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

  // Standard deviation of what was measured where it counts.
  [[nodiscard]] static double signal_of(const ForceBalanceRows& rows, Index coordinate) {
    return std::sqrt(centred_square(rows.measured.col(coordinate)) / rows.counted(coordinate));
  }

  void add_held_out_errors(const ExtendedFit& fit, std::vector<ChannelRest>& channels) const {
    if (data_.validation.empty()) return;
    const Eigen::MatrixXd rest = residuals(fit, data_.validation);
    for (Index j = 0; j < coordinates(); ++j) {
      const double signal = centred_square(data_.validation.measured.col(j));
      if (!(signal > 0.0)) continue;
      ChannelRest& channel = channels[static_cast<std::size_t>(j)];
      channel.held_out_nrmse = 100.0 * std::sqrt(rest.col(j).squaredNorm() / signal);
      channel.held_out_level = std::sqrt(data_.validation.measured.col(j).squaredNorm() / signal);
      channel.held_out_signal = signal_of(data_.validation, j) / signal_of(data_.estimation, j);
    }
  }

  ForceBalanceData data_;
  ForceBalanceOptions options_;
  ReadAgain read_again_;
  BalanceHypotheses hypotheses_;
  BalanceFitter fitter_;
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
  return std::make_unique<ForceBalanceProblem>(read({}, 0.0), options, read);
}

}  // namespace graybox
