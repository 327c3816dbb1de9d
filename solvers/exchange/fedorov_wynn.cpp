#include "solvers/exchange/fedorov_wynn.hpp"

#include "solvers/exchange/exchange_loop.hpp"

namespace graybox {
namespace {

constexpr std::int64_t kDefaultIterationLimit = 2'000'000;

bool advance(const ExchangeIteration& at) {
  const double d = static_cast<double>(at.set.dimension());
  const Extremes& extremes = at.extremes;
  const bool towards = extremes.largest_sensitivity - d >= d - extremes.smallest_sensitivity;
  const std::size_t first = towards ? extremes.largest : extremes.smallest;
  const std::size_t second = towards ? extremes.smallest : extremes.largest;
  return at.design.step_to_vertex(first).step != 0.0 ||
         at.design.step_to_vertex(second).step != 0.0;
}

}  // namespace

Solution FedorovWynn::solve(const InformationSet& set, const SolveOptions& options,
                            SolveObserver* observer) const {
  return run_exchange_method(set, options, observer, kDefaultIterationLimit, advance);
}

}  // namespace graybox
