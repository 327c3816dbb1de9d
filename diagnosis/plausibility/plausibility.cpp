#include "diagnosis/plausibility/plausibility.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "diagnosis/plausibility/law_pairs.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kReachedErrors = 3.0;  // standard errors by which a size or threshold is beyond
constexpr double kAtBound = 1e-3;       // of the bound
constexpr double kSameShare = 0.05;     // of the largest change
constexpr double kOneCombination = 0.9995;
constexpr double kWeakError = 0.2;
constexpr double kBends = 3.0;  // of the largest velocity: beyond, a friction's curve is straight

struct Remedy {
  PlausibilityRule rule;
  QuantityKind kind;  // kOther: all others
  const char* words;
};

constexpr Remedy kRemedies[] = {
    {PlausibilityRule::kSign, QuantityKind::kMass,
     "Usually a force or acceleration channel has the wrong sign or unit, or a force was not "
     "recorded."},
    {PlausibilityRule::kSign, QuantityKind::kInertia,
     "Usually a force or acceleration channel has the wrong sign or unit, or a force was not "
     "recorded."},
    {PlausibilityRule::kSign, QuantityKind::kStiffness,
     "Usually a channel has the wrong sign, or gravity or another spring is missing."},
    {PlausibilityRule::kSign, QuantityKind::kDamping,
     "Usually a channel comes late (a delay looks like negative damping) or has the wrong sign, or "
     "dry friction is missing."},
    {PlausibilityRule::kSign, QuantityKind::kFriction,
     "Usually the force or velocity has the wrong sign, or a channel comes late."},
    {PlausibilityRule::kSign, QuantityKind::kGain,
     "Usually that drive's channel has the wrong sign, gravity points elsewhere, or the bodies "
     "that "
     "the model states are not what loads this joint."},
    {PlausibilityRule::kZero, QuantityKind::kMass,
     "Record motion that shows it: faster, with more starts and stops."},
    {PlausibilityRule::kZero, QuantityKind::kInertia,
     "Record motion that shows it: faster, with more starts and stops."},
    {PlausibilityRule::kZero, QuantityKind::kOther,
     "Leave it out, or record motion that shows it."},
    {PlausibilityRule::kBound, QuantityKind::kOther,
     "Usually friction or a force is missing, or a unit is wrong: the model as given could not be "
     "fitted."},
    {PlausibilityRule::kSize, QuantityKind::kOther,
     "It stands in for something else where the motion can't tell; record larger motion, or leave "
     "the law out (--without)."},
    {PlausibilityRule::kThreshold, QuantityKind::kOther,
     "Record larger or faster motion, or leave the law out (--without)."},
    {PlausibilityRule::kEnergy, QuantityKind::kOther,
     "Usually a channel comes late or has the wrong sign."},
    {PlausibilityRule::kPair, QuantityKind::kOther,
     "Both stand in for one law that was not tried; leave one out (--without)."},
    {PlausibilityRule::kHomogeneous, QuantityKind::kOther,
     "No force or mass of known size is in the equations: state one parameter (fixed), or record a "
     "force."},
    {PlausibilityRule::kPoorInput, QuantityKind::kOther,
     "Record more frequencies or amplitudes (one sine does not tell inertia from stiffness), or "
     "state one of them."},
    {PlausibilityRule::kBody, QuantityKind::kOther,
     "Usually the motion does not show all of the body, or a force of the wrong sign or friction "
     "is in it."},
};

std::string remedy_for(PlausibilityRule rule, QuantityKind kind) {
  const char* words = "";
  for (const Remedy& remedy : kRemedies) {
    if (remedy.rule != rule) continue;
    if (remedy.kind == kind) return remedy.words;
    if (remedy.kind == QuantityKind::kOther) words = remedy.words;
  }
  return words;
}

bool has_error(const PhysicalQuantity& quantity) {
  return std::isfinite(quantity.standard_error) && quantity.standard_error > 0.0;
}

std::string unit_words(const std::string& unit) {
  return unit.empty() || unit == "1" ? "" : " " + unit;
}

constexpr double kLooseError = 0.5;  // of a value: a bound beside it says nothing

std::string value_words(const PhysicalQuantity& quantity) {
  std::string words = fmt::format("{:.3g}", quantity.value);
  if (has_error(quantity)) words += fmt::format(" ± {:.2g}", quantity.standard_error);
  return words + unit_words(quantity.unit);
}

