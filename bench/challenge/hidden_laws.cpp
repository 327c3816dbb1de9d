#include "bench/challenge/hidden_laws.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace graybox::bench {
namespace {

using Parameters = std::span<const double>;
using State = std::span<const double>;

double rounded_abs(double x, double corner) { return std::hypot(x, corner); }

// clip(z, -limit, limit) with rounded corners.
double rounded_clip(double z, double limit, double corner) {
  return 0.5 * (rounded_abs(z + limit, corner) - rounded_abs(z - limit, corner));
}

// Laws of a challenge are simulated and never fitted, so they need no derivatives.
class SimulatedLaw : public Law {
 public:
  void differentiate(double, double, State, LawDerivatives&) const final {
    throw std::logic_error("a law of a challenge is simulated, not fitted");
  }
};

// ---- springs ------------------------------------------------------------------------------------

// A law of the deflection (or signal) alone.
template <typename Function>
class StaticLaw final : public SimulatedLaw {
 public:
  explicit StaticLaw(Function function) : function_(std::move(function)) {}
  [[nodiscard]] double force(double z, double rate, State) const override {
    return function_(z, rate);
  }

 private:
  Function function_;
};

template <typename Function>
std::shared_ptr<const Law> static_law(Function function) {
  return std::make_shared<const StaticLaw<Function>>(std::move(function));
}

std::shared_ptr<const Law> proportional(Parameters p) {
  return static_law([k = p[0]](double z, double) { return k * z; });
}

std::shared_ptr<const Law> constant(Parameters p) {
  return static_law([value = p[0]](double, double) { return value; });
}

// k z^3 and a quintic term that is `share` of it at the deflection z_r.
std::shared_ptr<const Law> hardening_spring(Parameters p) {
  return static_law([k = p[0], reference = p[1], share = p[2]](double z, double) {
    const double square = z * z;
    return k * z * square * (1.0 + share * square / (reference * reference));
  });
}

std::shared_ptr<const Law> play(Parameters p) {
  return static_law([gap = p[0], k = p[1], corner = p[2]](double z, double) {
    return -k * rounded_clip(z, gap, corner);
  });
}

std::shared_ptr<const Law> clearance_spring(Parameters p) {
  return static_law([clearance = p[0], k = p[1], corner = p[2]](double z, double) {
    return k * (z - rounded_clip(z, clearance, corner));
  });
}

// With a second harmonic.
std::shared_ptr<const Law> tooth_ripple(Parameters p) {
  return static_law(
      [amplitude = p[0], period = p[1], phase = p[2], second = p[3]](double z, double) {
        const double angle = 2.0 * std::numbers::pi * z / period + phase;
        return amplitude * (std::sin(angle) + second * std::sin(2.0 * angle));
      });
}

// The spring's pull times its lever arm, by vectors: anchor A = a (cos, sin)(angle), lever end
// B = b (cos z, sin z); torque on the lever B x (pull along A - B), its negative is the law's
// force.
std::shared_ptr<const Law> spring_balancer(Parameters p) {
  return static_law([k = p[0], free = p[1], a = p[2], b = p[3], angle = p[4]](double z, double) {
    const double anchor_x = a * std::cos(angle), anchor_y = a * std::sin(angle);
    const double end_x = b * std::cos(z), end_y = b * std::sin(z);
    const double reach_x = anchor_x - end_x, reach_y = anchor_y - end_y;
    const double length = std::hypot(reach_x, reach_y);
    const double pull = k * (length - free) / std::max(length, 1e-12);
    return -pull * (end_x * reach_y - end_y * reach_x);
  });
}

// ---- friction -----------------------------------------------------------------------------------

std::shared_ptr<const Law> damper(Parameters p) {
  return static_law([d = p[0]](double, double rate) { return d * rate; });
}

// A damping for each direction, going over into each other about rest.
std::shared_ptr<const Law> one_sided_damper(Parameters p) {
  return static_law([forward = p[0], backward = p[1], rounding = p[2]](double, double rate) {
    return 0.5 * (forward + backward) * rate +
           0.5 * (forward - backward) * (rounded_abs(rate, rounding) - rounding);
  });
}

// F (|z'|/v_r)^e sign(z') with a rounded |z'|.
std::shared_ptr<const Law> thinning_friction(Parameters p) {
  return static_law(
      [level = p[0], exponent = p[1], reference = p[2], rounding = p[3]](double, double rate) {
        const double speed = rounded_abs(rate, rounding);
        return level * rate / speed * std::pow(speed / reference, exponent);
      });
}

// c z^2 z' and a term in z^4 that is `share` of it at the deflection z_r.
std::shared_ptr<const Law> stretch_damper(Parameters p) {
  return static_law([c = p[0], reference = p[1], share = p[2]](double z, double rate) {
    const double square = z * z;
    return c * square * rate * (1.0 + share * square / (reference * reference));
  });
}

// |z'| z' with a rounded |z'|: viscous at very low speed.
std::shared_ptr<const Law> turbulent_drag(Parameters p) {
  return static_law([c = p[0], rounding = p[1]](double, double rate) {
    return c * rate * rounded_abs(rate, rounding);
  });
}

struct FrictionCurve {
  double level = 0.0, static_level = 0.0;
  double stribeck_velocity = 1.0;
  double stiffness = 1.0;  // of the bristles
  double bristle_damping = 0.0;
  double damping = 0.0;
  double wave_share = 0.0, wave_length = 1.0;  // level along the deflection
  double load_level = 0.0;                     // level over |deflection|

