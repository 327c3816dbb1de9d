// Robust D-optimal design: one design for N samples of what is not known, each with its own
// information set over the same candidates. With M_s(lambda) = sum_i lambda_i H_{s,i} and
//
//   phi_s(lambda) = log det M_s(lambda) - c_s,
//
//   average      maximise  (1/N) sum_s phi_s(lambda)      (c_s does not matter to the design),
//   worst case   maximise  min_s phi_s(lambda).
//
// With c_s = 0 it is the absolute worst case: the sample under which least is learnt decides, even
// where no design could do better. With c_s = the sample's own optimum, log det M_s*, exp(phi_s/d)
// is the D-efficiency under sample s, and the design maximises the smallest one. That is what
// `graybox design robust` takes unless told otherwise. Information about theta relative to each
// sample's own value, as for stiffness factors, differs from information in fixed units by a
// congruence. That is a constant in log det M_s for each sample. It changes the absolute worst case
// alone.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/core/design.hpp"
#include "solvers/core/solver.hpp"

namespace graybox {

enum class RobustObjective { kAverage, kWorstCase };
[[nodiscard]] std::string_view to_string(RobustObjective objective);  // "average", "worst_case"
// The inverse. Throws InputError for another name.
[[nodiscard]] RobustObjective robust_objective(std::string_view name);

// The sets are referred to, not copied.
struct RobustProblem {
  std::vector<const InformationSet*> samples;
  RobustObjective objective = RobustObjective::kAverage;
  std::vector<double> references;  // c_s; empty: all 0

  [[nodiscard]] const InformationSet& first() const { return *samples.front(); }
  [[nodiscard]] double reference(std::size_t s) const {
    return references.empty() ? 0.0 : references[s];
  }
};

// Throws InputError unless there is at least one sample and all have the candidates (number and,
// where given, coordinates) and parameters of the first; the message names the set that has not.
// Also where references are given but not one finite number a sample.
void require_shared_candidates(const RobustProblem& problem);

// The D-optimal design of each sample alone and its log det, the c_s of the relative worst case, by
// column_generation. `duality_gap` is the largest checked gap among them: each log_det may be short
// of its optimum by d log(1 + duality_gap). Status other than kSolved: the first that was not.
struct SampleOptima {
  std::vector<Design> designs;
  std::vector<double> log_det;
  double duality_gap = 0.0;
  SolveStatus status = SolveStatus::kSolved;
  std::string message;
};
// on_sample hears how many are found, after each.
[[nodiscard]] SampleOptima sample_optima(const std::vector<const InformationSet*>& samples,
                                         const SolveOptions& options,
                                         const std::function<void(std::size_t)>& on_sample = {});

// The checker. For multipliers pi on the simplex, phi_s concave and w_i = sum_s pi_s tr(M_s^-1
// H_{s,i}), every design lambda' has
//
//   min_s phi_s(lambda') <= sum_s pi_s phi_s(lambda')
//      <= sum_s pi_s phi_s(lambda) + sum_s pi_s d log(tr(M_s^-1 M_s')/d)
//      <= sum_s pi_s phi_s(lambda) + d log(max_i w_i/d)
//
// (inequality of the arithmetic and geometric mean, concavity of the logarithm). So the objective
// of lambda is short of the optimum by at most
//
//   log_det_gap = [sum_s pi_s phi_s - min_s phi_s] + d log(max_i w_i/d) = d log(1 + duality_gap),
//
// whatever the pi: a poor one makes the bound weak, never wrong. For the average, pi_s = 1/N and
// the bracket is absent. In both cases the design is optimal where duality_gap = 0, and
// `efficiency` >= 1/(1 + duality_gap) compares exp(objective/d) with that of the optimum.
struct RobustCertificate {
  Certificate certificate;      // log_det: the objective, mean or minimum of the phi_s
  std::vector<double> log_det;  // log det M_s
  std::vector<double> prices;   // the pi used: clipped, normalised
  std::size_t worst_sample = 0;
};

// `prices`: pi for the worst case; negative or useless ones are replaced by zero, or all by 1/N.
// Extended precision; one pass over all samples.
[[nodiscard]] RobustCertificate certify_robust(const RobustProblem& problem, const Design& design,
                                               const std::vector<double>& prices = {});

}  // namespace graybox
