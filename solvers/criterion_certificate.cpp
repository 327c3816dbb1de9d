#include "graybox/solvers/criterion_certificate.hpp"

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "graybox/problems/packed_matrix.hpp"
#include "graybox/solvers/criterion_column_generation.hpp"
#include "graybox/solvers/tracer.hpp"

namespace graybox {
namespace {

using Matrix = Eigen::Matrix<Extended, Eigen::Dynamic, Eigen::Dynamic>;
using Vector = Eigen::Matrix<Extended, Eigen::Dynamic, 1>;

constexpr double kGoodGap = 1e-9;  // no better dual matrix is looked for
constexpr Extended kUnit = std::numeric_limits<Extended>::epsilon() / 2;

// Packed so that a dot product with a packed symmetric H is tr(A H).
std::vector<Extended> trace_dual(const Matrix& a) {
  std::vector<Extended> packed;
  for (Eigen::Index i = 0; i < a.rows(); ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) packed.push_back(i == j ? a(i, i) : a(i, j) + a(j, i));
  }
  return packed;
}

Matrix inverse_factor(const ExtendedInformation& information, std::size_t d) {
  const auto size = static_cast<Eigen::Index>(d);
  using RowMajor = Eigen::Matrix<Extended, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  return Eigen::Map<const RowMajor>(information.inverse_factor().data(), size, size);
}

// w_i = tr(Z^T H_i Z) for every candidate, with a bound on each error.
class Pricing {
 public:
  Pricing(const InformationSet& set, const ExtendedInformation& information, const Matrix& z)
      : set_(set),
        information_(information),
        dual_(trace_dual(z * z.transpose())),
        magnitude_(trace_dual(z.cwiseAbs() * z.cwiseAbs().transpose())),
        unit_(static_cast<Extended>(dual_.size() + 2 * set.dimension() +
                                    static_cast<std::size_t>(z.cols()) + 4) *
              kUnit) {}

  // `model_error(w, a)` bounds the error of w_i beyond rounding, a = tr(M^-1 H_i).
  template <typename ModelError>
  void run(const ModelError& model_error) {
    for (std::size_t i = 0; i < set_.candidate_count(); ++i) {
      const auto h = set_.information(i);
      Extended w = 0, magnitude = 0;
      for (std::size_t k = 0; k < h.size(); ++k) {
        w += dual_[k] * h[k];
        magnitude += magnitude_[k] * std::abs(h[k]);
      }
      const Extended error = unit_ * magnitude + model_error(std::max(w, Extended{0}), i);
      upper_ = std::max(upper_, w + error);
      if (w > largest_) {
        largest_ = w;
        error_of_largest_ = error;
        worst_ = i;
      }
    }
  }

  [[nodiscard]] Extended information_trace(std::size_t i) const {
    return information_.sensitivity(set_.information(i)) / (1 - information_.residual());
  }

  // The gap max w_i / scale - 1, with scale known to within the relative error given.
  void certify(Extended scale, Extended scale_error, Certificate& certificate) const {
    const Extended ratio = largest_ / scale;
    const Extended highest = upper_ / (scale * (1 - scale_error));
    const Extended lowest = (largest_ - error_of_largest_) / (scale * (1 + scale_error));
    certificate.worst_candidate = worst_;
    certificate.duality_gap = static_cast<double>(ratio - 1);
    certificate.rounding_bound =
        static_cast<double>(std::max(highest - ratio, ratio - lowest) +
                            std::numeric_limits<double>::epsilon() * std::abs(ratio - 1));
  }

