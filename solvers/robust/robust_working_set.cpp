#include "solvers/robust/robust_working_set.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "problems/kernels/kernels.hpp"
#include "solvers/kernels/dense_kernels.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

constexpr double kViolationShare = 0.3;

double largest_step(const VectorXd& x, const VectorXd& dx) {
  double step = kInfinity;
  for (Index i = 0; i < x.size(); ++i) {
    if (dx(i) < 0.0) step = std::min(step, -x(i) / dx(i));
  }
  return step;
}

Index signed_size(std::size_t size) { return static_cast<Index>(size); }

}  // namespace

RobustWorkingSet::RobustWorkingSet(const RobustProblem& problem)
    : problem_(problem),
      dimension_(problem.first().dimension()),
      packed_size_(problem.first().packed_size()),
      stride_((packed_size_ + 7) / 8 * 8),
      sample_count_(problem.samples.size()),
      group_count_(problem.objective == RobustObjective::kAverage ? 1 : signed_size(sample_count_)),
      prices_(sample_count_, 1.0 / static_cast<double>(sample_count_)),
      inverses_(sample_count_, InverseCholesky(dimension_)),
      scratch_(8 * dimension_ * (dimension_ + 1)),
      packed_(packed_size_) {}

bool RobustWorkingSet::add(std::size_t candidate, double weight) {
  const auto found = std::ranges::find_if(members_, [&](std::size_t member) {
    return member == candidate || equal_everywhere(member, candidate);
  });
  if (found != members_.end()) {
    weights_[static_cast<std::size_t>(found - members_.begin())] += weight;
    return false;
  }
  members_.push_back(candidate);
  weights_.push_back(weight);
  return true;
}

bool RobustWorkingSet::equal_everywhere(std::size_t a, std::size_t b) const {
  return std::ranges::all_of(problem_.samples, [&](const InformationSet* sample) {
    return std::ranges::equal(sample->information(a), sample->information(b));
  });
}

void RobustWorkingSet::drop_below(double sensitivity) {
  std::size_t kept = 0;
  for (std::size_t k = 0; k < members_.size(); ++k) {
    if (weights_[k] == 0.0 && mean_sensitivity_(signed_size(k)) < sensitivity) continue;
    members_[kept] = members_[k];
    weights_[kept] = weights_[k];
    ++kept;
  }
  members_.resize(kept);
  weights_.resize(kept);
}

void RobustWorkingSet::load_rows() {
  const std::size_t n = members_.size();
  rows_.resize(sample_count_ * n * packed_size_);
  auto* row = rows_.data();
  for (const InformationSet* sample : problem_.samples) {
    for (const std::size_t i : members_) {
      std::ranges::copy(sample->information(i), row);
      row += packed_size_;
    }
  }
  order_.resize(n);
  std::iota(order_.begin(), order_.end(), std::size_t{0});
  if (whitened_.size() < n * stride_) whitened_ = AlignedArray(2 * n * stride_);
  gram_.resize(n * n);
  traces_.resize(n);
}

std::size_t RobustWorkingSet::singular_sample() {
  load_rows();
  for (std::size_t s = 0; s < sample_count_; ++s) {
    std::ranges::fill(packed_, 0.0);
    kernels().accumulate(rows_.data() + s * members_.size() * packed_size_, members_.size(),
                         packed_size_, weights_.data(), packed_.data());
    if (!inverses_[s].factor(packed_)) return s;
  }
  return sample_count_;
}

// M_s and its inverse, phi and w. False where some M_s is singular.
bool RobustWorkingSet::evaluate(const VectorXd& weight) {
  const std::size_t n = members_.size();
  const double share = static_cast<double>(group_count_) / static_cast<double>(sample_count_);
  value_.setZero(group_count_);
  sensitivity_.setZero(signed_size(n), group_count_);
  for (std::size_t s = 0; s < sample_count_; ++s) {
    const Index g = group_count_ == 1 ? 0 : signed_size(s);
    const double* rows = rows_.data() + s * n * packed_size_;
    std::ranges::fill(packed_, 0.0);
    kernels().accumulate(rows, n, packed_size_, weight.data(), packed_.data());
    if (!inverses_[s].factor(packed_)) return false;
    value_(g) += share * (inverses_[s].log_det() - problem_.reference(s));
    kernels().price(rows, n, packed_size_, inverses_[s].trace_dual().data(), traces_.data());
    sensitivity_.col(g) += share * Eigen::Map<const VectorXd>(traces_.data(), signed_size(n));
  }
  return true;
}

