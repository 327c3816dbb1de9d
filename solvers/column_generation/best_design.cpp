#include "solvers/column_generation/best_design.hpp"

namespace graybox {

bool BestDesign::offer(double gap, std::span<const std::size_t> indices,
                       std::span<const double> weights) {
  if (!empty() && !(gap < gap_)) return false;
  gap_ = gap;
  members_.clear();
  for (std::size_t k = 0; k < indices.size(); ++k) {
    if (weights[k] > 0.0) members_.emplace_back(indices[k], weights[k]);
  }
  return true;
}

Design BestDesign::design(std::size_t candidate_count) const {
  Design design{std::vector<double>(candidate_count, 0.0)};
  for (const auto& [candidate, weight] : members_) design.weights[candidate] = weight;
  return design;
}

}  // namespace graybox
