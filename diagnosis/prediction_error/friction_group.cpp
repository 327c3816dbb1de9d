#include "diagnosis/prediction_error/friction_group.hpp"

#include <algorithm>

namespace graybox {

std::vector<LawExtension> friction_group(const std::vector<LawExtension>& extensions,
                                         const LumpedModel& model) {
  std::vector<LawExtension> group;
  for (const LawExtension& law : extensions) {
    if (law.law != "viscous" && law.law != "coulomb") continue;
    const Eigen::VectorXd& b = law.location.output;
    Eigen::Index mass = 0;
    b.cwiseAbs().maxCoeff(&mass);
    const bool is_of_free_mass =
        (b.array() != 0.0).count() == 1 && !model.imposed[static_cast<std::size_t>(mass)];
    const bool is_there = std::ranges::any_of(group, [&](const LawExtension& other) {
      return other.hypothesis == law.hypothesis;  // in another start: the first is the plainest
    });
    if (is_of_free_mass && !is_there) group.push_back(law);
  }
  return group;
}

PredictionFit with_group(const PredictionFitter& fitter, const PredictionFit& poorer,
                         const Eigen::VectorXd& weights, const std::vector<LawExtension>& group,
                         int iterations) {
  ExtendedLumpedModel start = poorer.model;
  for (const LawExtension& law : group) start = extended(start, law, 0.0);
  return fitter.fit(start, weights, poorer.initials, iterations);
}

}  // namespace graybox
