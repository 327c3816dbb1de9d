#include "diagnosis/prediction_error/prediction_hypotheses.hpp"

#include <fmt/format.h>

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "diagnosis/hypotheses/law_shapes.hpp"
#include "diagnosis/hypotheses/law_trend.hpp"
#include "diagnosis/predictor/standing_mass.hpp"
#include "diagnosis/signals/coasting.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kHeld = 0.2;    // of the forces that act: a standstill that tells of friction
constexpr double kTurned = 1.0;  // rad, that tell a force of one turn from a spring

// Simple laws win among equals (prediction_search.hpp).
int complexity_of(const std::string& law, LocationKind kind) {
  if (kind != LocationKind::kElement) {
    return law == "dead_zone" || law == "curved_gain" || law == "rate_limit" ? 1 : 0;
  }
  for (const char* plain : {"viscous", "coulomb", "offset", "inertia", "gravity"}) {
    if (law == plain) return 0;
  }
  for (const char* plain : {"stiffness", "cubic_spring", "asymmetric_viscous", "quadratic_drag",
                            "dead_zone", "backlash", "driven_viscous"}) {
    if (law == plain) return 1;
  }
  return law == "dahl" || law == "bouc_wen" || law == "play_and_slip" ? 3 : 2;
}

const std::vector<std::string> kForceLaws{"viscous",
                                          "coulomb",
                                          "offset",
                                          "stiffness",
                                          "inertia",
                                          "cubic_spring",
                                          "asymmetric_viscous",
                                          "stribeck",
                                          "dead_zone",
                                          "quadratic_drag",
                                          "deflection_damping",
                                          "backlash",
                                          "gravity",
                                          "ripple",
                                          "mode",
                                          "dahl",
                                          "bouc_wen",
                                          "play_and_slip"};

// A part of the model at this place with this law.
std::optional<std::size_t> part_at(const LumpedModel& model, const Location& place,
                                   const std::string& law) {
  for (std::size_t i = 0; i < model.parts.size(); ++i) {
    const Element& part = model.parts[i];
    if (part.law_name != law || part.location.kind != place.kind) continue;
    const bool is_same =
        place.kind == LocationKind::kElement
            ? part.location.output == place.output || part.location.output == -place.output
            : part.location.channel == place.channel;
    if (is_same) return i;
  }
  return {};
}

bool is_found(const ExtendedLumpedModel& model, std::size_t part) {
  return std::ranges::any_of(model.laws,
                             [&](const PlacedFinding& law) { return law.part == part; });
}

double value_of(const ExtendedLumpedModel& model, std::size_t part, std::size_t parameter) {
  return model.model.parts[part].parameters[parameter];
}

Index mass_of(const Location& place) {
  Index mass = 0;
  place.output.cwiseAbs().maxCoeff(&mass);
  return mass;
}

std::ptrdiff_t count_of(const ExtendedLumpedModel& model, std::size_t hypothesis) {
  return std::ranges::count(model.laws, hypothesis, &PlacedFinding::hypothesis);
}

LawExtension amplitude(LawExtension plain, std::vector<double> base, std::size_t parameter,
                       double unit, bool one_sided) {
  plain.direction.assign(base.size(), 0.0);
  plain.direction[parameter] = 1.0;
  plain.fixed.resize(base.size(), false);
  plain.base = std::move(base);
  plain.unit = unit;
  plain.one_sided = one_sided;
  return plain;
}

}  // namespace

namespace {

// A known size of lengths and times alone, as a transition velocity, says nothing of forces.
bool tells_scale(const LumpedParameter& parameter) {
  return parameter.fixed && (parameter.unit.find('N') != std::string::npos ||
                             parameter.unit.find("kg") != std::string::npos);
}

bool is_rotary(const LumpedModel& model) {
  const bool has_rotary_size =
      std::ranges::any_of(model.parameters, [](const LumpedParameter& parameter) {
        return parameter.unit.find("rad") != std::string::npos || parameter.unit == "kg m^2";
      });
  return has_rotary_size || std::ranges::any_of(model.output_units, [](const std::string& unit) {
           return unit.starts_with("rad");
         });
}

}  // namespace

