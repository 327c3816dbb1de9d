#include "problems/files/atomic_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/files/files_together.hpp"
#include "problems/files/input_guard.hpp"
#include "problems/files/temporary_name.hpp"

namespace graybox {
namespace {

namespace fs = std::filesystem;

constexpr int kMostLinks = 40;

// A descriptor, closed at the end of its scope.
class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() { close(); }
  operator int() const { return number_; }  // NOLINT: system calls take it as it is
  [[nodiscard]] bool valid() const { return number_ >= 0; }
  // 0, or -1 with errno: on a network disk this is where a full one shows.
  int close() { return number_ >= 0 ? ::close(std::exchange(number_, -1)) : 0; }

 private:
  int number_;
};

bool same_file(const struct stat& a, const struct stat& b) {
  return a.st_dev == b.st_dev && a.st_ino == b.st_ino;
}

// Standard output or error that goes to this file; -1 if neither does.
int stream_into(const struct stat& file) {
  for (const int stream : {STDOUT_FILENO, STDERR_FILENO}) {
    struct stat status {};
    if (fstat(stream, &status) == 0 && same_file(status, file)) return stream;
  }
  return -1;
}

std::string follow_links(const std::string& path) {
  fs::path target = path;
  for (int links = 0; links < kMostLinks; ++links) {
    std::error_code error;
    const fs::path next = fs::read_symlink(target, error);
    if (error) return target.string();
    target = target.parent_path() / next;
  }
  return target.string();
}

// Results are as public as any other file of the user.
mode_t usual_mode() {
  const mode_t mask = umask(0);
  umask(mask);
  return 0666 & ~mask;
}

bool write_all(int descriptor, const char* bytes, std::size_t count) {
  while (count > 0) {
    const ssize_t written = write(descriptor, bytes, count);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    bytes += written;
    count -= static_cast<std::size_t>(written);
  }
  return true;
}

// Some file systems can't sync folders or special files; that is no failure of the disk.
bool sync_failed(int descriptor) {
  return fsync(descriptor) != 0 && errno != EINVAL && errno != ENOTSUP && errno != EROFS;
}

}  // namespace

AtomicFile::AtomicFile(std::string path) : path_(std::move(path)) {
  if (path_.empty()) throw InputError("the name of the file to write is empty");
  find_target();
  make_temporary();
}

AtomicFile::~AtomicFile() {
  if (!committed_) unlink(temporary_.c_str());
}

void AtomicFile::commit() {
  sync_temporary();
  if (through_) {
    write_through();
  } else {
    replace_target();
  }
}

void AtomicFile::fail(const char* reason) const {
  throw InputError(fmt::format("{}: can't be written: {}", path_, reason));
}

void AtomicFile::find_target() {
  target_ = follow_links(path_);
  struct stat status {};
  if (stat(path_.c_str(), &status) != 0) {
    if (errno != ENOENT) fail(std::strerror(errno));
    return;
  }
  if (S_ISDIR(status.st_mode)) {
    throw InputError(fmt::format("{}: is a folder; name a file in it", path_));
  }
  if (is_protected_input(status)) {
    throw InputError(
        fmt::format("{}: is an input of this command, too; write to another file", path_));
  }
  through_ = !S_ISREG(status.st_mode) || stream_into(status) >= 0;
  mode_ = (status.st_mode & 0777U) | S_IRUSR | S_IWUSR;
}

void AtomicFile::make_temporary() {
  std::error_code error;
  const fs::path place = through_ ? fs::temp_directory_path(error) / "output" : fs::path(target_);
  if (error) fail("the folder for temporary files is missing; set TMPDIR");
  remove_leftovers(place.parent_path());
  temporary_ = temporary_pattern(place);
  const Descriptor file(mkstemps(temporary_.data(), kTemporaryEnding));
  if (!file.valid()) fail(std::strerror(errno));
  if (fchmod(file, mode_ != 0 ? mode_ : usual_mode()) != 0) {
    const int reason = errno;
    unlink(temporary_.c_str());
    fail(std::strerror(reason));
  }
}

void AtomicFile::sync_temporary() const {
  const Descriptor file(open(temporary_.c_str(), O_RDONLY | O_CLOEXEC));
  if (!file.valid() || sync_failed(file)) fail(std::strerror(errno));
}

void AtomicFile::replace_target() {
  committed_ = FilesTogether::take(temporary_, target_, path_);
  if (committed_) return;
  const int reason = put_in_place(temporary_, target_);
  committed_ = !fs::exists(temporary_);
  if (reason != 0) fail(std::strerror(reason));
}

// The temporary file stays for the destructor.
void AtomicFile::write_through() const {
  struct stat status {};
  const int stream = stat(path_.c_str(), &status) == 0 ? stream_into(status) : -1;
  std::fflush(nullptr);  // what was printed before comes before
  Descriptor out(stream >= 0 ? fcntl(stream, F_DUPFD_CLOEXEC, 0)
                             : open(path_.c_str(), O_WRONLY | O_NOCTTY | O_CLOEXEC));
  const Descriptor in(open(temporary_.c_str(), O_RDONLY | O_CLOEXEC));
  if (!out.valid() || !in.valid()) fail(std::strerror(errno));
  std::array<char, 1 << 16> block{};
  for (ssize_t got = 0; (got = read(in, block.data(), block.size())) != 0;) {
    if (got < 0 && errno == EINTR) continue;
    if (got < 0 || !write_all(out, block.data(), static_cast<std::size_t>(got))) {
      fail(std::strerror(errno));
    }
  }
  if (out.close() != 0) fail(std::strerror(errno));
}

void require_writable(const std::string& path) { const AtomicFile writable(path); }

void write_text_file(const std::string& path, std::string_view text) {
  AtomicFile file(path);
  {
    std::ofstream stream(file.temporary(), std::ios::binary);
    stream.write(text.data(), static_cast<std::streamsize>(text.size()));
    stream.close();
    if (!stream) throw InputError(fmt::format("{}: can't be written: disk full?", path));
  }
  file.commit();
}

}  // namespace graybox