// " (10 times the start, 0.0065 kg m^2)", where that is known.
std::string times_start_words(const PhysicalQuantity& quantity) {
  if (!std::isfinite(quantity.start) || quantity.start == 0.0) return "";
  const double times = quantity.value / quantity.start;
  if (!(times > 0.0)) return "";
  return times >= 1.0 ? fmt::format(" ({:.3g} times its start, {:.3g}{})", times, quantity.start,
                                    unit_words(quantity.unit))
                      : fmt::format(" (1/{:.3g} of its start, {:.3g}{})", 1.0 / times,
                                    quantity.start, unit_words(quantity.unit));
}

double largest_size(const std::vector<double>& values) {
  double largest = 0.0;
  for (const double value : values) largest = std::max(largest, std::abs(value));
  return largest;
}

bool must_not_be_negative(QuantityKind kind) {
  switch (kind) {
    case QuantityKind::kMass:
    case QuantityKind::kInertia:
    case QuantityKind::kStiffness:
    case QuantityKind::kDamping:
    case QuantityKind::kFriction:
    case QuantityKind::kGain:
      return true;
    default:
      return false;
  }
}

class Examination {
 public:
  Examination(const FittedPhysics& physics, const PlausibilityLimits& limits)
      : physics_(physics), limits_(limits) {}

  std::vector<Implausibility> run() {
    for (const PhysicalQuantity& quantity : physics_.quantities) {
      if (examine_sign(quantity)) continue;
      examine_bounds(quantity);
      examine_size(quantity);
      examine_threshold(quantity);
    }
    examine_energy();
    examine_pairs();
    examine_directions();
    examine_correlations();
    for (const PhysicalBody& body : physics_.bodies) examine_body(body);
    std::ranges::stable_partition(flaws_, &Implausibility::excludes);
    return std::move(flaws_);
  }

 private:
  void add(PlausibilityRule rule, const PhysicalQuantity& quantity, double standard_errors,
           std::string words, bool excludes = true) {
    flaws_.push_back({rule, quantity.name, quantity.value, standard_errors, std::move(words),
                      remedy_for(rule, quantity.kind), excludes});
  }
  void add(PlausibilityRule rule, std::string quantity, double value, std::string words) {
    flaws_.push_back({rule, std::move(quantity), value, kInfinity, std::move(words),
                      remedy_for(rule, QuantityKind::kOther), true});
  }

  // Whether it is the quantity's flaw.
  bool examine_sign(const PhysicalQuantity& quantity) {
    if (!must_not_be_negative(quantity.kind) || std::isnan(quantity.stated)) return false;
    const double total = quantity.value + quantity.stated;
    const bool is_gain = quantity.kind == QuantityKind::kGain;
    if (is_gain && !has_error(quantity)) return false;
    if (!has_error(quantity)) {
      if (total >= 0.0) return false;
      add(PlausibilityRule::kZero, quantity, 0.0,
          fmt::format("{} is not determined, negative and without a standard error: {}",
                      quantity.name, value_words(quantity)),
          false);
      return true;
    }
    const double errors = std::abs(total) / quantity.standard_error;
    if (total < 0.0 && errors > limits_.sign_errors) {
      const std::string beside =
          quantity.stated != 0.0 ? fmt::format(", {:.3g} with what the model states", total) : "";
      add(PlausibilityRule::kSign, quantity, errors,
          fmt::format("{} is negative by {:.2g} standard errors: {}{}", quantity.name, errors,
                      value_words(quantity), beside),
          !is_gain);
      return true;
    }
    if (is_gain) return false;
    if (errors < 1.0 || total < 0.0) {
      const std::string below =
          errors < 1.0 ? "" : fmt::format(" (below zero by {:.2g} standard errors)", errors);
      add(PlausibilityRule::kZero, quantity, errors,
          fmt::format("{} is not determined: {}{}", quantity.name, value_words(quantity), below),
          false);
      return true;
    }
    return false;
  }

