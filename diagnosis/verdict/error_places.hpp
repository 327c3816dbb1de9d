// Where in time the error of a diagnosis sits, told where it sits in few places: what happens once
// (a stop that is hit, a hand at the machine, a load that is picked up) is found by looking there.
//
//   lines.append(error_place_lines(diagnosis));
//
// Each recording is cut into 50 parts of equal length, with e_b the mean squared residual of part b
// of the channel whose error is the largest share of its signal.
//   - A spell: the shortest run of parts that holds half of the sum of e_b is at most 8 % of the
//     recording.
//   - An onset: from one part on the mean of e_b is at least nine times that before, also across
//     the seam itself (three parts on either side), and each side has ten parts at least.
// Neither is told where the measured signal itself moves as unevenly, nor where the error is below
// 3 % of the signal. For residuals whose past lasts for a fiftieth of the recording, chance tells a
// place in fewer than 1 % of recordings (tests/diagnosis/report/error_places_test.cpp).
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/evidence/diagnosis.hpp"

namespace graybox {

struct ErrorPlace {
  enum class Kind : std::uint8_t { kSpell, kOnset };
  Kind kind = Kind::kSpell;
  std::string recording, channel, unit;
  bool held_out = false;
  double from = 0.0, to = 0.0;   // s; an onset lasts to the end of the recording
  double share = 0.0;            // of the squared error there
  double ratio = 0.0;            // of an onset: the error (rms) after over that before
  double low = 0.0, high = 0.0;  // of the channel there, as measured
  // The channel goes there in no recording of the fit, nor elsewhere in this one.
  bool is_new = false;
};

// One at most for each recording; those kept out first.
[[nodiscard]] std::vector<ErrorPlace> error_places(std::span<const ResidualCurve> curves);

// Of the model found, or of the model as given where nothing was.
[[nodiscard]] std::vector<ErrorPlace> error_places_of(const Diagnosis& diagnosis);

// In words, three at most.
[[nodiscard]] std::vector<std::string> error_place_lines(const Diagnosis& diagnosis);

}  // namespace graybox
