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

  // Of faults that data show by themselves (data_faults.hpp, motion_pairs.hpp) also:
  std::string channel = {};         // whose samples these are
  std::optional<double> time = {};  // s, of the first sample that is wrong
  double strength = 0.0;            // evidence over its threshold: how sure; 0: no matter of degree
  std::string otherwise = {};       // what else it could be
  std::string mend = {};            // line of campaign.yaml that mends it
};

}  // namespace graybox
