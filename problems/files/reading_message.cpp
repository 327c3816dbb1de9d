#include "problems/files/reading_message.hpp"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <utility>

namespace graybox {
namespace {

constexpr std::size_t kHugePageNumbers = (std::size_t{2} << 20) / sizeof(double);
constexpr std::size_t kBlock = 4 * kHugePageNumbers;
constexpr std::uint64_t kLongestText = std::uint64_t{1} << 30;

}  // namespace

void MessageWriter::bytes(const void* data, std::size_t count) const {
  const auto* next = static_cast<const char*>(data);
  while (count > 0) {
    const ssize_t sent = write(descriptor_, next, count);
    if (sent < 0 && errno == EINTR) continue;
    if (sent <= 0) _exit(1);
    next += sent;
    count -= static_cast<std::size_t>(sent);
  }
}

void MessageWriter::text(const std::string& value) {
  whole(value.size());
  bytes(value.data(), value.size());
}

void MessageWriter::texts(const std::vector<std::string>& values) {
  whole(values.size());
  for (const std::string& value : values) text(value);
}

// An array of this size begins at a huge page (aligned_array.cpp), and so does each block.
void MessageWriter::numbers(AlignedArray values) {
  const bool is_large = values.size() >= 2 * kHugePageNumbers;
  for (std::size_t first = 0; first < values.size(); first += kBlock) {
    const std::size_t count = std::min(kBlock, values.size() - first);
    numbers(values.data() + first, count);
    if (is_large && count == kBlock) {
      madvise(values.data() + first, count * sizeof(double), MADV_DONTNEED);
    }
  }
}

bool MessageReader::bytes(void* data, std::size_t count) const {
  auto* next = static_cast<char*>(data);
  while (count > 0) {
    const ssize_t got = read(descriptor_, next, std::min(count, std::size_t{1} << 30));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    next += got;
    count -= static_cast<std::size_t>(got);
  }
  return true;
}

bool MessageReader::text(std::string& value) const {
  std::uint64_t size = 0;
  if (!whole(size) || size > kLongestText) return false;
  value.resize(size);
  return bytes(value.data(), size);
}

bool MessageReader::texts(std::vector<std::string>& values) const {
  std::uint64_t size = 0;
  if (!whole(size)) return false;
  values.clear();
  for (std::uint64_t i = 0; i < size; ++i) {
    if (!text(values.emplace_back())) return false;
  }
  return true;
}

}  // namespace graybox