 private:
  const InformationSet& set_;
  const ExtendedInformation& information_;
  std::vector<Extended> dual_;
  std::vector<Extended> magnitude_;
  Extended unit_;
  Extended largest_ = 0, error_of_largest_ = 0, upper_ = 0;
  std::size_t worst_ = 0;
};

void price_trace(const InformationSet& set, const Criterion& criterion,
                 const ExtendedInformation& information, Certificate& certificate) {
  const std::size_t d = set.dimension();
  const std::vector<double> factor = criterion.factor(d);
  const auto rows = static_cast<Eigen::Index>(d);
  const Matrix k = Eigen::Map<const Eigen::MatrixXd>(factor.data(), rows,
                                                     static_cast<Eigen::Index>(factor.size() / d))
                       .cast<Extended>();
  const Matrix x = inverse_factor(information, d);
  const Matrix whitened = x * k;
  const Extended phi = whitened.squaredNorm();
  const Extended eta = information.residual() / (1 - information.residual());
  Pricing pricing(set, information, x.transpose() * whitened);
  pricing.run([&](Extended w, std::size_t i) {
    const Extended a = pricing.information_trace(i);
    return 2 * eta * std::sqrt(phi * w * a) + eta * eta * phi * a;
  });
  pricing.certify(phi, eta + static_cast<Extended>(4 * d) * kUnit, certificate);
  certificate.criterion_value = static_cast<double>(phi);
}

void price_interest(const InformationSet& set, const Criterion& criterion,
                    const ExtendedInformation& information, Certificate& certificate) {
  const std::size_t d = set.dimension();
  const std::size_t s = criterion.interest().size();
  const Matrix x = inverse_factor(information, d);
  const Extended eta = information.residual() / (1 - information.residual());
  Pricing pricing(set, information, x.bottomRows(static_cast<Eigen::Index>(s)).transpose());
  pricing.run([&](Extended, std::size_t i) { return 2 * eta * pricing.information_trace(i); });
  pricing.certify(static_cast<Extended>(s), 0, certificate);
  Extended log_det = 0;
  for (std::size_t k = d - s; k < d; ++k) log_det += information.log_pivot(k);
  certificate.criterion_value = static_cast<double>(log_det);
}

struct LargestEigenvalue {
  Extended value = 0;
  Extended relative_error = 0;
  Vector vector;
};

// Of a positive semidefinite matrix. With the computed eigenvectors V as a congruence, |V^T V - I|
// <= e, the largest eigenvalue of V^T Y V is within the factors 1 -+ e of Y's (Ostrowski), and its
// diagonal differs from its eigenvalues by no more than what stands beside it (Weyl).
LargestEigenvalue largest_eigenvalue(const Matrix& y) {
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(y);
  const Matrix& v = eigen.eigenvectors();
  const Eigen::Index d = y.rows();
  Matrix diagonalised = v.transpose() * y * v;
  const Extended value = diagonalised.diagonal().maxCoeff();
  diagonalised.diagonal().setZero();
  const Extended rounding = static_cast<Extended>(6 * d * d) * kUnit;
  const Extended skew = (v.transpose() * v - Matrix::Identity(d, d)).norm() + rounding;
  return {value, (diagonalised.norm() / value + rounding + skew) / (1 - skew), v.col(d - 1)};
}

// Z with E = Z Z^T positive semidefinite and of trace one, from the design's dual matrix; empty
// where that is no matrix at all.
Matrix repaired_factor(const InformationSet& set, const std::vector<double>& dual, double& repair) {
  const auto d = static_cast<Eigen::Index>(set.dimension());
  if (dual.size() != set.packed_size() ||
      !std::ranges::all_of(dual, [](double x) { return std::isfinite(x); })) {
    return {};
  }
  Eigen::MatrixXd full(d, d);
  unpack(dual.data(), set.dimension(), full.data());
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(full.cast<Extended>());
  const Vector kept = eigen.eigenvalues().cwiseMax(Extended{0});
  const Extended trace = kept.sum();
  if (!(trace > 0) || !std::isfinite(trace)) return {};
  repair = static_cast<double>((kept / trace - eigen.eigenvalues()).cwiseAbs().sum());
  return eigen.eigenvectors() * (kept / trace).cwiseSqrt().asDiagonal();
}

// The dual matrix of the best design, found from the support of this one. It needs no trust: it is
// repaired and priced like any other.
std::vector<double> best_dual_matrix(const InformationSet& set, const Design& design) {
  const SolveOptions options{.duality_gap = kGoodGap, .criterion = Criterion::e()};
  Tracer tracer(set, options, nullptr);
  Design start{design.weights};
  for (double& weight : start.weights) weight = std::max(weight, 0.0);
  return solve_criterion(set, options, start, tracer).design.dual_matrix;
}

void price_smallest_eigenvalue(const InformationSet& set, const Design& design,
                               const ExtendedInformation& information, Certificate& certificate) {
  const std::size_t d = set.dimension();
  const Matrix x = inverse_factor(information, d);
  const LargestEigenvalue inverse = largest_eigenvalue(x.transpose() * x);
  const auto price = [&](const Matrix& z) {
    Pricing pricing(set, information, z);
    pricing.run([](Extended, std::size_t) { return Extended{0}; });
    // The gap is max w_i / (tr E lambda_min) - 1.
    const Extended scale = z.squaredNorm() / inverse.value;
    const Extended error =
        inverse.relative_error + information.residual() + static_cast<Extended>(d * d + 4) * kUnit;
    pricing.certify(scale, std::min(error, Extended{0.5}), certificate);
    return certificate.duality_gap;
  };
  certificate.criterion_value = static_cast<double>(1 / inverse.value);
  if (const Matrix given = repaired_factor(set, design.dual_matrix, certificate.dual_repair);
      given.size() > 0) {
    price(given);
    return;
  }
  // The eigenvector is the one dual matrix that fits where the smallest eigenvalue is simple.
  const double simple_gap = price(inverse.vector);
  if (simple_gap <= kGoodGap) return;
  double unused = 0.0;
  const Matrix found = repaired_factor(set, best_dual_matrix(set, design), unused);
  if (found.size() == 0 || !(price(found) < simple_gap)) price(inverse.vector);
}

}  // namespace

std::vector<std::size_t> elimination_order(const InformationSet& set, const Criterion& criterion) {
  std::vector<std::size_t> order;
  if (criterion.kind() != CriterionKind::kDs) return order;
  for (std::size_t k = 0; k < set.dimension(); ++k) {
    if (!std::ranges::binary_search(criterion.interest(), k)) order.push_back(k);
  }
  order.insert(order.end(), criterion.interest().begin(), criterion.interest().end());
  return order;
}

void price_criterion(const InformationSet& set, const Design& design, const Criterion& criterion,
                     const ExtendedInformation& information, Certificate& certificate) {
  switch (criterion.kind()) {
    case CriterionKind::kE:
      return price_smallest_eigenvalue(set, design, information, certificate);
    case CriterionKind::kDs:
      return price_interest(set, criterion, information, certificate);
    default:
      return price_trace(set, criterion, information, certificate);
  }
}

}  // namespace graybox
