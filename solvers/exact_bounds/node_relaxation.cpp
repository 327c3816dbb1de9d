#include "solvers/exact_bounds/node_relaxation.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "problems/base/packed_matrix.hpp"
#include "solvers/kernels/dense_kernels.hpp"

namespace graybox {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kIntegral = 1e-6;  // a count this close to a whole number is one
constexpr double kAtLimit = 1e-9;   // a count this close to its limit is at it
constexpr int kNewtonLimit = 60;
constexpr std::size_t kProbes = 8;  // halves are bounded for this many candidates at least

double trace_of(std::span<const double> trace_dual, std::size_t dimension) {
  double trace = 0.0;
  for (std::size_t i = 0; i < dimension; ++i) trace += trace_dual[packed_index(i, i)];
  return trace;
}

}  // namespace

NodeRelaxation::NodeRelaxation(const WhitenedPool& pool, std::int64_t experiments, double tolerance,
                               StopClock clock)
    : pool_(pool),
      clock_(clock),
      experiments_(experiments),
      tolerance_(tolerance),
      dimension_(pool.dimension()),
      packed_size_(pool.packed_size()),
      stride_((pool.packed_size() + 7) / 8 * 8),
      box_bound_(pool.dimension()),
      factor_(pool.dimension()),
      probe_factor_(pool.dimension()),
      matrix_(packed_size_),
      direction_matrix_(packed_size_),
      trial_matrix_(packed_size_),
      scratch_(8 * dimension_ * (dimension_ + 1)) {}

void NodeRelaxation::load(const TreeNode& node) {
  member_.clear();
  lower_.clear();
  upper_.clear();
  x_.clear();
  for (std::size_t k = 0; k < node.box->size(); ++k) {
    const BoxEntry& entry = (*node.box)[k];
    std::int32_t lower = entry.lower, upper = entry.upper;
    if (k == node.entry) {
      lower = std::max(lower, node.lower);
      upper = std::min(upper, node.upper);
    }
    if (upper == 0) continue;
    member_.push_back(entry.member);
    lower_.push_back(lower);
    upper_.push_back(upper);
    x_.push_back(static_cast<double>(entry.start));
  }
  price_.assign(member_.size(), 0.0);
  probe_price_.resize(member_.size());
  // Prices where the parent ended guide the way back into the box, unless the half left X singular.
  if (!evaluate()) std::ranges::fill(price_, 0.0);
}

// Moves x into the box and its sum to M, first by the variables inside their limits, then by those
// that are worth most. False if the box has no such point.
bool NodeRelaxation::repair_start() {
  double lack = static_cast<double>(experiments_);
  std::int64_t least = 0, most = 0;
  for (std::size_t i = 0; i < x_.size(); ++i) {
    x_[i] = std::clamp(x_[i], static_cast<double>(lower_[i]), static_cast<double>(upper_[i]));
    lack -= x_[i];
    least += lower_[i];
    most += upper_[i];
  }
  if (least > experiments_ || most < experiments_) return false;
  double room = 0.0;
  const auto room_inside = [&](std::size_t i) {
    if (!(x_[i] > lower_[i] && x_[i] < upper_[i])) return 0.0;
    return lack > 0.0 ? upper_[i] - x_[i] : x_[i] - lower_[i];
  };
  for (std::size_t i = 0; i < x_.size(); ++i) room += room_inside(i);
  if (room > 0.0) {
    const double share = std::min(std::abs(lack) / room, 1.0);
    double moved = 0.0;
    for (std::size_t i = 0; i < x_.size(); ++i) {
      const double change = std::copysign(share * room_inside(i), lack);
      x_[i] += change;
      moved += change;
    }
    lack -= moved;
  }
  if (std::abs(lack) > 1e-12 * static_cast<double>(experiments_)) spread(lack, 2 * dimension_);
  return true;
}

