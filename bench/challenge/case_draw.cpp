#include "bench/challenge/case_draw.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>

#include "bench/challenge/case_experiment.hpp"
#include "bench/challenge/detectability.hpp"
#include "problems/base/error.hpp"

namespace graybox::bench {
namespace {

constexpr double kLargestRelativeSize = 20.0;

template <typename Value>
void shuffle(std::vector<Value>& values, Random& random) {
  for (std::size_t k = values.size(); k > 1; --k) std::swap(values[k - 1], values[random.below(k)]);
}

// ---- composition --------------------------------------------------------------------------------

// Whole numbers that sum to `total` in these proportions (largest remainders).
std::vector<std::size_t> apportion(std::size_t total, const std::vector<double>& shares) {
  std::vector<std::size_t> counts;
  std::vector<std::pair<double, std::size_t>> remainders;
  double sum = 0.0;
  for (const double share : shares) sum += share;
  std::size_t given = 0;
  for (std::size_t k = 0; k < shares.size(); ++k) {
    const double exact = static_cast<double>(total) * shares[k] / sum;
    counts.push_back(static_cast<std::size_t>(std::floor(exact + 1e-9)));
    given += counts.back();
    remainders.emplace_back(static_cast<double>(counts.back()) - exact, k);
  }
  std::ranges::stable_sort(remainders, {}, &std::pair<double, std::size_t>::first);
  for (std::size_t k = 0; given < total; ++k, ++given) ++counts[remainders[k].second];
  return counts;
}

}  // namespace

std::vector<CaseOutline> deal_outlines(std::size_t cases,
                                       const std::vector<std::pair<Family, double>>& family_shares,
                                       const std::array<double, 4>& kind_shares) {
  std::vector<double> shares;
  for (const auto& [family, share] : family_shares) shares.push_back(share);
  const auto families = apportion(cases, shares);
  const auto kinds = apportion(cases, {kind_shares.begin(), kind_shares.end()});
  std::vector<Family> family_of;
  for (std::size_t f = 0; f < family_shares.size(); ++f) {
    family_of.insert(family_of.end(), families[f], family_shares[f].first);
  }
  // Case k of the list sorted by families gets the kind whose share is most behind.
  std::vector<CaseOutline> outlines(cases);
  std::vector<double> dealt(kinds.size(), 0.0);
  for (std::size_t k = 0; k < cases; ++k) {
    std::size_t most = 0;
    double behind = -std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < kinds.size(); ++i) {
      const double wanted =
          static_cast<double>(kinds[i]) * static_cast<double>(k + 1) / static_cast<double>(cases);
      if (dealt[i] < static_cast<double>(kinds[i]) && wanted - dealt[i] > behind) {
        behind = wanted - dealt[i];
        most = i;
      }
    }
    dealt[most] += 1.0;
    outlines[k].family = family_of[k];
    outlines[k].kind = static_cast<CaseKind>(most);
  }
  return outlines;
}

namespace {

bool is_offset(const HiddenLaw& law) { return law.name == "offset"; }

// The pair whose law, then place, has come up least, or by turns whose place, then law; at random
// among equals.
class Turns {
 public:
  explicit Turns(std::uint64_t seed) : random_(seed) {}

  LawAtPlace next(Family family, const std::vector<LawAtPlace>& possible,
                  const std::vector<LawAtPlace>& taken, bool alone) {
    const bool law_first = turn_++ % 2 == 0;
    std::vector<LawAtPlace> best;
    std::pair<int, int> least{std::numeric_limits<int>::max(), 0};
    for (const LawAtPlace& pair : possible) {
      if (conflicts(pair, taken)) continue;
      if (is_offset(*pair.law) && (laws_[pair.law] > 0 || !alone)) continue;
      std::pair<int, int> uses{laws_[pair.law], places_[{family, pair.place}]};
      if (!law_first) std::swap(uses.first, uses.second);
      if (uses > least) continue;
      if (uses < least) best.clear();
      least = uses;
      best.push_back(pair);
    }
    const LawAtPlace chosen = best.at(random_.below(best.size()));
    ++laws_[chosen.law];
    ++places_[{family, chosen.place}];
    return chosen;
  }

  static bool conflicts(const LawAtPlace& pair, const std::vector<LawAtPlace>& taken) {
    return std::ranges::any_of(taken,
                               [&](const LawAtPlace& other) { return other.place == pair.place; });
  }

