#include "diagnosis/signals/long_run_variance.hpp"

#include <algorithm>
#include <utility>

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr double kLargestCorrelation = 0.97;

// Of each score's AR(1) model.
Eigen::VectorXd first_correlations(const Eigen::MatrixXd& g, const std::vector<Index>& pieces) {
  Eigen::VectorXd products = Eigen::VectorXd::Zero(g.cols()), squares = products;
  Index first = 0;
  for (const Index length : pieces) {
    const auto x = g.middleRows(first, length);
    if (length > 1) {
      products += x.topRows(length - 1).cwiseProduct(x.bottomRows(length - 1)).colwise().sum();
    }
    squares += x.colwise().squaredNorm();
    first += length;
  }
  return (squares.array() > 0.0)
      .select(products.array() / squares.array().max(1e-300), 0.0)
      .cwiseMax(-kLargestCorrelation)
      .cwiseMin(kLargestCorrelation);
}

}  // namespace

PrewhitenedScores::PrewhitenedScores(const Eigen::MatrixXd& scores, std::vector<Index> pieces)
    : pieces_(std::move(pieces)),
      correlations_(first_correlations(scores, pieces_)),
      whitened_(scores.rows() - static_cast<Index>(pieces_.size()), scores.cols()) {
  Index first = 0, row = 0;
  for (Index& length : pieces_) {
    const auto x = scores.middleRows(first, length);
    first += length--;
    whitened_.middleRows(row, length) =
        x.bottomRows(length) - x.topRows(length) * correlations_.asDiagonal();
    row += length;
  }
}

Eigen::VectorXd PrewhitenedScores::whitened_correlations() const {
  return first_correlations(whitened_, pieces_);
}

Eigen::MatrixXd PrewhitenedScores::long_run_variance(Index lags) const {
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(whitened_.cols(), whitened_.cols());
  Index first = 0;
  for (const Index length : pieces_) {
    const auto x = whitened_.middleRows(first, length);
    sum.noalias() += x.transpose() * x;
    for (Index l = 1; l <= std::min(lags, length - 1); ++l) {
      const double weight = 1.0 - static_cast<double>(l) / static_cast<double>(lags + 1);
      const Eigen::MatrixXd gamma = x.bottomRows(length - l).transpose() * x.topRows(length - l);
      sum += weight * (gamma + gamma.transpose());
    }
    first += length;
  }
  const Eigen::VectorXd recolouring = (1.0 - correlations_.array()).inverse();
  return recolouring.asDiagonal() * sum * recolouring.asDiagonal();
}

}  // namespace graybox
