// AtomicFile: a file appears under its name complete or not at all. Data go to a temporary file in
// the same folder, which is renamed over the name by commit(); an exception, a full disk or Ctrl-C
// leaves an older file of that name as it was.
//
//   graybox::AtomicFile file("design.json");
//   std::ofstream(file.temporary()) << text;
//   file.commit();
//
// Libraries that open files by name (HDF5, matio) write to temporary() likewise.
#pragma once

#include <string>
#include <string_view>

namespace graybox {

class AtomicFile {
 public:
  // Throws InputError if the folder does not exist or can't be written.
  explicit AtomicFile(std::string path);
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;
  ~AtomicFile();  // removes the temporary file unless committed

  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] const std::string& temporary() const { return temporary_; }

  // Renames. Throws InputError if that fails.
  void commit();

 private:
  std::string path_;
  std::string temporary_;
  bool committed_ = false;
};

// Writes a whole text file that way.
void write_text_file(const std::string& path, std::string_view text);

}  // namespace graybox
