// The laws that a challenge hides in its simulated recordings. They share no code with the
// catalogue of problems/laws and are finer physics where they can be, so that a
// diagnosis is not asked to recover its own formulas:
//
//   play, dead zones, saturations   corners rounded as by elastic contact: |x| is sqrt(x^2 + c^2)
//   dry friction                    a sign rounded as by a lubricant's film; bristles before
//                                   sliding are laws of their own (Dahl, LuGre), also in the
//                                   catalogue
//   friction outside the catalogue  LuGre's bristles, with a level that varies
//   hardening springs, ripple       a small higher term on top
//   Dahl, Bouc-Wen                  with the force or the share of the yield force as state
//
// Each law is described in the catalogue's terms (name, parameters, units with F, x, I of the
// place), with further parameters of its own where it is finer. Laws that the catalogue lacks are
// here too.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "problems/laws/law.hpp"
#include "problems/laws/law_catalogue.hpp"

namespace graybox::bench {

// Kinds of places, as bits.
enum PlaceKind : unsigned {
  kSpringPlace = 1,    // a deflection that a spring of the model holds
  kAxisPlace = 2,      // a motor, arm axis or mass, against the ground
  kCouplingPlace = 4,  // a force here that follows the motion elsewhere
  kActuatorPlace = 8,
  kSensorPlace = 16,
  kFlangePlace = 32,
};

// How a place moves without the effect, all rms.
struct PlaceScale {
  double deflection = 1.0;    // about rest
  double offset = 0.0;        // of rest
  double rate = 1.0;          // of the deflection; unused at signals
  double acceleration = 1.0;  // likewise
  double force = 1.0;         // that would make this deflection; at signals the signal
  double stiffness = 0.0;     // of the model's spring there
  bool turns = false;         // an axis that comes round
};

struct HiddenParameter {
  std::string name;
  std::string unit;
  bool in_catalogue = true;  // the catalogue's law has it, with the same meaning
};

struct HiddenLaw {
  std::string name;
  LawUse use = LawUse::kForce;
  bool in_catalogue = true;
  unsigned places = 0;  // bits of PlaceKind
  bool rotations_only = false;
  double largest_size = 3.0;  // beyond, the effect is no longer that of a disturbed model
  std::vector<HiddenParameter> parameters;
  // Null for inertia, payload and delay, which have no Law object.
  std::function<std::shared_ptr<const Law>(std::span<const double>)> make;
  // The parameters at which the effect has a size (about its force over the force that moves the
  // place) at a place; `shape` holds six uniform numbers of [0, 1) that decide all but the size.
  std::function<std::vector<double>(double size, const PlaceScale& scale,
                                    std::span<const double> shape)>
      parameters_of;

  [[nodiscard]] bool at_signal() const {
    return (places & (unsigned{kActuatorPlace} | unsigned{kSensorPlace})) != 0;
  }
};

[[nodiscard]] const std::vector<HiddenLaw>& hidden_laws();

// Null if there is none.
[[nodiscard]] const HiddenLaw* find_hidden_law(std::string_view name, bool at_signal);

}  // namespace graybox::bench
