#include "problems/formats/hdf5_writer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/program_version.hpp"
#include "problems/files/atomic_file.hpp"

namespace graybox::hdf5 {
namespace {

// Texts one after the other, each filled up with zeros to one more than the longest.
class FixedTexts {
 public:
  explicit FixedTexts(const std::vector<std::string>& texts) : type_(H5Tcopy(H5T_C_S1), H5Tclose) {
    std::size_t longest = 0;
    for (const std::string& text : texts) longest = std::max(longest, text.size());
    bytes_.assign(std::max<std::size_t>(1, texts.size()) * (longest + 1), '\0');
    for (std::size_t i = 0; i < texts.size(); ++i) {
      std::ranges::copy(texts[i], bytes_.begin() + static_cast<std::ptrdiff_t>(i * (longest + 1)));
    }
    H5Tset_size(type_, longest + 1);
    H5Tset_cset(type_, H5T_CSET_UTF8);
  }
  [[nodiscard]] hid_t type() const { return type_; }
  [[nodiscard]] const void* bytes() const { return bytes_.data(); }

 private:
  Handle type_;
  std::vector<char> bytes_;
};

hid_t list_of(hsize_t size) { return H5Screate_simple(1, &size, nullptr); }

}  // namespace

Writer::Writer(std::string path) : path_(std::move(path)) {}

void Writer::check(herr_t status) const {
  if (status < 0) throw InputError(fmt::format("{}: can't be written: disk full?", path_));
}

void Writer::attribute(hid_t object, const char* name, hid_t type, hid_t space,
                       const void* values) const {
  const Handle attribute(H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  check(attribute.valid() ? 0 : -1);
  check(H5Awrite(attribute, type, values));
}

void Writer::attribute(hid_t object, const char* name, const std::string& text) const {
  const FixedTexts fixed({text});
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  attribute(object, name, fixed.type(), space, fixed.bytes());
}

void Writer::attribute(hid_t object, const char* name,
                       const std::vector<std::string>& texts) const {
  const FixedTexts fixed(texts);
  const Handle space(list_of(texts.size()), H5Sclose);
  attribute(object, name, fixed.type(), space, fixed.bytes());
}

void Writer::attribute(hid_t object, const char* name, double number) const {
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle attribute(H5Acreate2(object, name, H5T_IEEE_F64LE, space, H5P_DEFAULT, H5P_DEFAULT),
                         H5Aclose);
  check(H5Awrite(attribute, H5T_NATIVE_DOUBLE, &number));
}

void Writer::attribute(hid_t object, const char* name, const std::vector<double>& numbers) const {
  const Handle space(list_of(numbers.size()), H5Sclose);
  const Handle attribute(H5Acreate2(object, name, H5T_IEEE_F64LE, space, H5P_DEFAULT, H5P_DEFAULT),
                         H5Aclose);
  check(attribute.valid() ? 0 : -1);
  if (!numbers.empty()) check(H5Awrite(attribute, H5T_NATIVE_DOUBLE, numbers.data()));
}

Handle Writer::dataset(hid_t parent, const char* name, const std::vector<hsize_t>& shape,
                       const double* numbers) const {
  const Handle space(H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr),
                     H5Sclose);
  const Handle timeless(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  check(H5Pset_obj_track_times(timeless, false));
  const hid_t dataset =
      H5Dcreate2(parent, name, H5T_IEEE_F64LE, space, H5P_DEFAULT, timeless, H5P_DEFAULT);
  check(dataset < 0 ? -1
                    : H5Dwrite(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, numbers));
  return {dataset, H5Dclose};
}

void Writer::dataset(hid_t parent, const char* name, const std::vector<std::string>& texts) const {
  const FixedTexts fixed(texts);
  const Handle space(list_of(texts.size()), H5Sclose);
  const Handle timeless(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  check(H5Pset_obj_track_times(timeless, false));
  const Handle dataset(
      H5Dcreate2(parent, name, fixed.type(), space, H5P_DEFAULT, timeless, H5P_DEFAULT), H5Dclose);
  check(H5Dwrite(dataset, fixed.type(), H5S_ALL, H5S_ALL, H5P_DEFAULT, fixed.bytes()));
}

Handle Writer::group(hid_t parent, const char* name) const {
  const hid_t group = H5Gcreate2(parent, name, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  check(group < 0 ? -1 : 0);
  return {group, H5Gclose};
}

void write_file(const std::string& path,
                const std::function<void(const Writer& writer, hid_t file)>& contents) {
  const QuietErrors quiet;
  const Writer writer(path);
  AtomicFile target(path);
  const hid_t file = H5Fcreate(target.temporary().c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  if (file < 0) throw InputError(fmt::format("{}: can't be written", path));
  try {
    writer.attribute(file, "written_by", written_by());
    contents(writer, file);
    writer.check(H5Fflush(file, H5F_SCOPE_LOCAL));
  } catch (...) {
    H5Fclose(file);
    throw;
  }
  writer.check(H5Fclose(file));
  target.commit();
}

}  // namespace graybox::hdf5
