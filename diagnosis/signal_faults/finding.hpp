// What a check of a recording found.
#pragma once

#include <optional>
#include <string>

namespace graybox {

enum class Severity {
  kWarning,  // the recording can be used; a person should know
  kError     // the recording can't be used as it is
};

struct Finding {
  Severity severity;
  std::string check;    // "time", "not a number", "clipped", ...: one word or two
  std::string message;  // one line: what, where, and what to do

  // Faults that data show by themselves (data_faults.hpp, motion_pairs.hpp) have these, too.
  std::string channel = {};         // whose samples these are
  std::optional<double> time = {};  // s, of the first sample that is wrong
  double strength = 0.0;            // evidence over its threshold: how sure; 0: no matter of degree
  std::string otherwise = {};       // what else it could be
  std::string mend = {};            // line of campaign.yaml that mends it
};

// A warning about data that show their fault: `what`, then how sure that is, what else it could be
// and what mends it, in one line.
[[nodiscard]] Finding data_fault(const char* check, const std::string& channel,
                                 const std::string& what, double strength, std::string otherwise,
                                 std::string mend);

}  // namespace graybox