  [[nodiscard]] double level_at(double z, double rate) const {
    const double slow = std::exp(-std::pow(rate / stribeck_velocity, 2));
    const double wave = 1.0 + wave_share * std::sin(2.0 * std::numbers::pi * z / wave_length);
    return (level + (static_level - level) * slow) * wave + load_level * std::abs(z);
  }
};

// Bristles of deflection x: x' = z' - s |z'| x / g(z, z'). In steady sliding x = g sign(z') / s.
class BristleFriction final : public SimulatedLaw {
 public:
  explicit BristleFriction(const FrictionCurve& curve) : curve_(curve) {}
  [[nodiscard]] std::size_t state_count() const override { return 1; }
  [[nodiscard]] double force(double z, double rate, State state) const override {
    return curve_.stiffness * state[0] + curve_.bristle_damping * bristle_rate(z, rate, state[0]) +
           curve_.damping * rate;
  }
  void state_rate(double z, double rate, State state, std::span<double> change) const override {
    change[0] = bristle_rate(z, rate, state[0]);
  }

 private:
  [[nodiscard]] double bristle_rate(double z, double rate, double bristle) const {
    return rate *
           (1.0 - std::copysign(1.0, rate) * curve_.stiffness * bristle / curve_.level_at(z, rate));
  }

  FrictionCurve curve_;
};

std::shared_ptr<const Law> friction(const FrictionCurve& curve) {
  return std::make_shared<const BristleFriction>(curve);
}

// Dry friction that is nothing but that: bristles would make it Dahl's law, or LuGre's, which are
// laws of the catalogue themselves. The sign of z' is rounded.
double rounded_sign(double rate, double rounding) { return rate / rounded_abs(rate, rounding); }

std::shared_ptr<const Law> dry_friction(Parameters p) {
  return static_law([level = p[0], rounding = p[1]](double, double rate) {
    return level * rounded_sign(rate, rounding);
  });
}

std::shared_ptr<const Law> one_sided_friction(Parameters p) {
  return static_law([forward = p[0], backward = p[1], rounding = p[2]](double, double rate) {
    return 0.5 * (forward - backward) + 0.5 * (forward + backward) * rounded_sign(rate, rounding);
  });
}

std::shared_ptr<const Law> stribeck_friction(Parameters p) {
  return static_law(
      [level = p[0], resting = p[1], velocity = p[2], rounding = p[3]](double, double rate) {
        const double slow = std::exp(-std::pow(rate / velocity, 2));
        return (level + (resting - level) * slow) * rounded_sign(rate, rounding);
      });
}

std::shared_ptr<const Law> lugre_friction(Parameters p) {
  return friction({.level = p[3],
                   .static_level = p[4],
                   .stribeck_velocity = p[5],
                   .stiffness = p[0],
                   .bristle_damping = p[1],
                   .damping = p[2]});
}

std::shared_ptr<const Law> wavy_friction(Parameters p) {
  return friction({.level = p[0],
                   .static_level = p[0],
                   .stiffness = p[0] / p[3],
                   .wave_share = p[1],
                   .wave_length = p[2]});
}

// A level that grows with the deflection, so with the load a spring there carries.
std::shared_ptr<const Law> loaded_friction(Parameters p) {
  return friction({.level = p[1], .static_level = p[1], .stiffness = p[2], .load_level = p[0]});
}

// ---- memory -------------------------------------------------------------------------------------

// Dahl's law for the force itself: dF/dt = s (z' - |z'| F / F_c).
class PreslidingForce final : public SimulatedLaw {
 public:
  explicit PreslidingForce(Parameters p) : stiffness_(p[0]), level_(p[1]) {}
  [[nodiscard]] std::size_t state_count() const override { return 1; }
  [[nodiscard]] double force(double, double, State state) const override { return state[0]; }
  void state_rate(double, double rate, State state, std::span<double> change) const override {
    change[0] = stiffness_ * (rate - std::abs(rate) * state[0] / level_);
  }

