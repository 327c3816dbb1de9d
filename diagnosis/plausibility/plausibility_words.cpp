#include "diagnosis/plausibility/plausibility_words.hpp"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

namespace graybox {
namespace {

using Json = nlohmann::ordered_json;

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

}  // namespace

std::vector<std::string> plausibility_lines(std::span<const Implausibility> flaws) {
  std::vector<std::string> lines;
  for (const Implausibility& flaw : flaws) {
    lines.push_back(fmt::format("{}: {}. {}", flaw.excludes ? "Implausible" : "Not determined",
                                flaw.words, flaw.remedy));
  }
  return lines;
}

Json plausibility_json(std::span<const Implausibility> flaws) {
  Json list = Json::array();
  for (const Implausibility& flaw : flaws) {
    list.push_back({{"rule", name_of(flaw.rule)},
                    {"quantity", flaw.quantity},
                    {"value", number(flaw.value)},
                    {"standard_errors", number(flaw.standard_errors)},
                    {"excludes", flaw.excludes},
                    {"words", flaw.words},
                    {"remedy", flaw.remedy}});
  }
  return list;
}

}  // namespace graybox
