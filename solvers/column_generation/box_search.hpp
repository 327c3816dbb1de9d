// BoxSearch: a local maximum of a smooth function on a box, from a start inside, by a projected
// quasi-Newton method (Bertsekas 1982: coordinates that stand on a bound, with the gradient
// pointing out of the box, rest; BFGS on the others).
//
// Works in coordinates that map the box to the unit cube. The gradient is taken by differences of
// fourth order inside, of second order one-sided where a bound is near, with a step of 1e-3 of the
// box; function values never lie outside it. A run ends when the gradient promises no more than
// `tolerance` for a step across the box, when no step increases the value, or after `step_limit`
// steps. The value never falls below that of the start.
//
//   BoxSearch search(lower, upper);
//   const double value = search.maximise(function, point, {.tolerance = 1e-9});
//
// Cost: 2 to 4 n + 2 values a step, 5 to 30 steps. No allocation after construction.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>
#include <vector>

namespace graybox {

struct BoxSearchOptions {
  double tolerance = 1e-9;
  int step_limit = 60;
};

class BoxSearch {
 public:
  // lower <= upper, finite; equal bounds fix a coordinate.
  BoxSearch(std::span<const double> lower, std::span<const double> upper);

  using Function = std::function<double(std::span<const double>)>;
  // Moves `point` uphill and returns the value there.
  double maximise(const Function& function, std::span<double> point,
                  const BoxSearchOptions& options = {});

  // The gradient by differences, in the original coordinates (0 for fixed ones). For tests.
  void gradient(const Function& function, std::span<const double> point, std::span<double> out);

 private:
  void move_to(std::span<const double> point);  // unit_, the point in the unit cube
  double value_at(const Function& function, const Eigen::VectorXd& unit);
  void differentiate(const Function& function, const Eigen::VectorXd& unit, double value);
  [[nodiscard]] bool blocked(Eigen::Index k) const;
  double advance(const Function& function, double value);

  Eigen::VectorXd lower_, upper_, width_;
  Eigen::VectorXd unit_, trial_, gradient_, old_gradient_, direction_, step_, change_;
  Eigen::MatrixXd inverse_hessian_;  // of minus the function
  std::vector<double> point_;
};

}  // namespace graybox
