#include "diagnosis/design_page/design_facts.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <span>

#include "problems/base/packed_matrix.hpp"
#include "solvers/core/sensitivity.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

MatrixXd unpacked(const std::vector<double>& packed, std::size_t dimension) {
  const auto d = static_cast<Index>(dimension);
  MatrixXd full(d, d);
  unpack(packed.data(), dimension, full.data());
  return full;
}

// M^-1, of M scaled to unit diagonal; empty where M is singular.
MatrixXd inverse_of(const MatrixXd& information) {
  if (!(information.diagonal().array() > 0.0).all()) return {};
  const Eigen::VectorXd scale = information.diagonal().array().rsqrt();
  const MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
  const Eigen::LLT<MatrixXd> factor(scaled);
  if (factor.info() != Eigen::Success) return {};
  const MatrixXd identity = MatrixXd::Identity(information.rows(), information.cols());
  return scale.asDiagonal() * factor.solve(identity) * scale.asDiagonal();
}

// Ds: M^-1 less the inverse of the block of the nuisance parameters, over s.
MatrixXd subset_gradient(const MatrixXd& information, const MatrixXd& inverse,
                         const Criterion& criterion) {
  const auto interest = criterion.interest();
  std::vector<Index> nuisance;
  for (Index k = 0; k < information.rows(); ++k) {
    if (std::ranges::find(interest, static_cast<std::size_t>(k)) == interest.end()) {
      nuisance.push_back(k);
    }
  }
  MatrixXd gradient = inverse;
  if (!nuisance.empty()) {
    const MatrixXd block = inverse_of(information(nuisance, nuisance));
    if (block.size() == 0) return {};
    gradient(nuisance, nuisance) -= block;
  }
  return gradient / static_cast<double>(interest.size());
}

// phi_p: M^(-p-1) / tr M^-p.
MatrixXd power_gradient(const MatrixXd& information, double p) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> spectrum(information);
  // Over the least eigenvalue: large powers overflow.
  const double least = spectrum.eigenvalues()(0);
  const Eigen::ArrayXd ratio = (least / spectrum.eigenvalues().array());
  const double trace = ratio.pow(p).sum();
  const Eigen::VectorXd values = ratio.pow(p + 1.0) / (trace * least);
  return spectrum.eigenvectors() * values.asDiagonal() * spectrum.eigenvectors().transpose();
}

// G over a region, by the weights mu of its points: with W = sum_j mu_j J_j^T J_j / sum_j mu_j,
// t = tr M^-1 W and g = max_j tr J_j M^-1 J_j^T it is g M^-1 W M^-1 / t^2. Empty without weights.
MatrixXd region_gradient(const MatrixXd& inverse, const std::vector<double>& weights,
                         const PredictionRegion& region) {
  if (weights.size() != region.count()) return {};
  const std::span<const double> rows = region.rows();
  const Index d = inverse.rows();
  const Eigen::Map<const MatrixXd> all(rows.data(), d, static_cast<Index>(rows.size()) / d);
  MatrixXd second = MatrixXd::Zero(d, d);
  double largest = 0.0, mass = 0.0;
  Index column = 0;
  for (std::size_t j = 0; j < weights.size(); ++j) {
    const auto width = static_cast<Index>(region.row_counts()[j]);
    const auto point = all.middleCols(column, width);
    column += width;
    largest = std::max(largest, (point.transpose() * inverse * point).trace());
    mass += weights[j];
    second += weights[j] * point * point.transpose();
  }
  const double trace = (inverse * second).trace();
  if (!(mass > 0.0) || !(trace > 0.0)) return {};
  return mass * largest * inverse * second * inverse / (trace * trace);
}

MatrixXd gradient_of(const MatrixXd& information, const Design& design, const Criterion& criterion);

// The sum of those of the parts, by their shares; empty where one has none.
MatrixXd compound_gradient(const MatrixXd& information, const Design& design,
                           const Criterion& criterion) {
  MatrixXd sum = MatrixXd::Zero(information.rows(), information.cols());
  for (const CriterionPart& part : criterion.parts()) {
    const MatrixXd own = gradient_of(information, design, part.criterion);
    if (own.size() == 0) return {};
    sum += part.share * own;
  }
  return sum;
}

// G of certificate.hpp.
MatrixXd gradient_of(const MatrixXd& information, const Design& design,
                     const Criterion& criterion) {
  const auto d = static_cast<std::size_t>(information.rows());
  const MatrixXd inverse = inverse_of(information);
  if (inverse.size() == 0) return {};
  switch (criterion.kind()) {
    case CriterionKind::kD:
      return inverse / static_cast<double>(d);
    case CriterionKind::kA:
      return inverse * inverse / inverse.trace();
    case CriterionKind::kL:
    case CriterionKind::kC:
    case CriterionKind::kI: {
      const auto packed = criterion.weights();
      const MatrixXd weights = unpacked({packed.begin(), packed.end()}, d);
      const MatrixXd product = inverse * weights * inverse;
      return product / (inverse * weights).trace();
    }
    case CriterionKind::kDs:
      return subset_gradient(information, inverse, criterion);
    case CriterionKind::kPhiP:
      return power_gradient(information, criterion.p());
    case CriterionKind::kCompound:
      return compound_gradient(information, design, criterion);
    case CriterionKind::kG:  // over the candidates it is D
      return criterion.is_solved_as_d()
                 ? MatrixXd(inverse / static_cast<double>(d))
                 : region_gradient(inverse, design.dual_weights, criterion.region());
    case CriterionKind::kE:
      break;
  }
  if (design.dual_matrix.empty()) return {};
  const MatrixXd dual = unpacked(design.dual_matrix, d);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> spectrum(information, Eigen::EigenvaluesOnly);
  return dual / (dual.trace() * spectrum.eigenvalues()(0));
}