// Adds `lack` (of either sign) to x over at least `variables` variables that have room, the best
// priced first, in proportion to their room.
void NodeRelaxation::spread(double lack, std::size_t variables) {
  const auto room_of = [&](std::size_t i) {
    return lack > 0.0 ? upper_[i] - x_[i] : x_[i] - lower_[i];
  };
  entering_.clear();
  for (std::size_t i = 0; i < x_.size(); ++i) {
    if (room_of(i) > 0.0) entering_.emplace_back(std::copysign(price_[i], -lack), i);
  }
  std::ranges::sort(entering_);
  double room = 0.0;
  std::size_t taken = 0;
  while (taken < entering_.size() && (taken < variables || room < std::abs(lack))) {
    room += room_of(entering_[taken++].second);
  }
  if (!(room > 0.0)) return;
  const double share = std::copysign(std::min(std::abs(lack) / room, 1.0), lack);
  for (std::size_t k = 0; k < taken; ++k) {
    const std::size_t i = entering_[k].second;
    x_[i] += share * room_of(i);
  }
}

// A regular point of the box, of few variables: from the lower limits, the free runs are spread
// over the candidates that the centre of the box prices highest, over more of them until X is
// regular. False if X is singular at the centre, where its rank is largest: no design in the box is
// regular.
bool NodeRelaxation::restart() {
  double width = 0.0, left = static_cast<double>(experiments_);
  for (std::size_t i = 0; i < x_.size(); ++i) {
    width += upper_[i] - lower_[i];
    left -= lower_[i];
  }
  for (std::size_t i = 0; i < x_.size(); ++i) {
    x_[i] = lower_[i] + (width > 0.0 ? left / width * (upper_[i] - lower_[i]) : 0.0);
  }
  if (!evaluate()) return false;
  former_x_ = x_;
  for (std::size_t variables = 2 * dimension_; variables < x_.size(); variables *= 2) {
    for (std::size_t i = 0; i < x_.size(); ++i) x_[i] = lower_[i];
    spread(left, variables);
    if (evaluate()) return true;
  }
  x_ = former_x_;
  return evaluate();
}

// X, its inverse, f and the prices at x. False if X is singular.
bool NodeRelaxation::evaluate() {
  std::ranges::fill(matrix_, 0.0);
  for (std::size_t i = 0; i < x_.size(); ++i) {
    if (x_[i] <= 0.0) continue;
    const auto row = pool_.row(member_[i]);
    for (std::size_t k = 0; k < packed_size_; ++k) matrix_[k] += x_[i] * row[k];
  }
  if (!factor_.factor(matrix_)) return false;
  value_ = factor_.log_det();
  dense_kernels().price_indexed(pool_.rows(), member_.data(), member_.size(), packed_size_,
                                factor_.trace_dual().data(), price_.data());
  return true;
}

double NodeRelaxation::bound_here(std::span<const double> g, double log_det_dual,
                                  double trace_of_dual) {
  return box_bound_.evaluate(g, lower_, upper_, experiments_, log_det_dual,
                             pool_.sensitivity_rounding() * trace_of_dual);
}

void NodeRelaxation::choose_working_set() {
  working_.clear();
  entering_.clear();
  const double nu = box_bound_.multiplier();
  for (std::size_t i = 0; i < x_.size(); ++i) {
    if (lower_[i] == upper_[i]) continue;
    const double below = x_[i] - lower_[i], above = upper_[i] - x_[i];
    if (below > kAtLimit && above > kAtLimit) {
      working_.push_back(i);
    } else {
      const double gain = below > kAtLimit ? nu - price_[i] : price_[i] - nu;
      if (gain >= 0.0) entering_.emplace_back(gain, i);
    }
  }
  // The rest waits for the next step, if it still wants to enter then.
  const std::size_t taken = std::min(entering_.size(), 2 * dimension_ + 2);
  std::ranges::partial_sort(entering_, entering_.begin() + static_cast<std::ptrdiff_t>(taken),
                            [](const auto& a, const auto& b) {
                              return a.first > b.first ||
                                     (a.first == b.first && a.second < b.second);
                            });
  for (std::size_t k = 0; k < taken; ++k) working_.push_back(entering_[k].second);
}