struct PredictionHypotheses::MotionAt {
  std::vector<double> sizes, rates;  // |z - median|, |z'|, sorted
  double range = 0.0, largest = 0.0, rms_rate = 0.0, force = 0.0;
  double lesser_way = 0.0;       // law_trend.hpp
  bool is_of_free_mass = false;  // against the ground
  [[nodiscard]] double size(double share) const { return quantile_of(sizes, share); }
  [[nodiscard]] double rate(double share) const { return quantile_of(rates, share); }
  // The slope of the force of a spring of stiffness 1 with this half gap, by least squares.
  [[nodiscard]] double transmitted(double half_gap) const {
    double product = 0.0, square = 0.0;
    for (const double size : sizes) {
      product += size * std::max(size - half_gap, 0.0);
      square += size * size;
    }
    return product / square;
  }
  static double quantile_of(const std::vector<double>& sorted, double share) {
    return sorted.empty()
               ? 0.0
               : sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1))];
  }
};

PredictionHypotheses::PredictionHypotheses(const LumpedModel& model, const PredictionData& data,
                                           const std::vector<std::string>& excluded)
    : data_(&data), excluded_(excluded) {
  const auto n = static_cast<Index>(model.mass_names.size());
  const double held = standing_drive_of_mass(model, data).held();
  if (held > kHeld * data.force_scale()) held_at_standstill_ = held;
  rotates_ = is_rotary(model);
  has_known_scale_ = std::ranges::any_of(model.parameters, tells_scale);
  measures_position_ = std::ranges::any_of(model.outputs, [](const LumpedOutput& output) {
    return output.quantity == LumpedOutput::Quantity::kPosition;
  });
  Location place;
  place.units = rotates_ ? PlaceUnits{"N m", "rad", "kg m^2"} : PlaceUnits{"N", "m", "kg"};
  place.takes_inertia = true;
  for (Index i = 0; i < n; ++i) {
    place.name = model.mass_names[static_cast<std::size_t>(i)];
    place.input = place.output = VectorXd::Unit(n, i);
    add_place(place, fmt::format("{{kind: element, mass: {}}}", place.name));
    add_driven_laws(place, i, model);
  }
  place.takes_inertia = false;
  for (const Element& part : model.parts) {
    const VectorXd& b = part.location.output;
    Index plus = 0, minus = 0;
    if (part.location.kind != LocationKind::kElement || (b.array() != 0.0).count() != 2 ||
        b.maxCoeff(&plus) != 1.0 || b.minCoeff(&minus) != -1.0) {
      continue;
    }
    const auto& names = model.mass_names;
    const std::string &to = names[static_cast<std::size_t>(plus)],
                      &from = names[static_cast<std::size_t>(minus)];
    place.name = to + "-" + from;
    place.input = place.output = b;
    const bool is_known = std::ranges::any_of(locations_, [&](const Location& other) {
      return other.output.size() == b.size() && (other.output == b || other.output == -b);
    });
    if (!is_known) add_place(place, fmt::format("{{kind: element, between: [{}, {}]}}", to, from));
  }
  for (std::size_t c = 0; c < model.inputs.size(); ++c) {
    if (model.inputs[c].kind == LumpedInput::Kind::kForce) {
      add_signal(LocationKind::kActuator, c, model);
    }
    measure_input(static_cast<Index>(c), data);
  }
  for (std::size_t c = 0; c < model.outputs.size(); ++c) {
    add_signal(LocationKind::kSensor, c, model);
  }
}

void PredictionHypotheses::add(const Location& place, const std::string& yaml,
                               const std::string& law) {
  if (std::ranges::count(excluded_, law) > 0) return;
  Hypothesis hypothesis;
  hypothesis.place = place.name;
  hypothesis.location = yaml;
  hypothesis.law = law;
  const bool is_signal = place.kind != LocationKind::kElement;
  if (!is_signal) hypothesis.special_cases = special_cases_of(*find_law(law, false), false);
  hypotheses_.push_back(std::move(hypothesis));
  locations_.push_back(place);
}

void PredictionHypotheses::add_place(const Location& place, const std::string& yaml) {
  for (const std::string& law : kForceLaws) {
    if (law == "inertia" && !place.takes_inertia) continue;
    const bool is_one_mass = (place.output.array() != 0.0).count() == 1;
    if ((law == "mode" || law == "ripple" || law == "gravity") && !is_one_mass) continue;
    // Where in its turn a recording begins is not known from velocities.
    if ((law == "ripple" || law == "gravity") && !measures_position_) continue;
    if (law == "gravity" && !rotates_) continue;
    add(place, yaml, law);
  }
}