std::vector<double> traces(const InformationSet& set, const MatrixXd& matrix) {
  std::vector<double> packed(set.packed_size()), out(set.candidate_count());
  const MatrixXd symmetric = 0.5 * (matrix + matrix.transpose());
  pack_trace_dual(symmetric.data(), set.dimension(), packed.data());
  sensitivities(set, packed, out);
  return out;
}

std::string share_text(double efficiency) {
  return efficiency > 0.9999 ? fmt::format("{:.7f} %", 100.0 * efficiency)
                             : fmt::format("{:.3f} %", 100.0 * efficiency);
}

void add_log_det(double log_det, double below, std::vector<DesignFact>& facts) {
  if (!std::isfinite(log_det)) return;
  facts.push_back({"log det M", fmt::format("{:.8g}", log_det),
                   "The larger it is, the smaller is the region in which all parameters together "
                   "are confined."});
  if (!std::isfinite(below)) return;
  facts.push_back({"log det below the best", fmt::format("at most {:.2e}", below),
                   "No design has a log det M that is larger by more than this."});
}

}  // namespace

std::vector<double> criterion_sensitivities(const InformationSet& set, const Design& design,
                                            const Criterion& criterion,
                                            const std::vector<double>& prior) {
  std::vector<double> packed(set.packed_size());
  information_matrix(set, design.weights, packed);
  for (std::size_t k = 0; k < prior.size(); ++k) packed[k] += prior[k];
  const MatrixXd gradient = gradient_of(unpacked(packed, set.dimension()), design, criterion);
  return gradient.size() == 0 ? std::vector<double>() : traces(set, gradient);
}

std::vector<double> robust_sensitivities(const std::vector<const InformationSet*>& samples,
                                         const Design& design, const std::vector<double>& prices) {
  std::vector<double> sum(samples.front()->candidate_count(), 0.0);
  for (std::size_t s = 0; s < samples.size(); ++s) {
    const std::vector<double> own = criterion_sensitivities(*samples[s], design, Criterion());
    if (own.empty()) return {};
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += prices[s] * own[i];
  }
  return sum;
}

std::vector<double> standard_errors(const InformationSet& set, const std::vector<double>& efforts,
                                    const std::vector<double>& prior) {
  std::vector<double> packed(set.packed_size());
  information_matrix(set, efforts, packed);
  for (std::size_t k = 0; k < prior.size(); ++k) packed[k] += prior[k];
  const MatrixXd inverse = inverse_of(unpacked(packed, set.dimension()));
  std::vector<double> errors;
  for (Index k = 0; k < inverse.rows(); ++k) errors.push_back(std::sqrt(inverse(k, k)));
  return errors;
}

std::vector<DesignFact> facts_of(const SolveReport& report) {
  const Certificate& certificate = report.certificate;
  if (certificate.status != CertificateStatus::kCertified) return {};
  const std::string kind(to_string(report.options.criterion.kind()));
  std::vector<DesignFact> facts;
  facts.push_back({kind + "-efficiency", "at least " + share_text(certificate.efficiency),
                   "With the best design there is, this share of the experiments would do the same "
                   "work."});
  facts.push_back(
      {"duality gap", fmt::format("{:.2e}", certificate.duality_gap),
       fmt::format("The most telling candidate exceeds the bound in the picture by this "
                   "share; {:g} was asked, and rounding changes it by at most {:.1e}.",
                   report.options.duality_gap, certificate.rounding_bound)});
  add_log_det(certificate.log_det, certificate.log_det_gap, facts);
  if (report.options.criterion.kind() != CriterionKind::kD) {
    facts.push_back({"criterion " + kind, fmt::format("{:.8g}", certificate.criterion_value),
                     "The value of the criterion that was asked for."});
  }
  return facts;
}

std::vector<DesignFact> facts_of(const ExactReport& report) {
  std::vector<DesignFact> facts;
  facts.push_back({"D-efficiency", "at least " + share_text(report.certificate.proven_efficiency),
                   "The best design of as many experiments would need this share of them for the "
                   "same precision."});
  facts.push_back({"experiments", std::to_string(report.solution.design.experiments()),
                   "So many are run in all, repetitions counted."});
  add_log_det(
      report.certificate.log_det,
      -std::log(report.certificate.proven_efficiency) * static_cast<double>(report.share.dimension),
      facts);
  facts.push_back({"against fractions", share_text(report.share.certificate.efficiency),
                   "At least so efficient is it beside the best design that may run fractions of "
                   "an experiment."});
  return facts;
}

std::vector<DesignFact> facts_of(const ConstrainedExactReport& report) {
  const SolveReport& share = report.share.report;
  std::vector<DesignFact> facts;
  facts.push_back({std::string(to_string(share.options.criterion.kind())) + "-efficiency",
                   "at least " + share_text(report.proven_efficiency),
                   "The best design in whole numbers that obeys the same limits is not better by "
                   "more than this leaves open."});
  facts.push_back({"experiments", fmt::format("{:.0f}", report.share.experiments()),
                   "So many are run in all, repetitions counted."});
  add_log_det(share.certificate.log_det, std::nan(""), facts);
  const std::string kind(to_string(share.options.criterion.kind()));
  if (share.options.criterion.kind() != CriterionKind::kD) {
    facts.push_back({"criterion " + kind, fmt::format("{:.8g}", share.certificate.criterion_value),
                     "The value of the criterion that was asked for."});
  }
  return facts;
}

}  // namespace graybox
