#include "diagnosis/force_balance/late_channels.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "diagnosis/force_balance/balance_hypotheses.hpp"
#include "diagnosis/force_balance/balance_regression.hpp"
#include "diagnosis/force_balance_data/force_balance_laws.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr double kLateStep = 0.2;  // of a lateness, by which a force is moved on
constexpr double kTurning = 0.02;  // of a joint's speed, below which it turns round

bool is_told(const LatenessFit& lateness) {
  return std::abs(lateness.seconds) < kLongestDelay && lateness.share > kLeastShare &&
         lateness.share_held_out > kLeastShare;
}

}  // namespace

void LateChannels::find(const ExtendedFit& fit, std::vector<ChannelRest>& channels) const {
  if (data_.validation.empty()) return;
  const Eigen::MatrixXd rest = fitter_.residuals(fit, data_.estimation),
                        held_out = fitter_.residuals(fit, data_.validation);
  for (Index j = 0; j < data_.estimation.coordinates(); ++j) {
    if (data_.idle[static_cast<std::size_t>(j)]) continue;
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

bool LateChannels::is_worth_moving(const ChannelRest& rest) const {
  if (!rest.late_by || !rest.held_out_nrmse || !rest.held_out_nrmse_in_time) return false;
  const double sample_time = data_.recorded.front().sample_time();
  if (std::abs(*rest.late_by) < kShortestMove * sample_time) return false;
  const double ratio = *rest.held_out_nrmse_in_time / *rest.held_out_nrmse;
  return ratio * ratio <= 1.0 - kWorthMoving;
}

Eigen::VectorXd LateChannels::lateness_left(const ExtendedFit& fit) const {
  Eigen::VectorXd left = Eigen::VectorXd::Zero(data_.estimation.coordinates());
  const Eigen::MatrixXd rest = fitter_.residuals(fit, data_.estimation),
                        held_out = fitter_.residuals(fit, data_.validation);
  for (Index j = 0; j < data_.advance.size(); ++j) {
    if (data_.advance(j) != 0.0) left(j) = lateness_beside(fit, rest, held_out, j).seconds;
  }
  return left;
}

bool LateChannels::is_moved_too_little(const ExtendedFit& fit) const {
  if (data_.advance.size() == 0) return false;
  const Eigen::ArrayXd left = lateness_left(fit).cwiseAbs();
  return (left > kLateStep * kLateStep * data_.advance.array().abs()).any();
}

bool LateChannels::has_own_force(Index coordinate) const {
  if (!data_.robot.channels.motor_torque) return true;
  const auto column = data_.robot.transmission.col(coordinate).array();
  return (column != 0.0).count() == 1;
}

LatenessFit LateChannels::lateness_beside(const ExtendedFit& fit, const Eigen::MatrixXd& rest,
                                          const Eigen::MatrixXd& held_out, Index coordinate) const {
  return fit_lateness(
      {data_.estimation, rest.col(coordinate), columns_on(coordinate, fit, data_.estimation)},
      {data_.validation, held_out.col(coordinate), columns_on(coordinate, fit, data_.validation)},
      coordinate);
}

Eigen::MatrixXd LateChannels::columns_on(Index coordinate, const ExtendedFit& fit,
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

void LateChannels::append_plain_friction(Index coordinate, const ForceBalanceRows& rows,
                                         Eigen::MatrixXd& columns) const {
  const Eigen::VectorXd own = Eigen::VectorXd::Unit(data_.estimation.coordinates(), coordinate);
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

LateForce LateChannels::with_laws_refitted(const ExtendedFit& fit, Index coordinate,
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

std::optional<LateChannels::MovedRest> LateChannels::left_with_force_moved(
    std::span<const LawStart> laws, Index coordinate, double seconds) const {
  ForceBalanceData moved = data_;
  for (ForceBalanceRows* rows : {&moved.estimation, &moved.validation}) {
    advance_force(*rows, coordinate, seconds);
    rows->laws = std::make_shared<LawSampleCache>(rows->samples());
  }
  const BalanceHypotheses hypotheses(moved);
  const BalanceFitter fitter(moved, hypotheses, keep_going_);
  const ExtendedFit fit = fitter.fit(laws, nullptr);
  if (!fit.usable) return {};
  const auto nrmse = [&](const ForceBalanceRows& rows) {
    const double square = fitter.residuals(fit, rows).col(coordinate).squaredNorm();
    return 100.0 * std::sqrt(square / centred_square(rows.measured.col(coordinate)));
  };
  return MovedRest{nrmse(moved.estimation), nrmse(moved.validation)};
}

std::optional<double> lateness_of_all(const Eigen::VectorXd& each,
                                      const std::vector<ChannelRest>& channels) {
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

}  // namespace graybox
