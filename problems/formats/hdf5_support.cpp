#include "problems/formats/hdf5_support.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numeric>
#include <utility>

#include "problems/base/available_memory.hpp"
#include "problems/base/error.hpp"
#include "problems/formats/quiet_hdf5.hpp"
#include "problems/formats/symmetric_packer.hpp"

namespace graybox {

void silence_hdf5() {
  H5dont_atexit();  // closing the library is where it complains of damaged files once more
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
}

}  // namespace graybox

namespace graybox::hdf5 {
namespace {

constexpr std::size_t kMostStrings = 1'000'000;
constexpr std::size_t kMostText = std::size_t{1} << 28;  // bytes

}  // namespace

std::vector<hsize_t> shape_of(hid_t space) {
  const int rank = H5Sget_simple_extent_ndims(space);
  std::vector<hsize_t> shape(static_cast<std::size_t>(std::max(rank, 0)));
  if (rank > 0) H5Sget_simple_extent_dims(space, shape.data(), nullptr);
  return shape;
}

std::string shape_text(const std::vector<hsize_t>& shape) {
  return fmt::format("[{}]", fmt::join(shape, " x "));
}

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
  if (count > kMostStrings || H5Tget_size(type) > kMostText / count) fail();
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

std::vector<std::string> read_string_attribute(const std::string& source, hid_t object,
                                               const char* name) {
  if (H5Aexists(object, name) <= 0) return {};
  const Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose);
  const Handle type(H5Aget_type(attribute), H5Tclose);
  const Handle space(H5Aget_space(attribute), H5Sclose);
  return read_strings(fmt::format("{}: attribute {}", source, name), {attribute, &read_attribute},
                      type, space);
}

Dataset::Dataset(const std::string& path, hid_t file, const char* name)
    : Dataset(fmt::format("{}: dataset {}", path, name), H5Dopen2(file, name, H5P_DEFAULT)) {}

Dataset::Dataset(std::string name, hid_t id)
    : source(std::move(name)),
      dataset(id, H5Dclose),
      type(H5Dget_type(id), H5Tclose),
      space(H5Dget_space(id), H5Sclose),
      shape(shape_of(space)) {
  if (!dataset.valid()) {
    throw InputError(source + ": can't be opened; is it a dataset of an intact file?");
  }
}

void Dataset::require_floats() const {
  if (H5Tget_class(type) == H5T_FLOAT) return;
  throw InputError(fmt::format("{}: numbers must be float64 or float32; convert them", source));
}

namespace {

// Chunks that hold the shape; of chunks that are not written nothing is known.
long double chunks_of(const Dataset& dataset, hid_t creation) {
  std::vector<hsize_t> chunk(dataset.shape.size());
  if (H5Pget_chunk(creation, static_cast<int>(chunk.size()), chunk.data()) < 0) {
    fail_truncated(dataset.source);
  }
  long double count = 1.0L;
  for (std::size_t axis = 0; axis < chunk.size(); ++axis) {
    const auto extent = static_cast<long double>(dataset.shape[axis]);
    count *= std::ceil(extent / static_cast<long double>(std::max<hsize_t>(chunk[axis], 1)));
  }
  return count;
}

[[noreturn]] void fail_incomplete(const Dataset& dataset, long double needed, long double stored,
                                  const char* what) {
  throw InputError(
      fmt::format("{}: truncated: shape {} needs {:.0f} {}, {:.0f} are there; copy it "
                  "again, or write all of it",
                  dataset.source, shape_text(dataset.shape), needed, what, stored));
}

}  // namespace

