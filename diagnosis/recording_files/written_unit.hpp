// Units as people write them, and what they mean: "Nm", "N*m" and "N m" are one unit, and so are
// "°/s", "deg/sec" and "Grad/s". Units are compared here, and never by their spelling.
//
//   written_unit("0.1 deg")                // deg, 0.1
//   is_same_unit("Nm", "N m")              // true
#pragma once

#include <string>
#include <string_view>

namespace graybox {

// A unit with a factor: "0.1 deg" is {deg, 0.1}. An empty unit: none that is known. A share of
// something ("% of rated torque") is %.
struct WrittenUnit {
  std::string unit;
  double factor = 1.0;
};
[[nodiscard]] WrittenUnit written_unit(std::string_view text);

// The unit that people write like that ("Nm", "1/min", "°/s", "sec"), as units.hpp calls it; empty
// if there is none.
[[nodiscard]] std::string unit_as_written(std::string_view text);

// A unit by words of lower case joined by one blank, as they end a title: "n m", "rad s".
[[nodiscard]] WrittenUnit unit_of_words(std::string_view words);

// Whether two texts mean one unit. Texts that are no unit are compared as they are, but for blanks.
[[nodiscard]] bool is_same_unit(std::string_view one, std::string_view other);

}  // namespace graybox
