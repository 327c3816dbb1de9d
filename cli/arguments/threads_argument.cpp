#include "cli/arguments/threads_argument.hpp"

#include <algorithm>
#include <thread>

namespace graybox::cli {
namespace {

constexpr unsigned kMostThreads = 1024;  // as check_common_options() takes

}  // namespace

void add_threads(CLI::App& command, int& threads, const std::string& words) {
  threads = static_cast<int>(std::clamp(std::thread::hardware_concurrency(), 1U, kMostThreads));
  command.add_option("--threads", threads, words)->default_str("all cores");
}

}  // namespace graybox::cli
