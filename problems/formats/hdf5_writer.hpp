// What the writers of HDF5 files share. Files of equal contents are equal bytes: nothing has a
// time, and text has a fixed length (the longest string's, UTF-8, ended by a zero). Every failure
// of the library is an InputError, also one that shows when the file is closed.
#pragma once

#include <hdf5.h>

#include <functional>
#include <string>
#include <vector>

#include "problems/formats/hdf5_support.hpp"

namespace graybox::hdf5 {

class Writer {
 public:
  explicit Writer(std::string path);  // for messages

  void check(herr_t status) const;

  // Attributes: one text, a list of texts, one number, a list of numbers.
  void attribute(hid_t object, const char* name, const std::string& text) const;
  void attribute(hid_t object, const char* name, const std::vector<std::string>& texts) const;
  void attribute(hid_t object, const char* name, double number) const;
  void attribute(hid_t object, const char* name, const std::vector<double>& numbers) const;

  // Numbers in row-major order. The dataset comes back open, for its attributes.
  [[nodiscard]] Handle dataset(hid_t parent, const char* name, const std::vector<hsize_t>& shape,
                               const double* numbers) const;
  void dataset(hid_t parent, const char* name, const std::vector<std::string>& texts) const;
  [[nodiscard]] Handle group(hid_t parent, const char* name) const;

 private:
  void attribute(hid_t object, const char* name, hid_t type, hid_t space, const void* values) const;
  std::string path_;
};

// Makes the file with the attribute `written_by`, lets `contents` fill it and puts it in its place.
void write_file(const std::string& path,
                const std::function<void(const Writer& writer, hid_t file)>& contents);

}  // namespace graybox::hdf5
