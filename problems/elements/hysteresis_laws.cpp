// Laws with memory: friction before sliding, hysteresis, a mode hung on the place.
#include <cmath>
#include <numbers>

#include "graybox/problems/elements/law_lists.hpp"

namespace graybox {
namespace {

// Dahl 1968: f = s x, x' = z' - s |z'| x / F_c; |f| stays below F_c.
class Dahl final : public Law {
 public:
  explicit Dahl(std::span<const double> p) : stiffness_(p[0]), level_(p[1]) {}
  [[nodiscard]] std::size_t state_count() const override { return 1; }
  [[nodiscard]] double force(double, double, std::span<const double> state) const override {
    return stiffness_ * state[0];
  }
  void state_rate(double, double rate, std::span<const double> state,
                  std::span<double> state_rate) const override {
    state_rate[0] = rate - stiffness_ * std::abs(rate) * state[0] / level_;
  }

 private:
  double stiffness_, level_;
};

// Canudas de Wit, Olsson, Astrom and Lischinsky 1995: bristles of deflection x,
//   x' = z' - s_0 |z'| x / g,  g = F_c + (F_s - F_c) exp(-(z'/v_s)^2),  f = s_0 x + s_1 x' + s_2 z'.
class LuGre final : public Law {
 public:
  explicit LuGre(std::span<const double> p)
      : stiffness_(p[0]),
        bristle_damping_(p[1]),
        damping_(p[2]),
        level_(p[3]),
        static_level_(p[4]),
        velocity_(p[5]) {}
  [[nodiscard]] std::size_t state_count() const override { return 1; }
  [[nodiscard]] double force(double, double rate, std::span<const double> state) const override {
    return stiffness_ * state[0] + bristle_damping_ * bristle_rate(rate, state[0]) +
           damping_ * rate;
  }
  void state_rate(double, double rate, std::span<const double> state,
                  std::span<double> state_rate) const override {
    state_rate[0] = bristle_rate(rate, state[0]);
  }

 private:
  [[nodiscard]] double bristle_rate(double rate, double bristle) const {
    const double slow = std::exp(-(rate / velocity_) * (rate / velocity_));
    const double level = level_ + (static_level_ - level_) * slow;
    return rate - stiffness_ * std::abs(rate) * bristle / level;
  }

  double stiffness_, bristle_damping_, damping_, level_, static_level_, velocity_;
};

// Bouc 1967, Wen 1976, normalised (Ismail, Ikhouane and Rodellar 2009): f = k x, yield at |x| = x_y,
//   x' = z' (1 - |x/x_y|^n (beta sign(z' x) + 1 - beta)).
class BoucWen final : public Law {
 public:
  explicit BoucWen(std::span<const double> p)
      : stiffness_(p[0]), yield_(p[1]), exponent_(p[2]), shape_(p[3]) {}
  [[nodiscard]] std::size_t state_count() const override { return 1; }
  [[nodiscard]] double force(double, double, std::span<const double> state) const override {
    return stiffness_ * state[0];
  }
  void state_rate(double, double rate, std::span<const double> state,
                  std::span<double> state_rate) const override {
    const double direction = rate * state[0] > 0.0 ? 1.0 : -1.0;
    const double used = std::pow(std::abs(state[0]) / yield_, exponent_);
    state_rate[0] = rate * (1.0 - used * (shape_ * direction + 1.0 - shape_));
  }

 private:
  double stiffness_, yield_, exponent_, shape_;
};

// An inertia J on a spring and damper, hung on the place: J x'' = f, f = k (z - x) + d (z' - x').
class Mode final : public Law {
 public:
  explicit Mode(std::span<const double> p)
      : inertia_(p[0]),
        stiffness_(p[0] * std::pow(2.0 * std::numbers::pi * p[1], 2)),
        damping_(2.0 * p[2] * p[0] * 2.0 * std::numbers::pi * p[1]) {}
  [[nodiscard]] std::size_t state_count() const override { return 2; }
  [[nodiscard]] double force(double z, double rate, std::span<const double> state) const override {
    return stiffness_ * (z - state[0]) + damping_ * (rate - state[1]);
  }
  void state_rate(double z, double rate, std::span<const double> state,
                  std::span<double> state_rate) const override {
    state_rate[0] = state[1];
    state_rate[1] = force(z, rate, state) / inertia_;
  }
  void rest(double z, std::span<double> state) const override {
    state[0] = z;
    state[1] = 0.0;
  }

 private:
  double inertia_, stiffness_, damping_;
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
        {"static_level", "F", kPositive},
        {"stribeck_velocity", "x/s", kPositive}},
       make_law<LuGre>},
      {"bouc_wen",
       "hysteresis: f = k x, x' = z' (1 - |x/x_y|^n (beta sign(z' x) + 1 - beta))",
       kForce,
       {{"stiffness", "F/x", kPositive},
        {"yield", "x", kPositive},
        {"exponent", "1", kPositive},
        {"shape", "1", kUnitInterval}},
       make_law<BoucWen>},
      {"mode",
       "an extra mode: an inertia on a spring and damper, hung on the place",
       kForce,
       {{"inertia", "I", kPositive},
        {"frequency", "Hz", kPositive},
        {"damping_ratio", "1", kNonNegative}},
       make_law<Mode>},
  };
}

}  // namespace graybox
