// How much a position jitters from row to row beside its speed: by noise, coarse steps, or stamps
// that are not the times of the samples.
//
// With e(k) = (q(k+1) - q(k))/h - (v(k) + v(k+1))/2, the part of the rate that the speed does not
// explain, about its mean. A speed that was computed from the position holds nothing of its own,
// however it was smoothed. Its steps v(k+1) - v(k) then follow from e some rows before and behind.
// A first-order low pass v(k+1) = v(k) + a (rate - v(k)) even goes a/(1 - a/2) of e in each row.
#pragma once

#include <Eigen/Core>
#include <optional>

namespace graybox {

struct PositionJitter {
  double rate = 0.0;             // rms of e
  double speed_noise = 0.0;      // rms of the speed's steps, over sqrt(2)
  double speed_deviation = 0.0;  // about its mean
  double computed = 0.0;         // of the squares of the speed's steps, what follows from e
  double low_pass = 0.0;         // a of the low pass that made the speed; 0: none did

  // Between two rows the position jitters by three times what the speed does, and by more than the
  // speed ever deviates: most of the rate is no motion.
  [[nodiscard]] bool is_large() const {
    return rate >= 3.0 * speed_noise && rate > speed_deviation;
  }
  // More than half: noise of its own leaves less than a quarter, a smoothed rate above four fifths.
  [[nodiscard]] bool is_speed_computed() const { return computed > 0.5; }
};

// `position` has no wraps, and the unit of the speed times s; `step`: s between rows. The first
// 20 000 rows count. None below 100 rows and for signals that hold still or are no numbers.
[[nodiscard]] std::optional<PositionJitter> position_jitter(const Eigen::VectorXd& position,
                                                            const Eigen::VectorXd& speed,
                                                            double step);

}  // namespace graybox
