#include "solvers/ellipsoid/spanning_points.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "problems/base/stop.hpp"

namespace graybox {
namespace {

class SpanningSearch {
 public:
  SpanningSearch(const PointSet& points, bool centred)
      : points_(points),
        centred_(centred),
        n_(static_cast<Eigen::Index>(points.dimension)),
        middle_(Eigen::VectorXd::Zero(n_)),
        scale_(n_),
        basis_(n_, 0) {
    double magnitude = 1.0;
    for (Eigen::Index j = 0; j < n_; ++j) {
      const auto column = static_cast<std::size_t>(j);
      const double low = points.lower[column], high = points.upper[column];
      const double largest = std::max(std::abs(low), std::abs(high));
      if (!centred) middle_(j) = low + 0.5 * (high - low);
      scale_(j) = 1.0 / (centred ? largest : 0.5 * (high - low));
      magnitude = std::max(magnitude, largest * scale_(j));
    }
    rounding_ = 32.0 * static_cast<double>(n_) * std::numeric_limits<double>::epsilon() * magnitude;
  }

  SpanningPoints run() {
    SpanningPoints found;
    for (Eigen::Index k = 0; k < n_; ++k) {
      stop_if_requested();
      const Eigen::VectorXd direction = next_direction();
      if (!extend(direction, found.indices)) {
        found.dependent = last_of_largest(direction);
        return found;
      }
    }
    found.dependent = points_.dimension;
    std::ranges::sort(found.indices);
    const auto repeated = std::ranges::unique(found.indices);
    found.indices.erase(repeated.begin(), repeated.end());
    return found;
  }

 private:
  // The last coordinate that the others determine about as well as any: sums tend to come last.
  [[nodiscard]] std::size_t last_of_largest(const Eigen::VectorXd& direction) const {
    const double largest = direction.cwiseAbs().maxCoeff();
    Eigen::Index last = n_ - 1;
    while (std::abs(direction(last)) < 0.9 * largest) --last;
    return static_cast<std::size_t>(last);
  }

  // The component of v that is orthogonal to the basis; twice, since once is not enough.
  [[nodiscard]] Eigen::VectorXd orthogonal(Eigen::VectorXd v) const {
    for (int pass = 0; pass < 2; ++pass) v -= basis_ * (basis_.transpose() * v);
    return v;
  }

  // The unit vector orthogonal to the basis that is nearest to a coordinate axis.
  [[nodiscard]] Eigen::VectorXd next_direction() const {
    Eigen::Index axis = 0;
    basis_.rowwise().squaredNorm().minCoeff(&axis);
    return orthogonal(Eigen::VectorXd::Unit(n_, axis)).normalized();
  }

  [[nodiscard]] Eigen::VectorXd scaled(std::size_t i) const {
    const Eigen::Map<const Eigen::VectorXd> x(points_.point(i), n_);
    return (x - middle_).cwiseProduct(scale_);
  }

  // Adds the points farthest apart in the direction, and what they span to the basis. False where
  // all points agree in it.
  bool extend(const Eigen::VectorXd& direction, std::vector<std::size_t>& indices) {
    std::size_t lowest = 0, highest = 0;
    double low = std::numeric_limits<double>::infinity(), high = -low;
    const Eigen::VectorXd functional = direction.cwiseProduct(scale_);
    for (std::size_t i = 0; i < points_.count; ++i) {
      const Eigen::Map<const Eigen::VectorXd> x(points_.point(i), n_);
      const double value = functional.dot(x - middle_);
      if (value < low) {
        low = value;
        lowest = i;
      }
      if (value > high) {
        high = value;
        highest = i;
      }
    }
    const std::size_t longest = -low > high ? lowest : highest;
    if ((centred_ ? std::max(-low, high) : high - low) <= rounding_) return false;
    const Eigen::VectorXd difference =
        centred_ ? scaled(longest) : Eigen::VectorXd(scaled(highest) - scaled(lowest));
    basis_.conservativeResize(Eigen::NoChange, basis_.cols() + 1);
    basis_.col(basis_.cols() - 1).setZero();
    basis_.col(basis_.cols() - 1) = orthogonal(difference).normalized();
    indices.push_back(centred_ ? longest : highest);
    if (!centred_) indices.push_back(lowest);
    return true;
  }

  const PointSet& points_;
  bool centred_;
  Eigen::Index n_;
  Eigen::VectorXd middle_;
  Eigen::VectorXd scale_;
  Eigen::MatrixXd basis_;  // orthonormal columns
  double rounding_ = 0.0;
};

}  // namespace

SpanningPoints spanning_points(const PointSet& points, bool centred) {
  return SpanningSearch(points, centred).run();
}

}  // namespace graybox
