#include "problems/robot_information/robot_position_tables.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/mechanisms/frequency_response.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;

std::size_t padded(std::size_t count) {
  constexpr std::size_t kPadding = InformationTables::kFrequencyPadding;
  return (count + kPadding - 1) / kPadding * kPadding;
}

}  // namespace

PositionFreeTables::PositionFreeTables(const RobotModel& robot)
    : robot_(robot),
      motors_(static_cast<std::size_t>(robot.motor_count())),
      bearings_(robot.springs.size() - motors_),
      frequencies_(padded(robot.frequencies.size())),
      diagonal_(robot.transmission.isDiagonal(0.0)),
      squared_frequency_(frequencies_, 0.0),
      weight_(frequencies_, 0.0),
      bearing_(bearings_, frequencies_),
      gearbox_(matrix_elements(true), frequencies_),
      velocity_(matrix_elements(false), frequencies_),
      direct_(matrix_elements(false), frequencies_),
      reaction_(matrix_elements(false), frequencies_),
      closed_loop_(matrix_elements(true), frequencies_) {
  order_rotations();
  for (std::size_t f = 0; f < frequencies_; ++f) fill(f);
}

InformationTables PositionFreeTables::tables() const {
  return {.bearings = bearings_,
          .motors = motors_,
          .frequencies = frequencies_,
          .diagonal = diagonal_,
          .squared_frequency = squared_frequency_.data(),
          .weight = weight_.data(),
          .bearing = bearing_.data(),
          .gearbox = gearbox_.data(),
          .velocity = velocity_.data(),
          .direct = direct_.data(),
          .reaction = reaction_.data(),
          .closed_loop = closed_loop_.data()};
}

std::size_t PositionFreeTables::matrix_elements(bool symmetric) const {
  if (diagonal_) return motors_;
  return symmetric ? packed_size(motors_) : motors_ * motors_;
}

void PositionFreeTables::order_rotations() {
  for (const bool gearbox : {false, true}) {
    for (std::size_t s = 0; s < robot_.springs.size(); ++s) {
      if (robot_.springs[s].is_gearbox == gearbox) {
        rotations_.push_back(static_cast<Eigen::Index>(s));
      }
    }
  }
  places_.resize(rotations_.size());
  for (std::size_t k = 0; k < rotations_.size(); ++k) {
    places_[static_cast<std::size_t>(rotations_[k])] = k;
  }
}

Complex PositionFreeTables::spring_law(std::size_t place, double w) const {
  const ArmSpring& spring = robot_.springs[static_cast<std::size_t>(rotations_[place])];
  return {spring.stiffness, w * spring.damping};
}

// Padding repeats the last frequency with weight zero.
void PositionFreeTables::fill(std::size_t f) {
  const double w = robot_.frequencies[std::min(f, robot_.frequencies.size() - 1)];
  squared_frequency_[f] = w * w;
  if (f < robot_.frequencies.size()) {
    weight_[f] =
        2.0 * robot_.reference_psd / (static_cast<double>(motors_) * velocity_noise_psd(robot_, w));
  }
  for (std::size_t i = 0; i < bearings_; ++i) bearing_.set(i, f, spring_law(i, w));
  fill_motor_matrices(f, w);
}

void PositionFreeTables::fill_motor_matrices(std::size_t f, double w) {
  const auto m = static_cast<Eigen::Index>(motors_);
  const Eigen::MatrixXd& n = robot_.transmission;
  Eigen::VectorXcd gearbox(m);
  for (std::size_t i = 0; i < motors_; ++i) {
    gearbox(static_cast<Eigen::Index>(i)) = spring_law(bearings_ + i, w);
  }
  const Eigen::VectorXcd motor =
      -w * w * robot_.motor_inertia + Complex(0.0, w) * robot_.motor_friction;
  const Eigen::MatrixXcd free_motor = n.transpose() * motor.asDiagonal() * n;  // D_m - K_g
  Eigen::MatrixXcd motor_stiffness = free_motor;                               // D_m
  motor_stiffness.diagonal() += gearbox;
  const Eigen::MatrixXcd inverse = motor_stiffness.inverse();
  const Eigen::MatrixXcd free_part = inverse * free_motor;  // I - W
  Eigen::MatrixXcd closed_loop = n * inverse * n.transpose();
  const Complex velocity = Complex(0.0, w) * hold_factor(w, robot_.sample_time);
  closed_loop.diagonal() +=
      (velocity * controller_response(robot_.controller, w, robot_.sample_time)).cwiseInverse();

  set_symmetric(gearbox_, f, gearbox.asDiagonal() * free_part);
  set_full(velocity_, f, n * inverse * gearbox.asDiagonal());
  set_full(direct_, f, -n * inverse);
  set_full(reaction_, f, free_part.transpose());
  set_symmetric(closed_loop_, f, closed_loop);
}

