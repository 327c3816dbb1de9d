// BestDesign: the design of the smallest gap that a column generation has priced over the whole set
// so far, kept as the few members of its working set that carry weight.
//
//   if (best.offer(gap, working.indices(), working.weights())) ...   // kept
//   return tracer.finish(best.design(set.candidate_count()), ...);
#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "solvers/core/design.hpp"

namespace graybox {

class BestDesign {
 public:
  // Keeps the members of positive weight where the gap is the first or smaller than any before.
  bool offer(double gap, std::span<const std::size_t> indices, std::span<const double> weights);

  [[nodiscard]] bool empty() const { return members_.empty(); }
  [[nodiscard]] double gap() const { return gap_; }  // infinite while empty
  // Zero weights where nothing was kept.
  [[nodiscard]] Design design(std::size_t candidate_count) const;

 private:
  double gap_ = std::numeric_limits<double>::infinity();
  std::vector<std::pair<std::size_t, double>> members_;
};

}  // namespace graybox
