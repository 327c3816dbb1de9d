// The fuzzer's entry. The environment variable GRAYBOX_FUZZ_READER names the reader (readers.hpp);
// scripts/fuzz sets it.
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include "tests/fuzz/readers.hpp"

namespace {

const graybox::fuzz::Reader& chosen_reader() {
  const char* name = std::getenv("GRAYBOX_FUZZ_READER");
  const auto* reader = graybox::fuzz::find_reader(name == nullptr ? "" : name);
  if (reader == nullptr) {
    std::fputs("set GRAYBOX_FUZZ_READER to one of:", stderr);
    for (const auto& each : graybox::fuzz::all_readers()) std::fprintf(stderr, " %s", each.name);
    std::fputs("\n", stderr);
    std::exit(2);
  }
  return *reader;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const graybox::fuzz::Workplace workplace(chosen_reader());
  workplace.read({reinterpret_cast<const char*>(data), size});
  return 0;
}