void PositionFreeTables::set_symmetric(ComplexTable& table, std::size_t f,
                                       const Eigen::MatrixXcd& matrix) const {
  for (std::size_t i = 0; i < motors_; ++i) {
    for (std::size_t j = diagonal_ ? i : 0; j <= i; ++j) {
      table.set(diagonal_ ? i : packed_index(i, j), f,
                matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)));
    }
  }
}

void PositionFreeTables::set_full(ComplexTable& table, std::size_t f,
                                  const Eigen::MatrixXcd& matrix) const {
  for (std::size_t i = 0; i < motors_; ++i) {
    for (std::size_t j = 0; j < motors_; ++j) {
      if (diagonal_ && i != j) continue;
      table.set(diagonal_ ? i : i * motors_ + j, f,
                matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)));
    }
  }
}

void PositionFreeTables::pick_parameters(const double* sums, double scale,
                                         double* information) const {
  for (std::size_t p = 0, k = 0; p < robot_.parameters.size(); ++p) {
    const std::size_t spring_p = robot_.parameters[p];
    const double scaled = scale * robot_.springs[spring_p].stiffness;
    for (std::size_t q = 0; q <= p; ++q, ++k) {
      const std::size_t spring_q = robot_.parameters[q];
      information[k] = scaled * robot_.springs[spring_q].stiffness *
                       sums[packed_index(places_[spring_p], places_[spring_q])];
    }
  }
}

PackedArm::PackedArm(const RobotModel& robot, const PositionFreeTables& shared,
                     bool gravity_deflection)
    : shared_(shared),
      builder_(robot, {.gravity_deflection = gravity_deflection}),
      mass_(packed_size(robot.springs.size())),
      gravity_(mass_.size()) {}

void PackedArm::linearise(const Eigen::VectorXd& joint_angles) {
  const ArmLinearisation& arm = builder_.linearise(joint_angles);
  const std::vector<Eigen::Index>& rotations = shared_.rotations();
  for (std::size_t i = 0, k = 0; i < rotations.size(); ++i) {
    for (std::size_t j = 0; j <= i; ++j, ++k) {
      mass_[k] = arm.mass(rotations[i], rotations[j]);
      gravity_[k] = arm.gravity_stiffness(rotations[i], rotations[j]);
    }
  }
}

void check_positions(const RobotModel& robot, const PositionTable& positions) {
  const auto joints = static_cast<std::size_t>(robot.motor_count());
  if (positions.joint_count != joints || positions.degrees.empty()) {
    throw InputError(
        fmt::format("positions: need at least one position of {} joint angles for {}, "
                    "got {} numbers with {} a position",
                    joints, robot.name, positions.degrees.size(), positions.joint_count));
  }
  for (std::size_t i = 0; i < positions.degrees.size(); ++i) {
    if (!std::isfinite(positions.degrees[i])) {
      throw InputError(fmt::format("positions: angle q{} of position {} is not finite",
                                   i % joints + 1, i / joints));
    }
  }
}

Eigen::VectorXd radians(const PositionTable& positions, std::size_t i) {
  const auto degrees = positions.position(i);
  Eigen::VectorXd result(static_cast<Eigen::Index>(degrees.size()));
  for (std::size_t j = 0; j < degrees.size(); ++j) {
    result(static_cast<Eigen::Index>(j)) = degrees[j] * (std::numbers::pi / 180.0);
  }
  return result;
}

CandidateTable position_columns(const PositionTable& positions) {
  CandidateTable table;
  for (std::size_t j = 0; j < positions.joint_count; ++j) {
    table.names.push_back(fmt::format("q{}", j + 1));
    table.units.emplace_back("deg");
  }
  table.values = positions.degrees;
  return table;
}

}  // namespace graybox
