#include "diagnosis/wiring/gravity_fault.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "diagnosis/wiring/wired_balance.hpp"
#include "problems/laws/law_catalogue.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

constexpr double kLength = 9.81;                         // m/s^2
constexpr Index kSamples = 600;                          // while a direction is looked for
constexpr double kTouched = 0.2;                         // of a joint's error, that changes
constexpr double kSettled = 0.5, kLargestSettled = 0.8;  // of the error, and of a unit force
constexpr double kOfSprings = 0.8;                       // of the squares that springs would take
constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kFirstStep = 20.0 * kDegree, kLastStep = 1.0 * kDegree;
constexpr double kOther = 60.0 * kDegree;  // from the stated direction

// The relative error of each joint.
Eigen::VectorXd balance_errors(RigidRobotModel robot, const Vector3d& gravity,
                               std::span<const Motion> pieces) {
  robot.gravity = gravity;
  return WiredBalance(robot, pieces, WiredBalance::Gains::kPositive)
      .fit(Wiring(robot.size()))
      .error;
}

std::vector<Vector3d> directions_of_a_cube() {
  std::vector<Vector3d> result;
  for (int x = -1; x <= 1; ++x) {
    for (int y = -1; y <= 1; ++y) {
      for (int z = -1; z <= 1; ++z) {
        if (x != 0 || y != 0 || z != 0) result.push_back(Vector3d(x, y, z).normalized());
      }
    }
  }
  return result;
}

// Looks around the best direction so far, by smaller and smaller steps.
class DirectionSearch {
 public:
  DirectionSearch(const RigidRobotModel& robot, std::vector<Motion> pieces,
                  const std::function<bool()>& keep_going)
      : robot_(robot), pieces_(std::move(pieces)), keep_going_(keep_going) {}

  // None: it was stopped.
  [[nodiscard]] std::optional<Vector3d> best() {
    for (const Vector3d& direction : directions_of_a_cube()) {
      if (!goes_on()) return {};
      take_if_better(direction);
    }
    for (double step = kFirstStep; step >= kLastStep;) {
      if (!goes_on()) return {};
      if (!step_around(step)) step /= 2.0;
    }
    return plainest();
  }

 private:
  [[nodiscard]] double error_along(const Vector3d& direction) const {
    return balance_errors(robot_, kLength * direction, pieces_).sum();
  }

  // Robots stand, hang, or are on a wall: along an axis of the base where that does about as well.
  [[nodiscard]] Vector3d plainest() const {
    constexpr double kAsWell = 1.15;
    Vector3d plainest = best_;
    double least = kAsWell * error_;
    for (Index axis = 0; axis < 3; ++axis) {
      for (const double sign : {-1.0, 1.0}) {
        const Vector3d direction = sign * Vector3d::Unit(axis);
        const double error = error_along(direction);
        if (error > least) continue;
        least = error;
        plainest = direction;
      }
    }
    return plainest;
  }

  [[nodiscard]] bool goes_on() const { return !keep_going_ || keep_going_(); }

  bool take_if_better(const Vector3d& direction) {
    const double error = error_along(direction);
    if (!(error < error_)) return false;
    error_ = error;
    best_ = direction;
    return true;
  }

  bool step_around(double step) {
    const Vector3d centre = best_, across = centre.unitOrthogonal();
    bool is_better = false;
    for (int quarter = 0; quarter < 4; ++quarter) {
      const Vector3d axis = Eigen::AngleAxisd(0.5 * std::numbers::pi * quarter, centre) * across;
      is_better = take_if_better(Eigen::AngleAxisd(step, axis) * centre) || is_better;
    }
    return is_better;
  }

  const RigidRobotModel& robot_;
  std::vector<Motion> pieces_;
  const std::function<bool()>& keep_going_;
  Vector3d best_ = -Vector3d::UnitZ();
  double error_ = HUGE_VAL;
};

// With a spring, straight and cubic, at each joint, which together stand for any weight in a small
// motion.
RigidRobotModel with_springs(RigidRobotModel robot) {
  for (Index j = 0; j < robot.size(); ++j) {
    for (const char* law : {"stiffness", "cubic_spring"}) {
      Element spring;
      spring.name = fmt::format("{} of joint {}", law, j);
      spring.location.input = spring.location.output = Eigen::VectorXd::Unit(robot.size(), j);
      spring.location.channel = j;
      spring.law_name = law;
      spring.parameters = {1.0};
      spring.fixed = {false};
      spring.law = find_law(law, false)->make(spring.parameters);
      robot.elements.push_back(std::move(spring));
    }
  }
  return robot;
}

double angle_between(const Vector3d& a, const Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

// By the joints whose error changes: friction is all that others feel.
bool settles(const Eigen::VectorXd& before, const Eigen::VectorXd& after,
             const Eigen::VectorXd& by_springs) {
  double sum_before = 0.0, sum_after = 0.0, taken = 0.0, by_all = 0.0, touched = 0.0;
  for (Index j = 0; j < before.size(); ++j) {
    if (std::abs(after(j) - before(j)) < kTouched * before(j)) continue;
    touched += 1.0;
    sum_before += before(j);
    sum_after += after(j);
    taken += before(j) * before(j) - after(j) * after(j);
    by_all += before(j) * before(j) - by_springs(j) * by_springs(j);
  }
  return touched > 0.0 && sum_after <= kSettled * sum_before &&
         sum_after <= kLargestSettled * touched && taken >= kOfSprings * by_all;
}

}  // namespace

std::optional<GravityFault> find_gravity_fault(const RigidRobotModel& robot,
                                               std::span<const Motion> pieces,
                                               const std::function<bool()>& keep_going) {
  const std::optional<Vector3d> best =
      DirectionSearch(robot, thinned(pieces, kSamples), keep_going).best();
  if (!best) return {};
  GravityFault fault{.gravity = kLength * *best};
  if (robot.gravity.norm() > 0.0 && angle_between(robot.gravity, *best) < kOther) return {};
  const Eigen::VectorXd before = balance_errors(robot, robot.gravity, pieces),
                        after = balance_errors(robot, fault.gravity, pieces);
  fault.error_before = before.sum();
  fault.error_after = after.sum();
  const Eigen::VectorXd by_springs = balance_errors(with_springs(robot), robot.gravity, pieces);
  return settles(before, after, by_springs) ? std::optional(fault) : std::nullopt;
}

}  // namespace graybox
