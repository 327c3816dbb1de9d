// FilesTogether: the files that a command writes at its end appear together or not at all. While
// one exists, AtomicFile::commit() leaves a file complete beside its name, and commit() here puts
// all of them in their places. An exception on the way, as of a disk that is full at the second
// file, leaves every older file as it was. Devices and pipes are written to at once.
//
//   FilesTogether files;
//   write_design(...);   // AtomicFile
//   write_page(...);     // may throw
//   files.commit();
//
// For one thread and one at a time; not for files that a run goes on from (checkpoints).
#pragma once

#include <string>
#include <vector>

namespace graybox {

class FilesTogether {
 public:
  FilesTogether();
  FilesTogether(const FilesTogether&) = delete;
  FilesTogether& operator=(const FilesTogether&) = delete;
  ~FilesTogether();  // removes what was not committed

  // Throws InputError naming the file that can't be put in its place.
  void commit();

  // For AtomicFile: takes over the temporary file if one exists. `path`: for messages.
  static bool take(const std::string& temporary, const std::string& target,
                   const std::string& path);

 private:
  struct Waiting {
    std::string temporary, target, path;
  };
  std::vector<Waiting> waiting_;
};

// Renames over the target and syncs its folder: 0 or errno.
[[nodiscard]] int put_in_place(const std::string& temporary, const std::string& target);

}  // namespace graybox
