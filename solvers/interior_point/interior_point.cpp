#include "solvers/interior_point/interior_point.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "problems/base/packed_matrix.hpp"
#include "problems/kernels/kernels.hpp"
#include "solvers/core/claim.hpp"
#include "solvers/core/lapack.hpp"

namespace graybox {
namespace {

// Lower triangle of a column-major d x d array.
void pack_lower(std::span<const double> square, std::size_t d, std::span<double> packed) {
  for (std::size_t i = 0, k = 0; i < d; ++i) {
    for (std::size_t j = 0; j <= i; ++j, ++k) packed[k] = square[j * d + i];
  }
}

}  // namespace

DesignEvaluator::DesignEvaluator(const NormalizedSet& normal)
    : normal_(normal),
      information_(normal.packed_size()),
      square_(normal.dimension() * normal.dimension()),
      factor_(normal.packed_size()),
      inverse_factor_(normal.packed_size()),
      trace_dual_(normal.packed_size()),
      traces_(normal.candidate_count()) {}

bool DesignEvaluator::evaluate(std::span<const double> multipliers) {
  const std::size_t d = normal_.dimension(), p = normal_.packed_size();
  const std::size_t count = normal_.candidate_count();
  std::ranges::fill(information_, 0.0);
  kernels().accumulate(normal_.rows(), count, p, multipliers.data(), information_.data());
  unpack(information_.data(), d, square_.data());
  if (!lapack::factorise_cholesky(d, square_.data())) return false;
  pack_lower(square_, d, factor_);
  lapack::invert_lower(d, square_.data());
  pack_lower(square_, d, inverse_factor_);
  for (std::size_t i = 0, k = 0; i < d; ++i) {
    for (std::size_t j = 0; j <= i; ++j, ++k) {
      double inverse = 0.0;  // (L^-T L^-1)_ij
      for (std::size_t l = i; l < d; ++l) {
        inverse += inverse_factor_[packed_index(l, i)] * inverse_factor_[packed_index(l, j)];
      }
      trace_dual_[k] = i == j ? inverse : 2.0 * inverse;
    }
  }
  kernels().price(normal_.rows(), count, p, trace_dual_.data(), traces_.data());

  weight_sum_ = 0.0;
  double largest = 0.0;
  bool finite = true;
  for (std::size_t i = 0; i < count; ++i) {
    finite = finite && std::isfinite(traces_[i]);
    weight_sum_ += multipliers[i] / normal_.row_norms()[i];
    largest = std::max(largest, traces_[i] * normal_.row_norms()[i]);
  }
  gap_ = largest * weight_sum_ / static_cast<double>(d) - 1.0;
  return finite && std::isfinite(gap_);
}

double DesignEvaluator::gap_rounding() const {
  return graybox::gap_rounding(information_, trace_dual_, normal_.dimension()) + normal_.rounding();
}

double step_to_boundary(std::span<const double> x, std::span<const double> dx) {
  double fastest = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) fastest = std::max(fastest, -dx[i] / x[i]);
  return fastest > 0.0 ? 1.0 / fastest : std::numeric_limits<double>::infinity();
}

double boundary_fraction(double gap) { return 1.0 - std::clamp(0.1 * gap, 1e-6, 0.01); }

InteriorPointRun::InteriorPointRun(const NormalizedSet& normal, const SolveOptions& options,
                                   Tracer& tracer)
    : normal_(normal),
      options_(options),
      tracer_(tracer),
      iteration_limit_(options.iteration_limit > 0 ? options.iteration_limit
                                                   : kDefaultIterationLimit),
      target_(0.98 * options.duality_gap),
      progress_gap_(std::numeric_limits<double>::infinity()),
      best_gap_(std::numeric_limits<double>::infinity()),
      best_(normal.row_norms().begin(), normal.row_norms().end()) {}  // equal weights