 private:
  Random random_;
  int turn_ = 0;
  std::map<const HiddenLaw*, int> laws_;
  std::map<std::pair<Family, std::size_t>, int> places_;
};

// A law that only adds to a parameter that a fit adjusts hides nothing: one whose matrix is a
// multiple of b b^T, b the place's direction.
bool is_fitted(const HiddenLaw& law, const ChallengePlace& place, const LinearDynamics& dynamics) {
  const bool is_stiffness = law.name == "stiffness";
  if (!is_stiffness && law.name != "viscous") return false;
  if (place.location.input != place.location.output) return false;
  const Eigen::MatrixXd own =
      place.location.input * place.location.input.transpose() / place.location.input.squaredNorm();
  return std::ranges::any_of(dynamics.derivatives, [&](const LinearDynamics::Derivative& change) {
    const Eigen::MatrixXd& fitted = is_stiffness ? change.stiffness : change.damping;
    return fitted.size() > 0 && fitted.isApprox((own.cwiseProduct(fitted)).sum() * own, 1e-9);
  });
}

bool fits(const HiddenLaw& law, const ChallengePlace& place) {
  if ((law.places & place.kinds) == 0) return false;
  const bool rotates = place.location.units.deflection == "rad";
  if (law.rotations_only && !rotates) return false;
  return law.use != LawUse::kInertia || (place.location.takes_inertia && !place.inertia_is_fitted);
}

// ---- the size of an effect ----------------------------------------------------------------------

struct SizeSearch {
  const CaseSystem& system;
  const Detectability& detectability;
  double required;
  const std::function<bool()>& keep_going;

  // Not a number where the system with the effect has no rest or no stable motion.
  [[nodiscard]] double noncentrality(const std::vector<Element>& elements) const {
    try {
      return detectability.noncentrality(elements);
    } catch (const UnstableMotion&) {
    } catch (const InputError&) {
    }
    return std::numeric_limits<double>::quiet_NaN();
  }
};

}  // namespace

SizedEffect sized_at(const HiddenLaw& law, const ChallengePlace& place, double size,
                     const PlaceScale& scale, const std::array<double, 6>& shape) {
  const std::vector<double> values = law.parameters_of(size, scale, shape);
  SizedEffect result;
  result.effect.place = place.location.name;
  result.effect.law = law.name;
  result.effect.at_signal = law.at_signal();
  result.effect.in_catalogue = law.in_catalogue;
  result.effect.size = size;
  for (std::size_t k = 0; k < values.size(); ++k) {
    const HiddenParameter& parameter = law.parameters[k];
    result.effect.parameters.push_back({parameter.name,
                                        unit_at(parameter.unit, place.location.units), values[k],
                                        parameter.in_catalogue && law.in_catalogue});
  }
  result.element = element_of(law, place, values);
  return result;
}

namespace {

std::optional<SizedEffect> sized_effect(const SizeSearch& search, const LawAtPlace& pair,
                                        Random& random) {
  const ChallengePlace& place = search.system.places()[pair.place];
  const PlaceScale scale = search.detectability.scale_at(place);
  std::array<double, 6> shape{};
  for (double& value : shape) value = random.uniform();
  const double relative = std::pow(kLargestRelativeSize, random.uniform());
  const auto at = [&](double size) { return sized_at(*pair.law, place, size, scale, shape); };
  const auto lambda_at = [&](double size) { return search.noncentrality({at(size).element}); };
  const double largest = pair.law->largest_size;
  const std::optional<double> smallest =
      smallest_detectable_size(lambda_at, search.required, largest, search.keep_going);
  if (!smallest) {
    if (!is_offset(*pair.law)) return {};
    SizedEffect hidden = at(0.3 * largest);
    hidden.effect.noncentrality = lambda_at(hidden.effect.size);
    if (std::isnan(hidden.effect.noncentrality)) return {};
    return hidden;
  }
  double size = std::min(*smallest * relative, largest);
  for (int trial = 0; trial < 4; ++trial) {
    SizedEffect sized = at(size);
    sized.effect.smallest_size = *smallest;
    sized.effect.noncentrality = lambda_at(size);
    sized.effect.detectable = sized.effect.noncentrality >= 0.8 * search.required;
    if (sized.effect.detectable) return sized;
    size = std::sqrt(size * *smallest);
  }
  return {};
}

// All sets of the plan move, those for validation too.
bool moves_everywhere(const CaseSystem& system, const std::vector<Element>& elements,
                      std::uint64_t seed) {
  try {
    for (const ExperimentSet& set : system.plan().sets) {
      if (set.validation) (void)simulate_experiment(system, elements, set, 0, true, seed);
    }
    return true;
  } catch (const UnstableMotion&) {
  } catch (const InputError&) {
  }
  return false;
}

CaseTruth truth_of(const CaseOutline& outline, const CaseSystem& system) {
  CaseTruth truth;
  truth.name = outline.name;
  truth.family = outline.family;
  truth.kind = outline.kind;
  truth.seed = outline.seed;
  truth.parameter_names = system.parameter_names();
  truth.parameter_factors = system.parameter_factors();
  return truth;
}

}  // namespace

