// The force of a law as C99: what a program without graybox computes it by.
//
//   const std::optional<std::string> body = law_source(*find_law("coulomb", false));
//   // "return level * tanh(v / transition_velocity);"
//
// The statements are of z (deflection), v (its rate) and the law's parameters by name (c_name).
// They may call functions of math.h, and clip() and sign_of() of kLawHelpers.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "problems/laws/law_catalogue.hpp"

namespace graybox {

struct LawHelper {
  std::string_view name;
  std::string_view source;  // of a static function
};
inline constexpr std::array<LawHelper, 2> kLawHelpers{{
    {.name = "clip(",
     .source = "static double clip(double x, double limit) {\n"
               "  return x > limit ? limit : (x < -limit ? -limit : x);\n"
               "}\n"},
    {.name = "sign_of(",
     .source = "static double sign_of(double x) { return (x > 0.0) - (x < 0.0); }\n"},
}};

// None for a law with memory, for inertia and payload, and for laws of signals.
[[nodiscard]] std::optional<std::string> law_source(const LawEntry& law);

// A parameter's name that C and math.h do not use themselves.
[[nodiscard]] std::string c_name(const std::string& name);

// As many digits as a double needs to be read back, and never an integer: "1.0".
[[nodiscard]] std::string c_number(double value);

}  // namespace graybox