// By the forces that drive this mass itself.
void PredictionHypotheses::add_driven_laws(const Location& mass, Index at,
                                           const LumpedModel& model) {
  for (std::size_t c = 0; c < model.inputs.size(); ++c) {
    if (model.inputs[c].kind != LumpedInput::Kind::kForce || model.inputs[c].mass != at) continue;
    Location location = mass;
    location.driver = static_cast<Index>(c);
    location.units.driver = unit_below(model.input_units[c]);
    location.takes_inertia = false;
    const std::string yaml = fmt::format("{{kind: element, mass: {}, driven_by: {{input: {}}}}}",
                                         mass.name, model.input_names[c]);
    add(location, yaml, "load_dependent_friction");
    if (coasts(model, at, static_cast<Index>(c))) add(location, yaml, "driven_viscous");
  }
}

// Whether the recordings of the fit show this mass move with this drive, and without it.
bool PredictionHypotheses::coasts(const LumpedModel& model, Index mass, Index input) const {
  using enum LumpedOutput::Quantity;
  for (std::size_t j = 0; j < model.outputs.size(); ++j) {
    const LumpedOutput& output = model.outputs[j];
    if (output.mass != mass || (output.quantity != kPosition && output.quantity != kVelocity)) {
      continue;
    }
    std::vector<CoastingMotion> motions;
    for (const OutputErrorRecording& recording : data_->recordings()) {
      if (recording.role != ExperimentRole::kEstimation) continue;
      motions.push_back({recording.inputs.col(input), recording.outputs.col(static_cast<Index>(j)),
                         output.quantity == kVelocity});
    }
    return moves_without_drive(motions);
  }
  return false;
}

void PredictionHypotheses::add_signal(LocationKind kind, std::size_t channel,
                                      const LumpedModel& model) {
  const bool is_actuator = kind == LocationKind::kActuator;
  const auto& names = is_actuator ? model.input_names : model.output_names;
  const auto& units = is_actuator ? model.input_units : model.output_units;
  Location place;
  place.kind = kind;
  place.channel = static_cast<Index>(channel);
  place.name = fmt::format("{} {}", is_actuator ? "actuator" : "sensor", names[channel]);
  place.units.force = units[channel];
  const std::string yaml = fmt::format("{{kind: {}, {}: {}}}", is_actuator ? "actuator" : "sensor",
                                       is_actuator ? "input" : "output", names[channel]);
  add(place, yaml, "lag");
  add(place, yaml, "delay");
  if (is_actuator) {
    add(place, yaml, "saturation");
    add(place, yaml, "dead_zone");
    add(place, yaml, "curved_gain");
    add(place, yaml, "rate_limit");
  } else {
    add(place, yaml, "offset");
    using enum LumpedOutput::Quantity;
    const auto quantity = model.outputs[channel].quantity;
    if (quantity != kPosition) add(place, yaml, "rectifier");  // no encoder counts without a sign
    if (quantity == kAcceleration || quantity == kVelocity) add(place, yaml, "resonance");
  }
  const bool is_told = is_actuator ? has_known_scale_ : names.size() > 1;
  if (is_told) add(place, yaml, "gain");
}

void PredictionHypotheses::measure_input(Index channel, const PredictionData& data) {
  constexpr double kLow = 0.05, kHigh = 0.9, kBetween = 0.02;  // of the peak; of the samples
  double peak = 0.0, squares = 0.0, samples = 0.0, between = 0.0;
  for (const OutputErrorRecording& recording : data.recordings()) {
    const auto column = recording.inputs.col(channel);
    peak = std::max(peak, column.cwiseAbs().maxCoeff());
    squares += column.squaredNorm();
    samples += static_cast<double>(column.size());
  }
  for (const OutputErrorRecording& recording : data.recordings()) {
    const auto sizes = recording.inputs.col(channel).array().abs();
    between += static_cast<double>((sizes > kLow * peak && sizes < kHigh * peak).count());
  }
  input_peaks_.push_back(peak);
  input_scales_.push_back(std::sqrt(squares / std::max(samples, 1.0)));
  has_sizes_between_.push_back(between > kBetween * samples);
}

