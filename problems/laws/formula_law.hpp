// FormulaLaw: a Law from its formulas, written once for any number type, so that values and
// derivatives (dual numbers) come from the same lines. For the law files alone.
//
//   struct CubicSpring {
//     static constexpr int kParameters = 1, kStates = 0;
//     template <typename T>
//     static T force(const T* p, const T& z, const T&, const T*) { return p[0] * z * z * z; }
//   };
//   make_law<CubicSpring>                                        // for LawEntry::make
//
// A formula with states has state_rate(p, z, rate, x, change) too, and rest(p, z, x) where the
// states do not rest at zero.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <span>

#include "problems/laws/dual_number.hpp"
#include "problems/laws/law.hpp"

namespace graybox {

// clip(z, -limit, limit).
template <typename T>
T clip(const T& z, const T& limit) {
  if (z > limit) return limit;
  if (z < -limit) return -limit;
  return z;
}

// x^y for x > 0. The logarithm and a second power, which derivatives by y and pow() take, only
// where y has a derivative.
inline double power(double x, double y) { return std::pow(x, y); }
template <int n>
DualNumber<n> power(const DualNumber<n>& x, const DualNumber<n>& y) {
  const double value = std::pow(x.a, y.a);
  DualNumber<n> result(value);
  result.v = (value * y.a / x.a) * x.v;
  if (!y.v.isZero(0.0)) result.v += (value * std::log(x.a)) * y.v;
  return result;
}

template <typename Formula>
class FormulaLaw final : public Law {
  static constexpr int kParameters = Formula::kParameters;
  static constexpr int kStates = Formula::kStates;
  static constexpr std::size_t at(int i) { return static_cast<std::size_t>(i); }
  static_assert(kParameters <= static_cast<int>(kMaxLawParameters));
  static_assert(kStates <= static_cast<int>(kMaxLawStates));

 public:
  explicit FormulaLaw(std::span<const double> parameters) {
    std::copy_n(parameters.begin(), kParameters, parameters_.begin());
  }

  [[nodiscard]] std::size_t state_count() const override { return kStates; }

  [[nodiscard]] double force(double z, double rate, std::span<const double> state) const override {
    return Formula::force(parameters_.data(), z, rate, state.data());
  }

  void state_rate(double z, double rate, std::span<const double> state,
                  std::span<double> change) const override {
    if constexpr (kStates > 0) {
      Formula::state_rate(parameters_.data(), z, rate, state.data(), change.data());
    }
  }

  [[nodiscard]] StateRate state_rate_and_slope(double z, double rate, double state) const override {
    StateRate result;
    if constexpr (kStates == 1) {
      using Dual = DualNumber<1>;
      std::array<Dual, std::size_t{kParameters}> p;
      for (int i = 0; i < kParameters; ++i) p[at(i)] = Dual(parameters_[at(i)]);
      const Dual x(state, 0);
      Dual change;
      Formula::state_rate(p.data(), Dual(z), Dual(rate), &x, &change);
      result = {change.a, change.v[0]};
    }
    return result;
  }

  void rest(double z, std::span<double> state) const override {
    if constexpr (requires { Formula::rest(parameters_.data(), z, state.data()); }) {
      Formula::rest(parameters_.data(), z, state.data());
    }
  }

  void differentiate(double z, double rate, std::span<const double> state,
                     LawDerivatives& result) const override {
    using Dual = DualNumber<kFirstParameter + kParameters>;
    std::array<Dual, std::size_t{kParameters}> p;
    for (int i = 0; i < kParameters; ++i) {
      p[at(i)] = Dual(parameters_[at(i)], kFirstParameter + i);
    }
    std::array<Dual, kMaxLawStates> x, change;
    for (int i = 0; i < kStates; ++i) x[at(i)] = Dual(state[at(i)], 2 + i);
    const Dual deflection(z, 0), speed(rate, 1);
    write(Formula::force(p.data(), deflection, speed, x.data()), result.force);
    if constexpr (kStates > 0) {
      Formula::state_rate(p.data(), deflection, speed, x.data(), change.data());
      for (int i = 0; i < kStates; ++i) write(change[at(i)], result.state_rate[at(i)]);
    }
  }

 private:
  static constexpr int kFirstParameter = 2 + kStates;  // of a dual number's derivatives

  template <typename Dual>
  static void write(const Dual& from, LawDerivative& to) {
    to.value = from.a;
    to.by_deflection = from.v[0];
    to.by_rate = from.v[1];
    for (int i = 0; i < kStates; ++i) to.by_state[at(i)] = from.v[2 + i];
    for (int i = 0; i < kParameters; ++i) to.by_parameter[at(i)] = from.v[kFirstParameter + i];
  }

  std::array<double, std::size_t{kParameters}> parameters_{};
};

template <typename Formula>
std::shared_ptr<const Law> make_law(std::span<const double> parameters) {
  return std::make_shared<const FormulaLaw<Formula>>(parameters);
}

}  // namespace graybox
