#include "problems/formats/npy_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <fstream>
#include <string_view>
#include <utility>
#include <vector>

#include "problems/base/available_memory.hpp"
#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/input_file.hpp"
#include "problems/formats/symmetric_packer.hpp"
#include "problems/information/factor_form.hpp"

namespace graybox {
namespace {

constexpr std::string_view kMagic = "\x93NUMPY";
constexpr std::size_t kBufferNumbers = std::size_t{1} << 18;

struct Layout {
  std::vector<std::size_t> shape;
  bool fortran_order = false;
  std::size_t item_bytes = 8;  // 8: float64, 4: float32
  std::uint64_t data_offset = 0;
};

// The text after 'key': in the header's Python dictionary.
std::string_view value_of(const std::string& path, std::string_view header, std::string_view key) {
  const std::size_t at = header.find(fmt::format("'{}':", key));
  if (at == std::string_view::npos) {
    throw InputError(
        fmt::format("{}: header: key {} is missing; write it with numpy.save", path, key));
  }
  std::string_view value = header.substr(at + key.size() + 3);
  value.remove_prefix(std::min(value.find_first_not_of(' '), value.size()));
  return value;
}

std::size_t item_bytes_of(const std::string& path, std::string_view value) {
  for (const auto& [type, bytes] :
       {std::pair{"'<f8'", std::size_t{8}}, {"'<f4'", std::size_t{4}}}) {
    if (value.starts_with(type)) return bytes;
  }
  throw InputError(wrong_dtype(path, value.substr(0, value.find(','))));
}

std::vector<std::size_t> shape_of(const std::string& path, std::string_view value) {
  const auto fail = [&] {
    throw InputError(
        fmt::format("{}: header: shape can't be read; write it with numpy.save", path));
  };
  const std::size_t end = value.find(')');
  if (!value.starts_with('(') || end == std::string_view::npos) fail();
  std::string_view list = value.substr(1, end - 1);
  std::vector<std::size_t> shape;
  while (true) {
    list.remove_prefix(std::min(list.find_first_not_of(", "), list.size()));
    if (list.empty()) return shape;
    std::size_t extent = 0;
    const auto [rest, error] = std::from_chars(list.data(), list.data() + list.size(), extent);
    if (error != std::errc()) fail();
    shape.push_back(extent);
    list.remove_prefix(static_cast<std::size_t>(rest - list.data()));
  }
}

Layout read_layout(const InputFile& file) {
  const std::string start = file.head(12);
  if (!start.starts_with(kMagic) || start.size() < 12) {
    throw InputError(fmt::format("{}: no NumPy file (wrong first bytes); write it with numpy.save",
                                 file.path()));
  }
  const auto byte = [&](std::size_t i) {
    return static_cast<std::uint32_t>(static_cast<unsigned char>(start[i]));
  };
  const std::uint32_t version = byte(6);
  if (version < 1 || version > 3) {
    throw InputError(
        fmt::format("{}: NumPy format version {} is not known; write it with numpy.save",
                    file.path(), version));
  }
  const std::uint32_t length = version == 1
                                   ? byte(8) + (byte(9) << 8)
                                   : byte(8) + (byte(9) << 8) + (byte(10) << 16) + (byte(11) << 24);
  const std::uint64_t header_offset = version == 1 ? 10 : 12;
  if (header_offset + length > file.size()) {
    throw InputError(fmt::format("{}: truncated in its header; copy it again", file.path()));
  }
  std::string header(length, '\0');
  file.read(header_offset, header.data(), header.size());
  Layout layout;
  layout.item_bytes = item_bytes_of(file.path(), value_of(file.path(), header, "descr"));
  layout.fortran_order = value_of(file.path(), header, "fortran_order").starts_with("True");
  layout.shape = shape_of(file.path(), value_of(file.path(), header, "shape"));
  layout.data_offset = header_offset + length;
  return layout;
}

void require_size(const InputFile& file, const Layout& layout) {
  // Extended: the product of a damaged header's extents may not fit 64 bits.
  long double bytes = static_cast<long double>(layout.item_bytes);
  for (const std::size_t extent : layout.shape) bytes *= static_cast<long double>(extent);
  const auto present = static_cast<long double>(file.size() - layout.data_offset);
  if (bytes <= present) return;
  throw InputError(
      fmt::format("{}: truncated: shape ({}) needs {:.0f} bytes, {:.0f} are there; copy "
                  "it again",
                  file.path(), fmt::join(layout.shape, ", "), bytes, present));
}

// Reads `count` consecutive numbers at position `first` of the file's data, as float64.
class NumberReader {
 public:
  NumberReader(const InputFile& file, const Layout& layout) : file_(file), layout_(layout) {}

