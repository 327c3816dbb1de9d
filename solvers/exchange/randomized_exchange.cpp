#include "solvers/exchange/randomized_exchange.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "problems/base/random.hpp"
#include "problems/base/stop.hpp"
#include "solvers/exchange/exchange_loop.hpp"

namespace graybox {
namespace {

constexpr std::int64_t kDefaultIterationLimit = 100'000;
constexpr std::size_t kLeadersPerParameter = 4;  // the paper's gamma
constexpr double kEqualSensitivity = 1e-14;      // relative difference that is but rounding

void shuffle(std::vector<std::size_t>& items, Random& random) {
  for (std::size_t i = items.size(); i > 1; --i) std::swap(items[i - 1], items[random.below(i)]);
}

class SubspaceAscent {
 public:
  explicit SubspaceAscent(std::uint64_t seed) : random_(seed) {}

  bool advance(const ExchangeIteration& at) {
    const auto leading = at.design.exchange(at.extremes.largest, at.extremes.smallest);
    choose_leaders(at);
    support_ = at.design.support();
    shuffle(leaders_, random_);
    shuffle(support_, random_);
    bool moved = leading.step != 0.0;
    for (const std::size_t leader : leaders_) {
      for (const std::size_t member : support_) {
        if (stop_requested()) return moved;
        moved |= exchange(at.design, leader, member, leading.nullifying);
      }
    }
    return moved;
  }

 private:
  void choose_leaders(const ExchangeIteration& at) {
    const std::size_t count =
        std::min(kLeadersPerParameter * at.set.dimension(), at.set.candidate_count());
    leaders_.resize(at.set.candidate_count());
    std::iota(leaders_.begin(), leaders_.end(), std::size_t{0});
    const auto by_sensitivity = [&](std::size_t a, std::size_t b) {
      const double x = at.sensitivities[a], y = at.sensitivities[b];
      return x > y || (x == y && a < b);
    };
    std::ranges::nth_element(leaders_, leaders_.begin() + static_cast<std::ptrdiff_t>(count - 1),
                             by_sensitivity);
    leaders_.resize(count);
    std::ranges::sort(leaders_);
  }

  static bool exchange(ExchangeDesign& design, std::size_t leader, std::size_t member,
                       bool only_nullifying) {
    const double to = design.weight(leader), from = design.weight(member);
    if (leader == member || (to == 0.0 && from == 0.0)) return false;
    const double w_to = design.sensitivity(leader), w_from = design.sensitivity(member);
    design.note_candidates_read(2);
    if (std::abs(w_to - w_from) <= kEqualSensitivity * std::max(w_to, w_from)) return false;
    if (w_to > w_from ? from == 0.0 : to == 0.0) return false;  // nothing to give
    return design.exchange(leader, member, only_nullifying).step != 0.0;
  }

  Random random_;
  std::vector<std::size_t> leaders_;
  std::vector<std::size_t> support_;
};

}  // namespace

Solution RandomizedExchange::solve(const InformationSet& set, const SolveOptions& options,
                                   SolveObserver* observer) const {
  SubspaceAscent method(options.seed);
  return run_exchange_method(set, options, observer, kDefaultIterationLimit,
                             [&](const ExchangeIteration& at) { return method.advance(at); });
}

}  // namespace graybox