bool InteriorPointRun::proceed(bool evaluated, const DesignEvaluator& evaluator,
                               std::span<const double> multipliers) {
  constexpr std::int64_t kPatience = 15;
  ++iteration_;
  if (!evaluated) {
    fail("the information matrix of the iterate is numerically singular");
    return false;
  }
  tracer_.count_passes(2.0);
  const double gap = evaluator.gap();
  tracer_.record(gap, iteration_);
  if (gap < best_gap_) {
    best_gap_ = gap;
    std::ranges::copy(multipliers, best_.begin());
  }
  if (gap <= 0.9 * progress_gap_) {
    progress_gap_ = gap;
    last_progress_ = iteration_;
  }
  const double rounding = evaluator.gap_rounding();
  if (gap <= std::min(target_, gap_to_stop_at(options_.duality_gap, rounding))) {
    Claim claim = claim_at(options_.duality_gap, rounding);
    status_ = claim.status;
    message_ = std::move(claim.message);
  } else if (tracer_.out_of_time()) {
    status_ = SolveStatus::kTimeLimit;
  } else if (iteration_ >= iteration_limit_) {
    status_ = SolveStatus::kIterationLimit;
  } else if (iteration_ - last_progress_ >= kPatience) {
    fail(fmt::format("no progress in {} iterations", kPatience));
  } else {
    return true;
  }
  return false;
}

double InteriorPointRun::centring(double product, double predicted) const {
  const double ratio = std::clamp(predicted / product, 0.0, 1.0);
  const double floor = 0.02 * target_ * static_cast<double>(normal_.dimension());
  return std::max(ratio * ratio * ratio * product, floor) /
         static_cast<double>(normal_.candidate_count());
}

void InteriorPointRun::fail(std::string message) {
  if (tracer_.out_of_time()) {  // that is why
    status_ = SolveStatus::kTimeLimit;
    return;
  }
  message_ =
      fmt::format("{}; best duality gap {:.3g} in {} iterations", message, best_gap_, iteration_);
  const bool solved = std::isfinite(best_gap_) && best_gap_ <= options_.duality_gap;
  status_ = solved ? SolveStatus::kSolved : SolveStatus::kNumericalFailure;
}

void InteriorPointRun::drop_negligible(std::span<const double> reduced_costs) {
  const auto d = static_cast<double>(normal_.dimension());
  const std::span<const double> norms = normal_.row_norms();
  DesignEvaluator evaluator(normal_);
  double sum = 0.0;
  for (std::size_t i = 0; i < best_.size(); ++i) sum += best_[i] / norms[i];

  std::vector<double> kept(best_.size());
  const auto keep_if = [&](auto in_support) {
    for (std::size_t i = 0; i < best_.size(); ++i) kept[i] = in_support(i) ? best_[i] : 0.0;
    tracer_.count_passes(2.0);
    if (!evaluator.evaluate(kept) || evaluator.gap() > target_) return false;
    best_.swap(kept);
    return true;
  };
  const auto weight = [&](std::size_t i) { return best_[i] / norms[i] / sum; };
  for (const double threshold : {1.0, 1e-2, 1e-4, 1e-6, 1e-8}) {
    const auto in_support = [&](std::size_t i) {
      return weight(i) * d >= threshold * reduced_costs[i] * norms[i];
    };
    if (keep_if(in_support)) return;
  }
  // With mass m dropped, M' >= (1 - m d (1 + gap)) M, because the trace of M^-1 times what is
  // dropped is at most m d (1 + gap): the gap rises by about m d at most, and this attempt
  // succeeds.
  const double budget = 0.5 * (target_ - best_gap_) / d;
  double cut = 1.0 / d, mass = 1.0;
  while (cut > std::numeric_limits<double>::min() && mass > budget) {
    cut *= 0.1;
    mass = 0.0;
    for (std::size_t i = 0; i < best_.size(); ++i) mass += weight(i) < cut ? weight(i) : 0.0;
  }
  keep_if([&](std::size_t i) { return weight(i) >= cut; });
}

Solution InteriorPointRun::finish(std::span<const double> reduced_costs) {
  if (status_ == SolveStatus::kSolved) drop_negligible(reduced_costs);
  Design design{std::vector<double>(best_.size())};
  normal_.weights_from_multipliers(best_, design.weights);
  return tracer_.finish(std::move(design), status_, std::max<std::int64_t>(iteration_, 0),
                        std::move(message_));
}

Solution unsupported(const InformationSet& set, Tracer& tracer, std::string message) {
  if (tracer.out_of_time()) {  // equal weights are a design, too
    const auto count = set.candidate_count();
    return tracer.finish({std::vector<double>(count, 1.0 / static_cast<double>(count))},
                         SolveStatus::kTimeLimit, 0, std::move(message));
  }
  return tracer.finish({}, SolveStatus::kUnsupported, 0, std::move(message));
}

}  // namespace graybox
