#include "bench/challenge/lumped_case.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "diagnosis/signals/multisine.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/mechanisms/lumped_model.hpp"

namespace graybox::bench {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kGround = -1;

// A spring or damper between two masses, or a mass and the ground.
struct Part {
  std::string name;
  bool is_spring = true;
  Index mass = 0, other = kGround;
  double value = 0.0;
};

struct LumpedDesign {
  bool rotates = true;
  std::vector<std::string> mass_names;
  std::vector<double> masses;
  std::vector<Part> parts;
  std::vector<Index> driven;    // masses with an input
  std::vector<Index> measured;  // masses with an output
  bool measures_velocity = true;
  std::optional<PiController> controller;
  std::vector<double> levels;
  double from = 1.0, to = 50.0;  // Hz
};

double log_uniform(Random& random, double from, double to) {
  return from * std::pow(to / from, random.uniform());
}

PiController pi(double proportional, double integral_time) {
  return {VectorXd::Constant(1, proportional), VectorXd::Constant(1, integral_time)};
}

LumpedDesign one_mass(Random& random) {
  LumpedDesign design;
  const double inertia = log_uniform(random, 1e-3, 1e-2);
  design.mass_names = {"rotor"};
  design.masses = {inertia};
  design.parts = {{"bearing", false, 0, kGround, inertia * random.uniform(1.0, 3.0)}};
  design.driven = design.measured = {0};
  design.controller = pi(inertia * random.uniform(40.0, 80.0), random.uniform(0.05, 0.15));
  design.levels = {2.0, 8.0, 4.0};
  return design;
}

LumpedDesign two_mass(Random& random) {
  LumpedDesign design;
  const double motor = log_uniform(random, 1e-3, 5e-3), load = motor * random.uniform(2.0, 8.0);
  const double resonance = 2.0 * std::numbers::pi * random.uniform(12.0, 25.0);
  const double reduced = motor * load / (motor + load);
  design.mass_names = {"motor", "load"};
  design.masses = {motor, load};
  design.parts = {{"shaft", true, 0, 1, reduced * resonance * resonance},
                  {"shaft damping", false, 0, 1, 2.0 * 0.02 * reduced * resonance},
                  {"bearing", false, 1, kGround, load * random.uniform(0.5, 1.5)}};
  design.driven = design.measured = {0};
  design.controller = pi((motor + load) * random.uniform(15.0, 30.0), random.uniform(0.08, 0.15));
  design.levels = {1.0, 4.0, 2.0};
  return design;
}

LumpedDesign oscillator(Random& random) {
  LumpedDesign design;
  design.rotates = false;
  const double mass = log_uniform(random, 0.5, 5.0);
  const double resonance = 2.0 * std::numbers::pi * random.uniform(5.0, 12.0);
  design.mass_names = {"table"};
  design.masses = {mass};
  design.parts = {
      {"mount", true, 0, kGround, mass * resonance * resonance},
      {"mount damping", false, 0, kGround, 2.0 * random.uniform(0.03, 0.1) * mass * resonance}};
  design.driven = design.measured = {0};
  design.measures_velocity = false;
  const double level = 1e-3 * mass * resonance * resonance;
  design.levels = {0.5 * level, 2.0 * level, level};
  design.to = 30.0;
  return design;
}

LumpedDesign chain(Random& random) {
  LumpedDesign design;
  design.rotates = false;
  const double mass = log_uniform(random, 0.5, 3.0);
  const double stiffness = mass * std::pow(2.0 * std::numbers::pi * random.uniform(8.0, 14.0), 2);
  design.mass_names = {"first", "second", "third"};
  const std::vector<std::string> links{"first link", "second link"};
  for (Index i = 0; i < 3; ++i) design.masses.push_back(mass * random.uniform(0.7, 1.4));
  const auto damper = [&](double k) { return 2.0 * 0.05 * std::sqrt(k * mass); };
  design.parts = {{"mount", true, 0, kGround, stiffness * random.uniform(0.7, 1.4)}};
  for (Index i = 0; i < 2; ++i) {
    design.parts.push_back(
        {links[static_cast<std::size_t>(i)], true, i, i + 1, stiffness * random.uniform(0.7, 1.4)});
  }
  for (std::size_t i = 0; i < 3; ++i) {
    Part part = design.parts[i];
    part.name += " damping";
    part.is_spring = false;
    part.value = damper(part.value);
    design.parts.push_back(part);
  }
  design.driven = design.measured = {0, 2};
  design.measures_velocity = false;
  const double level = 1e-3 * stiffness;
  design.levels = {0.3 * level, 1.2 * level, 0.6 * level};
  design.to = 40.0;
  return design;
}

LumpedDesign draw_design(Family family, Random& random) {
  switch (family) {
    case Family::kOneMass:
      return one_mass(random);
    case Family::kTwoMass:
      return two_mass(random);
    case Family::kOscillator:
      return oscillator(random);
    default:
      return chain(random);
  }
}

class LumpedCase final : public CaseSystem {
 public:
  LumpedCase(Family family, std::uint64_t seed) {
    Random random(derived_seed(seed, {1}));
    believed_ = draw_design(family, random);
    for (double& mass : believed_.masses) mass = rounded(mass);
    for (Part& part : believed_.parts) part.value = rounded(part.value);
    true_ = believed_;
    units_ = believed_.rotates ? PlaceUnits{"N m", "rad", "kg m^2"} : PlaceUnits{"N", "m", "kg"};
    perturb(believed_.masses.size() + believed_.parts.size(), random);
    for (std::size_t i = 0; i < true_.masses.size(); ++i) {
      true_.masses[i] *= factors_[i];
      parameter_names_.push_back(true_.mass_names[i]);
    }
    for (std::size_t i = 0; i < true_.parts.size(); ++i) {
      true_.parts[i].value *= factors_[true_.masses.size() + i];
      parameter_names_.push_back(true_.parts[i].name);
    }
    controller_ = believed_.controller;
    name_channels();
    make_plan();
    draw_noise(random);
    list_places();
  }

