#include "problems/information/set_validation.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <span>
#include <string>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/information/factor_form.hpp"

namespace graybox {
namespace {

Eigen::MatrixXd full_matrix(std::span<const double> packed, std::size_t dimension) {
  const auto d = static_cast<Eigen::Index>(dimension);
  Eigen::MatrixXd full(d, d);
  unpack(packed.data(), dimension, full.data());
  return full;
}

// Allocates once for all matrices: a process with threads pays for each time.
class SemidefiniteTest {
 public:
  explicit SemidefiniteTest(std::size_t dimension)
      : matrix_(static_cast<Eigen::Index>(dimension), static_cast<Eigen::Index>(dimension)),
        shifted_(matrix_.rows(), matrix_.cols()) {}

  // A quick sufficient test first: the matrix shifted by the tolerance has a Cholesky factor.
  bool operator()(std::span<const double> packed) {
    unpack(packed.data(), static_cast<std::size_t>(matrix_.rows()), matrix_.data());
    const double scale = matrix_.diagonal().cwiseAbs().maxCoeff();
    if (scale == 0.0) return matrix_.cwiseAbs().maxCoeff() == 0.0;
    shifted_ = matrix_ / scale;
    shifted_.diagonal().array() += kSemidefiniteRounding;
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> in_place(shifted_);
    if (in_place.info() == Eigen::Success) return true;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(matrix_ / scale,
                                                               Eigen::EigenvaluesOnly);
    return eigen.info() == Eigen::Success &&
           eigen.eigenvalues()(0) >=
               -kSemidefiniteRounding * std::abs(eigen.eigenvalues()(matrix_.rows() - 1));
  }

 private:
  Eigen::MatrixXd matrix_, shifted_;
};

std::string subject(const InformationSet& set) {
  return set.name().empty() ? "information set" : set.name();
}

std::string parameter(const InformationSet& set, Eigen::Index k) {
  return set.parameters().empty() ? fmt::format("parameter {}", k)
                                  : set.parameters()[static_cast<std::size_t>(k)];
}

// The sum of the matrices, each divided by its largest diagonal entry, so that a few huge
// candidates can't hide the directions the others see.
Eigen::MatrixXd normalised_sum(const InformationSet& set) {
  std::vector<double> sum(set.packed_size(), 0.0), buffer(set.packed_size());
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    const auto packed = set.packed(i, buffer);
    double scale = 0.0;
    for (std::size_t j = 0; j < set.dimension(); ++j) {
      scale = std::max(scale, packed[packed_index(j, j)]);
    }
    if (scale == 0.0) continue;
    for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += packed[k] / scale;
  }
  return full_matrix(sum, set.dimension());
}

// "0.71 a - 0.70 b + ...": the terms of at least a tenth of the largest, heaviest first.
std::string combination(const InformationSet& set, const Eigen::VectorXd& direction) {
  constexpr std::size_t kMostTerms = 6;
  std::vector<Eigen::Index> order;
  const double largest = direction.cwiseAbs().maxCoeff();
  for (Eigen::Index k = 0; k < direction.size(); ++k) {
    if (std::abs(direction(k)) >= 0.1 * largest) order.push_back(k);
  }
  std::ranges::stable_sort(order, [&](Eigen::Index a, Eigen::Index b) {
    return std::abs(direction(a)) > std::abs(direction(b));
  });
  const double sign = direction(order.front()) < 0.0 ? -1.0 : 1.0;
  std::string text;
  for (std::size_t n = 0; n < std::min(order.size(), kMostTerms); ++n) {
    const double factor = sign * direction(order[n]);
    const char* joint = n == 0 ? "" : (factor < 0.0 ? " - " : " + ");
    text += fmt::format("{}{:.2g} {}", joint, std::abs(factor), parameter(set, order[n]));
  }
  return order.size() > kMostTerms ? text + " + ..." : text;
}

}  // namespace

std::vector<std::size_t> indefinite_candidates(const InformationSet& set) {
  std::vector<std::size_t> indefinite;
  if (set.has_factors()) {  // F^T F has no negative eigenvalue
    const std::size_t size = set.candidate_count() * set.rank() * set.dimension();
    require_finite_factors(subject(set), {set.factors(), size}, set.rank(), set.dimension());
    return indefinite;
  }
  SemidefiniteTest is_positive_semidefinite(set.dimension());
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    const auto packed = set.information(i);
    const auto bad = std::ranges::find_if_not(packed, [](double x) { return std::isfinite(x); });
    if (bad != packed.end()) {
      throw InputError(
          fmt::format("{}: candidate {}: entry {} of the packed matrix is {}; remove "
                      "or repair that candidate",
                      subject(set), i, bad - packed.begin(), *bad));
    }
    if (!is_positive_semidefinite(packed)) indefinite.push_back(i);
  }
  return indefinite;
}

void require_regular_sum(const InformationSet& set) {
  Eigen::MatrixXd total = normalised_sum(set);
  // Unit diagonal before judging the rank: units of the parameters must not matter.
  const Eigen::VectorXd diagonal = total.diagonal();
  for (Eigen::Index j = 0; j < diagonal.size(); ++j) {
    if (diagonal(j) > 0.0) continue;
    throw InputError(
        fmt::format("{}: the sum of all information matrices is singular: no candidate informs "
                    "about {}; fix it, or add candidates that do",
                    subject(set), parameter(set, j)));
  }
  const Eigen::VectorXd inverse_root = diagonal.cwiseSqrt().cwiseInverse();
  total = inverse_root.asDiagonal() * total * inverse_root.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(total);
  const Eigen::VectorXd& values = eigen.eigenvalues();
  const double largest = values(values.size() - 1);
  if (values(0) > 1e-14 * static_cast<double>(set.dimension()) * largest) return;
  const Eigen::VectorXd direction =
      inverse_root.cwiseProduct(eigen.eigenvectors().col(0)).normalized();
  throw InputError(fmt::format(
      "{}: the sum of all information matrices is singular in double precision (reciprocal "
      "condition {:.1e}): no candidate informs the parameter combination {}; fix one of these, add "
      "candidates that inform it, or, where the basis of the parameters is to blame (monomials), "
      "change to an orthogonal one: T H T' for every matrix H",
      subject(set), values(0) / largest, combination(set, direction)));
}

}  // namespace graybox
