// The names of groups of options that several commands share, as --help prints them.
#pragma once

namespace graybox::cli {

inline constexpr const char* kReadingOptions = "How the set is read";
inline constexpr const char* kCriterionOptions = "What a criterion needs";
inline constexpr const char* kConstraintOptions = "What the next experiments have to obey";

}  // namespace graybox::cli
