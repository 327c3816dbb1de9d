#include "problems/information/semidefinite_projection.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <span>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/information/set_validation.hpp"

namespace graybox {
namespace {

using Matrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
using Vector = Eigen::Matrix<long double, Eigen::Dynamic, 1>;

// The nearest positive semidefinite matrix; `eigenvalue` is the smallest of this one, relative to
// the largest.
Eigen::MatrixXd nearest_semidefinite(std::span<const double> packed, std::size_t dimension,
                                     double& eigenvalue) {
  const auto d = static_cast<Eigen::Index>(dimension);
  Eigen::MatrixXd matrix(d, d);
  unpack(packed.data(), dimension, matrix.data());
  const double scale = matrix.cwiseAbs().maxCoeff();
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen((matrix / scale).cast<long double>());
  const Vector& values = eigen.eigenvalues();
  eigenvalue = static_cast<double>(values(0) / values.cwiseAbs().maxCoeff());
  const Matrix& vectors = eigen.eigenvectors();
  const Matrix nearest = vectors * values.cwiseMax(0.0L).asDiagonal() * vectors.transpose();
  return scale * nearest.cast<double>();
}

std::string subject(const InformationSet& set) {
  return set.name().empty() ? "information set" : set.name();
}

void require_tolerance(double tolerance) {
  if (!(tolerance >= kSemidefiniteRounding && tolerance <= kLargestSemidefiniteTolerance)) {
    throw InputError(fmt::format("--psd-tolerance {} must be from {:g} to {:g}", tolerance,
                                 kSemidefiniteRounding, kLargestSemidefiniteTolerance));
  }
}

[[noreturn]] void refuse(const InformationSet& set, std::size_t candidate, double eigenvalue) {
  const bool could_be_accepted = eigenvalue >= -kLargestSemidefiniteTolerance;
  throw InputError(fmt::format(
      "{}: candidate {}: the information matrix is not positive semidefinite: its smallest "
      "eigenvalue is {:.1e} of its largest; check how it was formed{}",
      subject(set), candidate, eigenvalue,
      could_be_accepted ? fmt::format(", or accept it with --psd-tolerance {:.0e}", -2 * eigenvalue)
                        : std::string()));
}

}  // namespace

ProjectedSet project_semidefinite(InformationSet set, double tolerance,
                                  SingularSum singular_sum) {
  require_tolerance(tolerance);
  const std::size_t d = set.dimension(), p = set.packed_size();
  SemidefiniteChange change;
  AlignedArray changed;
  for (const std::size_t i : indefinite_candidates(set)) {
    double eigenvalue = 0.0;
    const Eigen::MatrixXd nearest = nearest_semidefinite(set.information(i), d, eigenvalue);
    if (eigenvalue < -tolerance) refuse(set, i, eigenvalue);
    if (changed.size() == 0) {
      changed = AlignedArray(set.candidate_count() * p);
      std::copy_n(set.data(), changed.size(), changed.begin());
    }
    pack(nearest.data(), d, changed.data() + i * p);
    ++change.candidates;
    if (eigenvalue < change.smallest_eigenvalue) {
      change.smallest_eigenvalue = eigenvalue;
      change.worst_candidate = i;
    }
  }
  if (change.candidates > 0) {
    set = InformationSet(d, std::move(changed), set.candidates(), set.parameters(), set.name());
  }
  if (singular_sum == SingularSum::kRefused) require_regular_sum(set);
  return {std::move(set), change};
}

std::string describe(const SemidefiniteChange& change) {
  if (change.candidates == 0) return {};
  return fmt::format(
      "{} {} made positive semidefinite: negative eigenvalues, down to {:.1e} of the largest "
      "(candidate {}), were set to zero",
      change.candidates, change.candidates == 1 ? "matrix was" : "matrices were",
      change.smallest_eigenvalue, change.worst_candidate);
}

}  // namespace graybox
