// NodeRelaxation: what branch and bound does at one node of its tree.
//
// A node is a box of counts over the pool, l_i <= m_i <= u_i, sum_i m_i = M. Its relaxation,
//
//   maximise f(x) = log det sum_i x_i B_i   over real x in the box,                             (1)
//
// is solved by Newton's method on a working set: the variables strictly inside their limits and
// those at a limit that want to leave it. With X = sum_i x_i B_i, g_i = tr(X^-1 B_i) and K_ij =
// tr(X^-1 B_i X^-1 B_j) a step y minimises y^T K y / 2 - g^T y within the box (box_quadratic.hpp),
// followed by Armijo's rule. Every iterate prices all candidates of the node and so gives the safe
// bound (3) of box_bound.hpp with W = X^-1; nothing relies on convergence, and a node is abandoned
// as soon as its bound is no better than `threshold`. Three things then shrink the box:
//
//   limits    (4), (5) of box_bound.hpp with the W at hand;
//   probing   for a count i and an integer a, the half m_i <= a (or m_i >= a + 1) is bounded by (3)
//             with the W of one Newton step towards it: on the free set F, with C = K_FF^-1 and C'
//             = C - C 1 1^T C / (1^T C 1), forcing m_i to move by s moves x_F by y = s C'_i / C'_ii
//             and costs about s^2 / (2 C'_ii). K holds the whole B_i, so here their trace-free
//             parts count. If one half is no better than the threshold the other is the node; if
//             both are, the node is done; otherwise the bounds choose the branching variable
//             (strong branching: the largest product of the two losses) and go with the children;
//   repeated  until nothing moves.
//
// A box whose centre is singular to rounding is taken to hold no regular design. Coordinates are
// those in which the relaxed optimum of one experiment is the identity.
//
// One design: where the limits leave a single design, W = X^-1 bounds it by its own log det but for
// rounding, which no branching makes smaller. Such a node is done. Its bound is the value of that
// design, which the caller computes in the checker's extended precision.
//
// Integer points: an integral x is a design; a fractional one is rounded (largest fractions up)
// inside the box. Both are offered to the caller as incumbents with their log det.
//
// Cost of a node: a few Newton steps of f d^3 + f^2 p / 2 each for f free variables, 2 n p for each
// pricing of its n candidates, and d^3 + n p for each probe. Nothing is allocated in the loops once
// the largest node has been seen. Not for use by several threads at once: one each.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "problems/base/aligned_array.hpp"
#include "problems/base/stop.hpp"
#include "solvers/core/inverse_cholesky.hpp"
#include "solvers/exact_bounds/box_bound.hpp"
#include "solvers/exact_bounds/box_quadratic.hpp"
#include "solvers/exact_bounds/whitened_pool.hpp"

namespace graybox {

// One candidate of a node. Members of the pool that are not listed have a count of zero.
struct BoxEntry {
  std::uint32_t member = 0;  // of the pool
  std::int32_t lower = 0;
  std::int32_t upper = 0;
  float start = 0.0F;  // where the relaxation of the node that made the box ended
};
using CountBox = std::vector<BoxEntry>;

// A node that waits: a parent's box and the half of it that is meant. The whole box at the root.
struct TreeNode {
  double bound = std::numeric_limits<double>::infinity();  // no design inside has a larger log det
  std::int64_t number = 0;                                 // in order of creation
  std::shared_ptr<const CountBox> box;
  std::uint32_t entry = 0;  // of the box, limited to:
  std::int32_t lower = 0;
  std::int32_t upper = std::numeric_limits<std::int32_t>::max();
};

struct NodeOutcome {
  bool stopped = false;                 // time was up: the node is as it was, the rest says nothing
  bool is_one_design = false;           // `design` is all that is left; the caller has its log det
  double bound = 0.0;                   // of what is left of the node; of all of it if it is done
  bool shrunk = false;                  // parts no better than the threshold were given up
  std::shared_ptr<const CountBox> box;  // null if the node is done
  std::uint32_t entry = 0;              // to branch on: counts up to `floor`, or above
  std::int32_t floor = 0;
  double down_bound = 0.0;
  double up_bound = 0.0;
  // A design met on the way, (pool member, count), and its log det.
  std::vector<std::pair<std::uint32_t, std::int32_t>> design;
  double design_log_det = -std::numeric_limits<double>::infinity();
};

class NodeRelaxation {
 public:
  // tolerance: a node whose bound is this close to the log det of its own integral point is done.
  // `clock`: nodes that it interrupts are handed back.
  NodeRelaxation(const WhitenedPool& pool, std::int64_t experiments, double tolerance,
                 StopClock clock = {});

  // Designs with log det above `threshold` are looked for; all bounds are raised to it where a part
  // of the box was given up against it.
  [[nodiscard]] NodeOutcome process(const TreeNode& node, double threshold);

  [[nodiscard]] std::int64_t newton_steps() const { return newton_steps_; }

 private:
  enum class Result { kDone, kSolved };

  void load(const TreeNode& node);
  bool repair_start();
  void spread(double lack, std::size_t variables);
  bool restart();
  bool evaluate();
  double bound_here(std::span<const double> g, double log_det_dual, double trace_of_dual);
  Result optimise(double threshold, bool precise);
  void choose_working_set();
  void form_hessian();
  bool step();
  double search_line(double slope);
  bool limits_exclude_start() const;
  void compact();

  // A count to branch on: up to `floor`, or above.
  struct Probe {
    std::size_t free_index = 0;  // in working_
    std::int32_t floor = 0;
    double down_loss = 0.0, up_loss = 0.0;  // of the bound: estimated, then proven
    double score = 0.0;
  };
  enum class Probing { kUnchanged, kShrunk, kEmpty };

  bool list_fractional();
  bool invert_free_hessian();
  void estimate_losses();
  double probe_half(std::size_t free_index, double shift, std::int32_t lower, std::int32_t upper);
  Probing probe(double threshold);

  void offer_rounded(NodeOutcome& outcome);
  void choose_branch(NodeOutcome& outcome) const;

  [[nodiscard]] bool holds_one_design() const;

  const WhitenedPool& pool_;
  StopClock clock_;
  std::int64_t experiments_;
  double tolerance_;
  std::size_t dimension_;
  std::size_t packed_size_;
  std::size_t stride_;

  // The node, variable by variable.
  std::vector<std::size_t> member_;
  std::vector<std::int32_t> lower_, upper_, whole_;
  std::vector<double> x_, former_x_;
  std::vector<double> price_;  // g
  std::vector<double> probe_price_;
  double bound_ = 0.0;  // the best so far
  double value_ = 0.0;  // f(x)

  BoxBound box_bound_;
  InverseCholesky factor_, probe_factor_;
  std::vector<double> matrix_, direction_matrix_, trial_matrix_;

  std::vector<std::size_t> working_;          // variables
  std::vector<std::size_t> working_members_;  // pool members
  std::vector<std::pair<double, std::size_t>> entering_;
  AlignedArray whitened_;
  std::size_t whitened_rows_ = 0;
  std::vector<double> traces_, hessian_, inverse_hessian_, linear_, step_, step_lower_, step_upper_;
  std::vector<double> scratch_;
  BoxQuadratic quadratic_;
  std::vector<Probe> probes_;
  std::vector<std::pair<double, std::size_t>> fractions_;
  std::int64_t newton_steps_ = 0;
};

}  // namespace graybox
