#include "diagnosis/hypotheses/next_experiment.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

#include "problems/base/packed_matrix.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/column_generation/column_generation.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr double kPowerQuantile = 1.2815515655446004;  // of the normal distribution, 90 %
constexpr double kGap = 1e-6;
constexpr double kSmallestShare = 0.01;

// Schur complement of the last diagonal entry; none where the others are singular or any is no
// number.
std::optional<double> distance_in(const MatrixXd& information) {
  const Index n = information.rows() - 1;
  if (!information.allFinite()) return {};
  if (information(n, n) == 0.0) return 0.0;  // both explain the same
  const Eigen::VectorXd scale = information.diagonal().cwiseSqrt();
  if (!(scale.minCoeff() > 0.0)) return {};
  const MatrixXd scaled =
      scale.cwiseInverse().asDiagonal() * information * scale.cwiseInverse().asDiagonal();
  const Eigen::LLT<MatrixXd> factor(scaled.topLeftCorner(n, n));
  if (factor.info() != Eigen::Success) return {};
  const Eigen::VectorXd half = factor.matrixL().solve(scaled.col(n).head(n));
  return std::max(0.0, (scaled(n, n) - half.squaredNorm())) * information(n, n);
}

// Units of the parameters that make the diagonal of M_0 one; s keeps its own.
Eigen::VectorXd parameter_scale(const MatrixXd& information) {
  Eigen::VectorXd scale = information.diagonal().cwiseSqrt();
  scale(scale.size() - 1) = 1.0;
  return scale;
}

// The parameters that the recordings see, and s. What is known has no columns.
std::vector<Index> seen_parameters(const MatrixXd& now) {
  std::vector<Index> seen;
  for (Index p = 0; p + 1 < now.rows(); ++p) {
    if (now(p, p) > 0.0) seen.push_back(p);
  }
  if (!seen.empty()) seen.push_back(now.rows() - 1);
  return seen;
}

}  // namespace

std::optional<RivalExperiments> rival_experiment_set(const MatrixXd& now,
                                                     const std::vector<MatrixXd>& further,
                                                     std::vector<ExperimentOption> options,
                                                     double recordings) {
  const std::vector<Index> seen = seen_parameters(now);
  if (seen.empty() || options.empty()) return {};
  const MatrixXd known = now(seen, seen);
  const std::optional<double> distance_now = distance_in(known);
  if (!distance_now) return {};
  const Eigen::VectorXd scale = parameter_scale(known).cwiseInverse();
  const std::size_t dimension = seen.size(), packed = packed_size(dimension);
  AlignedArray information(options.size() * packed);
  RivalExperiments result{{}, InformationSet(dimension, AlignedArray(packed))};
  for (std::size_t i = 0; i < options.size(); ++i) {
    const MatrixXd then = known + further[i](seen, seen);
    const std::optional<double> distance = distance_in(then);
    if (!distance) return {};
    result.distance_at_best = std::max(result.distance_at_best, *distance);
    const MatrixXd scaled = scale.asDiagonal() * then * scale.asDiagonal();
    pack(scaled.data(), dimension, information.data() + i * packed);
  }
  result.options = std::move(options);
  result.information = InformationSet(dimension, std::move(information), {}, {}, "next experiment");
  result.distance_now = *distance_now;
  result.recordings = recordings;
  return result;
}

double distance_that_excludes(double margin) {
  const double root = kPowerQuantile + std::sqrt(kPowerQuantile * kPowerQuantile + margin);
  return root * root;
}

std::optional<NextExperiment> next_experiment(const RivalExperiments& rivals,
                                              double exclusion_margin, double told_now) {
  const Criterion step = Criterion::ds({rivals.information.dimension() - 1});
  const Solution solution =
      ColumnGeneration().solve(rivals.information, {.duality_gap = kGap, .criterion = step});
  if (solution.status == SolveStatus::kUnsupported) return {};
  const Certificate proof = certify(rivals.information, solution.design, step);
  if (proof.status != CertificateStatus::kCertified) return {};
  NextExperiment next;
  const double share =
      rivals.distance_now > 0.0 ? std::min(1.0, told_now / rivals.distance_now) : 1.0;
  next.duality_gap = std::max(0.0, proof.duality_gap);
  next.distance_now = share * rivals.distance_now;
  next.distance_then = share * std::exp(proof.criterion_value);
  next.recordings = rivals.recordings;
  for (std::size_t i = 0; i < rivals.options.size(); ++i) {
    const double weight = solution.design.weights[i];
    if (weight >= kSmallestShare) next.shares.push_back({rivals.options[i], weight});
  }
  std::ranges::stable_sort(next.shares, std::greater<>(), &NextExperiment::Share::weight);
  const double gain = next.distance_then - next.distance_now;
  next.distance_needed = distance_that_excludes(exclusion_margin);
  const double missing = std::max(0.0, next.distance_needed - next.distance_now);
  next.recordings_needed = gain > 0.0 ? std::ceil(rivals.recordings * missing / gain)
                                      : std::numeric_limits<double>::infinity();
  return next;
}

}  // namespace graybox
