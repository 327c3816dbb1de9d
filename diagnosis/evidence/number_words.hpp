// Numbers in sentences.
#pragma once

#include <string>

namespace graybox {

// Three significant digits, without a power of ten up to a million: 0.0123, 4.56, 1210.
[[nodiscard]] std::string three_digits(double value);

}  // namespace graybox
