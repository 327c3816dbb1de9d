#include "diagnosis/wiring/wiring_faults.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <numbers>
#include <optional>
#include <string>
#include <utility>

#include "diagnosis/wiring/gravity_fault.hpp"
#include "diagnosis/wiring/rate_faults.hpp"
#include "diagnosis/wiring/wired_balance.hpp"
#include "diagnosis/wiring/wrap_faults.hpp"
#include "problems/base/array_index.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kSuspicious = 0.1;     // relative error
constexpr double kSettled = 0.6;        // of that
constexpr double kSettledBoth = 0.4;    // forces and motions exchanged: as masses that are unknown
constexpr double kSettledMotion = 0.4;  // a motion turned: short logs of few poses allow either
constexpr double kLargestSettled = 0.6;
constexpr double kAlike = 1.25;        // ratio of errors: either fault may be the one
constexpr double kErrors = 3.0;        // that what can't be negative is below zero
constexpr double kSmallestGain = 0.8;  // of the error, by the other sign
constexpr double kSmallestFactor = 3.0;
constexpr int kMostFaults = 4;

// On a way that has no back a load does what friction of the other sign would.
bool goes_both_ways(std::span<const Motion> pieces, Index motion) {
  constexpr double kBack = 0.02;  // of the velocity's squares
  double forwards = 0.0, backwards = 0.0;
  for (const Motion& piece : pieces) {
    const Eigen::ArrayXd velocity = piece.velocity.col(motion).array();
    forwards += velocity.max(0.0).square().sum();
    backwards += velocity.min(0.0).square().sum();
  }
  return std::min(forwards, backwards) >= kBack * (forwards + backwards);
}

bool has_own_motor(const RigidRobotModel& robot, Index j) {
  const Eigen::MatrixXd& n = robot.transmission;
  return (n.row(j).array() != 0.0).count() == 1 && (n.col(j).array() != 0.0).count() == 1;
}

class Detective {
 public:
  Detective(const RigidRobotModel& robot, std::span<const Motion> pieces,
            const std::function<bool()>& keep_going)
      : robot_(robot),
        pieces_(pieces),
        keep_going_(keep_going),
        joints_(robot.size()),
        balance_(robot, pieces),
        wiring_(joints_) {}

  std::vector<ChannelFault> run() {
    std::vector<ChannelFault> faults;
    while (static_cast<int>(faults.size()) < kMostFaults) {
      std::optional<Suspicion> best = best_suspicion();
      if (!best) break;
      wiring_ = best->wiring;
      balance_.forget();
      best->fault.measure = "relative error of the force balance";
      faults.push_back(std::move(best->fault));
    }
    for (Index j = 0; j < joints_ && static_cast<int>(faults.size()) < kMostFaults; ++j) {
      if (goes_on() && drives_itself(j)) faults.push_back(undo_wrong_sign(j));
    }
    return faults;
  }
  // Sum of the joints' errors, with what was found undone.
  [[nodiscard]] double error() { return balance_.fit(wiring_).error.sum(); }

 private:
  struct Suspicion {
    Wiring wiring;
    std::vector<Index> touched;  // joints where it shows
    ChannelFault fault;
    double error = 0.0;  // of all joints, when it is undone
    // Of a factor: times it and over it the error of some joint must be so much larger. 0: of none.
    double far = 0.0, different = 0.0;
    bool is_force_unit = false;
    double settled = kSettled;
  };

  [[nodiscard]] bool goes_on() const { return !keep_going_ || keep_going_(); }

  [[nodiscard]] std::optional<Suspicion> best_suspicion() {
    const VectorXd now = balance_.fit(wiring_).error;
    if (now.maxCoeff() < kSuspicious) return {};
    std::vector<Suspicion> list = all_suspicions(), claimed;
    for (Suspicion& suspicion : list) {
      if (!goes_on()) return {};
      if (settles(now, suspicion) && !gains_energy(suspicion))
        claimed.push_back(std::move(suspicion));
    }
    if (claimed.empty()) return {};
    std::ranges::stable_sort(claimed, {}, &Suspicion::error);
    Suspicion best = std::move(claimed.front());
    for (std::size_t i = 1; i < claimed.size(); ++i) {
      const Suspicion& other = claimed[i];
      // Of masses that are not known only the ratios of forces tell.
      const bool is_same = share_joints(other, best) || (best.is_force_unit && other.is_force_unit);
      if (is_same && other.error <= kAlike * best.error) best.fault.add_rival(other.fault);
    }
    return best;
  }