  void examine_bounds(const PhysicalQuantity& quantity) {
    const auto is_at = [&](double bound) {
      return std::isfinite(bound) && bound != 0.0 &&
             std::abs(quantity.value - bound) <= kAtBound * std::abs(bound);
    };
    if (is_at(quantity.lowest) || is_at(quantity.highest)) {
      if (has_error(quantity) && quantity.standard_error > kLooseError * std::abs(quantity.value)) {
        add(PlausibilityRule::kZero, quantity, 0.0,
            fmt::format("{} is not determined: {}", quantity.name, value_words(quantity)), false);
        return;
      }
      add(PlausibilityRule::kBound, quantity, kInfinity,
          fmt::format("{} is at a bound of the search{}: {}", quantity.name,
                      times_start_words(quantity), value_words(quantity)));
      return;
    }
    if (!std::isfinite(quantity.start) || !(quantity.start > 0.0) || !(quantity.value > 0.0))
      return;
    const double factor = quantity.value / quantity.start;
    // Without damping or friction a model may do very well.
    const bool may_vanish = quantity.kind == QuantityKind::kDamping ||
                            quantity.kind == QuantityKind::kFriction ||
                            quantity.kind == QuantityKind::kOther;
    const bool vanished = factor < 1.0 / limits_.runaway;
    if (factor < limits_.runaway && !(vanished && !may_vanish)) return;
    // How far it ran says nothing: nothing holds it there.
    add(PlausibilityRule::kBound, quantity, kInfinity,
        vanished ? fmt::format("{} ran below 1/{:g} of what is stated, {:.3g}{}", quantity.name,
                               limits_.runaway, quantity.start, unit_words(quantity.unit))
                 : fmt::format("{} ran beyond {:g} times what is stated, {:.3g}{}", quantity.name,
                               limits_.runaway, quantity.start, unit_words(quantity.unit)));
  }

  [[nodiscard]] const LawTrace* trace_of(const PhysicalQuantity& quantity) const {
    return quantity.law < physics_.laws.size() ? &physics_.laws[quantity.law] : nullptr;
  }

  void examine_size(const PhysicalQuantity& quantity) {
    const LawTrace* trace = trace_of(quantity);
    const bool is_force =
        quantity.kind == QuantityKind::kForce || quantity.kind == QuantityKind::kFriction;
    if (!is_force || trace == nullptr || !(trace->carried > 0.0)) return;
    if (sets_rest(*trace, physics_.laws)) return;
    const double share = share_reached(quantity, *trace);
    const double size = share * std::abs(quantity.value);
    const double beyond = size - limits_.size * trace->carried;
    if (!(beyond > 0.0)) return;
    const double errors =
        has_error(quantity) ? beyond / (share * quantity.standard_error) : kInfinity;
    add(PlausibilityRule::kSize, quantity, errors,
        fmt::format("{} exceeds what was ever carried there, {:.3g}{}, {:.3g} times: {}",
                    quantity.name, trace->carried, unit_words(quantity.unit), size / trace->carried,
                    value_words(quantity)),
        errors > kReachedErrors);
  }

  // How much of a force acted: a pendulum that swings by a little shows a small part of its weight.
  // Friction is told by its level, however little of it the motion shows.
  static double share_reached(const PhysicalQuantity& quantity, const LawTrace& trace) {
    if (quantity.kind == QuantityKind::kFriction || trace.force.empty()) return 1.0;
    return std::min(1.0, largest_size(trace.force) / std::abs(quantity.value));
  }

  void examine_threshold(const PhysicalQuantity& quantity) {
    const LawTrace* trace = trace_of(quantity);
    if (trace == nullptr) return;
    const std::vector<double>* motion = quantity.kind == QuantityKind::kDeflection
                                            ? &trace->deflection
                                        : quantity.kind == QuantityKind::kRate ? &trace->rate
                                                                               : nullptr;
    if (motion == nullptr || motion->empty()) return;
    const double largest = largest_size(*motion);
    const double beyond = quantity.value - largest;
    if (!(beyond > 0.0)) return;
    // The curve of a friction bends below the velocity that it is named by: a small error is
    // earned.
    const bool is_seen = quantity.kind == QuantityKind::kRate &&
                         quantity.value < kBends * largest &&
                         quantity.standard_error < kWeakError * quantity.value;
    if (is_seen) return;
    const double errors = has_error(quantity) ? beyond / quantity.standard_error : kInfinity;
    // With no error only what is far away is sure.
    const bool is_sure =
        has_error(quantity) ? errors > kReachedErrors : quantity.value > limits_.size * largest;
    add(PlausibilityRule::kThreshold, quantity, errors,
        fmt::format("{} was never reached, the motion went to {:.3g}{}: {}", quantity.name, largest,
                    unit_words(quantity.unit), value_words(quantity)),
        is_sure);
  }

  // ---- laws along the motion --------------------------------------------------------------------

  // All laws at one place count together: dry friction may well fall with speed by a negative
  // viscous part.
  struct PlacePower {
    std::string place, names;
    std::vector<double> power;
    double fed_in = std::numeric_limits<double>::quiet_NaN();
    bool has_memory = false;
  };

