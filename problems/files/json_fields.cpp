#include "problems/files/json_fields.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <type_traits>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/files/file_message.hpp"

namespace graybox {

JsonFields::JsonFields(std::string path) : path_(std::move(path)) {}

void JsonFields::fail(const std::string& problem) const {
  throw InputError(in_file(path_, problem));
}

std::string JsonFields::text(const Json& parent, const char* key) const {
  const auto found = parent.find(key);
  if (found == parent.end() || found->is_null()) return {};
  if (!found->is_string()) fail(fmt::format("{} must be text", key));
  return found->get<std::string>();
}

JsonFields::Json JsonFields::object(const Json& parent, const char* key) const {
  const auto found = parent.find(key);
  if (found == parent.end()) return Json::object();
  if (!found->is_object()) fail(fmt::format("{} must be an object", key));
  return *found;
}

std::optional<double> JsonFields::number(const Json& parent, const char* where,
                                         const char* key) const {
  const auto found = parent.find(key);
  if (found == parent.end() || found->is_null()) return std::nullopt;
  if (!found->is_number()) fail(fmt::format("{}{} must be a number", where, key));
  return found->get<double>();
}

template <typename Number>
std::vector<Number> JsonFields::array(const Json& parent, const char* where,
                                      const char* key) const {
  const auto found = parent.find(key);
  if (found == parent.end() || found->is_null()) return {};
  const auto fits = [](const Json& entry) {
    return std::is_integral_v<Number> ? entry.is_number_unsigned() : entry.is_number();
  };
  if (!found->is_array() || !std::ranges::all_of(*found, fits)) {
    fail(fmt::format("{}{} must be an array of {}", where, key,
                     std::is_integral_v<Number> ? "indices" : "numbers"));
  }
  return found->get<std::vector<Number>>();
}

std::vector<double> JsonFields::numbers(const Json& parent, const char* where,
                                        const char* key) const {
  return array<double>(parent, where, key);
}

std::vector<std::size_t> JsonFields::indices(const Json& parent, const char* where,
                                             const char* key) const {
  return array<std::size_t>(parent, where, key);
}

std::optional<std::size_t> JsonFields::index_below(const Json& entry, std::size_t count) {
  const auto index = entry.is_object() ? entry.find("index") : entry.end();
  if (index == entry.end() || !index->is_number_integer() || *index < 0 || *index >= count) {
    return std::nullopt;
  }
  return index->get<std::size_t>();
}

}  // namespace graybox
