#include "solvers/floors/floored_design.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "problems/base/error.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/core/candidate_region.hpp"
#include "solvers/core/tracer.hpp"

namespace graybox {
namespace {

constexpr double kFinestCompound = 1e-11;
constexpr double kFinestSharp = 1e-9;  // with E or G, which a barrier smooths
constexpr double kMargin = 1e-12;      // of e_k: what two sums of the same numbers may differ by
constexpr int kMostRounds = 40;
constexpr int kMostTrials = 80;

class FloorSearch {
 public:
  FloorSearch(const InformationSet& set, const SolveOptions& options,
              std::vector<EfficiencyFloor>& floors, SolveObserver* observer)
      : set_(set), options_(options), floors_(floors), tracer_(set, options, observer) {
    for (EfficiencyFloor& floor : floors_) {
      floor.multiplier = 0.0;
      best_.push_back(best_log_phi(set, floor.criterion));
      levels_.push_back(std::log(floor.share) + best_.back().most + kMargin);
    }
  }

  Solution run() {
    if (!solve()) return finish();
    for (int round = 0; round < kMostRounds; ++round) {
      for (std::size_t k = 0; k < floors_.size(); ++k) {
        if (!meet(k)) return finish();
      }
      if (judge()) break;
      require_no_contradiction();
    }
    return finish();
  }

 private:
  struct Trial {
    double share = 0.0;   // t
    double excess = 0.0;  // e_k
    Design design;
  };

  // The compound design of the present multipliers, and all e_k. False where there is none.
  bool solve() {
    double all = 1.0;
    for (const EfficiencyFloor& floor : floors_) all += floor.multiplier;
    SolveOptions options = options_;
    options.criterion = compound_of(options_.criterion, floors_);
    options.duality_gap = is_smooth() ? std::max(1e-4 * options_.duality_gap / all, kFinestCompound)
                                      : std::max(0.05 * options_.duality_gap / all, kFinestSharp);
    options.time_limit = options_.time_limit - tracer_.seconds();
    if (!(options.time_limit > 0.0) || tracer_.out_of_time()) return stop();
    Solution solution = ColumnGeneration().solve(set_, options);
    ++iterations_;
    tracer_.count_passes(solution.counters.passes);
    if (solution.status == SolveStatus::kTimeLimit) return stop();
    if (solution.design.weights.empty()) {
      message_ = solution.message;
      return false;
    }
    design_ = std::move(solution.design);
    return true;
  }

  // Whether no part of the compound has kinks.
  [[nodiscard]] bool is_smooth() const {
    const auto has_kinks = [](const Criterion& each) {
      return each.kind() == CriterionKind::kE || each.kind() == CriterionKind::kG;
    };
    return !has_kinks(options_.criterion) &&
           std::ranges::none_of(floors_, [&](const EfficiencyFloor& floor) {
             return floor.multiplier > 0.0 && has_kinks(floor.criterion);
           });
  }

  bool stop() {
    status_ = SolveStatus::kTimeLimit;
    return false;
  }

  [[nodiscard]] double excess(const Design& design, std::size_t k) const {
    const LogPhi phi = log_phi_of(set_, design, floors_[k].criterion);
    return phi.value - phi.error - levels_[k];
  }

  // Sets the multiplier of floor k from its share in the compound, and solves.
  bool try_share(std::size_t k, double share, Trial& trial) {
    double others = 1.0;
    for (std::size_t j = 0; j < floors_.size(); ++j) others += j == k ? 0.0 : floors_[j].multiplier;
    floors_[k].multiplier = share / (1.0 - share) * others;
    if (!solve()) return false;
    trial = {share, excess(design_, k), design_};
    return true;
  }

  // What e_k may exceed zero by.
  [[nodiscard]] double allowed(std::size_t k) const {
    return 0.2 * options_.duality_gap / static_cast<double>(floors_.size()) /
           std::max(floors_[k].multiplier, 1e-3);
  }

  bool meet(std::size_t k) {
    Trial low, high;
    if (!try_share(k, 0.0, low)) return false;
    if (low.excess >= 0.0) return true;
    for (double share = 0.5;; share = 1.0 - 0.25 * (1.0 - share)) {
      if (1.0 - share < 1e-9) return true;  // another floor stands against it
      if (!try_share(k, share, high)) return false;
      if (high.excess >= 0.0) break;
      low = std::move(high);
    }
    return close_in(k, std::move(low), std::move(high));
  }

  // Illinois: regula falsi that halves the value of an end that stays.
  bool close_in(std::size_t k, Trial low, Trial high) {
    double low_value = low.excess, high_value = high.excess;
    for (int trial = 0; trial < kMostTrials && high.excess > allowed(k); ++trial) {
      if (!(high.share - low.share > 1e-13)) break;
      const double cut = low_value / (low_value - high_value);
      const double share = low.share + std::clamp(cut, 0.001, 0.999) * (high.share - low.share);
      Trial next;
      if (!try_share(k, share, next)) return false;
      if (next.excess >= 0.0) {
        high = std::move(next);
        high_value = high.excess;
        low_value *= 0.5;
      } else {
        low = std::move(next);
        low_value = low.excess;
        high_value *= 0.5;
      }
    }
    take(k, low, high);
    return true;
  }