 private:
  double stiffness_, level_;
};

// The normalised Bouc-Wen law for the share w of the yield force k y:
// w' = z'/y (1 - |w|^n (beta sign(z' w) + 1 - beta)).
class YieldingSpring final : public SimulatedLaw {
 public:
  explicit YieldingSpring(Parameters p)
      : yield_force_(p[0] * p[1]), yield_(p[1]), exponent_(p[2]), shape_(p[3]) {}
  [[nodiscard]] std::size_t state_count() const override { return 1; }
  [[nodiscard]] double force(double, double, State state) const override {
    return yield_force_ * state[0];
  }
  void state_rate(double, double rate, State state, std::span<double> change) const override {
    const double loading = rate * state[0] >= 0.0 ? 1.0 : 1.0 - 2.0 * shape_;
    change[0] = rate / yield_ * (1.0 - std::pow(std::abs(state[0]), exponent_) * loading);
  }

 private:
  double yield_force_, yield_, exponent_, shape_;
};

// A slider behind a spring whose slack has rounded corners. The spring's deflection x follows z but
// for the slip of the slider, which sets in as the spring's force nears the level: the share of z'
// that slips is (|f|/F_c)^n while the spring is being loaded.
class SlackSlider final : public SimulatedLaw {
 public:
  explicit SlackSlider(Parameters p)
      : stiffness_(p[0]),
        slack_(p[0] - p[1]),
        gap_(p[2]),
        level_(p[3]),
        exponent_(p[4]),
        corner_(p[5]) {}
  [[nodiscard]] std::size_t state_count() const override { return 1; }
  [[nodiscard]] double force(double, double, State state) const override {
    return stiffness_ * state[0] - slack_ * rounded_clip(state[0], gap_, corner_);
  }
  void state_rate(double z, double rate, State state, std::span<double> change) const override {
    const double pull = force(z, rate, state);
    const double slip = pull * rate > 0.0 ? std::pow(std::abs(pull) / level_, exponent_) : 0.0;
    change[0] = rate * (1.0 - slip);
  }

 private:
  double stiffness_, slack_, gap_, level_, exponent_, corner_;
};

// An absorber: m s'' = pull, its position and momentum as states.
class Absorber final : public SimulatedLaw {
 public:
  explicit Absorber(Parameters p) : inertia_(p[0]) {
    const double w = 2.0 * std::numbers::pi * p[1];
    stiffness_ = inertia_ * w * w;
    damping_ = 2.0 * p[2] * inertia_ * w;
  }
  [[nodiscard]] std::size_t state_count() const override { return 2; }
  [[nodiscard]] double force(double z, double rate, State state) const override {
    return stiffness_ * (z - state[0]) + damping_ * (rate - state[1] / inertia_);
  }
  void state_rate(double z, double rate, State state, std::span<double> change) const override {
    change[0] = state[1] / inertia_;
    change[1] = force(z, rate, state);
  }
  void rest(double z, std::span<double> state) const override {
    state[0] = z;
    state[1] = 0.0;
  }

