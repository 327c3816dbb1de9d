// The parameters that shape laws' forces (thresholds, exponents, wave lengths, those of laws with
// memory), by variable projection. Linear parameters are solved for at each step (Golub and Pereyra
// 1973), with Kaufman's Jacobian (1975). It is that of -P(dL a) for laws' columns L(theta) of
// amplitudes a. P is the projection on what neither the model's columns nor L imitate.
//
// Laws listed as new begin from several of their shapes (law_shapes.hpp): the given one and the
// best others, each refined alone; after that all laws whose shapes are not held are refined
// together. Friction that is not new keeps a transition within widest_transition.
#pragma once

#include <functional>
#include <vector>

#include "diagnosis/force_balance/balance_regression.hpp"
#include "diagnosis/force_balance_data/force_balance_laws.hpp"

namespace graybox {

struct RefinedLaw {
  PlacedLaw law;
  bool is_new = false;
  const MotionScale* scale = nullptr;  // of its place
  bool is_held = false;                // its shape stays as it is
};

// False if no refinement ended with finite values, or on request.
[[nodiscard]] bool refine_shapes(const ForceBalanceData& data, const BalanceProjection& projection,
                                 std::vector<RefinedLaw>& laws,
                                 const std::function<bool()>& keep_going);

}  // namespace graybox