// K on the working set, with a proximal term that keeps it definite where candidates are dependent.
void NodeRelaxation::form_hessian() {
  const std::size_t n = working_.size();
  if (whitened_rows_ < n) {
    whitened_rows_ = 2 * n;
    whitened_ = AlignedArray(whitened_rows_ * stride_);
    traces_.resize(whitened_rows_);
    hessian_.resize(whitened_rows_ * whitened_rows_);
    inverse_hessian_.resize(whitened_rows_ * whitened_rows_);
    for (auto* vector : {&linear_, &step_, &step_lower_, &step_upper_}) {
      vector->resize(whitened_rows_);
    }
    quadratic_.reserve(whitened_rows_);
  }
  working_members_.clear();
  for (const std::size_t i : working_) working_members_.push_back(member_[i]);
  dense_kernels().whiten(pool_.rows(), working_members_.data(), n, dimension_,
                         factor_.inverse_factor().data(), whitened_.data(), stride_, traces_.data(),
                         scratch_.data());
  dense_kernels().gram(whitened_.data(), n, stride_, hessian_.data());
  double trace = 0.0;
  for (std::size_t i = 0; i < n; ++i) trace += hessian_[i * n + i];
  for (std::size_t i = 0; i < n; ++i) hessian_[i * n + i] += 1e-9 * trace / static_cast<double>(n);
}

// How far to go along step_: Armijo's rule on f. Zero if nothing is gained.
double NodeRelaxation::search_line(double slope) {
  std::ranges::fill(direction_matrix_, 0.0);
  for (std::size_t a = 0; a < working_.size(); ++a) {
    const auto row = pool_.row(working_members_[a]);
    for (std::size_t k = 0; k < packed_size_; ++k) direction_matrix_[k] += step_[a] * row[k];
  }
  for (double length = 1.0; length > 1e-6; length *= 0.4) {
    for (std::size_t k = 0; k < packed_size_; ++k) {
      trial_matrix_[k] = matrix_[k] + length * direction_matrix_[k];
    }
    if (probe_factor_.log_det_of(trial_matrix_) >= value_ + 0.1 * length * slope) return length;
  }
  return 0.0;
}

// One Newton step. False if it gains nothing.
bool NodeRelaxation::step() {
  ++newton_steps_;
  choose_working_set();
  const std::size_t n = working_.size();
  if (n < 2) return false;
  form_hessian();
  for (std::size_t a = 0; a < n; ++a) {
    const std::size_t i = working_[a];
    linear_[a] = price_[i] - box_bound_.multiplier();
    step_lower_[a] = std::min(lower_[i] - x_[i], 0.0);
    step_upper_[a] = std::max(upper_[i] - x_[i], 0.0);
  }
  const std::span<double> y(step_.data(), n);
  if (!quadratic_.solve({hessian_.data(), n * n}, {linear_.data(), n}, {step_lower_.data(), n},
                        {step_upper_.data(), n}, y)) {
    return false;
  }
  double slope = 0.0;
  for (std::size_t a = 0; a < n; ++a) slope += linear_[a] * y[a];
  if (!(slope > 1e-14)) return false;
  const double length = slope < 1e-4 ? 1.0 : search_line(slope);
  if (length == 0.0) return false;
  for (std::size_t a = 0; a < n; ++a) {
    const std::size_t i = working_[a];
    const auto low = static_cast<double>(lower_[i]), high = static_cast<double>(upper_[i]);
    double moved = x_[i] + length * y[a];
    if (moved - low < kAtLimit) moved = low;
    if (high - moved < kAtLimit) moved = high;
    x_[i] = moved;
  }
  return true;
}

