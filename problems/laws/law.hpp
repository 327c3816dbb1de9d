// Law: how an element answers the motion at its place,
//
//   f = f(z, z', x),   x' = g(z, z', x),
//
// z the deflection (or, at an actuator or sensor, the signal, and then z' is not used), x the law's
// internal states, if any. The catalogue and the units are in law_catalogue.hpp; where the force
// acts is the element's business (element.hpp).
//
// Laws are immutable and hold no state of their own: one law serves many threads.
#pragma once

#include <array>
#include <cstddef>
#include <span>

namespace graybox {

inline constexpr std::size_t kMaxLawStates = 2;
inline constexpr std::size_t kMaxLawParameters = 6;

// A value of a law and its partial derivatives by z, z', the states and the law's parameters.
struct LawDerivative {
  double value = 0.0;
  double by_deflection = 0.0;
  double by_rate = 0.0;
  std::array<double, kMaxLawStates> by_state{};
  std::array<double, kMaxLawParameters> by_parameter{};
};

struct LawDerivatives {
  LawDerivative force;
  std::array<LawDerivative, kMaxLawStates> state_rate;
};

// Of a law with one state.
struct StateRate {
  double value = 0.0;
  double by_state = 0.0;
};

class Law {
 public:
  virtual ~Law() = default;
  [[nodiscard]] virtual std::size_t state_count() const { return 0; }
  // `state` has state_count() numbers, here and below.
  [[nodiscard]] virtual double force(double z, double rate,
                                     std::span<const double> state) const = 0;
  virtual void state_rate(double /*z*/, double /*rate*/, std::span<const double> /*state*/,
                          std::span<double> /*state_rate*/) const {}
  // The states in which the law rests at z: x' = 0 where z' = 0, reached from x = 0 without motion.
  virtual void rest(double /*z*/, std::span<double> /*state*/) const {}
  // f and g with their derivatives, exact (at a kink those of one side). Of the arrays only the
  // entries of this law's states and parameters are written.
  virtual void differentiate(double z, double rate, std::span<const double> state,
                             LawDerivatives& result) const = 0;
  // g of a law with one state, and its slope alone: what a step in time takes.
  [[nodiscard]] virtual StateRate state_rate_and_slope(double z, double rate, double state) const {
    LawDerivatives all;
    differentiate(z, rate, {&state, 1}, all);
    return {all.state_rate[0].value, all.state_rate[0].by_state[0]};
  }
};

}  // namespace graybox
