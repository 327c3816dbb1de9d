// The readers of the project's file formats, by name, as the fuzzer and the replay of its corpus
// call them: any bytes give a result or an InputError of one line, never anything else.
#pragma once

#include <filesystem>
#include <span>
#include <string>

namespace graybox::fuzz {

struct Reader {
  const char* name;   // of the corpus' folder
  const char* input;  // name of the file that the bytes become
  void (*read)(const std::filesystem::path& file);
};

// Null if there is none of this name.
[[nodiscard]] const Reader* find_reader(const std::string& name);
[[nodiscard]] std::span<const Reader> all_readers();

// A folder for this process with the files that inputs refer to (tests/fuzz/companions).
class Workplace {
 public:
  explicit Workplace(const Reader& reader);
  Workplace(const Workplace&) = delete;
  Workplace& operator=(const Workplace&) = delete;
  ~Workplace();

  // Ends the program through an uncaught exception if the reader throws another one than it may.
  void read(std::span<const char> bytes) const;

 private:
  const Reader& reader_;
  std::filesystem::path folder_;
};

}  // namespace graybox::fuzz
