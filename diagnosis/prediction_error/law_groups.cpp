#include "diagnosis/prediction_error/law_groups.hpp"

#include <algorithm>
#include <map>
#include <optional>
#include <string>

namespace graybox {
namespace {

// The one free mass on which a law acts; none for laws between masses, and of signals.
std::optional<Eigen::Index> free_mass_of(const LawExtension& law, const LumpedModel& model) {
  const Eigen::VectorXd& b = law.location.output;
  if (law.location.kind != LocationKind::kElement || (b.array() != 0.0).count() != 1) return {};
  Eigen::Index mass = 0;
  b.cwiseAbs().maxCoeff(&mass);
  if (model.imposed[static_cast<std::size_t>(mass)]) return {};
  return mass;
}

// By free mass that has neither of two laws, both.
std::vector<std::vector<LawExtension>> pairs_of(const std::string& first, const std::string& second,
                                                const std::vector<LawExtension>& extensions,
                                                const LumpedModel& model) {
  std::map<Eigen::Index, std::map<std::string, LawExtension>> found;  // by mass, by law
  for (const LawExtension& law : extensions) {
    if (law.law != first && law.law != second) continue;
    if (law.location.driver >= 0 || law.replaces) continue;
    if (const auto mass = free_mass_of(law, model)) found[*mass].emplace(law.law, law);
  }
  std::vector<std::vector<LawExtension>> groups;
  for (const auto& [mass, laws] : found) {
    if (laws.size() == 2) groups.push_back({laws.at(first), laws.at(second)});
  }
  return groups;
}

}  // namespace

std::vector<LawExtension> friction_group(const std::vector<LawExtension>& extensions,
                                         const LumpedModel& model) {
  std::vector<LawExtension> group;
  for (const LawExtension& law : extensions) {
    if (law.law != "viscous" && law.law != "coulomb") continue;
    const bool is_of_free_mass = free_mass_of(law, model).has_value();
    const bool is_there = std::ranges::any_of(group, [&](const LawExtension& other) {
      return other.hypothesis == law.hypothesis;  // in another start: the first is the plainest
    });
    if (is_of_free_mass && !is_there) group.push_back(law);
  }
  return group;
}

std::vector<std::vector<LawExtension>> dragged_friction(const std::vector<LawExtension>& extensions,
                                                        const LumpedModel& model) {
  std::vector<std::vector<LawExtension>> groups =
      pairs_of("coulomb", "quadratic_drag", extensions, model);
  if (groups.size() > 1) groups.clear();  // drag at motor and load imitates their spring
  return groups;
}

std::vector<std::vector<LawExtension>> bent_drives(const std::vector<LawExtension>& extensions,
                                                   const LumpedModel& model) {
  std::vector<std::vector<LawExtension>> groups;
  for (const LawExtension& drive : extensions) {
    if (drive.law != "curved_gain") continue;
    const LumpedInput& input = model.inputs[static_cast<std::size_t>(drive.location.channel)];
    const auto brakes = [&](const LawExtension& law) {
      return law.law == "coulomb" && law.location.driver < 0 && !law.replaces &&
             free_mass_of(law, model) == input.mass;
    };
    const auto friction = std::ranges::find_if(extensions, brakes);
    if (friction != extensions.end()) groups.push_back({*friction, drive});
  }
  return groups;
}

std::vector<std::vector<LawExtension>> braked_weights(const std::vector<LawExtension>& extensions,
                                                      const LumpedModel& model) {
  return pairs_of("gravity", "coulomb", extensions, model);
}

std::vector<std::vector<LawExtension>> resting_springs(const std::vector<LawExtension>& extensions,
                                                       const LumpedModel& model) {
  return pairs_of("stiffness", "offset", extensions, model);
}

bool swings_about_rest(const ExtendedLumpedModel& model, const Eigen::MatrixXd& motion) {
  constexpr int kFewestPasses = 3;
  if (model.laws.size() < 2) return false;
  const auto& parts = model.model.parts;
  const Element& spring = parts[model.laws[model.laws.size() - 2].part];
  const Element& force = parts[model.laws.back().part];
  const double stiffness = spring.parameters[0];
  if (!(stiffness > 0.0)) return false;
  const Eigen::VectorXd deflection =
      motion.leftCols(spring.location.input.size()) * spring.location.input;
  const double rest = -force.parameters[0] / stiffness;
  int passes = 0;
  for (Eigen::Index k = 1; k < deflection.size(); ++k) {
    passes += (deflection(k - 1) < rest) != (deflection(k) < rest) ? 1 : 0;
  }
  return passes >= kFewestPasses;
}

PredictionFit with_group(const PredictionFitter& fitter, const PredictionFit& poorer,
                         const Eigen::VectorXd& weights, const std::vector<LawExtension>& group,
                         int iterations) {
  ExtendedLumpedModel start = poorer.model;
  for (const LawExtension& law : group) start = extended(start, law, 0.0);
  return fitter.fit(start, weights, poorer.initials, iterations);
}

}  // namespace graybox
