// CandidateSpace: a continuum of possible experiments, the points x of a box in R^n, each with its
// information matrix H(x). An InformationSet is a sample of one.
//
//   const RobotSpace space(robot, paper_ranges());       // joint angles, robot_space.hpp
//   const auto evaluator = space.evaluator();             // one for each thread
//   evaluator->information(point, packed);
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace graybox {

class InformationEvaluator {
 public:
  virtual ~InformationEvaluator() = default;

  // Writes H(point), packed (packed_matrix.hpp). The point lies in the box.
  virtual void information(std::span<const double> point, std::span<double> packed) = 0;
};

// Bounds of the sensitivity tr(W H(x)) over boxes, for one W. One for each thread.
class SensitivityBound {
 public:
  struct Answer {
    double at_centre = 0.0;  // tr(W H) at the centre of the box
    double above = 0.0;      // tr(W H) <= this in all of the box; infinite: the box is too large
  };

  virtual ~SensitivityBound() = default;

  // `shares`: how much each coordinate's width adds to the bound, to choose which one to halve.
  virtual Answer over(std::span<const double> lower, std::span<const double> upper,
                      std::span<double> shares) = 0;
};

class CandidateSpace {
 public:
  virtual ~CandidateSpace() = default;

  [[nodiscard]] virtual std::size_t dimension() const = 0;  // d, of H
  // The box: lower[k] <= x_k <= upper[k]; a coordinate with lower = upper is fixed.
  [[nodiscard]] virtual std::span<const double> lower() const = 0;
  [[nodiscard]] virtual std::span<const double> upper() const = 0;

  [[nodiscard]] virtual std::unique_ptr<InformationEvaluator> evaluator() const = 0;

  // For a positive semidefinite W (d x d); none where this space knows no bound.
  [[nodiscard]] virtual std::unique_ptr<SensitivityBound> sensitivity_bound(
      const Eigen::MatrixXd& /*weight*/) const {
    return nullptr;
  }

  [[nodiscard]] std::size_t coordinate_count() const { return lower().size(); }  // n
};

}  // namespace graybox
