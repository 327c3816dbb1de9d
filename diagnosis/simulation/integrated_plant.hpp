// The plant of any mechanism with elements, integrated with SUNDIALS (plant.hpp).
#pragma once

#include <Eigen/Core>
#include <memory>

#include "diagnosis/simulation/mechanism.hpp"
#include "diagnosis/simulation/plant.hpp"
#include "problems/elements/element_dynamics.hpp"

namespace graybox {

struct PlantStart {
  Eigen::VectorXd coordinates;  // q, at rest
  Eigen::VectorXd command;      // to which inputs add
};

[[nodiscard]] std::unique_ptr<Plant> integrated_plant(std::unique_ptr<Mechanism> mechanism,
                                                      ElementDynamics elements, PlantStart start,
                                                      double sample_time,
                                                      const IntegratorOptions& options);

}  // namespace graybox
