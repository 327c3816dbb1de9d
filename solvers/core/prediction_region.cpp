#include "solvers/core/prediction_region.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"

namespace graybox {

PredictionRegion::PredictionRegion(std::size_t dimension, std::vector<double> rows,
                                   std::vector<std::size_t> row_counts)
    : dimension_(dimension), rows_(std::move(rows)), row_counts_(std::move(row_counts)) {
  if (!std::ranges::all_of(rows_, [](double x) { return std::isfinite(x); })) {
    throw InputError("a region of predictions holds a number that is not finite");
  }
  constexpr double kLargest = 1e100;  // squares of numbers beyond it, or its inverse, are none
  double largest = 0.0;
  for (const double x : rows_) largest = std::max(largest, std::abs(x));
  const bool is_sized = largest <= kLargest && largest >= 1.0 / kLargest;
  if (!rows_.empty() && !is_sized) {
    throw InputError(fmt::format(
        "a region of predictions has {:.3g} for its largest number: {}", largest,
        largest > 0.0 ? "scale its units to lie between 1e-100 and 1e100" : "it predicts nothing"));
  }
  // Each count is held against what is left, so that their sum can't overflow.
  std::size_t left = dimension_ == 0 ? 0 : rows_.size() / dimension_;
  const bool is_whole = dimension_ > 0 && rows_.size() % dimension_ == 0;
  for (const std::size_t count : row_counts_) {
    if (count > left) throw InputError("a region of predictions has too few rows for its points");
    left -= count;
  }
  if (left != 0 || !is_whole) {
    throw InputError(fmt::format("a region of predictions has {} numbers, which are no rows of {}",
                                 rows_.size(), dimension_));
  }
}

PredictionRegion PredictionRegion::of_regressors(std::size_t dimension, std::vector<double> rows) {
  std::vector<std::size_t> counts(dimension == 0 ? 0 : rows.size() / dimension, 1);
  return {dimension, std::move(rows), std::move(counts)};
}

PredictionRegion PredictionRegion::of_set(const InformationSet& set) {
  constexpr double kNegligible = 1e-14;
  const std::size_t d = set.dimension();
  Eigen::MatrixXd matrix(static_cast<Eigen::Index>(d), static_cast<Eigen::Index>(d));
  std::vector<double> rows;
  std::vector<std::size_t> counts;
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    unpack(set.information(i).data(), d, matrix.data());
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(matrix);
    const double least =
        kNegligible * static_cast<double>(d) * std::max(eigen.eigenvalues().maxCoeff(), 0.0);
    std::size_t& count = counts.emplace_back(0);
    for (Eigen::Index k = 0; k < matrix.rows(); ++k) {
      if (!(eigen.eigenvalues()(k) > least)) continue;
      const Eigen::VectorXd row = std::sqrt(eigen.eigenvalues()(k)) * eigen.eigenvectors().col(k);
      rows.insert(rows.end(), row.begin(), row.end());
      ++count;
    }
  }
  return {d, std::move(rows), std::move(counts)};
}

std::vector<double> PredictionRegion::mean_information() const {
  std::vector<double> mean(packed_size(dimension_), 0.0);
  for (std::size_t r = 0; r < rows_.size(); r += dimension_) {
    for (std::size_t a = 0; a < dimension_; ++a) {
      for (std::size_t b = 0; b <= a; ++b) mean[packed_index(a, b)] += rows_[r + a] * rows_[r + b];
    }
  }
  for (double& entry : mean) entry /= static_cast<double>(count());
  return mean;
}

std::vector<double> mean_information(const InformationSet& set) {
  std::vector<double> mean(set.packed_size(), 0.0);
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    const auto h = set.information(i);
    for (std::size_t k = 0; k < h.size(); ++k) mean[k] += h[k];
  }
  for (double& entry : mean) entry /= static_cast<double>(set.candidate_count());
  return mean;
}

}  // namespace graybox
