// Laws of the rate alone: friction and drag. They take energy: f z' >= 0.
//
// A friction that jumps at z' = 0 has no unique motion there; it is replaced by tanh(z'/v_t), whose
// transition velocity v_t is a parameter: small against the velocities of interest, and no smaller
// than needed, for the integrator's steps shrink with it.
#include <cmath>

#include "graybox/problems/elements/law_lists.hpp"

namespace graybox {
namespace {

class Viscous final : public Law {
 public:
  explicit Viscous(std::span<const double> p) : damping_(p[0]) {}
  [[nodiscard]] double force(double, double rate, std::span<const double>) const override {
    return damping_ * rate;
  }

 private:
  double damping_;
};

class Coulomb final : public Law {
 public:
  explicit Coulomb(std::span<const double> p) : level_(p[0]), transition_(p[1]) {}
  [[nodiscard]] double force(double, double rate, std::span<const double>) const override {
    return level_ * std::tanh(rate / transition_);
  }

 private:
  double level_, transition_;
};

class AsymmetricCoulomb final : public Law {
 public:
  explicit AsymmetricCoulomb(std::span<const double> p)
      : forward_(p[0]), backward_(p[1]), transition_(p[2]) {}
  [[nodiscard]] double force(double, double rate, std::span<const double>) const override {
    return (rate > 0.0 ? forward_ : backward_) * std::tanh(rate / transition_);
  }

 private:
  double forward_, backward_, transition_;
};

// Stribeck 1902, in the form of Armstrong-Helouvry, Dupont and Canudas de Wit 1994.
class Stribeck final : public Law {
 public:
  explicit Stribeck(std::span<const double> p)
      : level_(p[0]), static_level_(p[1]), velocity_(p[2]), transition_(p[3]) {}
  [[nodiscard]] double force(double, double rate, std::span<const double>) const override {
    const double slow = std::exp(-(rate / velocity_) * (rate / velocity_));
    return (level_ + (static_level_ - level_) * slow) * std::tanh(rate / transition_);
  }

 private:
  double level_, static_level_, velocity_, transition_;
};

class QuadraticDrag final : public Law {
 public:
  explicit QuadraticDrag(std::span<const double> p) : coefficient_(p[0]) {}
  [[nodiscard]] double force(double, double rate, std::span<const double>) const override {
    return coefficient_ * std::abs(rate) * rate;
  }

 private:
  double coefficient_;
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
  };
}

}  // namespace graybox
