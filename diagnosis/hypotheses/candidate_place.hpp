// CandidatePlace: a place of a model where physics may be missing.
#pragma once

#include <cstdint>
#include <string>

#include "problems/elements/element.hpp"

namespace graybox {

// What a law that is not linear describes as a whole: the curve of the spring at its place, or the
// friction there.
enum class Characteristic : std::int8_t { kNone, kSpring, kFriction };

struct CandidatePlace {
  Location location;
  std::string yaml;  // the value of `location` in physics.yaml, in flow style
  // The laws of the model that already have free parameters here: what only changes those is no
  // hypothesis.
  bool has_free_stiffness = false;
  double spring_stiffness = 0.0;  // of the model's springs there, by its own values; 0: none
  bool has_free_damping = false;
  bool has_free_inertia = false;
  bool turns = false;     // an axis that comes round: ripple has periods of whole turns
  bool may_lift = false;  // nothing else says how gravity acts here: on the angle of the axis alone
  bool is_compound = false;  // sum or difference of two places
  bool is_coupling = false;  // b_in differs from b_out
  // A constant force here changes where the model rests, and its plant there.
  bool shifts_rest = false;
};

}  // namespace graybox
