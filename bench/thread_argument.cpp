#include "bench/thread_argument.hpp"

#include <algorithm>
#include <charconv>
#include <string_view>
#include <thread>

namespace graybox::bench {

int take_thread_count(int& argc, char** argv) {
  constexpr std::string_view kFlag = "--threads=";
  int threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  int kept = 1;
  for (int i = 1; i < argc; ++i) {
    const std::string_view argument = argv[i];
    if (!argument.starts_with(kFlag)) {
      argv[kept++] = argv[i];
      continue;
    }
    const std::string_view value = argument.substr(kFlag.size());
    threads = 0;
    std::from_chars(value.data(), value.data() + value.size(), threads);
  }
  argc = kept;
  return threads;
}

}  // namespace graybox::bench
