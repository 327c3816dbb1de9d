#include "diagnosis/force_balance_data/derivative_noise.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <variant>
#include <vector>

#include "diagnosis/inverse_dynamics/motion_record.hpp"
#include "diagnosis/recordings/preprocess.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kLargestShare = 0.01;  // of the acceleration's variance
constexpr double kHighest = 0.4;        // of the sample rate
constexpr double kStep = 1.25;
constexpr double kFewestWaves = 10.0;
constexpr Index kFewestSamples = 20;
constexpr int kOrder = 4;

VectorXd second_differences(const VectorXd& values, double sample_time) {
  const Index n = values.size() - 2;
  return (values.tail(n) - 2.0 * values.segment(1, n) + values.head(n)) /
         (sample_time * sample_time);
}

double variance(const VectorXd& values) { return (values.array() - values.mean()).square().mean(); }

double noise_variance(const PositionRecord& record) {
  const VectorXd second = second_differences(record.values, 1.0);
  const Index n = second.size() - 1;
  return (second.tail(n) - second.head(n)).squaredNorm() / (20.0 * static_cast<double>(n));
}

// Share of noise in the acceleration, all records together.
double noise_share(std::span<const PositionRecord> records, double frequency) {
  const double wave = 2.0 * std::numbers::pi;
  double of_noise = 0.0, of_all = 0.0;
  for (const PositionRecord& record : records) {
    const auto samples = static_cast<double>(record.values.size());
    const VectorXd smooth =
        zero_phase_low_pass(record.values, frequency * record.sample_time, kOrder);
    of_all += samples * variance(second_differences(smooth, record.sample_time));
    of_noise += samples * 0.4 * noise_variance(record) * record.sample_time * std::pow(wave, 4) *
                std::pow(frequency, 5);
  }
  return of_all > 0.0 ? of_noise / of_all : 0.0;
}

}  // namespace

std::optional<double> low_pass_for_acceleration(std::span<const PositionRecord> records) {
  std::vector<PositionRecord> used;
  double duration = 0.0, sample_time = 0.0;
  for (const PositionRecord& record : records) {
    if (record.values.size() < kFewestSamples) continue;
    used.push_back(record);
    duration = std::max(duration, static_cast<double>(record.values.size()) * record.sample_time);
    sample_time = std::max(sample_time, record.sample_time);
  }
  if (used.empty()) return {};
  const double highest = kHighest / sample_time;
  for (double frequency = highest; frequency * duration >= kFewestWaves; frequency /= kStep) {
    if (noise_share(used, frequency) > kLargestShare) continue;
    return frequency == highest ? std::nullopt : std::optional(frequency);
  }
  return {};
}

std::optional<LowPass> missing_low_pass(const RigidRobotModel& drive, const Campaign& campaign) {
  const bool is_even = campaign.sample_time.has_value() ||
                       std::ranges::any_of(campaign.preprocess, [](const PreprocessStep& step) {
                         return std::holds_alternative<Resample>(step);
                       });
  if (!is_even || !drive.channels.velocity.empty() || drive.channels.position.empty()) return {};
  std::vector<PositionRecord> positions;
  for (const MotionRecord& record : read_motion_records(drive, campaign)) {
    for (const Motion& piece : record.pieces) {
      if (!piece.filters.empty()) return {};
      positions.push_back({piece.position.col(0), piece.sample_time()});
    }
  }
  const std::optional<double> frequency = low_pass_for_acceleration(positions);
  if (!frequency) return {};
  return LowPass{*frequency, kOrder, {}};
}

}  // namespace graybox
