// An answer about an information set, as a command prints it: with what reading changed of the set.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "problems/information/semidefinite_projection.hpp"

namespace graybox::cli {

// "set.h5: 7920 candidates, ..." and the note on what was changed, each with its newline.
[[nodiscard]] std::string set_headline(const ProjectedSet& read);

// One line of JSON.
void print_line(const ProjectedSet& read, nlohmann::ordered_json line);

// The line of JSON, or the text below the headline.
void print_answer(const ProjectedSet& read, bool json, nlohmann::ordered_json line,
                  const std::string& text);

}  // namespace graybox::cli
