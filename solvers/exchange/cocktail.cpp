#include "solvers/exchange/cocktail.hpp"

#include <algorithm>
#include <limits>
#include <span>
#include <vector>

#include "problems/base/packed_matrix.hpp"
#include "problems/base/stop.hpp"
#include "solvers/exchange/exchange_loop.hpp"

namespace graybox {
namespace {

constexpr std::int64_t kDefaultIterationLimit = 1'000'000;

class Mixture {
 public:
  bool advance(const ExchangeIteration& at) {
    const bool stepped = at.design.step_to_vertex(at.extremes.largest).step != 0.0;
    const bool exchanged = exchange_neighbours(at);
    return at.design.reweigh() && (stepped || exchanged || at.design.support().size() > 1);
  }

 private:
  bool exchange_neighbours(const ExchangeIteration& at) {
    if (metric_.empty()) set_metric(at.uniform_information, at.set.dimension());
    chain_ = at.design.support();
    std::ranges::sort(chain_);  // an order that does not depend on how points came and went
    bool exchanged = false;
    for (std::size_t k = 0; k + 1 < chain_.size(); ++k) {
      if (stop_requested()) return exchanged;
      const std::size_t next = nearest_after(at.set, k);
      at.design.note_candidates_read(chain_.size() - k);
      exchanged |= at.design.exchange(next, chain_[k]).step != 0.0;
    }
    return exchanged;
  }

  // Squares of the scale of each packed entry; entries off the diagonal count twice.
  void set_metric(std::span<const double> uniform, std::size_t d) {
    metric_.resize(uniform.size());
    for (std::size_t r = 0; r < d; ++r) {
      for (std::size_t c = 0; c <= r; ++c) {
        const double scale = uniform[packed_index(r, r)] * uniform[packed_index(c, c)];
        metric_[packed_index(r, c)] = (r == c ? 1.0 : 2.0) / scale;
      }
    }
  }

  [[nodiscard]] std::size_t nearest_after(const InformationSet& set, std::size_t position) const {
    const auto h = set.information(chain_[position]);
    double nearest = std::numeric_limits<double>::infinity();
    std::size_t best = chain_[position + 1];
    for (std::size_t k = position + 1; k < chain_.size(); ++k) {
      const auto other = set.information(chain_[k]);
      double distance = 0.0;
      for (std::size_t j = 0; j < metric_.size(); ++j) {
        const double difference = h[j] - other[j];
        distance += metric_[j] * difference * difference;
      }
      if (distance < nearest) {
        nearest = distance;
        best = chain_[k];
      }
    }
    return best;
  }

  std::vector<double> metric_;
  std::vector<std::size_t> chain_;
};

}  // namespace

Solution Cocktail::solve(const InformationSet& set, const SolveOptions& options,
                         SolveObserver* observer) const {
  Mixture method;
  return run_exchange_method(set, options, observer, kDefaultIterationLimit,
                             [&](const ExchangeIteration& at) { return method.advance(at); });
}

}  // namespace graybox
