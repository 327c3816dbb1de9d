// What can't be of a model, in words and as JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/plausibility/plausibility.hpp"

namespace graybox {

// One line each: what no machine has, by how much, and what that usually means.
[[nodiscard]] std::vector<std::string> plausibility_lines(std::span<const Implausibility> flaws);

// [{"rule", "quantity", "value", "standard_errors", "excludes", "words", "remedy"}]
[[nodiscard]] nlohmann::ordered_json plausibility_json(std::span<const Implausibility> flaws);

}  // namespace graybox
