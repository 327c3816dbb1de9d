#include "diagnosis/free_motion/changing_coefficient.hpp"

#include <algorithm>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/free_motion/time_variation.hpp"
#include "diagnosis/harmonic_balance/periodic_law.hpp"
#include "problems/base/distributions.hpp"

namespace graybox {
namespace {

constexpr double kShareOfFree = 0.1;  // that laws may make of the free motion

// A change is small that makes less than this share of the forces at its place, as a law is that
// explains less than a thousandth beside others.
constexpr double kSmallChange = 1e-3;

std::string coefficient_name(Coefficient coefficient) {
  switch (coefficient) {
    case Coefficient::kStiffness:
      return "stiffness";
    case Coefficient::kDamping:
      return "damping";
    case Coefficient::kGain:
      break;
  }
  return "gain";
}

std::string coefficient_unit(Coefficient coefficient) {
  switch (coefficient) {
    case Coefficient::kStiffness:
      return "F/x";
    case Coefficient::kDamping:
      return "F s/x";
    case Coefficient::kGain:
      break;
  }
  return "1";
}

// The most that forces with slopes that vary make of the free motion: a share of it, and of what
// they do at all. `left`: chi-square that no law explains, which may be such a force; of the
// model's own laws nothing is known.
double made_of_free_motion(const ModelState& model, std::size_t own_laws, double free_power,
                           double gain, double left) {
  if (std::ranges::any_of(std::span(model.laws).first(own_laws), has_varying_slopes))
    return kShareOfFree * free_power;
  const double of_laws =
      std::ranges::any_of(model.laws, has_varying_slopes) ? std::max(gain, 0.0) : 0.0;
  return kShareOfFree * std::min(free_power, of_laws + left);
}

}  // namespace

std::optional<TimeVariation> find_time_variation(const PlantFamily& family,
                                                 const PeriodicData& data, const ModelState& model,
                                                 std::size_t own_laws, double gain, double left,
                                                 int threads) {
  const std::vector<VariationScore> scores = variation_scores(family, data, model, threads);
  const auto beyond = [](const VariationScore& score) {
    return score.statistic - score.degrees_of_freedom;
  };
  const auto best = std::ranges::max_element(scores, {}, beyond);
  if (best == scores.end() || !(best->degrees_of_freedom > 0.0)) return {};
  if (beyond(*best) < made_of_free_motion(model, own_laws, best->free_power, gain, left)) return {};
  TimeVariation result;
  result.place = best->place->location.name;
  result.coefficient = coefficient_name(best->coefficient);
  result.unit = unit_at(coefficient_unit(best->coefficient), best->place->location.units);
  result.p_value = std::min(1.0, static_cast<double>(scores.size()) *
                                     chi_square_tail(best->statistic, best->degrees_of_freedom));
  if (best->force_share < kSmallChange) result.p_value = 1.0;
  result.deviation = best->deviation;
  result.frequency = best->frequency;
  result.duration = best->duration;
  result.course = best->course;
  constexpr double kAsWell = 10.0;  // of chi-square
  for (const VariationScore& score : scores) {
    if (&score == &*best || beyond(score) < beyond(*best) - kAsWell) continue;
    result.alternatives.push_back(coefficient_name(score.coefficient) + " at " +
                                  score.place->location.name);
  }
  return result;
}

bool has_varying_slopes(const ActingLaw& law) {
  if (is_body(*law.place, *law.entry) || law.entry->name == "offset") return false;
  return !PeriodicLaw(*law.entry, law.parameters).is_linear();
}

}  // namespace graybox
