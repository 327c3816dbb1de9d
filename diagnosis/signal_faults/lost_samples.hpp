// Samples that were cut out of a position without a trace in the times: it jumps by what it moved
// meanwhile.
//
// Rule: r = rate - median of the five rates around it, rates being steps over their time; |r| above
// 20 times the |r| that 99 % of all samples keep below. For positions only: velocities and forces
// jump. A motion has no such jump where it is sampled well; a spike has two of opposite sign and is
// not counted, nor is what happens at the first and the last two steps.
// Rates: docs/how_to/faulty_data.md. Cost: O(n).
//
// The first two steps have a rule of their own, for measured positions and speeds. A recorder's
// first rows may hold old values, from before it ran: 0.188, then -0.0002, -0.0002, ... Neither a
// position nor a speed can go there at a stroke where no later step is an eighth as large.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace graybox {

struct LostSamples {
  std::vector<Eigen::Index> after;  // the sample after each jump, rising
  double jump;                      // of the first, in the position's unit
  double strength;                  // largest |r| over its threshold
};

// Below 100 samples or for signals of at most 16 levels there is no answer.
// Rising times.
[[nodiscard]] std::optional<LostSamples> find_lost_samples(
    const Eigen::Ref<const Eigen::VectorXd>& time,
    const Eigen::Ref<const Eigen::VectorXd>& position);

struct StaleStart {
  Eigen::Index samples;  // old ones, one or two
  double strength;       // the step behind them over its threshold
};

// None below 50 samples, for signals of at most 16 levels, and where no later step is above zero.
[[nodiscard]] std::optional<StaleStart> find_stale_start(
    const Eigen::Ref<const Eigen::VectorXd>& values);

// Whether a speed may have set off from rest within the row behind such a start: it is faster then,
// the same way. Where rows are far apart that is no old value.
[[nodiscard]] bool may_have_set_off(const Eigen::Ref<const Eigen::VectorXd>& speed,
                                    const StaleStart& start);

}  // namespace graybox