std::optional<std::size_t> PredictionHypotheses::at_sensor(std::size_t output,
                                                           std::string_view law) const {
  for (std::size_t h = 0; h < hypotheses_.size(); ++h) {
    const Location& place = locations_[h];
    if (place.kind == LocationKind::kSensor && hypotheses_[h].law == law &&
        static_cast<std::size_t>(place.channel) == output) {
      return h;
    }
  }
  return {};
}

bool PredictionHypotheses::is_plain(std::size_t hypothesis) const {
  return complexity_of(hypotheses_[hypothesis].law, locations_[hypothesis].kind) == 0;
}

bool PredictionHypotheses::acts_in_moments(std::size_t hypothesis) const {
  return hypotheses_[hypothesis].law == "coulomb" || is_late_channel(hypothesis);
}

bool PredictionHypotheses::is_late_channel(std::size_t hypothesis) const {
  const std::string& law = hypotheses_[hypothesis].law;
  return law == "delay" || law == "lag";
}

double PredictionHypotheses::z_of_law(std::size_t hypothesis, const PredictionFit& poorer,
                                      const PredictionFit& richer) const {
  return is_late_channel(hypothesis) ? z_as_given(poorer, richer) : z_between(poorer, richer);
}

PredictionHypotheses::MotionAt PredictionHypotheses::motion_at(
    const Location& place, const Eigen::MatrixXd& motion) const {
  MotionAt at;
  const Index m = motion.cols() / 2;
  const VectorXd z = motion.leftCols(m) * place.input;
  const VectorXd rate = motion.rightCols(m) * place.input;
  std::vector<double> sorted(z.data(), z.data() + z.size());
  std::ranges::sort(sorted);
  const double median = MotionAt::quantile_of(sorted, 0.5);
  for (Index k = 0; k < z.size(); ++k) {
    at.sizes.push_back(std::abs(z(k) - median));
    at.rates.push_back(std::abs(rate(k)));
  }
  std::ranges::sort(at.sizes);
  std::ranges::sort(at.rates);
  at.range = z.maxCoeff() - z.minCoeff();
  at.largest = std::max(z.cwiseAbs().maxCoeff(), 1e-300);
  at.rms_rate = std::max(std::sqrt(rate.squaredNorm() / static_cast<double>(rate.size())), 1e-300);
  at.lesser_way = lesser_way(rate);
  at.force = data_->force_scale();
  return at;
}

