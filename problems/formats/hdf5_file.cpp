#include "graybox/problems/formats/hdf5_file.hpp"

#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "graybox/problems/error.hpp"
#include "graybox/problems/formats/atomic_file.hpp"
#include "graybox/problems/formats/symmetric_packer.hpp"
#include "graybox/problems/packed_matrix.hpp"

namespace graybox {
namespace {

constexpr const char* kFormat = "graybox-information-set/1";

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

std::vector<hsize_t> shape_of(hid_t space) {
  const int rank = H5Sget_simple_extent_ndims(space);
  std::vector<hsize_t> shape(static_cast<std::size_t>(std::max(rank, 0)));
  if (rank > 0) H5Sget_simple_extent_dims(space, shape.data(), nullptr);
  return shape;
}

std::string shape_text(const std::vector<hsize_t>& shape) {
  return fmt::format("[{}]", fmt::join(shape, " x "));
}

// ---- strings -----------------------------------------------------------------------------------

// Attributes and datasets are read through different calls of the same form.
struct StringSource {
  hid_t id;
  herr_t (*read)(hid_t id, hid_t memory_type, void* buffer);
};

herr_t read_attribute(hid_t id, hid_t type, void* buffer) { return H5Aread(id, type, buffer); }
herr_t read_dataset(hid_t id, hid_t type, void* buffer) {
  return H5Dread(id, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, buffer);
}

std::vector<std::string> read_strings(const std::string& source, StringSource from, hid_t type,
                                      hid_t space) {
  const auto fail = [&] { throw InputError(source + ": expected text; write it as strings"); };
  if (H5Tget_class(type) != H5T_STRING) fail();
  const hssize_t points = H5Sget_simple_extent_npoints(space);
  const auto count = static_cast<std::size_t>(std::max<hssize_t>(points, 0));
  std::vector<std::string> strings;
  if (count == 0) return strings;
  const Handle memory_type(H5Tcopy(type), H5Tclose);  // keeps size, padding and character set
  if (H5Tis_variable_str(type) > 0) {
    std::vector<char*> pointers(count, nullptr);
    if (from.read(from.id, memory_type, pointers.data()) < 0) fail();
    for (const char* text : pointers) strings.emplace_back(text == nullptr ? "" : text);
    H5Dvlen_reclaim(memory_type, space, H5P_DEFAULT, pointers.data());
    return strings;
  }
  const std::size_t size = H5Tget_size(type);
  std::vector<char> bytes(count * size);
  if (from.read(from.id, memory_type, bytes.data()) < 0) fail();
  for (std::size_t i = 0; i < count; ++i) {
    std::string text(bytes.data() + i * size, size);
    text.resize(std::min(text.find('\0'), text.size()));
    text.resize(text.find_last_not_of(' ') + 1);
    strings.push_back(std::move(text));
  }
  return strings;
}

// Empty if the attribute does not exist.
std::vector<std::string> read_string_attribute(const std::string& source, hid_t object,
                                               const char* name) {
  if (H5Aexists(object, name) <= 0) return {};
  const Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose);
  const Handle type(H5Aget_type(attribute), H5Tclose);
  const Handle space(H5Aget_space(attribute), H5Sclose);
  return read_strings(fmt::format("{}: attribute {}", source, name), {attribute, &read_attribute},
                      type, space);
}

std::vector<const char*> c_strings(const std::vector<std::string>& strings) {
  std::vector<const char*> pointers;
  for (const std::string& text : strings) pointers.push_back(text.c_str());
  return pointers;
}

hid_t utf8_strings() {
  const hid_t type = H5Tcopy(H5T_C_S1);
  H5Tset_size(type, H5T_VARIABLE);
  H5Tset_cset(type, H5T_CSET_UTF8);
  return type;
}

// ---- reading -----------------------------------------------------------------------------------

struct OpenDataset {
  OpenDataset(const std::string& path, hid_t file, const char* name)
      : source(fmt::format("{}: dataset {}", path, name)),
        dataset(H5Dopen2(file, name, H5P_DEFAULT), H5Dclose),
        type(H5Dget_type(dataset), H5Tclose),
        space(H5Dget_space(dataset), H5Sclose),
        shape(shape_of(space)) {
    if (!dataset.valid()) {
      throw InputError(
          fmt::format("{}: can't be opened; is it a dataset of an intact file?", source));
    }
  }

