// Reading of JSON files: every failure is an InputError of one line that names the file and, for a
// number that no double holds, the field.
//
//   const auto root = read_json_file<nlohmann::json>("design.json");
//   // "design.json: support[3].weight: the number 1E1000 is too large; ..."
//
// Json is nlohmann::json or nlohmann::ordered_json. What the file must hold is the caller's matter.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

namespace graybox {

// Throws InputError where the file is missing, a folder, empty or not JSON.
template <typename Json>
[[nodiscard]] Json read_json_file(const std::string& path);

// The same of a text; `path` begins the message.
template <typename Json>
[[nodiscard]] Json parse_json(std::string_view text, const std::string& path);

}  // namespace graybox
