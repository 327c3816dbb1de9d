// Laws with memory: friction before sliding, hysteresis, a mode hung on the place.
#include <cmath>
#include <numbers>

#include "problems/laws/formula_law.hpp"
#include "problems/laws/law_lists.hpp"

namespace graybox {
namespace {

// Dahl 1968: f = s x, x' = z' - s |z'| x / F_c; |f| stays below F_c. p: s, F_c.
struct Dahl {
  static constexpr int kParameters = 2, kStates = 1;
  template <typename T>
  static T force(const T* p, const T&, const T&, const T* x) {
    return p[0] * x[0];
  }
  template <typename T>
  static void state_rate(const T* p, const T&, const T& rate, const T* x, T* change) {
    using std::abs;
    change[0] = rate - p[0] * abs(rate) * x[0] / p[1];
  }
};

// Canudas de Wit, Olsson, Astrom and Lischinsky 1995: bristles of deflection x,
//   x' = z' - s_0 |z'| x / g,  g = F_c + (F_s - F_c) exp(-(z'/v_s)^2),
//   f = s_0 x + s_1 x' + s_2 z'.
// p: s_0, s_1, s_2, F_c, F_s, v_s.
struct LuGre {
  static constexpr int kParameters = 6, kStates = 1;
  template <typename T>
  static T force(const T* p, const T& z, const T& rate, const T* x) {
    T bristle_rate;
    state_rate(p, z, rate, x, &bristle_rate);
    return p[0] * x[0] + p[1] * bristle_rate + p[2] * rate;
  }
  template <typename T>
  static void state_rate(const T* p, const T&, const T& rate, const T* x, T* change) {
    using std::abs;
    using std::exp;
    const T slow = exp(-(rate / p[5]) * (rate / p[5]));
    const T level = p[3] + (p[4] - p[3]) * slow;
    change[0] = rate - p[0] * abs(rate) * x[0] / level;
  }
};

// Bouc 1967, Wen 1976, normalised (Ismail, Ikhouane and Rodellar 2009): f = k x, yield at |x| =
// x_y,
//   x' = z' (1 - |x/x_y|^n (beta sign(z' x) + 1 - beta)).
// Its loops give no energy where beta is 1/2 or more (Erlicher and Point 2004), and its slope is
// bounded where n is 1 or more. p: k, x_y, n, beta.
struct BoucWen {
  static constexpr int kParameters = 4, kStates = 1;
  template <typename T>
  static T force(const T* p, const T&, const T&, const T* x) {
    return p[0] * x[0];
  }
  template <typename T>
  static void state_rate(const T* p, const T&, const T& rate, const T* x, T* change) {
    using std::abs;
    const double direction = rate * x[0] > 0.0 ? 1.0 : -1.0;
    // At x = 0 the power has no derivative by n (and for n < 1 none by x): there it is left out.
    const T used = x[0] == 0.0 ? T(0.0) : power(T(abs(x[0]) / p[1]), p[2]);
    change[0] = rate * (1.0 - used * (p[3] * direction + 1.0 - p[3]));
  }
};

// How fast the spring of a slider follows while it pulls with a force near the level at which it
// slips.
template <typename T>
T slipping_rate(const T& rate, const T& pull, const T& level, const T& exponent) {
  using std::abs;
  return rate * pull > 0.0 ? T(rate * (1.0 - power(T(abs(pull) / level), exponent))) : rate;
}

// A slider behind a spring with play: the spring's deflection x follows z until its force nears
// F_c,
//   f = k x - (k - k_p) clip(x, -h, h),   x' = z' (1 - |f/F_c|^n (1 + sign(z' f))/2).
// p: k, k_p, h, F_c, n.
struct PlayAndSlip {
  static constexpr int kParameters = 5, kStates = 1;
  template <typename T>
  static T force(const T* p, const T&, const T&, const T* x) {
    return p[0] * x[0] - (p[0] - p[1]) * clip(x[0], p[2]);
  }
  template <typename T>
  static void state_rate(const T* p, const T& z, const T& rate, const T* x, T* change) {
    change[0] = slipping_rate(rate, force(p, z, rate, x), p[3], p[4]);
  }
};

// The same with one level a direction: the play then is where the law's force is nothing, which no
// offset of a single level's force gives. p: k, k_p, h, F_+, F_-, n.
struct AsymmetricPlayAndSlip {
  static constexpr int kParameters = 6, kStates = 1;
  template <typename T>
  static T force(const T* p, const T& z, const T& rate, const T* x) {
    return PlayAndSlip::force(p, z, rate, x);
  }
  template <typename T>
  static void state_rate(const T* p, const T& z, const T& rate, const T* x, T* change) {
    const T pull = force(p, z, rate, x);
    change[0] = slipping_rate(rate, pull, pull > 0.0 ? p[3] : p[4], p[5]);
  }
};

// An inertia J on a spring and damper, hung on the place: J x'' = f, f = k (z - x) + d (z' - x').
// p: J, frequency, damping ratio.
struct Mode {
  static constexpr int kParameters = 3, kStates = 2;
  template <typename T>
  static T force(const T* p, const T& z, const T& rate, const T* x) {
    const T w = 2.0 * std::numbers::pi * p[1];
    return p[0] * w * (w * (z - x[0]) + 2.0 * p[2] * (rate - x[1]));
  }
  template <typename T>
  static void state_rate(const T* p, const T& z, const T& rate, const T* x, T* change) {
    change[0] = x[1];
    change[1] = force(p, z, rate, x) / p[0];
  }
  static void rest(const double*, double z, double* x) {
    x[0] = z;
    x[1] = 0.0;
  }
};

}  // namespace

std::vector<LawEntry> hysteresis_laws() {
  using enum ParameterRange;
  constexpr auto kForce = LawUse::kForce;
  return {
      {"dahl",
       "friction before sliding: f = s x, x' = z' - s |z'| x/F_c",
       kForce,
       {{"stiffness", "F/x", kPositive}, {"level", "F", kPositive}},
       make_law<Dahl>},
      {"lugre",
       "friction with bristles, Stribeck effect and viscous part (LuGre)",
       kForce,
       {{"stiffness", "F/x", kPositive},
        {"bristle_damping", "F s/x", kNonNegative},
        {"damping", "F s/x", kNonNegative},
        {"level", "F", kPositive},
        {.name = "static_level", .unit = "F", .range = kPositive, .at_least = "level"},
        {"stribeck_velocity", "x/s", kPositive}},
       make_law<LuGre>},
      {"bouc_wen",
       "hysteresis: f = k x, x' = z' (1 - |x/x_y|^n (beta sign(z' x) + 1 - beta))",
       kForce,
       {{"stiffness", "F/x", kPositive},
        {"yield", "x", kPositive},
        {.name = "exponent", .unit = "1", .range = kPositive, .at_least = "1"},
        {.name = "shape", .unit = "1", .range = kUnitInterval, .at_least = "0.5"}},
       make_law<BoucWen>},
      {"play_and_slip",
       "slider behind a spring with play: f = k x - (k - k_p) clip(x, -h, h), slips near F_c",
       kForce,
       {{"stiffness", "F/x", kPositive},
        {"play_stiffness", "F/x", kPositive},
        {"half_gap", "x", kNonNegative},
        {"level", "F", kPositive},
        {"exponent", "1", kPositive}},
       make_law<PlayAndSlip>},
      {"mode",
       "an extra mode: an inertia on a spring and damper, hung on the place",
       kForce,
       {{"inertia", "I", kPositive},
        {"frequency", "Hz", kPositive},
        {"damping_ratio", "1", kNonNegative}},
       make_law<Mode>},
  };
}

std::vector<LawEntry> supplementary_hysteresis_laws() {
  using enum ParameterRange;
  return {{"asymmetric_play_and_slip",
           "play_and_slip that slips near F_+ where f > 0 and near F_- where f < 0",
           LawUse::kForce,
           {{"stiffness", "F/x", kPositive},
            {"play_stiffness", "F/x", kPositive},
            {"half_gap", "x", kNonNegative},
            {"positive_level", "F", kPositive},
            {"negative_level", "F", kPositive},
            {"exponent", "1", kPositive}},
           make_law<AsymmetricPlayAndSlip>}};
}

}  // namespace graybox
