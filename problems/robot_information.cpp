#include "graybox/problems/robot_information.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <complex>
#include <exception>
#include <memory>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "graybox/problems/error.hpp"
#include "graybox/problems/frequency_response.hpp"
#include "graybox/problems/kernels/information_kernels.hpp"
#include "graybox/problems/local_model.hpp"
#include "graybox/problems/packed_matrix.hpp"
#include "graybox/problems/robot_information_moving.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;

// A table of complex numbers in the layout of InformationTables.
class ComplexTable {
 public:
  ComplexTable(std::size_t elements, std::size_t frequencies)
      : frequencies_(frequencies), values_(2 * elements * frequencies, 0.0) {}
  void set(std::size_t element, std::size_t frequency, Complex value) {
    values_[2 * element * frequencies_ + frequency] = value.real();
    values_[(2 * element + 1) * frequencies_ + frequency] = value.imag();
  }
  [[nodiscard]] const double* data() const { return values_.data(); }

 private:
  std::size_t frequencies_;
  std::vector<double> values_;
};

// Everything the kernel needs of a robot that does not depend on the position, and the orders:
// the kernel wants bearings before gearboxes, the chain has them joint by joint, and parameters
// have an order of their own.
class PositionFreeTables {
 public:
  explicit PositionFreeTables(const RobotModel& robot)
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

  [[nodiscard]] InformationTables tables() const {
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

  // The rotation of the chain at each place of the kernel's order, and the place of each rotation.
  [[nodiscard]] const std::vector<Eigen::Index>& rotations() const { return rotations_; }
  [[nodiscard]] std::size_t place(std::size_t rotation) const { return places_[rotation]; }

 private:
  static std::size_t padded(std::size_t count) {
    constexpr std::size_t kPadding = InformationTables::kFrequencyPadding;
    return (count + kPadding - 1) / kPadding * kPadding;
  }
  [[nodiscard]] std::size_t matrix_elements(bool symmetric) const {
    if (diagonal_) return motors_;
    return symmetric ? packed_size(motors_) : motors_ * motors_;
  }

  void order_rotations() {
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

  [[nodiscard]] Complex spring_law(std::size_t place, double w) const {
    const ArmSpring& spring = robot_.springs[static_cast<std::size_t>(rotations_[place])];
    return {spring.stiffness, w * spring.damping};
  }

  // Padding repeats the last frequency with weight zero.
  void fill(std::size_t f) {
    const double w = robot_.frequencies[std::min(f, robot_.frequencies.size() - 1)];
    squared_frequency_[f] = w * w;
    if (f < robot_.frequencies.size()) {
      weight_[f] = 2.0 * robot_.reference_psd /
                   (static_cast<double>(motors_) * velocity_noise_psd(robot_, w));
    }
    for (std::size_t i = 0; i < bearings_; ++i) bearing_.set(i, f, spring_law(i, w));
    fill_motor_matrices(f, w);
  }

  void fill_motor_matrices(std::size_t f, double w) {
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

  void set_symmetric(ComplexTable& table, std::size_t f, const Eigen::MatrixXcd& matrix) const {
    for (std::size_t i = 0; i < motors_; ++i) {
      for (std::size_t j = diagonal_ ? i : 0; j <= i; ++j) {
        table.set(diagonal_ ? i : packed_index(i, j), f,
                  matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)));
      }
    }
  }
  void set_full(ComplexTable& table, std::size_t f, const Eigen::MatrixXcd& matrix) const {
    for (std::size_t i = 0; i < motors_; ++i) {
      for (std::size_t j = 0; j < motors_; ++j) {
        if (diagonal_ && i != j) continue;
        table.set(diagonal_ ? i : i * motors_ + j, f,
                  matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)));
      }
    }
  }

  const RobotModel& robot_;
  std::size_t motors_, bearings_, frequencies_;
  bool diagonal_;
  std::vector<double> squared_frequency_, weight_;
  ComplexTable bearing_, gearbox_, velocity_, direct_, reaction_, closed_loop_;
  std::vector<Eigen::Index> rotations_;
  std::vector<std::size_t> places_;
};

// Computes one position after another; one a thread.
class PositionWorker {
 public:
  PositionWorker(const RobotModel& robot, const PositionFreeTables& shared,
                 const RobotInformationOptions& options)
      : robot_(robot),
        shared_(shared),
        tables_(shared.tables()),
        builder_(robot, {.gravity_deflection = options.gravity_deflection}),
        scale_(options.scale),
        mass_(packed_size(robot.springs.size())),
        gravity_(mass_.size()),
        sums_(mass_.size()),
        workspace_(information_workspace_size(tables_.bearings, tables_.motors)) {}

