// The range of motion that a verdict was checked in: outside of it nothing was seen, and nothing is
// said.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/signals/standing_drive.hpp"

namespace graybox {

struct CheckedRange {
  struct Span {
    std::string quantity;  // "velocity of carriage", "frequency"
    std::string unit;
    double from = 0.0, to = 0.0;
    double slowest = 0.0;  // speed that lasted (standing_drive.hpp), of a velocity; 0: not known
  };
  // What the drive of the only axis gave while that stood still, at one place.
  struct Standing {
    std::string axis, unit;
    StandingDrive drive;
    // What the laws found hold there; NaN: not asked.
    double holds = std::numeric_limits<double>::quiet_NaN();
    // "0 to 185 N m"
    [[nodiscard]] std::string drive_words() const;
  };
  std::vector<Span> spans;
  std::vector<Span> recorded;          // velocities in all recordings, those of the fit, too
  std::vector<std::string> positions;  // of a robot, in words; empty: the spans say all
  std::vector<std::string> files;      // that it was checked on
  bool kept_out = false;               // of the fit; else they are those of the fit
  std::optional<Standing> standing;    // none: it did not stand, or that tells little
};

}  // namespace graybox
