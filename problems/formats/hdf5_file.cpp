#include "graybox/problems/formats/hdf5_file.hpp"

#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "graybox/problems/error.hpp"
#include "graybox/problems/formats/atomic_file.hpp"
#include "graybox/problems/formats/hdf5_support.hpp"
#include "graybox/problems/formats/stored_set.hpp"
#include "graybox/problems/formats/symmetric_packer.hpp"
#include "graybox/problems/packed_matrix.hpp"

namespace graybox {
namespace {

constexpr const char* kFormat = "graybox-information-set/1";

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

bool exists(hid_t file, const char* name) {
  return H5Lexists(file, name, H5P_DEFAULT) > 0 && H5Oexists_by_name(file, name, H5P_DEFAULT) > 0;
}

// The part of the candidates that is asked for: `part` of `parts`.
struct Part {
  std::size_t part = 0;
  std::size_t parts = 1;
};

// Fills the set's dimension, information and place of the part.
void read_packed(const hdf5::Dataset& information, Part part, StoredSet& set) {
  const hsize_t packed = information.shape[1];
  set.dimension = dimension_from_packed_size(packed);
  if (set.dimension == 0) {
    throw InputError(
        fmt::format("{}: shape {}: {} is no packed size d(d+1)/2; expected [Q x p] "
                    "packed lower triangles or [Q x d x d]",
                    information.source, hdf5::shape_text(information.shape), packed));
  }
  set.total = information.shape[0];
  if (set.total < part.parts) {
    throw InputError(fmt::format("{}: {} candidates can't be shared by {} processes; use fewer",
                                 information.source, set.total, part.parts));
  }
  set.first = set.total * part.part / part.parts;
  const std::size_t last = set.total * (part.part + 1) / part.parts;
  set.information = hdf5::stored_rows(information, set.first, last - set.first);
}

void read_information(const std::string& path, hid_t file, Part part, StoredSet& set) {
  if (!exists(file, "information")) {
    throw InputError(
        fmt::format("{}: dataset information is missing; expected float64 [Q x p] of "
                    "packed lower triangles",
                    path));
  }
  const hdf5::Dataset information(path, file, "information");
  set.source = information.source;
  information.require_floats();
  const auto& shape = information.shape;
  if (shape.size() != 2 && shape.size() != 3) {
    throw InputError(
        fmt::format("{}: shape {}: expected [Q x p] packed lower triangles or "
                    "[Q x d x d]",
                    information.source, hdf5::shape_text(shape)));
  }
  if (std::ranges::count(shape, hsize_t{0}) > 0) {
    throw InputError(fmt::format("{}: shape {}: there are no candidates", information.source,
                                 hdf5::shape_text(shape)));
  }
  if (shape.size() == 2) return read_packed(information, part, set);
  if (part.parts > 1) {
    throw InputError(
        fmt::format("{}: shape {}: slices are read from packed lower triangles "
                    "[Q x p]; convert the set with 'graybox problem convert'",
                    information.source, hdf5::shape_text(shape)));
  }
  set.information.values = hdf5::read_stack(information, set.dimension);
  set.information.count = set.information.values.size();
  set.total = shape[0];
}

void read_candidates(const std::string& path, hid_t file, StoredSet& set) {
  if (!exists(file, "candidates")) return;
  const hdf5::Dataset candidates(path, file, "candidates");
  candidates.require_floats();
  const auto& shape = candidates.shape;
  if (shape.size() != 2 || shape[0] != set.total) {
    throw InputError(fmt::format("{}: shape {}: expected one row for each of the {} candidates",
                                 candidates.source, hdf5::shape_text(shape), set.total));
  }
  candidates.require_stored();
  set.names = hdf5::read_string_attribute(candidates.source, candidates.dataset, "names");
  set.units = hdf5::read_string_attribute(candidates.source, candidates.dataset, "units");
  if (set.names.empty()) {
    for (hsize_t i = 0; i < shape[1]; ++i) set.names.push_back(fmt::format("x{}", i + 1));
  }
  if (set.units.empty()) set.units.resize(shape[1]);
  for (const auto& [field, list] : {std::pair{"names", &set.names}, {"units", &set.units}}) {
    if (list->size() == shape[1]) continue;
    throw InputError(
        fmt::format("{}: attribute {} has {} entries for {} columns; write one for "
                    "each",
                    candidates.source, field, list->size(), shape[1]));
  }
  set.coordinates = hdf5::stored_rows(candidates, 0, shape[0]);
}

void read_parameters(const std::string& path, hid_t file, StoredSet& set) {
  if (!exists(file, "parameters")) return;
  const hdf5::Dataset parameters(path, file, "parameters");
  set.parameters = hdf5::read_strings(parameters.source, {parameters.dataset, &hdf5::read_dataset},
                                      parameters.type, parameters.space);
  if (set.parameters.size() != set.dimension) {
    throw InputError(fmt::format("{}: {} names for d = {} parameters; write one for each",
                                 parameters.source, set.parameters.size(), set.dimension));
  }
}

void require_format(const std::string& path, hid_t file) {
  const auto format = hdf5::read_string_attribute(path, file, "format");
  if (format.size() == 1 && format[0] == kFormat) return;
  throw InputError(fmt::format("{}: attribute format is {}; expected {}", path,
                               format.empty() ? "missing" : "'" + format[0] + "'", kFormat));
}

void require_hash(const std::string& path, const std::string& stated, const InformationSet& set) {
  if (stated.empty()) return;
  const std::string found = set.content_hash();
  if (stated == found) return;
  throw InputError(
      fmt::format("{}: attribute sha256 starts {:.12} but the data give {:.12}: they "
                  "were changed after writing; make the set again",
                  path, stated, found));
}

hid_t open_to_read(const std::string& path) {
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  if (file >= 0) return file;
  throw InputError(
      fmt::format("{}: not readable as HDF5; the path is wrong, or the file is "
                  "truncated or damaged: copy it again",
                  path));
}

StoredSet stored_set(const std::string& path, Part part) {
  const hdf5::QuietErrors quiet;
  const hdf5::Handle file(open_to_read(path), H5Fclose);
  require_format(path, file);
  StoredSet set;
  read_information(path, file, part, set);
  // A part comes without coordinates.
  if (part.parts == 1) read_candidates(path, file, set);
  read_parameters(path, file, set);
  const auto hash = hdf5::read_string_attribute(path, file, "sha256");
  if (!hash.empty()) set.sha256 = hash[0];
  return set;
}

// Arguments: the file; for a part its number and how many there are.
void send_hdf5(const std::vector<std::string>& arguments, MessageWriter& answer) {
  Part part;
  if (arguments.size() == 3) part = {std::stoul(arguments[1]), std::stoul(arguments[2])};
  send(stored_set(arguments[0], part), answer);
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
    const hdf5::Handle type(utf8_strings(), H5Tclose);
    const hdf5::Handle space(scalar ? H5Screate(H5S_SCALAR) : H5Screate_simple(1, &size, nullptr),
                             H5Sclose);
    const hdf5::Handle attribute(H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT),
                                 H5Aclose);
    check(H5Awrite(attribute, type, c_strings(values).data()));
  }

