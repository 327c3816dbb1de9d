#include "solvers/exact_bounds/relaxation.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/QR>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/stop.hpp"
#include "solvers/column_generation/column_generation.hpp"

namespace graybox {
namespace {

using ExtendedMatrix = Eigen::Matrix<Extended, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// X with X M(weights) X^T = I.
std::vector<Extended> whitening_transform(const InformationSet& set,
                                          std::span<const Extended> weights) {
  const auto d = static_cast<Eigen::Index>(set.dimension());
  ExtendedMatrix sum = ExtendedMatrix::Zero(d, d);
  for (std::size_t c = 0; c < weights.size(); ++c) {
    if (weights[c] == 0) continue;
    const double* h = set.information(c).data();
    for (Eigen::Index i = 0; i < d; ++i) {
      for (Eigen::Index j = 0; j <= i; ++j) sum(i, j) += weights[c] * *h++;
    }
  }
  const Eigen::LLT<ExtendedMatrix> factor(sum);  // reads the lower triangle
  const ExtendedMatrix transform = factor.matrixL().solve(ExtendedMatrix::Identity(d, d));
  return {transform.data(), transform.data() + transform.size()};
}

// d as soon as one matrix has it, and where there is no time to look at all: more is safe.
std::size_t largest_rank(const InformationSet& set) {
  const auto d = static_cast<Eigen::Index>(set.dimension());
  Eigen::MatrixXd full(d, d);
  Eigen::Index largest = 0;
  for (std::size_t i = 0; i < set.candidate_count() && largest < d; ++i) {
    if (stop_requested()) return set.dimension();
    unpack(set.information(i).data(), set.dimension(), full.data());
    // Rank does not depend on the units of the parameters; the threshold does.
    const Eigen::VectorXd scale = full.diagonal().unaryExpr(
        [](double entry) { return entry > 0.0 ? 1.0 / std::sqrt(entry) : 0.0; });
    const Eigen::MatrixXd unit = scale.asDiagonal() * full * scale.asDiagonal();
    Eigen::ColPivHouseholderQR<Eigen::MatrixXd> factor(unit);
    factor.setThreshold(1e-13);
    largest = std::max(largest, factor.rank());
  }
  return static_cast<std::size_t>(largest);
}

}  // namespace

double Relaxation::log_det_bound(std::int64_t experiments) const {
  const auto d = static_cast<double>(dimension);
  const double log_m = d * std::log(static_cast<double>(experiments));
  const double bound = log_det_ceiling + log_m;
  return bound + std::numeric_limits<double>::epsilon() * (std::abs(bound) + std::abs(log_m));
}

Relaxation certified_relaxation(const InformationSet& set, Design design, int threads) {
  Relaxation relaxation;
  relaxation.dimension = set.dimension();
  relaxation.largest_rank = largest_rank(set);
  relaxation.certificate = certify(set, design);
  const Certificate& certificate = relaxation.certificate;
  if (certificate.status != CertificateStatus::kCertified) {
    throw InputError(set.name() + ": no design of the relaxed problem (" + certificate.message +
                     ")");
  }
  const auto d = static_cast<double>(set.dimension());
  const CheckedWeights checked(set, design);
  const ExtendedInformation information(set, checked.weights);
  relaxation.log_det_ceiling = certificate.log_det +
                               log_det_rounding(information, set.dimension()) +
                               d * std::log1p(largest_gap(certificate));
  relaxation.inverse_factor = whitening_transform(set, checked.weights);
  relaxation.sensitivities.resize(set.candidate_count());
  const auto count = static_cast<std::ptrdiff_t>(set.candidate_count());
#pragma omp parallel for num_threads(threads) schedule(static)
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    const auto candidate = static_cast<std::size_t>(i);
    relaxation.sensitivities[candidate] =
        static_cast<double>(information.sensitivity(set.information(candidate)));
  }
  relaxation.weights = std::move(design.weights);
  return relaxation;
}

Relaxation solve_relaxation(const InformationSet& set, const RelaxationOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  const TimeLimit limit(options.time_limit);
  Solution solution = ColumnGeneration().solve(set, {.duality_gap = options.duality_gap,
                                                     .time_limit = options.time_limit,
                                                     .seed = options.seed,
                                                     .threads = options.threads});
  Relaxation relaxation = certified_relaxation(set, std::move(solution.design), options.threads);
  relaxation.seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return relaxation;
}

double log_det_rounding(const ExtendedInformation& information, std::size_t dimension) {
  constexpr double kUnit = std::numeric_limits<double>::epsilon();
  const auto d = static_cast<double>(dimension);
  const auto residual = static_cast<double>(information.residual());
  const auto log_det = static_cast<double>(information.log_det());
  return d * residual / (1.0 - residual) + kUnit * (d + std::abs(log_det));
}

}  // namespace graybox