  void read(std::size_t first, std::size_t count, double* out) {
    const std::uint64_t offset = layout_.data_offset + first * layout_.item_bytes;
    if (layout_.item_bytes == 8) {
      file_.read(offset, out, count * sizeof(double));
      return;
    }
    singles_.resize(count);
    file_.read(offset, singles_.data(), count * sizeof(float));
    std::ranges::copy(singles_, out);
  }

 private:
  const InputFile& file_;
  const Layout& layout_;
  std::vector<float> singles_;
};

// Candidates first .. first + count - 1, each `width` numbers, contiguous whatever the file's
// order.
void read_rows(NumberReader& reader, const Layout& layout, std::size_t first, std::size_t count,
               std::size_t width, std::vector<double>& column, double* rows) {
  if (!layout.fortran_order) {
    reader.read(first * width, count * width, rows);
    return;
  }
  // Fortran order: entry k of all candidates is contiguous.
  column.resize(count);
  for (std::size_t k = 0; k < width; ++k) {
    reader.read(k * layout.shape[0] + first, count, column.data());
    for (std::size_t i = 0; i < count; ++i) rows[i * width + k] = column[i];
  }
}

AlignedArray read_values(const InputFile& file, const Layout& layout, std::size_t dimension) {
  const bool full = layout.shape.size() == 3;
  const std::size_t count = layout.shape[0];
  const std::size_t width = full ? dimension * dimension : packed_size(dimension);
  NumberReader reader(file, layout);
  std::vector<double> column;
  if (!full && !layout.fortran_order && layout.item_bytes == 8) {
    return file.numbers(layout.data_offset, count * width);
  }
  require_memory_for_numbers(static_cast<long double>(count * packed_size(dimension)), file.path());
  const std::size_t block = std::max<std::size_t>(1, kBufferNumbers / width);
  if (!full) {
    AlignedArray packed(count * width);
    for (std::size_t first = 0; first < count; first += block) {
      read_rows(reader, layout, first, std::min(block, count - first), width, column,
                packed.data() + first * width);
    }
    return packed;
  }
  SymmetricPacker packer(file.path(), dimension, count,
                         layout.item_bytes == 8 ? kSymmetryTolerance : kSingleSymmetryTolerance);
  std::vector<double> rows(block * width);
  for (std::size_t first = 0; first < count; first += block) {
    const std::size_t here = std::min(block, count - first);
    read_rows(reader, layout, first, here, width, column, rows.data());
    packer.add(rows.data(), here);
  }
  return packer.take();
}

// Factors of `rank` rows: [Q x d] or [Q x k x d], row-major in the result.
AlignedArray read_factor_values(const InputFile& file, const Layout& layout, std::size_t rank) {
  const std::size_t count = layout.shape.front(), d = layout.shape.back(), width = rank * d;
  NumberReader reader(file, layout);
  if (!layout.fortran_order && layout.item_bytes == 8) {
    return file.numbers(layout.data_offset, count * width);
  }
  require_memory_for_numbers(static_cast<long double>(count * width), file.path());
  AlignedArray factors(count * width);
  const std::size_t block = std::max<std::size_t>(1, kBufferNumbers / width);
  std::vector<double> column, rows(block * width);
  for (std::size_t first = 0; first < count; first += block) {
    const std::size_t here = std::min(block, count - first);
    double* out = factors.data() + first * width;
    read_rows(reader, layout, first, here, width, column, layout.fortran_order ? rows.data() : out);
    // In Fortran order the rows of a factor follow each other fastest.
    for (std::size_t k = 0; layout.fortran_order && k < here * width; ++k) {
      const std::size_t entry = k % width;
      out[k - entry + entry % rank * d + entry / rank] = rows[k];
    }
  }
  return factors;
}

}  // namespace

std::string wrong_dtype(const std::string& source, std::string_view dtype) {
  return fmt::format(
      "{}: dtype {}: expected little-endian float64 or float32; save array.astype('<f8')", source,
      dtype);
}

std::size_t dimension_of_shape(const std::string& source, const std::vector<std::size_t>& shape) {
  const auto fail = [&](std::string_view problem) {
    throw InputError(fmt::format(
        "{}: shape ({}): {}; expected [Q x d x d] or packed [Q x p], or --factors where the array "
        "holds factors",
        source, fmt::join(shape, ", "), problem));
  };
  if (shape.size() != 2 && shape.size() != 3) fail("wrong number of axes");
  if (std::ranges::count(shape, std::size_t{0}) > 0) fail("there are no candidates");
  if (shape.size() == 3) {
    if (shape[1] != shape[2]) fail("the matrices are not square");
    return shape[1];
  }
  const std::size_t dimension = dimension_from_packed_size(shape[1]);
  if (dimension == 0) fail(fmt::format("{} is no packed size d(d+1)/2", shape[1]));
  return dimension;
}

NpyArray read_npy_array(const std::string& path) {
  const InputFile file(path);
  const Layout layout = read_layout(file);
  require_size(file, layout);
  std::size_t count = 1;
  for (const std::size_t extent : layout.shape) count *= extent;
  if (count == 0) throw InputError(path + ": the array is empty");
  NpyArray array{layout.shape, layout.fortran_order, std::vector<double>(count)};
  NumberReader(file, layout).read(0, count, array.values.data());
  return array;
}

InformationSet read_npy(const std::string& path) {
  const InputFile file(path);
  const Layout layout = read_layout(file);
  const std::size_t dimension = dimension_of_shape(path, layout.shape);
  require_size(file, layout);
  AlignedArray information = read_values(file, layout, dimension);
  require_finite(path, information, dimension);
  return InformationSet(dimension, std::move(information), {}, {}, path);
}

InformationSet read_npy_factors(const std::string& path) {
  const InputFile file(path);
  const Layout layout = read_layout(file);
  const std::vector<std::size_t>& shape = layout.shape;
  if ((shape.size() != 2 && shape.size() != 3) || std::ranges::count(shape, std::size_t{0}) > 0) {
    throw InputError(fmt::format("{}: shape ({}): expected factors [Q x d] or [Q x k x d]", path,
                                 fmt::join(shape, ", ")));
  }
  require_size(file, layout);
  const std::size_t rank = shape.size() == 3 ? shape[1] : 1;
  AlignedArray factors = read_factor_values(file, layout, rank);
  require_finite_factors(path, factors.span(), rank, shape.back());
  return InformationSet::of_factors(shape.back(), rank, std::move(factors), {}, {}, path);
}

void write_npy(const std::string& path, const InformationSet& set) {
  std::string header =
      fmt::format("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}, {}), }}",
                  set.candidate_count(), set.packed_size());
  // The data start at a multiple of 64 bytes; the header ends with a newline.
  const std::size_t unpadded = 10 + header.size() + 1;
  header.append((64 - unpadded % 64) % 64, ' ');
  header += '\n';
  AtomicFile target(path);
  {
    std::ofstream stream(target.temporary(), std::ios::binary);
    stream << kMagic << '\x01' << '\0' << static_cast<char>(header.size() & 0xFF)
           << static_cast<char>(header.size() >> 8) << header;
    stream.write(
        reinterpret_cast<const char*>(set.data()),
        static_cast<std::streamsize>(set.candidate_count() * set.packed_size() * sizeof(double)));
    stream.close();
    if (!stream) throw InputError(fmt::format("{}: can't be written: disk full?", path));
  }
  target.commit();
}

}  // namespace graybox
