// What the information matrices of a robot share over its positions, for robot_information and
// robot_spectrum_information. (The mathematics is in the header of the former.) These are tables
// that do not depend on the position, the arm at a position in the order that the kernel wants, and
// a loop over positions by several threads.
//
// The kernel wants bearings before gearboxes, the chain has them joint by joint, and parameters
// have an order of their own.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <cstddef>
#include <exception>
#include <vector>

#include "problems/base/aligned_array.hpp"
#include "problems/base/stop.hpp"
#include "problems/information/information_set.hpp"
#include "problems/kernels/information_kernels.hpp"
#include "problems/mechanisms/local_model.hpp"
#include "problems/mechanisms/robot_model.hpp"
#include "problems/robot_information/robot_grid.hpp"

namespace graybox {

// A table of complex numbers in the layout of InformationTables.
class ComplexTable {
 public:
  ComplexTable(std::size_t elements, std::size_t frequencies)
      : frequencies_(frequencies), values_(2 * elements * frequencies, 0.0) {}
  void set(std::size_t element, std::size_t frequency, std::complex<double> value) {
    values_[2 * element * frequencies_ + frequency] = value.real();
    values_[(2 * element + 1) * frequencies_ + frequency] = value.imag();
  }
  [[nodiscard]] const double* data() const { return values_.data(); }

 private:
  std::size_t frequencies_;
  std::vector<double> values_;
};

class PositionFreeTables {
 public:
  explicit PositionFreeTables(const RobotModel& robot);  // keeps a reference

  [[nodiscard]] InformationTables tables() const;

  // The rotation of the chain at each place of the kernel's order.
  [[nodiscard]] const std::vector<Eigen::Index>& rotations() const { return rotations_; }

  // Packed d x d `information` = scale k_p k_q sums_pq for the parameters p, q of the robot, from
  // packed sums over springs in the kernel's order.
  void pick_parameters(const double* sums, double scale, double* information) const;

 private:
  [[nodiscard]] std::size_t matrix_elements(bool symmetric) const;
  void order_rotations();
  [[nodiscard]] std::complex<double> spring_law(std::size_t place, double w) const;
  void fill(std::size_t f);
  void fill_motor_matrices(std::size_t f, double w);
  void set_symmetric(ComplexTable& table, std::size_t f, const Eigen::MatrixXcd& matrix) const;
  void set_full(ComplexTable& table, std::size_t f, const Eigen::MatrixXcd& matrix) const;

  const RobotModel& robot_;
  std::size_t motors_, bearings_, frequencies_;
  bool diagonal_;
  std::vector<double> squared_frequency_, weight_;
  ComplexTable bearing_, gearbox_, velocity_, direct_, reaction_, closed_loop_;
  std::vector<Eigen::Index> rotations_;
  std::vector<std::size_t> places_;  // of each rotation in the kernel's order
};

// Mass matrix and gravity stiffness at one position after another, as the kernel reads them.
class PackedArm {
 public:
  PackedArm(const RobotModel& robot, const PositionFreeTables& shared, bool gravity_deflection);

  void linearise(const Eigen::VectorXd& joint_angles);  // rad
  [[nodiscard]] const double* mass() const { return mass_.data(); }
  [[nodiscard]] const double* gravity() const { return gravity_.data(); }

 private:
  const PositionFreeTables& shared_;
  LocalModelBuilder builder_;
  AlignedArray mass_, gravity_;
};

// Throws InputError if there are no positions, they do not fit the robot or are not finite.
void check_positions(const RobotModel& robot, const PositionTable& positions);

// The joint angles of a position in rad.
[[nodiscard]] Eigen::VectorXd radians(const PositionTable& positions, std::size_t position);

// Columns q1, q2, ... in degrees, a row for each position.
[[nodiscard]] CandidateTable position_columns(const PositionTable& positions);

// Runs compute(position, out) for all positions. Each is computed by itself, so neither the number
// of threads nor their schedule shows in the result. `make_worker()` is called once a thread.
// Throws what compute() threw at the first position where it did, and Stopped where time is up
// (stop.hpp).
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
        stop_if_requested();
        worker.compute(radians(positions, index), out + index * stride);
      } catch (...) {
#pragma omp critical(graybox_for_each_position)
        if (index < failed) {
          failed = index;
          failure = std::current_exception();
        }
      }
    }
  }
  if (failure != nullptr) std::rethrow_exception(failure);
}

}  // namespace graybox
