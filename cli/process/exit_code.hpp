// What the program ends with.
#pragma once

namespace graybox::cli {

inline constexpr int kDone = 0;
inline constexpr int kShort = 1;     // a numerical outcome short of what was asked
inline constexpr int kBadInput = 2;  // bad input or usage

}  // namespace graybox::cli
