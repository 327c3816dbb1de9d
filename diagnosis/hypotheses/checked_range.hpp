// The range of motion that a verdict was checked in: outside of it nothing was seen, and nothing is
// said.
#pragma once

#include <string>
#include <vector>

namespace graybox {

struct CheckedRange {
  struct Span {
    std::string quantity;  // "velocity of carriage", "frequency"
    std::string unit;
    double from = 0.0, to = 0.0;
  };
  std::vector<Span> spans;
  std::vector<Span> recorded;          // velocities in all recordings, those of the fit, too
  std::vector<std::string> positions;  // of a robot, in words; empty: the spans say all
  std::vector<std::string> files;      // that it was checked on
  bool kept_out = false;               // of the fit; else they are those of the fit
};

}  // namespace graybox