  void require_floats() const {
    if (H5Tget_class(type) == H5T_FLOAT) return;
    throw InputError(fmt::format("{}: numbers must be float64 or float32; convert them", source));
  }

  std::string source;
  Handle dataset;
  Handle type;
  Handle space;
  std::vector<hsize_t> shape;
};

bool exists(hid_t file, const char* name) {
  return H5Lexists(file, name, H5P_DEFAULT) > 0 && H5Oexists_by_name(file, name, H5P_DEFAULT) > 0;
}

void fail_truncated(const std::string& source) {
  throw InputError(source +
                   ": data can't be read; the file is truncated or damaged, copy it again");
}

AlignedArray read_packed(const OpenDataset& information, std::size_t& dimension) {
  const hsize_t packed = information.shape[1];
  dimension = dimension_from_packed_size(packed);
  if (dimension == 0) {
    throw InputError(
        fmt::format("{}: shape {}: {} is no packed size d(d+1)/2; expected [Q x p] "
                    "packed lower triangles or [Q x d x d]",
                    information.source, shape_text(information.shape), packed));
  }
  AlignedArray values(information.shape[0] * packed);
  if (H5Dread(information.dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT,
              values.data()) < 0) {
    fail_truncated(information.source);
  }
  return values;
}

AlignedArray read_full(const OpenDataset& information, std::size_t& dimension) {
  const auto& shape = information.shape;
  if (shape[1] != shape[2]) {
    throw InputError(fmt::format("{}: shape {}: the matrices are not square; expected [Q x d x d]",
                                 information.source, shape_text(shape)));
  }
  dimension = shape[1];
  const double tolerance =
      H5Tget_size(information.type) < 8 ? kSingleSymmetryTolerance : kSymmetryTolerance;
  SymmetricPacker packer(information.source, dimension, shape[0], tolerance);
  const hsize_t block = std::max<hsize_t>(1, (hsize_t{1} << 17) / (dimension * dimension));
  std::vector<double> buffer(block * dimension * dimension);
  for (hsize_t first = 0; first < shape[0]; first += block) {
    const std::array<hsize_t, 3> start{first, 0, 0};
    const std::array<hsize_t, 3> count{std::min(block, shape[0] - first), dimension, dimension};
    const Handle memory(H5Screate_simple(3, count.data(), nullptr), H5Sclose);
    H5Sselect_hyperslab(information.space, H5S_SELECT_SET, start.data(), nullptr, count.data(),
                        nullptr);
    if (H5Dread(information.dataset, H5T_NATIVE_DOUBLE, memory, information.space, H5P_DEFAULT,
                buffer.data()) < 0) {
      fail_truncated(information.source);
    }
    packer.add(buffer.data(), count[0]);
  }
  return packer.take();
}

AlignedArray read_information(const std::string& path, hid_t file, std::size_t& dimension) {
  if (!exists(file, "information")) {
    throw InputError(
        fmt::format("{}: dataset information is missing; expected float64 [Q x p] of "
                    "packed lower triangles",
                    path));
  }
  const OpenDataset information(path, file, "information");
  information.require_floats();
  const auto& shape = information.shape;
  if (shape.size() != 2 && shape.size() != 3) {
    throw InputError(
        fmt::format("{}: shape {}: expected [Q x p] packed lower triangles or "
                    "[Q x d x d]",
                    information.source, shape_text(shape)));
  }
  if (std::ranges::count(shape, hsize_t{0}) > 0) {
    throw InputError(fmt::format("{}: shape {}: there are no candidates", information.source,
                                 shape_text(shape)));
  }
  return shape.size() == 2 ? read_packed(information, dimension)
                           : read_full(information, dimension);
}

CandidateTable read_candidates(const std::string& path, hid_t file, std::size_t candidate_count) {
  CandidateTable table;
  if (!exists(file, "candidates")) return table;
  const OpenDataset candidates(path, file, "candidates");
  candidates.require_floats();
  const auto& shape = candidates.shape;
  if (shape.size() != 2 || shape[0] != candidate_count) {
    throw InputError(fmt::format("{}: shape {}: expected one row for each of the {} candidates",
                                 candidates.source, shape_text(shape), candidate_count));
  }
  table.names = read_string_attribute(candidates.source, candidates.dataset, "names");
  table.units = read_string_attribute(candidates.source, candidates.dataset, "units");
  if (table.names.empty()) {
    for (hsize_t i = 0; i < shape[1]; ++i) table.names.push_back(fmt::format("x{}", i + 1));
  }
  if (table.units.empty()) table.units.resize(shape[1]);
  for (const auto& [field, list] : {std::pair{"names", &table.names}, {"units", &table.units}}) {
    if (list->size() == shape[1]) continue;
    throw InputError(
        fmt::format("{}: attribute {} has {} entries for {} columns; write one for "
                    "each",
                    candidates.source, field, list->size(), shape[1]));
  }
  table.values.resize(shape[0] * shape[1]);
  if (!table.values.empty() && H5Dread(candidates.dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL,
                                       H5P_DEFAULT, table.values.data()) < 0) {
    fail_truncated(candidates.source);
  }
  return table;
}

std::vector<std::string> read_parameters(const std::string& path, hid_t file,
                                         std::size_t dimension) {
  if (!exists(file, "parameters")) return {};
  const OpenDataset parameters(path, file, "parameters");
  auto names = read_strings(parameters.source, {parameters.dataset, &read_dataset}, parameters.type,
                            parameters.space);
  if (names.size() != dimension) {
    throw InputError(fmt::format("{}: {} names for d = {} parameters; write one for each",
                                 parameters.source, names.size(), dimension));
  }
  return names;
}

void require_format(const std::string& path, hid_t file) {
  const auto format = read_string_attribute(path, file, "format");
  if (format.size() == 1 && format[0] == kFormat) return;
  throw InputError(fmt::format("{}: attribute format is {}; expected {}", path,
                               format.empty() ? "missing" : "'" + format[0] + "'", kFormat));
}

void require_hash(const std::string& path, hid_t file, const InformationSet& set) {
  const auto stated = read_string_attribute(path, file, "sha256");
  if (stated.empty()) return;
  const std::string found = set.content_hash();
  if (stated[0] == found) return;
  throw InputError(
      fmt::format("{}: attribute sha256 starts {:.12} but the data give {:.12}: they "
                  "were changed after writing; make the set again",
                  path, stated[0], found));
}

// ---- writing -----------------------------------------------------------------------------------

class Writer {
 public:
  explicit Writer(const std::string& path) : path_(path) {}

