// The fields of a JSON file, one by one. A field that is missing is empty. One of another kind is
// an InputError that names file and field.
//
//   const JsonFields fields("design.json");
//   const auto root = read_json_file<nlohmann::ordered_json>("design.json");
//   fields.number(root, "", "seconds")  // 0.31, or nothing
//   fields.fail("support is missing");  // "design.json: support is missing"
#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

namespace graybox {

// `where` is what a message writes before the key, "counters.".
class JsonFields {
 public:
  using Json = nlohmann::ordered_json;

  explicit JsonFields(std::string path);

  // Throws InputError; the path begins the message.
  [[noreturn]] void fail(const std::string& problem) const;

  [[nodiscard]] std::string text(const Json& parent, const char* key) const;
  // The object itself, empty where there is none.
  [[nodiscard]] Json object(const Json& parent, const char* key) const;
  [[nodiscard]] std::optional<double> number(const Json& parent, const char* where,
                                             const char* key) const;
  [[nodiscard]] std::vector<double> numbers(const Json& parent, const char* where,
                                            const char* key) const;
  [[nodiscard]] std::vector<std::size_t> indices(const Json& parent, const char* where,
                                                 const char* key) const;

  // The field "index" of a list's entry; nothing where it is no integer from 0 to count - 1.
  [[nodiscard]] static std::optional<std::size_t> index_below(const Json& entry, std::size_t count);

 private:
  template <typename Number>
  [[nodiscard]] std::vector<Number> array(const Json& parent, const char* where,
                                          const char* key) const;

  std::string path_;
};

}  // namespace graybox
