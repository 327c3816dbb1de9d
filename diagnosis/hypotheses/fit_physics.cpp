#include "diagnosis/hypotheses/fit_physics.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

namespace graybox {
namespace {

constexpr double kToldFromZero = 3.0;  // standard errors, as the gate asks of a sign

bool is_signal(const Hypothesis& hypothesis) {
  return hypothesis.place.starts_with("sensor ") || hypothesis.place.starts_with("actuator ");
}

// A gap or a velocity that the motion has to pass; lengths of levers, waves and stated scales are
// none.
QuantityKind kind_of(const LawEntry& entry, const LawParameter& parameter,
                     const LawParameterEstimate& estimate) {
  if (parameter.is_relative || parameter.sets_scale) return QuantityKind::kOther;
  const bool is_wave = entry.name == "ripple";
  if (parameter.unit == "x" && !is_wave) return QuantityKind::kDeflection;
  if (parameter.unit == "x/s") return QuantityKind::kRate;
  return quantity_kind(estimate.name, estimate.unit);
}

// What the model has at the place beside a law's parameter that may be an error of it. A weight may
// make a joint topple, but not beyond a clearance.
double stated_beside(const LawEntry& entry, QuantityKind kind, const LawParameter& parameter,
                     const PhysicalContext::OfLaw* context) {
  if (parameter.range != ParameterRange::kAny) return 0.0;
  const bool is_known = context != nullptr && std::isfinite(context->stiffness);
  if (entry.name == "dead_zone" && !is_known) return 0.0;
  if (context == nullptr) return PhysicalQuantity::kNone;
  switch (kind) {
    case QuantityKind::kStiffness:
      return context->stiffness;
    case QuantityKind::kDamping:
      return context->damping;
    case QuantityKind::kMass:
    case QuantityKind::kInertia:
      return context->inertia;
    default:
      return 0.0;
  }
}

void add_model(const PhysicalContext& context, const ExtendedFit& fit, FittedPhysics& physics) {
  for (std::size_t p = 0; p < fit.model_parameters.size(); ++p) {
    const LawParameterEstimate& estimate = fit.model_parameters[p];
    PhysicalQuantity& quantity = physics.quantities.emplace_back();
    quantity.name = estimate.name;
    quantity.unit = estimate.unit;
    quantity.kind =
        p < context.kinds.size() ? context.kinds[p] : quantity_kind(estimate.name, estimate.unit);
    quantity.value = estimate.value;
    quantity.standard_error = estimate.standard_error;
    if (p < context.starts.size()) quantity.start = context.starts[p];
    if (p < context.lowest.size()) quantity.lowest = context.lowest[p];
    if (p < context.highest.size()) quantity.highest = context.highest[p];
  }
  physics.bodies = context.bodies;
}

// What the deflection alone sets is given back, and what moves a mass. The rest is taken from the
// law itself: the force along the motion may have passed a filter.
void add_conservative_part(const LawEntry& entry, const FittedLaw& law, LawTrace& trace) {
  if (!entry.make || entry.use != LawUse::kForce) {
    trace.conservative = trace.force;
    return;
  }
  const std::shared_ptr<const Law> force = entry.make(law.values());
  trace.has_memory = force->state_count() > 0;
  if (trace.has_memory) return;
  for (std::size_t t = 0; t < trace.force.size(); ++t) {
    const double z = trace.deflection[t], rate = trace.rate[t];
    trace.conservative.push_back(trace.force[t] -
                                 (force->force(z, rate, {}) - force->force(z, 0.0, {})));
  }
}

}  // namespace

FittedPhysics fit_physics(const MismatchProblem& problem, const ExtendedFit& fit) {
  const auto* evidence = dynamic_cast<const PhysicalEvidence*>(&problem);
  const PhysicalContext context =
      evidence != nullptr ? evidence->physical_context(fit) : PhysicalContext{};
  return fit_physics(problem.hypotheses(), context, fit);
}

FittedPhysics fit_physics(std::span<const Hypothesis> hypotheses, const PhysicalContext& context,
                          const ExtendedFit& fit) {
  FittedPhysics physics;
  add_model(context, fit, physics);
  for (std::size_t l = 0; l < fit.laws.size(); ++l) {
    const FittedLaw& law = fit.laws[l];
    const Hypothesis& hypothesis = hypotheses[law.hypothesis];
    const LawEntry* entry = find_law(hypothesis.law, is_signal(hypothesis));
    const PhysicalContext::OfLaw* own = l < context.laws.size() ? &context.laws[l] : nullptr;
    LawTrace trace = own != nullptr ? own->trace : LawTrace{};
    trace.name = hypothesis.law + " at " + hypothesis.place;
    trace.place = hypothesis.place;
    if (entry != nullptr) add_conservative_part(*entry, law, trace);
    for (std::size_t p = 0; entry != nullptr && p < law.parameters.size(); ++p) {
      const LawParameterEstimate& estimate = law.parameters[p];
      PhysicalQuantity& quantity = physics.quantities.emplace_back();
      quantity.name = estimate.name + " of " + trace.name;
      quantity.unit = estimate.unit;
      quantity.kind = is_signal(hypothesis) ? QuantityKind::kOther
                                            : kind_of(*entry, entry->parameters[p], estimate);
      quantity.value = estimate.value;
      quantity.standard_error = estimate.standard_error;
      quantity.stated = stated_beside(*entry, quantity.kind, entry->parameters[p], own);
      quantity.law = l;
    }
    physics.laws.push_back(std::move(trace));
  }
  return physics;
}

CheckedRange checked_range(const MismatchProblem& problem) {
  const auto* evidence = dynamic_cast<const PhysicalEvidence*>(&problem);
  return evidence != nullptr ? evidence->checked_range() : CheckedRange{};
}

bool sets_size(const LawParameterEstimate& estimate) {
  if (estimate.sets_scale) return false;
  return estimate.unit != "1" && estimate.unit != "rad" && estimate.unit != "m" &&
         estimate.unit != "s" && estimate.unit != "Hz" && estimate.unit != "rad/s" &&
         estimate.unit != "m/s";
}

bool is_determined(const LawParameterEstimate& estimate) {
  const double error = estimate.error();
  if (!std::isfinite(error)) return true;  // nothing is known of it
  const std::string& name = estimate.name;
  if (name.ends_with("phase") || name.ends_with("angle")) return error < 1.0;
  if (name == "x" || name == "y" || name == "z") return true;
  return error <= std::abs(estimate.value);
}

bool excludes_its_absence(const FittedLaw& law) {
  return std::ranges::any_of(law.parameters, [](const LawParameterEstimate& estimate) {
    return sets_size(estimate) && estimate.error() > 0.0 &&
           std::abs(estimate.value) > kToldFromZero * estimate.error();
  });
}

}  // namespace graybox
