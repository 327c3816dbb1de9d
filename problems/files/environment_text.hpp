// File names with variables of the environment in them.
#pragma once

#include <string>

namespace graybox {

class YamlField;

// The field's text with every ${NAME} replaced by the environment's value of NAME:
// "${GRAYBOX_RECORDINGS}/emps.mat". Throws InputError, with the place in the file, where a variable
// is not set or a brace is missing. Variables within values are left as they are.
[[nodiscard]] std::string with_environment(const YamlField& field);

}  // namespace graybox
