// Samples of stiffness factors: what the parameters theta of a robot (robot_model.hpp) may be if
// the nominal stiffness is only known to within a fraction. The factors are independent and uniform
// on [1 - uncertainty, 1 + uncertainty]; the nominal theta = 1 is not one of them.
//
//   const auto thetas = graybox::latin_hypercube_stiffness({.uncertainty = 0.5}, 50, 12);
//   const RobotModel other = with_stiffness_factors(robot, thetas[0]);
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace graybox {

struct StiffnessUncertainty {
  double uncertainty = 0.5;
  std::uint64_t seed = 1;
};

// Both throw InputError unless 0 <= uncertainty < 1, count >= 1 and parameters >= 1.

// Independent draws. Sample k depends on the seed and k alone, so more samples continue fewer.
[[nodiscard]] std::vector<Eigen::VectorXd> random_stiffness(const StiffnessUncertainty& options,
                                                            std::size_t count,
                                                            std::size_t parameters);

// A Latin hypercube (McKay, Beckman and Conover 1979): of the `count` equal intervals of each
// parameter's range, every one holds exactly one sample. Covers the range with few samples.
[[nodiscard]] std::vector<Eigen::VectorXd> latin_hypercube_stiffness(
    const StiffnessUncertainty& options, std::size_t count, std::size_t parameters);

}  // namespace graybox