  static bool share_joints(const Suspicion& a, const Suspicion& b) {
    return std::ranges::any_of(a.touched, [&b](Index joint) {
      return std::ranges::find(b.touched, joint) != b.touched.end();
    });
  }

  // Whether undoing it makes the balance fit, not at the cost of other joints; then with its
  // figures.
  [[nodiscard]] bool settles(const VectorXd& now, Suspicion& suspicion) {
    const VectorXd then = balance_.fit(suspicion.wiring).error;
    if (suspicion.is_force_unit) {  // shows at joints that share masses with it
      Index most = 0;
      (now - then).maxCoeff(&most);
      suspicion.touched = {most};
    }
    const double before = now(suspicion.touched).mean(), after = then(suspicion.touched).mean();
    if (before < kSuspicious || after > suspicion.settled * before || after > kLargestSettled) {
      return false;
    }
    suspicion.error = then.sum();
    suspicion.fault.dissimilarity_before = before;
    suspicion.fault.dissimilarity_after = after;
    return suspicion.error < now.sum() && (suspicion.far == 0.0 || is_determined(suspicion, then));
  }

  // A missing spring may turn a force that is known round. Friction it does not.
  [[nodiscard]] bool gains_energy(const Suspicion& suspicion) {
    return std::ranges::any_of(suspicion.touched, [&](Index j) {
      return has_own_motor(robot_, j) && friction_over_error(suspicion.wiring, j) < -kErrors;
    });
  }

  [[nodiscard]] bool is_determined(const Suspicion& suspicion, const VectorXd& here) {
    return std::ranges::all_of(std::array{suspicion.far, 1.0 / suspicion.far}, [&](double factor) {
      Wiring elsewhere = suspicion.wiring;
      for (Index j = 0; j < joints_; ++j) {
        if (elsewhere.force_factors(j) != wiring_.force_factors(j)) {
          elsewhere.force_factors(j) *= factor;
        }
        if (elsewhere.motion_factors(j) != wiring_.motion_factors(j)) {
          elsewhere.motion_factors(j) *= factor;
        }
      }
      const VectorXd there = balance_.fit(elsewhere).error;
      return (there.array() > suspicion.different * here.array()).any();
    });
  }

  [[nodiscard]] std::vector<Suspicion> all_suspicions() const {
    std::vector<Suspicion> list;
    add_swaps(list);
    add_signs(list);
    add_force_units(list);
    add_angle_units(list);
    return list;
  }

  void add_swaps(std::vector<Suspicion>& list) const {
    const auto add = [&](bool forces, bool motions, Index a, Index b) {
      Suspicion swapped{wiring_, {a, b}, {}, 0.0};
      std::string names;
      const auto exchange = [&](std::vector<Index>& from, const auto& name) {
        std::swap(from[at(a)], from[at(b)]);
        swapped.fault.channels.push_back(name(a));
        swapped.fault.channels.push_back(name(b));
        names += fmt::format("{}{} and {}", names.empty() ? "" : ", and ", name(a), name(b));
      };
      if (forces) exchange(swapped.wiring.force, [this](Index j) { return force_name(j); });
      if (forces && motions) swapped.settled = kSettledBoth;
      if (motions) exchange(swapped.wiring.motion, [this](Index j) { return motion_name(j); });
      swapped.fault.message = names + " are swapped";
      list.push_back(std::move(swapped));
    };
    for (Index a = 0; a < joints_; ++a) {
      for (Index b = a + 1; b < joints_; ++b) {
        add(true, false, a, b);
        add(false, true, a, b);
        add(true, true, a, b);
      }
    }
  }

  void add_signs(std::vector<Suspicion>& list) const {
    for (Index j = 0; j < joints_ && joints_ > 1; ++j) {
      for (const auto& [force, motion] : {std::pair{true, false}, {false, true}, {true, true}}) {
        Suspicion flipped{wiring_, {j}, {}, 0.0};
        if (!force) flipped.settled = kSettledMotion;
        if (force) {
          flipped.wiring.force_factors(j) *= -1.0;
          flipped.fault.channels.push_back(force_name(j));
        }
        if (motion) {
          flipped.wiring.motion_factors(j) *= -1.0;
          flipped.fault.channels.push_back(motion_name(j));
        }
        flipped.fault.message =
            force && motion
                ? fmt::format(
                      "{} and {} both have the wrong sign: that of the axis or the gear ratio?",
                      force_name(j), motion_name(j))
                : fmt::format("{} has the wrong sign", flipped.fault.channels.front());
        list.push_back(std::move(flipped));
      }
    }
  }

