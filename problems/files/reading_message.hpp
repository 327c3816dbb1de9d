// What a process that reads a file sends to the process that asked for it (reading_process.hpp):
// whole numbers, texts and arrays, one after the other, in the machine's own byte order.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "problems/base/aligned_array.hpp"

namespace graybox {

// How an answer begins.
enum class ReadingStatus : std::uint64_t {
  kRead = 1,     // the contents follow
  kRefused = 2,  // the text of an InputError follows
  kDamaged = 3,  // any other failure, of memory among them; nothing follows
};

// The child's end. Ends the process if nobody listens any more.
class MessageWriter {
 public:
  explicit MessageWriter(int descriptor) : descriptor_(descriptor) {}

  void whole(std::uint64_t value) { bytes(&value, sizeof value); }
  void text(const std::string& value);
  void texts(const std::vector<std::string>& values);
  void numbers(const double* values, std::size_t count) { bytes(values, count * sizeof(double)); }
  // Gives the memory back while it is sent, so that two processes don't hold all of it.
  void numbers(AlignedArray values);

 private:
  void bytes(const void* data, std::size_t count) const;

  int descriptor_;
};

// The parent's end. False if the answer ends early, or a length is absurd.
class MessageReader {
 public:
  explicit MessageReader(int descriptor) : descriptor_(descriptor) {}

  [[nodiscard]] bool whole(std::uint64_t& value) const { return bytes(&value, sizeof value); }
  [[nodiscard]] bool text(std::string& value) const;
  [[nodiscard]] bool texts(std::vector<std::string>& values) const;
  [[nodiscard]] bool numbers(double* values, std::size_t count) const {
    return bytes(values, count * sizeof(double));
  }

 private:
  bool bytes(void* data, std::size_t count) const;

  int descriptor_;
};

}  // namespace graybox
