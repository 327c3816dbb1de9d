// Exact designs under constraints, with proof: whole numbers m_i that obey design_constraints.hpp,
//
//   maximise  Phi(P + sum_i m_i H_i),   Phi of any criterion (certificate.hpp).
//
// Branch and bound over boxes of counts, best first. Each node solves the relaxed problem in its
// box (constrained_column_generation.hpp). With its M, the gains w_i = tr(G H_i) and the
// multipliers y of its rows,
//
//   log Phi(M(m)) <= log Phi(M) + log(tr(G P) + bound(y))         for every design of the box,  (1)
//
// bound(y) of multiplier_bound.hpp: nothing relies on convergence. For E and G, whose Phi has a
// kink, G is that of their barrier at M (constrained_exchange.hpp). Each run of a candidate with
// reduced gain r_i < 0 costs |r_i| under the logarithm, and so does each run that one with r_i > 0
// is short of its limit. Counts that no better design can have go away for good. At the root that
// leaves a pool of some tens or hundreds of candidates.
//
// Designs come from rounding the relaxed points of the nodes one count at a time, and from
// exchanges that keep within all constraints.
//
// With `top` K the K best designs are sought: parts of the tree are given up only where they hold
// nothing better than the K-th. The proof is then of all K.
//
// Arithmetic: (1) in double precision, raised by 1e-10 or, where that is more, by d eps times the
// condition of M with unit diagonal. The design itself is judged by the checker
// in extended precision.
//
// exact_method.hpp has the faster tree for D-optimal designs of M experiments without constraints.
// Cost: the number of nodes times that of the relaxed problem on the pool. G over the candidates
// has a point for each of the whole set in every node.
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "solvers/constrained/constrained_column_generation.hpp"
#include "solvers/exact/exact_method.hpp"

namespace graybox {

struct ConstrainedExactOptions {
  double gap = 1e-6;  // proven where Phi(best) / Phi(design) - 1 <= gap
  double time_limit = std::numeric_limits<double>::infinity();  // wall seconds
  std::uint64_t seed = 1;
  int threads = 1;  // the answer does not depend on it, unless time runs out
  Criterion criterion = {};
  std::size_t top = 1;  // how many designs
};

struct RankedDesign {
  std::vector<std::int64_t> counts;                         // Q numbers
  double value = -std::numeric_limits<double>::infinity();  // log Phi
};

struct ConstrainedExactSolution {
  std::vector<RankedDesign> designs;  // best first, all different; empty where none was found
  ExactStatus status = ExactStatus::kSingular;
  double value_bound = std::numeric_limits<double>::infinity();  // no design has a larger log Phi
  double last_bound = std::numeric_limits<double>::infinity();   // ... but those listed
  std::int64_t nodes = 0;
  std::size_t open_nodes = 0;
  std::size_t survivors = 0;  // candidates that were left at the root
  double seconds = 0.0;
  std::string message = {};
};

// Throws InputError as solve_constrained(), and where no whole numbers are left between the limits
// of a candidate.
[[nodiscard]] ConstrainedExactSolution solve_constrained_exact(
    const InformationSet& set, const DesignConstraints& constraints,
    const ConstrainedExactOptions& options, ExactObserver* observer = nullptr);

}  // namespace graybox
