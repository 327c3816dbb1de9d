// Laws of the deflection alone: springs, play, stops, ripple. They store energy and lose none.
#include <cmath>
#include <numbers>

#include "problems/laws/formula_law.hpp"
#include "problems/laws/law_lists.hpp"

namespace graybox {
namespace {

struct Stiffness {
  static constexpr int kParameters = 1, kStates = 0;
  template <typename T>
  static T force(const T* p, const T& z, const T&, const T*) {
    return p[0] * z;
  }
};

struct CubicSpring {
  static constexpr int kParameters = 1, kStates = 0;
  template <typename T>
  static T force(const T* p, const T& z, const T&, const T*) {
    return p[0] * z * z * z;
  }
};

// What turns a spring of this stiffness into one with play: -k z inside the gap. p: half gap, k.
struct Backlash {
  static constexpr int kParameters = 2, kStates = 0;
  template <typename T>
  static T force(const T* p, const T& z, const T&, const T*) {
    return -p[1] * clip(z, p[0]);
  }
};

struct DeadZoneSpring {
  static constexpr int kParameters = 2, kStates = 0;
  template <typename T>
  static T force(const T* p, const T& z, const T&, const T*) {
    return p[1] * (z - clip(z, p[0]));
  }
};

struct Ripple {
  static constexpr int kParameters = 3, kStates = 0;
  template <typename T>
  static T force(const T* p, const T& z, const T&, const T*) {
    using std::sin;
    return p[0] * sin(2.0 * std::numbers::pi * z / p[1] + p[2]);
  }
};

// From an anchor at distance a of an axis to a lever of length b at the angle phi from it: the
// length l = sqrt(a^2 + b^2 - 2 a b cos phi) and its slope dl/dphi = a b sin(phi) / l. No length:
// no direction.
template <typename T>
struct LeverReach {
  T length = T(0.0), slope = T(0.0);
  LeverReach(const T& a, const T& b, const T& phi) {
    using std::cos;
    using std::sin;
    using std::sqrt;
    const T square = a * a + b * b - 2.0 * a * b * cos(phi);
    if (!(square > 0.0)) return;
    length = sqrt(square);
    slope = a * b * sin(phi) / length;
  }
};

// A straight spring between anchor and lever; its torque about the axis is (k (l - l_0)) dl/dphi.
// p: k, l_0, a, b, angle.
struct Balancer {
  static constexpr int kParameters = 5, kStates = 0;
  template <typename T>
  static T force(const T* p, const T& z, const T&, const T*) {
    const LeverReach<T> reach(p[2], p[3], z - p[4]);
    return p[0] * (reach.length - p[1]) * reach.slope;
  }
};

// The same geometry with a gas in place of the spring's steel. Pulled out by s = l - |a - b| beyond
// its shortest length, the rod presses a gas column of length g together, and p V^n = const gives
//   F = F_0 (1 - s/g)^(-n),   f = F dl/dphi:
// n = 1 for slow, 1.4 for fast motion of nitrogen (isothermal, adiabatic). A gas that would be
// pressed to less than a thousandth is held there. p: F_0, g, n, a, b, angle.
struct GasBalancer {
  static constexpr int kParameters = 6, kStates = 0;
  template <typename T>
  static T force(const T* p, const T& z, const T&, const T*) {
    using std::abs;
    using std::pow;
    const LeverReach<T> reach(p[3], p[4], z - p[5]);
    T column = 1.0 - (reach.length - abs(p[3] - p[4])) / p[1];
    if (!(column > 1e-3)) column = T(1e-3);
    return p[0] * pow(column, -p[2]) * reach.slope;
  }
};

// A mass off the axis: m g r about the direction in which it hangs. p: sine, cosine.
struct GravityTorque {
  static constexpr int kParameters = 2, kStates = 0;
  template <typename T>
  static T force(const T* p, const T& z, const T&, const T*) {
    using std::cos;
    using std::sin;
    return p[0] * sin(z) + p[1] * cos(z);
  }
};

struct Offset {
  static constexpr int kParameters = 1, kStates = 0;
  template <typename T>
  static T force(const T* p, const T&, const T&, const T*) {
    return p[0];
  }
};

}  // namespace

std::vector<LawEntry> spring_laws() {
  using enum ParameterRange;
  constexpr auto kForce = LawUse::kForce;
  return {
      {"stiffness",
       "linear spring, or the error of one: f = k z",
       kForce,
       {{"stiffness", "F/x", kAny, true}},
       make_law<Stiffness>},
      {"cubic_spring",
       "hardening (k > 0) or softening (k < 0): f = k z^3",
       kForce,
       {{"stiffness", "F/x^3", kAny, true}},
       make_law<CubicSpring>},
      {"backlash",
       "play in a spring of stiffness k: takes k z away while |z| is within the half gap",
       kForce,
       {{"half_gap", "x", kNonNegative}, {"stiffness", "F/x", kPositive, true}},
       make_law<Backlash>},
      {"dead_zone",
       "spring that engages beyond a clearance c: f = k (z - clip(z, -c, c))",
       kForce,
       {{"clearance", "x", kNonNegative}, {"stiffness", "F/x", kAny, true}},
       make_law<DeadZoneSpring>},
      {"ripple",
       "torque ripple, cogging, transmission error: f = a sin(2 pi z/period + phase)",
       kForce,
       {{"amplitude", "F", kAny, true}, {"period", "x", kPositive}, {"phase", "rad", kAny}},
       make_law<Ripple>},
      {"balancer",
       "gravity balancer: a spring from an anchor to a lever on the axis",
       kForce,
       {{.name = "stiffness",
         .unit = "N/m",
         .range = kPositive,
         .is_linear = true,
         .is_relative = true},
        {.name = "free_length", .unit = "m", .range = kNonNegative, .is_relative = true},
        {.name = "anchor_distance", .unit = "m", .range = kPositive, .sets_scale = true},
        {.name = "lever_length", .unit = "m", .range = kPositive, .is_relative = true},
        {"anchor_angle", "rad", kAny}},
       make_law<Balancer>},
      {"gravity",
       "weight of a mass off the axis: f = s sin z + c cos z",
       kForce,
       {{"sine", "F", kAny, true}, {"cosine", "F", kAny, true}},
       make_law<GravityTorque>},
      {"offset", "constant: f = c", kForce, {{"value", "F", kAny, true}}, make_law<Offset>},
  };
}

std::vector<LawEntry> supplementary_spring_laws() {
  using enum ParameterRange;
  return {
      {"gas_balancer",
       "gravity balancer with a gas spring: F = F_0 (1 - s/g)^-n at the stroke s",
       LawUse::kForce,
       {{.name = "force", .unit = "N", .range = kPositive, .is_linear = true, .is_relative = true},
        {.name = "gas_length", .unit = "m", .range = kPositive, .is_relative = true},
        {"exponent", "1", kPositive},
        {.name = "anchor_distance", .unit = "m", .range = kPositive, .sets_scale = true},
        {.name = "lever_length", .unit = "m", .range = kPositive, .is_relative = true},
        {"anchor_angle", "rad", kAny}},
       make_law<GasBalancer>}};
}

}  // namespace graybox