  // A force that outweighs all others keeps the masses that they share to itself, and fits at any
  // scale: factors far away must do much worse.
  void add_force_units(std::vector<Suspicion>& list) const {
    constexpr double kFar = 30.0, kDifferent = 2.0;
    const auto add = [&](Index j, double factor, std::string message) {
      Suspicion scaled{wiring_, {j}, {}, 0.0, kFar, kDifferent, true};
      scaled.wiring.force_factors(j) /= factor;
      scaled.fault.channels = {force_name(j)};
      scaled.fault.message = std::move(message);
      list.push_back(std::move(scaled));
    };
    for (Index j = 0; j < joints_ && joints_ > 1; ++j) {
      const std::string& name = force_name(j);
      const std::string unit = robot_.joints[at(j)].is_prismatic ? "N" : "N m";
      for (const double factor : {1e3, 1e-3, 1e6, 1e-6}) {
        add(j, factor, unit_fault_words(name, unit, factor));
      }
      const double ratio = std::abs(robot_.transmission(j, j));
      if (std::max(ratio, 1.0 / ratio) < kSmallestFactor) continue;
      for (const double factor : {ratio, 1.0 / ratio}) {
        add(j, factor,
            fmt::format("{} is {:.3g} times too {}: on the other side of the gear?", name,
                        std::max(factor, 1.0 / factor), factor > 1.0 ? "large" : "small"));
      }
    }
  }

  // Joints turn twice at most: degrees read as radians show by more, and no angle is taken for one
  // that would turn farther. Over many turns the bodies' torques are waves of every length, and fit
  // what they like: other factors must do worse.
  void add_angle_units(std::vector<Suspicion>& list) const {
    constexpr double kDegrees = 180.0 / std::numbers::pi;
    constexpr double kMostTurn = 4.0 * std::numbers::pi;  // of a joint
    constexpr double kFar = 1.5, kDifferent = 1.2;
    std::vector<Index> turning;
    for (Index j = 0; j < joints_; ++j) {
      if (!robot_.joints[at(j)].is_prismatic) turning.push_back(j);
    }
    const auto add = [&](const std::vector<Index>& joints, double factor) {
      Suspicion scaled{wiring_, joints, {}, 0.0, kFar, kDifferent};
      std::string names;
      for (const Index j : joints) {
        scaled.wiring.motion_factors(j) /= factor;
        scaled.fault.channels.push_back(motion_name(j));
        names += (names.empty() ? "" : ", ") + motion_name(j);
      }
      scaled.fault.message = fmt::format(
          "{}: {}", names,
          factor > 1.0 ? "degrees, where radians are stated" : "radians, where degrees are stated");
      list.push_back(std::move(scaled));
    };
    for (const double factor : {kDegrees, 1.0 / kDegrees}) {
      std::vector<Index> possible, suspect;
      for (const Index j : turning) {
        const double recorded = balance_.range(wiring_, j);
        if (recorded / factor > kMostTurn) continue;
        possible.push_back(j);
        const bool turns_too_far = recorded > kMostTurn;
        if (turns_too_far == (factor > 1.0)) suspect.push_back(j);
      }
      if (!suspect.empty()) add(possible, factor);
      for (const Index j : suspect) {
        if (possible.size() > 1) add({j}, factor);
      }
    }
  }

  // Whether it moves against its force: of inertia and friction neither can be negative. Joints
  // that share motors share these, too, and are passed over.
  [[nodiscard]] bool drives_itself(Index j) {
    if (!has_own_motor(robot_, j) || !goes_both_ways(pieces_, wiring_.motion[at(j)]) ||
        !(friction_over_error(wiring_, j) < -kErrors))
      return false;
    const WiredFit now = balance_.fit(wiring_);
    return balance_.inertia(wiring_, now, j) < 0.0 ||
           balance_.fit(other_force_sign(j)).error(j) < kSmallestGain * now.error(j);
  }

  // Jackknife error.
  [[nodiscard]] double friction_over_error(const Wiring& wiring, Index j) {
    VectorXd values(WiredBalance::kBlocks);
    for (Index b = 0; b < values.size(); ++b) {
      values(b) = balance_.dissipation(wiring, balance_.fit(wiring, b), j);
    }
    const auto blocks = static_cast<double>(values.size());
    const double error =
        std::sqrt((blocks - 1.0) / blocks * (values.array() - values.mean()).square().sum());
    const double friction = balance_.dissipation(wiring, balance_.fit(wiring), j);
    return error > 0.0 ? friction / error : 0.0;
  }

