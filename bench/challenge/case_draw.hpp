// Which cases a challenge has, and the draw of each.
//
// Composition of n cases (400 unless `--quick`, then 40). By family: 30 % on the full robot, 20 %
// on a three-axis robot, 50 % on lumped systems. In each family: 25 % with nothing missing, 10 %
// with two effects, 7.5 % with a law that the catalogue lacks, the rest with one effect. Their
// order is shuffled. Laws and places are taken in turn, so that all come up, from shuffled lists.
//
// Size: an effect's smallest detectable size is searched for (detectability.hpp) to 12 %; its size
// is that times 20^U, U uniform, unless the law's largest size comes first. Where a place hides a
// law at any size, the case takes another law and place, but for offsets. A constant can't be seen
// in the lines of periodic data. Its few cases are kept as cases with an effect that is not
// detectable.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bench/challenge/case_truth.hpp"

namespace graybox::bench {

struct LawAtPlace {
  const HiddenLaw* law = nullptr;
  std::size_t place = 0;  // of CaseSystem::places()
};

struct CaseOutline {
  std::string name;
  Family family = Family::kRobot;
  CaseKind kind = CaseKind::kNothing;
  std::uint64_t seed = 0;
  std::vector<LawAtPlace> effects;  // first choices
};

struct SizedEffect {
  HiddenEffect effect;  // its size and parameters; detectability is still to be told
  Element element;
};
// The effect that a law makes at a place at this size; `shape` as for HiddenLaw::parameters_of.
[[nodiscard]] SizedEffect sized_at(const HiddenLaw& law, const ChallengePlace& place, double size,
                                   const PlaceScale& scale, const std::array<double, 6>& shape);

// Outlines without name, seed and effects, so that families and kinds (in the order of CaseKind)
// both have their shares: both lists are apportioned, the kinds in turn over the families.
[[nodiscard]] std::vector<CaseOutline> deal_outlines(
    std::size_t cases, const std::vector<std::pair<Family, double>>& family_shares,
    const std::array<double, 4>& kind_shares);

// `family`: the only one, where given.
[[nodiscard]] std::vector<CaseOutline> compose_challenge(std::size_t cases, std::uint64_t seed,
                                                         std::optional<Family> family = {});

// Every law that may be put at each place of a system.
[[nodiscard]] std::vector<LawAtPlace> possible_effects(const CaseSystem& system, bool in_catalogue);

// Empty name where `keep_going` has said no. Throws std::runtime_error where no effect can be
// drawn.
[[nodiscard]] CaseTruth draw_case(const CaseOutline& outline,
                                  const std::function<bool()>& keep_going = {});

}  // namespace graybox::bench