  void check(herr_t status) const {
    if (status < 0) throw InputError(fmt::format("{}: can't be written: disk full?", path_));
  }

  void attribute(hid_t object, const char* name, const std::vector<std::string>& values,
                 bool scalar) const {
    const hsize_t size = values.size();
    const Handle type(utf8_strings(), H5Tclose);
    const Handle space(scalar ? H5Screate(H5S_SCALAR) : H5Screate_simple(1, &size, nullptr),
                       H5Sclose);
    const Handle attribute(H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT),
                           H5Aclose);
    check(H5Awrite(attribute, type, c_strings(values).data()));
  }

  void strings(hid_t file, const char* name, const std::vector<std::string>& values) const {
    const hsize_t size = values.size();
    const Handle type(utf8_strings(), H5Tclose);
    const Handle space(H5Screate_simple(1, &size, nullptr), H5Sclose);
    const Handle dataset(H5Dcreate2(file, name, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                         H5Dclose);
    check(H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, c_strings(values).data()));
  }

  // Leaves the dataset open, for its attributes.
  [[nodiscard]] hid_t matrix(hid_t file, const char* name, std::array<hsize_t, 2> shape,
                             const double* values) const {
    const Handle space(H5Screate_simple(2, shape.data(), nullptr), H5Sclose);
    const hid_t dataset =
        H5Dcreate2(file, name, H5T_IEEE_F64LE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    check(H5Dwrite(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values));
    return dataset;
  }

 private:
  std::string path_;
};

void write_contents(const Writer& writer, hid_t file, const InformationSet& set) {
  writer.attribute(file, "format", {kFormat}, true);
  writer.attribute(file, "sha256", {set.content_hash()}, true);
  const Handle information(
      writer.matrix(file, "information", {set.candidate_count(), set.packed_size()}, set.data()),
      H5Dclose);
  const CandidateTable& table = set.candidates();
  if (!table.names.empty()) {
    const Handle candidates(
        writer.matrix(file, "candidates", {set.candidate_count(), table.names.size()},
                      table.values.data()),
        H5Dclose);
    writer.attribute(candidates, "names", table.names, false);
    writer.attribute(candidates, "units", table.units, false);
  }
  if (!set.parameters().empty()) writer.strings(file, "parameters", set.parameters());
}

hid_t open_to_read(const std::string& path) {
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  if (file >= 0) return file;
  throw InputError(
      fmt::format("{}: not readable as HDF5; the path is wrong, or the file is "
                  "truncated or damaged: copy it again",
                  path));
}

}  // namespace