// Newton's method until the bound of the box is at most the threshold (kDone), or is known well
// enough to branch.
NodeRelaxation::Result NodeRelaxation::optimise(double threshold, bool precise) {
  if (!repair_start() || (!evaluate() && !restart())) {
    bound_ = -kInfinity;
    return Result::kDone;
  }
  for (int iteration = 0;; ++iteration) {
    const double bound = bound_here(price_, -value_, trace_of(factor_.trace_dual(), dimension_));
    bound_ = std::min(bound_, bound);
    if (bound_ <= threshold) return Result::kDone;
    double wanted = 0.25 * tolerance_;
    if (!precise) {
      wanted = std::isfinite(threshold) ? std::max(0.02 * (bound_ - threshold), wanted) : 1e-3;
    }
    if (bound - value_ <= wanted || iteration == kNewtonLimit || clock_.stops()) {
      return Result::kSolved;
    }
    former_x_ = x_;
    if (!step()) return Result::kSolved;
    if (!evaluate()) {  // the step lost rank: back to where X had it
      x_ = former_x_;
      return evaluate() ? Result::kSolved : Result::kDone;
    }
  }
}

bool NodeRelaxation::limits_exclude_start() const {
  for (std::size_t i = 0; i < x_.size(); ++i) {
    if (x_[i] < lower_[i] - kAtLimit || x_[i] > upper_[i] + kAtLimit) return true;
  }
  return false;
}

// Forgets the candidates that are run no times.
void NodeRelaxation::compact() {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < x_.size(); ++i) {
    if (upper_[i] == 0) continue;
    member_[kept] = member_[i];
    lower_[kept] = lower_[i];
    upper_[kept] = upper_[i];
    x_[kept] = x_[i];
    price_[kept] = price_[i];
    ++kept;
  }
  member_.resize(kept);
  lower_.resize(kept);
  upper_.resize(kept);
  x_.resize(kept);
  price_.resize(kept);
  probe_price_.resize(kept);
}

// The variables inside their limits, in working_, and those of them that are not whole, in probes_.
// False if all counts are whole.
bool NodeRelaxation::list_fractional() {
  working_.clear();
  probes_.clear();
  for (std::size_t i = 0; i < x_.size(); ++i) {
    if (x_[i] - lower_[i] <= kAtLimit || upper_[i] - x_[i] <= kAtLimit) continue;
    const double nearest = std::round(x_[i]);
    if (std::abs(x_[i] - nearest) > kIntegral) {
      probes_.push_back(
          {.free_index = working_.size(), .floor = static_cast<std::int32_t>(std::floor(x_[i]))});
    }
    working_.push_back(i);
  }
  return !probes_.empty();
}

// C' of the header for the free set working_, in inverse_hessian_. False where K is not definite.
bool NodeRelaxation::invert_free_hessian() {
  form_hessian();
  const std::size_t n = working_.size();
  double trace = 0.0;
  for (std::size_t i = 0; i < n; ++i) trace += hessian_[i * n + i];
  if (!dense_kernels().cholesky(hessian_.data(), n, 1e-18 * trace)) return false;
  for (std::size_t j = 0; j < n; ++j) {
    double* column = inverse_hessian_.data() + j * n;
    std::fill_n(column, n, 0.0);
    column[j] = 1.0;
    dense_kernels().cholesky_solve(hessian_.data(), n, column);
  }
  double total = 0.0;
  for (std::size_t j = 0; j < n; ++j) {
    double sum = 0.0;
    for (std::size_t i = 0; i < n; ++i) sum += inverse_hessian_[j * n + i];
    linear_[j] = sum;
    total += sum;
  }
  for (std::size_t j = 0; j < n; ++j) {
    for (std::size_t i = 0; i < n; ++i) {
      inverse_hessian_[j * n + i] -= linear_[i] * linear_[j] / total;
    }
  }
  return true;
}

