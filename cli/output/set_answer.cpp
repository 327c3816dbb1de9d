#include "cli/output/set_answer.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <utility>

#include "cli/arguments/set_arguments.hpp"
#include "cli/output/console.hpp"

namespace graybox::cli {

std::string set_headline(const ProjectedSet& read) {
  return fmt::format("{}: {}\n{}", read.set.name(), describe(read.set), change_note(read.changed));
}

void print_line(const ProjectedSet& read, nlohmann::ordered_json line) {
  add_change(read.changed, line);
  fmt::print("{}\n", line.dump());
}

void print_answer(const ProjectedSet& read, bool json, nlohmann::ordered_json line,
                  const std::string& text) {
  if (json) {
    print_line(read, std::move(line));
  } else {
    fmt::print("{}{}", set_headline(read), text);
  }
}

}  // namespace graybox::cli
