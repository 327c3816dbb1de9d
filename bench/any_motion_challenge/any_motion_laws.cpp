#include "bench/any_motion_challenge/any_motion_laws.hpp"

#include <cmath>
#include <numbers>
#include <stdexcept>

namespace graybox::bench {
namespace {

using Shape = std::span<const double>;

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr double kRounding = 2e-4;  // of the rms rate

double between(double from, double to, double share) { return from + (to - from) * share; }

class SimulatedLaw : public Law {
 public:
  void differentiate(double, double, std::span<const double>, LawDerivatives&) const final {
    throw std::logic_error("a law of a challenge is simulated, not fitted");
  }
};

class Weight final : public SimulatedLaw {
 public:
  explicit Weight(std::span<const double> p) : sine_(p[0]), cosine_(p[1]) {}
  [[nodiscard]] double force(double z, double, std::span<const double>) const override {
    return sine_ * std::sin(z) + cosine_ * std::cos(z);
  }

 private:
  double sine_, cosine_;
};

class FadingFriction final : public SimulatedLaw {
 public:
  explicit FadingFriction(std::span<const double> p) : level_(p[0]), time_(p[1]), rounding_(p[2]) {}
  [[nodiscard]] std::size_t state_count() const override { return 1; }
  [[nodiscard]] double force(double, double rate, std::span<const double> state) const override {
    const double level = level_ * (0.3 + 0.7 * std::exp(-state[0] / time_));
    return level * rate / std::hypot(rate, rounding_);
  }
  void state_rate(double, double, std::span<const double>,
                  std::span<double> change) const override {
    change[0] = 1.0;
  }

 private:
  double level_, time_, rounding_;
};

// A law of the periodic set at other kinds of places.
HiddenLaw moved(std::string_view name, unsigned places, double largest_size,
                bool at_signal = false) {
  HiddenLaw law = *find_hidden_law(name, at_signal);
  law.places = places;
  law.largest_size = largest_size;
  return law;
}

// The last parameter of a dry friction is where its sign is rounded.
HiddenLaw dry(std::string_view name) {
  HiddenLaw law = moved(name, kAxisPlace, 1.0);
  law.parameters_of = [sizes = law.parameters_of](double size, const PlaceScale& scale,
                                                  Shape shape) {
    std::vector<double> values = sizes(size, scale, shape);
    values.back() = kRounding * scale.rate;
    return values;
  };
  return law;
}

HiddenLaw weight() {
  HiddenLaw law;
  law.name = "gravity";
  law.places = kAxisPlace;
  law.largest_size = 2.0;
  law.parameters = {{"sine", "F"}, {"cosine", "F"}};
  law.make = [](std::span<const double> p) { return std::make_shared<const Weight>(p); };
  law.parameters_of = [](double size, const PlaceScale& scale, Shape shape) {
    const double angle = kTurn * shape[0];
    return std::vector{size * scale.force * std::cos(angle), size * scale.force * std::sin(angle)};
  };
  return law;
}

// No machine has a negative spring against the ground.
HiddenLaw missing_spring() {
  HiddenLaw law = moved("stiffness", kHeldAxisPlace, 1.0);
  law.parameters_of = [](double size, const PlaceScale& scale, Shape) {
    return std::vector{size * scale.force / scale.deflection};
  };
  return law;
}

HiddenLaw cogging() {
  HiddenLaw law = moved("ripple", kAxisPlace, 1.5);
  law.parameters_of = [](double size, const PlaceScale& scale, Shape shape) {
    const double period = kTurn / std::floor(between(3.0, 13.0, shape[0]));
    return std::vector{size * scale.force, period, between(-3.0, 3.0, shape[1]), 0.02};
  };
  return law;
}

HiddenLaw fading_friction() {
  HiddenLaw law;
  law.name = "fading_friction";
  law.in_catalogue = false;
  law.places = kAxisPlace;
  law.largest_size = 1.0;
  law.parameters = {{"level", "F", false}, {"time", "s", false}, {"rounding", "x/s", false}};
  law.make = [](std::span<const double> p) { return std::make_shared<const FadingFriction>(p); };
  law.parameters_of = [](double size, const PlaceScale& scale, Shape shape) {
    return std::vector{size * scale.force, between(1.5, 4.0, shape[0]), kRounding * scale.rate};
  };
  return law;
}

// A wave of friction along the way is no longer than a turn, however far the axis runs.
HiddenLaw wavy_friction() {
  HiddenLaw law = moved("position_friction", kAxisPlace, 1.0);
  law.parameters_of = [](double size, const PlaceScale& scale, Shape shape) {
    const double bristle = std::min(0.02 * scale.deflection, 0.01);
    return std::vector{size * scale.force, between(0.7, 0.95, shape[0]),
                       std::min(between(2.0, 4.0, shape[1]) * scale.deflection,
                                between(0.3, 1.0, shape[1]) * kTurn),
                       bristle};
  };
  return law;
}

std::vector<HiddenLaw> all_laws() {
  constexpr unsigned kSignals = unsigned{kActuatorPlace} | unsigned{kSensorPlace};
  return {dry("coulomb"),
          dry("asymmetric_coulomb"),
          dry("stribeck"),
          moved("viscous", kUndampedAxisPlace, 3.0),
          moved("offset", kAxisPlace, 1.5),
          weight(),
          cogging(),
          missing_spring(),
          moved("cubic_spring", kSpringPlace, 1.0),
          moved("backlash", kSpringPlace, 3.0),
          moved("dead_zone", kSpringPlace, 10.0),
          moved("delay", kSignals, 12.0, true),
          moved("lag", kSignals, 20.0, true),
          moved("saturation", kActuatorPlace, 1.5, true),
          moved("dead_zone", kActuatorPlace, 1.0, true),
          wavy_friction(),
          fading_friction(),
          moved("load_friction", kSpringPlace, 0.7),
          moved("impact_stop", unsigned{kSpringPlace} | kHeldAxisPlace, 30.0),
          moved("drifting_stiffness", unsigned{kSpringPlace} | kHeldAxisPlace, 0.5),
          moved("magnetic_spring", unsigned{kSpringPlace} | kHeldAxisPlace, 1.0)};
}

}  // namespace

const std::vector<HiddenLaw>& any_motion_laws() {
  static const std::vector<HiddenLaw> laws = all_laws();
  return laws;
}

const HiddenLaw* find_any_motion_law(std::string_view name, bool at_signal) {
  for (const HiddenLaw& law : any_motion_laws()) {
    if (law.name == name && law.at_signal() == at_signal) return &law;
  }
  return nullptr;
}

}  // namespace graybox::bench
