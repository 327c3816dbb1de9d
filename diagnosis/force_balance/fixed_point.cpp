#include "graybox/diagnosis/force_balance/fixed_point.hpp"

#include <Eigen/QR>
#include <algorithm>

namespace graybox {

Eigen::VectorXd FixedPointIteration::next(const Eigen::VectorXd& x, const Eigen::VectorXd& of_x) {
  points_.push_back(x);
  steps_.push_back(of_x - x);
  const auto kept = std::min(static_cast<Eigen::Index>(points_.size()) - 1, x.size());
  if (kept == 0) return of_x;
  Eigen::MatrixXd moves(x.size(), kept), changes(x.size(), kept);
  const std::size_t last = points_.size() - 1;
  for (Eigen::Index k = 0; k < kept; ++k) {
    const std::size_t older = last - 1 - static_cast<std::size_t>(k);
    moves.col(k) = points_[last] - points_[older];
    changes.col(k) = steps_[last] - steps_[older];
  }
  const Eigen::VectorXd shares = changes.completeOrthogonalDecomposition().solve(steps_.back());
  const Eigen::VectorXd result = of_x - (moves + changes) * shares;
  return result.allFinite() ? result : of_x;
}

}  // namespace graybox
