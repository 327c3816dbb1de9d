// Numbers that wrap: a counter of 8, 16 or 32 bits (also a signed number that was read as an
// unsigned one), or an angle that is kept within one turn or half of one.
//
// Rule for a period P: the values span at most P, steps above P/2 occur, and with whole periods
// added each of them is at most P/8 and at most 5 times the step that 99 % of the other steps keep
// below. Counters hold whole numbers and need two such steps; an angle needs one. Periods of
// counters are tried from the smallest on, and turns before halves of them.
//
// A signed number that was read as unsigned may wrap once only, as a drive does that reverses. Its
// rule: whole numbers from 0 to P - 1, none from P/8 to 7 P/8, in 20 samples or more. A switch has
// few levels, so there are two or more on either side and five in all. Steps across the middle are
// small with whole periods added: at most P/256, or 5 times what 99 % of the others keep below.
// Rates: docs/how_to/faulty_data.md. Cost: O(n log n).
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>

namespace graybox {

struct CounterWrap {
  double period;
  std::size_t count;   // steps
  Eigen::Index first;  // sample after the first
  double strength;     // P/8 over the largest mended step
  bool is_signed;      // a signed number that was read as unsigned, by the second rule
};

// `turn`: in the channel's unit, or 0 for what is no angle.
[[nodiscard]] std::optional<CounterWrap> find_wrap(const Eigen::Ref<const Eigen::VectorXd>& values,
                                                   double turn);

// The values with whole periods added where a step is longer than half a period.
[[nodiscard]] Eigen::VectorXd unwrapped(const Eigen::Ref<const Eigen::VectorXd>& values,
                                        double period);

}  // namespace graybox
