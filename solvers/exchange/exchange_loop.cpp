#include "solvers/exchange/exchange_loop.hpp"

#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "solvers/conditioning/conditioned_set.hpp"
#include "solvers/core/claim.hpp"
#include "solvers/core/tracer.hpp"
#include "solvers/core/warm_start.hpp"
#include "solvers/exchange/start_design.hpp"

namespace graybox {
namespace {

// True if log det M has not risen above rounding for many iterations.
class ProgressWatch {
 public:
  bool stalled(double log_det, std::int64_t iteration) {
    if (iteration < next_check_) return false;
    next_check_ = iteration + kWindow;
    const double rounding =
        4.0 * std::numeric_limits<double>::epsilon() * std::max(1.0, std::abs(log_det));
    const bool gained = log_det > last_ + rounding;
    last_ = log_det;
    return !gained;
  }

 private:
  static constexpr std::int64_t kWindow = 10000;
  std::int64_t next_check_ = kWindow;
  double last_ = -std::numeric_limits<double>::infinity();
};

bool own_start(const ConditionedSet& conditioned, Tracer& tracer, ExchangeDesign& design) {
  if (design.assign(start_design(conditioned, tracer))) return true;
  std::vector<std::size_t> all(conditioned.set().candidate_count());
  std::iota(all.begin(), all.end(), std::size_t{0});
  return design.assign(all);
}

}  // namespace

Solution run_exchange_method(const InformationSet& set, const SolveOptions& options,
                             SolveObserver* observer, std::int64_t default_limit,
                             const AdvanceFunction& advance) {
  Tracer tracer(set, options, observer);
  const ConditionedSet conditioned(set, kSensitivityAccuracy * options.duality_gap, tracer);
  ExchangeDesign design(conditioned.set());
  std::vector<double> sensitivities(set.candidate_count());
  const double d = static_cast<double>(set.dimension());
  const std::int64_t limit = options.iteration_limit > 0 ? options.iteration_limit : default_limit;
  ProgressWatch watch;

  std::int64_t iteration = 0;
  const bool asked = !options.start.empty();
  const bool warm = asked && design.assign_weights(simplex_start(options.start));
  const auto finish = [&](SolveStatus status, std::string message = {}) {
    if (asked && !warm) message = without_start(message);
    return tracer.finish({design.weights()}, status, iteration, std::move(message));
  };
  if (!warm && !own_start(conditioned, tracer, design)) {
    return finish(SolveStatus::kNumericalFailure, "no regular starting design was found");
  }
  while (true) {
    const Extremes extremes = price_all(conditioned.set(), design, sensitivities);
    tracer.count_passes(1.0);
    tracer.count_candidates(design.take_candidates_read());
    const double gap = extremes.largest_sensitivity / d - 1.0;
    tracer.record(gap, iteration);
    const double rounding = design.gap_rounding();
    if (gap <= gap_to_stop_at(options.duality_gap, rounding)) {
      Claim claim = claim_at(options.duality_gap, rounding);
      return finish(claim.status, std::move(claim.message));
    }
    if (tracer.out_of_time()) return finish(SolveStatus::kTimeLimit);
    if (iteration == limit) return finish(SolveStatus::kIterationLimit);
    if (!std::isfinite(gap)) {
      return finish(SolveStatus::kNumericalFailure, "the sensitivities are not finite");
    }
    ++iteration;
    const bool moved = advance(
        {conditioned.set(), design, extremes, sensitivities, conditioned.uniform_information()});
    if (tracer.out_of_time()) return finish(SolveStatus::kTimeLimit);  // moves were left out
    if (!moved || watch.stalled(design.log_det(), iteration)) {
      return finish(SolveStatus::kNumericalFailure, "no move gains in double precision any more");
    }
    if (!design.refresh()) {
      return finish(SolveStatus::kNumericalFailure, "the information matrix became singular");
    }
  }
}

}  // namespace graybox