// A bound of the box with its variable i = working_[free_index] limited to lower .. upper: one
// Newton step that moves it by `shift`, as far as the other counts' limits allow, then (3) of
// box_bound.hpp with the W found there.
double NodeRelaxation::probe_half(std::size_t free_index, double shift, std::int32_t lower,
                                  std::int32_t upper) {
  const std::size_t n = working_.size();
  const double* column = inverse_hessian_.data() + free_index * n;
  const double pivot = column[free_index];
  if (!(pivot > 0.0)) return bound_;
  std::ranges::copy(matrix_, trial_matrix_.begin());
  for (std::size_t a = 0; a < n; ++a) {
    const std::size_t i = working_[a];
    const double moved = std::clamp(x_[i] + shift * column[a] / pivot,
                                    static_cast<double>(lower_[i]), static_cast<double>(upper_[i]));
    const double change = moved - x_[i];
    const auto row = pool_.row(working_members_[a]);
    for (std::size_t k = 0; k < packed_size_; ++k) trial_matrix_[k] += change * row[k];
  }
  if (!probe_factor_.factor(trial_matrix_)) return bound_;
  dense_kernels().price_indexed(pool_.rows(), member_.data(), member_.size(), packed_size_,
                                probe_factor_.trace_dual().data(), probe_price_.data());
  const std::size_t variable = working_[free_index];
  std::swap(lower, lower_[variable]);
  std::swap(upper, upper_[variable]);
  const double bound = bound_here(probe_price_, -probe_factor_.log_det(),
                                  trace_of(probe_factor_.trace_dual(), dimension_));
  std::swap(lower, lower_[variable]);
  std::swap(upper, upper_[variable]);
  return std::min(bound, bound_);
}

// Losses of both halves to second order, best choice first.
void NodeRelaxation::estimate_losses() {
  const std::size_t n = working_.size();
  for (Probe& half : probes_) {
    const double x = x_[working_[half.free_index]];
    const double pivot = std::max(inverse_hessian_[half.free_index * n + half.free_index], 1e-300);
    const double down = x - half.floor, up = half.floor + 1 - x;
    half.down_loss = 0.5 * down * down / pivot;
    half.up_loss = 0.5 * up * up / pivot;
    half.score = half.down_loss * half.up_loss;
  }
  std::ranges::sort(probes_, [](const Probe& a, const Probe& b) {
    return a.score > b.score || (a.score == b.score && a.free_index < b.free_index);
  });
}

NodeRelaxation::Probing NodeRelaxation::probe(double threshold) {
  if (!invert_free_hessian()) return Probing::kUnchanged;
  estimate_losses();
  const double needed = bound_ - threshold;  // a half that loses this much is given up
  Probing result = Probing::kUnchanged;
  for (std::size_t rank = 0; rank < probes_.size() && !clock_.stops(); ++rank) {
    Probe& half = probes_[rank];
    const bool promising = std::max(half.down_loss, half.up_loss) > 0.7 * needed;
    if (rank >= kProbes && !promising) {
      half.score = -1.0;  // not a choice
      continue;
    }
    const std::size_t i = working_[half.free_index];
    const double x = x_[i];
    const double down = probe_half(half.free_index, half.floor - x, lower_[i], half.floor);
    const double up = probe_half(half.free_index, half.floor + 1 - x, half.floor + 1, upper_[i]);
    half.down_loss = bound_ - down;
    half.up_loss = bound_ - up;
    half.score = std::max(half.down_loss, 1e-12) * std::max(half.up_loss, 1e-12);
    if (down <= threshold && up <= threshold) return Probing::kEmpty;
    if (down <= threshold) lower_[i] = half.floor + 1;
    if (up <= threshold) upper_[i] = half.floor;
    if (down <= threshold || up <= threshold) result = Probing::kShrunk;
  }
  return result;
}

// The design next to x: counts rounded down, then the largest fractions up until there are M.
void NodeRelaxation::offer_rounded(NodeOutcome& outcome) {
  std::int64_t left = experiments_;
  fractions_.clear();
  whole_.resize(x_.size());
  for (std::size_t i = 0; i < x_.size(); ++i) {
    whole_[i] =
        std::clamp(static_cast<std::int32_t>(std::floor(x_[i] + kIntegral)), lower_[i], upper_[i]);
    left -= whole_[i];
    if (whole_[i] < upper_[i]) fractions_.emplace_back(whole_[i] - x_[i], i);
  }
  std::ranges::sort(fractions_);
  for (std::size_t k = 0; left > 0 && k < fractions_.size(); ++k, --left) {
    ++whole_[fractions_[k].second];
  }
  if (left != 0) return;
  outcome.design.clear();
  std::ranges::fill(trial_matrix_, 0.0);
  for (std::size_t i = 0; i < x_.size(); ++i) {
    if (whole_[i] == 0) continue;
    outcome.design.emplace_back(static_cast<std::uint32_t>(member_[i]), whole_[i]);
    const auto row = pool_.row(member_[i]);
    for (std::size_t k = 0; k < packed_size_; ++k) trial_matrix_[k] += whole_[i] * row[k];
  }
  outcome.design_log_det = probe_factor_.log_det_of(trial_matrix_);
}

