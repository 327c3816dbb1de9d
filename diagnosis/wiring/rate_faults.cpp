#include "diagnosis/wiring/rate_faults.hpp"
#include "problems/base/array_index.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <optional>
#include <string>
#include <utility>

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kWindow = 10;  // samples
constexpr Index kFewestWindows = 20;
constexpr double kFollows = 0.9;    // correlation
constexpr double kStranger = 0.5;   // of a rate with its own signal, where it may be another's
constexpr double kOwnFactor = 2.0;  // and its inverse: recorded rates may be filtered

// Changes of each joint's signal, and the integrals of its rate, over windows that do not overlap.
struct Changes {
  MatrixXd of_signal, of_integral;  // windows x joints
};

// `to_recorded`: rows of the joints' signals times it are the recorded ones.
Changes changes_of(std::span<const Motion> pieces, const MatrixXd Motion::*signal,
                   const MatrixXd Motion::*rate, const MatrixXd& to_recorded) {
  Index windows = 0;
  for (const Motion& piece : pieces) windows += std::max<Index>(0, piece.samples() - 1) / kWindow;
  const Index joints = to_recorded.cols();
  Changes changes{MatrixXd(windows, joints), MatrixXd(windows, joints)};
  Index row = 0;
  for (const Motion& piece : pieces) {
    const MatrixXd values = piece.*signal * to_recorded, rates = piece.*rate * to_recorded;
    for (Index first = 0; first + kWindow < piece.samples(); first += kWindow, ++row) {
      const Index last = first + kWindow;
      changes.of_signal.row(row) = values.row(last) - values.row(first);
      changes.of_integral.row(row).setZero();
      for (Index t = first; t < last; ++t) {
        changes.of_integral.row(row) +=
            0.5 * (piece.time(t + 1) - piece.time(t)) * (rates.row(t) + rates.row(t + 1));
      }
    }
  }
  if (row > 0) {  // constant errors of rates are no faults of wires
    changes.of_signal.rowwise() -= changes.of_signal.colwise().mean().eval();
    changes.of_integral.rowwise() -= changes.of_integral.colwise().mean().eval();
  }
  return changes;
}

double cosine(const VectorXd& a, const VectorXd& b) {
  const double size = a.norm() * b.norm();
  return size > 0.0 ? a.dot(b) / size : 0.0;
}

std::string factor_words(const std::string& rate, const std::string& signal, double factor) {
  constexpr double kDegrees = 180.0 / std::numbers::pi, kClose = 0.1;
  const double size = std::abs(factor);
  const bool are_degrees = std::abs(std::abs(std::log(size)) - std::log(kDegrees)) < kClose;
  return fmt::format("{} is {:.3g} times {} rate of {}: {}", rate, size,
                     factor < 0.0 ? "the negative" : "the", signal,
                     are_degrees ? "one of them in degrees?" : "another unit, or a gear ratio?");
}

// What is wrong with the rate of channel j, if anything.
std::optional<ChannelFault> rate_fault(const Changes& changes, Index j,
                                       const std::vector<std::string>& signals,
                                       const std::vector<std::string>& rates) {
  const VectorXd integral = changes.of_integral.col(j), own = changes.of_signal.col(j);
  if (!(own.norm() > 0.0) || !(integral.norm() > 0.0)) return {};  // stands still
  const std::string &rate = rates[at(j)], &signal = signals[at(j)];
  const double follows = cosine(integral, own);
  const auto fault_with = [&](const VectorXd& change, std::string message,
                              std::vector<std::string> channels) {
    const double factor = integral.dot(change) / change.squaredNorm();
    return ChannelFault{
        std::move(channels), std::move(message), (integral - own).norm() / own.norm(),
        (integral / factor - change).norm() / change.norm(), "relative error of the rate"};
  };
  if (std::abs(follows) > kFollows) {
    const double factor = integral.dot(own) / own.squaredNorm(), size = std::abs(factor);
    const bool is_scaled = size < 1.0 / kOwnFactor || size > kOwnFactor;
    if (!is_scaled && factor > 0.0) return {};
    return fault_with(own,
                      is_scaled ? factor_words(rate, signal, factor)
                                : fmt::format("{} or {} has the wrong sign", rate, signal),
                      {rate, signal});
  }
  if (std::abs(follows) > kStranger) return {};
  for (Index other = 0; other < changes.of_signal.cols(); ++other) {
    const VectorXd change = changes.of_signal.col(other);
    if (other == j || std::abs(cosine(integral, change)) <= kFollows) continue;
    const std::string& of = signals[at(other)];
    return fault_with(change,
                      fmt::format("{} is the rate of {} and not of {}: swapped?", rate, of, signal),
                      {rate, signal, of});
  }
  return {};
}

}  // namespace

std::vector<ChannelFault> find_rate_faults(const RigidRobotModel& robot,
                                           std::span<const Motion> pieces) {
  std::vector<ChannelFault> faults;
  const RobotChannels& channels = robot.channels;
  const MatrixXd to_recorded = channels.motor_position
                                   ? MatrixXd(robot.transmission.transpose())
                                   : MatrixXd::Identity(robot.size(), robot.size());
  const auto examine = [&](const MatrixXd Motion::*signal, const MatrixXd Motion::*rate,
                           const std::vector<std::string>& signals,
                           const std::vector<std::string>& rates) {
    if (signals.empty() || rates.empty()) return;  // differentiated
    const Changes changes = changes_of(pieces, signal, rate, to_recorded);
    for (Index j = 0; j < robot.size() && changes.of_signal.rows() >= kFewestWindows; ++j) {
      std::optional<ChannelFault> fault = rate_fault(changes, j, signals, rates);
      if (fault) faults.push_back(*std::move(fault));
    }
  };
  examine(&Motion::position, &Motion::velocity, channels.position, channels.velocity);
  examine(&Motion::velocity, &Motion::acceleration, channels.velocity, channels.acceleration);
  return faults;
}

}  // namespace graybox
