#include "diagnosis/final_fit/judged_model.hpp"

#include <cmath>

namespace graybox {

double relative_size(const Eigen::VectorXd& error, const Eigen::VectorXd& scale) {
  return std::sqrt((error.array() / scale.array()).square().mean());
}

}  // namespace graybox
