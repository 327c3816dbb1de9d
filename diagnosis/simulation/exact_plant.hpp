// The plant of linear equations of motion, solved exactly from sample to sample (plant.hpp).
#pragma once

#include <memory>

#include "diagnosis/simulation/mechanism.hpp"
#include "diagnosis/simulation/plant.hpp"

namespace graybox {

// Cost O(n^2) a sample.
[[nodiscard]] std::unique_ptr<Plant> exact_plant(const LinearMotion& motion, double sample_time);

}  // namespace graybox