std::vector<LawAtPlace> possible_effects(const CaseSystem& system, bool in_catalogue) {
  std::vector<LawAtPlace> pairs;
  const LinearDynamics dynamics = system.linear(0);
  for (const HiddenLaw& law : hidden_laws()) {
    if (law.in_catalogue != in_catalogue) continue;
    for (std::size_t p = 0; p < system.places().size(); ++p) {
      const ChallengePlace& place = system.places()[p];
      if (fits(law, place) && !is_fitted(law, place, dynamics)) pairs.push_back({&law, p});
    }
  }
  return pairs;
}

std::vector<CaseOutline> compose_challenge(std::size_t cases, std::uint64_t seed,
                                           std::optional<Family> family) {
  std::vector<std::pair<Family, double>> shares{
      {Family::kRobot, 120.0},  {Family::kThreeAxis, 80.0},  {Family::kOneMass, 50.0},
      {Family::kTwoMass, 50.0}, {Family::kOscillator, 50.0}, {Family::kChain, 50.0}};
  if (family) shares = {{*family, 1.0}};
  std::vector<CaseOutline> outlines = deal_outlines(cases, shares, {100.0, 230.0, 40.0, 30.0});
  Random random(derived_seed(seed, {10}));
  shuffle(outlines, random);
  Turns turns(derived_seed(seed, {11}));
  std::map<std::pair<Family, bool>, std::vector<LawAtPlace>> possible;
  for (std::size_t k = 0; k < cases; ++k) {
    CaseOutline& outline = outlines[k];
    outline.name = fmt::format("case_{:03}", k + 1);
    outline.seed = derived_seed(seed, {12, k});
    const bool in_catalogue = outline.kind != CaseKind::kOutside;
    auto& pairs = possible[{outline.family, in_catalogue}];
    if (pairs.empty()) pairs = possible_effects(*draw_system(outline.family, 1), in_catalogue);
    const std::size_t effects = outline.kind == CaseKind::kNothing      ? 0
                                : outline.kind == CaseKind::kTwoEffects ? 2
                                                                        : 1;
    for (std::size_t e = 0; e < effects; ++e) {
      outline.effects.push_back(turns.next(outline.family, pairs, outline.effects, effects == 1));
    }
  }
  return outlines;
}

CaseTruth draw_case(const CaseOutline& outline, const std::function<bool()>& keep_going) {
  constexpr std::size_t kOtherChoices = 12;
  const auto system = draw_system(outline.family, outline.seed);
  CaseTruth truth = truth_of(outline, *system);
  const Detectability detectability(*system, outline.seed);
  truth.degrees_of_freedom = detectability.degrees_of_freedom();
  truth.required_noncentrality = required_noncentrality(truth.degrees_of_freedom);
  const SizeSearch search{*system, detectability, truth.required_noncentrality, keep_going};
  Random random(derived_seed(outline.seed, {20}));
  auto others = possible_effects(*system, outline.kind != CaseKind::kOutside);
  std::erase_if(others, [](const LawAtPlace& pair) { return is_offset(*pair.law); });
  shuffle(others, random);
  others.resize(std::min(others.size(), kOtherChoices));
  std::vector<LawAtPlace> taken;
  std::vector<Element> elements;
  for (const LawAtPlace& wanted : outline.effects) {
    std::vector<LawAtPlace> choices{wanted};
    choices.insert(choices.end(), others.begin(), others.end());
    const std::size_t before = taken.size();
    for (const LawAtPlace& pair : choices) {
      if (keep_going && !keep_going()) return {};
      if (Turns::conflicts(pair, taken)) continue;
      const auto sized = sized_effect(search, pair, random);
      if (!sized) continue;
      std::vector<Element> together = elements;
      together.push_back(sized->element);
      const double joint =
          elements.empty() ? sized->effect.noncentrality : search.noncentrality(together);
      if (std::isnan(joint) || !moves_everywhere(*system, together, outline.seed)) continue;
      truth.effects.push_back(sized->effect);
      truth.noncentrality = joint;
      elements = std::move(together);
      taken.push_back(pair);
      break;
    }
    if (taken.size() == before) {
      if (keep_going && !keep_going()) return {};
      throw std::runtime_error(
          fmt::format("{}: no law at no place can be seen in its recordings", outline.name));
    }
  }
  return truth;
}

}  // namespace graybox::bench
