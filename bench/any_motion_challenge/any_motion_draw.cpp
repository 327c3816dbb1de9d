#include "bench/any_motion_challenge/any_motion_draw.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>

#include "bench/any_motion_challenge/any_motion_laws.hpp"
#include "bench/any_motion_challenge/innovation_detectability.hpp"
#include "bench/challenge/detectability.hpp"
#include "diagnosis/simulation/plant.hpp"

namespace graybox::bench {
namespace {

constexpr double kLargestRelativeSize = 20.0;
constexpr double kMostTorque = 3.0;

template <typename Value>
void shuffle(std::vector<Value>& values, Random& random) {
  for (std::size_t k = values.size(); k > 1; --k) std::swap(values[k - 1], values[random.below(k)]);
}

// ---- pairs --------------------------------------------------------------------------------------

// "motor" and "load" are both the rotor of a single axis.
struct NamedLaw {
  const char* law;
  const char* place;
};
constexpr std::array<std::array<NamedLaw, 2>, 8> kPairs{{
    {{{"viscous", "motor"}, {"coulomb", "motor"}}},
    {{{"coulomb", "motor"}, {"coulomb", "load"}}},
    {{{"coulomb", "motor"}, {"delay", "sensor"}}},
    {{{"offset", "load"}, {"coulomb", "load"}}},
    {{{"coulomb", "load"}, {"cubic_spring", "motor-load"}}},
    {{{"coulomb", "load"}, {"gravity", "load"}}},
    {{{"coulomb", "motor"}, {"lag", "actuator"}}},
    {{{"coulomb", "load"}, {"backlash", "motor-load"}}},
}};

bool is_at(const ChallengePlace& place, std::string_view wanted, bool is_single) {
  const std::string& name = place.location.name;
  if (wanted == "sensor" || wanted == "actuator") return name.starts_with(wanted);
  return name == wanted || (is_single && name == "rotor" && wanted != "motor-load");
}

std::vector<LawAtPlace> pair_on(const AnyMotionSystem& system,
                                const std::array<NamedLaw, 2>& wanted) {
  std::vector<LawAtPlace> found;
  const auto possible = possible_any_motion_effects(system, true);
  for (const NamedLaw& each : wanted) {
    const auto match = std::ranges::find_if(possible, [&](const LawAtPlace& pair) {
      return pair.law->name == each.law &&
             is_at(system.places()[pair.place], each.place, system.mass_count() == 1);
    });
    if (match != possible.end()) found.push_back(*match);
  }
  const bool same =
      found.size() == 2 && found[0].law == found[1].law && found[0].place == found[1].place;
  return same ? std::vector<LawAtPlace>{} : found;
}

// Those of kPairs that a system can have.
std::vector<std::vector<LawAtPlace>> possible_pairs(const AnyMotionSystem& system) {
  std::vector<std::vector<LawAtPlace>> pairs;
  for (const auto& wanted : kPairs) {
    auto pair = pair_on(system, wanted);
    if (pair.size() == 2) pairs.push_back(std::move(pair));
  }
  return pairs;
}

// Choices of one family and kind, in turn from a shuffled list.
class Deck {
 public:
  Deck() = default;
  Deck(std::vector<std::vector<LawAtPlace>> choices, Random& random)
      : choices_(std::move(choices)) {
    shuffle(choices_, random);
  }
  [[nodiscard]] bool empty() const { return choices_.empty(); }
  const std::vector<LawAtPlace>& next() { return choices_[next_++ % choices_.size()]; }

 private:
  std::vector<std::vector<LawAtPlace>> choices_;
  std::size_t next_ = 0;
};

std::vector<std::vector<LawAtPlace>> choices_of(const AnyMotionSystem& system, CaseKind kind) {
  if (kind == CaseKind::kTwoEffects) return possible_pairs(system);
  std::vector<std::vector<LawAtPlace>> choices;
  if (kind == CaseKind::kNothing) return {{}};
  for (const LawAtPlace& pair : possible_any_motion_effects(system, kind == CaseKind::kOneEffect)) {
    choices.push_back({pair});
  }
  return choices;
}

// ---- the size of an effect ----------------------------------------------------------------------

struct SizeSearch {
  const AnyMotionSystem& system;
  const InnovationDetectability& detectability;
  double required;
  const std::function<bool()>& keep_going;

