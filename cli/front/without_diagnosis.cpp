#include <algorithm>
#include <iterator>
#include <string_view>

#include "cli/front/diagnosis_commands.hpp"

namespace graybox::cli {
namespace {

constexpr std::string_view kAbsent[] = {
    "simulate", "recordings", "responses",         "fit",          "predict", "model", "diagnose",
    "export",   "challenge",  "design sequential", "design verify"};

}  // namespace

void add_diagnosis_commands(CLI::App& /*app*/, Invocation& /*invocation*/) {}

std::string reason_for_absence(const std::string& command) {
  if (std::ranges::find(kAbsent, command) == std::end(kAbsent)) return {};
  return "'" + command +
         "' is not in this program: it was built without the diagnosis; build it again with "
         "-DGRAYBOX_WITH_DIAGNOSIS=ON";
}

}  // namespace graybox::cli