InformationSet read_hdf5(const std::string& path) {
  const QuietErrors quiet;
  const Handle file(open_to_read(path), H5Fclose);
  require_format(path, file);
  std::size_t dimension = 0;
  AlignedArray information = read_information(path, file, dimension);
  require_finite(path + ": dataset information", information, dimension);
  const std::size_t candidate_count = information.size() / packed_size(dimension);
  InformationSet set(dimension, std::move(information),
                     read_candidates(path, file, candidate_count),
                     read_parameters(path, file, dimension), path);
  require_hash(path, file, set);
  return set;
}

InformationSlice read_hdf5_slice(const std::string& path, std::size_t part, std::size_t parts) {
  const QuietErrors quiet;
  const Handle file(open_to_read(path), H5Fclose);
  require_format(path, file);
  if (!exists(file, "information")) throw InputError(path + ": dataset information is missing");
  const OpenDataset information(path, file, "information");
  information.require_floats();
  const std::size_t dimension =
      information.shape.size() == 2 ? dimension_from_packed_size(information.shape[1]) : 0;
  if (dimension == 0) {
    throw InputError(
        fmt::format("{}: shape {}: slices are read from packed lower triangles "
                    "[Q x p]; convert the set with 'graybox problem convert'",
                    information.source, shape_text(information.shape)));
  }
  const std::size_t total = information.shape[0];
  if (total < parts) {
    throw InputError(fmt::format("{}: {} candidates can't be shared by {} processes; use fewer",
                                 information.source, total, parts));
  }
  const std::size_t first = total * part / parts;
  const std::array<hsize_t, 2> start{first, 0};
  const std::array<hsize_t, 2> count{total * (part + 1) / parts - first, information.shape[1]};
  AlignedArray values(count[0] * count[1]);
  const Handle memory(H5Screate_simple(2, count.data(), nullptr), H5Sclose);
  H5Sselect_hyperslab(information.space, H5S_SELECT_SET, start.data(), nullptr, count.data(),
                      nullptr);
  if (H5Dread(information.dataset, H5T_NATIVE_DOUBLE, memory, information.space, H5P_DEFAULT,
              values.data()) < 0) {
    fail_truncated(information.source);
  }
  require_finite(path + ": dataset information", values, dimension);
  const auto hash = read_string_attribute(path, file, "sha256");
  return {InformationSet(dimension, std::move(values), {}, read_parameters(path, file, dimension),
                         path),
          first, total, hash.empty() ? std::string() : hash[0]};
}

void write_hdf5(const std::string& path, const InformationSet& set) {
  const QuietErrors quiet;
  AtomicFile target(path);
  {
    const Writer writer(path);
    const hid_t id = H5Fcreate(target.temporary().c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    if (id < 0) throw InputError(fmt::format("{}: can't be written", path));
    const Handle file(id, H5Fclose);
    write_contents(writer, file, set);
    writer.check(H5Fflush(file, H5F_SCOPE_LOCAL));
  }
  target.commit();
}

}  // namespace graybox