  // Not a number where the machine has no stable motion with them.
  [[nodiscard]] double noncentrality(const std::vector<Element>& elements) const {
    try {
      return detectability.noncentrality(elements);
    } catch (const UnstableMotion&) {
      return std::numeric_limits<double>::quiet_NaN();
    }
  }
};

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
  const auto smallest =
      smallest_detectable_size(lambda_at, search.required, largest, search.keep_going);
  if (!smallest) return {};
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

// Also in the recordings kept out, and without a limit cycle: the torque's rms is at most three
// times what it is without the effects.
bool moves_everywhere(const AnyMotionSystem& system, const std::vector<Element>& elements,
                      std::uint64_t seed) {
  try {
    for (std::size_t k = 0; k < system.plan().size(); ++k) {
      const double quiet = root_mean_square(simulate_drive(system, {}, k, seed, nullptr).input);
      const DriveRecording run = simulate_drive(system, elements, k, seed, nullptr);
      if (root_mean_square(run.input) > kMostTorque * quiet) return false;
    }
    return true;
  } catch (const UnstableMotion&) {
    return false;
  }
}

CaseTruth truth_of(const CaseOutline& outline, const AnyMotionSystem& system) {
  CaseTruth truth;
  truth.name = outline.name;
  truth.family = outline.family;
  truth.kind = outline.kind;
  truth.seed = outline.seed;
  for (const DriveParameter& parameter : system.parameters()) {
    truth.parameter_names.push_back(parameter.name);
    truth.parameter_factors.push_back(parameter.factor);
  }
  truth.same_places = system.same_places();
  return truth;
}

// The effects of one choice, sized; none where one of them can't be seen or the machine does not
// move with them.
bool add_effects(const SizeSearch& search, const std::vector<LawAtPlace>& choice,
                 std::uint64_t seed, Random& random, CaseTruth& truth) {
  std::vector<Element> elements;
  std::vector<HiddenEffect> effects;
  for (const LawAtPlace& pair : choice) {
    const auto sized = sized_effect(search, pair, random);
    if (!sized) return false;
    elements.push_back(sized->element);
    effects.push_back(sized->effect);
  }
  const double joint =
      effects.size() == 1 ? effects[0].noncentrality : search.noncentrality(elements);
  if (!(joint >= 0.8 * search.required) || !moves_everywhere(search.system, elements, seed)) {
    return false;
  }
  truth.effects = std::move(effects);
  truth.noncentrality = joint;
  return true;
}

}  // namespace

std::vector<LawAtPlace> possible_any_motion_effects(const AnyMotionSystem& system,
                                                    bool in_catalogue) {
  std::vector<LawAtPlace> pairs;
  for (const HiddenLaw& law : any_motion_laws()) {
    if (law.in_catalogue != in_catalogue) continue;
    for (std::size_t p = 0; p < system.places().size(); ++p) {
      if ((law.places & system.places()[p].kinds) != 0) pairs.push_back({&law, p});
    }
  }
  return pairs;
}

std::vector<CaseOutline> compose_any_motion(std::size_t cases, std::uint64_t seed,
                                            std::optional<Family> family) {
  std::vector<std::pair<Family, double>> shares{{Family::kAxisEncoder, 60.0},
                                                {Family::kAxisTachometer, 40.0},
                                                {Family::kDriveEncoders, 60.0},
                                                {Family::kDriveMotorEncoder, 50.0},
                                                {Family::kDriveTachometer, 30.0}};
  if (family) shares = {{*family, 1.0}};
  std::vector<CaseOutline> outlines = deal_outlines(cases, shares, {40.0, 120.0, 40.0, 40.0});
  Random random(derived_seed(seed, {10}));
  shuffle(outlines, random);
  std::map<std::pair<Family, CaseKind>, Deck> decks;
  for (std::size_t k = 0; k < cases; ++k) {
    CaseOutline& outline = outlines[k];
    outline.name = fmt::format("case_{:03}", k + 1);
    outline.seed = derived_seed(seed, {12, k});
    Deck& deck = decks[{outline.family, outline.kind}];
    if (deck.empty()) {
      deck = Deck(choices_of(AnyMotionSystem(outline.family, 1), outline.kind), random);
    }
    outline.effects = deck.next();
  }
  return outlines;
}

CaseTruth draw_any_motion_case(const CaseOutline& outline,
                               const std::function<bool()>& keep_going) {
  const AnyMotionSystem system(outline.family, outline.seed);
  CaseTruth truth = truth_of(outline, system);
  const InnovationDetectability detectability(system, outline.seed);
  truth.degrees_of_freedom = detectability.degrees_of_freedom();
  truth.required_noncentrality = required_noncentrality(truth.degrees_of_freedom);
  if (outline.effects.empty()) return truth;
  const SizeSearch search{system, detectability, truth.required_noncentrality, keep_going};
  Random random(derived_seed(outline.seed, {20}));
  auto choices = choices_of(system, outline.kind);
  shuffle(choices, random);
  choices.insert(choices.begin(), outline.effects);
  for (const auto& choice : choices) {
    if (keep_going && !keep_going()) return {};
    if (add_effects(search, choice, outline.seed, random, truth)) return truth;
  }
  if (keep_going && !keep_going()) return {};
  throw std::runtime_error(
      fmt::format("{}: no law at no place can be seen in its recordings", outline.name));
}

}  // namespace graybox::bench
