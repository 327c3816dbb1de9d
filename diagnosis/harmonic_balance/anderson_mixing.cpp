#include "diagnosis/harmonic_balance/anderson_mixing.hpp"

#include <Eigen/QR>
#include <utility>

#include "diagnosis/harmonic_balance/real_products.hpp"

namespace graybox {

void AndersonMixing::add(Eigen::MatrixXcd reached, Eigen::VectorXcd change) {
  reached_.push_back(std::move(reached));
  changes_.push_back(std::move(change));
  if (reached_.size() <= remembered_) return;
  reached_.erase(reached_.begin());
  changes_.erase(changes_.begin());
}

Eigen::MatrixXcd AndersonMixing::mixed() const {
  const std::size_t older = changes_.size() - 1;
  if (older == 0) return reached_.back();
  Eigen::MatrixXd differences(2 * changes_.back().size(), static_cast<Eigen::Index>(older));
  for (std::size_t i = 0; i < older; ++i) {
    differences.col(static_cast<Eigen::Index>(i)) =
        as_real(Eigen::VectorXcd(changes_.back() - changes_[i]));
  }
  const Eigen::VectorXd weights =
      differences.completeOrthogonalDecomposition().solve(as_real(changes_.back()));
  Eigen::MatrixXcd result = reached_.back();
  for (std::size_t i = 0; i < older; ++i) {
    result -= weights(static_cast<Eigen::Index>(i)) * (reached_.back() - reached_[i]);
  }
  return result;
}

}  // namespace graybox
