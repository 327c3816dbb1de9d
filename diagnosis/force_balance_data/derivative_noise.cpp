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

constexpr double kLargestShare = 0.01, kSmallShare = 5e-4;  // of the acceleration's variance
constexpr double kHighest = 0.4;        // of the sample rate
constexpr double kStep = 1.25;
constexpr double kFewestWaves = 10.0;
constexpr Index kFewestSamples = 20;
constexpr int kOrder = 4;

VectorXd differences(const VectorXd& values, double sample_time, int derivatives) {
  VectorXd result = values;
  for (int m = 0; m < derivatives; ++m) {
    const Index n = result.size() - 1;
    result = VectorXd((result.tail(n) - result.head(n)) / sample_time);
  }
  return result;
}

double variance(const VectorXd& values) { return (values.array() - values.mean()).square().mean(); }

double noise_variance(const MotionSamples& record) {
  const VectorXd third = differences(record.values, 1.0, 3);
  return third.squaredNorm() / (20.0 * static_cast<double>(third.size()));
}

// Variance of the accelerations under a low-pass, times samples: of all, and of their noise.
struct AccelerationPower {
  double of_all = 0.0, of_noise = 0.0;
  [[nodiscard]] double share() const { return of_all > 0.0 ? of_noise / of_all : 0.0; }
};

AccelerationPower power_below(double frequency, std::span<const MotionSamples> records) {
  const double wave = 2.0 * std::numbers::pi;
  AccelerationPower result;
  for (const MotionSamples& record : records) {
    const auto samples = static_cast<double>(record.values.size());
    const VectorXd smooth =
        zero_phase_low_pass(record.values, frequency * record.sample_time, kOrder);
    result.of_all +=
        samples * variance(differences(smooth, record.sample_time, record.derivatives));
    const double power = 2.0 * record.derivatives;
    result.of_noise += samples * 2.0 / (power + 1.0) * noise_variance(record) *
                       record.sample_time * std::pow(wave, power) *
                       std::pow(frequency, power + 1.0);
  }
  return result;
}

// Whether what the last step of the ladder let through is noise for the most part.
bool adds_noise(const AccelerationPower& above, const AccelerationPower& below) {
  constexpr double kMostly = 0.5;
  return above.of_noise - below.of_noise > kMostly * (above.of_all - below.of_all);
}

}  // namespace

std::optional<double> low_pass_for_acceleration(std::span<const MotionSamples> records) {
  std::vector<MotionSamples> used;
  double duration = 0.0, sample_time = 0.0;
  for (const MotionSamples& record : records) {
    if (record.values.size() < kFewestSamples) continue;
    used.push_back(record);
    duration = std::max(duration, static_cast<double>(record.values.size()) * record.sample_time);
    sample_time = std::max(sample_time, record.sample_time);
  }
  if (used.empty()) return {};
  const double highest = kHighest / sample_time;
  AccelerationPower own = power_below(highest, used);
  if (own.share() <= kLargestShare) return {};
  for (double frequency = highest; frequency * duration >= kFewestWaves; frequency /= kStep) {
    const AccelerationPower below = power_below(frequency / kStep, used);
    const bool is_quiet = own.share() <= kSmallShare;  // smooth motion has no more above
    if (own.share() <= kLargestShare && (is_quiet || !adds_noise(own, below))) return frequency;
    own = below;
  }
  return {};
}

std::optional<LowPass> missing_low_pass(const RigidRobotModel& drive, const Campaign& campaign) {
  const bool is_even = campaign.sample_time.has_value() ||
                       std::ranges::any_of(campaign.preprocess, [](const PreprocessStep& step) {
                         return std::holds_alternative<Resample>(step);
                       });
  const bool has_velocity = !drive.channels.velocity.empty();
  if (!is_even || !drive.channels.acceleration.empty()) return {};
  if (!has_velocity && drive.channels.position.empty()) return {};
  std::vector<MotionSamples> motions;
  for (const MotionRecord& record : read_motion_records(drive, campaign)) {
    for (const Motion& piece : record.pieces) {
      if (!piece.filters.empty()) return {};
      if (has_velocity) {
        motions.push_back({piece.velocity.col(0), piece.sample_time(), 1});
      } else {
        motions.push_back({piece.position.col(0), piece.sample_time(), 2});
      }
    }
  }
  const std::optional<double> frequency = low_pass_for_acceleration(motions);
  if (!frequency) return {};
  return LowPass{*frequency, kOrder, {}};
}

}  // namespace graybox
