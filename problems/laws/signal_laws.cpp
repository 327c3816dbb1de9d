// Laws of actuators and sensors: the signal s becomes s + f(s), or s + f(d) with a driving input d.
#include <numbers>

#include "problems/laws/formula_law.hpp"
#include "problems/laws/law_lists.hpp"

namespace graybox {
namespace {

struct GainError {
  static constexpr int kParameters = 1, kStates = 0;
  template <typename T>
  static T force(const T* p, const T& signal, const T&, const T*) {
    return p[0] * signal;
  }
};

struct SignalOffset {
  static constexpr int kParameters = 1, kStates = 0;
  template <typename T>
  static T force(const T* p, const T&, const T&, const T*) {
    return p[0];
  }
};

// The corner is a parabola from limit - corner to limit + corner, of slope one to zero. p: limit,
// corner.
struct Saturation {
  static constexpr int kParameters = 2, kStates = 0;
  template <typename T>
  static T force(const T* p, const T& signal, const T&, const T*) {
    const T corner = p[1] < p[0] ? p[1] : p[0];
    const T size = signal < 0.0 ? T(-signal) : signal;
    const T beyond = p[0] + corner - size;  // to where it holds at the limit
    if (!(corner > 0.0) || beyond <= 0.0 || beyond >= 2.0 * corner) {
      return clip(signal, p[0]) - signal;
    }
    const T held = p[0] - beyond * beyond / (4.0 * corner);
    return (signal < 0.0 ? T(-held) : held) - signal;
  }
};

struct SignalDeadZone {
  static constexpr int kParameters = 1, kStates = 0;
  template <typename T>
  static T force(const T* p, const T& signal, const T&, const T*) {
    return -clip(signal, p[0]);
  }
};

struct Feedthrough {
  static constexpr int kParameters = 1, kStates = 0;
  template <typename T>
  static T force(const T* p, const T& driving, const T&, const T*) {
    return p[0] * driving;
  }
};

struct Rectifier {
  static constexpr int kParameters = 1, kStates = 0;
  template <typename T>
  static T force(const T* p, const T& signal, const T&, const T*) {
    return signal < 0.0 ? T(-2.0 * p[0] * signal) : T(0.0);
  }
};

// The gain grows or falls in proportion to the size of s: at the reference it is 1 + curvature. p:
// curvature, reference.
struct CurvedGain {
  static constexpr int kParameters = 2, kStates = 0;
  template <typename T>
  static T force(const T* p, const T& signal, const T&, const T*) {
    const T size = signal < 0.0 ? T(-signal) : signal;
    return p[0] * size / p[1] * signal;
  }
};

// Beside s a part of what swings with it: p s'' of x'' + 2 z w x' + w^2 x = s, that is p x''. p:
// participation, frequency, damping ratio.
struct Resonance {
  static constexpr int kParameters = 3, kStates = 2;
  template <typename T>
  static T acceleration(const T* p, const T& signal, const T* x) {
    const T w = 2.0 * std::numbers::pi * p[1];
    return signal - w * (w * x[0] + 2.0 * p[2] * x[1]);
  }
  template <typename T>
  static T force(const T* p, const T& signal, const T&, const T* x) {
    return p[0] * acceleration(p, signal, x);
  }
  template <typename T>
  static void state_rate(const T* p, const T& signal, const T&, const T* x, T* change) {
    change[0] = x[1];
    change[1] = acceleration(p, signal, x);
  }
  static void rest(const double* p, double signal, double* x) {
    const double w = 2.0 * std::numbers::pi * p[1];
    x[0] = signal / (w * w);
    x[1] = 0.0;
  }
};

// The signal is replaced by x, which follows it.
struct Follower {
  static constexpr int kStates = 1;
  template <typename T>
  static T force(const T*, const T& signal, const T&, const T* x) {
    return x[0] - signal;
  }
  static void rest(const double*, double signal, double* x) { x[0] = signal; }
};

// x' = (s - x)/T.
struct Lag : Follower {
  static constexpr int kParameters = 1;
  template <typename T>
  static void state_rate(const T* p, const T& signal, const T&, const T* x, T* change) {
    change[0] = (signal - x[0]) / p[0];
  }
};

// The same, no faster than a limit. p: limit, T.
struct RateLimit : Follower {
  static constexpr int kParameters = 2;
  template <typename T>
  static void state_rate(const T* p, const T& signal, const T&, const T* x, T* change) {
    change[0] = clip(T((signal - x[0]) / p[1]), p[0]);
  }
};

}  // namespace

std::vector<LawEntry> signal_laws() {
  using enum ParameterRange;
  constexpr auto kSignal = LawUse::kSignal;
  return {
      {"gain", "s becomes (1 + error) s", kSignal, {{"error", "1", kAny}}, make_law<GainError>},
      {"offset", "s becomes s + value", kSignal, {{"value", "F", kAny}}, make_law<SignalOffset>},
      {"saturation",
       "s is held within -limit ... limit, with a parabola for a corner from corner below to "
       "corner above",
       kSignal,
       {{"limit", "F", kPositive},
        {.name = "corner", .unit = "F", .range = kNonNegative, .if_absent = 0.0}},
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

std::vector<LawEntry> supplementary_signal_laws() {
  return {
      {"feedthrough",
       "s becomes s + gain d, d an input that drives it (driven_by)",
       LawUse::kSignal,
       {{"gain", "F/x", ParameterRange::kAny}},
       make_law<Feedthrough>},
      {"rectifier",
       "s becomes s + share (|s| - s): a sensor that reads no sign where share is 1",
       LawUse::kSignal,
       {{"share", "1", ParameterRange::kAny}},
       make_law<Rectifier>},
      {"curved_gain",
       "s becomes (1 + curvature |s|/reference) s",
       LawUse::kSignal,
       {{"curvature", "1", ParameterRange::kAny},
        {.name = "reference", .unit = "F", .range = ParameterRange::kPositive, .sets_scale = true}},
       make_law<CurvedGain>},
      {"rate_limit",
       "s is replaced by x, which follows it no faster than a limit: x' = clip((s - x)/"
       "time_constant, -limit, limit)",
       LawUse::kSignal,
       {{"limit", "F/s", ParameterRange::kPositive},
        {"time_constant", "s", ParameterRange::kPositive}},
       make_law<RateLimit>},
      {"resonance",
       "s becomes s + participation x'', x'' + 2 z w x' + w^2 x = s: what swings where it is "
       "measured",
       LawUse::kSignal,
       {{"participation", "1", ParameterRange::kAny},
        {"frequency", "Hz", ParameterRange::kPositive},
        {"damping_ratio", "1", ParameterRange::kNonNegative}},
       make_law<Resonance>}};
}

}  // namespace graybox
