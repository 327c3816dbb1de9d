#include "cli/output/spectrum_tables.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <span>
#include <utility>

#include "cli/process/interrupt.hpp"
#include "problems/mechanisms/frequency_response.hpp"
#include "problems/mechanisms/local_model.hpp"
#include "problems/robot_information/robot_spectrum_information.hpp"
#include "problems/robot_information/stiffness_samples.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/core/sensitivity.hpp"

namespace graybox::cli {
namespace {

std::string key(const BlockDesign& design) {
  return fmt::format("{},{:.6g}", design.name, design.limit);
}

double covariance_of(double log_det, std::size_t dimension) {
  return std::exp(-log_det / static_cast<double>(dimension));
}

// The natural frequency of the robot at a position (motors free) that is nearest to a line, Hz.
class NearestResonance {
 public:
  NearestResonance(const RobotModel& robot, std::span<const double> degrees) {
    LocalModelBuilder builder(robot);
    Eigen::VectorXd angles(static_cast<Eigen::Index>(degrees.size()));
    for (std::size_t j = 0; j < degrees.size(); ++j) {
      angles(static_cast<Eigen::Index>(j)) = degrees[j] * (std::numbers::pi / 180.0);
    }
    frequencies_ = natural_frequencies(builder.build(angles)) / (2.0 * std::numbers::pi);
  }
  [[nodiscard]] double to(double line) const {
    return *std::ranges::min_element(
        frequencies_, {}, [line](double resonance) { return std::abs(resonance - line); });
  }

 private:
  Eigen::VectorXd frequencies_;
};

// The part of a design in the positions that it uses.
struct UsedPositions {
  std::vector<std::size_t> positions;
  std::vector<double> weights;  // of all their lines
};

UsedPositions used_positions(const CandidateBlocks& blocks, const Design& design) {
  const std::vector<double> shares = block_shares(blocks, design.weights);
  UsedPositions used;
  for (std::size_t b = 0; b < shares.size(); ++b) {
    if (shares[b] > 0.0) used.positions.push_back(b);
  }
  for (std::size_t i = 0; i < design.weights.size(); ++i) {
    if (shares[blocks.label[i]] > 0.0) used.weights.push_back(design.weights[i]);
  }
  return used;
}

// Infinite where the design is singular on that robot.
double covariance_on(const RobotModel& robot, const PositionTable& positions,
                     const std::vector<double>& weights, int threads) {
  const InformationSet set = robot_spectrum_set(robot, positions, {.threads = threads});
  std::vector<double> matrix(set.packed_size());
  information_matrix(set, weights, matrix);
  InverseFactor factor;
  if (!invert(matrix, set.dimension(), factor)) return std::numeric_limits<double>::infinity();
  return covariance_of(factor.log_det, set.dimension());
}

}  // namespace

ComparedDesign compared(const InformationSet& set, const CandidateBlocks& blocks,
                        BlockDesign design) {
  ComparedDesign row;
  row.of = std::move(design);
  const Certificate certificate = certify(set, row.of.design);
  row.log_det = certificate.log_det;
  row.covariance = covariance_of(certificate.log_det, set.dimension());
  row.joint_gap = certificate.duality_gap;
  row.lines = certificate.support_size;
  for (const double share : block_shares(blocks, row.of.design.weights)) {
    row.positions += share > 0.0 ? 1U : 0U;
  }
  return row;
}

std::string describe(const BlockDesign& design) {
  if (design.name == "flat") return "flat spectrum, best positions";
  if (design.name == "blocks_first") return "positions of the flat one, then spectra";
  if (design.name == "two_step") return "spectrum of each position, then positions";
  if (design.limit >= 1.0) return "joint";
  return fmt::format("joint, at most {:.4g} % a position", 100.0 * design.limit);
}

std::string comparison_csv(const std::vector<ComparedDesign>& designs) {
  std::string text =
      "design,position_limit,covariance,over_first,log_det,own_gap,joint_gap,positions,lines,"
      "passes,seconds,status\n";
  for (const ComparedDesign& row : designs) {
    text += fmt::format("{},{:.10g},{:.6g},{:.12g},{:.3g},{:.6g},{},{},{:.4g},{:.4g},{}\n",
                        key(row.of), row.covariance, row.covariance / designs.front().covariance,
                        row.log_det, row.of.own_gap, row.joint_gap, row.positions, row.lines,
                        row.of.counters.passes, row.of.counters.seconds, to_string(row.of.status));
  }
  return text;
}

std::string comparison_text(const std::vector<ComparedDesign>& designs) {
  std::string text =
      fmt::format("  {:<42} {:>11} {:>10} {:>9} {:>9} {:>6} {:>7}\n", "design", "covariance",
                  "over first", "own gap", "positions", "lines", "passes");
  for (const ComparedDesign& row : designs) {
    text +=
        fmt::format("  {:<42} {:>11.5g} {:>10.4g} {:>9.1e} {:>9} {:>6} {:>7.1f}\n",
                    describe(row.of), row.covariance, row.covariance / designs.front().covariance,
                    row.of.own_gap, row.positions, row.lines, row.of.counters.passes);
  }
  return text;
}

nlohmann::ordered_json comparison_json(const std::vector<ComparedDesign>& designs) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const ComparedDesign& row : designs) {
    list.push_back({{"design", row.of.name},
                    {"position_limit", row.of.limit},
                    {"covariance", row.covariance},
                    {"log_det", row.log_det},
                    {"own_gap", row.of.own_gap},
                    {"joint_gap", row.joint_gap},
                    {"positions", row.positions},
                    {"lines", row.lines},
                    {"passes", row.of.counters.passes},
                    {"seconds", row.of.counters.seconds},
                    {"status", to_string(row.of.status)}});
  }
  return list;
}

