// Weights that miss the simplex by no more than another program's rounding, put back on it.
// Negative ones become zero, and then all are divided by their sum. What was done is kept, to be
// stated; the design that is certified is the repaired one.
//
//   std::vector<double> weights{0.5, 0.5000001, -1e-8};
//   const WeightRepair repair = repair_weights(weights).value();
//   assert(repair.clipped == 1e-8);
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace graybox {

inline constexpr double kLargestRepair = 1e-6;  // of one weight below zero, and of the sum

struct WeightRepair {
  double clipped = 0.0;   // sum of the negative weights set to zero, as a positive number
  double rescaled = 0.0;  // the sum after that, less one, before all were divided by it

  [[nodiscard]] bool any() const { return clipped != 0.0 || rescaled != 0.0; }
  bool operator==(const WeightRepair&) const = default;
};

// Nothing, with the weights as they were, where one is below -kLargestRepair or no number, or where
// their sum is further than kLargestRepair from one.
[[nodiscard]] std::optional<WeightRepair> repair_weights(std::vector<double>& weights);

// One line without full stop: "weights repaired: 1e-08 below zero clipped, a sum of 1 + 2e-07 put
// right". Empty where nothing was done.
[[nodiscard]] std::string describe(const WeightRepair& repair);

}  // namespace graybox
