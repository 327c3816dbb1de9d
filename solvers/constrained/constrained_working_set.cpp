#include "solvers/constrained/constrained_working_set.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "problems/base/packed_matrix.hpp"
#include "problems/base/stop.hpp"
#include "problems/kernels/kernels.hpp"
#include "solvers/constrained/multiplier_bound.hpp"
#include "solvers/kernels/dense_kernels.hpp"

namespace graybox {
namespace {

using Eigen::Index;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kToBoundary = 0.995;
constexpr double kRowTolerance = 1e-10;    // relative, of the rows
constexpr double kEquationWidth = 1e-9;    // rows whose bounds are closer count as equations
constexpr std::size_t kLargestFace = 400;  // free efforts of a last Newton step
constexpr double kCoarse = 1e-2;           // a gap of a first round, whose rows need not hold yet
constexpr double kLongestStep = 1.5;       // in |B|_F
constexpr double kNearLimit = 1e-3;        // of an effort, relative
constexpr double kSmallestComplementarity = 1e-20;

}  // namespace

ConstrainedWorkingSet::ConstrainedWorkingSet(const Criterion& criterion, std::size_t dimension,
                                             std::span<const double> coordinates,
                                             std::span<const double> prior,
                                             const DesignConstraints& constraints)
    : constraints_(constraints),
      dimension_(dimension),
      packed_size_(packed_size(dimension)),
      inverse_(dimension),
      is_determinant_(criterion.kind() == CriterionKind::kD),
      prior_(prior.begin(), prior.end()),
      matrix_(packed_size_),
      dual_(packed_size_),
      gram_(nullptr, 0, static_cast<Index>((packed_size_ + 7) / 8 * 8)),
      scratch_(8 * dimension * (dimension + 1)),
      root_weight_(packed_size_),
      unpacked_(static_cast<Index>(dimension), static_cast<Index>(dimension)) {
  if (criterion.kind() == CriterionKind::kCompound) {
    for (const CriterionPart& part : criterion.parts()) {
      parts_.push_back({part.share, CriterionFrame(part.criterion, dimension, coordinates)});
    }
  } else {
    parts_.push_back({1.0, CriterionFrame(criterion, dimension, coordinates)});
  }
  for (Part& part : parts_) {
    part.frame.smooth_by_barrier();
    is_smoothed_ = is_smoothed_ || part.frame.is_smoothed();
    largest_power_ = std::max(largest_power_, part.frame.rank_one());
  }
  set_sharpness(1.0);
  const auto m = static_cast<Index>(constraints.rows.size());
  state_.s_limits.lower.resize(m);
  state_.s_limits.upper.resize(m);
  is_slack_.resize(m);
  for (Index j = 0; j < m; ++j) {
    const LinearConstraint& row = constraints.rows[static_cast<std::size_t>(j)];
    const double size = std::max(std::abs(row.lower), std::abs(row.upper));
    const bool equation = std::isfinite(size) && row.upper - row.lower <= kEquationWidth * size;
    state_.s_limits.lower(j) = equation ? 0.5 * (row.lower + row.upper) : row.lower;
    state_.s_limits.upper(j) = equation ? state_.s_limits.lower(j) : row.upper;
    is_slack_(j) = equation ? 0.0 : 1.0;
  }
  state_.s_limits.at_lower = state_.s_limits.at_upper = state_.y = state_.s = Vector::Zero(m);
}

bool ConstrainedWorkingSet::add(std::size_t candidate, const double* information) {
  if (!members_.insert(candidate).second) return false;
  candidates_.push_back(candidate);
  rows_.insert(rows_.end(), information, information + packed_size_);
  return true;
}

// Limits, rows and states of all members; those of new members are set by start().
void ConstrainedWorkingSet::resize() {
  const auto n = static_cast<Index>(size());
  const auto m = static_cast<Index>(constraints_.rows.size());
  for (Vector* v : {&state_.x, &state_.x_limits.at_lower, &state_.x_limits.at_upper}) {
    v->conservativeResizeLike(Vector::Zero(n));
  }
  state_.x_limits.lower.resize(n);
  state_.x_limits.upper.resize(n);
  a_.resize(m, n);
  for (Index k = 0; k < n; ++k) {
    const std::size_t i = candidates_[static_cast<std::size_t>(k)];
    state_.x_limits.lower(k) = constraints_.lower_of(i);
    state_.x_limits.upper(k) = constraints_.upper_of(i);
    for (Index j = 0; j < m; ++j) {
      a_(j, k) = constraints_.rows[static_cast<std::size_t>(j)].coefficients[i];
    }
  }
}

// Multipliers of the limits with (value - lower) at_lower at least mu, and likewise above.
void ConstrainedWorkingSet::centre(const Vector& value, double mu, Limited& limited) const {
  for (Index k = 0; k < value.size(); ++k) {
    const double below = value(k) - limited.lower(k), above = limited.upper(k) - value(k);
    limited.at_lower(k) =
        std::isfinite(limited.lower(k)) ? std::max(limited.at_lower(k), mu / below) : 0.0;
    limited.at_upper(k) =
        std::isfinite(limited.upper(k)) ? std::max(limited.at_upper(k), mu / above) : 0.0;
  }
}

// Inside all limits, with a complementarity that suits the gap.
void ConstrainedWorkingSet::start(double pool_gap) {
  const auto n = static_cast<Index>(size());
  const auto fresh = static_cast<Index>(fresh_);
  const double mu = std::clamp(pool_gap, 1e-14, 1.0) / static_cast<double>(limit_count());
  const bool cold = fresh == 0;
  double most_effort = 0.0;  // if every member were run as often as it may be
  for (Index k = 0; k < n; ++k) {
    most_effort += a_(0, k) * constraints_.largest_effort(candidates_[static_cast<std::size_t>(k)]);
  }
  const double feasible = std::min(0.5, constraints_.rows.front().upper / most_effort);
  for (Index k = 0; k < n; ++k) {
    const std::size_t i = candidates_[static_cast<std::size_t>(k)];
    const double lower = state_.x_limits.lower(k);
    const double room = constraints_.largest_effort(i) - lower;
    const double share = room * feasible;
    const double least = (cold ? 1.0 : std::min(1.0, pool_gap)) * share;
    if (k >= fresh) state_.x(k) = lower + least;
    const double inside = std::min(least, 0.1 * room);
    const double most = std::isfinite(state_.x_limits.upper(k)) ? inside : 1e-3 * room;
    state_.x(k) = std::clamp(state_.x(k), lower + inside, lower + room - most);
  }
  state_.s = (a_ * state_.x);
  for (Index j = 0; j < state_.s.size(); ++j) {
    if (is_slack_(j) == 0.0) {
      state_.s(j) = state_.s_limits.lower(j);
      continue;
    }
    const double lower = state_.s_limits.lower(j), upper = state_.s_limits.upper(j);
    const double scale = std::max(std::abs(state_.s(j)), 1e-3 * a_.row(j).cwiseAbs().dot(state_.x));
    const double room = std::min(upper - lower, scale > 0.0 ? scale : 1.0);
    const double inside = (cold ? 0.1 : 0.1 * std::min(1.0, pool_gap)) * room;
    if (std::isfinite(lower)) state_.s(j) = std::max(state_.s(j), lower + inside);
    if (std::isfinite(upper)) state_.s(j) = std::min(state_.s(j), upper - inside);
  }
  centre(state_.x, mu, state_.x_limits);
  for (Index j = 0; j < state_.s.size(); ++j) {
    if (is_slack_(j) == 0.0) continue;
    const double below = state_.s(j) - state_.s_limits.lower(j),
                 above = state_.s_limits.upper(j) - state_.s(j);
    state_.s_limits.at_lower(j) = std::isfinite(below) ? std::max(-state_.y(j), mu / below) : 0.0;
    state_.s_limits.at_upper(j) = std::isfinite(above) ? std::max(state_.y(j), mu / above) : 0.0;
  }
  fresh_ = size();
}

Eigen::Index ConstrainedWorkingSet::limit_count() const {
  const auto finite = [](const Vector& v) { return v.array().isFinite().count(); };
  Index rows = 0;
  for (Index j = 0; j < state_.s.size(); ++j) {
    if (is_slack_(j) == 0.0) continue;
    rows += (std::isfinite(state_.s_limits.lower(j)) ? 1 : 0) +
            (std::isfinite(state_.s_limits.upper(j)) ? 1 : 0);
  }
  return finite(state_.x_limits.lower) + finite(state_.x_limits.upper) + rows;
}

// M, G and w at x. False where M is singular.
bool ConstrainedWorkingSet::evaluate() {
  if (prior_.empty()) {
    std::ranges::fill(matrix_, 0.0);
  } else {
    std::ranges::copy(prior_, matrix_.begin());
  }
  kernels().accumulate(rows_.data(), size(), packed_size_, state_.x.data(), matrix_.data());
  regular_ = inverse_.factor(matrix_);
  if (!regular_) return false;
  std::ranges::fill(dual_, 0.0);
  true_dual_.assign(packed_size_, 0.0);
  smoothing_ = 1.0;
  for (Part& part : parts_) {
    part.frame.compute(inverse_);
    const double factor = part.frame.smoothing_factor();
    smoothing_ = std::max(smoothing_, factor);
    for (std::size_t k = 0; k < packed_size_; ++k) {
      const double entry = part.share * part.frame.trace_dual()[k];
      dual_[k] += entry;
      true_dual_[k] += factor * entry;
    }
  }
  gain_.resize(state_.x.size());
  kernels().price(rows_.data(), size(), packed_size_, dual_.data(), gain_.data());
  prior_gain_ = true_prior_gain_ = 0.0;
  for (std::size_t k = 0; k < prior_.size(); ++k) {
    prior_gain_ += prior_[k] * dual_[k];
    true_prior_gain_ += prior_[k] * true_dual_[k];
  }
  return true;
}

// E and G smooth with this sharpness, and phi_p with a p that is no larger.
void ConstrainedWorkingSet::set_sharpness(double sharpness) {
  sharpness_ = sharpness;
  for (Part& part : parts_) {
    part.frame.set_sharpness(sharpness);
    part.frame.set_power_at_most(sharpness);
  }
}

// F and V of the members listed: smooth_restricted_problem.hpp. Each criterion has p columns of F.
// Further terms are one column each: of F where they add, of V where they subtract.
void ConstrainedWorkingSet::form_gram_rows() {
  const std::size_t n = listed_.size(), width = (packed_size_ + 7) / 8 * 8;
  std::size_t outer = 0;
  Index down = 0;
  for (const Part& part : parts_) {
    for (const CriterionFrame::OuterTerm& term : part.frame.outer_terms()) {
      if (term.coefficient < 0.0) {
        ++down;
      } else {
        ++outer;
      }
    }
    down += part.frame.rank_one() > 0.0 ? 1 : 0;
  }
  const std::size_t stride = width * parts_.size() + (outer + 7) / 8 * 8;
  if (gram_rows_.size() < n * stride) gram_rows_ = AlignedArray(2 * n * stride);
  new (&gram_) GramMap(gram_rows_.data(), static_cast<Index>(n), static_cast<Index>(stride));
  downdates_.resize(static_cast<Index>(n), down);
  if (is_determinant_) {
    traces_.resize(n);
    dense_kernels().whiten(rows_.data(), listed_.data(), n, dimension_,
                           inverse_.inverse_factor().data(), gram_rows_.data(), stride,
                           traces_.data(), scratch_.data());
    gram_ /= std::sqrt(static_cast<double>(dimension_));
    return;
  }
  gram_.rightCols(static_cast<Index>(stride - width * parts_.size())).setZero();
  std::size_t column = width * parts_.size();
  Index downdate = 0;
  for (std::size_t k = 0; k < parts_.size(); ++k) {
    form_rows_of(parts_[k], k * width);
    form_outer_terms(parts_[k], column, downdate);
  }
}

void ConstrainedWorkingSet::form_rows_of(const Part& part, std::size_t first) {
  const auto d = static_cast<Index>(dimension_);
  const std::size_t stride = static_cast<std::size_t>(gram_.outerStride());
  for (Index a = 0, k = 0; a < d; ++a) {
    for (Index b = 0; b <= a; ++b, ++k) {
      root_weight_[static_cast<std::size_t>(k)] =
          std::sqrt((a == b ? 1.0 : 2.0) * part.share * part.frame.omega(a, b));
    }
  }
  for (std::size_t i = 0; i < listed_.size(); ++i) {
    unpack(row(listed_[i]), dimension_, unpacked_.data());
    half_.noalias() = part.frame.axes() * unpacked_;
    rotated_.noalias() = half_ * part.frame.axes().transpose();
    double* out = gram_rows_.data() + i * stride + first;
    std::size_t k = 0;
    for (Index a = 0; a < d; ++a) {
      for (Index b = 0; b <= a; ++b, ++k) out[k] = root_weight_[k] * rotated_(a, b);
    }
    std::fill(out + packed_size_, out + (packed_size_ + 7) / 8 * 8, 0.0);
  }
}

void ConstrainedWorkingSet::form_outer_terms(const Part& part, std::size_t& column,
                                             Index& downdate) {
  Vector v(static_cast<Index>(size()));
  const auto add = [&](double coefficient, std::span<const double> dual) {
    kernels().price(rows_.data(), size(), packed_size_, dual.data(), v.data());
    const double root = std::sqrt(part.share * std::abs(coefficient));
    for (std::size_t i = 0; i < listed_.size(); ++i) {
      const double entry = root * v(static_cast<Index>(listed_[i]));
      const auto to = static_cast<Index>(i);
      (coefficient < 0.0 ? downdates_(to, downdate) : gram_(to, static_cast<Index>(column))) =
          entry;
    }
    if (coefficient < 0.0) {
      ++downdate;
    } else {
      ++column;
    }
  };
  if (part.frame.rank_one() > 0.0) add(-part.frame.rank_one(), part.frame.trace_dual());
  for (const CriterionFrame::OuterTerm& term : part.frame.outer_terms()) {
    add(term.coefficient, term.dual);
  }
}

// The diagonal Z of the limits, with a proximal term that keeps S + Z regular under ties.
Eigen::VectorXd ConstrainedWorkingSet::limit_stiffness() const {
  // The curvature that sharpness adds says nothing of the directions in which there is none.
  const double sharp = is_smoothed_ ? sharpness_ : 1.0;
  Vector z = 1e-10 * (gram_.rowwise().squaredNorm() / sharp).cwiseMax(gain_.cwiseAbs2());
  for (Index k = 0; k < z.size(); ++k) {
    const double below = state_.x(k) - state_.x_limits.lower(k);
    const double above = state_.x_limits.upper(k) - state_.x(k);
    if (std::isfinite(below)) z(k) += state_.x_limits.at_lower(k) / below;
    if (std::isfinite(above)) z(k) += state_.x_limits.at_upper(k) / above;
  }
  return z;
}

// S + Z as a matrix where members are few; where they are more than the p columns of the g_i, by
// the formula of Woodbury: n p^2 in place of n^3 / 3.
bool ConstrainedWorkingSet::factorise_hessian() {
  listed_.resize(size());
  std::iota(listed_.begin(), listed_.end(), std::size_t{0});
  form_gram_rows();
  const Vector z = limit_stiffness();
  columns_.used = size() > 2 * static_cast<std::size_t>(gram_.cols());
  if (!columns_.used) {
    hessian_factor_.resize(gram_.rows(), gram_.rows());
    dense_kernels().gram(gram_rows_.data(), size(), static_cast<std::size_t>(gram_.cols()),
                         hessian_factor_.data());
    if (downdates_.cols() > 0) {
      hessian_factor_.selfadjointView<Eigen::Lower>().rankUpdate(downdates_, -1.0);
    }
    hessian_factor_.diagonal() += z;
    return dense_kernels().cholesky(hessian_factor_.data(), size(), 0.0);
  }
  columns_.inverse_stiffness = z.cwiseInverse();
  columns_.scaled_gram = columns_.inverse_stiffness.cwiseSqrt().asDiagonal() * gram_;
  Matrix columns = Matrix::Identity(gram_.cols(), gram_.cols());
  columns.selfadjointView<Eigen::Lower>().rankUpdate(columns_.scaled_gram.transpose());
  columns_.factor.compute(columns);
  if (columns_.factor.info() != Eigen::Success) return false;
  columns_.solved_downdates.resize(0, 0);
  if (downdates_.cols() == 0) return true;
  columns_.solved_downdates = solve_hessian(downdates_);
  const Index k = downdates_.cols();
  columns_.downdate.compute(Matrix::Identity(k, k) -
                            downdates_.transpose() * columns_.solved_downdates);
  return columns_.downdate.info() == Eigen::Success;
}

// (S + Z)^-1 right.
Eigen::MatrixXd ConstrainedWorkingSet::solve_hessian(const Matrix& right) const {
  if (!columns_.used) {
    Matrix solved = right;
    for (Index j = 0; j < solved.cols(); ++j) {
      dense_kernels().cholesky_solve(hessian_factor_.data(), size(), solved.col(j).data());
    }
    return solved;
  }
  const Vector root = columns_.inverse_stiffness.cwiseSqrt();
  const Matrix scaled = root.asDiagonal() * right;
  Matrix out = root.asDiagonal() *
               (scaled - columns_.scaled_gram *
                             columns_.factor.solve(columns_.scaled_gram.transpose() * scaled));
  if (columns_.solved_downdates.size() > 0) {
    out += columns_.solved_downdates *
           columns_.downdate.solve(columns_.solved_downdates.transpose() * right);
  }
  return out;
}

// S + Z, and the Schur complement of the rows.
bool ConstrainedWorkingSet::factorise() {
  if (!factorise_hessian()) return false;
  inverse_slack_ = Vector::Zero(state_.s.size());
  for (Index j = 0; j < state_.s.size(); ++j) {
    if (is_slack_(j) == 0.0) continue;
    double stiffness = 0.0;
    const double below = state_.s(j) - state_.s_limits.lower(j);
    const double above = state_.s_limits.upper(j) - state_.s(j);
    if (std::isfinite(below)) stiffness += state_.s_limits.at_lower(j) / below;
    if (std::isfinite(above)) stiffness += state_.s_limits.at_upper(j) / above;
    inverse_slack_(j) = 1.0 / stiffness;
  }
  Matrix schur;
  if (columns_.used) {
    schur = a_ * solve_hessian(a_.transpose());
  } else {
    const Matrix half = hessian_factor_.triangularView<Eigen::Lower>().solve(a_.transpose());
    schur = half.transpose() * half;
  }
  const Vector size = schur.diagonal();
  schur.diagonal() += inverse_slack_ + 1e-13 * size;
  schur_factor_.compute(schur);
  return schur_factor_.info() == Eigen::Success;
}

// What the limits push their variables with, mu / distance, less the second-order terms of a
// predicted step.
ConstrainedWorkingSet::Push ConstrainedWorkingSet::push_of(const Vector& value,
                                                           const Limited& limits, double mu,
                                                           const Vector* step,
                                                           const Vector* lower_step,
                                                           const Vector* upper_step) {
  Push push{Vector::Zero(value.size()), Vector::Zero(value.size())};
  for (Index k = 0; k < value.size(); ++k) {
    const double below = value(k) - limits.lower(k), above = limits.upper(k) - value(k);
    if (std::isfinite(below) && below > 0.0) {
      const double second = step == nullptr ? 0.0 : (*step)(k) * (*lower_step)(k);
      push.up(k) = (mu - second) / below;
    }
    if (std::isfinite(above) && above > 0.0) {
      const double second = step == nullptr ? 0.0 : -(*step)(k) * (*upper_step)(k);
      push.down(k) = (mu - second) / above;
    }
  }
  return push;
}

// The multipliers' part of Newton's step, from the variables'.
void ConstrainedWorkingSet::multiplier_steps(const Vector& value, const Limited& limits,
                                             const Push& push, const Vector& step,
                                             Vector& lower_step, Vector& upper_step) {
  lower_step = upper_step = Vector::Zero(value.size());
  for (Index k = 0; k < value.size(); ++k) {
    const double below = value(k) - limits.lower(k), above = limits.upper(k) - value(k);
    if (std::isfinite(below) && below > 0.0) {
      const double z = limits.at_lower(k);
      lower_step(k) = push.up(k) - z - z / below * step(k);
    }
    if (std::isfinite(above) && above > 0.0) {
      const double z = limits.at_upper(k);
      upper_step(k) = push.down(k) - z + z / above * step(k);
    }
  }
}

// Newton's step to complementarity `mu`, with the second-order terms of a predicted step.
void ConstrainedWorkingSet::solve(double mu, const Direction* predicted, Direction& step) {
  const auto push_on = [&](const Vector& value, const Limited& limits, Vector Direction::*of,
                           Vector Direction::*lower, Vector Direction::*upper) {
    if (predicted == nullptr) return push_of(value, limits, mu, nullptr, nullptr, nullptr);
    return push_of(value, limits, mu, &(predicted->*of), &(predicted->*lower),
                   &(predicted->*upper));
  };
  const Push x_push =
      push_on(state_.x, state_.x_limits, &Direction::x, &Direction::x_lower, &Direction::x_upper);
  const Push s_push =
      push_on(state_.s, state_.s_limits, &Direction::s, &Direction::s_lower, &Direction::s_upper);
  const Vector h = gain_ - a_.transpose() * state_.y + x_push.up - x_push.down;
  // Equations have no slack that could move.
  const Vector g = is_slack_.cwiseProduct(state_.y + s_push.up - s_push.down);
  const Vector kh = solve_hessian(h);
  const Vector missing = state_.s - a_ * state_.x;
  step.y = schur_factor_.solve(a_ * kh - missing - inverse_slack_.cwiseProduct(g));
  step.x = kh - solve_hessian(a_.transpose() * step.y);
  step.s = inverse_slack_.cwiseProduct(step.y + g);
  multiplier_steps(state_.x, state_.x_limits, x_push, step.x, step.x_lower, step.x_upper);
  multiplier_steps(state_.s, state_.s_limits, s_push, step.s, step.s_lower, step.s_upper);
}

namespace {

// The largest length <= 1 for which value + length * change stays above zero.
void shorten(double value, double change, double& length) {
  if (change < 0.0) length = std::min(length, -value / change);
}

}  // namespace

double ConstrainedWorkingSet::step_length(const Direction& step) const {
  double length = 1.0 / kToBoundary;
  for (Index k = 0; k < state_.x.size(); ++k) {
    shorten(state_.x(k) - state_.x_limits.lower(k), step.x(k), length);
    if (std::isfinite(state_.x_limits.upper(k))) {
      shorten(state_.x_limits.upper(k) - state_.x(k), -step.x(k), length);
      shorten(state_.x_limits.at_upper(k), step.x_upper(k), length);
    }
    shorten(state_.x_limits.at_lower(k), step.x_lower(k), length);
  }
  for (Index j = 0; j < state_.s.size(); ++j) {
    if (is_slack_(j) == 0.0) continue;
    if (std::isfinite(state_.s_limits.lower(j))) {
      shorten(state_.s(j) - state_.s_limits.lower(j), step.s(j), length);
      shorten(state_.s_limits.at_lower(j), step.s_lower(j), length);
    }
    if (std::isfinite(state_.s_limits.upper(j))) {
      shorten(state_.s_limits.upper(j) - state_.s(j), -step.s(j), length);
      shorten(state_.s_limits.at_upper(j), step.s_upper(j), length);
    }
  }
  return std::min(1.0, kToBoundary * length);
}

// |B|_F of the change of M, where S measures it.
double ConstrainedWorkingSet::model_length(const Direction& step) const {
  double squared = (gram_.transpose() * step.x).squaredNorm();
  squared -= (downdates_.transpose() * step.x).squaredNorm();
  const double scale = std::max(static_cast<double>(dimension_), sharpness_);
  return std::sqrt(std::max(squared, 0.0) * scale);
}

double ConstrainedWorkingSet::complementarity() const {
  Direction none;
  none.x = Vector::Zero(state_.x.size());
  none.s = Vector::Zero(state_.s.size());
  none.x_lower = none.x_upper = none.x;
  none.s_lower = none.s_upper = none.s;
  return complementarity_after(none, 0.0);
}

double ConstrainedWorkingSet::complementarity_after(const Direction& step, double length) const {
  double sum = 0.0;
  for (Index k = 0; k < state_.x.size(); ++k) {
    const double x = state_.x(k) + length * step.x(k);
    if (std::isfinite(state_.x_limits.lower(k))) {
      sum +=
          (x - state_.x_limits.lower(k)) * (state_.x_limits.at_lower(k) + length * step.x_lower(k));
    }
    if (std::isfinite(state_.x_limits.upper(k))) {
      sum +=
          (state_.x_limits.upper(k) - x) * (state_.x_limits.at_upper(k) + length * step.x_upper(k));
    }
  }
  for (Index j = 0; j < state_.s.size(); ++j) {
    if (is_slack_(j) == 0.0) continue;
    const double s = state_.s(j) + length * step.s(j);
    if (std::isfinite(state_.s_limits.lower(j))) {
      sum +=
          (s - state_.s_limits.lower(j)) * (state_.s_limits.at_lower(j) + length * step.s_lower(j));
    }
    if (std::isfinite(state_.s_limits.upper(j))) {
      sum +=
          (state_.s_limits.upper(j) - s) * (state_.s_limits.at_upper(j) + length * step.s_upper(j));
    }
  }
  return sum / static_cast<double>(limit_count());
}

void ConstrainedWorkingSet::move(const Direction& step, double length) {
  state_.x += length * step.x;
  state_.y += length * step.y;
  state_.s += length * step.s;
  state_.x_limits.at_lower += length * step.x_lower;
  state_.x_limits.at_upper += length * step.x_upper;
  state_.s_limits.at_lower += length * step.s_lower;
  state_.s_limits.at_upper += length * step.s_upper;
}

// The gap of f over the members, with what the rows are still broken by.
void ConstrainedWorkingSet::measure_gap() {
  const std::span<const double> y{state_.y.data(), static_cast<std::size_t>(state_.y.size())};
  true_multipliers_.assign(y.begin(), y.end());
  for (double& multiplier : true_multipliers_) multiplier *= smoothing_;
  const auto bound = multiplier_bound<double>(constraints_, candidates_, {gain_.data(), size()}, y);
  gap_ = std::max(prior_gain_ + bound.value - 1.0, 0.0) + infeasibility();
}

double ConstrainedWorkingSet::infeasibility() const {
  const Vector value = (a_ * state_.x);
  double worst = 0.0;
  for (Index j = 0; j < state_.s.size(); ++j) {
    const double outside =
        std::max({state_.s_limits.lower(j) - value(j), value(j) - state_.s_limits.upper(j), 0.0});
    const double scale = std::max(a_.row(j).cwiseAbs().dot(state_.x), std::abs(state_.s(j)));
    if (outside > 0.0) worst = std::max(worst, outside / std::max(scale, 1e-300));
  }
  return worst;
}

bool ConstrainedWorkingSet::obeys_rows() const { return infeasibility() <= kRowTolerance; }

// Predictor and corrector. Where the last step was short, or gained nothing, the point is too far
// from the central path: it is first brought back there.
void ConstrainedWorkingSet::step(bool centring) {
  const double mu = complementarity();
  double target = 0.5 * mu;
  if (!centring) {
    solve(0.0, nullptr, predictor_);
    const double after = complementarity_after(predictor_, step_length(predictor_));
    const double ratio = std::max(after, 0.0) / mu;
    target = std::max(ratio * ratio * ratio, 1e-6) * mu;
  }
  solve(target, centring ? nullptr : &predictor_, corrector_);
  length_ = step_length(corrector_);
  const double reach = model_length(corrector_);
  const double most = is_smoothed_ ? 1.0 : kLongestStep;  // a barrier bears no overshooting
  if (reach > 1.0) length_ = std::min(length_, most / reach);
  const State before = state_;
  for (int attempt = 0; attempt < 8; ++attempt, length_ *= 0.3) {
    move(corrector_, length_);
    if (evaluate()) return;
    state_ = before;
  }
  length_ = 0.0;
}

bool ConstrainedWorkingSet::improve(double pool_gap, double tolerance) {
  resize();
  start(pool_gap);
  if (!evaluate()) return false;
  const bool sharpens = is_smoothed_ || sharpness_ < largest_power_;
  // New members call for a smoother criterion, in which steps are longer.
  const double smooth_again = std::max({1.0, largest_power_, 0.3 / pool_gap});
  if (is_smoothed_ && sharpness_ > smooth_again) {
    set_sharpness(smooth_again);
    if (!evaluate()) return false;
  }
  return sharpens ? follow_sharpness(tolerance) : descend(tolerance);
}

// The optimum of f, while E or G gets as sharp as the tolerance asks for, and p as large as it is.
bool ConstrainedWorkingSet::follow_sharpness(double tolerance) {
  constexpr double kFaster = 4.0, kSharpest = 1e12;
  for (;;) {
    const bool is_sharp =
        (!is_smoothed_ || smoothing_ - 1.0 <= 0.3 * tolerance) && sharpness_ >= largest_power_;
    const double enough = is_sharp ? 0.5 * tolerance : std::max(0.3 / sharpness_, 0.5 * tolerance);
    const bool done = descend(enough);
    if (!done && !regular_) return false;
    const bool stays_sharp = !is_smoothed_ || smoothing_ - 1.0 <= 0.4 * tolerance;
    if (is_sharp && stays_sharp) return done;
    if (sharpness_ > kSharpest || stop_requested()) return false;
    set_sharpness(kFaster * sharpness_);
    start(0.3 / sharpness_);
    if (!evaluate()) return false;
  }
}

// Steps until the gap of f over the members is at most `tolerance`.
bool ConstrainedWorkingSet::descend(double tolerance) {
  constexpr int kStepLimit = 80, kStalledLimit = 12;
  constexpr double kShortStep = 0.1;
  double best = kInfinity;
  for (int count = 0, stalled = 0; count < kStepLimit; ++count) {
    measure_gap();
    if (gap_ <= tolerance && tolerance >= kCoarse) return true;
    if (gap_ <= tolerance) {
      const State before = state_;
      polish();
      if (obeys_rows()) return true;
      state_ = before;
      if (!evaluate()) return false;
      measure_gap();
    }
    stalled = gap_ < 0.9 * best ? 0 : stalled + 1;
    best = std::min(best, gap_);
    if (stalled > kStalledLimit || !(complementarity() > kSmallestComplementarity)) break;
    if (stop_requested()) return false;
    if (!factorise()) break;
    step(count > 0 && (length_ < kShortStep || stalled > 2));
    if (length_ == 0.0) break;
  }
  polish();
  return gap_ <= tolerance && obeys_rows();
}

// Efforts that are at a limit are put there; what is left to solve for, and the rows that bind.
ConstrainedWorkingSet::Face ConstrainedWorkingSet::snap_to_face() {
  Face face;
  for (Index k = 0; k < state_.x.size(); ++k) {
    const double room = constraints_.largest_effort(candidates_[static_cast<std::size_t>(k)]);
    const double below = (state_.x(k) - state_.x_limits.lower(k)) / room;
    const double above = (state_.x_limits.upper(k) - state_.x(k)) / room;
    // Both relative: a distance is small where its multiplier is not.
    const double gain = std::max(gain_(k), 1e-300);
    if (below < std::min(kNearLimit, state_.x_limits.at_lower(k) / gain)) {
      state_.x(k) = state_.x_limits.lower(k);
    } else if (above < std::min(kNearLimit, state_.x_limits.at_upper(k) / gain)) {
      state_.x(k) = state_.x_limits.upper(k);
    } else {
      face.free.push_back(k);
    }
  }
  std::vector<double> limits;
  for (Index j = 0; j < state_.s.size(); ++j) {
    const double size = std::max(a_.row(j).cwiseAbs().dot(state_.x), 1e-300);
    const bool above = is_slack_(j) == 0.0 || state_.y(j) > 0.0;
    const double limit = above ? state_.s_limits.upper(j) : state_.s_limits.lower(j);
    if (is_slack_(j) > 0.0 && std::abs(limit - state_.s(j)) / size > std::abs(state_.y(j)) * size)
      continue;
    face.rows.push_back(j);
    limits.push_back(limit);
  }
  face.limits = Vector::Map(limits.data(), static_cast<Index>(limits.size()));
  return face;
}

// Newton's step in the face. False where it leaves the limits or M is singular.
bool ConstrainedWorkingSet::step_in(const Face& face) {
  const auto n = static_cast<Index>(face.free.size()), m = static_cast<Index>(face.rows.size());
  listed_.assign(face.free.begin(), face.free.end());
  form_gram_rows();
  Matrix kkt = Matrix::Zero(n + m, n + m);
  kkt.topLeftCorner(n, n).noalias() = gram_ * gram_.transpose();
  kkt.topLeftCorner(n, n).noalias() -= downdates_ * downdates_.transpose();
  const Vector diagonal = kkt.diagonal().head(n);
  kkt.diagonal().head(n) += 1e-12 * diagonal;
  kkt.bottomLeftCorner(m, n) = a_(face.rows, face.free);
  kkt.topRightCorner(n, m) = kkt.bottomLeftCorner(m, n).transpose();
  Vector right(n + m);
  right.head(n) = gain_(face.free);
  right.tail(m) = face.limits - (a_ * state_.x)(face.rows);
  Vector solution = kkt.partialPivLu().solve(right);
  if (!((kkt * solution - right).norm() <=
        1e-9 * right.norm())) {  // rows that depend on each other
    solution = kkt.completeOrthogonalDecomposition().solve(right);
  }
  if (!solution.allFinite()) return false;
  state_.x(face.free) += solution.head(n);
  state_.y.setZero();
  state_.y(face.rows) = solution.tail(m);
  const bool inside = (state_.x.array() >= state_.x_limits.lower.array()).all() &&
                      (state_.x.array() <= state_.x_limits.upper.array()).all();
  return inside && evaluate();
}

// Kept where the gap, with what the rows are broken by, does not grow.
void ConstrainedWorkingSet::polish() {
  constexpr int kSteps = 3;
  constexpr double kNothingToGain = 1e-13;
  State best = state_;
  double best_gap = gap_;
  const Face face = snap_to_face();
  const bool small = face.free.size() <= kLargestFace;
  bool at_best = false;  // M and w are those of the best
  if (!face.free.empty() && small && evaluate()) {
    for (int step = 0; step < kSteps && best_gap > kNothingToGain; ++step) {
      at_best = step_in(face);
      if (!at_best) break;
      measure_gap();
      at_best = gap_ <= best_gap;
      if (!at_best) break;
      best_gap = gap_;
      best = state_;
    }
  }
  if (at_best) return;
  state_ = std::move(best);
  (void)evaluate();
  measure_gap();
}

void ConstrainedWorkingSet::drop(double threshold) {
  if (!regular_) return;  // no gains to judge by
  const Vector reduced = gain_ - a_.transpose() * state_.y;
  std::vector<Index> kept;
  for (Index k = 0; k < state_.x.size(); ++k) {
    const std::size_t i = candidates_[static_cast<std::size_t>(k)];
    const double room = constraints_.largest_effort(i);
    const bool idle = state_.x(k) <= 1e-9 * room && reduced(k) * room < -threshold;
    if (!idle || !dropped_.insert(i).second) kept.push_back(k);
  }
  keep(kept);
}

void ConstrainedWorkingSet::keep(const std::vector<Index>& kept) {
  if (kept.size() == size()) return;
  for (std::size_t to = 0; to < kept.size(); ++to) {
    const auto from = static_cast<std::size_t>(kept[to]);
    candidates_[to] = candidates_[from];
    std::copy_n(row(from), packed_size_,
                rows_.begin() + static_cast<std::ptrdiff_t>(to * packed_size_));
  }
  for (Vector* v : {&state_.x, &state_.x_limits.at_lower, &state_.x_limits.at_upper}) {
    *v = Vector((*v)(kept));
  }
  candidates_.resize(kept.size());
  members_ = {candidates_.begin(), candidates_.end()};
  rows_.resize(kept.size() * packed_size_);
  fresh_ = kept.size();
  resize();
}

}  // namespace graybox
