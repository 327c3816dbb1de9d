#include "diagnosis/force_balance_data/late_forces.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "diagnosis/recordings/sample_interpolation.hpp"

namespace graybox {
namespace {

using Eigen::Index;

constexpr Index kFewestMoved = 20;  // samples
constexpr double kImitated = 1e-6;  // of a column's square, beside others

// Squares of y(t + shift) - y_model(t), over pairs of samples of one piece that count.
struct ShiftedError {
  double square = 0.0, count = 0.0;
};

ShiftedError shifted_error(const ForceBalanceRows& rows, const Eigen::MatrixXd& rest,
                           Index coordinate, Index shift) {
  ShiftedError error;
  const auto counts = [&](Index row) {
    return rows.counts.size() == 0 || rows.counts(row, coordinate) > 0.0;
  };
  Index first = 0;
  for (const Motion& piece : rows.pieces) {
    const Index last = first + piece.samples();
    for (Index t = std::max(first, first - shift); t < std::min(last, last - shift); ++t) {
      if (!counts(t) || !counts(t + shift)) continue;
      const double model = rows.measured(t, coordinate) - rest(t, coordinate);
      const double difference = rows.measured(t + shift, coordinate) - model;
      error.square += difference * difference;
      error.count += 1.0;
    }
    first = last;
  }
  return error;
}

double variance(const ForceBalanceRows& rows, Index coordinate) {
  const Eigen::VectorXd measured = rows.measured.col(coordinate);
  return (measured.array() - measured.mean()).square().sum() /
         std::max(1.0, rows.counted(coordinate));
}

// Slopes of the force that the model gives, per s; 0 where it or a neighbour does not count.
struct Slopes {
  Eigen::VectorXd values;
  Eigen::VectorXd counts;  // 1 or 0
  Index count = 0;
  [[nodiscard]] Eigen::MatrixXd masked(const Eigen::MatrixXd& matrix) const {
    return counts.asDiagonal() * matrix;
  }
};

Slopes slopes_of(const LatenessRows& of, Index coordinate) {
  const ForceBalanceRows& rows = of.rows;
  const Eigen::VectorXd model = rows.measured.col(coordinate) - of.rest;
  const auto counts = [&](Index row) {
    return rows.counts.size() == 0 || rows.counts(row, coordinate) > 0.0;
  };
  Slopes slopes{Eigen::VectorXd::Zero(model.size()), Eigen::VectorXd::Zero(model.size())};
  Index first = 0;
  for (const Motion& piece : rows.pieces) {
    for (Index t = first + 1; t + 1 < first + piece.samples(); ++t) {
      if (!counts(t - 1) || !counts(t) || !counts(t + 1)) continue;
      slopes.values(t) = (model(t + 1) - model(t - 1)) / (2.0 * piece.sample_time());
      slopes.counts(t) = 1.0;
      ++slopes.count;
    }
    first += piece.samples();
  }
  return slopes;
}

// Where a parabola through three neighbours is least, from the middle one, in samples.
double least_between(double before, double middle, double after) {
  const double bend = before - 2.0 * middle + after;
  return bend > 0.0 && std::isfinite(bend) ? std::clamp(0.5 * (before - after) / bend, -0.5, 0.5)
                                           : 0.0;
}

// The samples of a piece at which the forces of then are known for every joint.
Motion with_forces_moved(const Motion& piece, const Eigen::VectorXd& seconds) {
  const double first_time = piece.time(0), last_time = piece.time(piece.samples() - 1);
  const double from = first_time - std::min(0.0, seconds.minCoeff()),
               to = last_time - std::max(0.0, seconds.maxCoeff());
  const auto first = static_cast<Index>((piece.time.array() < from).count());
  const Index count = static_cast<Index>((piece.time.array() <= to).count()) - first;
  if (count < kFewestMoved) return piece;
  Motion moved = samples_of(piece, first, count);
  for (Index j = 0; j < seconds.size(); ++j) {
    if (seconds(j) == 0.0) continue;
    const Eigen::VectorXd then = (moved.time.array() + seconds(j)).max(first_time).min(last_time);
    moved.torque.col(j) = interpolated(piece.time, piece.torque.col(j), then);
  }
  return moved;
}

}  // namespace

LatenessFit fit_lateness(const LatenessRows& fitted, const LatenessRows& held_out,
                         Index coordinate) {
  const Slopes slopes = slopes_of(fitted, coordinate), then = slopes_of(held_out, coordinate);
  if (slopes.count < 2 * fitted.columns.cols() + 20 || then.count < 2) return {};
  // Beside the other columns: of the slopes, and of what is left.
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(slopes.masked(fitted.columns));
  const auto beside = [&](const Eigen::VectorXd& values, const Eigen::VectorXd& values_then) {
    const Eigen::VectorXd taken = qr.solve(values);
    return std::pair<Eigen::VectorXd, Eigen::VectorXd>(
        values - slopes.masked(fitted.columns) * taken,
        values_then - then.masked(held_out.columns) * taken);
  };
  const auto [column, column_then] = beside(slopes.values, then.values);
  const auto [rest, rest_then] = beside(slopes.masked(fitted.rest), then.masked(held_out.rest));
  constexpr double kNeverChanges = 1e-9;  // of its rms: such a force comes at any time
  const double signal = variance(held_out.rows, coordinate);
  const double square = held_out.rows.measured.col(coordinate).squaredNorm();
  if (!(signal * static_cast<double>(then.count) > kNeverChanges * square)) return {};
  if (!(column.squaredNorm() > kImitated * slopes.values.squaredNorm())) return {};
  const double coefficient = rest.dot(column) / column.squaredNorm();
  const double left = (rest_then - coefficient * column_then).squaredNorm();
  LatenessFit fit;
  fit.seconds = -coefficient;
  fit.share = coefficient * rest.dot(column) / rest.squaredNorm();
  fit.share_held_out = 1.0 - left / rest_then.squaredNorm();
  fit.nrmse_held_out = 100.0 * std::sqrt(left / static_cast<double>(then.count) / signal);
  return fit;
}

void advance_forces(const Eigen::VectorXd& seconds, std::vector<MotionRecord>& records) {
  if (seconds.size() == 0 || (seconds.array() == 0.0).all()) return;
  for (MotionRecord& record : records) {
    for (Motion& piece : record.pieces) piece = with_forces_moved(piece, seconds);
  }
}

void advance_force(ForceBalanceRows& rows, Index coordinate, double seconds) {
  if (rows.empty()) return;
  const Eigen::VectorXd measured = rows.measured.col(coordinate);
  const Eigen::VectorXd known = measured - rows.force.col(coordinate);
  if (rows.counts.size() == 0) rows.counts.setOnes(rows.samples(), rows.coordinates());
  const Eigen::VectorXd counted = rows.counts.col(coordinate);
  Index first = 0;
  for (const Motion& piece : rows.pieces) {
    const Index last = first + piece.samples();
    const double step = piece.sample_time();
    const Index shift = step > 0.0 ? std::lround(seconds / step) : 0;
    for (Index t = first; t < last; ++t) {
      const Index then = t + shift;
      const bool is_there = then >= first && then < last && counted(t) > 0.0 && counted(then) > 0.0;
      rows.counts(t, coordinate) = is_there ? 1.0 : 0.0;
      if (!is_there) continue;
      rows.measured(t, coordinate) = measured(then);
      rows.force(t, coordinate) = measured(then) - known(t);
    }
    first = last;
  }
  rows.leave_out_standing_forces();
}

std::optional<LateForce> late_force(const ForceBalanceRows& rows, const Eigen::MatrixXd& rest,
                                    const ForceBalanceRows& held_out,
                                    const Eigen::MatrixXd& rest_held_out, Index coordinate) {
  if (rows.empty() || held_out.empty()) return {};
  const double step = rows.pieces.front().sample_time(),
               held_out_step = held_out.pieces.front().sample_time();
  if (!(step > 0.0) || !(held_out_step > 0.0)) return {};
  const auto longest = static_cast<Index>(kLongestDelay / step);
  // Few pairs say little: of short pieces most are lost.
  const auto mean_of = [coordinate](const ForceBalanceRows& of, const Eigen::MatrixXd& left,
                                    Index shift) {
    const ShiftedError error = shifted_error(of, left, coordinate, shift);
    return error.count > 0.0 && error.count >= 0.5 * of.counted(coordinate)
               ? error.square / error.count
               : std::numeric_limits<double>::infinity();
  };
  const auto error_at = [&](Index shift) { return mean_of(rows, rest, shift); };
  const double unshifted = error_at(0);
  Index best = 0;
  double least = unshifted;
  for (Index shift = -longest; shift <= longest; ++shift) {
    const double error = error_at(shift);
    if (error >= least) continue;
    least = error;
    best = shift;
  }
  const bool is_at_the_end = std::abs(best) == longest;
  if (best == 0 || is_at_the_end || least > (1.0 - kLeastShare) * unshifted) return {};
  const double samples =
      static_cast<double>(best) + least_between(error_at(best - 1), least, error_at(best + 1));
  const auto shift = static_cast<Index>(std::lround(samples * step / held_out_step));
  const double before = mean_of(held_out, rest_held_out, 0),
               after = mean_of(held_out, rest_held_out, shift);
  const double signal = variance(held_out, coordinate);
  if (!(signal > 0.0) || !std::isfinite(before) || after > (1.0 - kLeastShare) * before) return {};
  return LateForce{samples * step, 100.0 * std::sqrt(after / signal)};
}

}  // namespace graybox
