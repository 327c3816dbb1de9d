#include "problems/files/environment_text.hpp"

#include <fmt/format.h>

#include <cstdlib>

#include "problems/files/yaml_field.hpp"

namespace graybox {

std::string with_environment(const YamlField& field) {
  const std::string text = field.text();
  std::string result;
  std::size_t after = 0;  // of what has been taken over
  for (std::size_t begin = 0; (begin = text.find("${", after)) != std::string::npos;) {
    const std::size_t end = text.find('}', begin);
    if (end == std::string::npos) field.fail("'${' without '}'");
    const std::string name = text.substr(begin + 2, end - begin - 2);
    const char* value = std::getenv(name.c_str());
    if (value == nullptr || *value == '\0') {
      field.fail(fmt::format("the environment variable {} is not set; set it to a folder", name));
    }
    result += text.substr(after, begin - after) + value;
    after = end + 1;
  }
  return result + text.substr(after);
}

}  // namespace graybox
