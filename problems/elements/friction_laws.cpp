// Laws that brake: friction and drag. They take energy: f z' >= 0.
//
// A friction that jumps at z' = 0 has no unique motion there; it is replaced by tanh(z'/v_t), whose
// transition velocity v_t is a parameter: small against the velocities of interest, and no smaller
// than needed, for the integrator's steps shrink with it.
#include <cmath>

#include "graybox/problems/elements/formula_law.hpp"
#include "graybox/problems/elements/law_lists.hpp"

namespace graybox {
namespace {

struct Viscous {
  static constexpr int kParameters = 1, kStates = 0;
  template <typename T>
  static T force(const T* p, const T&, const T& rate, const T*) {
    return p[0] * rate;
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
       {{"damping", "F s/x", kAny}},
       make_law<Viscous>},
      {"coulomb",
       "dry friction: f = F_c tanh(z'/v_t)",
       kForce,
       {{"level", "F", kNonNegative}, {"transition_velocity", "x/s", kPositive}},
       make_law<Coulomb>},
      {"asymmetric_coulomb",
       "dry friction with a level for each direction",
       kForce,
       {{"forward_level", "F", kNonNegative},
        {"backward_level", "F", kNonNegative},
        {"transition_velocity", "x/s", kPositive}},
       make_law<AsymmetricCoulomb>},
      {"stribeck",
       "f = (F_c + (F_s - F_c) exp(-(z'/v_s)^2)) tanh(z'/v_t)",
       kForce,
       {{"level", "F", kNonNegative},
        {"static_level", "F", kNonNegative},
        {"stribeck_velocity", "x/s", kPositive},
        {"transition_velocity", "x/s", kPositive}},
       make_law<Stribeck>},
      {"quadratic_drag",
       "f = c |z'| z'",
       kForce,
       {{"coefficient", "F s^2/x^2", kNonNegative}},
       make_law<QuadraticDrag>},
      {"deflection_damping",
       "damping that grows with the deflection: f = c z^2 z'",
       kForce,
       {{"coefficient", "F s/x^3", kNonNegative}},
       make_law<DeflectionDamping>},
  };
}

}  // namespace graybox
