#include "problems/formats/mat_file.hpp"

#include <fmt/format.h>
#include <matio.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <utility>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/input_file.hpp"
#include "problems/formats/mat73_file.hpp"
#include "problems/formats/mat_handles.hpp"
#include "problems/formats/mat_sizes.hpp"
#include "problems/formats/mat_variable.hpp"
#include "problems/formats/stored_set.hpp"
#include "problems/formats/symmetric_packer.hpp"

namespace graybox {
namespace {

// Of the files written: no time, so that equal contents are equal bytes.
constexpr const char* kHeader = "MATLAB 5.0 MAT-file, written by graybox";

bool is_real_float(const matvar_t& variable) {
  return (variable.class_type == MAT_C_DOUBLE || variable.class_type == MAT_C_SINGLE) &&
         variable.isComplex == 0;
}

// By its kind alone: its contents are judged once it is chosen.
bool may_be_information_set(const matvar_t& variable) {
  if (variable.class_type == MAT_C_CELL) return true;
  return is_real_float(variable) && variable.rank == 3 && variable.dims[0] == variable.dims[1];
}

std::vector<std::string> fitting_variables(mat_t* file) {
  std::vector<std::string> names;
  Mat_Rewind(file);
  while (const MatVariable variable{Mat_VarReadNextInfo(file)}) {
    if (variable->name != nullptr && may_be_information_set(*variable)) {
      names.emplace_back(variable->name);
    }
  }
  Mat_Rewind(file);
  return names;
}

std::string size_text(const matvar_t& variable) {
  return fmt::format("{}",
                     fmt::join(variable.dims, variable.dims + std::max(variable.rank, 0), " x "));
}

// The numbers of a full real matrix, as doubles.
class Numbers {
 public:
  const double* of(const matvar_t& variable, std::size_t count) {
    if (variable.class_type == MAT_C_DOUBLE) return static_cast<const double*>(variable.data);
    const auto* singles = static_cast<const float*>(variable.data);
    doubles_.assign(singles, singles + count);
    return doubles_.data();
  }

