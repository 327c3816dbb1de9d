// Laws of actuators and sensors: the signal s becomes s + f(s).
#include <algorithm>

#include "graybox/problems/elements/law_lists.hpp"

namespace graybox {
namespace {

class GainError final : public Law {
 public:
  explicit GainError(std::span<const double> p) : error_(p[0]) {}
  [[nodiscard]] double force(double signal, double, std::span<const double>) const override {
    return error_ * signal;
  }

 private:
  double error_;
};

class SignalOffset final : public Law {
 public:
  explicit SignalOffset(std::span<const double> p) : value_(p[0]) {}
  [[nodiscard]] double force(double, double, std::span<const double>) const override {
    return value_;
  }

 private:
  double value_;
};

class Saturation final : public Law {
 public:
  explicit Saturation(std::span<const double> p) : limit_(p[0]) {}
  [[nodiscard]] double force(double signal, double, std::span<const double>) const override {
    return std::clamp(signal, -limit_, limit_) - signal;
  }

 private:
  double limit_;
};

class SignalDeadZone final : public Law {
 public:
  explicit SignalDeadZone(std::span<const double> p) : half_width_(p[0]) {}
  [[nodiscard]] double force(double signal, double, std::span<const double>) const override {
    return -std::clamp(signal, -half_width_, half_width_);
  }

 private:
  double half_width_;
};

// s is replaced by x, x' = (s - x)/T.
class Lag final : public Law {
 public:
  explicit Lag(std::span<const double> p) : time_constant_(p[0]) {}
  [[nodiscard]] std::size_t state_count() const override { return 1; }
  [[nodiscard]] double force(double signal, double, std::span<const double> state) const override {
    return state[0] - signal;
  }
  void state_rate(double signal, double, std::span<const double> state,
                  std::span<double> state_rate) const override {
    state_rate[0] = (signal - state[0]) / time_constant_;
  }
  void rest(double signal, std::span<double> state) const override { state[0] = signal; }

 private:
  double time_constant_;
};

}  // namespace

std::vector<LawEntry> signal_laws() {
  using enum ParameterRange;
  constexpr auto kSignal = LawUse::kSignal;
  return {
      {"gain", "s becomes (1 + error) s", kSignal, {{"error", "1", kAny}}, make_law<GainError>},
      {"offset", "s becomes s + value", kSignal, {{"value", "F", kAny}}, make_law<SignalOffset>},
      {"saturation",
       "s is held within -limit ... limit",
       kSignal,
       {{"limit", "F", kPositive}},
       make_law<Saturation>},
      {"dead_zone",
       "s becomes s - clip(s, -half_width, half_width)",
       kSignal,
       {{"half_width", "F", kNonNegative}},
       make_law<SignalDeadZone>},
      {"lag",
       "first-order lag: x' = (s - x)/time_constant",
       kSignal,
       {{"time_constant", "s", kPositive}},
       make_law<Lag>},
      {"delay", "s comes later by a time", LawUse::kDelay, {{"time", "s", kNonNegative}}, {}},
  };
}

}  // namespace graybox
