#include "solvers/core/criterion.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"

namespace graybox {
namespace {

constexpr std::array<std::pair<CriterionKind, std::string_view>, 10> kNames{{
    {CriterionKind::kD, "D"},
    {CriterionKind::kA, "A"},
    {CriterionKind::kE, "E"},
    {CriterionKind::kL, "L"},
    {CriterionKind::kDs, "Ds"},
    {CriterionKind::kC, "c"},
    {CriterionKind::kI, "I"},
    {CriterionKind::kPhiP, "phi_p"},
    {CriterionKind::kG, "G"},
    {CriterionKind::kCompound, "compound"},
}};

constexpr double kForgivenNegative = 1e-9;
constexpr double kNegligible = 1e-14;

[[noreturn]] void refuse_weights(std::string_view name, double smallest, double largest) {
  throw InputError(
      fmt::format("criterion {}: the weight matrix W must be positive semidefinite and not zero; "
                  "scaled to unit diagonal, its eigenvalues reach from {:.3g} to {:.3g}",
                  name, smallest, largest));
}

// K of W = K K^T, column-major, a column for each eigenvalue of W, scaled to unit diagonal, that is
// not negligible.
std::vector<double> factor_of(std::string_view name, std::span<const double> packed,
                              std::size_t d) {
  const auto size = static_cast<Eigen::Index>(d);
  Eigen::MatrixXd matrix(size, size);
  unpack(packed.data(), d, matrix.data());
  if (!matrix.allFinite()) {
    throw InputError(fmt::format("criterion {}: the weight matrix W is not finite", name));
  }
  Eigen::VectorXd scale = matrix.diagonal().cwiseMax(0.0).cwiseSqrt();
  Eigen::VectorXd inverse = scale;
  for (double& x : inverse) x = x > 0.0 ? 1.0 / x : 0.0;
  for (Eigen::Index i = 0; i < size; ++i) {
    if (scale(i) == 0.0 && !matrix.row(i).isZero(0.0)) refuse_weights(name, -1.0, 1.0);
  }
  matrix = (inverse.asDiagonal() * matrix * inverse.asDiagonal()).eval();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(matrix);
  const Eigen::VectorXd& values = eigen.eigenvalues();
  const double largest = values(size - 1);
  if (!(largest > 0.0) || values(0) < -kForgivenNegative * largest) {
    refuse_weights(name, values(0), largest);
  }
  std::vector<double> factor;
  for (Eigen::Index k = 0; k < size; ++k) {
    if (!(values(k) > kNegligible * static_cast<double>(d) * largest)) continue;
    const Eigen::VectorXd column =
        std::sqrt(values(k)) * scale.cwiseProduct(eigen.eigenvectors().col(k));
    factor.insert(factor.end(), column.begin(), column.end());
  }
  return factor;
}

std::string known_parameters(const InformationSet& set) {
  if (set.parameters().empty()) {
    return fmt::format("the set's {} parameters have no names: give indices from 0 to {}",
                       set.dimension(), set.dimension() - 1);
  }
  return fmt::format("the parameters are {}", fmt::join(set.parameters(), ", "));
}

}  // namespace

std::string_view to_string(CriterionKind kind) {
  for (const auto& [value, name] : kNames) {
    if (value == kind) return name;
  }
  return "unknown";
}

CriterionKind criterion_kind(std::string_view name) {
  if (name == "V") return CriterionKind::kI;  // its other name (Atkinson, Donev and Tobias 2007)
  for (const auto& [value, known] : kNames) {
    if (known == name) return value;
  }
  throw InputError(
      fmt::format("unknown criterion '{}'; choose D, A, E, L, Ds, c, I (or V), phi_p or G", name));
}

Criterion Criterion::weighted(CriterionKind kind, std::vector<double> weights) {
  std::size_t d = 1;
  while (packed_size(d) < weights.size()) ++d;
  if (packed_size(d) != weights.size()) {
    throw InputError(
        fmt::format("criterion {}: {} numbers are no packed lower triangle of a square matrix",
                    to_string(kind), weights.size()));
  }
  Criterion criterion(kind);
  criterion.weight_factor_ = factor_of(to_string(kind), weights, d);
  criterion.weights_ = std::move(weights);
  return criterion;
}

Criterion Criterion::l(std::vector<double> weights) {
  return weighted(CriterionKind::kL, std::move(weights));
}

Criterion Criterion::c(std::vector<double> weights) {
  return weighted(CriterionKind::kC, std::move(weights));
}

Criterion Criterion::i(std::vector<double> weights) {
  return weighted(CriterionKind::kI, std::move(weights));
}

Criterion Criterion::phi_p(double p) {
  if (!(p >= 0.0)) {
    throw InputError(
        fmt::format("criterion phi_p: p is {}; give a number from 0 (D) over 1 (A) to "
                    "inf (E)",
                    p));
  }
  if (p == 0.0) return {};
  if (std::isinf(p)) return e();
  Criterion criterion(CriterionKind::kPhiP);
  criterion.p_ = p;
  return criterion;
}

Criterion Criterion::g(PredictionRegion region) {
  if (region.count() == 0) throw InputError("criterion G: the region has no points");
  Criterion criterion(CriterionKind::kG);
  criterion.region_ = std::move(region);
  return criterion;
}

Criterion Criterion::compound(std::vector<CriterionPart> parts) {
  if (parts.empty()) throw InputError("a compound criterion needs at least one part");
  double largest = 0.0;
  int with_eigenvalue = 0;
  for (const CriterionPart& part : parts) {
    const CriterionKind kind = part.criterion.kind();
    if (kind == CriterionKind::kCompound) {
      throw InputError("a compound criterion can't be part of another: give all parts at once");
    }
    if (kind == CriterionKind::kE && ++with_eigenvalue > 1) {
      throw InputError("compound criterion: E stands there twice; add up its shares");
    }
    if (!(part.share > 0.0) || !std::isfinite(part.share)) {
      throw InputError(fmt::format("compound criterion: the share of {} is {}; it must be positive",
                                   to_string(kind), part.share));
    }
    largest = std::max(largest, part.share);
  }
  // Over the largest first: large shares have no sum.
  double sum = 0.0;
  for (CriterionPart& part : parts) sum += part.share /= largest;
  for (CriterionPart& part : parts) {
    part.share /= sum;
    if (part.share > 0.0) continue;
    throw InputError(
        fmt::format("compound criterion: the share of {} is nothing beside that of the others; "
                    "leave it out or state a larger one",
                    to_string(part.criterion.kind())));
  }
  Criterion criterion(CriterionKind::kCompound);
  criterion.parts_ = std::move(parts);
  return criterion;
}

bool operator==(const Criterion& a, const Criterion& b) {
  return a.kind_ == b.kind_ && a.weights_ == b.weights_ && a.interest_ == b.interest_ &&
         a.p_ == b.p_ && a.region_ == b.region_ && a.parts_ == b.parts_;
}

Criterion Criterion::ds(std::vector<std::size_t> interest) {
  if (interest.empty()) {
    throw InputError("criterion Ds: name at least one parameter of interest");
  }
  std::ranges::sort(interest);
  const auto twice = std::ranges::adjacent_find(interest);
  if (twice != interest.end()) {
    throw InputError(fmt::format("criterion Ds: parameter {} is named twice", *twice));
  }
  Criterion criterion(CriterionKind::kDs);
  criterion.interest_ = std::move(interest);
  return criterion;
}

std::vector<double> Criterion::factor(std::size_t dimension) const {
  if (has_weights()) return weight_factor_;
  const std::size_t columns = kind_ == CriterionKind::kDs ? interest_.size() : dimension;
  std::vector<double> factor(dimension * columns, 0.0);
  for (std::size_t k = 0; k < columns; ++k) {
    factor[k * dimension + (kind_ == CriterionKind::kDs ? interest_[k] : k)] = 1.0;
  }
  return factor;
}

void Criterion::require_fits(const InformationSet& set) const {
  const std::size_t d = set.dimension();
  for (const CriterionPart& part : parts_) part.criterion.require_fits(set);
  if (kind_ == CriterionKind::kG && region_.count() > 0 && region_.dimension() != d) {
    throw InputError(
        fmt::format("criterion G: the region has {} columns, but the set has {} "
                    "parameters",
                    region_.dimension(), d));
  }
  if (has_weights() && weights_.size() != packed_size(d)) {
    const auto rows =
        static_cast<std::size_t>(std::sqrt(2.0 * static_cast<double>(weights_.size())));
    throw InputError(fmt::format("criterion {2}: W is {0} x {0}, but the set has {1} parameters",
                                 rows, d, to_string(kind_)));
  }
  if (kind_ == CriterionKind::kDs && interest_.back() >= d) {
    throw InputError(fmt::format("criterion Ds: there is no parameter {}; {}", interest_.back(),
                                 known_parameters(set)));
  }
}

std::vector<std::size_t> parameter_indices(const InformationSet& set,
                                           std::span<const std::string> names) {
  std::vector<std::size_t> indices;
  for (const std::string& name : names) {
    const auto known = std::ranges::find(set.parameters(), name);
    std::size_t index = static_cast<std::size_t>(known - set.parameters().begin());
    if (known == set.parameters().end()) {
      const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), index);
      if (error != std::errc() || end != name.data() + name.size() || index >= set.dimension()) {
        throw InputError(fmt::format("unknown parameter '{}'; {}", name, known_parameters(set)));
      }
    }
    indices.push_back(index);
  }
  return indices;
}

}  // namespace graybox
