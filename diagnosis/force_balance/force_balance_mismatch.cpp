#include "diagnosis/force_balance/force_balance_mismatch.hpp"

#include <fmt/format.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <memory>
#include <string_view>
#include <utility>

#include "diagnosis/estimation/recording_spread.hpp"
#include "diagnosis/force_balance/balance_regression.hpp"
#include "diagnosis/force_balance/remaining_structure.hpp"
#include "diagnosis/force_balance/shape_refinement.hpp"
#include "diagnosis/force_balance_data/derivative_noise.hpp"
#include "diagnosis/force_balance_data/force_balance_data.hpp"
#include "diagnosis/force_balance_data/force_balance_laws.hpp"
#include "diagnosis/force_balance_data/late_forces.hpp"
#include "diagnosis/force_balance_data/payload_tangent.hpp"
#include "diagnosis/force_balance_data/uncertain_bodies.hpp"
#include "diagnosis/hypotheses/physical_evidence.hpp"
#include "diagnosis/inverse_dynamics/weighted_regression.hpp"
#include "diagnosis/signals/coloured_noise.hpp"
#include "diagnosis/signals/long_run_variance.hpp"
#include "diagnosis/wiring/wiring_faults.hpp"
#include "problems/base/error.hpp"
#include "problems/base/random.hpp"
#include "problems/base/stop.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
constexpr Index kShownCurves = 6;  // of the recordings of one role
constexpr int kGainRounds = 16;    // of fits that take the drives' gains from one another
constexpr double kGainTolerance = 1e-4;
constexpr int kNoiseRounds = 4;    // of refinements of shapes
constexpr double kLateStep = 0.2;  // of a lateness, by which a force is moved on
constexpr int kLateRounds = 3;
constexpr double kTurning = 0.02;  // of a joint's speed, below which it turns round
// Largest ratio of a coordinate's noise to that before: of shapes in general, and of a payload's
// place, which hangs on it.
constexpr double kSettledNoise = 1.5;
constexpr double kSettledPlace = 1.1;

// Columns of several terms over `noise`: coordinate after coordinate.
Eigen::MatrixXd stacked(const BalanceColumns& columns, const Eigen::VectorXd& noise,
                        Index samples) {
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(samples * noise.size(), columns.count);
  for (Index j = 0; j < noise.size(); ++j) {
    const Eigen::MatrixXd& own = columns.in[static_cast<std::size_t>(j)];
    if (own.size() > 0) result.middleRows(j * samples, samples) = own / noise(j);
  }
  return result;
}

void append(const Eigen::MatrixXd& more, Eigen::MatrixXd& columns) {
  const Index first = columns.cols();
  columns.conservativeResize(more.rows(), first + more.cols());
  columns.rightCols(more.cols()) = more;
}

double centred_square(const Eigen::MatrixXd& values) {
  return (values.rowwise() - values.colwise().mean()).squaredNorm();
}

// Root mean squares by coordinate, of the samples that count.
Eigen::VectorXd rms_of(const ForceBalanceRows& rows, const Eigen::MatrixXd& residuals) {
  const Eigen::VectorXd rms = rows.root_mean_squares(residuals);
  return rms.cwiseMax(1e-12 * std::max(rms.maxCoeff(), 1e-300));
}

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

// A parameter of a law or of the model, as one column of the information about all.
struct Column {
  std::size_t law = 0, parameter = 0;
};

// Every joint has friction; then come loads; then what may stand in for a load, offsets and coupled
// joints.
int rank_of(std::string_view law, const CandidatePlace& place) {
  const bool is_friction = law == "viscous" || law == "coulomb";
  if (is_friction) return place.is_compound ? 2 : 0;
  if (law == "payload" || law == "inertia" || law == "gravity") return 1;
  return law == "offset" ? 2 : kRareRank;
}

// None for a payload, which all joints carry.
std::vector<std::size_t> coordinates_of(const CandidatePlace& place) {
  std::vector<std::size_t> coordinates;
  for (Index j = 0; j < place.location.output.size(); ++j) {
    if (place.location.output(j) != 0.0) coordinates.push_back(static_cast<std::size_t>(j));
  }
  return coordinates;
}

// The recordings once more, with the forces of each joint moved by so many seconds.
using ReadInTime = std::function<ForceBalanceData(const Eigen::VectorXd& advance)>;

