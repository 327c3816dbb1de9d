// PredictionRegion: where predictions will be made. At each point j the model predicts J_j theta,
// with J_j of one row for each response, in units in which all of them count alike. The covariance
// of the prediction is J_j M^-1 J_j^T, and its trace the variance that the criteria I (mean over
// the points) and G (largest of the points) look at.
//
//   const PredictionRegion line = PredictionRegion::of_regressors(2, {1, 0, 1, 0.5, 1, 1});
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "problems/information/information_set.hpp"

namespace graybox {

class PredictionRegion {
 public:
  PredictionRegion() = default;  // no points
  // The rows of all J_j, one after another, and how many each point has. Throws InputError for a
  // number that is not finite, and for rows that do not add up.
  PredictionRegion(std::size_t dimension, std::vector<double> rows,
                   std::vector<std::size_t> row_counts);
  // One response: each row is a point.
  [[nodiscard]] static PredictionRegion of_regressors(std::size_t dimension,
                                                      std::vector<double> rows);
  // A point for each candidate: J_j^T J_j = H_j, from the eigenvalues of H_j that exceed 1e-14 d of
  // its largest.
  [[nodiscard]] static PredictionRegion of_set(const InformationSet& set);

  [[nodiscard]] std::size_t dimension() const { return dimension_; }
  [[nodiscard]] std::size_t count() const { return row_counts_.size(); }
  [[nodiscard]] std::span<const double> rows() const { return rows_; }
  [[nodiscard]] std::span<const std::size_t> row_counts() const { return row_counts_; }
  // mean_j J_j^T J_j, packed: W of criterion I.
  [[nodiscard]] std::vector<double> mean_information() const;

  friend bool operator==(const PredictionRegion& a, const PredictionRegion& b) {
    return a.dimension_ == b.dimension_ && a.rows_ == b.rows_ && a.row_counts_ == b.row_counts_;
  }

 private:
  std::size_t dimension_ = 0;
  std::vector<double> rows_;
  std::vector<std::size_t> row_counts_;
};

// mean_i H_i, packed: W of criterion I over the candidates of a set.
[[nodiscard]] std::vector<double> mean_information(const InformationSet& set);

}  // namespace graybox