void PredictionHypotheses::extend_friction(const LawExtension& plain,
                                           const ExtendedLumpedModel& present, const MotionAt& at,
                                           std::vector<LawExtension>& list) const {
  constexpr double kTransition = 1e-3;  // of the rms velocity
  constexpr double kImposedTransition = 0.05;
  constexpr std::array kWideTransitions{0.1, 0.4};
  constexpr double kSpeeds = 1.5;     // a motion of one speed tells no law of speeds
  constexpr double kBothWays = 0.02;  // of the squared velocity, in the direction that has less
  constexpr double kSlides = 0.6;     // of the fastest motion; what needs more is viscous
  const Location& place = plain.location;
  const LumpedModel& model = present.model;
  bool is_imposed = true;
  for (Index i = 0; i < place.output.size(); ++i) {
    is_imposed &= place.output(i) == 0.0 || model.imposed[static_cast<std::size_t>(i)];
  }
  const double transition = (is_imposed ? kImposedTransition : kTransition) * at.rms_rate;
  const auto viscous = part_at(model, place, "viscous");
  const auto coulomb = part_at(model, place, "coulomb");
  if (plain.law == "viscous" && !viscous && !part_at(model, place, "asymmetric_viscous")) {
    list.push_back(amplitude(plain, {0.0}, 0, at.force / at.rms_rate, true));
  } else if (plain.law == "coulomb" && !coulomb && !part_at(model, place, "stribeck") &&
             !part_at(model, place, "load_dependent_friction")) {
    LawExtension law = amplitude(plain, {0.0, transition}, 0, at.force, true);
    law.fixed = {false, !is_imposed};
    list.push_back(law);
    for (const double share : kWideTransitions) {  // a gradual one, that is seen
      law.base[1] = share * at.rms_rate;
      law.most = {std::numeric_limits<double>::infinity(), kSlides * at.rate(1.0)};
      law.fixed[1] = false;
      if (!is_imposed) list.push_back(law);
    }
  } else if (plain.law == "asymmetric_viscous" && viscous && at.lesser_way > kBothWays) {
    const bool found = is_found(present, *viscous);
    const double damping = found ? value_of(present, *viscous, 0) : 0.0;
    LawExtension law = amplitude(plain, {damping, damping}, 1, at.force / at.rms_rate, false);
    law.fixed = {!found, false};
    if (found) law.replaces = viscous;
    list.push_back(std::move(law));
  } else if (plain.law == "stribeck" && coulomb && is_found(present, *coulomb)) {
    const double level = value_of(present, *coulomb, 0);
    for (const double share : {0.1, 0.3}) {
      LawExtension law =
          amplitude(plain, {level, level, at.rate(share), value_of(present, *coulomb, 1)}, 1,
                    std::max(level, 1e-3 * at.force), false);
      law.fixed = {false, false, false, true};
      law.replaces = coulomb;
      if (at.rate(share) > transition) list.push_back(std::move(law));
    }
  } else if (plain.law == "load_dependent_friction" && !part_at(model, place, "stribeck")) {
    // Where it takes over from a level, that of the usual load stays what it is.
    const bool takes_over = coulomb && is_found(present, *coulomb);
    if (coulomb && !takes_over) return;
    const double load = input_scales_[static_cast<std::size_t>(place.driver)];
    if (!(load > 0.0)) return;
    const double level = takes_over ? value_of(present, *coulomb, 0) : 0.0;
    const double width = takes_over ? value_of(present, *coulomb, 1) : transition;
    LawExtension law = amplitude(plain, {level, 0.0, width}, 1, at.force / load, true);
    law.direction[0] = -load;
    law.fixed = {false, false, !is_imposed};
    if (takes_over) law.replaces = coulomb;
    list.push_back(std::move(law));
  } else if (plain.law == "driven_viscous") {
    extend_driven(plain, present, at, list);
  } else if (plain.law == "quadratic_drag" && at.rate(0.9) > kSpeeds * at.rate(0.2)) {
    list.push_back(amplitude(plain, {0.0}, 0, at.force / (at.rms_rate * at.rms_rate), true));
  } else if (plain.law == "deflection_damping" && !winds_up(place, at)) {
    list.push_back(
        amplitude(plain, {0.0}, 0, at.force / (at.rms_rate * at.largest * at.largest), true));
  }
}

// The driven damping is what the drive adds to a damping of the model itself.
void PredictionHypotheses::extend_driven(const LawExtension& plain,
                                         const ExtendedLumpedModel& present, const MotionAt& at,
                                         std::vector<LawExtension>& list) const {
  if (part_at(present.model, plain.location, "asymmetric_viscous")) return;
  const auto viscous = part_at(present.model, plain.location, "viscous");
  const bool takes_over = viscous && is_found(present, *viscous);
  const double damping = takes_over ? value_of(present, *viscous, 0) : 0.0;
  const double peak = input_peaks_[static_cast<std::size_t>(plain.location.driver)];
  LawExtension law =
      amplitude(plain, {damping, damping, kNoDrive * peak}, 0, at.force / at.rms_rate, false);
  law.fixed = {false, !takes_over, true};
  if (takes_over) law.replaces = viscous;
  list.push_back(std::move(law));
}

// A spring at a mass that goes on and on would wind up without end. Where the position is not
// measured, that is all that is known of it.
bool PredictionHypotheses::winds_up(const Location& place, const MotionAt& at) const {
  constexpr double kTwoTurns = 4.0 * std::numbers::pi;
  const bool is_one_mass = (place.output.array() != 0.0).count() == 1;
  const bool goes_on = at.lesser_way < kOneWay || (rotates_ && at.range > kTwoTurns);
  return !measures_position_ && is_one_mass && goes_on;
}

void PredictionHypotheses::extend_spring(const LawExtension& plain,
                                         const ExtendedLumpedModel& present, const MotionAt& at,
                                         std::vector<LawExtension>& list) const {
  const auto spring = part_at(present.model, plain.location, "stiffness");
  const double size = at.largest;
  if (plain.law == "offset") {
    list.push_back(amplitude(plain, {0.0}, 0, at.force, false));
  } else if (winds_up(plain.location, at)) {
    return;
  } else if (plain.law == "stiffness" && !spring) {
    list.push_back(amplitude(plain, {0.0}, 0, at.force / size, false));
  } else if (plain.law == "cubic_spring") {
    list.push_back(amplitude(plain, {0.0}, 0, at.force / (size * size * size), false));
  } else if (plain.law == "dead_zone") {
    for (const double share : {0.6, 0.9}) {
      list.push_back(amplitude(plain, {at.size(share), 0.0}, 1, at.force / size, false));
    }
  } else if (plain.law == "backlash" && spring) {
    extend_play(plain, present, *spring, at, list);
  } else if (plain.law == "gravity" && at.range > kTurned) {
    for (const std::size_t parameter : {0U, 1U}) {
      list.push_back(amplitude(plain, {0.0, 0.0}, parameter, at.force, false));
    }
  }
}

