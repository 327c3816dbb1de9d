#include "bench/challenge/confinement.hpp"

#if defined(__linux__) && __has_include(<linux/landlock.h>)
#define GRAYBOX_HAS_LANDLOCK 1
#include <fcntl.h>
#include <linux/landlock.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cstdint>
#endif

namespace graybox::bench {

std::vector<std::filesystem::path> system_paths() {
  return {"/usr", "/bin", "/lib", "/lib64", "/etc", "/dev", "/proc", "/sys", "/opt"};
}

#ifdef GRAYBOX_HAS_LANDLOCK

namespace {

constexpr std::uint64_t kReadFile = LANDLOCK_ACCESS_FS_READ_FILE | LANDLOCK_ACCESS_FS_EXECUTE;
constexpr std::uint64_t kRead = kReadFile | LANDLOCK_ACCESS_FS_READ_DIR;
constexpr std::uint64_t kChange = LANDLOCK_ACCESS_FS_MAKE_REG | LANDLOCK_ACCESS_FS_MAKE_DIR |
                                  LANDLOCK_ACCESS_FS_MAKE_SYM | LANDLOCK_ACCESS_FS_REMOVE_FILE |
                                  LANDLOCK_ACCESS_FS_REMOVE_DIR;
constexpr std::uint64_t kWrite = kRead | LANDLOCK_ACCESS_FS_WRITE_FILE | kChange;

class Descriptor {
 public:
  explicit Descriptor(long value) : value_(static_cast<int>(value)) {}
  ~Descriptor() {
    if (value_ >= 0) close(value_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  [[nodiscard]] int value() const { return value_; }

 private:
  int value_;
};

bool allow(const Descriptor& rules, const std::filesystem::path& path, std::uint64_t access) {
  const Descriptor file(open(path.c_str(), O_PATH | O_CLOEXEC));
  if (file.value() < 0) return true;
  struct stat status {};
  if (fstat(file.value(), &status) != 0) return false;
  if (!S_ISDIR(status.st_mode)) access &= kReadFile | LANDLOCK_ACCESS_FS_WRITE_FILE;
  landlock_path_beneath_attr beneath{};
  beneath.allowed_access = access;
  beneath.parent_fd = file.value();
  return syscall(SYS_landlock_add_rule, rules.value(), LANDLOCK_RULE_PATH_BENEATH, &beneath, 0) ==
         0;
}

}  // namespace

bool confine_thread(const OpenPaths& paths) {
  landlock_ruleset_attr handled{};
  handled.handled_access_fs = kWrite;
  // The first field is all that the oldest kernels with Landlock know.
  const Descriptor rules(
      syscall(SYS_landlock_create_ruleset, &handled, sizeof(handled.handled_access_fs), 0));
  if (rules.value() < 0) return false;
  for (const auto& path : paths.readable) {
    if (!allow(rules, path, kRead)) return false;
  }
  for (const auto& path : paths.writable) {
    if (!allow(rules, path, kWrite)) return false;
  }
  return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
         syscall(SYS_landlock_restrict_self, rules.value(), 0) == 0;
}

#else

bool confine_thread(const OpenPaths& /*paths*/) { return false; }

#endif

}  // namespace graybox::bench
