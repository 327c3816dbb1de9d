// What the readers and writers of HDF5 files share (hdf5_file.cpp, mat73_file.cpp): identifiers
// that close themselves, text, and stacks of matrices, with every failure an InputError.
#pragma once

#include <hdf5.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "problems/base/aligned_array.hpp"
#include "problems/formats/stored_set.hpp"

namespace graybox::hdf5 {

// An HDF5 identifier, closed at the end of its scope.
class Handle {
 public:
  using Close = herr_t (*)(hid_t);
  Handle(hid_t id, Close close) : id_(id), close_(close) {}
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  operator hid_t() const { return id_; }  // NOLINT: HDF5 calls take it as it is
  [[nodiscard]] bool valid() const { return id_ >= 0; }

 private:
  hid_t id_;
  Close close_;
};

// HDF5 prints its own error stack to stderr unless told otherwise; ours is one line.
class QuietErrors {
 public:
  QuietErrors() {
    H5Eget_auto2(H5E_DEFAULT, &function_, &data_);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  QuietErrors(const QuietErrors&) = delete;
  QuietErrors& operator=(const QuietErrors&) = delete;
  ~QuietErrors() { H5Eset_auto2(H5E_DEFAULT, function_, data_); }

 private:
  H5E_auto2_t function_ = nullptr;
  void* data_ = nullptr;
};

[[nodiscard]] std::vector<hsize_t> shape_of(hid_t space);
[[nodiscard]] std::string shape_text(const std::vector<hsize_t>& shape);  // "[7920 x 78]"

// Attributes and datasets are read through different calls of the same form.
struct StringSource {
  hid_t id;
  herr_t (*read)(hid_t id, hid_t memory_type, void* buffer);
};
herr_t read_attribute(hid_t id, hid_t type, void* buffer);
herr_t read_dataset(hid_t id, hid_t type, void* buffer);

// Strings of fixed or variable length. `source` begins the error message.
[[nodiscard]] std::vector<std::string> read_strings(const std::string& source, StringSource from,
                                                    hid_t type, hid_t space);
// Empty if the attribute does not exist.
[[nodiscard]] std::vector<std::string> read_string_attribute(const std::string& source,
                                                             hid_t object, const char* name);

// What lies in one piece may stay in the file, however large (InputFile::numbers).
enum class Reading : std::int8_t { kAll, kPerhapsLeft };

struct Dataset {
  // Opens path:/name. Throws InputError if it can't be opened.
  Dataset(const std::string& path, hid_t file, const char* name);
  // Takes over an open identifier.
  Dataset(std::string source, hid_t dataset);

  // Throws InputError unless the numbers are floating point.
  void require_floats() const;
  // Throws InputError unless the file stores as much as the shape says, and, if all is to be read,
  // memory can hold it as float64. To be called before memory is taken.
  void require_stored(Reading reading = Reading::kAll) const;

  std::string source;  // "file: dataset name", for error messages
  Handle dataset;
  Handle type;
  Handle space;
  std::vector<hsize_t> shape;
};

[[noreturn]] void fail_truncated(const std::string& source);

// Rows of a dataset with two axes, checked by require_stored; left in the file if they lie there in
// one piece as float64.
[[nodiscard]] StoredNumbers stored_rows(const Dataset& table, std::size_t first, std::size_t count);

// [Q x d x d] to packed lower triangles, in blocks; checks what is stored, and symmetry.
[[nodiscard]] AlignedArray read_stack(const Dataset& stack, std::size_t& dimension);

}  // namespace graybox::hdf5
