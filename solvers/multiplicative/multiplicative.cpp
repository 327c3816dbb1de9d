#include "solvers/multiplicative/multiplicative.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "problems/base/error.hpp"
#include "solvers/conditioning/conditioned_set.hpp"
#include "solvers/core/claim.hpp"
#include "solvers/core/inverse_cholesky.hpp"
#include "solvers/core/sensitivity.hpp"
#include "solvers/core/tracer.hpp"
#include "solvers/core/warm_start.hpp"
#include "solvers/multiplicative/reweigh_pass.hpp"
#include "solvers/restricted_problem/criterion_frame.hpp"

namespace graybox {
namespace {

constexpr std::int64_t kDefaultIterationLimit = 10'000'000;
constexpr double kNegligibleShare = 1e-17;

// lambda_i H_i <= lambda_i tr(M^-1 H_i) M: a weight with a negligible bound does not show in M.
Design without_negligible_weights(std::vector<double> weights, std::span<const double> w) {
  double total = 0.0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (!(weights[i] * std::max(w[i], 1.0) > kNegligibleShare)) weights[i] = 0.0;
    total += weights[i];
  }
  for (double& weight : weights) weight /= total;
  return {std::move(weights)};
}

// (1 - share) of the design, and share of that of equal weights.
void blend(double share, std::span<const double> uniform, std::vector<double>& weights,
           std::vector<double>& information) {
  const double each = share / static_cast<double>(weights.size());
  for (double& weight : weights) weight = (1.0 - share) * weight + each;
  for (std::size_t k = 0; k < information.size(); ++k) {
    information[k] = (1.0 - share) * information[k] + share * uniform[k];
  }
}

// Weights and information matrix of the start; false, with both as they were, where that matrix is
// singular.
bool begin_from(std::span<const double> start, const InformationSet& set, Tracer& tracer,
                InverseCholesky& factor, std::vector<double>& weights,
                std::vector<double>& information) {
  std::vector<double> first = simplex_start(start), matrix(information.size());
  information_matrix(set, first, matrix);
  tracer.count_candidates(static_cast<std::size_t>(
      std::ranges::count_if(first, [](double weight) { return weight > 0.0; })));
  if (!factor.factor(matrix)) return false;
  weights = std::move(first);
  information = std::move(matrix);
  return true;
}

void require_factor(const InformationSet& set, const Criterion& criterion) {
  criterion.require_fits(set);
  if (!criterion.has_factor()) {
    throw InputError(
        fmt::format("multiplicative does not solve criterion {}", to_string(criterion.kind())));
  }
}

}  // namespace

Solution Multiplicative::solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer) const {
  Tracer tracer(set, options, observer);
  require_factor(set, options.criterion);
  const ConditionedSet conditioned(set, kSensitivityAccuracy * options.duality_gap, tracer);
  const std::size_t count = set.candidate_count();
  const bool plain = options.criterion.kind() == CriterionKind::kD;
  const double optimum = plain ? static_cast<double>(set.dimension()) : 1.0;
  const std::int64_t limit =
      options.iteration_limit > 0 ? options.iteration_limit : kDefaultIterationLimit;

  std::vector<double> weights(count, 1.0 / static_cast<double>(count));
  std::vector<double> former(weights), w(count, 0.0);
  std::vector<double> information(conditioned.uniform_information().begin(),
                                  conditioned.uniform_information().end());
  InverseCholesky factor(set.dimension());
  const bool asked = !options.start.empty();
  const bool warm =
      asked && begin_from(options.start, conditioned.set(), tracer, factor, weights, information);
  CriterionFrame frame(options.criterion, set.dimension(), conditioned.coordinates());
  ReweighPass pass(set.dimension(), options.threads);
  std::int64_t iteration = 0;
  // The sensitivities belong to the weights before the step: those are the answer.
  const auto finish = [&](SolveStatus status, std::string message = {}) {
    if (!plain && status != SolveStatus::kNumericalFailure) {
      sensitivities(conditioned.set(), factor.trace_dual(), w);  // tr(M^-1 H_i)
      tracer.count_passes(1.0);
    }
    if (asked && !warm) message = without_start(message);
    return tracer.finish(without_negligible_weights(std::move(former), w), status, iteration,
                         std::move(message));
  };
  while (true) {
    if (!factor.factor(information)) {
      return finish(SolveStatus::kNumericalFailure, "the information matrix became singular");
    }
    std::ranges::copy(weights, former.begin());
    const double rounding = gap_rounding(information, factor.trace_dual(), set.dimension());
    if (plain) {
      pass.run(conditioned.set().data(), factor.trace_dual(), weights, w, information);
    } else {
      frame.compute(factor);
      pass.run_root(conditioned.set().data(), frame.trace_dual(), weights, w, information);
    }
    tracer.count_passes(1.0);
    const double gap = *std::ranges::max_element(w) / optimum - 1.0;
    tracer.record(gap, iteration);
    if (gap <= gap_to_stop_at(options.duality_gap, rounding)) {
      Claim claim = claim_at(options.duality_gap, rounding);
      return finish(claim.status, std::move(claim.message));
    }
    if (tracer.out_of_time()) return finish(SolveStatus::kTimeLimit);
    if (iteration == limit) return finish(SolveStatus::kIterationLimit);
    if (warm && iteration == 0) {
      blend(uniform_share(gap), conditioned.uniform_information(), weights, information);
    }
    ++iteration;
  }
}

}  // namespace graybox
