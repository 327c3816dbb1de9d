// What the three Ipopt back-ends share: one Form tells Ipopt the problem, run() drives it.
//
// Ipopt works on its own notion of an error (dual infeasibility, constraint violation and
// complementarity, in the units of the form). Those are not the duality gap, so its tolerances are
// set out of the way. Every iterate is turned into weights and judged by max_i tr(M^-1 H_i)/d - 1.
// The cost of that, one or two passes over the set, is on the clock. Ipopt stops when that gap is
// met. If it stops by itself before, it is started again from the best weights so far, with the
// barrier parameter that belongs to their gap, as long as each start at least halves the gap.
//
// MUMPS, the linear solver beneath Ipopt, keeps global state: runs in one process take turns, and
// the clock starts when the turn comes. Nothing stops it within a factorisation: where time is up,
// run() returns the best design and leaves the factorisation to a thread that ends after it.
#pragma once

#include <IpTNLP.hpp>
#include <span>
#include <vector>

#include "solvers/conditioning/normalized_set.hpp"
#include "solvers/core/solver.hpp"

namespace graybox::ipopt {

class Session;

// One statement of the problem. Variables, constraints and derivatives are the TNLP virtuals; the
// rest is the way between weights and iterates.
class Form : public Ipopt::TNLP {
 public:
  // The set must be whitened, its rows not scaled, and outlive the form.
  explicit Form(const NormalizedSet& set) : set_(set) {}

  // Sets the point that get_starting_point() will give: the image of these weights, moved off the
  // boundary as far as the barrier parameter asks.
  virtual void start_from(std::span<const double> weights, double duality_gap, double barrier) = 0;

  // Weights of an iterate, up to a factor; negative values will be clipped.
  virtual void weights_of(const double* variables, const double* multipliers,
                          std::span<double> weights) const = 0;

  void attach(Session& session) { session_ = &session; }

  bool intermediate_callback(Ipopt::AlgorithmMode mode, Ipopt::Index iteration,
                             Ipopt::Number objective, Ipopt::Number primal_infeasibility,
                             Ipopt::Number dual_infeasibility, Ipopt::Number barrier,
                             Ipopt::Number step, Ipopt::Number regularization,
                             Ipopt::Number dual_step_size, Ipopt::Number primal_step_size,
                             Ipopt::Index line_search_trials, const Ipopt::IpoptData* data,
                             Ipopt::IpoptCalculatedQuantities* quantities) final;
  void finalize_solution(Ipopt::SolverReturn status, Ipopt::Index variable_count,
                         const Ipopt::Number* variables, const Ipopt::Number* lower_multipliers,
                         const Ipopt::Number* upper_multipliers, Ipopt::Index constraint_count,
                         const Ipopt::Number* constraints, const Ipopt::Number* multipliers,
                         Ipopt::Number objective, const Ipopt::IpoptData* data,
                         Ipopt::IpoptCalculatedQuantities* quantities) final;

 protected:
  // For use in long evaluations: true once the time is up (Ipopt itself asks only once an
  // iteration); the evaluation then returns false and the run ends.
  [[nodiscard]] bool interrupted() const;
  [[nodiscard]] const NormalizedSet& set() const { return set_; }

  // packed = sum_i factors_i B_i, and out_i = tr(W B_i) for W in trace-dual packing.
  void sum_candidates(std::span<const double> factors, std::span<double> packed) const;
  void price_candidates(std::span<const double> trace_dual, double* out) const;
  void count_pass() const;  // for other loops over all candidates

 private:
  const NormalizedSet& set_;
  Session* session_ = nullptr;
  std::vector<double> variables_;  // of the iterate being judged
  std::vector<double> multipliers_;
};

using MakeForm = Form* (*)(const NormalizedSet& set);  // ownership goes to an Ipopt::SmartPtr

// Runs Ipopt on the form, with the statuses of solver.hpp. Throws InputError for options out of
// range.
[[nodiscard]] Solution run(const InformationSet& set, const SolveOptions& options,
                           SolveObserver* observer, MakeForm make_form);

}  // namespace graybox::ipopt
