#include "graybox/diagnosis/force_balance/standstill.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace graybox {
namespace {

using Eigen::Index;

constexpr Index kFewestSamples = 20;
constexpr double kSameAngle = 1e-9;  // rad or m

Motion samples_of(const Motion& piece, Index first, Index count) {
  Motion part = piece;
  part.time = piece.time.segment(first, count);
  for (Eigen::MatrixXd Motion::*signal :
       {&Motion::position, &Motion::velocity, &Motion::acceleration, &Motion::torque}) {
    part.*signal = (piece.*signal).middleRows(first, count);
  }
  return part;
}

// Where all joints stand, for long enough.
std::vector<bool> standing(const Motion& piece, const Eigen::VectorXd& speeds) {
  const Index samples = piece.samples();
  std::vector<bool> stands(static_cast<std::size_t>(samples), false);
  for (Index t = 0; t < samples;) {
    const auto is_slow = [&](Index at) {
      return (piece.velocity.row(at).transpose().array().abs() <= kStandingSpeed * speeds.array())
          .all();
    };
    Index end = t;
    while (end < samples && is_slow(end)) ++end;
    if (end > t && piece.time(end - 1) - piece.time(t) >= kStandingTime) {
      std::fill(stands.begin() + t, stands.begin() + end, true);
    }
    t = std::max(end, t + 1);
  }
  return stands;
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

std::vector<Motion> moving_parts(const Motion& piece, const Eigen::VectorXd& speeds) {
  const std::vector<bool> stands = standing(piece, speeds);
  std::vector<Motion> parts;
  const Index samples = piece.samples();
  for (Index t = 0; t < samples;) {
    Index end = t;
    while (end < samples && !stands[static_cast<std::size_t>(end)]) ++end;
    if (end - t == samples) return {piece};
    if (end - t >= kFewestSamples) parts.push_back(samples_of(piece, t, end - t));
    t = std::max(end, t + 1);
  }
  return parts;
}

}  // namespace graybox