  [[nodiscard]] std::vector<PlacePower> powers() const {
    std::vector<PlacePower> places;
    for (const LawTrace& law : physics_.laws) {
      if (law.force.empty() || law.force.size() != law.rate.size()) continue;
      auto known = std::ranges::find_if(places, [&](const PlacePower& each) {
        return each.place == law.place && each.power.size() == law.force.size();
      });
      if (known == places.end()) {
        known = places.insert(places.end(), {law.place, {}, std::vector<double>(law.force.size())});
      }
      known->names += (known->names.empty() ? "" : " and ") + law.name;
      known->has_memory |= law.has_memory;
      known->fed_in = law.fed_in;
      for (std::size_t t = 0; t < law.force.size(); ++t) {
        const double given_back = t < law.conservative.size() ? law.conservative[t] : 0.0;
        known->power[t] += (law.force[t] - given_back) * law.rate[t];
      }
    }
    return places;
  }

  // Whether the laws of a place may all be passive, as far as their sizes are known: none is below
  // zero by more than its error, and what the model has there itself may make up for the rest.
  [[nodiscard]] bool may_be_passive(const std::string& place) const {
    bool has_sizes = false;
    for (const PhysicalQuantity& quantity : physics_.quantities) {
      const LawTrace* trace = trace_of(quantity);
      if (trace == nullptr || trace->place != place || !must_not_be_negative(quantity.kind))
        continue;
      has_sizes = true;
      const double total = quantity.value + quantity.stated;  // NaN: something, but not how much
      if (total < 0.0 && !has_error(quantity)) return false;
      if (total < -limits_.sign_errors * quantity.standard_error) return false;
    }
    return has_sizes;
  }

  void examine_energy() {
    for (const PlacePower& place : powers()) {
      if (may_be_passive(place.place)) continue;
      double created = 0.0, taken = 0.0;
      for (const double power : place.power) (power < 0.0 ? created : taken) += std::abs(power);
      if (place.has_memory) created = std::max(0.0, created - taken);
      const auto samples = static_cast<double>(place.power.size());
      const double fed_in = place.fed_in > 0.0 ? place.fed_in * samples : created + taken;
      if (!(fed_in > 0.0) || created <= limits_.energy_share * fed_in) continue;
      add(PlausibilityRule::kEnergy, place.names, created / fed_in,
          fmt::format("{} creates energy: {:.2g} % of what is fed in at {}", place.names,
                      100.0 * created / fed_in, place.place));
    }
  }

  void examine_pairs() {
    const bool has_spring = std::ranges::any_of(physics_.quantities, [](const auto& quantity) {
      return quantity.law == PhysicalQuantity::kOfTheModel &&
             quantity.kind == QuantityKind::kStiffness;
    });
    for (std::size_t a = 0; a < physics_.laws.size(); ++a) {
      for (std::size_t b = a + 1; b < physics_.laws.size(); ++b) {
        const LawTrace &first = physics_.laws[a], &second = physics_.laws[b];
        const std::string names = first.name + " and " + second.name;
        if (cancel(first, second)) {
          add(PlausibilityRule::kPair, names, 0.0,
              names + " cancel: their sum is much smaller than each");
        } else if (!has_spring && turns_round(first, second)) {
          add(PlausibilityRule::kPair, names, 0.0,
              names + " are a spring that pulls back near the middle and pushes away at the ends");
        }
      }
    }
  }

  // ---- what the data do not tell ----------------------------------------------------------------

  void examine_directions() {
    for (const UnseenDirection& unseen : physics_.unseen) {
      const Eigen::VectorXd& change = unseen.change;
      if (change.size() < 2 || change.size() != static_cast<Index>(physics_.quantities.size())) {
        continue;
      }
      if ((change.array() - change.mean()).abs().maxCoeff() <=
          kSameShare * change.cwiseAbs().maxCoeff()) {
        add(PlausibilityRule::kHomogeneous, "all parameters", 0.0,
            "the equations are homogeneous: all parameters may be scaled together, and the data "
            "stay as they are");
        continue;
      }
      std::vector<std::size_t> members;
      for (Index p = 0; p < change.size(); ++p) {
        if (std::abs(change(p)) > kSameShare) members.push_back(static_cast<std::size_t>(p));
      }
      if (members.size() == 2) add_pair(members[0], members[1]);
    }
  }

  void examine_correlations() {
    const Eigen::MatrixXd& correlation = physics_.correlation;
    const auto count = static_cast<Index>(physics_.quantities.size());
    if (correlation.rows() != count || correlation.cols() != count) return;
    for (Index a = 0; a < count; ++a) {
      for (Index b = a + 1; b < count; ++b) {
        if (std::abs(correlation(a, b)) > kOneCombination && is_weak(a) && is_weak(b)) {
          add_pair(static_cast<std::size_t>(a), static_cast<std::size_t>(b));
        }
      }
    }
  }