std::optional<LawExtension> PredictionHypotheses::weight_like(const ExtendedLumpedModel& present,
                                                              std::size_t spring,
                                                              const Eigen::MatrixXd& motion) const {
  const Element& part = present.model.parts[spring];
  if (part.location.kind != LocationKind::kElement || part.location.driver >= 0) return {};
  for (std::size_t h = 0; h < hypotheses_.size(); ++h) {
    if (hypotheses_[h].law != "gravity" || locations_[h].input != part.location.input) continue;
    if (part_at(present.model, locations_[h], "gravity")) return {};
    const VectorXd angle = motion.leftCols(motion.cols() / 2) * part.location.input;
    if (!(angle.maxCoeff() - angle.minCoeff() > kTurned)) return {};
    Eigen::MatrixX2d waves(angle.size(), 2);
    waves << angle.array().sin(), angle.array().cos();
    const VectorXd force = angle.unaryExpr([&](double at) { return part.law->force(at, 0.0, {}); });
    const Eigen::Vector2d sizes = waves.colPivHouseholderQr().solve(force);
    if (!sizes.allFinite()) return {};
    LawExtension weight = amplitude({}, {0.0, 0.0}, 0, 1.0, false);
    weight.hypothesis = h;
    weight.location = locations_[h];
    weight.law = "gravity";
    weight.direction = {sizes(0), sizes(1)};
    return weight;
  }
  return {};
}

// A small gap, and wide ones. A spring that was fitted without its gap came out too soft: beside a
// wide gap it starts as stiff as least squares of its force over the deflections asks for.
void PredictionHypotheses::extend_play(const LawExtension& plain,
                                       const ExtendedLumpedModel& present, std::size_t spring,
                                       const MotionAt& at, std::vector<LawExtension>& list) const {
  const double stiffness = value_of(present, spring, 0);
  if (!(stiffness > 0.0)) return;
  list.push_back(amplitude(plain, {0.0, stiffness}, 0, at.force / stiffness, true));
  const std::size_t parameter = present.first_parameter(spring);
  if (present.model.parameters[parameter].fixed) return;
  for (const double share : {0.15, 0.3, 0.5}) {
    const double half_gap = at.size(share);
    const double stiffer = stiffness / at.transmitted(half_gap);
    if (!(half_gap > 0.0) || !std::isfinite(stiffer)) continue;
    LawExtension law = amplitude(plain, {half_gap, stiffer}, 0, 1.0, true);
    law.direction[0] = 0.0;
    law.is_secant = true;
    law.own_start = {parameter, stiffer};
    list.push_back(std::move(law));
  }
}

// A second one beside one that was found, not a third. A trial each from 250 samples a period to 8.
void PredictionHypotheses::extend_modes(const LawExtension& plain,
                                        const ExtendedLumpedModel& present,
                                        std::vector<LawExtension>& list) const {
  constexpr std::ptrdiff_t kMost = 2;
  constexpr double kLowest = 0.004, kHighest = 0.12, kRatio = 1.2;  // of the sampling frequency
  constexpr double kDamping = 0.03, kMostDamping = 0.5, kMostFrequency = 0.2;
  const bool is_force = plain.location.kind == LocationKind::kElement;
  const Index mass = is_force ? mass_of(plain.location) : 0;
  const bool is_imposed = present.model.imposed[static_cast<std::size_t>(mass)];
  if (count_of(present, plain.hypothesis) >= kMost || (is_force && is_imposed)) return;
  const double unit = is_force ? present.model.masses(mass) : 1.0;
  for (double share = kLowest; share <= kHighest; share *= kRatio) {
    const double frequency = share / data_->sample_time();
    LawExtension law = amplitude(plain, {0.0, frequency, kDamping}, 0, unit, is_force);
    law.most = {std::numeric_limits<double>::infinity(), kMostFrequency / data_->sample_time(),
                kMostDamping};
    list.push_back(std::move(law));
  }
}

