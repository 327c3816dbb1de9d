// AtomicFile: a file appears under its name complete or not at all. Data go to a temporary file in
// the same folder, which is renamed over the name by commit(); an exception, a full disk or Ctrl-C
// leaves an older file of that name as it was. File and folder are on the disk when commit()
// returns: a power cut after it loses nothing.
//
//   graybox::AtomicFile file("design.json");
//   std::ofstream(file.temporary()) << text;
//   file.commit();
//
// Libraries that open files by name (HDF5, matio) write to temporary() likewise.
//
// A symbolic link stays, and the file that it names is replaced. What is no regular file
// (/dev/null, a pipe, `>(command)`) is written to, and so is a file that the command's standard
// output goes to. An input of the same command is refused (input_guard.hpp). Temporary files of
// killed runs are removed by the next run that writes into the folder (temporary_name.hpp).
#pragma once

#include <string>
#include <string_view>

namespace graybox {

class AtomicFile {
 public:
  // Throws InputError if the folder does not exist or can't be written, or the name is an input's.
  explicit AtomicFile(std::string path);
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;
  ~AtomicFile();  // removes the temporary file unless committed

  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] const std::string& temporary() const { return temporary_; }

  // Puts the file in its place. Throws InputError if that fails.
  void commit();

 private:
  [[noreturn]] void fail(const char* reason) const;
  void find_target();
  void make_temporary();
  void sync_temporary() const;
  void replace_target();
  void write_through() const;

  std::string path_;    // as it was named
  std::string target_;  // after symbolic links
  std::string temporary_;
  unsigned mode_ = 0;     // permissions of the file that is replaced; 0: there is none
  bool through_ = false;  // the target is written to, not replaced
  bool committed_ = false;
};

// Throws as the constructor of AtomicFile does; for commands, before hours of work.
void require_writable(const std::string& path);

// Writes a whole text file that way.
void write_text_file(const std::string& path, std::string_view text);

}  // namespace graybox
