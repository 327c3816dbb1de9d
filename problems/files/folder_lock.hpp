// One run at a time in a folder of results.
//
//   const graybox::FolderLock lock(folder);   // makes the folder; held to the end of the scope
//
// The lock is the system's (flock on the folder): it ends with the process, however that ends, and
// leaves no file. File systems without such locks are written to without one.
#pragma once

#include <filesystem>

namespace graybox {

class FolderLock {
 public:
  // Throws InputError where the folder can't be made, or another run holds it. Removes what killed
  // runs left in it (temporary_name.hpp).
  explicit FolderLock(const std::filesystem::path& folder);
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;
  ~FolderLock();

 private:
  int descriptor_ = -1;
};

}  // namespace graybox
