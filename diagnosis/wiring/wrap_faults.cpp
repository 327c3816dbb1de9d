#include "diagnosis/wiring/wrap_faults.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kJump = 0.5;       // of the range
constexpr double kSmooth = 0.2;     // of the range
constexpr double kSameSize = 0.15;  // relative
constexpr double kPath = 0.5;       // of the range: one count to and fro at standstill is no wrap
constexpr double kStepResponse = 0.8;  // of a filter: times its inverse cut-off
constexpr double kSlope = 1.4;  // of a filtered jump: times its size and cut-off; 1.7 at least
constexpr double kWhole = 0.8;  // of the range: from one end to the other
constexpr double kMoves = 0.2;  // of the range: the motion beside jumps

// What the filters make of a jump.
struct Ramp {
  Index samples = 1;
  double slope = 0.0;  // the steepest change from sample to sample at least, over the jump
};

Ramp ramp_of_jump(const Motion& piece) {
  if (piece.filters.empty() || piece.samples() < 2) return {};
  const double lowest = std::ranges::min(piece.filters, {}, &FilterPass::frequency).frequency;
  const double cut_off = lowest * piece.sample_time();  // periods a sample
  return {1 + static_cast<Index>(std::ceil(kStepResponse / cut_off)), kSlope * cut_off};
}

struct Jumps {
  double least = 0.0, most = 0.0;  // sizes
  double smooth = 0.0;             // largest change beside jumps
  double path = 0.0;               // of the motion beside jumps
  double reach = 0.0;              // of that motion, from end to end
  int count = 0;
  bool are_steep = true;

  void add(double size) {
    least = count == 0 ? size : std::min(least, size);
    most = std::max(most, size);
    ++count;
  }
  // Whether they are steps of one size in a signal that is smooth beside them.
  [[nodiscard]] bool stand_out(double range) const {
    return count > 0 && smooth <= kSmooth * range && path >= kPath * range &&
           most - least <= kSameSize * most;
  }
  [[nodiscard]] bool are_wraps(double range) const {
    return stand_out(range) && are_steep && least >= kWhole * range && reach >= kMoves * range;
  }
};

void add_jumps(const VectorXd& signal, const Ramp& ramp, double range, Jumps& jumps) {
  const Index window = ramp.samples, count = signal.size() - window;
  if (count < 1) return;
  const VectorXd changes = (signal.tail(count) - signal.head(count)).cwiseAbs();
  double mended = 0.0, lowest = 0.0, highest = 0.0;
  for (Index t = 0; t < count; ++t) {
    if (changes(t) > kJump * range) {
      double size = 0.0;
      const Index first = t;
      for (; t < count && changes(t) > kJump * range; ++t) size = std::max(size, changes(t));
      const Index taken = t - 1 + window - first;  // samples
      const VectorXd steps = signal.segment(first + 1, taken) - signal.segment(first, taken);
      jumps.are_steep = jumps.are_steep && steps.cwiseAbs().maxCoeff() >= ramp.slope * size;
      jumps.add(size);
      t += window - 1;  // ramps down
      continue;
    }
    const Index next = std::min(count - t, window + 1);
    const bool leads_to_jump = changes.segment(t, next).maxCoeff() > kJump * range;
    if (leads_to_jump) continue;
    jumps.smooth = std::max(jumps.smooth, changes(t));
    const double step = signal(t + 1) - signal(t);
    jumps.path += std::abs(step);
    mended += step;
    lowest = std::min(lowest, mended);
    highest = std::max(highest, mended);
  }
  jumps.reach = std::max(jumps.reach, highest - lowest);
}

// The jumps of a signal of all joints, times `to_recorded`, and its range.
std::pair<Jumps, double> jumps_of(std::span<const Motion> pieces, const MatrixXd Motion::*signal,
                                  const VectorXd& to_recorded) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const Motion& piece : pieces) {
    const VectorXd values = piece.*signal * to_recorded;
    low = std::min(low, values.minCoeff());
    high = std::max(high, values.maxCoeff());
  }
  const double range = high - low;
  Jumps jumps;
  for (const Motion& piece : pieces) {
    add_jumps(piece.*signal * to_recorded, ramp_of_jump(piece), range, jumps);
  }
  return {jumps, range};
}

ChannelFault wrap_fault(const Jumps& jumps, double range, const std::string& channel,
                        const std::string& unit) {
  return {{channel},
          fmt::format("{} jumps {} by {:.3g} {}, its whole range: a counter that wraps "
                      "or is reset?",
                      channel, jumps.count == 1 ? "once" : fmt::format("{} times", jumps.count),
                      jumps.most, unit),
          jumps.most / range,
          jumps.smooth / range,
          "largest change between samples over the range"};
}

}  // namespace

std::vector<ChannelFault> find_wraps(const RigidRobotModel& robot, std::span<const Motion> pieces) {
  std::vector<ChannelFault> faults;
  const RobotChannels& channels = robot.channels;
  const MatrixXd to_recorded = channels.motor_position
                                   ? MatrixXd(robot.transmission.transpose())
                                   : MatrixXd::Identity(robot.size(), robot.size());
  for (std::size_t j = 0; j < channels.position.size(); ++j) {
    const auto [jumps, range] =
        jumps_of(pieces, &Motion::position, to_recorded.col(static_cast<Index>(j)));
    if (!jumps.are_wraps(range)) continue;
    faults.push_back(
        wrap_fault(jumps, range, channels.position[j], robot.joints[j].is_prismatic ? "m" : "rad"));
  }
  return faults;
}

bool have_blows(const RigidRobotModel& robot, std::span<const Motion> pieces) {
  const std::vector<std::string>& names = robot.channels.velocity;
  for (std::size_t j = 0; j < names.size(); ++j) {
    const VectorXd alone = VectorXd::Unit(robot.size(), static_cast<Index>(j));
    const auto [jumps, range] = jumps_of(pieces, &Motion::velocity, alone);
    if (jumps.stand_out(range)) return true;
  }
  return false;
}

}  // namespace graybox
