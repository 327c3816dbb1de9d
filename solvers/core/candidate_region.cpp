#include "solvers/core/candidate_region.hpp"

#include <algorithm>
#include <utility>
#include <vector>

namespace graybox {
namespace {

bool lacks_region(const Criterion& criterion) {
  return criterion.kind() == CriterionKind::kG && criterion.region().count() == 0;
}

}  // namespace

Criterion over_candidates(const Criterion& criterion, const InformationSet& set) {
  if (lacks_region(criterion)) return Criterion::g(PredictionRegion::of_set(set));
  const auto has_gap = [](const CriterionPart& part) { return lacks_region(part.criterion); };
  if (std::ranges::none_of(criterion.parts(), has_gap)) return criterion;
  std::vector<CriterionPart> parts(criterion.parts().begin(), criterion.parts().end());
  for (CriterionPart& part : parts) part.criterion = over_candidates(part.criterion, set);
  return Criterion::compound(std::move(parts));
}

}  // namespace graybox
