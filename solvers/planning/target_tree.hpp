// TargetTree: whether some whole numbers m_i of experiments reach every target
// c_j^T M(m)^-1 c_j <= s_j^2, by branch and bound with weights mu of its own in each node.
//
// A node is a box of counts, l <= m <= u, within design_constraints.hpp. Its relaxed problem,
// whether real numbers in the box reach every target (minimax_precision.hpp), begins with the mu of
// the parent. If it is proven that none do, the node is done. Otherwise the count farthest from a
// whole number is split. The relaxed design, rounded, may be the one that is looked for.
//
// One mu for the whole tree, as constrained_exact.hpp has it, leaves open what a mixture of whole
// designs reaches though none of them does. Here boxes end where single designs are told apart.
//
// Cost: a few L-optimal designs a node.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "solvers/planning/minimax_precision.hpp"

namespace graybox {

enum class TreeAnswer : std::int8_t {
  kNone,   // no whole numbers reach every target: proven
  kFound,  // `counts` do
  kOpen,   // time was up
};

struct TargetTreeResult {
  TreeAnswer answer = TreeAnswer::kOpen;
  std::vector<std::int64_t> counts;
  std::int64_t nodes = 0;
};

// `mu`: where to begin, one a target. Ends when stop.hpp says so.
[[nodiscard]] TargetTreeResult search_target_tree(const InformationSet& set,
                                                  const DesignConstraints& constraints,
                                                  std::span<const PrecisionTarget> targets,
                                                  std::span<const double> mu, int threads);

}  // namespace graybox
