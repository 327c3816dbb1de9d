#include "solvers/restricted_problem/restricted_problem.hpp"

#include <algorithm>
#include <cstring>
#include <numeric>

#include "problems/base/packed_matrix.hpp"
#include "problems/kernels/kernels.hpp"
#include "solvers/restricted_problem/eigenvalue_restricted_problem.hpp"
#include "solvers/restricted_problem/smooth_restricted_problem.hpp"

namespace graybox {

RestrictedProblem::RestrictedProblem(std::size_t dimension)
    : dimension_(dimension), packed_size_(graybox::packed_size(dimension)) {}

bool RestrictedProblem::add(std::size_t candidate, const double* information, double weight) {
  const std::size_t bytes = packed_size_ * sizeof(double);
  for (std::size_t k = 0; k < size(); ++k) {
    if (indices_[k] == candidate || std::memcmp(row(k), information, bytes) == 0) {
      weights_[k] += weight;
      return false;
    }
  }
  indices_.push_back(candidate);
  weights_.push_back(weight);
  rows_.insert(rows_.end(), information, information + packed_size_);
  return true;
}

void RestrictedProblem::normalise() {
  const double sum = std::accumulate(weights_.begin(), weights_.end(), 0.0);
  for (double& weight : weights_) weight /= sum;
}

std::vector<double> RestrictedProblem::information() const {
  std::vector<double> packed(packed_size_);
  sum_information(weights_, packed);
  return packed;
}

void RestrictedProblem::sum_information(std::span<const double> weights,
                                        std::span<double> packed) const {
  std::ranges::fill(packed, 0.0);
  kernels().accumulate(rows_.data(), size(), packed_size_, weights.data(), packed.data());
}

void RestrictedProblem::keep(const std::vector<bool>& kept) {
  std::size_t count = 0;
  for (std::size_t k = 0; k < size(); ++k) {
    if (!kept[k]) continue;
    indices_[count] = indices_[k];
    weights_[count] = weights_[k];
    std::copy_n(row(k), packed_size_, rows_.data() + count * packed_size_);
    ++count;
  }
  indices_.resize(count);
  weights_.resize(count);
  rows_.resize(count * packed_size_);
}

std::unique_ptr<RestrictedProblem> make_restricted_problem(const Criterion& criterion,
                                                           std::size_t dimension,
                                                           std::span<const double> coordinates) {
  if (criterion.kind() == CriterionKind::kE) {
    return std::make_unique<EigenvalueRestrictedProblem>(dimension, coordinates);
  }
  return std::make_unique<SmoothRestrictedProblem>(criterion, dimension, coordinates);
}

}  // namespace graybox