void PredictionHypotheses::extend_ripples(const LawExtension& plain,
                                          const ExtendedLumpedModel& present,
                                          const std::vector<RippleTrial>& ripples,
                                          std::vector<LawExtension>& list) const {
  constexpr std::ptrdiff_t kMost = 3;
  if (count_of(present, plain.hypothesis) >= kMost) return;
  for (const RippleTrial& trial : ripples) {
    if (trial.coordinate != mass_of(plain.location)) continue;
    if (rotates_ && is_about_a_turn(trial.period)) continue;  // a weight
    list.push_back(
        amplitude(plain, {0.0, trial.period, trial.phase}, 0, data_->force_scale(), false));
  }
}

void PredictionHypotheses::extend_memory(const LawExtension& plain,
                                         const ExtendedLumpedModel& present, const MotionAt& at,
                                         std::vector<LawExtension>& list) const {
  if (at.lesser_way < kOneWay) return;  // what never turns back shows no memory
  if (plain.law == "bouc_wen" && !at.is_of_free_mass) {
    extend_bouc_wen(plain, present, at, list);
  } else if (plain.law == "dahl" && !part_at(present.model, plain.location, "bouc_wen")) {
    for (const double share : {0.3, 0.6}) {
      if (!(at.size(share) > 0.0)) continue;
      LawExtension law = amplitude(plain, {0.0, 0.0}, 1, at.force, true);
      law.direction = {1.0 / at.size(share), 1.0};  // the stiffness that slips after that way
      list.push_back(std::move(law));
    }
  } else if (plain.law == "play_and_slip" && !at.is_of_free_mass) {
    for (const double gap : {0.05, 0.1, 0.2}) {
      LawExtension law =
          amplitude(plain, {0.0, 0.0, gap * at.largest, 0.0, 4.0}, 3, at.force, true);
      law.direction = {10.0 / at.largest, 1.0 / at.largest, 0.0, 1.0, 0.0};
      law.fixed = {false, false, false, false, true};
      list.push_back(std::move(law));
    }
  }
}

// Dahl's law is the Bouc-Wen law of exponent and shape 1.
void PredictionHypotheses::extend_bouc_wen(const LawExtension& plain,
                                           const ExtendedLumpedModel& present, const MotionAt& at,
                                           std::vector<LawExtension>& list) const {
  constexpr double kMostExponent = 20.0;
  const double unlimited = std::numeric_limits<double>::infinity();
  const auto add = [&](LawExtension law) {
    law.most = {unlimited, unlimited, kMostExponent, 1.0};
    list.push_back(std::move(law));
  };
  for (const double share : {0.1, 0.3, 0.6}) {
    const double yield = at.size(share);
    if (!(yield > 0.0)) continue;
    add(amplitude(plain, {0.0, yield, 1.5, 0.5}, 0, at.force / yield, true));
  }
  const auto dahl = part_at(present.model, plain.location, "dahl");
  if (!dahl || !is_found(present, *dahl)) return;
  const double stiffness = value_of(present, *dahl, 0), level = value_of(present, *dahl, 1);
  LawExtension law = amplitude(plain, {stiffness, level / stiffness, 1.0, 0.9}, 2, 1.0, false);
  law.replaces = dahl;
  add(std::move(law));
}

void PredictionHypotheses::extend_force(std::size_t hypothesis, const ExtendedLumpedModel& present,
                                        const MotionAt& at, const std::vector<RippleTrial>& ripples,
                                        std::vector<LawExtension>& list) const {
  LawExtension plain;
  plain.hypothesis = hypothesis;
  plain.location = locations_[hypothesis];
  plain.law = hypotheses_[hypothesis].law;
  plain.complexity = complexity_of(plain.law, plain.location.kind);
  if (plain.law == "mode") return extend_modes(plain, present, list);
  if (plain.law == "ripple") return extend_ripples(plain, present, ripples, list);
  if (part_at(present.model, plain.location, plain.law)) return;
  if (plain.law == "inertia") {
    Index mass = 0;
    plain.location.output.cwiseAbs().maxCoeff(&mass);
    // A mass that moves freely has an inertia among the model's own parameters.
    if (present.model.imposed[static_cast<std::size_t>(mass)] &&
        present.model.masses(mass) == 0.0) {
      const double acceleration = at.rms_rate * at.rms_rate / at.largest;
      list.push_back(amplitude(plain, {0.0}, 0, at.force / acceleration, false));
    }
    return;
  }
  MotionAt own = at;
  Index coordinate = 0;
  const bool is_single = (plain.location.output.array() != 0.0).count() == 1;
  plain.location.output.cwiseAbs().maxCoeff(&coordinate);
  own.is_of_free_mass = is_single && !present.model.imposed[static_cast<std::size_t>(coordinate)];
  extend_friction(plain, present, at, list);
  extend_spring(plain, present, at, list);
  extend_memory(plain, present, own, list);
}