// The lower limits add up to M, or the upper ones, or one count alone is open.
bool NodeRelaxation::holds_one_design() const {
  std::int64_t least = 0, most = 0;
  std::size_t open = 0;
  for (std::size_t i = 0; i < x_.size(); ++i) {
    least += lower_[i];
    most += upper_[i];
    open += lower_[i] < upper_[i] ? 1U : 0U;
  }
  return open <= 1 || least == experiments_ || most == experiments_;
}

// The half-way point of the best-scored count, or of the widest box if all counts are whole.
void NodeRelaxation::choose_branch(NodeOutcome& outcome) const {
  const Probe* best = nullptr;
  for (const Probe& half : probes_) {
    if (best == nullptr || half.score > best->score) best = &half;
  }
  outcome.down_bound = outcome.up_bound = bound_;
  std::size_t chosen = 0;
  if (best != nullptr) {
    chosen = working_[best->free_index];
    outcome.floor = best->floor;
    outcome.down_bound -= best->down_loss;
    outcome.up_bound -= best->up_loss;
  } else {
    for (std::size_t i = 1; i < x_.size(); ++i) {
      if (upper_[i] - lower_[i] > upper_[chosen] - lower_[chosen]) chosen = i;
    }
    const auto whole = static_cast<std::int32_t>(std::lround(x_[chosen]));
    outcome.floor = std::clamp(whole, lower_[chosen], upper_[chosen] - 1);
  }
  auto box = std::make_shared<CountBox>();
  box->reserve(x_.size());
  for (std::size_t i = 0; i < x_.size(); ++i) {
    box->push_back({.member = static_cast<std::uint32_t>(member_[i]),
                    .lower = lower_[i],
                    .upper = upper_[i],
                    .start = static_cast<float>(x_[i])});
  }
  outcome.entry = static_cast<std::uint32_t>(chosen);
  outcome.box = std::move(box);
}

NodeOutcome NodeRelaxation::process(const TreeNode& node, double threshold) {
  NodeOutcome outcome;
  bound_ = node.bound;
  load(node);
  bool precise = false;
  for (;;) {
    if (optimise(threshold, precise) == Result::kDone) break;
    if (box_bound_.tighten(price_, threshold, {lower_, upper_}) > 0) {
      outcome.shrunk = true;
      const bool again = limits_exclude_start();
      compact();
      if (again) continue;
    }
    if (clock_.stops()) {
      outcome.stopped = true;
      return outcome;
    }
    if (holds_one_design()) {
      outcome.design.clear();
      offer_rounded(outcome);
      outcome.is_one_design = !outcome.design.empty();
      if (!outcome.is_one_design) bound_ = -kInfinity;  // the counts can't add up to M
      break;
    }
    if (!list_fractional()) {
      if (!precise) {
        precise = true;
        continue;
      }
      offer_rounded(outcome);
      if (bound_ <= outcome.design_log_det + tolerance_) break;
    } else {
      const Probing probing = probe(threshold);
      if (probing == Probing::kEmpty) {
        bound_ = threshold;
        break;
      }
      if (probing == Probing::kShrunk) {
        outcome.shrunk = true;
        compact();
        continue;
      }
      offer_rounded(outcome);
    }
    choose_branch(outcome);
    outcome.bound = bound_;
    return outcome;
  }
  // What was given up against the threshold may be as good as the threshold.
  outcome.bound = std::min(node.bound, std::max(bound_, threshold));
  return outcome;
}

}  // namespace graybox
