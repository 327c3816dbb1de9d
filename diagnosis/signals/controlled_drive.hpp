// Drives that a speed controller made, or that are its target.
//
// A target: wherever the drive stays at one number, the speed settles at the same number. A machine
// has its own gain; one within 2 % of 1 at all levels is rare.
//
// An output: at about one speed the drive falls as the speed rises, u = a - g v, in the same row or
// the next one. In an open loop it is the speed that answers, and more drive makes more speed. What
// is not taken for an output:
//
// - A drive counted the other way, as u = -b v against friction: its line passes through zero. The
//   line of a controller has its zero near the speed.
// - A current at a constant voltage while a motor runs up: then the speed is not about one.
// - A single tone, whose phase may be anything behind a mass and a late sensor.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace graybox {

// Rows of one recording, in recorded numbers and of one length.
struct DriveAndSpeed {
  Eigen::VectorXd drive, speed;
};

// The numbers at which the speed settles where the drive stays at them, rising. Empty: they do not
// agree, or are less than two that differ by a quarter of the largest. Levels below a tenth of the
// largest do not count: nothing moves there.
[[nodiscard]] std::vector<double> levels_of_target(const std::vector<DriveAndSpeed>& recordings);

struct SpeedFeedback {
  double constant = 0.0, gain = 0.0;  // drive = constant - gain speed
  double share = 0.0;                 // of the drive's squares about its mean
};

// None below 50 rows and where less than 90 % of the drive follow from the speed.
[[nodiscard]] std::optional<SpeedFeedback> find_speed_feedback(
    const std::vector<DriveAndSpeed>& recordings);

}  // namespace graybox
