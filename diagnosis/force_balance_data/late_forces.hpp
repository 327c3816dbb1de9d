// Whether what a drive reports comes late: a force that was measured follows the one that the
// fitted model gives, some time behind (or ahead).
//
//     sum over t of (y(t + tau) - y_model(t))^2
//
// over whole samples tau within kLongestDelay either way, y = measured. Samples are paired anew,
// not interpolated, for interpolated noise is smaller noise. The least sum and its neighbours give
// tau between samples. It is told where it takes kLeastShare of the squared error both of the
// recordings of the fit and, at the same tau, of those kept out. Damping that is missing in the
// model looks like it, too.
//
// Cost: O(N) a sample of tau.
#pragma once

#include <optional>

#include "diagnosis/force_balance_data/force_balance_data.hpp"

namespace graybox {

inline constexpr double kLongestDelay = 0.25;  // s
inline constexpr double kLeastShare = 0.1;
// Lateness that takes this share of the squared error kept out has laws stand in for it: they are
// sought anew with the force moved.
inline constexpr double kWorthMoving = 0.3;
// Less lateness than so many samples is no fault: what a drive holds acts half a sample later.
inline constexpr double kShortestMove = 1.5;

struct LateForce {
  double seconds = 0.0;         // positive: late
  double nrmse_held_out = 0.0;  // with that, %
};

// `rest`, `rest_held_out`: what the model leaves, samples x coordinates.
[[nodiscard]] std::optional<LateForce> late_force(const ForceBalanceRows& rows,
                                                  const Eigen::MatrixXd& rest,
                                                  const ForceBalanceRows& held_out,
                                                  const Eigen::MatrixXd& rest_held_out,
                                                  Eigen::Index coordinate);

// The rows with one coordinate's forces moved earlier by so many seconds, in whole samples. Where a
// recording then has none, they do not count.
void advance_force(ForceBalanceRows& rows, Eigen::Index coordinate, double seconds);

// One coordinate's rows for a regression: what is left of its force, the columns of the model and
// of laws that act there, and those of plain friction.
struct LatenessRows {
  const ForceBalanceRows& rows;
  Eigen::VectorXd rest;
  Eigen::MatrixXd columns;
};

// Lateness beside all that was fitted, and beside plain friction: where a mass moves at one
// frequency, lateness looks like viscous friction of either sign, which takes its place or hides
// it. To first order
//
//     y(t) = y_model(t - tau) = X b - tau y_model',
//
// so tau is the coefficient of one more column, by least squares on these rows alone.
struct LatenessFit {
  double seconds = 0.0;  // tau; 0 where nothing can be said
  // This column takes so much of the squared error that the others leave, and so much on recordings
  // kept out, with the coefficients of the fit's.
  double share = 0.0, share_held_out = 0.0;
  double nrmse_held_out = 0.0;  // with all columns, %
};

[[nodiscard]] LatenessFit fit_lateness(const LatenessRows& fitted, const LatenessRows& held_out,
                                       Eigen::Index coordinate);

// Moves the forces of each joint earlier by so many seconds (later: negative), by interpolation;
// samples at the ends for which there is no force then go. A piece that is too short for that
// stays as it is.
void advance_forces(const Eigen::VectorXd& seconds, std::vector<MotionRecord>& records);

}  // namespace graybox
