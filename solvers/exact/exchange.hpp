// exchange: Fedorov's exchange (local_exchange.hpp) from many starts, on the candidates that
// survive screening.
//
//   1. The paper's rounding, efficient rounding and a design grown one run at a time are improved
//      on a small pool: the relaxation's support and the candidates of the largest sensitivities.
//   2. The best of them screens the set (exact_screening.hpp): no optimal design is lost, and nor
//      is any exchange that could lead to a better one.
//   3. On the survivors: all of these again, random starts drawn from lambda, then rounds of
//      iterated local search, each of which replaces one to three runs of the best design at random
//      and improves the result, until 48 in a row gain nothing. A better design screens again.
//
// What it proves is the relaxation's bound. Randomised by the seed; the same answer for any number
// of threads. A start costs about as many exchange steps as the start differs from its optimum,
// each a pricing of the pool for every distinct candidate in the design.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "solvers/exact/exact_method.hpp"

namespace graybox {

struct ExchangeResult {
  std::vector<std::int64_t>
      counts;            // over the whole set; the paper's rounding if nothing is better
  double log_det = 0.0;  // minus infinity if no regular design was found
  std::int64_t steps = 0;
};

// `observer` is asked between starts; progress shows the relaxation's bound.
[[nodiscard]] ExchangeResult search_by_exchange(const InformationSet& set,
                                                const Relaxation& relaxation,
                                                const ExactOptions& options,
                                                ExactObserver* observer = nullptr);

class Exchange : public ExactMethod {
 public:
  [[nodiscard]] std::string_view name() const override { return "exchange"; }
  [[nodiscard]] std::string_view description() const override {
    return "Fedorov exchange from roundings and random starts, on screened candidates";
  }
  [[nodiscard]] ExactSolution solve(const InformationSet& set, const Relaxation& relaxation,
                                    const ExactOptions& options,
                                    ExactObserver* observer = nullptr) const override;
};

}  // namespace graybox
