#include "diagnosis/recording_files/gzip_text.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "problems/base/available_memory.hpp"
#include "problems/base/error.hpp"
#include "problems/files/input_file.hpp"

namespace graybox {
namespace {

constexpr std::size_t kChunk = std::size_t{1} << 16U;
constexpr int kGzipWindow = 15 + 16;  // the largest window, with a gzip header

class Inflater {
 public:
  explicit Inflater(std::string path) : path_(std::move(path)) {
    if (inflateInit2(&stream_, kGzipWindow) != Z_OK) fail("can't be unpacked: out of memory");
  }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;
  ~Inflater() { inflateEnd(&stream_); }

  // Adds what these bytes hold.
  void take(unsigned char* bytes, std::size_t count) {
    stream_.next_in = bytes;
    stream_.avail_in = static_cast<uInt>(count);
    while (stream_.avail_in > 0) {
      if (ended_) inflateReset(&stream_);  // another member
      ended_ = false;
      unpack();
    }
  }
  [[nodiscard]] std::string text() {
    if (!ended_) fail("ends early: the gzip file is truncated; copy it again");
    return std::move(text_);
  }

 private:
  [[noreturn]] void fail(const std::string& text) const {
    throw InputError(fmt::format("{}: {}", path_, text));
  }
  void unpack() {
    std::array<unsigned char, kChunk> chunk;
    do {
      stream_.next_out = chunk.data();
      stream_.avail_out = static_cast<uInt>(chunk.size());
      const int result = inflate(&stream_, Z_NO_FLUSH);
      if (result != Z_OK && result != Z_STREAM_END && result != Z_BUF_ERROR) {
        fail("is no gzip file, or damaged; copy it again");
      }
      add(chunk.data(), chunk.size() - stream_.avail_out);
      ended_ = result == Z_STREAM_END;
    } while (!ended_ && stream_.avail_out == 0);
  }
  void add(const unsigned char* bytes, std::size_t count) {
    if (text_.size() + count > text_.capacity()) {
      const std::size_t size = std::max(2 * text_.capacity(), kChunk);
      require_memory(size, path_ + ", unpacked,", "use a part of it or a larger machine");
      text_.reserve(size);
    }
    text_.append(reinterpret_cast<const char*>(bytes), count);
  }

  std::string path_;
  std::string text_;
  z_stream stream_{};
  bool ended_ = false;
};

}  // namespace

std::string unpacked_gzip(const std::string& path) {
  const InputFile file(path);
  Inflater inflater(path);
  std::array<unsigned char, kChunk> bytes;
  for (std::uint64_t at = 0; at < file.size(); at += bytes.size()) {
    const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(kChunk, file.size() - at));
    file.read(at, bytes.data(), count);
    inflater.take(bytes.data(), count);
  }
  return inflater.text();
}

}  // namespace graybox
