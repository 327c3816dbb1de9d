#include "problems/formats/hdf5_file.hpp"

#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/formats/hdf5_support.hpp"
#include "problems/formats/hdf5_writer.hpp"
#include "problems/formats/stored_set.hpp"
#include "problems/formats/symmetric_packer.hpp"

namespace graybox {
namespace {

constexpr const char* kFormat = "graybox-information-set/1";

// ---- reading -----------------------------------------------------------------------------------

bool exists(hid_t file, const char* name) {
  return H5Lexists(file, name, H5P_DEFAULT) > 0 && H5Oexists_by_name(file, name, H5P_DEFAULT) > 0;
}

// The part of the candidates that is asked for: `part` of `parts`.
struct Part {
  std::size_t part = 0;
  std::size_t parts = 1;
};

// Takes the part's candidates of the rows, and says where it stands in the whole.
void read_part(const hdf5::Dataset& rows, Part part, StoredSet& set) {
  set.total = rows.shape[0];
  if (set.total < part.parts) {
    throw InputError(fmt::format("{}: {} candidates can't be shared by {} processes; use fewer",
                                 rows.source, set.total, part.parts));
  }
  set.first = set.total * part.part / part.parts;
  const std::size_t last = set.total * (part.part + 1) / part.parts;
  set.information = hdf5::stored_rows(rows, set.first, last - set.first);
}

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
  read_part(information, part, set);
}

// Rows of F_i, [Q x d] or [Q x k x d].
void read_factors(const std::string& path, hid_t file, Part part, StoredSet& set) {
  const hdf5::Dataset factors(path, file, "factors");
  set.source = factors.source;
  factors.require_floats();
  const auto& shape = factors.shape;
  if ((shape.size() != 2 && shape.size() != 3) || std::ranges::count(shape, hsize_t{0}) > 0) {
    throw InputError(fmt::format("{}: shape {}: expected factors [Q x d] or [Q x k x d]",
                                 factors.source, hdf5::shape_text(shape)));
  }
  if (exists(file, "information")) {
    throw InputError(
        fmt::format("{}: there is a dataset information, too; keep one of them", factors.source));
  }
  set.dimension = shape.back();
  set.rank = shape.size() == 3 ? shape[1] : 1;
  read_part(factors, part, set);
}

void read_information(const std::string& path, hid_t file, Part part, StoredSet& set) {
  if (exists(file, "factors")) return read_factors(path, file, part, set);
  if (!exists(file, "information")) {
    throw InputError(
        fmt::format("{}: dataset information is missing; expected float64 [Q x p] of "
                    "packed lower triangles, or factors",
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
  candidates.require_stored(hdf5::Reading::kPerhapsLeft);
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

void write_contents(const hdf5::Writer& writer, hid_t file, const InformationSet& set) {
  writer.attribute(file, "format", std::string(kFormat));
  writer.attribute(file, "sha256", set.content_hash());
  if (set.has_factors()) {
    std::vector<hsize_t> shape{set.candidate_count(), set.rank(), set.dimension()};
    if (set.rank() == 1) shape.erase(shape.begin() + 1);
    const hdf5::Handle factors = writer.dataset(file, "factors", shape, set.factors());
  } else {
    const hdf5::Handle information =
        writer.dataset(file, "information", {set.candidate_count(), set.packed_size()}, set.data());
  }
  const CandidateTable& table = set.candidates();
  if (!table.names.empty()) {
    const hdf5::Handle candidates = writer.dataset(
        file, "candidates", {set.candidate_count(), table.names.size()}, table.values.data());
    writer.attribute(candidates, "names", table.names);
    writer.attribute(candidates, "units", table.units);
  }
  if (!set.parameters().empty()) writer.dataset(file, "parameters", set.parameters());
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
  hdf5::write_file(
      path, [&](const hdf5::Writer& writer, hid_t file) { write_contents(writer, file, set); });
}

}  // namespace graybox