 private:
  std::vector<double> doubles_;
};

// Cell number `index` must be a full real square matrix; returns its size.
std::size_t square_size(const std::string& source, const matvar_t* cell, std::size_t index) {
  const auto fail = [&](const std::string& problem) {
    throw InputError(fmt::format("{}: candidate {}: {}", source, index, problem));
  };
  if (cell == nullptr || element_count(*cell) == 0) fail("the cell is empty; remove it");
  if (cell->class_type == MAT_C_SPARSE) fail("the matrix is sparse; store full(H)");
  if (cell->isComplex != 0) fail("the matrix is complex; information matrices are real");
  if (!is_real_float(*cell)) fail("expected a double or single matrix");
  if (cell->rank != 2 || cell->dims[0] != cell->dims[1]) {
    fail(fmt::format("the matrix is {}, not square", size_text(*cell)));
  }
  if (!holds_its_numbers(*cell)) fail("the matrix can't be read; is the file truncated?");
  return cell->dims[0];
}

AlignedArray from_cell_array(const std::string& source, const matvar_t& variable,
                             std::size_t& dimension) {
  const std::size_t count = element_count(variable);
  if (count == 0) throw InputError(source + ": the cell array is empty; there are no candidates");
  if (variable.data == nullptr || variable.nbytes < count * sizeof(matvar_t*)) {
    throw InputError(source + ": can't be read; the file is truncated or damaged");
  }
  matvar_t* const* cells = static_cast<matvar_t* const*>(variable.data);
  dimension = square_size(source, cells[0], 0);
  const double tolerance =
      cells[0]->class_type == MAT_C_DOUBLE ? kSymmetryTolerance : kSingleSymmetryTolerance;
  SymmetricPacker packer(source, dimension, count, tolerance);
  Numbers numbers;
  for (std::size_t i = 0; i < count; ++i) {
    if (square_size(source, cells[i], i) != dimension) {
      throw InputError(
          fmt::format("{}: candidate {}: the matrix is {}, but candidate 0 is {} x {}; "
                      "all must be of one size",
                      source, i, size_text(*cells[i]), dimension, dimension));
    }
    packer.add(numbers.of(*cells[i], dimension * dimension), 1);
  }
  return packer.take();
}

AlignedArray from_numeric_array(const std::string& source, const matvar_t& variable,
                                std::size_t& dimension) {
  dimension = variable.dims[0];
  const std::size_t count = variable.dims[2];
  if (dimension == 0 || count == 0) throw InputError(source + ": there are no candidates");
  if (!holds_its_numbers(variable)) {
    throw InputError(source + ": can't be read; the file is truncated or damaged");
  }
  const bool wide = variable.class_type == MAT_C_DOUBLE;
  SymmetricPacker packer(source, dimension, count,
                         wide ? kSymmetryTolerance : kSingleSymmetryTolerance);
  Numbers numbers;
  packer.add(numbers.of(variable, count * dimension * dimension), count);
  return packer.take();
}

// matio takes what there is of a truncated file and fills the rest with zeros, so the elements are
// counted here first: each begins with its type and its length in bytes (MAT-file format, level 5).
void require_complete(const InputFile& file) {
  if (!file.head(16).starts_with("MATLAB 5")) return;
  if (file.size() < 128) throw InputError(file.path() + ": truncated in its header; copy it again");
  std::array<char, 2> order{};
  file.read(126, order.data(), order.size());
  const bool swapped = order[0] == 'M';
  for (std::uint64_t offset = 128; offset < file.size();) {
    std::array<std::uint32_t, 2> tag{};
    file.read(offset, tag.data(), sizeof tag);
    offset += sizeof tag + (swapped ? __builtin_bswap32(tag[1]) : tag[1]);
    if (offset > file.size()) {
      throw InputError(fmt::format("{}: truncated: {} bytes of {} are there; copy it again",
                                   file.path(), file.size(), offset));
    }
  }
}

// The bytes of a file with the cell array "Hi", as write_mat makes it: the file's header; tag,
// flags, size and name of the cell; for each matrix its tag, flags, size, name, the tag of its
// numbers and these. matio does not notice that the disk is full, and makes the lengths in the file
// fit what is there: nothing but the size tells.
std::uint64_t size_of_mat(std::size_t count, std::size_t d) {
  constexpr std::uint64_t kFileHeader = 128, kTag = 8, kFlags = 16, kSize = 16, kName = 8;
  constexpr std::uint64_t kArray = kTag + kFlags + kSize + kName;
  return kFileHeader + kArray + count * (kArray + kTag + d * d * sizeof(double));
}

}  // namespace

void require_complete_mat(const std::string& path) { require_complete(InputFile(path)); }

namespace {

StoredSet stored_mat5(const std::string& path, const std::string& variable) {
  require_complete_mat(path);
  Mat_LogInitFunc("graybox", [](int, char*) {});
  const MatFile file(Mat_Open(path.c_str(), MAT_ACC_RDONLY));
  if (file == nullptr) {
    throw InputError(fmt::format("{}: no MATLAB file, or truncated; save it again", path));
  }
  const std::string chosen = choose_variable(path, fitting_variables(file.get()), variable);
  StoredSet set;
  set.source = fmt::format("{}: variable {}", path, chosen);
  require_plausible_size(set.source, path,
                         *MatVariable{Mat_VarReadInfo(file.get(), chosen.c_str())});
  const MatVariable contents{Mat_VarRead(file.get(), chosen.c_str())};
  if (contents == nullptr) {
    throw InputError(set.source + ": can't be read; the file is truncated or damaged");
  }
  set.information.values = contents->class_type == MAT_C_CELL
                               ? from_cell_array(set.source, *contents, set.dimension)
                               : from_numeric_array(set.source, *contents, set.dimension);
  set.information.count = set.information.values.size();
  return set;
}

// Arguments: the file and the variable, which may be empty.
void send_mat(const std::vector<std::string>& arguments, MessageWriter& answer) {
  const bool is_hdf5 = InputFile(arguments[0]).head(16).starts_with("MATLAB 7.3");
  send(is_hdf5 ? stored_mat73(arguments[0], arguments[1]) : stored_mat5(arguments[0], arguments[1]),
       answer);
}

}  // namespace

const ReadingTask kReadMat{"mat", &send_mat};

InformationSet read_mat(const std::string& path, const std::string& variable) {
  return information_set(path, receive_stored_set(kReadMat, {path, variable}));
}

void write_mat(const std::string& path, const InformationSet& set) {
  const std::size_t d = set.dimension();
  const std::size_t count = set.candidate_count();
  // Each cell: tags, flags, sizes and name take 64 bytes beside the numbers.
  if (count * (d * d * sizeof(double) + 64) >= (std::size_t{1} << 31)) {
    throw InputError(
        fmt::format("{}: {} candidates of d = {} exceed the 2 GB of a MATLAB 5 variable; "
                    "write .h5 instead",
                    path, count, d));
  }
  Mat_LogInitFunc("graybox", [](int, char*) {});
  AtomicFile target(path);
  {
    // The header is ours: matio's own has the time.
    MatFile file(Mat_CreateVer(target.temporary().c_str(), kHeader, MAT_FT_MAT5));
    std::array<std::size_t, 2> cell_size{1, count};
    const MatVariable cell{
        Mat_VarCreate("Hi", MAT_C_CELL, MAT_T_CELL, 2, cell_size.data(), nullptr, 0)};
    if (file == nullptr || cell == nullptr) {
      throw InputError(fmt::format("{}: can't be written", path));
    }
    std::array<std::size_t, 2> matrix_size{d, d};
    std::vector<double> full(d * d);
    for (std::size_t i = 0; i < count; ++i) {
      unpack(set.information(i).data(), d, full.data());
      Mat_VarSetCell(cell.get(), static_cast<int>(i),
                     Mat_VarCreate(nullptr, MAT_C_DOUBLE, MAT_T_DOUBLE, 2, matrix_size.data(),
                                   full.data(), 0));
    }
    // What stdio still holds is written at the end: there a full disk shows, too.
    std::error_code unknown;
    const bool written = Mat_VarWrite(file.get(), cell.get(), MAT_COMPRESSION_NONE) == 0;
    if (Mat_Close(file.release()) != 0 || !written ||
        std::filesystem::file_size(target.temporary(), unknown) != size_of_mat(count, d)) {
      throw InputError(fmt::format("{}: can't be written: disk full?", path));
    }
  }
  target.commit();
}

}  // namespace graybox
