#include "diagnosis/signals/drive_lateness.hpp"

#include <Eigen/Cholesky>
#include <array>
#include <cmath>
#include <vector>

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr Index kShiftsOfSpan = 10;  // each way, in spans
constexpr Index kFewestOfSpan = 60;  // samples of a log, in spans
constexpr double kFollows = 0.2;     // of the squared changes of speed may be left
constexpr double kClearly = 0.3;     // of what is left without a shift
constexpr double kStill = 1e-3;      // of the fastest motion

// Means over `span` samples from each on.
VectorXd block_means(const VectorXd& signal, Index span) {
  VectorXd means(signal.size() - span + 1);
  double sum = signal.head(span).sum();
  means(0) = sum / static_cast<double>(span);
  for (Index i = 1; i < means.size(); ++i) {
    sum += signal(i + span - 1) - signal(i - 1);
    means(i) = sum / static_cast<double>(span);
  }
  return means;
}

struct Blocks {
  VectorXd speed, force;  // of equal length
};

Blocks blocks_of(const LoggedDrive& log, Index span) {
  Blocks blocks;
  blocks.force = block_means(log.force, span);
  if (log.is_velocity) {
    blocks.speed = block_means(log.motion, span);
  } else {
    const Index n = log.motion.size() - span;
    blocks.speed = (log.motion.tail(n) - log.motion.head(n)) / static_cast<double>(span);
  }
  const Index common = std::min(blocks.speed.size(), blocks.force.size());
  blocks.speed.conservativeResize(common);
  blocks.force.conservativeResize(common);
  return blocks;
}

// Normal equations of the speed a span later, and the squared changes of speed.
struct Regression {
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  double squares = 0.0, changes = 0.0;

  void add(const Blocks& blocks, Index span, Index shift) {
    const Index margin = kShiftsOfSpan * span;
    const double still = kStill * blocks.speed.cwiseAbs().maxCoeff();
    for (Index i = margin; i + span + margin < blocks.speed.size(); ++i) {
      const double now = blocks.speed(i), next = blocks.speed(i + span);
      const double direction = std::abs(now) > still ? std::copysign(1.0, now) : 0.0;
      const Eigen::Vector4d row(now, blocks.force(i + span / 2 + shift), direction, 1.0);
      if (!row.allFinite() || !std::isfinite(next)) continue;
      normal.noalias() += row * row.transpose();
      right += next * row;
      squares += next * next;
      changes += (next - now) * (next - now);
    }
  }
  [[nodiscard]] double left() const {
    const Eigen::Vector4d scale = normal.diagonal().cwiseSqrt().cwiseMax(1e-300);
    Eigen::Matrix4d scaled = scale.cwiseInverse().asDiagonal() * normal;
    scaled *= scale.cwiseInverse().asDiagonal();
    scaled.diagonal().array() += 1e-12;  // a column may be zero, or equal another
    const Eigen::Vector4d aim = right.cwiseQuotient(scale);
    return std::max(0.0, squares - aim.dot(scaled.ldlt().solve(aim)));
  }
};

struct BestShift {
  Index shift = 0;
  double left = 0.0, without = 0.0, changes = 0.0;  // sums of squares
};

BestShift best_shift(std::span<const LoggedDrive> logs, Index span) {
  std::vector<Blocks> all;
  for (const LoggedDrive& log : logs) {
    if (log.motion.size() >= kFewestOfSpan * span) all.push_back(blocks_of(log, span));
  }
  BestShift best;
  const auto asked = [&](Index shift) {
    Regression regression;
    for (const Blocks& blocks : all) regression.add(blocks, span, shift);
    best.changes = regression.changes;
    return regression.left();
  };
  best.left = best.without = asked(0);
  for (Index shift = -kShiftsOfSpan * span; shift <= kShiftsOfSpan * span; ++shift) {
    const double left = asked(shift);
    if (!(left < best.left)) continue;
    best.left = left;
    best.shift = shift;
  }
  return best;
}

}  // namespace

std::optional<Index> drive_lateness(std::span<const LoggedDrive> logs) {
  for (const Index span : {2, 4, 8}) {
    const BestShift best = best_shift(logs, span);
    if (!(best.changes > 0.0) || best.left > kFollows * best.changes) continue;
    const bool is_inside = best.shift < kShiftsOfSpan * span;
    const bool is_late = best.shift > span / 4 && best.left < kClearly * best.without;
    return is_inside && is_late ? std::optional<Index>(best.shift) : std::nullopt;
  }
  return {};
}

}  // namespace graybox