  [[nodiscard]] Wiring other_force_sign(Index j) const {
    Wiring other = wiring_;
    other.force_factors(j) *= -1.0;
    return other;
  }

  // Of the force or of the motion, whichever lets the joints that share masses with it fit.
  [[nodiscard]] ChannelFault undo_wrong_sign(Index j) {
    const Wiring force = other_force_sign(j);
    Wiring motion = wiring_;
    motion.motion_factors(j) *= -1.0;
    const double by_force = balance_.fit(force).error.sum();
    const double by_motion = balance_.fit(motion).error.sum();
    ChannelFault fault{
        {}, {}, friction_over_error(wiring_, j), 0.0, "friction's power over its standard error"};
    if (by_force < kAlike * by_motion) fault.channels.push_back(force_name(j));
    if (by_motion < kAlike * by_force) fault.channels.push_back(motion_name(j));
    wiring_ = by_motion < by_force ? motion : force;
    fault.dissimilarity_after = friction_over_error(wiring_, j);
    fault.message = fmt::format("{} has the wrong sign: by friction {} would gain energy",
                                fmt::join(fault.channels, " or "), robot_.joints[at(j)].name);
    return fault;
  }

  [[nodiscard]] const std::string& force_name(Index j) const {
    return robot_.channels.torque[at(j)];
  }
  [[nodiscard]] const std::string& motion_name(Index j) const {
    const RobotChannels& channels = robot_.channels;
    return (channels.position.empty() ? channels.velocity : channels.position)[at(j)];
  }

  const RigidRobotModel& robot_;
  std::span<const Motion> pieces_;
  const std::function<bool()>& keep_going_;
  Index joints_;
  WiredBalance balance_;
  Wiring wiring_;  // with what was found undone
};

ChannelFault told(const GravityFault& gravity, const RigidRobotModel& robot) {
  const auto joints = static_cast<double>(robot.size());
  return {.channels = robot.channels.torque,
          .message = fmt::format(
              "gravity points elsewhere: the forces fit [{:.3g}, {:.3g}, {:.3g}] m/s^2 in the base "
              "frame, the model says [{:.3g}, {:.3g}, {:.3g}]",
              gravity.gravity.x(), gravity.gravity.y(), gravity.gravity.z(), robot.gravity.x(),
              robot.gravity.y(), robot.gravity.z()),
          .dissimilarity_before = gravity.error_before / joints,
          .dissimilarity_after = gravity.error_after / joints,
          .measure = "relative error of the force balance"};
}

// Wires mend some joints where gravity mends all. Without any, a large error asks for it, too.
std::vector<ChannelFault> wires_or_gravity(const RigidRobotModel& robot,
                                           std::span<const Motion> pieces,
                                           const std::function<bool()>& keep_going) {
  constexpr double kLarge = 0.25;  // of a joint's error
  Detective detective(robot, pieces, keep_going);
  const double as_recorded = detective.error();
  std::vector<ChannelFault> wires = detective.run();
  if (wires.empty() && as_recorded < kLarge * static_cast<double>(robot.size())) return wires;
  const std::optional<GravityFault> gravity = find_gravity_fault(robot, pieces, keep_going);
  if (!gravity) return wires;
  RigidRobotModel elsewhere = robot;
  elsewhere.gravity = gravity->gravity;
  if (!Detective(elsewhere, pieces, keep_going).run().empty()) return wires;
  ChannelFault fault = told(*gravity, robot);
  const double mended = detective.error();
  // Gains that are not known take the size of every weight, and leave less to tell gravity by.
  const bool is_better =
      !robot.channels.unknown_drive_gains && gravity->error_after <= kAlike * mended;
  if (!is_better && wires.size() == 1) wires.front().add_rival(fault);
  if (!is_better) return wires;
  if (wires.size() == 1 && mended <= kAlike * gravity->error_after) fault.add_rival(wires.front());
  return {std::move(fault)};
}

}  // namespace

std::vector<ChannelFault> find_wiring_faults(const RigidRobotModel& robot,
                                             std::span<const Motion> pieces,
                                             const std::function<bool()>& keep_going) {
  std::vector<ChannelFault> faults = find_wraps(robot, pieces);
  if (!faults.empty()) return faults;  // a jump looks like a wrong sign
  if (have_blows(robot, pieces)) return {};
  faults = find_rate_faults(robot, pieces);
  if (!faults.empty()) return faults;  // what follows would follow from them
  return wires_or_gravity(robot, pieces, keep_going);
}

}  // namespace graybox