  [[nodiscard]] bool is_weak(Index p) const {
    const PhysicalQuantity& quantity = physics_.quantities[static_cast<std::size_t>(p)];
    return has_error(quantity) && quantity.standard_error > kWeakError * std::abs(quantity.value);
  }

  void add_pair(std::size_t a, std::size_t b) {
    const std::string names = physics_.quantities[a].name + " and " + physics_.quantities[b].name;
    if (std::ranges::find(flaws_, names, &Implausibility::quantity) != flaws_.end()) return;
    add(PlausibilityRule::kPoorInput, names, 0.0,
        fmt::format("the recordings do not tell {} apart", names));
  }

  void examine_body(const PhysicalBody& body) {
    if (can_exist(body) || !(body.errors_from_possible > limits_.sign_errors)) return;
    flaws_.push_back({PlausibilityRule::kBody, body.name, body.mass, body.errors_from_possible,
                      fmt::format("no body has the inertia and centre of mass of {}", body.name),
                      remedy_for(PlausibilityRule::kBody, QuantityKind::kOther), true});
  }

  const FittedPhysics& physics_;
  const PlausibilityLimits& limits_;
  std::vector<Implausibility> flaws_;
};

}  // namespace

const char* words_of(QuantityKind kind) {
  switch (kind) {
    case QuantityKind::kMass:
      return "mass";
    case QuantityKind::kInertia:
      return "inertia";
    case QuantityKind::kStiffness:
      return "stiffness";
    case QuantityKind::kDamping:
      return "damping";
    case QuantityKind::kFriction:
      return "friction level";
    case QuantityKind::kGain:
      return "gain";
    case QuantityKind::kForce:
      return "force";
    case QuantityKind::kDeflection:
      return "threshold of the deflection";
    case QuantityKind::kRate:
      return "threshold of the velocity";
    case QuantityKind::kOther:
      break;
  }
  return "parameter";
}

QuantityKind quantity_kind(const std::string& name, const std::string& unit) {
  if (unit == "kg") return QuantityKind::kMass;
  if (unit == "kg m^2") return QuantityKind::kInertia;
  if (unit == "N/m" || unit == "N m/rad") return QuantityKind::kStiffness;
  if (unit == "N s/m" || unit == "N m s/rad") return QuantityKind::kDamping;
  if (unit != "N" && unit != "N m") return QuantityKind::kOther;
  return name.find("level") != std::string::npos ? QuantityKind::kFriction : QuantityKind::kForce;
}

const char* name_of(PlausibilityRule rule) {
  switch (rule) {
    case PlausibilityRule::kSign:
      return "sign";
    case PlausibilityRule::kZero:
      return "zero";
    case PlausibilityRule::kBound:
      return "bound";
    case PlausibilityRule::kSize:
      return "size";
    case PlausibilityRule::kThreshold:
      return "threshold";
    case PlausibilityRule::kEnergy:
      return "energy";
    case PlausibilityRule::kPair:
      return "pair";
    case PlausibilityRule::kHomogeneous:
      return "homogeneous";
    case PlausibilityRule::kPoorInput:
      return "poor_input";
    case PlausibilityRule::kBody:
      break;
  }
  return "body";
}

std::vector<Implausibility> implausibilities(const FittedPhysics& physics,
                                             const PlausibilityLimits& limits) {
  return Examination(physics, limits).run();
}

std::size_t excluding(std::span<const Implausibility> flaws) {
  return static_cast<std::size_t>(std::ranges::count_if(flaws, &Implausibility::excludes));
}

bool can_exist(const PhysicalBody& body, double tolerance) {
  if (!(body.mass > 0.0)) return false;
  const double trace = body.inertia.trace();
  Eigen::Matrix4d pseudo = Eigen::Matrix4d::Zero();
  pseudo.topLeftCorner<3, 3>() = 0.5 * trace * Eigen::Matrix3d::Identity() - body.inertia;
  pseudo.topRightCorner<3, 1>() = body.first_moment;
  pseudo.bottomLeftCorner<1, 3>() = body.first_moment.transpose();
  pseudo(3, 3) = body.mass;
  // A block of unit size each: metres and kilograms must not decide.
  const double length = std::sqrt(std::max(trace, 1e-300) / body.mass);
  Eigen::Vector4d scale(length, length, length, 1.0);
  pseudo = scale.cwiseInverse().asDiagonal() * pseudo * scale.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(pseudo / body.mass,
                                                              Eigen::EigenvaluesOnly);
  return solver.eigenvalues()(0) >= -tolerance;
}

}  // namespace graybox