  // Writes H, packed. `joint_angles` in rad.
  void compute(const Eigen::VectorXd& joint_angles, double* information) {
    const ArmLinearisation& arm = builder_.linearise(joint_angles);
    const std::vector<Eigen::Index>& rotations = shared_.rotations();
    for (std::size_t i = 0, k = 0; i < rotations.size(); ++i) {
      for (std::size_t j = 0; j <= i; ++j, ++k) {
        mass_[k] = arm.mass(rotations[i], rotations[j]);
        gravity_[k] = arm.gravity_stiffness(rotations[i], rotations[j]);
      }
    }
    information_kernel().information(tables_, mass_.data(), gravity_.data(), workspace_.data(),
                                     sums_.data());
    pick_parameters(information);
  }

 private:
  void pick_parameters(double* information) const {
    for (std::size_t p = 0, k = 0; p < robot_.parameters.size(); ++p) {
      const std::size_t spring_p = robot_.parameters[p];
      const double scaled = scale_ * robot_.springs[spring_p].stiffness;
      for (std::size_t q = 0; q <= p; ++q, ++k) {
        const std::size_t spring_q = robot_.parameters[q];
        information[k] = scaled * robot_.springs[spring_q].stiffness *
                         sums_[packed_index(shared_.place(spring_p), shared_.place(spring_q))];
      }
    }
  }

  const RobotModel& robot_;
  const PositionFreeTables& shared_;
  InformationTables tables_;
  LocalModelBuilder builder_;
  double scale_;
  AlignedArray mass_, gravity_, sums_, workspace_;
};

Eigen::VectorXd radians(const PositionTable& positions, std::size_t i) {
  const auto degrees = positions.position(i);
  Eigen::VectorXd result(static_cast<Eigen::Index>(degrees.size()));
  for (std::size_t j = 0; j < degrees.size(); ++j) {
    result(static_cast<Eigen::Index>(j)) = degrees[j] * (std::numbers::pi / 180.0);
  }
  return result;
}

void check(const RobotModel& robot, const PositionTable& positions,
           const RobotInformationOptions& options) {
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
  if (!(options.scale > 0.0) || !std::isfinite(options.scale)) {
    throw InputError(fmt::format("scale: must be positive, is {}", options.scale));
  }
  if (options.total_derivative && !options.gravity_deflection) {
    throw InputError("total_derivative: needs gravity_deflection, without it no point moves");
  }
  if (options.threads < 1) {
    throw InputError(fmt::format("threads: must be at least 1, is {}", options.threads));
  }
}

// Runs compute(position, out) for all positions. Each is computed by itself, so neither the number
// of threads nor their schedule shows in the result. `make_worker()` is called once a thread.
template <class MakeWorker>
void for_each_position(const PositionTable& positions, std::size_t stride, int threads,
                       const MakeWorker& make_worker, double* out) {
  std::exception_ptr failure;  // of the first position that failed
  std::size_t failed = positions.count();
  const auto count = static_cast<std::ptrdiff_t>(positions.count());
#pragma omp parallel num_threads(threads)
  {
    auto worker = make_worker();
#pragma omp for schedule(dynamic, 16)
    for (std::ptrdiff_t i = 0; i < count; ++i) {
      const auto index = static_cast<std::size_t>(i);
      try {
        worker.compute(radians(positions, index), out + index * stride);
      } catch (...) {
#pragma omp critical(graybox_robot_information)
        if (index < failed) {
          failed = index;
          failure = std::current_exception();
        }
      }
    }
  }
  if (failure != nullptr) std::rethrow_exception(failure);
}

CandidateTable candidate_table(const PositionTable& positions) {
  CandidateTable table;
  for (std::size_t j = 0; j < positions.joint_count; ++j) {
    table.names.push_back(fmt::format("q{}", j + 1));
    table.units.emplace_back("deg");
  }
  table.values = positions.degrees;
  return table;
}

}  // namespace

InformationSet robot_information_set(const RobotModel& robot, const PositionTable& positions,
                                     const RobotInformationOptions& options) {
  check(robot, positions, options);
  const std::size_t d = robot.parameters.size(), stride = packed_size(d);
  AlignedArray information(positions.count() * stride);
  if (options.total_derivative) {
    for_each_position(
        positions, stride, options.threads, [&] { return MovingPointWorker(robot, options.scale); },
        information.data());
  } else {
    const PositionFreeTables shared(robot);
    for_each_position(
        positions, stride, options.threads, [&] { return PositionWorker(robot, shared, options); },
        information.data());
  }
  return InformationSet(d, std::move(information), candidate_table(positions),
                        robot.parameter_names(), robot.name);
}

Eigen::MatrixXd robot_information_matrix(const RobotModel& robot,
                                         const Eigen::VectorXd& joint_angles,
                                         const RobotInformationOptions& options) {
  PositionTable position{static_cast<std::size_t>(joint_angles.size()), {}};
  for (const double angle : joint_angles) {
    position.degrees.push_back(angle * (180.0 / std::numbers::pi));
  }
  const InformationSet set = robot_information_set(robot, position, options);
  const auto d = static_cast<Eigen::Index>(set.dimension());
  Eigen::MatrixXd matrix(d, d);
  unpack(set.data(), set.dimension(), matrix.data());
  return matrix;
}

}  // namespace graybox
