#include "graybox/problems/formats/mat_file.hpp"

#include <fmt/format.h>
#include <matio.h>

#include <algorithm>
#include <array>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include "graybox/problems/error.hpp"
#include "graybox/problems/formats/atomic_file.hpp"
#include "graybox/problems/formats/input_file.hpp"
#include "graybox/problems/formats/symmetric_packer.hpp"
#include "graybox/problems/packed_matrix.hpp"

namespace graybox {
namespace {

struct CloseMat {
  void operator()(mat_t* file) const { Mat_Close(file); }
};
struct FreeVariable {
  void operator()(matvar_t* variable) const { Mat_VarFree(variable); }
};
using MatFile = std::unique_ptr<mat_t, CloseMat>;
using MatVariable = std::unique_ptr<matvar_t, FreeVariable>;

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

std::string choose_variable(const std::string& path, mat_t* file, const std::string& wanted) {
  const auto names = fitting_variables(file);
  if (!wanted.empty()) {
    if (std::ranges::find(names, wanted) != names.end()) return wanted;
    throw InputError(
        fmt::format("{}: no variable {} that is a cell array of matrices or d x d x Q; "
                    "there {} {}",
                    path, wanted, names.size() == 1 ? "is" : "are",
                    names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "))));
  }
  if (names.size() == 1) return names.front();
  if (names.empty()) {
    throw InputError(
        fmt::format("{}: no variable is a cell array of square matrices or a d x d x Q "
                    "array; save one, for example Hi",
                    path));
  }
  throw InputError(
      fmt::format("{}: several variables may be information sets: {}; name one with "
                  "--variable",
                  path, fmt::join(names, ", ")));
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

std::size_t element_count(const matvar_t& variable) {
  std::size_t count = variable.rank > 0 ? 1 : 0;
  for (int i = 0; i < variable.rank; ++i) count *= variable.dims[i];
  return count;
}

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
  if (cell->data == nullptr) fail("the matrix can't be read; is the file truncated?");
  return cell->dims[0];
}

InformationSet from_cell_array(const std::string& source, const std::string& path,
                               const matvar_t& variable) {
  const std::size_t count = element_count(variable);
  if (count == 0) throw InputError(source + ": the cell array is empty; there are no candidates");
  if (variable.data == nullptr) {
    throw InputError(source + ": can't be read; the file is truncated or damaged");
  }
  matvar_t* const* cells = static_cast<matvar_t* const*>(variable.data);
  const std::size_t dimension = square_size(source, cells[0], 0);
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
  return InformationSet(dimension, packer.take(), {}, {}, path);
}

InformationSet from_numeric_array(const std::string& source, const std::string& path,
                                  const matvar_t& variable) {
  const std::size_t dimension = variable.dims[0];
  const std::size_t count = variable.dims[2];
  if (dimension == 0 || count == 0) throw InputError(source + ": there are no candidates");
  if (variable.data == nullptr) {
    throw InputError(source + ": can't be read; the file is truncated or damaged");
  }
  const bool wide = variable.class_type == MAT_C_DOUBLE;
  SymmetricPacker packer(source, dimension, count,
                         wide ? kSymmetryTolerance : kSingleSymmetryTolerance);
  Numbers numbers;
  packer.add(numbers.of(variable, count * dimension * dimension), count);
  return InformationSet(dimension, packer.take(), {}, {}, path);
}

}  // namespace

InformationSet read_mat(const std::string& path, const std::string& variable) {
  { const InputFile present(path); }  // missing, a folder, empty
  Mat_LogInitFunc("graybox", [](int, char*) {});
  const MatFile file(Mat_Open(path.c_str(), MAT_ACC_RDONLY));
  if (file == nullptr) {
    throw InputError(fmt::format("{}: no MATLAB file, or truncated; save it again", path));
  }
  const std::string chosen = choose_variable(path, file.get(), variable);
  const std::string source = fmt::format("{}: variable {}", path, chosen);
  const MatVariable contents{Mat_VarRead(file.get(), chosen.c_str())};
  if (contents == nullptr) {
    throw InputError(source + ": can't be read; the file is truncated or damaged");
  }
  InformationSet set = contents->class_type == MAT_C_CELL
                           ? from_cell_array(source, path, *contents)
                           : from_numeric_array(source, path, *contents);
  return set;
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
  AtomicFile target(path);
  {
    const MatFile file(Mat_CreateVer(target.temporary().c_str(), nullptr, MAT_FT_MAT5));
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
    if (Mat_VarWrite(file.get(), cell.get(), MAT_COMPRESSION_NONE) != 0) {
      throw InputError(fmt::format("{}: can't be written: disk full?", path));
    }
  }
  target.commit();
}

}  // namespace graybox
