// Speeds that turn round between two samples: impacts, as on an end stop. No counter does that.
//
// Rule: a step from v to v' of the other sign, at least a quarter of the range of all values and 8
// times what 95 % of all steps keep below, with |v'| at least a tenth of |v|. Both last: the sample
// before v has the sign of v, and the one after v' that of v'. None below 100 samples or of at most
// 16 levels (a direction). Cost: O(n).
#pragma once

#include <Eigen/Core>
#include <optional>

namespace graybox {

struct SpeedImpacts {
  Eigen::Index first;  // sample after the first
  std::size_t count;
  double largest;   // step
  double strength;  // largest step over its threshold
};

[[nodiscard]] std::optional<SpeedImpacts> find_speed_impacts(
    const Eigen::Ref<const Eigen::VectorXd>& velocity);

}  // namespace graybox
