// Laws that brake: friction and drag. They take energy: f z' >= 0.
//
// A friction that jumps at z' = 0 has no unique motion there; it is replaced by tanh(z'/v_t), whose
// transition velocity v_t is a parameter: small against the velocities of interest, and no smaller
// than needed, for the integrator's steps shrink with it.
#include <cmath>

#include "problems/laws/formula_law.hpp"
#include "problems/laws/law_lists.hpp"

namespace graybox {
namespace {

struct Viscous {
  static constexpr int kParameters = 1, kStates = 0;
  template <typename T>
  static T force(const T* p, const T&, const T& rate, const T*) {
    return p[0] * rate;
  }
};

// p: forward, backward.
struct AsymmetricViscous {
  static constexpr int kParameters = 2, kStates = 0;
  template <typename T>
  static T force(const T* p, const T&, const T& rate, const T*) {
    return (rate > 0.0 ? p[0] : p[1]) * rate;
  }
};

struct Coulomb {
  static constexpr int kParameters = 2, kStates = 0;
  template <typename T>
  static T force(const T* p, const T&, const T& rate, const T*) {
    using std::tanh;
    return p[0] * tanh(rate / p[1]);
  }
};

// p: forward, backward, v_t.
struct AsymmetricCoulomb {
  static constexpr int kParameters = 3, kStates = 0;
  template <typename T>
  static T force(const T* p, const T&, const T& rate, const T*) {
    using std::tanh;
    return (rate > 0.0 ? p[0] : p[1]) * tanh(rate / p[2]);
  }
};

// Stribeck 1902, in the form of Armstrong-Helouvry, Dupont and Canudas de Wit 1994.
struct Stribeck {
  static constexpr int kParameters = 4, kStates = 0;
  template <typename T>
  static T force(const T* p, const T&, const T& rate, const T*) {
    using std::exp;
    using std::tanh;
    const T slow = exp(-(rate / p[2]) * (rate / p[2]));
    return (p[0] + (p[1] - p[0]) * slow) * tanh(rate / p[3]);
  }
};

// Friction that grows with less than the first power of the rate, or none: lubricated gears. With
// v_t under the root the slope at rest is finite; for rates far above it f is F (|z'|/v_r)^e
// sign(z'). p: F, e, v_r, v_t.
struct SublinearFriction {
  static constexpr int kParameters = 4, kStates = 0;
  template <typename T>
  static T force(const T* p, const T&, const T& rate, const T*) {
    const T square = (rate * rate + p[3] * p[3]) / (p[2] * p[2]);
    return p[0] * (rate / p[2]) * power(square, T(0.5 * (p[1] - 1.0)));
  }
};

// Gears and bearings rub more under load. An input, the load, stands in place of the deflection.
// p: F_c, mu, v_t.
struct LoadFriction {
  static constexpr int kParameters = 3, kStates = 0;
  template <typename T>
  static T force(const T* p, const T& load, const T& rate, const T*) {
    using std::abs;
    using std::tanh;
    return (p[0] + p[1] * abs(load)) * tanh(rate / p[2]);
  }
};

// A motor on a bridge brakes itself (back electromotive force) while the bridge conducts. Without a
// drive it coasts, or brakes harder where the bridge shorts it. An input, the drive, stands in
// place of the deflection. p: driven, undriven, threshold.
struct DrivenViscous {
  static constexpr int kParameters = 3, kStates = 0;
  template <typename T>
  static T force(const T* p, const T& drive, const T& rate, const T*) {
    using std::abs;
    return (abs(drive) > p[2] ? p[0] : p[1]) * rate;
  }
};

struct QuadraticDrag {
  static constexpr int kParameters = 1, kStates = 0;
  template <typename T>
  static T force(const T* p, const T&, const T& rate, const T*) {
    using std::abs;
    return p[0] * abs(rate) * rate;
  }
};

struct DeflectionDamping {
  static constexpr int kParameters = 1, kStates = 0;
  template <typename T>
  static T force(const T* p, const T& z, const T& rate, const T*) {
    return p[0] * z * z * rate;
  }
};

}  // namespace

std::vector<LawEntry> friction_laws() {
  using enum ParameterRange;
  constexpr auto kForce = LawUse::kForce;
  return {
      {"viscous",
       "viscous friction or damping, or the error of one: f = d z'",
       kForce,
       {{"damping", "F s/x", kAny, true}},
       make_law<Viscous>},
      {"asymmetric_viscous",
       "viscous friction with a damping for each direction",
       kForce,
       {{"forward_damping", "F s/x", kAny, true}, {"backward_damping", "F s/x", kAny, true}},
       make_law<AsymmetricViscous>},
      {"coulomb",
       "dry friction: f = F_c tanh(z'/v_t)",
       kForce,
       {{"level", "F", kNonNegative, true}, {"transition_velocity", "x/s", kPositive}},
       make_law<Coulomb>},
      {"asymmetric_coulomb",
       "dry friction with a level for each direction",
       kForce,
       {{"forward_level", "F", kNonNegative, true},
        {"backward_level", "F", kNonNegative, true},
        {"transition_velocity", "x/s", kPositive}},
       make_law<AsymmetricCoulomb>},
      {"stribeck",
       "f = (F_c + (F_s - F_c) exp(-(z'/v_s)^2)) tanh(z'/v_t)",
       kForce,
       {{"level", "F", kNonNegative, true},
        {.name = "static_level",
         .unit = "F",
         .range = kNonNegative,
         .is_linear = true,
         .at_least = "level"},
        {"stribeck_velocity", "x/s", kPositive},
        {"transition_velocity", "x/s", kPositive}},
       make_law<Stribeck>},
      {"sublinear_friction",
       "f = F (|z'|/v_r)^e sign(z'), smooth within v_t of rest",
       kForce,
       {{"level", "F", kNonNegative, true},
        {"exponent", "1", kUnitInterval},
        {.name = "reference_velocity", .unit = "x/s", .range = kPositive, .sets_scale = true},
        {"transition_velocity", "x/s", kPositive}},
       make_law<SublinearFriction>},
      {"quadratic_drag",
       "f = c |z'| z'",
       kForce,
       {{"coefficient", "F s^2/x^2", kNonNegative, true}},
       make_law<QuadraticDrag>},
      {"deflection_damping",
       "damping that grows with the deflection: f = c z^2 z'",
       kForce,
       {{"coefficient", "F s/x^3", kNonNegative, true}},
       make_law<DeflectionDamping>},
  };
}

std::vector<LawEntry> supplementary_friction_laws() {
  using enum ParameterRange;
  return {
      {"load_dependent_friction",
       "dry friction that grows with an input d: f = (F_c + mu |d|) tanh(z'/v_t)",
       LawUse::kForce,
       {{"level", "F", kNonNegative, true},
        {"coefficient", "F/D", kNonNegative, true},
        {"transition_velocity", "x/s", kPositive}},
       make_law<LoadFriction>},
      {"driven_viscous",
       "viscous friction of a mass while an input d drives it, |d| > d_0, and while it does not",
       LawUse::kForce,
       {{"driven_damping", "F s/x", kAny, true},
        {"undriven_damping", "F s/x", kAny, true},
        {.name = "threshold", .unit = "D", .range = kNonNegative, .sets_scale = true}},
       make_law<DrivenViscous>}};
}

}  // namespace graybox
