#include "diagnosis/hypotheses/checked_range.hpp"

#include <fmt/format.h>

namespace graybox {

std::string CheckedRange::Standing::drive_words() const {
  return fmt::format("{:.3g} to {:.3g} {}", drive.lowest, drive.highest, unit);
}

}  // namespace graybox
