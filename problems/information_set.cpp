#include "graybox/problems/information_set.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "graybox/problems/error.hpp"
#include "graybox/problems/packed_matrix.hpp"
#include "graybox/problems/random.hpp"
#include "graybox/problems/sha256.hpp"

namespace graybox {
namespace {

Eigen::MatrixXd full_matrix(std::span<const double> packed, std::size_t dimension) {
  const auto d = static_cast<Eigen::Index>(dimension);
  Eigen::MatrixXd full(d, d);
  unpack(packed.data(), dimension, full.data());
  return full;
}

// A quick sufficient test first: the matrix shifted by the tolerance has a Cholesky factor.
bool is_positive_semidefinite(const Eigen::MatrixXd& matrix) {
  const double scale = matrix.diagonal().cwiseAbs().maxCoeff();
  if (scale == 0.0) return matrix.cwiseAbs().maxCoeff() == 0.0;
  const double tolerance = 1e-9 * scale;
  Eigen::MatrixXd shifted = matrix / scale;
  shifted.diagonal().array() += tolerance / scale;
  if (Eigen::LLT<Eigen::MatrixXd>(shifted).info() == Eigen::Success) return true;
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(matrix / scale, Eigen::EigenvaluesOnly);
  return eigen.info() == Eigen::Success &&
         eigen.eigenvalues()(0) >= -1e-9 * std::abs(eigen.eigenvalues()(matrix.rows() - 1));
}

std::string subject(const std::string& name) { return name.empty() ? "information set" : name; }

}  // namespace

InformationSet::InformationSet(std::size_t dimension, AlignedArray information,
                               CandidateTable candidates, std::vector<std::string> parameters,
                               std::string name)
    : dimension_(dimension),
      packed_size_(graybox::packed_size(dimension)),
      candidate_count_(dimension == 0 ? 0 : information.size() / packed_size_),
      information_(std::move(information)),
      candidates_(std::move(candidates)),
      parameters_(std::move(parameters)),
      name_(std::move(name)) {
  const std::string who = subject(name_);
  if (dimension_ == 0) throw InputError(who + ": the number of parameters d must be at least 1");
  if (candidate_count_ == 0) throw InputError(who + ": there are no candidates");
  if (candidate_count_ * packed_size_ != information_.size()) {
    throw InputError(fmt::format("{}: {} numbers do not divide into packed matrices of {} (d = {})",
                                 who, information_.size(), packed_size_, dimension_));
  }
  if (candidates_.units.size() != candidates_.names.size()) {
    throw InputError(fmt::format("{}: candidates: {} column names but {} units", who,
                                 candidates_.names.size(), candidates_.units.size()));
  }
  if (candidates_.values.size() != candidate_count_ * candidates_.names.size()) {
    throw InputError(fmt::format("{}: candidates: {} values, but {} candidates of {} columns", who,
                                 candidates_.values.size(), candidate_count_,
                                 candidates_.names.size()));
  }
  if (!parameters_.empty() && parameters_.size() != dimension_) {
    throw InputError(
        fmt::format("{}: parameters: {} names, but d = {}", who, parameters_.size(), dimension_));
  }
}

std::span<const double> InformationSet::coordinates(std::size_t candidate) const {
  const std::size_t n = candidates_.names.size();
  return std::span<const double>(candidates_.values).subspan(candidate * n, n);
}

std::string InformationSet::content_hash() const {
  const std::uint64_t shape[2] = {candidate_count_, dimension_};  // little-endian on x86-64
  Sha256 hash;
  hash.update(shape, sizeof shape);
  hash.update(information_.data(), bytes());
  return hash.hexadecimal();
}

InformationSet InformationSet::subset(std::span<const std::size_t> indices) const {
  const std::size_t n = candidates_.names.size();
  AlignedArray information(indices.size() * packed_size_);
  CandidateTable table{candidates_.names, candidates_.units, {}};
  table.values.reserve(indices.size() * n);
  for (std::size_t k = 0; k < indices.size(); ++k) {
    const std::size_t i = indices[k];
    if (i >= candidate_count_) {
      throw InputError(fmt::format("{}: subset index {} is not below the {} candidates",
                                   subject(name_), i, candidate_count_));
    }
    std::ranges::copy(this->information(i), information.begin() + k * packed_size_);
    const auto row = coordinates(i);
    table.values.insert(table.values.end(), row.begin(), row.end());
  }
  return InformationSet(dimension_, std::move(information), std::move(table), parameters_, name_);
}

void InformationSet::validate() const {
  const std::string who = subject(name_);
  std::vector<double> sum(packed_size_, 0.0);
  for (std::size_t i = 0; i < candidate_count_; ++i) {
    const auto packed = this->information(i);
    const auto bad = std::ranges::find_if_not(packed, [](double x) { return std::isfinite(x); });
    if (bad != packed.end()) {
      throw InputError(
          fmt::format("{}: candidate {}: entry {} of the packed matrix is {}; remove "
                      "or repair that candidate",
                      who, i, bad - packed.begin(), *bad));
    }
    if (!is_positive_semidefinite(full_matrix(packed, dimension_))) {
      throw InputError(
          fmt::format("{}: candidate {}: the information matrix is not positive "
                      "semidefinite; check how it was formed",
                      who, i));
    }
    // Normalised, so that a few huge candidates can't hide the directions the others see.
    double scale = 0.0;
    for (std::size_t j = 0; j < dimension_; ++j)
      scale = std::max(scale, packed[packed_index(j, j)]);
    if (scale == 0.0) continue;
    for (std::size_t k = 0; k < packed_size_; ++k) sum[k] += packed[k] / scale;
  }
  Eigen::MatrixXd total = full_matrix(sum, dimension_);
  // Unit diagonal before judging the rank: units of the parameters must not matter.
  Eigen::VectorXd diagonal = total.diagonal();
  for (Eigen::Index j = 0; j < diagonal.size(); ++j) {
    if (diagonal(j) <= 0.0) {
      throw InputError(fmt::format(
          "{}: the sum of all information matrices is singular: no "
          "candidate informs about parameter {}",
          who, parameters_.empty() ? std::to_string(j) : parameters_[static_cast<std::size_t>(j)]));
    }
  }
  const Eigen::VectorXd inverse_root = diagonal.cwiseSqrt().cwiseInverse();
  total = inverse_root.asDiagonal() * total * inverse_root.asDiagonal();
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(total);
  const Eigen::VectorXd values = eigen.eigenvalues();
  if (values(0) <= 1e-14 * static_cast<double>(dimension_) * values(values.size() - 1)) {
    Eigen::Index worst = 0;
    eigen.eigenvectors().col(0).cwiseAbs().maxCoeff(&worst);
    throw InputError(fmt::format(
        "{}: the sum of all information matrices is singular (reciprocal condition {:.1e}): a "
        "combination of parameters with most weight on {} can't be estimated by any design",
        who, values(0) / values(values.size() - 1),
        parameters_.empty() ? "parameter " + std::to_string(worst)
                            : parameters_[static_cast<std::size_t>(worst)]));
  }
}

std::vector<std::size_t> nested_subset(std::size_t total, std::size_t count, std::uint64_t seed) {
  if (count > total) {
    throw InputError(
        fmt::format("a subset of {} candidates was asked of a set of {}", count, total));
  }
  std::vector<std::size_t> order(total);
  std::iota(order.begin(), order.end(), std::size_t{0});
  Random random(seed);
  for (std::size_t i = 0; i < count; ++i) {  // Fisher-Yates from the front: prefixes are nested
    std::swap(order[i], order[i + random.below(total - i)]);
  }
  order.resize(count);
  return order;
}

}  // namespace graybox