class ForceBalanceProblem : public MismatchProblem, public PhysicalEvidence {
 public:
  ForceBalanceProblem(ForceBalanceData data, ForceBalanceOptions options,
                      ReadInTime read_in_time = {})
      : data_(std::move(data)),
        options_(std::move(options)),
        read_in_time_(std::move(read_in_time)),
        regression_(data_.estimation) {
    const BalanceFit first = regression_.fit({});
    first_inverse_gains_ = Eigen::VectorXd::Zero(static_cast<Index>(data_.gain_parameters.size()));
    for (Index j = 0; j < first_inverse_gains_.size(); ++j) {
      const Index parameter = data_.gain_parameters[static_cast<std::size_t>(j)];
      if (parameter >= 0) first_inverse_gains_(j) = first.model(parameter);
    }
    const Eigen::MatrixXd rest = unpredicted(data_.estimation, first.residuals);
    for (Index j = 0; j < coordinates(); ++j) {
      noises_.emplace_back(rest.col(j));
      const double moving =
          data_.estimation.counted(j) / static_cast<double>(data_.estimation.samples());
      effective_.push_back(is_idle(j) ? 0.0 : moving * noises_.back().effective_samples());
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
  [[nodiscard]] std::vector<ChannelFault> channel_faults() const override {
    return find_wiring_faults(data_.robot, data_.recorded, options_.keep_going);
  }

  [[nodiscard]] std::vector<std::string> remarks() const override { return data_.remarks; }

  [[nodiscard]] ExtendedFit fit(std::span<const LawStart> starts,
                                const ExtendedFit* nearby) const override {
    std::vector<RefinedLaw> refined;
    const Eigen::VectorXd gains =
        nearby != nullptr && nearby->usable ? inverse_gains(*nearby) : first_inverse_gains_;
    for (const LawStart& start : starts) {
      refined.push_back({placed(start.hypothesis, start.parameters, gains),
                         !is_fitted(start, nearby), &scales_[place_of_[start.hypothesis]], false});
    }
    hold_untouched(starts, nearby, refined);
    const std::vector<RefinedLaw> given = refined;
    ExtendedFit result = fit_refined(starts, refined, noise_of(nearby));
    settle_gains(starts, refined, result);
    // Without one of their number, laws that are known may leave their ranges; as they are they
    // remain.
    const bool is_stopped = options_.keep_going && !options_.keep_going();
    if (!result.usable && !is_stopped && std::ranges::none_of(given, &RefinedLaw::is_new)) {
      const FitBalance balance = balance_of(given);
      ExtendedFit held = described(starts, with_amplitudes(balance, given));
      if (held.usable) return held;
    }
    return result;
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
    return std::make_unique<ForceBalanceProblem>(*std::move(freed), options_, read_in_time_);
  }
  [[nodiscard]] std::vector<std::string> departures_from_stated(
      const ExtendedFit& fit) const override {
    return graybox::departures_from_stated(data_, fit.model_parameters);
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
      channel.channel = channel_name(j);
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
    if (!read_in_time_ || data_.validation.empty()) return nullptr;
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
      if (data_.advance(j) != 0.0) moved.push_back({channel_name(j), data_.advance(j)});
    }
    return moved;
  }

  [[nodiscard]] PhysicalContext physical_context(const ExtendedFit& fit) const override {
    PhysicalContext context;
    context.kinds = data_.parameter_kinds;
    context.bodies = fitted_bodies(data_, fit.model_parameters);
    for (const FittedLaw& law : fit.laws) {
      PhysicalContext::OfLaw& own = context.laws.emplace_back();
      const PlacedLaw placed_law = placed_of(fit, law);
      if (!placed_law.place->location.is_flange) describe_physics(placed_law, own);
    }
    return context;
  }

  [[nodiscard]] CheckedRange checked_range() const override {
    CheckedRange range;
    range.kept_out = !data_.validation.empty();
    const ForceBalanceRows& rows = range.kept_out ? data_.validation : data_.estimation;
    for (const std::string& name : rows.names) {
      if (std::ranges::find(range.files, name) == range.files.end()) range.files.push_back(name);
    }
    for (Index j = 0; j < coordinates(); ++j) add_spans(rows, j, range);
    return range;
  }

  [[nodiscard]] std::vector<ForcePicture> force_pictures(const ExtendedFit& fit) const override {
    std::vector<ForcePicture> pictures;
    for (const FittedLaw& law : fit.laws) {
      if (data_.places[place_of_[law.hypothesis]].location.is_flange) {
        pictures.push_back({law.hypothesis, "", "", "", {}, {}, {}, {}});
      } else {
        pictures.push_back(picture(fit, law));
      }
    }
    return pictures;
  }

  [[nodiscard]] std::vector<ResidualCurve> residual_curves(const ExtendedFit& fit) const override {
    std::vector<ResidualCurve> curves;
    if (!data_.validation.empty()) add_curves(fit, data_.validation, true, curves);
    add_curves(fit, data_.estimation, false, curves);
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
    if (rows.model.in[at].size() > 0) append(rows.model.in[at], columns);
    for (const FittedLaw& law : fit.laws) {
      const BalanceColumns own = law_columns(placed_of(fit, law), data_, rows);
      if (own.in[at].size() > 0) append(own.in[at], columns);
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
    append(law_samples(*place, *find_law("viscous", false)->make(std::vector{1.0}), rows), columns);
    append(law_samples(*place,
                       *find_law("coulomb", false)->make(std::vector{1.0, kTurning * speed}), rows),
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
  [[nodiscard]] static bool is_told(const LatenessFit& lateness) {
    return std::abs(lateness.seconds) < kLongestDelay && lateness.share > kLeastShare &&
           lateness.share_held_out > kLeastShare;
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
      ForceBalanceData moved = read_in_time_(advance);
      if (!data_.uncertain.empty()) {
        auto freed = with_uncertain_bodies(moved, data_.estimation.worth);
        if (!freed) return nullptr;
        moved = *std::move(freed);
      }
      return std::make_unique<ForceBalanceProblem>(std::move(moved), options_, read_in_time_);
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

  [[nodiscard]] Index coordinates() const { return data_.estimation.coordinates(); }
  [[nodiscard]] bool is_idle(Index j) const { return data_.idle[static_cast<std::size_t>(j)]; }

  void add_held_out_errors(const ExtendedFit& fit, std::vector<ChannelRest>& channels) const {
    if (data_.validation.empty()) return;
    const Eigen::MatrixXd rest = residuals(fit, data_.validation);
    for (Index j = 0; j < coordinates(); ++j) {
      const double signal = centred_square(data_.validation.measured.col(j));
      if (!(signal > 0.0)) continue;
      channels[static_cast<std::size_t>(j)].held_out_nrmse =
          100.0 * std::sqrt(rest.col(j).squaredNorm() / signal);
    }
  }

  [[nodiscard]] bool acts_on(std::size_t hypothesis, const std::vector<bool>& coordinates) const {
    const std::vector<std::size_t>& own = hypotheses_[hypothesis].acts_on;
    return std::ranges::any_of(own, [&](std::size_t j) { return coordinates[j]; });
  }
  // A law that is added, left out or exchanged leaves the shapes of laws on other coordinates as
  // they are: these share no more than the bodies' parameters, and nothing where every drive has a
  // gain of its own. There the place of a payload is held, too, for which the gains would have to
  // settle every time.
  void hold_untouched(std::span<const LawStart> starts, const ExtendedFit* nearby,
                      std::vector<RefinedLaw>& laws) const {
    if (nearby == nullptr) return;
    std::vector<bool> touched(static_cast<std::size_t>(coordinates()), false);
    bool is_any = false;
    const auto touch = [&](std::size_t hypothesis) {
      for (std::size_t j = 0; j < touched.size(); ++j) {
        const std::vector<std::size_t>& own = hypotheses_[hypothesis].acts_on;
        touched[j] = touched[j] || own.empty() || std::ranges::find(own, j) != own.end();
      }
      is_any = true;
    };
    for (std::size_t l = 0; l < laws.size(); ++l) {
      if (laws[l].is_new) touch(starts[l].hypothesis);
    }
    for (const FittedLaw& law : nearby->laws) {
      if (std::ranges::find(starts, law.hypothesis, &LawStart::hypothesis) == starts.end()) {
        touch(law.hypothesis);
      }
    }
    for (std::size_t l = 0; is_any && l < laws.size(); ++l) {
      const bool is_free_payload = hypotheses_[starts[l].hypothesis].acts_on.empty() &&
                                   !data_.robot.channels.unknown_drive_gains;
      laws[l].is_held =
          !laws[l].is_new && !is_free_payload && !acts_on(starts[l].hypothesis, touched);
    }
  }

  // Laws of given shapes, their amplitudes fitted where the data tell these apart.
  struct AmplitudeFit {
    std::vector<PlacedLaw> laws;
    std::vector<BalanceColumns> columns;
    BalanceFit fitted;
    std::vector<double> inverse_gains;  // as ExtendedFit's
  };

  // What a fit leaves of each coordinate, root mean square.
  [[nodiscard]] Eigen::VectorXd noise_of(const ExtendedFit* fit) const {
    if (fit == nullptr || !fit->usable) return regression_.noise();
    return rms_of(data_.estimation, residuals(*fit, data_.estimation));
  }

  // Shapes and the noise that weighs the coordinates, in turn: a law that explains most of what one
  // coordinate measures gives it a weight under which laws of several coordinates are others.
  [[nodiscard]] ExtendedFit fit_refined(std::span<const LawStart> starts,
                                        std::vector<RefinedLaw>& refined,
                                        Eigen::VectorXd noise) const {
    const FitBalance balance = balance_of(refined);
    const BalanceRegression& regression = balance.regression();
    for (int round = 1;; ++round) {
      const BalanceProjection projection(regression, noise);
      if (!refine_shapes(data_, projection, refined, options_.keep_going)) {
        ExtendedFit result;
        result.trouble = "the laws' shapes could not be refined";
        return result;
      }
      const AmplitudeFit fit = with_amplitudes(balance, refined);
      const bool has_shapes = std::ranges::any_of(refined, [](const RefinedLaw& law) {
        return !law.is_held && !law.law.refined().empty();
      });
      if (!fit.fitted.full_rank || !has_shapes || coordinates() == 1 || round == kNoiseRounds) {
        return described(starts, fit);
      }
      const std::vector<BalanceColumns> places = payload_slopes(refined, fit);
      const Eigen::VectorXd next =
          places.empty() ? fit.fitted.noise : noise_beside(regression, fit, places);
      if (is_settled(noise, next, places.empty() ? kSettledNoise : kSettledPlace)) {
        return described(starts, fit);
      }
      noise = next;
      for (std::size_t l = 0; l < refined.size(); ++l) {
        refined[l].law = fit.laws[l];
        refined[l].is_new = false;
      }
    }
  }

  // A payload's place decides which coordinates it suits. With its slopes beside its mass the noise
  // is that of the best place, as far as this is near.
  [[nodiscard]] std::vector<BalanceColumns> payload_slopes(const std::vector<RefinedLaw>& refined,
                                                           const AmplitudeFit& fit) const {
    std::vector<BalanceColumns> slopes;
    for (std::size_t l = 0; l < refined.size(); ++l) {
      const PlacedLaw& law = fit.laws[l];
      if (refined[l].is_held || law.entry->use != LawUse::kPayload) continue;
      slopes.push_back(law_slopes(law, law.refined(), data_, data_.estimation));
    }
    return slopes;
  }
  [[nodiscard]] static Eigen::VectorXd noise_beside(const BalanceRegression& regression,
                                                    const AmplitudeFit& fit,
                                                    const std::vector<BalanceColumns>& more) {
    std::vector<BalanceColumns> columns = fit.columns;
    columns.insert(columns.end(), more.begin(), more.end());
    const BalanceFit beside = regression.fit(columns);
    return beside.full_rank ? beside.noise : fit.fitted.noise;
  }

  [[nodiscard]] bool is_settled(const Eigen::VectorXd& noise, const Eigen::VectorXd& next,
                                double largest_ratio) const {
    for (Index j = 0; j < coordinates(); ++j) {
      const double change = std::abs(std::log(next(j) / noise(j)));
      if (!is_idle(j) && change > std::log(largest_ratio)) return false;
    }
    return true;
  }

  [[nodiscard]] Eigen::VectorXd inverse_gains(const ExtendedFit& fit) const {
    Eigen::VectorXd gains = Eigen::VectorXd::Zero(static_cast<Index>(data_.gain_parameters.size()));
    for (Index j = 0; j < gains.size(); ++j) {
      const Index parameter = data_.gain_parameters[static_cast<std::size_t>(j)];
      if (parameter >= 0) {
        gains(j) = fit.model_parameters[static_cast<std::size_t>(parameter)].value;
      } else if (!fit.inverse_gains.empty()) {
        gains(j) = fit.inverse_gains[static_cast<std::size_t>(j)];
      }
    }
    return gains;
  }
  // Where gains are unknown a payload's force is over them: fits about the payload and the gains
  // that were found, until these stay. `result`: of the first of these fits.
  void settle_gains(std::span<const LawStart> starts, std::vector<RefinedLaw>& laws,
                    ExtendedFit& result) const {
    const bool is_asked = std::ranges::any_of(laws, [](const RefinedLaw& law) {
      return !law.is_held && law.law.inverse_gains.size() > 0;
    });
    for (int round = 1; is_asked && result.usable && round < kGainRounds; ++round) {
      bool is_settled = true;
      for (std::size_t l = 0; l < laws.size(); ++l) {
        const PlacedLaw used = std::exchange(laws[l].law, placed_of(result, result.laws[l]));
        is_settled = is_settled && (used.inverse_gains.size() == 0 ||
                                    (!laws[l].is_new && are_same_payload(used, laws[l].law)));
        laws[l].is_new = false;
      }
      if (is_settled) return;
      result = fit_refined(starts, laws, noise_of(&result));
    }
  }
  static bool are_same_payload(const PlacedLaw& one, const PlacedLaw& other) {
    const Eigen::VectorXd gains = one.inverse_gains - other.inverse_gains;
    const Eigen::Map<const Eigen::Vector4d> body(one.parameters.data());
    const Eigen::Map<const Eigen::Vector4d> other_body(other.parameters.data());
    return gains.lpNorm<Eigen::Infinity>() <=
               kGainTolerance * one.inverse_gains.lpNorm<Eigen::Infinity>() &&
           (body - other_body).norm() <= kGainTolerance * body.norm();
  }

  // The regression of one fit: that of the recordings, or about the payload that it begins with,
  // where its force is over unknown gains.
  class FitBalance {
   public:
    explicit FitBalance(const BalanceRegression& recorded) : regression_(&recorded) {}
    FitBalance(PayloadTangent tangent, const Eigen::VectorXd& noise)
        : tangent_(std::make_unique<PayloadTangent>(std::move(tangent))),
          own_(std::make_unique<BalanceRegression>(tangent_->rows, noise)),
          regression_(own_.get()) {}
    [[nodiscard]] const BalanceRegression& regression() const { return *regression_; }
    // Takes the gains that only the payload tells from the model's parameters.
    void part_gains(AmplitudeFit& fit) const {
      if (!tangent_ || tangent_->loaded.empty() || !fit.fitted.full_rank) return;
      const auto count = static_cast<Index>(tangent_->loaded.size());
      const Index model = fit.fitted.model.size() - count;
      fit.inverse_gains.assign(static_cast<std::size_t>(tangent_->rows.coordinates()), 0.0);
      for (Index k = 0; k < count; ++k) {
        const auto joint = static_cast<std::size_t>(tangent_->loaded[static_cast<std::size_t>(k)]);
        fit.inverse_gains[joint] = fit.fitted.model(model + k);
      }
      fit.fitted.model.conservativeResize(model);
    }

   private:
    std::unique_ptr<PayloadTangent> tangent_;
    std::unique_ptr<BalanceRegression> own_;
    const BalanceRegression* regression_;
  };
  [[nodiscard]] FitBalance balance_of(std::span<const RefinedLaw> laws) const {
    std::vector<PlacedLaw> payloads;
    for (const RefinedLaw& law : laws) {
      if (!law.is_new && law.law.inverse_gains.size() > 0) payloads.push_back(law.law);
    }
    if (payloads.empty()) return FitBalance(regression_);
    return {about_payloads(data_, payloads), regression_.noise()};
  }

  [[nodiscard]] AmplitudeFit with_amplitudes(const FitBalance& balance,
                                             std::span<const RefinedLaw> refined) const {
    AmplitudeFit result;
    for (const RefinedLaw& law : refined) {
      result.laws.push_back(law.law);
      result.columns.push_back(law_columns(law.law, data_, data_.estimation));
    }
    result.fitted = balance.regression().fit(result.columns);
    if (result.fitted.full_rank) set_amplitudes(result.laws, result.fitted.amplitudes);
    balance.part_gains(result);
    return result;
  }

  [[nodiscard]] ExtendedFit described(std::span<const LawStart> starts,
                                      const AmplitudeFit& fit) const {
    ExtendedFit result;
    if (!fit.fitted.full_rank) {
      result.trouble = "the data can't tell its parameters apart";
      return result;
    }
    for (std::size_t l = 0; l < fit.laws.size(); ++l) {
      const std::string trouble = trouble_with(fit.laws[l]);
      if (trouble.empty()) continue;
      result.trouble = trouble;
      result.impossible.push_back(l);
    }
    if (!result.impossible.empty()) return result;
    result.usable = true;
    result.inverse_gains = fit.inverse_gains;
    describe(starts, fit.laws, fit.fitted, result);
    const std::vector<double> wald = wald_statistics(fit.columns, fit.fitted);
    for (std::size_t l = 0; l < wald.size(); ++l) result.laws[l].wald_statistic = wald[l];
    return result;
  }

  // Why a law with these parameters can't be there; empty if it can.
  [[nodiscard]] std::string trouble_with(const PlacedLaw& law) const {
    if (!is_within_ranges(law)) return "a law's parameter leaves its range";
    if (!keeps_order(*law.entry, law.parameters)) {
      return "friction at rest is less than when sliding: no Stribeck effect";
    }
    if (!slides(law)) return "a friction never slides: it is a damper here";
    if (!comes_back(law)) return "less than a wave of a ripple was recorded: it is a spring here";
    if (!is_within_reach(law)) return "a payload is farther from the flange than the robot is long";
    return "";
  }

  void list_hypotheses() {
    for (const CandidatePlace& place : data_.places) {
      scales_.push_back(motion_scale(place, data_.estimation));
      for (const LawEntry* entry : force_balance_laws(place, data_.position_is_recorded)) {
        hypotheses_.push_back({.place = place.location.name,
                               .location = place.yaml,
                               .law = entry->name,
                               .special_cases = special_cases_of(*entry, false),
                               .is_compound = place.is_compound,
                               .repeatable = entry->name == "ripple",
                               .characteristic = characteristic_of(*entry, place),
                               .acts_on = coordinates_of(place),
                               .rank = rank_of(entry->name, place)});
        entries_.push_back(entry);
        place_of_.push_back(scales_.size() - 1);
      }
    }
  }

  // `gains`: 1/gain of each joint's drive where these are unknown.
  [[nodiscard]] PlacedLaw placed(std::size_t hypothesis, std::vector<double> parameters,
                                 const Eigen::VectorXd& gains) const {
    PlacedLaw law{&data_.places[place_of_[hypothesis]], entries_[hypothesis],
                  std::move(parameters)};
    if (law.place->location.is_flange) law.inverse_gains = gains;
    return law;
  }

  // Whether `nearby` has this law with these parameters.
  static bool is_fitted(const LawStart& start, const ExtendedFit* nearby) {
    if (nearby == nullptr) return false;
    return std::ranges::any_of(nearby->laws, [&start](const FittedLaw& law) {
      return law.hypothesis == start.hypothesis &&
             std::ranges::equal(law.parameters, start.parameters, {}, &LawParameterEstimate::value);
    });
  }

  static void set_amplitudes(std::vector<PlacedLaw>& laws, const Eigen::VectorXd& amplitudes) {
    Index at = 0;
    for (PlacedLaw& law : laws) {
      law.set_amplitudes(amplitudes.segment(at, law.amplitudes()));
      at += law.amplitudes();
    }
  }

  [[nodiscard]] const MotionScale& scale_of(const PlacedLaw& law) const {
    return scales_[static_cast<std::size_t>(law.place - data_.places.data())];
  }

  [[nodiscard]] bool slides(const PlacedLaw& law) const {
    for (std::size_t i = 0; i < law.parameters.size(); ++i) {
      if (law.entry->parameters[i].name == "transition_velocity" &&
          law.parameters[i] > widest_transition(scale_of(law))) {
        return false;
      }
    }
    return true;
  }

  [[nodiscard]] bool is_within_reach(const PlacedLaw& law) const {
    if (law.entry->use != LawUse::kPayload) return true;
    double length = data_.robot.flange.translation().norm();
    for (const RobotJoint& joint : data_.robot.joints) length += joint.origin.translation().norm();
    const auto& p = law.parameters;
    return Eigen::Vector3d(p[1], p[2], p[3]).norm() <= length;
  }

  // A wave that was not recorded as a whole is a guess.
  [[nodiscard]] bool comes_back(const PlacedLaw& law) const {
    for (std::size_t i = 0; i < law.parameters.size(); ++i) {
      const bool is_wave = law.entry->name == "ripple" && law.entry->parameters[i].name == "period";
      if (is_wave && law.parameters[i] > scale_of(law).range) return false;
    }
    return true;
  }

  static bool is_within_ranges(const PlacedLaw& law) {
    for (std::size_t i = 0; i < law.parameters.size(); ++i) {
      const ParameterRange range = law.entry->parameters[i].range;
      const double value = law.parameters[i];
      if (range == ParameterRange::kPositive && !(value > 0.0)) return false;
      if (range == ParameterRange::kNonNegative && !(value >= 0.0)) return false;
      if (range == ParameterRange::kUnitInterval && !(value >= 0.0 && value <= 1.0)) return false;
    }
    return true;
  }

  // Columns of all parameters that the fit has estimated over `noise`: the model's, the laws'
  // (which they are), gains that only a payload tells.
  [[nodiscard]] Eigen::MatrixXd information_columns(const std::vector<PlacedLaw>& laws,
                                                    const Eigen::VectorXd& noise,
                                                    std::vector<Column>& of_laws) const {
    const Index samples = data_.estimation.samples();
    Eigen::MatrixXd columns = stacked(data_.estimation.model, noise, samples);
    for (std::size_t l = 0; l < laws.size(); ++l) {
      const PlacedLaw& law = laws[l];
      const std::vector<std::size_t> linear = law.linear(), scaled = law.scaled();
      for (const std::size_t index : linear) of_laws.push_back({l, index});
      if (!linear.empty()) {
        append(stacked(law_columns(law, data_, data_.estimation), noise, samples), columns);
      }
      std::vector<std::size_t> shaping = law.refined();
      if (!scaled.empty()) shaping.insert(shaping.begin(), scaled.front());
      if (shaping.empty()) continue;
      for (const std::size_t index : shaping) of_laws.push_back({l, index});
      append(stacked(law_slopes(law, shaping, data_, data_.estimation), noise, samples), columns);
    }
    add_gain_slopes(laws, noise, columns);
    return columns;
  }

  // What 1/gain of each joint's drive changes in the forces of payloads there: in the column of the
  // gain, or one of its own at the end.
  void add_gain_slopes(const std::vector<PlacedLaw>& laws, const Eigen::VectorXd& noise,
                       Eigen::MatrixXd& columns) const {
    const Index samples = data_.estimation.samples();
    Eigen::MatrixXd carried = Eigen::MatrixXd::Zero(samples, coordinates());
    Eigen::VectorXd gains = Eigen::VectorXd::Zero(coordinates());
    for (const PlacedLaw& law : laws) {
      if (law.inverse_gains.size() == 0) continue;
      const BalanceColumns force = force_before_gains(law, data_, data_.estimation);
      gains = law.inverse_gains;
      for (Index j = 0; j < coordinates(); ++j) {
        carried.col(j) += force.in[static_cast<std::size_t>(j)].col(0) / noise(j);
      }
    }
    for (Index j = 0; j < coordinates() && carried.squaredNorm() > 0.0; ++j) {
      const Index gain = data_.gain_parameters[static_cast<std::size_t>(j)];
      if (gain >= 0) {
        columns.col(gain).segment(j * samples, samples) += carried.col(j);
      } else if (gains(j) != 0.0) {
        append(Eigen::MatrixXd::Zero(columns.rows(), 1), columns);
        columns.rightCols<1>().middleRows(j * samples, samples) = carried.col(j);
      }
    }
  }

  // The prior precision of all parameters of a fit: those of laws have none.
  [[nodiscard]] Eigen::VectorXd prior_precision(Index parameters) const {
    Eigen::VectorXd precision = Eigen::VectorXd::Zero(parameters);
    const Eigen::VectorXd& model = data_.estimation.model_precision;
    precision.head(model.size()) = model;
    return precision;
  }
  // Rows of the prior below those of the data.
  void append_prior_rows(Eigen::MatrixXd& columns) const {
    const Index rows = columns.rows(), count = data_.estimation.model_precision.size();
    columns.conservativeResize(rows + count, Eigen::NoChange);
    columns.bottomRows(count).setZero();
    const Eigen::VectorXd precision = prior_precision(columns.cols());
    for (Index k = 0; k < count; ++k) columns(rows + k, k) = std::sqrt(precision(k));
  }

  // What estimates by columns over the noise owe to the data and to the prior.
  struct Influences {
    // Row t, column k is what the residuals at time t add to the error of parameter k: x_k - truth
    // is the sum over t.
    Eigen::MatrixXd of_data;
    // Row i, column k: what a standard deviation of the prior of parameter i does to that of k.
    Eigen::MatrixXd of_prior;
  };
  [[nodiscard]] Influences influences(const Eigen::MatrixXd& columns,
                                      const Eigen::VectorXd& precision,
                                      const BalanceFit& fitted) const {
    const Eigen::VectorXd lengths = columns.colwise().norm();
    const Eigen::VectorXd unit = lengths.cwiseInverse();
    const Eigen::MatrixXd scaled = columns * unit.asDiagonal();
    Eigen::MatrixXd gram = scaled.transpose() * scaled;
    gram.diagonal() += precision.cwiseProduct(unit.cwiseAbs2());
    const Eigen::MatrixXd weighted =
        gram.ldlt().solve(Eigen::MatrixXd::Identity(gram.rows(), gram.cols())) * unit.asDiagonal();
    const Eigen::MatrixXd influence = scaled * weighted;
    const Index samples = data_.estimation.samples();
    Eigen::MatrixXd result = Eigen::MatrixXd::Zero(samples, columns.cols());
    for (Index j = 0; j < coordinates(); ++j) {
      const Eigen::VectorXd rest = fitted.residuals.col(j) / fitted.noise(j);
      result += rest.asDiagonal() * influence.middleRows(j * samples, samples);
    }
    Eigen::MatrixXd of_prior(0, columns.cols());
    if (data_.estimation.model_precision.size() > 0) {
      // precision times deviation of the prior, which is 1 / sqrt(worth precision).
      const Eigen::VectorXd pull = (precision / data_.estimation.worth).cwiseSqrt();
      of_prior = pull.cwiseProduct(unit).asDiagonal() * weighted;
    }
    return {std::move(result), std::move(of_prior)};
  }

  // Covariance of estimates from their influences, which follow each other in time.
  [[nodiscard]] Eigen::MatrixXd covariance(const Eigen::MatrixXd& influence, Index fitted) const {
    std::vector<Index> pieces;
    for (const Motion& piece : data_.estimation.pieces) pieces.push_back(piece.samples());
    const PrewhitenedScores scores(influence, std::move(pieces));
    const Index lags = andrews_lags(scores.whitened_correlations(), scores.samples());
    const auto count = static_cast<double>(data_.estimation.force.size());
    return count / (count - static_cast<double>(fitted)) * scores.long_run_variance(lags);
  }

  // What each recording adds to the errors of the estimates, a row each.
  [[nodiscard]] Eigen::MatrixXd recording_sums(const Eigen::MatrixXd& influence) const {
    const ForceBalanceRows& rows = data_.estimation;
    Eigen::MatrixXd sums(0, influence.cols());
    Index row = 0;
    for (std::size_t piece = 0; piece < rows.pieces.size(); ++piece) {
      if (piece == 0 || rows.names[piece] != rows.names[piece - 1]) {
        sums.conservativeResize(sums.rows() + 1, Eigen::NoChange);
        sums.bottomRows<1>().setZero();
      }
      const Index samples = rows.pieces[piece].samples();
      sums.bottomRows<1>() += influence.middleRows(row, samples).colwise().sum();
      row += samples;
    }
    return sums;
  }

  // Standard deviations of the model's parameters and of those of the laws, at least as wide as the
  // spread between recordings (recording_spread.hpp); NaN where the data do not see one.
  struct Deviations {
    Eigen::VectorXd model;
    std::vector<Column> parameters;
    std::vector<double> of_parameters;
  };
  [[nodiscard]] Deviations deviations(const std::vector<PlacedLaw>& laws,
                                      const BalanceFit& fitted) const {
    Deviations result;
    const Eigen::MatrixXd all = information_columns(laws, fitted.noise, result.parameters);
    Eigen::MatrixXd with_prior = all;
    append_prior_rows(with_prior);
    Eigen::MatrixXd basis(with_prior.rows(), 0);
    const std::vector<bool> is_seen = extend_basis(with_prior, basis);
    std::vector<Index> seen;
    for (std::size_t k = 0; k < is_seen.size(); ++k) {
      if (is_seen[k]) seen.push_back(static_cast<Index>(k));
    }
    const Influences influence =
        influences(all(Eigen::all, seen), prior_precision(all.cols())(seen), fitted);
    const Eigen::VectorXd between = deviations_between(recording_sums(influence.of_data));
    Eigen::VectorXd deviation = Eigen::VectorXd::Constant(all.cols(), kUnknown);
    for (std::size_t k = 0; k < seen.size(); ++k) {
      const auto own = static_cast<Index>(k);
      const double within = std::sqrt(covariance(influence.of_data.col(own), all.cols())(0, 0));
      const double of_data = std::max(within, between(own));
      deviation(seen[k]) = std::hypot(of_data, influence.of_prior.col(own).norm());
    }
    const Index model = data_.estimation.model.count;
    result.model = deviation.head(model);
    for (Index k = model; k < deviation.size(); ++k) result.of_parameters.push_back(deviation(k));
    return result;
  }

  // Wald statistic of each law's amplitudes, shapes held.
  [[nodiscard]] std::vector<double> wald_statistics(const std::vector<BalanceColumns>& laws,
                                                    const BalanceFit& fitted) const {
    const Index samples = data_.estimation.samples();
    Eigen::MatrixXd columns = stacked(data_.estimation.model, fitted.noise, samples);
    const Index model = columns.cols();
    for (const BalanceColumns& law : laws) append(stacked(law, fitted.noise, samples), columns);
    std::vector<double> result;
    if (laws.empty()) return result;
    const Influences influence = influences(columns, prior_precision(columns.cols()), fitted);
    Index first = 0;
    for (const BalanceColumns& law : laws) {
      const auto at = Eigen::seqN(model + first, law.count);
      const Eigen::MatrixXd of_prior = influence.of_prior(Eigen::all, at);
      const Eigen::MatrixXd own = covariance(influence.of_data(Eigen::all, at), columns.cols()) +
                                  of_prior.transpose() * of_prior;
      const Eigen::VectorXd amplitudes = fitted.amplitudes.segment(first, law.count);
      result.push_back(amplitudes.dot(own.completeOrthogonalDecomposition().solve(amplitudes)));
      first += law.count;
    }
    return result;
  }

  void describe(std::span<const LawStart> starts, const std::vector<PlacedLaw>& laws,
                const BalanceFit& fitted, ExtendedFit& result) const {
    const Deviations deviation = deviations(laws, fitted);
    for (Index k = 0; k < fitted.model.size(); ++k) {
      const auto at = static_cast<std::size_t>(k);
      result.model_parameters.push_back({data_.parameter_names[at], data_.parameter_units[at],
                                         fitted.model(k), deviation.model(k)});
    }
    for (std::size_t l = 0; l < laws.size(); ++l) {
      const PlacedLaw& law = laws[l];
      std::vector<double> errors(law.parameters.size(), kUnknown);
      for (std::size_t k = 0; k < deviation.parameters.size(); ++k) {
        const Column& column = deviation.parameters[k];
        if (column.law == l) errors[column.parameter] = deviation.of_parameters[k];
      }
      FittedLaw& described = result.laws.emplace_back();
      described.hypothesis = starts[l].hypothesis;
      for (std::size_t i = 0; i < law.parameters.size(); ++i) {
        described.parameters.push_back(estimate_of(
            law.entry->parameters[i], law.place->location.units, law.parameters[i], errors[i]));
      }
    }
    result.parameter_count =
        static_cast<std::size_t>(fitted.model.size()) + deviation.parameters.size();
    for (Index j = 0; j < coordinates(); ++j) {
      result.deviance += effective_[static_cast<std::size_t>(j)] * 2.0 * std::log(fitted.noise(j));
    }
    result.estimation = assess(data_.estimation, fitted.residuals);
    result.held_out = fitted.held_out;
    for (Index j = 0; j < coordinates(); ++j) {
      if (is_idle(j)) result.held_out.col(j).setOnes();  // nothing to predict
    }
  }

  // Errors with given values of everything.
  [[nodiscard]] Eigen::MatrixXd residuals(const ExtendedFit& fit,
                                          const ForceBalanceRows& rows) const {
    Eigen::MatrixXd result = rows.force;
    const auto subtract = [&result](const BalanceColumns& columns, const Eigen::VectorXd& values) {
      for (Index j = 0; j < result.cols(); ++j) {
        const Eigen::MatrixXd& own = columns.in[static_cast<std::size_t>(j)];
        if (own.size() > 0) result.col(j) -= own * values;
      }
    };
    Eigen::VectorXd model(static_cast<Index>(fit.model_parameters.size()));
    for (Index k = 0; k < model.size(); ++k) {
      model(k) = fit.model_parameters[static_cast<std::size_t>(k)].value;
    }
    subtract(rows.model, model);
    for (const FittedLaw& law : fit.laws) {
      subtract(law_force_column(placed_of(fit, law), data_, rows), Eigen::VectorXd::Ones(1));
    }
    return result;
  }

  [[nodiscard]] PlacedLaw placed_of(const ExtendedFit& fit, const FittedLaw& law) const {
    return placed(law.hypothesis, law.values(), inverse_gains(fit));
  }

  // Relative errors are of all coordinates together, as tables of published results have them.
  [[nodiscard]] Assessment assess(const ForceBalanceRows& rows,
                                  const Eigen::MatrixXd& error) const {
    const double variance = centred_square(rows.measured);
    Assessment result;
    result.chi_square = (error * regression_.noise().cwiseInverse().asDiagonal()).squaredNorm();
    result.degrees_of_freedom = 0.0;
    for (Index j = 0; j < rows.coordinates(); ++j) result.degrees_of_freedom += rows.counted(j);
    result.nrmse = 100.0 * std::sqrt(error.squaredNorm() / variance);
    result.variance_accounted_for = 100.0 * (1.0 - centred_square(error) / variance);
    return result;
  }

  [[nodiscard]] ForcePicture picture(const ExtendedFit& fit, const FittedLaw& law) const {
    const PlacedLaw placed_law = placed_of(fit, law);
    const BalanceColumns own = law_force_column(placed_law, data_, data_.estimation);
    const Eigen::MatrixXd rest = residuals(fit, data_.estimation);
    const Eigen::VectorXd& direction = placed_law.place->location.output;
    Eigen::VectorXd law_force = Eigen::VectorXd::Zero(rest.rows());
    for (Index j = 0; j < coordinates(); ++j) {
      const Eigen::MatrixXd& block = own.in[static_cast<std::size_t>(j)];
      if (block.size() > 0) law_force += direction(j) * block.col(0);
    }
    law_force /= direction.squaredNorm();
    const Eigen::VectorXd force = law_force + rest * direction / direction.squaredNorm();
    const PlaceUnits& units = placed_law.place->location.units;
    ForcePicture result{
        law.hypothesis, units.deflection, units.deflection + "/s", units.force, {}, {}, {}, {}};
    for (const Motion& piece : data_.estimation.pieces) {
      const RecordedPlaceMotion motion = motion_at(*placed_law.place, piece);
      result.deflection.insert(result.deflection.end(), motion.deflection.begin(),
                               motion.deflection.end());
      result.rate.insert(result.rate.end(), motion.rate.begin(), motion.rate.end());
    }
    result.force.assign(force.begin(), force.end());
    result.law_force.assign(law_force.begin(), law_force.end());
    return result;
  }

  // What the model has at the law's place, and the law along the motion.
  void describe_physics(const PlacedLaw& law, PhysicalContext::OfLaw& own) const {
    const Location& place = law.place->location;
    if (place.input != place.output) return;  // driven from elsewhere, it may well feed energy in
    own.inertia = data_.known_inertia;
    if (place.units.deflection == "m") own.stiffness = 0.0;  // gravity may make a joint topple
    own.damping = 0.0;
    for (const Element& element : data_.robot.elements) {
      const bool is_there = are_one_place(element.location, place);
      if (is_there && element.law_name == "viscous") own.damping += element.parameters[0];
    }
    const ForceBalanceRows& rows = data_.estimation;
    const BalanceColumns force = law_force_column(law, data_, rows);
    const Eigen::VectorXd direction = place.output / place.output.squaredNorm();
    Eigen::VectorXd at_place = Eigen::VectorXd::Zero(rows.samples());
    for (Index j = 0; j < coordinates(); ++j) {
      const Eigen::MatrixXd& block = force.in[static_cast<std::size_t>(j)];
      const Eigen::VectorXd column =
          block.size() > 0 ? Eigen::VectorXd(block.col(0)) : Eigen::VectorXd::Zero(rows.samples());
      own.trace.acting.insert(own.trace.acting.end(), column.begin(), column.end());
      at_place += direction(j) * column;
    }
    own.trace.force.assign(at_place.begin(), at_place.end());
    for (const Motion& piece : rows.pieces) {
      const RecordedPlaceMotion motion = motion_at(*law.place, piece);
      own.trace.deflection.insert(own.trace.deflection.end(), motion.deflection.begin(),
                                  motion.deflection.end());
      own.trace.rate.insert(own.trace.rate.end(), motion.rate.begin(), motion.rate.end());
    }
    const Eigen::VectorXd measured = rows.measured * direction;
    const Eigen::Map<const Eigen::VectorXd> rate(own.trace.rate.data(), rows.samples());
    own.trace.carried = measured.cwiseAbs().maxCoeff();
    own.trace.fed_in = measured.cwiseProduct(rate).cwiseMax(0.0).mean();
  }

  void add_spans(const ForceBalanceRows& rows, Index j, CheckedRange& range) const {
    const BalanceCoordinate& moving = data_.coordinates[static_cast<std::size_t>(j)];
    constexpr double kNever = std::numeric_limits<double>::infinity();
    CheckedRange::Span position{"position of " + moving.name, moving.units.deflection, kNever,
                                -kNever};
    CheckedRange::Span velocity{"velocity of " + moving.name, moving.units.deflection + "/s",
                                kNever, -kNever};
    const auto widen = [](CheckedRange::Span& span, const auto& values) {
      span.from = std::min(span.from, values.minCoeff());
      span.to = std::max(span.to, values.maxCoeff());
    };
    for (const Motion& piece : rows.pieces) {
      widen(position, piece.position.col(j));
      widen(velocity, piece.velocity.col(j));
    }
    if (data_.position_is_recorded) range.spans.push_back(std::move(position));
    range.spans.push_back(std::move(velocity));
    range.spans.push_back({channel_name(j), moving.units.force, rows.measured.col(j).minCoeff(),
                           rows.measured.col(j).maxCoeff()});
  }

  [[nodiscard]] std::string channel_name(Index coordinate) const {
    const BalanceCoordinate& moving = data_.coordinates[static_cast<std::size_t>(coordinate)];
    return (moving.units.force == "N m" ? "torque of " : "force of ") + moving.name;
  }

  // The first recording of a role, every coordinate.
  void add_curves(const ExtendedFit& fit, const ForceBalanceRows& rows, bool held_out,
                  std::vector<ResidualCurve>& curves) const {
    const Eigen::MatrixXd error = residuals(fit, rows);
    const Motion& piece = rows.pieces.front();
    for (Index j = 0; j < std::min(coordinates(), kShownCurves); ++j) {
      ResidualCurve curve;
      curve.channel = channel_name(j);
      curve.unit = data_.coordinates[static_cast<std::size_t>(j)].units.force;
      curve.experiment = rows.names.front();
      curve.over_time = true;
      curve.held_out = held_out;
      const auto own = Eigen::seqN(Index{0}, piece.samples());
      const Eigen::VectorXd measured = rows.measured(own, j), rest = error(own, j);
      curve.axis.assign(piece.time.begin(), piece.time.end());
      curve.measured.assign(measured.begin(), measured.end());
      curve.residual.assign(rest.begin(), rest.end());
      curves.push_back(std::move(curve));
    }
  }

  // What every hypothesis is asked: rows are samples over `rms`, coordinate after coordinate.
  struct ScoreQuestion {
    const ScoreTest& test;
    const Eigen::MatrixXd& basis;  // of all that the fit has
    const Eigen::MatrixXd& right;  // what it leaves, and draws of noise
    const Eigen::VectorXd& rms;    // by coordinate
    double worth;                  // of a sample, in independent ones
    double square;                 // of what is left
  };
  [[nodiscard]] HypothesisScore score_of(std::size_t hypothesis, const Eigen::VectorXd& gains,
                                         const ScoreQuestion& question,
                                         std::span<double> null_minima) const;
  [[nodiscard]] CandidateProducts products_with(const BalanceColumns& columns,
                                                const ScoreQuestion& question) const;

  ForceBalanceData data_;
  ForceBalanceOptions options_;
  ReadInTime read_in_time_;
  BalanceRegression regression_;
  Eigen::VectorXd first_inverse_gains_;  // of the model as given; empty where gains are known
  std::vector<ColouredNoise> noises_;    // by coordinate
  std::vector<double> effective_;        // samples, by coordinate
  std::vector<Hypothesis> hypotheses_;
  std::vector<const LawEntry*> entries_;
  std::vector<std::size_t> place_of_;
  std::vector<MotionScale> scales_;  // of each place
};

// ---- scores -------------------------------------------------------------------------------------

ScoreTable ForceBalanceProblem::scores(const ExtendedFit& fit, std::span<const std::size_t> asked,
                                       int null_draws, std::uint64_t seed) const {
  const Eigen::MatrixXd rest = residuals(fit, data_.estimation);
  const Eigen::VectorXd rms = rms_of(data_.estimation, rest);
  const Index samples = rest.rows();
  double counted = 0.0;
  for (Index j = 0; j < coordinates(); ++j) {
    if (!is_idle(j)) counted += data_.estimation.counted(j);
  }
  const double worth = sample_count() / std::max(1.0, counted);
  Eigen::MatrixXd right(rest.size(), 1 + null_draws);
  right.col(0) = (rest * rms.cwiseInverse().asDiagonal()).reshaped();
  // Draws follow each other in time as the noise does. They are judged as the data are: a sample is
  // worth `worth` of an independent one.
  Random random(seed);
  for (Index b = 1; b <= null_draws; ++b) {
    for (Index j = 0; j < coordinates(); ++j) {
      Eigen::VectorXd draw = noises_[static_cast<std::size_t>(j)].draw(random);
      if (data_.estimation.counts.size() > 0)
        draw.array() *= data_.estimation.counts.col(j).array();
      const double scale = std::sqrt(worth * data_.estimation.counted(j) / draw.squaredNorm());
      right.col(b).segment(j * samples, samples) = is_idle(j) || !std::isfinite(scale)
                                                       ? Eigen::VectorXd::Zero(samples)
                                                       : Eigen::VectorXd(scale * draw);
    }
  }
  std::vector<PlacedLaw> present;
  for (const FittedLaw& law : fit.laws) present.push_back(placed_of(fit, law));
  std::vector<Column> unused;
  Eigen::MatrixXd parameters = information_columns(present, rms, unused);
  append_prior_rows(parameters);
  right.conservativeResize(parameters.rows(), Eigen::NoChange);
  right.bottomRows(parameters.rows() - rest.size()).setZero();
  const Eigen::VectorXd precision = prior_precision(parameters.cols());
  for (Index k = 0; k < parameters.rows() - rest.size(); ++k) {
    const double value = fit.model_parameters[static_cast<std::size_t>(k)].value;
    right(rest.size() + k, 0) = -std::sqrt(precision(k)) * value;
  }
  Eigen::MatrixXd basis(parameters.rows(), 0);
  (void)extend_basis(parameters, basis);
  const double square = right.col(0).squaredNorm();
  const double freedom =
      std::max(sample_count() - static_cast<double>(basis.cols()), 0.5 * sample_count());
  const ScoreTest test(
      {Eigen::MatrixXd::Identity(basis.cols(), basis.cols()), basis.transpose() * right},
      {square, freedom});
  const ScoreQuestion question{test, basis, right, rms, worth, square};
  ScoreTable table;
  table.scores.resize(asked.size());
  std::vector<std::vector<double>> minima(
      asked.size(), std::vector<double>(static_cast<std::size_t>(null_draws), 1.0));
  const Eigen::VectorXd gains = inverse_gains(fit);
  std::exception_ptr failure;
#pragma omp parallel for num_threads(options_.threads) schedule(dynamic)
  for (std::size_t i = 0; i < asked.size(); ++i) {
    try {
      table.scores[i] = score_of(asked[i], gains, question, minima[i]);
    } catch (...) {  // must not leave a thread
#pragma omp critical(force_balance_scores)
      failure = std::current_exception();
    }
  }
  if (failure) std::rethrow_exception(failure);
  table.null_minima.assign(static_cast<std::size_t>(null_draws), 1.0);
  for (const std::vector<double>& own : minima) {
    for (std::size_t b = 0; b < own.size(); ++b) {
      table.null_minima[b] = std::min(table.null_minima[b], own[b]);
    }
  }
  return table;
}

// The best of the law's shapes.
HypothesisScore ForceBalanceProblem::score_of(std::size_t hypothesis, const Eigen::VectorXd& gains,
                                              const ScoreQuestion& question,
                                              std::span<double> null_minima) const {
  HypothesisScore best;
  best.start.hypothesis = hypothesis;
  const CandidatePlace& place = data_.places[place_of_[hypothesis]];
  const LawEntry& entry = *entries_[hypothesis];
  best.amplitude_unit = unit_at(entry.parameters.front().unit, place.location.units);
  best.shapes = 0;
  const PlacedLaw law = placed(hypothesis, {}, gains);
  std::vector<LawShape> shapes = law_shapes(entry, place, scales_[place_of_[hypothesis]]);
  // Where gains are known the mass alone shows, and its place follows in the refit.
  if (place.location.is_flange && law.inverse_gains.size() == 0) shapes.resize(1);
  for (const LawShape& shape : shapes) {
    if (shape.basis.empty()) continue;
    const CandidateProducts products =
        products_with(basis_columns(law, shape.basis, data_, data_.estimation), question);
    if (!products.information.allFinite() || !(products.information.trace() > 0.0)) continue;
    ++best.shapes;
    question.test.lower_minimum_p_values(
        products, [&](const Eigen::VectorXd& amplitudes) { return shape.allows(amplitudes); },
        null_minima);
    CandidateScore score = question.test.score(products);
    if (score.statistic <= best.score.statistic) continue;
    std::vector<double> parameters = shape.parameters(score.amplitudes);
    if (parameters.empty() && !best.start.parameters.empty()) continue;
    best.amplitude = score.amplitudes(0);
    best.amplitude_deviation = std::sqrt(score.amplitude_covariance(0, 0) / question.worth);
    if (parameters.empty()) continue;  // the sign that it found is impossible
    best.start.parameters = std::move(parameters);
    best.explained_share = score.statistic / question.square;
    best.score = std::move(score);
  }
  return best;
}

// Products of columns over the noise with one another, with what the fit has and with what it
// leaves.
CandidateProducts ForceBalanceProblem::products_with(const BalanceColumns& columns,
                                                     const ScoreQuestion& question) const {
  const Index samples = data_.estimation.samples();
  CandidateProducts products{Eigen::MatrixXd::Zero(columns.count, columns.count),
                             Eigen::MatrixXd::Zero(columns.count, question.basis.cols()),
                             Eigen::MatrixXd::Zero(columns.count, question.right.cols())};
  for (Index j = 0; j < coordinates(); ++j) {
    const Eigen::MatrixXd& block = columns.in[static_cast<std::size_t>(j)];
    if (block.size() == 0) continue;
    const Eigen::MatrixXd own = block / question.rms(j);
    products.information.noalias() += own.transpose() * own;
    products.nuisance.noalias() +=
        own.transpose() * question.basis.middleRows(j * samples, samples);
    products.scores.noalias() += own.transpose() * question.right.middleRows(j * samples, samples);
  }
  return products;
}

}  // namespace

std::unique_ptr<MismatchProblem> force_balance_problem(const std::filesystem::path& model,
                                                       const Campaign& campaign,
                                                       const ForceBalanceOptions& options) {
  const auto read = [robot = load_rigid_robot(model), campaign,
                     places = options.place_files](const Eigen::VectorXd& advance) {
    return load_force_balance_data(robot, campaign, places, advance);
  };
  return std::make_unique<ForceBalanceProblem>(read({}), options, read);
}

std::unique_ptr<MismatchProblem> drive_balance_problem(const RigidRobotModel& drive,
                                                       const Campaign& campaign,
                                                       const ForceBalanceOptions& options) {
  Campaign smooth = campaign;
  const std::optional<LowPass> low_pass = missing_low_pass(drive, campaign);
  if (low_pass) smooth.preprocess.emplace_back(*low_pass);
  const auto read = [drive, smooth, low_pass](const Eigen::VectorXd& advance) {
    ForceBalanceData data = load_force_balance_data(drive, smooth, {}, advance);
    if (low_pass) {
      data.remarks.push_back(fmt::format(
          "All channels went through a low-pass at {:.4g} Hz: above it the noise of the positions, "
          "differentiated twice, hides the acceleration (preprocess: low_pass, frequency: {:.4g})",
          low_pass->frequency, low_pass->frequency));
    }
    name_as_lumped(data);
    return data;
  };
  return std::make_unique<ForceBalanceProblem>(read({}), options, read);
}

}  // namespace graybox