  void strings(hid_t file, const char* name, const std::vector<std::string>& values) const {
    const hsize_t size = values.size();
    const hdf5::Handle type(utf8_strings(), H5Tclose);
    const hdf5::Handle space(H5Screate_simple(1, &size, nullptr), H5Sclose);
    const hdf5::Handle dataset(
        H5Dcreate2(file, name, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Dclose);
    check(H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, c_strings(values).data()));
  }

  // Leaves the dataset open, for its attributes.
  [[nodiscard]] hid_t matrix(hid_t file, const char* name, std::array<hsize_t, 2> shape,
                             const double* values) const {
    const hdf5::Handle space(H5Screate_simple(2, shape.data(), nullptr), H5Sclose);
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
  const hdf5::Handle information(
      writer.matrix(file, "information", {set.candidate_count(), set.packed_size()}, set.data()),
      H5Dclose);
  const CandidateTable& table = set.candidates();
  if (!table.names.empty()) {
    const hdf5::Handle candidates(
        writer.matrix(file, "candidates", {set.candidate_count(), table.names.size()},
                      table.values.data()),
        H5Dclose);
    writer.attribute(candidates, "names", table.names, false);
    writer.attribute(candidates, "units", table.units, false);
  }
  if (!set.parameters().empty()) writer.strings(file, "parameters", set.parameters());
}

}  // namespace

const ReadingTask kReadHdf5{"hdf5", &send_hdf5};

InformationSet read_hdf5(const std::string& path) {
  StoredSet stored = receive_stored_set(kReadHdf5, {path});
  const std::string hash = stored.sha256;
  InformationSet set = information_set(path, std::move(stored));
  require_hash(path, hash, set);
  return set;
}

InformationSlice read_hdf5_slice(const std::string& path, std::size_t part, std::size_t parts) {
  StoredSet stored =
      receive_stored_set(kReadHdf5, {path, std::to_string(part), std::to_string(parts)});
  const std::size_t first = stored.first;
  const std::size_t total = stored.total;
  std::string hash = stored.sha256;
  return {information_set(path, std::move(stored)), first, total, std::move(hash)};
}

void write_hdf5(const std::string& path, const InformationSet& set) {
  const hdf5::QuietErrors quiet;
  AtomicFile target(path);
  {
    const Writer writer(path);
    const hid_t id = H5Fcreate(target.temporary().c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    if (id < 0) throw InputError(fmt::format("{}: can't be written", path));
    const hdf5::Handle file(id, H5Fclose);
    write_contents(writer, file, set);
    writer.check(H5Fflush(file, H5F_SCOPE_LOCAL));
  }
  target.commit();
}

}  // namespace graybox
