// The commit that this build is of (cmake/GrayboxCommit.cmake writes the definition).
#pragma once

namespace graybox::cli {

extern const char* const kBuildCommit;

}  // namespace graybox::cli
