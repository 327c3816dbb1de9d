// What `graybox` alone prints: the tasks in words, with one command each.
#pragma once

#include <string>

namespace graybox::cli {

[[nodiscard]] std::string task_list();

}  // namespace graybox::cli
