// InputFile: a file open for reading whose every failure is an InputError with one clear line.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "problems/base/aligned_array.hpp"

namespace graybox {

// An input of the command (input_guard.hpp), or what it has written itself and will write again.
enum class InputUse { kInput, kOwnState };

class InputFile {
 public:
  // Throws InputError if the file is missing, a folder, unreadable or empty.
  explicit InputFile(std::string path, InputUse use = InputUse::kInput);
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;
  ~InputFile();

  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] std::uint64_t size() const { return size_; }

  // Reads exactly `count` bytes at `offset`. Throws InputError if the file ends before.
  void read(std::uint64_t offset, void* bytes, std::size_t count) const;

  // `count` float64 numbers at `offset`. In memory; where they would take more than half of what is
  // there, they stay in the file if they can (mapped_numbers.hpp), else InputError says how much is
  // missing.
  [[nodiscard]] AlignedArray numbers(std::uint64_t offset, std::size_t count) const;

  // The first bytes, at most `count`.
  [[nodiscard]] std::string head(std::size_t count) const;

 private:
  std::string path_;
  int descriptor_ = -1;
  std::uint64_t size_ = 0;
};

}  // namespace graybox