 private:
  double inertia_, stiffness_, damping_;
};

// ---- signals ------------------------------------------------------------------------------------

std::shared_ptr<const Law> rounded_saturation(Parameters p) {
  return static_law([limit = p[0], corner = p[1]](double s, double) {
    return rounded_clip(s, limit, corner) - s;
  });
}

std::shared_ptr<const Law> rounded_dead_band(Parameters p) {
  return static_law(
      [width = p[0], corner = p[1]](double s, double) { return -rounded_clip(s, width, corner); });
}

// The signal's missing part e = s - x as seen from outside: x is what arrives.
class FirstOrderLag final : public SimulatedLaw {
 public:
  explicit FirstOrderLag(Parameters p) : rate_(1.0 / p[0]) {}
  [[nodiscard]] std::size_t state_count() const override { return 1; }
  [[nodiscard]] double force(double signal, double, State state) const override {
    return state[0] - signal;
  }
  void state_rate(double signal, double, State state, std::span<double> change) const override {
    change[0] = rate_ * (signal - state[0]);
  }
  void rest(double signal, std::span<double> state) const override { state[0] = signal; }

 private:
  double rate_;
};

// ---- what the catalogue lacks -------------------------------------------------------------------

// A stop beyond a clearance that loses energy at impact (Hunt and Crossley 1975): on penetration p,
// k p (1 + d p'), never pulling.
std::shared_ptr<const Law> impact_stop(Parameters p) {
  return static_law([clearance = p[0], k = p[1], d = p[2]](double z, double rate) {
    const double side = z >= 0.0 ? 1.0 : -1.0;
    const double depth = side * z - clearance;
    if (depth <= 0.0) return 0.0;
    return side * k * depth * std::max(0.0, 1.0 + d * side * rate);
  });
}

// Repelling magnets.
std::shared_ptr<const Law> magnetic_spring(Parameters p) {
  return static_law([k = p[0]](double z, double) { return k * std::pow(z, 5); });
}

// A stiffness that swings with time; its clock is a state.
class DriftingSpring final : public SimulatedLaw {
 public:
  explicit DriftingSpring(Parameters p) : stiffness_(p[0]), rate_(2.0 * std::numbers::pi / p[1]) {}
  [[nodiscard]] std::size_t state_count() const override { return 1; }
  [[nodiscard]] double force(double z, double, State state) const override {
    return stiffness_ * std::sin(rate_ * state[0]) * z;
  }
  void state_rate(double, double, State, std::span<double> change) const override {
    change[0] = 1.0;
  }

