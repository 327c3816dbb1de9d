#include "solvers/discrimination/discrimination_problem.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "problems/base/aligned_array.hpp"
#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "solvers/certificates/certificate.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr double kNoMisfit = 1e-10;  // of y, what is left of it by rounding

void require_alike(const Jacobians& truth, const Jacobians& rival) {
  if (truth.candidates == rival.candidates && truth.outputs == rival.outputs) return;
  throw InputError(fmt::format("{}: {} candidates with {} outputs, but {} has {} with {}",
                               rival.source, rival.candidates, rival.outputs, truth.source,
                               truth.candidates, truth.outputs));
}

// The columns J, and y - o beside them.
Jacobians with_misfit(const Jacobians& truth, const Jacobians& rival) {
  const auto named = std::ranges::find(rival.names, "prediction");
  const auto offset = static_cast<std::size_t>(named - rival.names.begin());
  const bool has_offset = named != rival.names.end();
  Jacobians out = rival;
  out.values.clear();
  out.names.clear();
  out.parameters = rival.parameters - (has_offset ? 1 : 0) + 1;
  for (std::size_t row = 0; row < rival.candidates * rival.outputs; ++row) {
    double rest = truth.values[row];
    for (std::size_t k = 0; k < rival.parameters; ++k) {
      const double entry = rival.values[row * rival.parameters + k];
      if (has_offset && k == offset) {
        rest -= entry;
      } else {
        out.values.push_back(entry);
      }
    }
    out.values.push_back(rest);
  }
  for (std::size_t k = 0; k < rival.parameters; ++k) {
    if (has_offset && k == offset) continue;
    out.names.push_back(rival.names.empty() ? fmt::format("{}", k) : rival.names[k]);
  }
  out.names.emplace_back("misfit");
  return out;
}

// The rival is regular, and leaves something of y.
void require_distinct(const Jacobians& joined) {
  const auto rows = static_cast<Index>(joined.candidates * joined.outputs);
  const auto columns = static_cast<Index>(joined.parameters);
  RowMajor all = Eigen::Map<const RowMajor>(joined.values.data(), rows, columns);
  for (Index k = 0; k < columns; ++k) {
    const double length = all.col(k).norm();
    if (length > 0.0) all.col(k) /= length;
  }
  const Eigen::VectorXd y = all.col(columns - 1);
  Eigen::VectorXd rest = y;
  if (columns > 1) {
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(all.leftCols(columns - 1));
    if (qr.rank() < columns - 1) {
      throw InputError(fmt::format(
          "{}: its {} parameters can't be estimated from all candidates together; leave out those "
          "that say the same",
          joined.source, columns - 1));
    }
    rest -= all.leftCols(columns - 1) * qr.solve(y);
  }
  if (!(rest.norm() > kNoMisfit * y.norm())) {
    throw InputError(
        fmt::format("{}: it can predict all that the first model does: no experiment tells them "
                    "apart",
                    joined.source));
  }
}

void add_block(const InformationSet& block, std::size_t first, std::size_t dimension,
               AlignedArray& matrices) {
  for (std::size_t i = 0; i < block.candidate_count(); ++i) {
    const auto h = block.information(i);
    double* out = matrices.data() + i * packed_size(dimension);
    for (std::size_t a = 0, k = 0; a < block.dimension(); ++a) {
      for (std::size_t b = 0; b <= a; ++b, ++k) out[packed_index(first + a, first + b)] = h[k];
    }
  }
}

std::string name_of(const Jacobians& rival) {
  return std::filesystem::path(rival.source).stem().string();
}

}  // namespace

Criterion DiscriminationProblem::criterion(std::span<const double> scales) const {
  if (misfit.size() == 1) return criterion_of(0);
  const std::size_t d = set.dimension();
  std::vector<double> rows(misfit.size() * d, 0.0);
  for (std::size_t k = 0; k < misfit.size(); ++k) {
    rows[k * d + misfit[k]] = scales.empty() ? 1.0 : std::sqrt(scales[k]);
  }
  return Criterion::g(PredictionRegion::of_regressors(d, std::move(rows)));
}

Criterion DiscriminationProblem::criterion_of(std::size_t rival) const {
  return Criterion::ds({misfit[rival]});
}

DiscriminationProblem discrimination_problem(const Jacobians& truth,
                                             std::span<const Jacobians> rivals,
                                             const JacobianNoise& noise,
                                             CandidateTable candidates) {
  if (truth.parameters != 1) {
    throw InputError(fmt::format("{}: {} columns; the predictions of the first model are one",
                                 truth.source, truth.parameters));
  }
  if (rivals.empty()) throw InputError("there is no rival model");
  std::vector<InformationSet> blocks;
  std::vector<std::string> names, parameters;
  std::vector<std::size_t> misfit;
  for (const Jacobians& rival : rivals) {
    require_alike(truth, rival);
    Jacobians joined = with_misfit(truth, rival);
    require_distinct(joined);
    names.push_back(name_of(rival));
    for (const std::string& each : joined.names) {
      parameters.push_back(fmt::format("{}.{}", names.back(), each));
    }
    misfit.push_back(parameters.size() - 1);
    blocks.push_back(information_set_from_jacobians(std::move(joined), noise));
  }
  const std::size_t d = parameters.size();
  AlignedArray matrices(truth.candidates * packed_size(d));
  std::fill_n(matrices.data(), truth.candidates * packed_size(d), 0.0);
  std::size_t first = 0;
  for (const InformationSet& block : blocks) {
    add_block(block, first, d, matrices);
    first += block.dimension();
  }
  InformationSet set(d, std::move(matrices), std::move(candidates), std::move(parameters));
  set.validate();
  return {.set = std::move(set), .rivals = std::move(names), .misfit = std::move(misfit)};
}

std::vector<double> misfits(const DiscriminationProblem& problem, const Design& design) {
  std::vector<double> all;
  for (std::size_t k = 0; k < problem.rivals.size(); ++k) {
    const Certificate proof = certify(problem.set, design, problem.criterion_of(k));
    all.push_back(proof.status == CertificateStatus::kCertified ? std::exp(proof.criterion_value)
                                                                : 0.0);
  }
  return all;
}

}  // namespace graybox
