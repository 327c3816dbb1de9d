// Forces that do not act on free and periodic motion one by one (transients.hpp): those of the
// model itself, and laws beyond their mean slopes.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "diagnosis/free_motion/free_records.hpp"
#include "diagnosis/harmonic_balance/period_transform.hpp"

namespace graybox {

class FreeMotionForces {
 public:
  FreeMotionForces(const FreeMotionFrame& frame, const std::vector<FreePlant>& plants)
      : frame_(frame), plants_(plants) {}

  // What they add where the free motion of the last round meets the periodic one: free.own, and
  // what the outputs see of it. Cost: some thousand evaluations of the forces.
  void add_forces(FreeRecord& free) const;
  // free.own_seen, from free.own.
  void see_own_motion(FreeRecord& free) const;

 private:
  [[nodiscard]] Eigen::MatrixXcd coordinates_at_bins(const FreeRecord& free) const;
  [[nodiscard]] Eigen::MatrixXcd force_of(OwnForce* own, bool with_laws, const FreePlant& plant,
                                          const Eigen::MatrixXcd& coordinates,
                                          PeriodTransform& transform) const;

  const FreeMotionFrame& frame_;
  const std::vector<FreePlant>& plants_;
};

}  // namespace graybox