// Of the normalised weights and prices, after evaluate(); phi shifts by d log(sum lambda) alike for
// all samples.
double RobustWorkingSet::measure_gap(const Point& point) {
  const auto d = static_cast<double>(dimension_);
  const double price_sum = point.price.sum();
  mean_sensitivity_.noalias() = sensitivity_ * point.price;
  mean_sensitivity_ *= point.weight.sum() / price_sum;
  const double mean = point.price.dot(value_) / price_sum;
  spread_ = std::exp(std::max(mean - value_.minCoeff(), 0.0) / d);
  return mean_sensitivity_.maxCoeff() / d * spread_ - 1.0;
}

// Strictly inside; y pi alike for all groups.
void RobustWorkingSet::start() {
  constexpr double kFirstSlack = 0.3;
  const auto n = signed_size(members_.size());
  at_.level = value_.minCoeff() - kFirstSlack;
  at_.slack = value_.array() - at_.level;
  at_.price = at_.slack.cwiseInverse();
  const double mu = 1.0 / at_.price.sum();
  at_.price *= mu;
  mean_sensitivity_.noalias() = sensitivity_ * at_.price;
  at_.cost.resize(n);
  for (Index i = 0; i < n; ++i) {
    at_.cost(i) =
        std::max(static_cast<double>(dimension_) - mean_sensitivity_(i), mu / at_.weight(i));
  }
}

// S + diag(s/lambda) + sum_g q_g (w_g - w~)(w_g - w~)^T.
bool RobustWorkingSet::factorise() {
  const std::size_t n = members_.size();
  const double share = static_cast<double>(group_count_) / static_cast<double>(sample_count_);
  system_.setZero(signed_size(n), signed_size(n));
  for (std::size_t s = 0; s < sample_count_; ++s) {
    const double factor = share * at_.price(group_count_ == 1 ? 0 : signed_size(s));
    if (factor < 1e-13) continue;  // moves no digit of the step
    dense_kernels().whiten(rows_.data() + s * n * packed_size_, order_.data(), n, dimension_,
                           inverses_[s].inverse_factor().data(), whitened_.data(), stride_,
                           traces_.data(), scratch_.data());
    dense_kernels().gram(whitened_.data(), n, stride_, gram_.data());
    system_ += factor * Eigen::Map<const MatrixXd>(gram_.data(), system_.rows(), system_.cols());
  }
  ratio_ = at_.price.cwiseQuotient(at_.slack);
  centre_.noalias() = sensitivity_ * ratio_;
  centre_ /= ratio_.sum();
  if (group_count_ > 1) {
    const MatrixXd centred = (sensitivity_.colwise() - centre_) * ratio_.cwiseSqrt().asDiagonal();
    system_.selfadjointView<Eigen::Lower>().rankUpdate(centred);
  }
  system_.diagonal() += at_.cost.cwiseQuotient(at_.weight);
  return factorise_system();
}

// With more members of positive weight than M has entries the optimal weights are not unique, and
// the system becomes singular as s goes to zero. A little more on the diagonal picks one of the
// steps.
bool RobustWorkingSet::factorise_system() {
  const VectorXd diagonal = system_.diagonal();
  for (const double ridge : {0.0, 1e-14, 1e-12, 1e-10, 1e-8}) {
    system_.diagonal() = (1.0 + ridge) * diagonal;
    factor_.compute(system_.selfadjointView<Eigen::Lower>());
    if (factor_.info() == Eigen::Success) return true;
  }
  return false;
}

// The Newton step for the targets of the products.
void RobustWorkingSet::solve_direction() {
  const auto d = static_cast<double>(dimension_);
  const VectorXd missing = value_ - at_.slack - VectorXd::Constant(group_count_, at_.level);
  // dpi = constant - q (w^T dlambda - dt)
  const VectorXd constant = slack_target_.cwiseQuotient(at_.slack) - ratio_.cwiseProduct(missing);
  const double lack = 1.0 - at_.price.sum() - constant.sum();
  const VectorXd from_weight = weight_target_.cwiseQuotient(at_.weight);
  VectorXd right = sensitivity_ * (at_.price + constant) + at_.cost + from_weight + lack * centre_;
  right.array() -= d;
  step_.weight = factor_.solve(right);
  const VectorXd rise = sensitivity_.transpose() * step_.weight;
  step_.level = (lack + ratio_.dot(rise)) / ratio_.sum();
  step_.slack = rise + missing - VectorXd::Constant(group_count_, step_.level);
  step_.price =
      constant - ratio_.cwiseProduct(rise - VectorXd::Constant(group_count_, step_.level));
  step_.cost = from_weight - at_.cost.cwiseQuotient(at_.weight).cwiseProduct(step_.weight);
}

double RobustWorkingSet::step_to_boundary() const {
  return std::min({1.0, largest_step(at_.weight, step_.weight), largest_step(at_.cost, step_.cost),
                   largest_step(at_.slack, step_.slack), largest_step(at_.price, step_.price)});
}