  // The design of `high`, or the mixture of both ends that just meets the floor: log Phi_k is
  // concave, so that the mixture by the chord of e_k meets it too.
  void take(std::size_t k, const Trial& low, const Trial& high) {
    double others = 1.0;
    for (std::size_t j = 0; j < floors_.size(); ++j) others += j == k ? 0.0 : floors_[j].multiplier;
    floors_[k].multiplier = high.share / (1.0 - high.share) * others;
    design_ = high.design;
    if (!(low.excess < 0.0) || !(high.excess > allowed(k))) return;
    const double part = high.excess / (high.excess - low.excess);
    for (std::size_t i = 0; i < design_.weights.size(); ++i) {
      design_.weights[i] += part * (low.design.weights[i] - high.design.weights[i]);
    }
    if (excess(design_, k) < 0.0) design_ = high.design;
  }

  // Whether the present design is proven, and the best so far.
  bool judge() {
    const FlooredCertificate proof =
        certify_floored(set_, design_, options_.criterion, floors_, options_.duality_gap, best_);
    const double gap = proof.certificate.status == CertificateStatus::kCertified
                           ? largest_gap(proof.certificate)
                           : std::numeric_limits<double>::infinity();
    tracer_.record(gap, iterations_);
    if (gap < best_gap_ || answer_.weights.empty()) {
      best_gap_ = gap;
      answer_ = design_;
      multipliers_.clear();
      for (const EfficiencyFloor& floor : floors_) multipliers_.push_back(floor.multiplier);
    }
    if (!proves(proof.certificate, options_.duality_gap)) return false;
    status_ = SolveStatus::kSolved;
    return true;
  }

  // With s_k = u_k / sum u, no design has sum s_k log Phi_k above that of the compound of the
  // floors by more than its gap. Below sum s_k b_k they contradict each other.
  void require_no_contradiction() const {
    if (floors_.size() < 2) return;
    std::vector<CriterionPart> parts;
    std::string names;
    for (const EfficiencyFloor& floor : floors_) {
      if (!(floor.multiplier > 0.0)) continue;
      parts.push_back({floor.multiplier, floor.criterion});
      names += fmt::format("{}{}={:.6g}", names.empty() ? "" : ", ",
                           to_string(floor.criterion.kind()), floor.share);
    }
    if (parts.size() < 2) return;
    const Criterion floors_alone = Criterion::compound(std::move(parts));
    const Certificate proof = certify(set_, of_floors_alone(), floors_alone);
    if (proof.status != CertificateStatus::kCertified) return;
    double reach = 0.0, all = 0.0;
    for (std::size_t k = 0; k < floors_.size(); ++k) {
      const LogPhi phi = log_phi_of(set_, design_, floors_[k].criterion);
      reach += floors_[k].multiplier *
               (phi.value + phi.error - std::log(floors_[k].share) - best_[k].least);
      all += floors_[k].multiplier;
    }
    if (reach / all + std::log1p(largest_gap(proof)) >= -1e-12) return;
    throw InputError(fmt::format(
        "the floors {} contradict each other: no design reaches all of them; lower one", names));
  }

  // The present design without what proves it under the objective, which comes first.
  [[nodiscard]] Design of_floors_alone() const {
    Design design = design_;
    if (options_.criterion.kind() != CriterionKind::kG) return design;
    const std::size_t points = over_candidates(options_.criterion, set_).region().count();
    if (points <= design.dual_weights.size()) {
      design.dual_weights.erase(design.dual_weights.begin(),
                                design.dual_weights.begin() + static_cast<std::ptrdiff_t>(points));
    }
    return design;
  }

  Solution finish() {
    if (answer_.weights.empty()) (void)judge();
    for (std::size_t k = 0; k < floors_.size() && k < multipliers_.size(); ++k) {
      floors_[k].multiplier = multipliers_[k];
    }
    return tracer_.finish(std::move(answer_), status_, iterations_, std::move(message_));
  }

  const InformationSet& set_;
  const SolveOptions& options_;
  std::vector<EfficiencyFloor>& floors_;
  Tracer tracer_;
  std::vector<BestLogPhi> best_;
  std::vector<double> levels_;  // b_k, by the upper bound of Phi_k*
  Design design_, answer_;
  std::vector<double> multipliers_;  // of answer_
  double best_gap_ = std::numeric_limits<double>::infinity();
  SolveStatus status_ = SolveStatus::kNumericalFailure;
  std::string message_;
  std::int64_t iterations_ = 0;
};

}  // namespace

Solution solve_floored(const InformationSet& set, const SolveOptions& options,
                       std::vector<EfficiencyFloor>& floors, SolveObserver* observer) {
  require_fits(options.criterion, floors, set);
  return FloorSearch(set, options, floors, observer).run();
}

}  // namespace graybox
