#include "solvers/column_generation/box_search.hpp"

#include <algorithm>
#include <cmath>

namespace graybox {
namespace {

constexpr double kDifference = 1e-3;       // of the unit cube
constexpr double kBound = 1e-12;           // nearer than this is on the bound
constexpr double kFirstStep = 0.02;        // length of the first step, where no curvature is known
constexpr double kLongestStep = 0.25;      // in any coordinate
constexpr double kSufficient = 1e-4;       // Armijo
constexpr double kShortestStep = 1e-7;     // shortening ends here
constexpr double kLeastCurvature = 1e-10;  // of BFGS pairs, relative

}  // namespace

BoxSearch::BoxSearch(std::span<const double> lower, std::span<const double> upper)
    : lower_(
          Eigen::Map<const Eigen::VectorXd>(lower.data(), static_cast<Eigen::Index>(lower.size()))),
      upper_(
          Eigen::Map<const Eigen::VectorXd>(upper.data(), static_cast<Eigen::Index>(upper.size()))),
      width_(upper_ - lower_),
      point_(lower.size()) {
  const Eigen::Index n = lower_.size();
  for (Eigen::VectorXd* vector :
       {&unit_, &trial_, &gradient_, &old_gradient_, &direction_, &step_, &change_}) {
    vector->setZero(n);
  }
  inverse_hessian_.setIdentity(n, n);
}

double BoxSearch::value_at(const Function& function, const Eigen::VectorXd& unit) {
  for (Eigen::Index k = 0; k < unit.size(); ++k) {
    // The bounds exactly, without the rounding of lower + width.
    point_[static_cast<std::size_t>(k)] =
        unit(k) >= 1.0 - kBound ? upper_(k) : lower_(k) + unit(k) * width_(k);
  }
  return function(point_);
}

void BoxSearch::move_to(std::span<const double> point) {
  for (Eigen::Index k = 0; k < unit_.size(); ++k) {
    const double offset = point[static_cast<std::size_t>(k)] - lower_(k);
    unit_(k) = width_(k) > 0.0 ? std::clamp(offset / width_(k), 0.0, 1.0) : 0.0;
  }
}

void BoxSearch::differentiate(const Function& function, const Eigen::VectorXd& unit, double value) {
  trial_ = unit;
  const auto moved = [&](Eigen::Index k, double by) {
    trial_(k) = unit(k) + by;
    const double result = value_at(function, trial_);
    trial_(k) = unit(k);
    return result;
  };
  constexpr double h = kDifference;
  for (Eigen::Index k = 0; k < unit.size(); ++k) {
    gradient_(k) = 0.0;
    if (width_(k) == 0.0) continue;
    const bool room_below = unit(k) >= 2.0 * h, room_above = unit(k) <= 1.0 - 2.0 * h;
    if (room_below && room_above) {
      gradient_(k) =
          (8.0 * (moved(k, h) - moved(k, -h)) - (moved(k, 2.0 * h) - moved(k, -2.0 * h))) /
          (12.0 * h);
    } else {
      const double side = room_above ? h : -h;
      gradient_(k) = (4.0 * moved(k, side) - moved(k, 2.0 * side) - 3.0 * value) / (2.0 * side);
    }
  }
}

void BoxSearch::gradient(const Function& function, std::span<const double> point,
                         std::span<double> out) {
  move_to(point);
  differentiate(function, unit_, value_at(function, unit_));
  for (Eigen::Index k = 0; k < unit_.size(); ++k) {
    out[static_cast<std::size_t>(k)] = width_(k) > 0.0 ? gradient_(k) / width_(k) : 0.0;
  }
}

// Fixed, or on a bound with the gradient pointing out.
bool BoxSearch::blocked(Eigen::Index k) const {
  return width_(k) == 0.0 || (unit_(k) <= kBound && gradient_(k) <= 0.0) ||
         (unit_(k) >= 1.0 - kBound && gradient_(k) >= 0.0);
}

// One step along direction_, projected into the box and shortened until the value increases enough;
// leaves the step in step_. Returns the new value, or the old one where no step increases it.
double BoxSearch::advance(const Function& function, double value) {
  double length = std::min(1.0, kLongestStep / direction_.lpNorm<Eigen::Infinity>());
  for (; length * direction_.lpNorm<Eigen::Infinity>() > kShortestStep; length *= 0.4) {
    trial_ = (unit_ + length * direction_).cwiseMax(0.0).cwiseMin(1.0);
    step_ = trial_ - unit_;
    const double reached = value_at(function, trial_);
    if (reached >= value + kSufficient * gradient_.dot(step_) && reached > value) {
      unit_ += step_;
      return reached;
    }
  }
  step_.setZero();
  return value;
}

double BoxSearch::maximise(const Function& function, std::span<double> point,
                           const BoxSearchOptions& options) {
  const Eigen::Index n = unit_.size();
  move_to(point);
  double value = value_at(function, unit_);
  differentiate(function, unit_, value);
  bool curvature_known = false;
  for (int iteration = 0; iteration < options.step_limit; ++iteration) {
    double promise = 0.0;  // of a step across the box
    direction_.setZero();
    for (Eigen::Index k = 0; k < n; ++k) {
      if (blocked(k)) continue;
      promise += std::abs(gradient_(k));
      for (Eigen::Index j = 0; curvature_known && j < n; ++j) {
        if (!blocked(j)) direction_(k) += inverse_hessian_(k, j) * gradient_(j);
      }
      if (!curvature_known) direction_(k) = gradient_(k);
    }
    if (promise <= options.tolerance) break;
    if (!curvature_known) direction_ *= kFirstStep / direction_.lpNorm<Eigen::Infinity>();
    if (direction_.dot(gradient_) <= 0.0) {  // bounds have cut the quasi-Newton direction badly
      inverse_hessian_.setIdentity();
      curvature_known = false;
      continue;
    }
    const double reached = advance(function, value);
    if (reached <= value) {
      if (!curvature_known) break;
      inverse_hessian_.setIdentity();
      curvature_known = false;
      continue;
    }
    value = reached;
    old_gradient_ = gradient_;
    differentiate(function, unit_, value);
    change_ = old_gradient_ - gradient_;  // of the gradient of minus the function
    const double curvature = step_.dot(change_);
    if (curvature > kLeastCurvature * step_.norm() * change_.norm()) {
      if (!curvature_known) {
        inverse_hessian_.setIdentity();
        inverse_hessian_ *= curvature / change_.squaredNorm();
        curvature_known = true;
      }
      // BFGS: (I - s y^T / sy) B (I - y s^T / sy) + s s^T / sy
      direction_.noalias() = inverse_hessian_ * change_;
      const double scale = (1.0 + change_.dot(direction_) / curvature) / curvature;
      inverse_hessian_ +=
          scale * step_ * step_.transpose() -
          (direction_ * step_.transpose() + step_ * direction_.transpose()) / curvature;
    }
  }
  value = value_at(function, unit_);
  std::ranges::copy(point_, point.begin());
  return value;
}

}  // namespace graybox
