#include "diagnosis/wiring/wrap_faults.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>

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

// Samples that a jump takes after the filters.
Index samples_of_jump(const Motion& piece) {
  if (piece.filters.empty() || piece.samples() < 2) return 1;
  double lowest = piece.filters.front().frequency;
  for (const FilterPass& filter : piece.filters) lowest = std::min(lowest, filter.frequency);
  const Index last = piece.samples() - 1;
  const double sample = (piece.time(last) - piece.time(0)) / static_cast<double>(last);
  return 1 + static_cast<Index>(std::ceil(kStepResponse / (lowest * sample)));
}

struct Jumps {
  double least = 0.0, most = 0.0;  // sizes
  double smooth = 0.0;             // largest change beside jumps
  double path = 0.0;               // of the motion beside jumps
  int count = 0;

  void add(double size) {
    least = count == 0 ? size : std::min(least, size);
    most = std::max(most, size);
    ++count;
  }
};

void add_jumps(const VectorXd& signal, Index window, double range, Jumps& jumps) {
  const Index count = signal.size() - window;
  if (count < 1) return;
  const VectorXd changes = (signal.tail(count) - signal.head(count)).cwiseAbs();
  for (Index t = 0; t < count; ++t) {
    if (changes(t) > kJump * range) {
      double size = 0.0;
      for (; t < count && changes(t) > kJump * range; ++t) size = std::max(size, changes(t));
      jumps.add(size);
      t += window - 1;  // ramps down
      continue;
    }
    const Index next = std::min(count - t, window + 1);
    const bool leads_to_jump = changes.segment(t, next).maxCoeff() > kJump * range;
    if (leads_to_jump) continue;
    jumps.smooth = std::max(jumps.smooth, changes(t));
    jumps.path += std::abs(signal(t + 1) - signal(t));
  }
}

std::optional<ChannelFault> wrap_of(std::span<const Motion> pieces, const MatrixXd Motion::*signal,
                                    const VectorXd& to_recorded, const std::string& channel,
                                    const std::string& unit) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const Motion& piece : pieces) {
    const VectorXd values = piece.*signal * to_recorded;
    low = std::min(low, values.minCoeff());
    high = std::max(high, values.maxCoeff());
  }
  const double range = high - low;
  Jumps jumps;
  for (const Motion& piece : pieces) {
    add_jumps(piece.*signal * to_recorded, samples_of_jump(piece), range, jumps);
  }
  if (jumps.count == 0 || jumps.smooth > kSmooth * range || jumps.path < kPath * range ||
      jumps.most - jumps.least > kSameSize * jumps.most) {
    return {};
  }
  return ChannelFault{
      {channel},
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
    std::optional<ChannelFault> fault =
        wrap_of(pieces, &Motion::position, to_recorded.col(static_cast<Index>(j)),
                channels.position[j], robot.joints[j].is_prismatic ? "m" : "rad");
    if (fault) faults.push_back(*std::move(fault));
  }
  return faults;
}

bool have_blows(const RigidRobotModel& robot, std::span<const Motion> pieces) {
  const std::vector<std::string>& names = robot.channels.velocity;
  for (std::size_t j = 0; j < names.size(); ++j) {
    const VectorXd alone = VectorXd::Unit(robot.size(), static_cast<Index>(j));
    if (wrap_of(pieces, &Motion::velocity, alone, names[j], "")) return true;
  }
  return false;
}

}  // namespace graybox
