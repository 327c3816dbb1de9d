#include "solvers/exchange/vertex_exchange.hpp"

#include "solvers/exchange/exchange_loop.hpp"

namespace graybox {
namespace {

constexpr std::int64_t kDefaultIterationLimit = 2'000'000;

bool advance(const ExchangeIteration& at) {
  return at.design.exchange(at.extremes.largest, at.extremes.smallest).step != 0.0;
}

}  // namespace

Solution VertexExchange::solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer) const {
  return run_exchange_method(set, options, observer, kDefaultIterationLimit, advance);
}

}  // namespace graybox
