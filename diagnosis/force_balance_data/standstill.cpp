#include "diagnosis/force_balance_data/standstill.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "problems/base/quantile.hpp"

namespace graybox {
namespace {

using Eigen::Index;

constexpr Index kFewestSamples = 20;
constexpr double kSameAngle = 1e-9;  // rad or m
constexpr double kSlope = 3.0;       // samples
constexpr double kFlicker = 6.0;     // standard deviations from end to end
constexpr double kWidestBand = 5.0;  // times the narrowest
constexpr double kMedianOfNormal = 0.6745;

// How far what was held shows among the samples beside it: half a period of the low-pass that the
// force went through, and what a slope reaches.
double reach_of(const Motion& piece) {
  double reach = kSlope * piece.sample_time();
  for (const FilterPass& filter : piece.filters) reach = std::max(reach, 0.5 / filter.frequency);
  return reach;
}

// The noise of the positions, by their third differences, most of which are none of the motion's.
double noise_of(const Motion& piece, Index joint) {
  std::vector<double> differences;
  const auto q = piece.position.col(joint);
  for (Index t = 3; t < piece.samples(); ++t) {
    differences.push_back(std::abs(q(t) - 3.0 * q(t - 1) + 3.0 * q(t - 2) - q(t - 3)));
  }
  if (differences.empty()) return 0.0;
  std::ranges::sort(differences);
  return quantile(differences, 0.5) / (kMedianOfNormal * std::sqrt(20.0));
}

// How far a joint that rests may seem to get, which an encoder rounds.
double band_of(const Motion& piece, Index joint, double speed) {
  const double narrowest = kStandingSpeed * kStandingTime * speed;
  return std::clamp(kFlicker * noise_of(piece, joint), narrowest, kWidestBand * narrowest);
}

}  // namespace

std::vector<bool> idle_joints(std::span<const Motion> pieces,
                              const std::vector<bool>& is_prismatic) {
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  const auto joints = static_cast<Index>(is_prismatic.size());
  Eigen::VectorXd lowest = Eigen::VectorXd::Constant(joints, kInfinite), highest = -lowest;
  for (const Motion& piece : pieces) {
    lowest = lowest.cwiseMin(piece.position.colwise().minCoeff().transpose());
    highest = highest.cwiseMax(piece.position.colwise().maxCoeff().transpose());
  }
  const Eigen::VectorXd range = highest - lowest;
  std::vector<bool> idle;
  for (Index j = 0; j < joints; ++j) {
    double largest = 0.0;
    for (Index k = 0; k < joints; ++k) {
      const bool is_alike =
          is_prismatic[static_cast<std::size_t>(j)] == is_prismatic[static_cast<std::size_t>(k)];
      if (is_alike) largest = std::max(largest, range(k));
    }
    const bool stands_alone = largest <= kSameAngle && range.maxCoeff() > kSameAngle;
    idle.push_back(range(j) < kIdleRange * largest || stands_alone);
  }
  return idle;
}

Eigen::VectorXd root_mean_square_speeds(std::span<const Motion> pieces) {
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(pieces.front().velocity.cols());
  double samples = 0.0;
  for (const Motion& piece : pieces) {
    squares += piece.velocity.colwise().squaredNorm().transpose();
    samples += static_cast<double>(piece.samples());
  }
  return (squares / samples).cwiseSqrt();
}

std::vector<Stay> joint_stays(const Motion& piece, Index joint, double speed) {
  return stays(piece.time, piece.position.col(joint), band_of(piece, joint, speed), kStandingTime);
}

void mark_standstill(Motion& piece, const Eigen::VectorXd& speeds) {
  const Index samples = piece.samples();
  piece.stands.setConstant(samples, speeds.size(), false);
  if (samples < 2) return;
  const double reach = reach_of(piece);
  for (Index j = 0; j < speeds.size(); ++j) {
    for (const Stay& stay : joint_stays(piece, j, speeds(j))) {
      const double from = piece.time(stay.first), to = piece.time(stay.first + stay.count - 1);
      Index first = stay.first, last = stay.first + stay.count - 1;
      while (first > 0 && from - piece.time(first - 1) <= reach) --first;
      while (last + 1 < samples && piece.time(last + 1) - to <= reach) ++last;
      piece.stands.col(j).segment(first, last + 1 - first).setConstant(true);
    }
  }
}

std::vector<Motion> moving_parts(const Motion& piece) {
  std::vector<Motion> parts;
  const Index samples = piece.samples();
  const auto all_stand = [&piece](Index at) { return piece.stands.row(at).all(); };
  for (Index t = 0; t < samples;) {
    Index end = t;
    while (end < samples && !all_stand(end)) ++end;
    if (end - t == samples) return {piece};
    if (end - t >= kFewestSamples) parts.push_back(samples_of(piece, t, end - t));
    t = std::max(end, t + 1);
  }
  return parts;
}

}  // namespace graybox
