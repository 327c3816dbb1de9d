// Forces that were recorded later or earlier than the motion. A force F(t) that comes late by T is
// F(t - T), near F - T dF/dt, so that what a fit leaves of it goes with the force's own rate: see
// late_forces.hpp. Here the laws of the model found take part.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "diagnosis/force_balance/balance_fitter.hpp"
#include "diagnosis/force_balance_data/force_balance_data.hpp"
#include "diagnosis/force_balance_data/late_forces.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"

namespace graybox {

// Refers to the data and the fitter.
class LateChannels {
 public:
  LateChannels(const ForceBalanceData& data, const BalanceFitter& fitter,
               std::function<bool()> keep_going)
      : data_(data), fitter_(fitter), keep_going_(std::move(keep_going)) {}

  // Fills late_by and held_out_nrmse_in_time of each channel that is late. Without recordings kept
  // out it does nothing.
  void find(const ExtendedFit& fit, std::vector<ChannelRest>& channels) const;

  // Whether moving the force by its lateness lowers its error on what is kept out enough.
  [[nodiscard]] bool is_worth_moving(const ChannelRest& rest) const;

  // What is left, in s, of the lateness of each joint that was moved.
  [[nodiscard]] Eigen::VectorXd lateness_left(const ExtendedFit& fit) const;
  [[nodiscard]] bool is_moved_too_little(const ExtendedFit& fit) const;

  // Not that of motors which move other joints, too.
  [[nodiscard]] bool has_own_force(Eigen::Index coordinate) const;

 private:
  struct MovedRest {  // NRMSE of one coordinate, %
    double estimation = 0.0, held_out = 0.0;
  };

  [[nodiscard]] LatenessFit lateness_beside(const ExtendedFit& fit, const Eigen::MatrixXd& rest,
                                            const Eigen::MatrixXd& held_out,
                                            Eigen::Index coordinate) const;
  // Columns of the model, of the laws found and of plain friction that act on a coordinate.
  [[nodiscard]] Eigen::MatrixXd columns_on(Eigen::Index coordinate, const ExtendedFit& fit,
                                           const ForceBalanceRows& rows) const;
  void append_plain_friction(Eigen::Index coordinate, const ForceBalanceRows& rows,
                             Eigen::MatrixXd& columns) const;
  // Laws fitted to a late force take part of its lateness. So the force is moved on, and the same
  // laws are fitted again, as long as that lowers what they leave.
  [[nodiscard]] LateForce with_laws_refitted(const ExtendedFit& fit, Eigen::Index coordinate,
                                             LateForce late) const;
  // None where the laws can't be fitted.
  [[nodiscard]] std::optional<MovedRest> left_with_force_moved(std::span<const LawStart> laws,
                                                               Eigen::Index coordinate,
                                                               double seconds) const;

  const ForceBalanceData& data_;
  const BalanceFitter& fitter_;
  std::function<bool()> keep_going_;
};

// Where several joints are moved one way, one clock for all positions, or all forces, may be late.
// The median of all that come late or early at all.
[[nodiscard]] std::optional<double> lateness_of_all(const Eigen::VectorXd& each,
                                                    const std::vector<ChannelRest>& channels);

}  // namespace graybox
