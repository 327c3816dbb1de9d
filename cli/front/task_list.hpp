// The tasks that graybox is for, in words: with one command each where it is called alone, and as
// headings of the commands in its help.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace graybox::cli {

[[nodiscard]] std::string task_list();

// Puts each command of `app` into the group of its task, and adds examples.
void group_by_task(CLI::App& app);

}  // namespace graybox::cli