 private:
  double stiffness_, rate_;
};

template <typename Kind>
std::shared_ptr<const Law> make(Parameters p) {
  return std::make_shared<const Kind>(p);
}

// ---- the list -----------------------------------------------------------------------------------

using Shape = std::span<const double>;

double between(double from, double to, double share) { return from + (to - from) * share; }
double log_between(double from, double to, double share) {
  return from * std::pow(to / from, share);
}
double sign_of(double share) { return share < 0.5 ? -1.0 : 1.0; }

// A deflection that a law with a threshold sees: motion and, under load, its mean.
double reach(const PlaceScale& scale) { return std::hypot(scale.deflection, scale.offset); }

// Presliding ends early in each swing.
double bristle_deflection(const PlaceScale& scale) { return 0.02 * scale.deflection; }

std::vector<HiddenLaw> hidden_springs() {
  constexpr auto kForce = LawUse::kForce;
  constexpr unsigned kSpring = kSpringPlace, kAxis = kAxisPlace, kCoupling = kCouplingPlace;
  return {
      {"stiffness",
       kForce,
       true,
       kAxis | kCoupling,
       false,
       1.0,
       {{"stiffness", "F/x"}},
       proportional,
       [](double size, const PlaceScale& scale, Shape shape) {
         return std::vector{sign_of(shape[0]) * size * scale.force / scale.deflection};
       }},
      {"cubic_spring",
       kForce,
       true,
       kSpring,
       false,
       1.0,
       {{"stiffness", "F/x^3"}, {"higher_term_at", "x", false}, {"higher_term", "1", false}},
       hardening_spring,
       [](double size, const PlaceScale& scale, Shape shape) {
         const double z = reach(scale);
         const double direction = shape[0] < 0.25 ? -0.3 : 1.0;  // softening stays short of a dip
         return std::vector{direction * size * scale.stiffness / (z * z), 3.0 * z, 0.02};
       }},
      {"backlash",
       kForce,
       true,
       kSpring,
       false,
       3.0,
       {{"half_gap", "x"}, {"stiffness", "F/x"}, {"corner", "x", false}},
       play,
       [](double size, const PlaceScale& scale, Shape) {
         const double gap = size * reach(scale);
         return std::vector{gap, scale.stiffness, 0.05 * gap};
       }},
      {"dead_zone",
       kForce,
       true,
       kSpring,
       false,
       10.0,
       {{"clearance", "x"}, {"stiffness", "F/x"}, {"corner", "x", false}},
       clearance_spring,
       [](double size, const PlaceScale& scale, Shape shape) {
         const double clearance = between(0.5, 1.2, shape[0]) * reach(scale);
         return std::vector{clearance, size * scale.stiffness, 0.05 * clearance};
       }},
  };
}

// Other forces of the position.
std::vector<HiddenLaw> hidden_position_forces() {
  constexpr auto kForce = LawUse::kForce;
  constexpr unsigned kAxis = kAxisPlace, kCoupling = kCouplingPlace;
  return {
      {"ripple",
       kForce,
       true,
       kAxis | kCoupling,
       false,
       3.0,
       {{"amplitude", "F"}, {"period", "x"}, {"phase", "rad"}, {"second_harmonic", "1", false}},
       tooth_ripple,
       [](double size, const PlaceScale& scale, Shape shape) {
         const double wanted = between(2.0, 5.0, shape[0]) * scale.deflection;
         const double turn = 2.0 * std::numbers::pi;
         const double period =
             scale.turns ? turn / std::max(1.0, std::round(turn / wanted)) : wanted;
         return std::vector{size * scale.force, period, between(-3.0, 3.0, shape[1]), 0.02};
       }},
      {"balancer",
       kForce,
       true,
       kAxis,
       true,
       10.0,
       {{"stiffness", "N/m"},
        {"free_length", "m"},
        {"anchor_distance", "m"},
        {"lever_length", "m"},
        {"anchor_angle", "rad"}},
       spring_balancer,
       [](double size, const PlaceScale& scale, Shape shape) {
         const double anchor = between(0.3, 0.6, shape[0]), lever = between(0.15, 0.3, shape[1]);
         return std::vector{size * scale.force / scale.deflection / (anchor * lever),
                            between(0.1, 0.3, shape[2]), anchor, lever,
                            between(-3.0, 3.0, shape[3])};
       }},
      {"offset",
       kForce,
       true,
       kAxis,
       false,
       3.0,
       {{"value", "F"}},
       constant,
       [](double size, const PlaceScale& scale, Shape shape) {
         return std::vector{sign_of(shape[0]) * size * scale.force};
       }},
  };
}

// Forces of a velocity that grow smoothly from rest.
std::vector<HiddenLaw> hidden_dampers() {
  constexpr auto kForce = LawUse::kForce;
  constexpr unsigned kSpring = kSpringPlace, kAxis = kAxisPlace, kCoupling = kCouplingPlace;
  return {
      {"viscous",
       kForce,
       true,
       kAxis | kSpring | kCoupling,
       false,
       3.0,
       {{"damping", "F s/x"}},
       damper,
       [](double size, const PlaceScale& scale, Shape) {
         return std::vector{size * scale.force / scale.rate};
       }},
      {"asymmetric_viscous",
       kForce,
       true,
       kAxis,
       false,
       3.0,
       {{"forward_damping", "F s/x"}, {"backward_damping", "F s/x"}, {"rounding", "x/s", false}},
       one_sided_damper,
       [](double size, const PlaceScale& scale, Shape shape) {
         const double damping = size * scale.force / scale.rate;
         const double part = sign_of(shape[0]) * between(0.3, 0.7, shape[1]);
         return std::vector{(1.0 + part) * damping, (1.0 - part) * damping, 0.02 * scale.rate};
       }},
      {"sublinear_friction",  // its level means little without its reference velocity
       kForce,
       true,
       kAxis,
       false,
       1.0,
       {{"level", "F", false},
        {"exponent", "1"},
        {"reference_velocity", "x/s", false},
        {"rounding", "x/s", false}},
       thinning_friction,
       [](double size, const PlaceScale& scale, Shape shape) {
         return std::vector{size * scale.force, between(0.3, 0.6, shape[0]), scale.rate,
                            0.02 * scale.rate};
       }},
      {"deflection_damping",
       kForce,
       true,
       kSpring,
       false,
       3.0,
       {{"coefficient", "F s/x^3"}, {"higher_term_at", "x", false}, {"higher_term", "1", false}},
       stretch_damper,
       [](double size, const PlaceScale& scale, Shape) {
         const double z = reach(scale);
         return std::vector{size * scale.force / (scale.rate * z * z), 3.0 * z, 0.02};
       }},
  };
}

// Dry friction, and drag.
std::vector<HiddenLaw> hidden_frictions() {
  constexpr auto kForce = LawUse::kForce;
  constexpr unsigned kSpring = kSpringPlace, kAxis = kAxisPlace;
  return {
      {"coulomb",
       kForce,
       true,
       kAxis | kSpring,
       false,
       1.0,
       {{"level", "F"}, {"rounding", "x/s", false}},
       dry_friction,
       [](double size, const PlaceScale& scale, Shape) {
         return std::vector{size * scale.force, 0.01 * scale.rate};
       }},
      {"asymmetric_coulomb",
       kForce,
       true,
       kAxis,
       false,
       1.0,
       {{"forward_level", "F"}, {"backward_level", "F"}, {"rounding", "x/s", false}},
       one_sided_friction,
       [](double size, const PlaceScale& scale, Shape shape) {
         const double part = sign_of(shape[0]) * between(0.3, 0.7, shape[1]);
         return std::vector{(1.0 + part) * size * scale.force, (1.0 - part) * size * scale.force,
                            0.01 * scale.rate};
       }},
      {"stribeck",
       kForce,
       true,
       kAxis,
       false,
       1.0,
       {{"level", "F"},
        {"static_level", "F"},
        {"stribeck_velocity", "x/s"},
        {"rounding", "x/s", false}},
       stribeck_friction,
       [](double size, const PlaceScale& scale, Shape shape) {
         const double level = size * scale.force;
         return std::vector{level, between(1.5, 2.5, shape[0]) * level,
                            between(0.2, 0.6, shape[1]) * scale.rate, 0.01 * scale.rate};
       }},
      {"quadratic_drag",
       kForce,
       true,
       kAxis,
       false,
       3.0,
       {{"coefficient", "F s^2/x^2"}, {"rounding", "x/s", false}},
       turbulent_drag,
       [](double size, const PlaceScale& scale, Shape) {
         return std::vector{size * scale.force / (scale.rate * scale.rate), 0.01 * scale.rate};
       }},
  };
}

// Friction by bristles.
std::vector<HiddenLaw> hidden_bristles() {
  constexpr auto kForce = LawUse::kForce;
  constexpr unsigned kSpring = kSpringPlace, kAxis = kAxisPlace;
  return {
      {"dahl",
       kForce,
       true,
       kAxis | kSpring,
       false,
       1.0,
       {{"stiffness", "F/x"}, {"level", "F"}},
       make<PreslidingForce>,
       [](double size, const PlaceScale& scale, Shape shape) {
         const double level = size * scale.force;
         return std::vector{level / (between(0.2, 0.6, shape[0]) * scale.deflection), level};
       }},
      {"lugre",
       kForce,
       true,
       kAxis,
       false,
       1.0,
       {{"stiffness", "F/x"},
        {"bristle_damping", "F s/x"},
        {"damping", "F s/x"},
        {"level", "F"},
        {"static_level", "F"},
        {"stribeck_velocity", "x/s"}},
       lugre_friction,
       [](double size, const PlaceScale& scale, Shape shape) {
         const double level = size * scale.force;
         return std::vector{level / (between(0.1, 0.4, shape[0]) * scale.deflection),
                            0.02 * level / scale.rate,
                            between(0.1, 0.3, shape[1]) * level / scale.rate,
                            level,
                            between(1.3, 2.0, shape[2]) * level,
                            between(0.2, 0.6, shape[3]) * scale.rate};
       }},
  };
}

// Springs that yield or slip.
std::vector<HiddenLaw> hidden_yielding_springs() {
  constexpr auto kForce = LawUse::kForce;
  constexpr unsigned kSpring = kSpringPlace, kAxis = kAxisPlace;
  return {
      {"bouc_wen",
       kForce,
       true,
       kSpring,
       false,
       3.0,
       {{"stiffness", "F/x"}, {"yield", "x"}, {"exponent", "1"}, {"shape", "1"}},
       make<YieldingSpring>,
       [](double size, const PlaceScale& scale, Shape shape) {
         return std::vector{size * scale.stiffness, between(0.4, 1.0, shape[0]) * scale.deflection,
                            between(1.0, 2.0, shape[1]), between(0.5, 1.0, shape[2])};
       }},
      {"play_and_slip",
       kForce,
       true,
       kAxis | kSpring,
       false,
       1.0,
       {{"stiffness", "F/x"},
        {"play_stiffness", "F/x"},
        {"half_gap", "x"},
        {"level", "F"},
        {"exponent", "1"},
        {"corner", "x", false}},
       make<SlackSlider>,
       [](double size, const PlaceScale& scale, Shape shape) {
         const double level = size * scale.force;
         const double stiffness = level / (between(0.2, 0.5, shape[0]) * scale.deflection);
         const double gap = between(0.1, 0.3, shape[1]) * scale.deflection;
         return std::vector{stiffness,
                            between(0.1, 0.3, shape[2]) * stiffness,
                            gap,
                            level,
                            between(2.0, 6.0, shape[3]),
                            0.05 * gap};
       }},
  };
}

// Masses beside those of the model, loose or fixed.
std::vector<HiddenLaw> hidden_masses() {
  constexpr auto kForce = LawUse::kForce;
  constexpr unsigned kAxis = kAxisPlace;
  return {
      {"mode",
       kForce,
       true,
       kAxis,
       false,
       1.0,
       {{"inertia", "I"}, {"frequency", "Hz"}, {"damping_ratio", "1"}},
       make<Absorber>,
       [](double size, const PlaceScale& scale, Shape shape) {
         return std::vector{size * scale.force / scale.acceleration,
                            log_between(6.0, 40.0, shape[0]), log_between(0.01, 0.08, shape[1])};
       }},
      {"inertia",
       LawUse::kInertia,
       true,
       kAxis,
       true,
       0.5,
       {{"inertia", "I"}},
       {},
       [](double size, const PlaceScale& scale, Shape) {
         return std::vector{size * scale.force / scale.acceleration};
       }},
      {"payload",
       LawUse::kPayload,
       true,
       kFlangePlace,
       false,
       100.0,
       {{"mass", "kg"}, {"x", "m"}, {"y", "m"}, {"z", "m"}},
       {},
       [](double size, const PlaceScale&, Shape shape) {
         return std::vector{size, between(0.05, 0.3, shape[0]), between(-0.1, 0.1, shape[1]),
                            between(-0.1, 0.1, shape[2])};
       }},
  };
}

std::vector<HiddenLaw> hidden_signals() {
  constexpr auto kSignal = LawUse::kSignal;
  constexpr unsigned kBoth = unsigned{kActuatorPlace} | unsigned{kSensorPlace};
  return {
      {"gain",
       kSignal,
       true,
       kBoth,
       false,
       0.3,
       {{"error", "1"}},
       proportional,
       [](double size, const PlaceScale&, Shape shape) {
         return std::vector{sign_of(shape[0]) * size};
       }},
      {"offset",
       kSignal,
       true,
       kBoth,
       false,
       3.0,
       {{"value", "F"}},
       constant,
       [](double size, const PlaceScale& scale, Shape shape) {
         return std::vector{sign_of(shape[0]) * size * scale.force};
       }},
      {"saturation",
       kSignal,
       true,
       kBoth,
       false,
       3.0,
       {{"limit", "F"}, {"corner", "F", false}},
       rounded_saturation,
       [](double size, const PlaceScale& scale, Shape) {
         const double limit = 3.5 * scale.force * std::exp(-size);
         return std::vector{limit, 0.01 * limit};
       }},
      {"dead_zone",
       kSignal,
       true,
       kBoth,
       false,
       1.0,
       {{"half_width", "F"}, {"corner", "F", false}},
       rounded_dead_band,
       [](double size, const PlaceScale& scale, Shape) {
         const double width = size * scale.force;
         return std::vector{width, 0.05 * width};
       }},
  };
}

// Signals that come late.
std::vector<HiddenLaw> hidden_delays() {
  constexpr auto kSignal = LawUse::kSignal;
  constexpr unsigned kBoth = unsigned{kActuatorPlace} | unsigned{kSensorPlace};
  return {
      {"lag",
       kSignal,
       true,
       kBoth,
       false,
       20.0,
       {{"time_constant", "s"}},
       make<FirstOrderLag>,
       [](double size, const PlaceScale&, Shape) { return std::vector{1e-3 * size}; }},
      {"delay",
       LawUse::kDelay,
       true,
       kBoth,
       false,
       10.0,
       {{"time", "s"}},
       {},
       [](double size, const PlaceScale&, Shape) { return std::vector{1e-3 * size}; }},
  };
}

std::vector<HiddenLaw> springs_outside_the_catalogue() {
  constexpr auto kForce = LawUse::kForce;
  constexpr unsigned kSpring = kSpringPlace;
  return {
      {"impact_stop",
       kForce,
       false,
       kSpring,
       false,
       30.0,
       {{"clearance", "x", false}, {"stiffness", "F/x", false}, {"impact_damping", "s/x", false}},
       impact_stop,
       [](double size, const PlaceScale& scale, Shape shape) {
         return std::vector{between(0.8, 1.5, shape[0]) * reach(scale), size * scale.stiffness,
                            between(0.5, 1.5, shape[1]) / scale.rate};
       }},
      {"magnetic_spring",
       kForce,
       false,
       kSpring,
       false,
       1.0,
       {{"stiffness", "F/x^5", false}},
       magnetic_spring,
       [](double size, const PlaceScale& scale, Shape) {
         return std::vector{size * scale.stiffness / std::pow(reach(scale), 4)};
       }},
  };
}

// Friction that varies with position or load, and a spring that drifts.
std::vector<HiddenLaw> varying_laws_outside_the_catalogue() {
  constexpr auto kForce = LawUse::kForce;
  constexpr unsigned kSpring = kSpringPlace, kAxis = kAxisPlace;
  return {
      {"position_friction",
       kForce,
       false,
       kAxis,
       false,
       1.0,
       {{"level", "F", false},
        {"wave_share", "1", false},
        {"wave_length", "x", false},
        {"bristle_deflection", "x", false}},
       wavy_friction,
       [](double size, const PlaceScale& scale, Shape shape) {
         return std::vector{size * scale.force, between(0.7, 0.95, shape[0]),
                            between(2.0, 4.0, shape[1]) * scale.deflection,
                            bristle_deflection(scale)};
       }},
      {"load_friction",
       kForce,
       false,
       kSpring,
       false,
       0.7,
       {{"level_over_deflection", "F/x", false},
        {"least_level", "F", false},
        {"bristle_stiffness", "F/x", false}},
       loaded_friction,
       [](double size, const PlaceScale& scale, Shape) {
         const double slope = size * scale.stiffness;
         return std::vector{slope, 0.02 * slope * scale.deflection, 20.0 * slope};
       }},
      {"drifting_stiffness",
       kForce,
       false,
       kAxis | kSpring,
       false,
       0.5,
       {{"stiffness", "F/x", false}, {"time", "s", false}},
       make<DriftingSpring>,
       [](double size, const PlaceScale& scale, Shape shape) {
         return std::vector{size * scale.force / scale.deflection, between(1.3, 6.0, shape[0])};
       }},
  };
}

}  // namespace

const std::vector<HiddenLaw>& hidden_laws() {
  static const std::vector<HiddenLaw> laws = [] {
    std::vector<HiddenLaw> all;
    for (auto part :
         {hidden_springs(), hidden_position_forces(), hidden_dampers(), hidden_frictions(),
          hidden_bristles(), hidden_yielding_springs(), hidden_masses(), hidden_signals(),
          hidden_delays(), springs_outside_the_catalogue(), varying_laws_outside_the_catalogue()}) {
      std::ranges::move(part, std::back_inserter(all));
    }
    return all;
  }();
  return laws;
}

const HiddenLaw* find_hidden_law(std::string_view name, bool at_signal) {
  for (const HiddenLaw& law : hidden_laws()) {
    if (law.name == name && law.at_signal() == at_signal) return &law;
  }
  return nullptr;
}

}  // namespace graybox::bench