std::string spectra_csv(const RobotModel& robot, const InformationSet& set,
                        const CandidateBlocks& blocks, const std::vector<ComparedDesign>& designs) {
  std::string text = "design,position_limit,position";
  for (std::size_t k = 0; k + 2 < set.candidates().names.size(); ++k) {
    text += "," + set.candidates().names[k];
  }
  text += ",share,frequency,axis,power,weight,resonance\n";
  for (const ComparedDesign& row : designs) {
    if (row.of.name == "flat") continue;
    const std::vector<double>& weights = row.of.design.weights;
    const std::vector<double> shares = block_shares(blocks, weights);
    std::size_t last_block = blocks.count;
    std::optional<NearestResonance> nearest;
    for (std::size_t i = 0; i < weights.size(); ++i) {
      if (weights[i] == 0.0) continue;
      const auto coordinates = set.coordinates(i);
      const auto angles = coordinates.first(coordinates.size() - 2);
      const double frequency = coordinates[angles.size()];
      const std::size_t block = blocks.label[i];
      if (std::exchange(last_block, block) != block) nearest.emplace(robot, angles);
      text += fmt::format("{},{}", key(row.of), block);
      for (const double angle : angles) text += fmt::format(",{:.10g}", angle);
      text += fmt::format(",{:.8g},{:.8g},{:.0f},{:.8g},{:.8g},{:.8g}\n", shares[block], frequency,
                          coordinates.back(), flat_power(robot) * weights[i] / shares[block],
                          weights[i], nearest->to(frequency));
    }
  }
  return text;
}

std::string robustness_csv(const RobotModel& robot, const PositionTable& positions,
                           const CandidateBlocks& blocks,
                           const std::vector<ComparedDesign>& designs, std::size_t samples,
                           int threads) {
  std::string text =
      "design,position_limit,deviation,samples,covariance_median,covariance_90,covariance_worst\n";
  for (const ComparedDesign& row : designs) {
    const UsedPositions used = used_positions(blocks, row.of.design);
    const PositionTable chosen = positions.subset(used.positions);
    for (const double deviation : {0.0, 0.01, 0.03, 0.1, 0.3, 0.5}) {
      // Without deviation all draws are the robot itself.
      const auto factors =
          random_stiffness({.uncertainty = deviation, .seed = 1}, deviation == 0.0 ? 1 : samples,
                           robot.parameters.size());
      std::vector<double> covariance;
      for (const Eigen::VectorXd& theta : factors) {
        if (interrupted()) return text;
        covariance.push_back(
            covariance_on(with_stiffness_factors(robot, theta), chosen, used.weights, threads));
      }
      std::ranges::sort(covariance);
      text += fmt::format("{},{:g},{},{:.6g},{:.6g},{:.6g}\n", key(row.of), deviation,
                          covariance.size(), covariance[covariance.size() / 2],
                          covariance[(covariance.size() * 9 - 1) / 10], covariance.back());
    }
  }
  return text;
}

}  // namespace graybox::cli