  [[nodiscard]] std::unique_ptr<Plant> plant(const std::vector<Element>& elements,
                                             std::size_t) const override {
    const LinearDynamics linear_part = linear(0);
    LumpedModel model;
    model.name = "case";
    model.sample_time = plan_.sample_time;
    model.mass_names = true_.mass_names;
    model.mass = linear_part.mass;
    model.damping = linear_part.damping;
    model.stiffness = linear_part.stiffness;
    model.input = linear_part.input;
    model.position_output = linear_part.position_output;
    model.velocity_output = linear_part.velocity_output;
    model.input_names = channels_.inputs;
    model.output_names = channels_.outputs;
    model.elements = elements;
    return lumped_plant(model);
  }

  [[nodiscard]] LinearDynamics linear(std::size_t) const override {
    const auto n = static_cast<Index>(true_.masses.size());
    LinearDynamics result;
    result.mass = result.damping = result.stiffness = MatrixXd::Zero(n, n);
    result.rest = VectorXd::Zero(n);
    for (Index i = 0; i < n; ++i) {
      LinearDynamics::Derivative change;
      change.mass = MatrixXd::Zero(n, n);
      change.mass(i, i) = true_.masses[static_cast<std::size_t>(i)];
      result.mass += change.mass;
      result.derivatives.push_back(change);
    }
    for (const Part& part : true_.parts) {
      const VectorXd b = direction(part);
      LinearDynamics::Derivative change;
      MatrixXd& changed = part.is_spring ? change.stiffness : change.damping;
      changed = part.value * b * b.transpose();
      (part.is_spring ? result.stiffness : result.damping) += changed;
      result.derivatives.push_back(change);
    }
    result.input = MatrixXd::Zero(n, input_count());
    for (std::size_t j = 0; j < true_.driven.size(); ++j) {
      result.input(true_.driven[j], static_cast<Index>(j)) = 1.0;
    }
    result.position_output = result.velocity_output = MatrixXd::Zero(output_count(), n);
    MatrixXd& output = true_.measures_velocity ? result.velocity_output : result.position_output;
    for (std::size_t j = 0; j < true_.measured.size(); ++j) {
      output(static_cast<Index>(j), true_.measured[j]) = 1.0;
    }
    return result;
  }

  void write_model(const std::filesystem::path& folder) const override {
    write_text_file((folder / "model.yaml").string(), model_text());
  }

 private:
  // The digits that the model file has.
  static double rounded(double value) { return std::stod(fmt::format("{:.4e}", value)); }

  [[nodiscard]] VectorXd direction(const Part& part) const {
    VectorXd b = VectorXd::Unit(static_cast<Index>(true_.masses.size()), part.mass);
    if (part.other != kGround) b(part.other) = -1.0;
    return b;
  }

  void name_channels() {
    for (const Index mass : believed_.driven) {
      channels_.inputs.push_back("force_" + name_of(mass));
    }
    for (const Index mass : believed_.measured) {
      channels_.outputs.push_back((believed_.measures_velocity ? "velocity_" : "position_") +
                                  name_of(mass));
      channels_.output_units.push_back(units_.deflection +
                                       (believed_.measures_velocity ? "/s" : ""));
      if (controller_) channels_.references.push_back("reference_" + channels_.outputs.back());
    }
    channels_.input_unit = units_.force;
  }

  void make_plan() {
    plan_.sample_time = 0.001;
    plan_.period = 2000;
    plan_.settling_periods = controller_ ? 1 : 4;  // the controller damps the rest
    plan_.periods = 6;
    std::vector<double> frequencies;
    constexpr int kFrequencies = 30;
    for (int k = 0; k < kFrequencies; ++k) {
      frequencies.push_back(believed_.from *
                            std::pow(believed_.to / believed_.from, k / (kFrequencies - 1.0)));
    }
    plan_.lines = odd_lines(frequencies, plan_.period, plan_.sample_time);
    plan_.positions = {VectorXd()};
    plan_.levels = believed_.levels;
    plan_.sets = {{0, 0, 0, false}, {0, 0, 1, false}, {0, 1, 0, false},
                  {0, 1, 1, false}, {0, 1, 2, true},  {0, 2, 0, true}};
  }

