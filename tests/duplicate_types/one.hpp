// One half of a broken pair for scripts/check_types: the class and the enum of two.hpp again.
#pragma once

namespace graybox {

struct Twice {
  double value = 0.0;
};
enum class Kind { kOne };

}  // namespace graybox
