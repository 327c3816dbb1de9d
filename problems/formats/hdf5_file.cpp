#include "graybox/problems/formats/hdf5_file.hpp"

#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "graybox/problems/error.hpp"
#include "graybox/problems/formats/hdf5_support.hpp"
#include "graybox/problems/formats/hdf5_writer.hpp"
#include "graybox/problems/formats/symmetric_packer.hpp"
#include "graybox/problems/packed_matrix.hpp"

namespace graybox {
namespace {

constexpr const char* kFormat = "graybox-information-set/1";

// ---- reading -----------------------------------------------------------------------------------

bool exists(hid_t file, const char* name) {
  return H5Lexists(file, name, H5P_DEFAULT) > 0 && H5Oexists_by_name(file, name, H5P_DEFAULT) > 0;
}

AlignedArray read_packed(const hdf5::Dataset& information, std::size_t& dimension) {
  const hsize_t packed = information.shape[1];
  dimension = dimension_from_packed_size(packed);
  if (dimension == 0) {
    throw InputError(
        fmt::format("{}: shape {}: {} is no packed size d(d+1)/2; expected [Q x p] "
                    "packed lower triangles or [Q x d x d]",
                    information.source, hdf5::shape_text(information.shape), packed));
  }
  AlignedArray values(information.shape[0] * packed);
  if (H5Dread(information.dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT,
              values.data()) < 0) {
    hdf5::fail_truncated(information.source);
  }
  return values;
}

AlignedArray read_information(const std::string& path, hid_t file, std::size_t& dimension) {
  if (!exists(file, "information")) {
    throw InputError(
        fmt::format("{}: dataset information is missing; expected float64 [Q x p] of "
                    "packed lower triangles",
                    path));
  }
  const hdf5::Dataset information(path, file, "information");
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
  return shape.size() == 2 ? read_packed(information, dimension)
                           : hdf5::read_stack(information, dimension);
}

CandidateTable read_candidates(const std::string& path, hid_t file, std::size_t candidate_count) {
  CandidateTable table;
  if (!exists(file, "candidates")) return table;
  const hdf5::Dataset candidates(path, file, "candidates");
  candidates.require_floats();
  const auto& shape = candidates.shape;
  if (shape.size() != 2 || shape[0] != candidate_count) {
    throw InputError(fmt::format("{}: shape {}: expected one row for each of the {} candidates",
                                 candidates.source, hdf5::shape_text(shape), candidate_count));
  }
  table.names = hdf5::read_string_attribute(candidates.source, candidates.dataset, "names");
  table.units = hdf5::read_string_attribute(candidates.source, candidates.dataset, "units");
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
    hdf5::fail_truncated(candidates.source);
  }
  return table;
}

std::vector<std::string> read_parameters(const std::string& path, hid_t file,
                                         std::size_t dimension) {
  if (!exists(file, "parameters")) return {};
  const hdf5::Dataset parameters(path, file, "parameters");
  auto names = hdf5::read_strings(parameters.source, {parameters.dataset, &hdf5::read_dataset},
                                  parameters.type, parameters.space);
  if (names.size() != dimension) {
    throw InputError(fmt::format("{}: {} names for d = {} parameters; write one for each",
                                 parameters.source, names.size(), dimension));
  }
  return names;
}

void require_format(const std::string& path, hid_t file) {
  const auto format = hdf5::read_string_attribute(path, file, "format");
  if (format.size() == 1 && format[0] == kFormat) return;
  throw InputError(fmt::format("{}: attribute format is {}; expected {}", path,
                               format.empty() ? "missing" : "'" + format[0] + "'", kFormat));
}

void require_hash(const std::string& path, hid_t file, const InformationSet& set) {
  const auto stated = hdf5::read_string_attribute(path, file, "sha256");
  if (stated.empty()) return;
  const std::string found = set.content_hash();
  if (stated[0] == found) return;
  throw InputError(
      fmt::format("{}: attribute sha256 starts {:.12} but the data give {:.12}: they "
                  "were changed after writing; make the set again",
                  path, stated[0], found));
}

// ---- writing -----------------------------------------------------------------------------------

void write_contents(const hdf5::Writer& writer, hid_t file, const InformationSet& set) {
  writer.attribute(file, "format", std::string(kFormat));
  writer.attribute(file, "sha256", set.content_hash());
  const hdf5::Handle information = writer.dataset(
      file, "information", {set.candidate_count(), set.packed_size()}, set.data());
  const CandidateTable& table = set.candidates();
  if (!table.names.empty()) {
    const hdf5::Handle candidates = writer.dataset(
        file, "candidates", {set.candidate_count(), table.names.size()}, table.values.data());
    writer.attribute(candidates, "names", table.names);
    writer.attribute(candidates, "units", table.units);
  }
  if (!set.parameters().empty()) writer.dataset(file, "parameters", set.parameters());
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
  const hdf5::QuietErrors quiet;
  const hdf5::Handle file(open_to_read(path), H5Fclose);
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
  const hdf5::QuietErrors quiet;
  const hdf5::Handle file(open_to_read(path), H5Fclose);
  require_format(path, file);
  if (!exists(file, "information")) throw InputError(path + ": dataset information is missing");
  const hdf5::Dataset information(path, file, "information");
  information.require_floats();
  const std::size_t dimension =
      information.shape.size() == 2 ? dimension_from_packed_size(information.shape[1]) : 0;
  if (dimension == 0) {
    throw InputError(
        fmt::format("{}: shape {}: slices are read from packed lower triangles "
                    "[Q x p]; convert the set with 'graybox problem convert'",
                    information.source, hdf5::shape_text(information.shape)));
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
  const hdf5::Handle memory(H5Screate_simple(2, count.data(), nullptr), H5Sclose);
  H5Sselect_hyperslab(information.space, H5S_SELECT_SET, start.data(), nullptr, count.data(),
                      nullptr);
  if (H5Dread(information.dataset, H5T_NATIVE_DOUBLE, memory, information.space, H5P_DEFAULT,
              values.data()) < 0) {
    hdf5::fail_truncated(information.source);
  }
  require_finite(path + ": dataset information", values, dimension);
  const auto hash = hdf5::read_string_attribute(path, file, "sha256");
  return {InformationSet(dimension, std::move(values), {}, read_parameters(path, file, dimension),
                         path),
          first, total, hash.empty() ? std::string() : hash[0]};
}

void write_hdf5(const std::string& path, const InformationSet& set) {
  hdf5::write_file(path, [&](const hdf5::Writer& writer, hid_t file) {
    write_contents(writer, file, set);
  });
}

}  // namespace graybox
