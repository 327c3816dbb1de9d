// Laws of the deflection alone: springs, play, stops, ripple. They store energy and lose none.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "graybox/problems/elements/law_lists.hpp"

namespace graybox {
namespace {

class Stiffness final : public Law {
 public:
  explicit Stiffness(std::span<const double> p) : stiffness_(p[0]) {}
  [[nodiscard]] double force(double z, double, std::span<const double>) const override {
    return stiffness_ * z;
  }

 private:
  double stiffness_;
};

class CubicSpring final : public Law {
 public:
  explicit CubicSpring(std::span<const double> p) : stiffness_(p[0]) {}
  [[nodiscard]] double force(double z, double, std::span<const double>) const override {
    return stiffness_ * z * z * z;
  }

 private:
  double stiffness_;
};

// What turns a spring of this stiffness into one with play: -k z inside the gap.
class Backlash final : public Law {
 public:
  explicit Backlash(std::span<const double> p) : half_gap_(p[0]), stiffness_(p[1]) {}
  [[nodiscard]] double force(double z, double, std::span<const double>) const override {
    return -stiffness_ * std::clamp(z, -half_gap_, half_gap_);
  }

 private:
  double half_gap_, stiffness_;
};

class DeadZoneSpring final : public Law {
 public:
  explicit DeadZoneSpring(std::span<const double> p) : clearance_(p[0]), stiffness_(p[1]) {}
  [[nodiscard]] double force(double z, double, std::span<const double>) const override {
    return stiffness_ * (z - std::clamp(z, -clearance_, clearance_));
  }

 private:
  double clearance_, stiffness_;
};

class Ripple final : public Law {
 public:
  explicit Ripple(std::span<const double> p)
      : amplitude_(p[0]), wave_number_(2.0 * std::numbers::pi / p[1]), phase_(p[2]) {}
  [[nodiscard]] double force(double z, double, std::span<const double>) const override {
    return amplitude_ * std::sin(wave_number_ * z + phase_);
  }

 private:
  double amplitude_, wave_number_, phase_;
};

// A straight spring from an anchor at distance a of the axis to a lever of length b. With phi the
// angle between the two, its length is l = sqrt(a^2 + b^2 - 2 a b cos phi) and its torque about the
// axis (k (l - l_0)) dl/dphi, dl/dphi = a b sin(phi) / l.
class Balancer final : public Law {
 public:
  explicit Balancer(std::span<const double> p)
      : stiffness_(p[0]), free_length_(p[1]), anchor_(p[2]), lever_(p[3]), angle_(p[4]) {}
  [[nodiscard]] double force(double z, double, std::span<const double>) const override {
    const double phi = z - angle_;
    const double length =
        std::sqrt(anchor_ * anchor_ + lever_ * lever_ - 2.0 * anchor_ * lever_ * std::cos(phi));
    if (length == 0.0) return 0.0;  // spring of no length: no direction
    return stiffness_ * (length - free_length_) * anchor_ * lever_ * std::sin(phi) / length;
  }

 private:
  double stiffness_, free_length_, anchor_, lever_, angle_;
};

class Offset final : public Law {
 public:
  explicit Offset(std::span<const double> p) : value_(p[0]) {}
  [[nodiscard]] double force(double, double, std::span<const double>) const override {
    return value_;
  }

 private:
  double value_;
};

}  // namespace

std::vector<LawEntry> spring_laws() {
  using enum ParameterRange;
  constexpr auto kForce = LawUse::kForce;
  return {
      {"stiffness",
       "linear spring, or the error of one: f = k z",
       kForce,
       {{"stiffness", "F/x", kAny}},
       make_law<Stiffness>},
      {"cubic_spring",
       "hardening (k > 0) or softening (k < 0): f = k z^3",
       kForce,
       {{"stiffness", "F/x^3", kAny}},
       make_law<CubicSpring>},
      {"backlash",
       "play in a spring of stiffness k: takes k z away while |z| is within the half gap",
       kForce,
       {{"half_gap", "x", kNonNegative}, {"stiffness", "F/x", kPositive}},
       make_law<Backlash>},
      {"dead_zone",
       "spring that engages beyond a clearance c: f = k (z - clip(z, -c, c))",
       kForce,
       {{"clearance", "x", kNonNegative}, {"stiffness", "F/x", kAny}},
       make_law<DeadZoneSpring>},
      {"ripple",
       "torque ripple, cogging, transmission error: f = a sin(2 pi z/period + phase)",
       kForce,
       {{"amplitude", "F", kAny}, {"period", "x", kPositive}, {"phase", "rad", kAny}},
       make_law<Ripple>},
      {"balancer",
       "gravity balancer: a spring from an anchor to a lever on the axis",
       kForce,
       {{"stiffness", "N/m", kPositive},
        {"free_length", "m", kNonNegative},
        {"anchor_distance", "m", kPositive},
        {"lever_length", "m", kPositive},
        {"anchor_angle", "rad", kAny}},
       make_law<Balancer>},
      {"offset", "constant: f = c", kForce, {{"value", "F", kAny}}, make_law<Offset>},
  };
}

}  // namespace graybox
