// CandidateSpace: a continuum of possible experiments, the points x of a box in R^n, each with its
// information matrix H(x). An InformationSet is a sample of one.
//
//   const RobotSpace space(robot, paper_ranges());       // joint angles, robot_space.hpp
//   const auto evaluator = space.evaluator();             // one for each thread
//   evaluator->information(point, packed);
#pragma once

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

class CandidateSpace {
 public:
  virtual ~CandidateSpace() = default;

  [[nodiscard]] virtual std::size_t dimension() const = 0;  // d, of H
  // The box: lower[k] <= x_k <= upper[k]; a coordinate with lower = upper is fixed.
  [[nodiscard]] virtual std::span<const double> lower() const = 0;
  [[nodiscard]] virtual std::span<const double> upper() const = 0;

  [[nodiscard]] virtual std::unique_ptr<InformationEvaluator> evaluator() const = 0;

  [[nodiscard]] std::size_t coordinate_count() const { return lower().size(); }  // n
};

}  // namespace graybox
