// Fixed points x = F(x) by Anderson's extrapolation (Journal of the ACM 12, 1965). The next x is
// the one for which F(x) - x, straight in x through the last points, is least. For a map that is
// straight in n dimensions it ends after n + 1 evaluations.
//
//   FixedPointIteration iteration;
//   while (...) x = iteration.next(x, evaluate(x));
#pragma once

#include <Eigen/Core>
#include <vector>

namespace graybox {

class FixedPointIteration {
 public:
  [[nodiscard]] Eigen::VectorXd next(const Eigen::VectorXd& x, const Eigen::VectorXd& of_x);

 private:
  std::vector<Eigen::VectorXd> points_, steps_;  // x and F(x) - x
};

}  // namespace graybox