void PredictionHypotheses::extend_signal(std::size_t hypothesis, const ExtendedLumpedModel& present,
                                         std::vector<LawExtension>& list) const {
  LawExtension plain;
  plain.hypothesis = hypothesis;
  plain.location = locations_[hypothesis];
  plain.law = hypotheses_[hypothesis].law;
  plain.complexity = complexity_of(plain.law, plain.location.kind);
  if (plain.law == "resonance") return extend_modes(plain, present, list);
  if (part_at(present.model, plain.location, plain.law)) return;
  const bool is_actuator = plain.location.kind == LocationKind::kActuator;
  if (is_actuator && !(input_peaks_[static_cast<std::size_t>(plain.location.channel)] > 0.0))
    return;
  // What nothing drives is the same motion later, from another start.
  const bool is_the_only_clock = data_->moves_freely() && data_->output_count() == 1;
  if (is_late_channel(hypothesis) && is_the_only_clock) return;
  const auto channel = static_cast<std::size_t>(plain.location.channel);
  const double sample_time = data_->sample_time();
  const double size =
      is_actuator ? input_scales_[channel] : data_->output_scale()(static_cast<Index>(channel));
  if (plain.law == "lag" || plain.law == "delay") {
    list.push_back(amplitude(plain, {0.0}, 0, sample_time, true));
  } else if (plain.law == "gain") {
    list.push_back(amplitude(plain, {0.0}, 0, 1.0, false));
  } else if (plain.law == "offset" || plain.law == "dead_zone") {
    list.push_back(amplitude(plain, {0.0}, 0, size, plain.law == "dead_zone"));
  } else if (plain.law == "curved_gain" && has_sizes_between_[channel]) {
    LawExtension law = amplitude(plain, {0.0, input_peaks_[channel]}, 0, 1.0, false);
    law.fixed = {false, true};
    list.push_back(std::move(law));
  } else if (plain.law == "saturation") {
    for (const double share : {0.8, 0.5, 0.3}) {
      const double limit = share * input_peaks_[channel];
      LawExtension law = amplitude(plain, {limit, 0.0}, 0, 1.0, true);
      law.direction = {0.0, 0.0};
      law.fixed = {false, true};
      law.is_secant = true;
      list.push_back(std::move(law));
    }
  } else if (plain.law == "rate_limit") {
    for (const double share : {0.3, 0.1, 0.03, 0.01}) {  // of all that it goes, a sample
      const double limit = 2.0 * share * input_peaks_[channel] / sample_time;
      LawExtension law = amplitude(plain, {limit, sample_time}, 0, 1.0, true);
      law.direction = {0.0, 0.0};
      law.fixed = {false, true};
      law.is_secant = true;
      list.push_back(std::move(law));
    }
  }
}

std::vector<LawExtension> PredictionHypotheses::extensions(
    const ExtendedLumpedModel& present, const Eigen::MatrixXd& motion,
    const std::vector<RippleTrial>& ripples) const {
  std::vector<LawExtension> list;
  for (std::size_t h = 0; h < hypotheses_.size(); ++h) {
    if (locations_[h].kind == LocationKind::kElement) {
      extend_force(h, present, motion_at(locations_[h], motion), ripples, list);
    } else {
      extend_signal(h, present, list);
    }
  }
  // Where a signal or a motion is zero throughout there is nothing to measure by.
  const auto is_finite = [](double value) { return std::isfinite(value); };
  std::erase_if(list, [&](const LawExtension& law) {
    return !std::isfinite(law.unit) || !std::ranges::all_of(law.base, is_finite) ||
           !std::ranges::all_of(law.direction, is_finite);
  });
  return list;
}

}  // namespace graybox