void Dataset::require_stored(Reading reading) const {
  const long double count =
      std::accumulate(shape.begin(), shape.end(), 1.0L, [](long double product, hsize_t extent) {
        return product * static_cast<long double>(extent);
      });
  const Handle creation(H5Dget_create_plist(dataset), H5Pclose);
  if (!creation.valid()) fail_truncated(source);
  const H5D_layout_t layout = H5Pget_layout(creation);
  if (layout == H5D_CHUNKED) {
    hsize_t stored = 0;
    const long double needed = chunks_of(*this, creation);
    // It fails where no chunk was ever written.
    if (H5Dget_storage_size(dataset) > 0 && H5Dget_num_chunks(dataset, space, &stored) < 0) {
      fail_truncated(source);
    }
    if (static_cast<long double>(stored) < needed) {
      fail_incomplete(*this, needed, static_cast<long double>(stored), "chunks");
    }
  } else if (layout == H5D_CONTIGUOUS || layout == H5D_COMPACT) {
    const long double needed = count * static_cast<long double>(H5Tget_size(type));
    const auto stored = static_cast<long double>(H5Dget_storage_size(dataset));
    if (stored < needed) fail_incomplete(*this, needed, stored, "bytes");
  }
  if (reading == Reading::kAll) require_memory_for_numbers(count, source);
}

StoredNumbers stored_rows(const Dataset& table, std::size_t first, std::size_t count) {
  table.require_stored(Reading::kPerhapsLeft);
  const hsize_t width =
      std::accumulate(table.shape.begin() + 1, table.shape.end(), hsize_t{1}, std::multiplies<>());
  StoredNumbers rows;
  rows.count = count * width;
  const haddr_t address = H5Dget_offset(table.dataset);
  if (address != HADDR_UNDEF && H5Tequal(table.type, H5T_IEEE_F64LE) > 0 &&
      std::endian::native == std::endian::little) {
    rows.offset = address + first * width * sizeof(double);
    return rows;
  }
  require_memory_for_numbers(static_cast<long double>(rows.count), table.source);
  rows.values = AlignedArray(rows.count);
  if (rows.count == 0) return rows;
  std::vector<hsize_t> start(table.shape.size(), 0), size = table.shape;
  start[0] = first;
  size[0] = count;
  const Handle memory(H5Screate_simple(static_cast<int>(size.size()), size.data(), nullptr),
                      H5Sclose);
  H5Sselect_hyperslab(table.space, H5S_SELECT_SET, start.data(), nullptr, size.data(), nullptr);
  if (H5Dread(table.dataset, H5T_NATIVE_DOUBLE, memory, table.space, H5P_DEFAULT,
              rows.values.data()) < 0) {
    fail_truncated(table.source);
  }
  return rows;
}

void fail_truncated(const std::string& source) {
  throw InputError(source +
                   ": data can't be read; the file is truncated or damaged, copy it again");
}

AlignedArray read_stack(const Dataset& stack, std::size_t& dimension) {
  const auto& shape = stack.shape;
  if (shape[1] != shape[2]) {
    throw InputError(fmt::format("{}: shape {}: the matrices are not square; expected [Q x d x d]",
                                 stack.source, shape_text(shape)));
  }
  stack.require_stored();
  dimension = shape[1];
  const double tolerance =
      H5Tget_size(stack.type) < 8 ? kSingleSymmetryTolerance : kSymmetryTolerance;
  SymmetricPacker packer(stack.source, dimension, shape[0], tolerance);
  const hsize_t block = std::max<hsize_t>(1, (hsize_t{1} << 17) / (dimension * dimension));
  std::vector<double> buffer(block * dimension * dimension);
  for (hsize_t first = 0; first < shape[0]; first += block) {
    const std::array<hsize_t, 3> start{first, 0, 0};
    const std::array<hsize_t, 3> count{std::min(block, shape[0] - first), dimension, dimension};
    const Handle memory(H5Screate_simple(3, count.data(), nullptr), H5Sclose);
    H5Sselect_hyperslab(stack.space, H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr);
    if (H5Dread(stack.dataset, H5T_NATIVE_DOUBLE, memory, stack.space, H5P_DEFAULT, buffer.data()) <
        0) {
      fail_truncated(stack.source);
    }
    packer.add(buffer.data(), count[0]);
  }
  return packer.take();
}

}  // namespace graybox::hdf5
