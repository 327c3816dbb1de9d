#include "diagnosis/signal_faults/finding.hpp"

#include <fmt/format.h>

#include <utility>

namespace graybox {
namespace {

constexpr double kMuch = 99.0;  // thresholds

}  // namespace

Finding data_fault(const char* check, const std::string& channel, const std::string& what,
                   double strength, std::string otherwise, std::string mend) {
  Finding finding{.severity = Severity::kWarning,
                  .check = check,
                  .message = fmt::format("{} {} times the threshold; could also be {}; {}", what,
                                         strength < kMuch ? fmt::format("{:.2g}", strength)
                                                          : fmt::format("more than {:g}", kMuch),
                                         otherwise, mend)};
  finding.channel = channel;
  finding.strength = strength;
  finding.otherwise = std::move(otherwise);
  finding.mend = std::move(mend);
  return finding;
}

}  // namespace graybox