// Mehrotra's predictor, and with it the targets of the corrector. The products do not fall below
// what y = phi - t is violated by, weighted with the prices: ahead of it they would fix prices that
// the next step has to move again.
void RobustWorkingSet::choose_centring() {
  weight_target_ = -at_.weight.cwiseProduct(at_.cost);
  slack_target_ = -at_.slack.cwiseProduct(at_.price);
  solve_direction();
  const double step = step_to_boundary();
  const double product = at_.weight.dot(at_.cost) + at_.slack.dot(at_.price);
  const double predicted = (at_.weight + step * step_.weight).dot(at_.cost + step * step_.cost) +
                           (at_.slack + step * step_.slack).dot(at_.price + step * step_.price);
  const double ratio = std::clamp(predicted / product, 0.0, 1.0);
  const VectorXd missing = value_ - at_.slack - VectorXd::Constant(group_count_, at_.level);
  const double floor = kViolationShare * at_.price.dot(missing.cwiseAbs());
  const double centring = std::max(ratio * ratio * ratio * product, floor) /
                          static_cast<double>(at_.weight.size() + group_count_);
  weight_target_.array() += centring - (step_.weight.array() * step_.cost.array());
  slack_target_.array() += centring - (step_.slack.array() * step_.price.array());
}

// As far as the boundary and the regularity of all M_s allow; evaluates the new point.
bool RobustWorkingSet::move() {
  const double fraction = best_gap_ > 1e-3 ? 0.95 : 0.999;
  const VectorXd from = at_.weight;
  double step = std::min(1.0, fraction * step_to_boundary());
  for (int attempt = 0; attempt < 20; ++attempt, step *= 0.5) {
    at_.weight = from + step * step_.weight;
    if (!at_.weight.allFinite() || !evaluate(at_.weight)) continue;
    at_.cost += step * step_.cost;
    at_.slack += step * step_.slack;
    at_.price += step * step_.price;
    at_.level += step * step_.level;
    return true;
  }
  return false;
}

bool RobustWorkingSet::optimise(double tolerance, const std::function<bool()>& stop) {
  constexpr int kIterationLimit = 100, kPatience = 12;
  load_rows();
  const auto n = signed_size(members_.size());
  at_.weight = 0.9 * Eigen::Map<const VectorXd>(weights_.data(), n).array() /
                   std::accumulate(weights_.begin(), weights_.end(), 0.0) +
               0.1 / static_cast<double>(n);
  if (!evaluate(at_.weight)) return false;
  start();
  best_gap_ = kInfinity;
  double progress_gap = kInfinity;
  for (int iteration = 0, since_progress = 0; iteration <= kIterationLimit; ++iteration) {
    const double gap = measure_gap(at_);
    if (gap < best_gap_) {
      best_gap_ = gap;
      best_ = at_;
    }
    since_progress = gap < 0.9 * progress_gap ? 0 : since_progress + 1;
    progress_gap = std::min(progress_gap, gap);
    if (gap <= tolerance || since_progress > kPatience || stop()) break;
    ++iterations_;
    if (!factorise()) break;
    choose_centring();
    solve_direction();
    if (!move()) break;
  }
  finish(tolerance);
  return true;
}

// Back to the best point, normalised, less the weights and prices that their multipliers mark as
// zero if the gap allows.
void RobustWorkingSet::finish(double tolerance) {
  const auto d = static_cast<double>(dimension_);
  const double allowed = std::max(tolerance, best_gap_);
  for (const double threshold : {1.0, 1e-2, 1e-4, 0.0}) {
    Point trial = best_;
    for (Index i = 0; i < trial.weight.size(); ++i) {
      if (trial.weight(i) * d < threshold * trial.cost(i)) trial.weight(i) = 0.0;
    }
    for (Index g = 0; g < group_count_; ++g) {
      if (trial.price(g) * d < threshold * trial.slack(g)) trial.price(g) = 0.0;
    }
    const double weight_sum = trial.weight.sum(), price_sum = trial.price.sum();
    if (!(weight_sum > 0.0) || !(price_sum > 0.0)) continue;
    trial.weight /= weight_sum;
    trial.price /= price_sum;
    if (!evaluate(trial.weight)) continue;
    gap_ = measure_gap(trial);
    if (gap_ > allowed && threshold > 0.0) continue;
    std::ranges::copy(trial.weight, weights_.begin());
    for (std::size_t s = 0; s < sample_count_; ++s) {
      prices_[s] = group_count_ == 1 ? 1.0 / static_cast<double>(sample_count_)
                                     : trial.price(signed_size(s));
    }
    return;
  }
}

}  // namespace graybox