  // White, 1 to 10 % of what the outputs do at the lowest level.
  void draw_noise(Random& random) {
    const double typical = believed_.measures_velocity ? believed_.levels[0] : 5e-4;
    white_noise_ = VectorXd(output_count());
    for (double& value : white_noise_) {
      value = rounded(typical * log_uniform(random, 1e-2, 1e-1));
    }
  }

  void list_places() {
    const auto n = static_cast<Index>(true_.masses.size());
    for (Index i = 0; i < n; ++i) {
      ChallengePlace place = force_place(VectorXd::Unit(n, i), name_of(i));
      place.kinds = kAxisPlace;
      place.turns = believed_.rotates;
      place.inertia_is_fitted = true;
      places_.push_back(place);
    }
    for (const Part& part : true_.parts) {
      if (!part.is_spring) continue;
      if (part.other == kGround) {
        ChallengePlace& place = places_[static_cast<std::size_t>(part.mass)];
        place.kinds |= kSpringPlace;
        place.spring = part.value;
        continue;
      }
      ChallengePlace place =
          force_place(direction(part), name_of(part.mass) + "-" + name_of(part.other));
      place.kinds = kSpringPlace;
      place.spring = part.value;
      places_.push_back(place);
    }
    for (Index j = 0; j < input_count(); ++j) {
      add_signal(j, LocationKind::kActuator, "actuator ", channels_.inputs, units_.force,
                 kActuatorPlace);
    }
    for (Index j = 0; j < output_count(); ++j) {
      add_signal(j, LocationKind::kSensor, "sensor ", channels_.outputs,
                 channels_.output_units.front(), kSensorPlace);
    }
  }

  [[nodiscard]] ChallengePlace force_place(const VectorXd& b, const std::string& name) const {
    ChallengePlace place;
    place.location.name = name;
    place.location.input = place.location.output = b;
    place.location.units = units_;
    return place;
  }

  void add_signal(Index channel, LocationKind kind, const char* noun,
                  const std::vector<std::string>& names, const std::string& unit, unsigned kinds) {
    ChallengePlace place;
    place.location.kind = kind;
    place.location.channel = channel;
    place.location.name = noun + names[static_cast<std::size_t>(channel)];
    place.location.units.force = unit;
    place.kinds = kinds;
    places_.push_back(place);
  }

  [[nodiscard]] const std::string& name_of(Index mass) const {
    return believed_.mass_names[static_cast<std::size_t>(mass)];
  }

  [[nodiscard]] std::string element_text(const Part& part) const {
    const std::string where =
        part.other == kGround
            ? "mass: " + name_of(part.mass)
            : fmt::format("between: [{}, {}]", name_of(part.mass), name_of(part.other));
    const std::string unit = unit_at(part.is_spring ? "F/x" : "F s/x", units_);
    return fmt::format(
        "  - name: {}\n    location: {{kind: element, {}}}\n    law: {}\n"
        "    parameters: {{{}: {{value: {:.4e}, unit: {}}}}}\n",
        part.name, where, part.is_spring ? "stiffness" : "viscous",
        part.is_spring ? "stiffness" : "damping", part.value, unit);
  }

  [[nodiscard]] std::string model_text() const {
    std::string text =
        fmt::format("format: graybox-lumped/1\nsample_time: {}\nmotion: {}\nmasses:\n",
                    plan_.sample_time, believed_.rotates ? "rotation" : "translation");
    for (std::size_t i = 0; i < believed_.masses.size(); ++i) {
      text += fmt::format("  {}: {:.4e}\n", believed_.mass_names[i], believed_.masses[i]);
    }
    text += "elements:\n";
    for (const Part& part : believed_.parts) text += element_text(part);
    text += "inputs:\n";
    for (std::size_t j = 0; j < believed_.driven.size(); ++j) {
      text += fmt::format("  - {{name: {}, mass: {}}}\n", channels_.inputs[j],
                          name_of(believed_.driven[j]));
    }
    text += "outputs:\n";
    for (std::size_t j = 0; j < believed_.measured.size(); ++j) {
      text += fmt::format("  - {{name: {}, mass: {}, quantity: {}}}\n", channels_.outputs[j],
                          name_of(believed_.measured[j]),
                          believed_.measures_velocity ? "velocity" : "position");
    }
    text += "noise:\n";
    for (std::size_t j = 0; j < believed_.measured.size(); ++j) {
      text +=
          fmt::format("  {}: {:.4e}\n", channels_.outputs[j], white_noise_(static_cast<Index>(j)));
    }
    if (controller_) {
      text +=
          fmt::format("controller: {{kind: pi, proportional: [{:.9e}], integral_time: [{:.9e}]}}\n",
                      controller_->proportional(0), controller_->integral_time(0));
    }
    return text;
  }

  LumpedDesign believed_, true_;
  PlaceUnits units_;
};

}  // namespace

std::unique_ptr<CaseSystem> draw_lumped_case(Family family, std::uint64_t seed) {
  return std::make_unique<LumpedCase>(family, seed);
}

}  // namespace graybox::bench
