#include "problems/files/input_guard.hpp"

#include <mutex>
#include <set>
#include <utility>

namespace graybox {
namespace {

struct Guard {
  std::mutex mutex;
  bool active = false;
  std::set<std::pair<dev_t, ino_t>> files;
};

Guard& guard() {
  static Guard instance;
  return instance;
}

}  // namespace

void protect_inputs() {
  const std::scoped_lock lock(guard().mutex);
  guard().active = true;
}

void note_input(const std::string& path) {
  struct stat file {};
  if (stat(path.c_str(), &file) == 0) note_input(file);
}

void note_input(const struct stat& file) {
  if (!S_ISREG(file.st_mode)) return;
  const std::scoped_lock lock(guard().mutex);
  if (guard().active) guard().files.emplace(file.st_dev, file.st_ino);
}

bool is_protected_input(const struct stat& file) {
  const std::scoped_lock lock(guard().mutex);
  return guard().files.contains({file.st_dev, file.st_ino});
}

}  // namespace graybox
