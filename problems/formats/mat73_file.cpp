#include "problems/formats/mat73_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "problems/base/available_memory.hpp"
#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/formats/hdf5_support.hpp"
#include "problems/formats/mat_variable.hpp"
#include "problems/formats/symmetric_packer.hpp"

namespace graybox {
namespace {

std::string matlab_class(const std::string& source, hid_t object) {
  const auto text = hdf5::read_string_attribute(source, object, "MATLAB_class");
  return text.empty() ? std::string() : text[0];
}

bool is_cell(const hdf5::Dataset& variable) {
  return H5Tget_class(variable.type) == H5T_REFERENCE &&
         matlab_class(variable.source, variable.dataset) == "cell";
}

// MATLAB's d x d x Q is [Q x d x d] in the file: HDF5 counts axes from the slowest.
bool is_stack(const hdf5::Dataset& variable) {
  return H5Tget_class(variable.type) == H5T_FLOAT && variable.shape.size() == 3 &&
         variable.shape[1] == variable.shape[2];
}

std::vector<std::string> object_names(hid_t file) {
  std::vector<std::string> names;
  const auto collect = [](hid_t, const char* name, const H5L_info_t*, void* list) -> herr_t {
    static_cast<std::vector<std::string>*>(list)->emplace_back(name);
    return 0;
  };
  H5Literate(file, H5_INDEX_NAME, H5_ITER_INC, nullptr, collect, &names);
  return names;
}

std::vector<std::string> fitting_variables(const std::string& path, hid_t file) {
  std::vector<std::string> fitting;
  for (const std::string& name : object_names(file)) {
    H5O_info_t info;
    if (H5Oget_info_by_name(file, name.c_str(), &info, H5P_DEFAULT) < 0) continue;
    if (info.type != H5O_TYPE_DATASET) continue;
    const hdf5::Dataset variable(path, file, name.c_str());
    if (is_cell(variable) || is_stack(variable)) fitting.push_back(name);
  }
  return fitting;
}

class CellReader {
 public:
  explicit CellReader(const hdf5::Dataset& variable) : variable_(variable) {
    variable.require_stored();
    const hssize_t count = H5Sget_simple_extent_npoints(variable.space);
    references_.resize(static_cast<std::size_t>(std::max<hssize_t>(count, 0)));
    // An empty cell array is marked by an attribute and holds its dimensions instead.
    if (H5Aexists(variable.dataset, "MATLAB_empty") > 0) references_.clear();
    if (references_.empty()) {
      throw InputError(variable.source + ": the cell array is empty; there are no candidates");
    }
    if (H5Dread(variable.dataset, H5T_STD_REF_OBJ, H5S_ALL, H5S_ALL, H5P_DEFAULT,
                references_.data()) < 0) {
      hdf5::fail_truncated(variable.source);
    }
  }

  AlignedArray read(std::size_t& dimension) {
    dimension = square_size(*open(0));
    require_memory_for_numbers(static_cast<long double>(references_.size()) *
                                   static_cast<long double>(packed_size(dimension)),
                               variable_.source);
    const double tolerance =
        H5Tget_size(open(0)->type) < 8 ? kSingleSymmetryTolerance : kSymmetryTolerance;
    SymmetricPacker packer(variable_.source, dimension, references_.size(), tolerance);
    std::vector<double> full(dimension * dimension);
    for (std::size_t i = 0; i < references_.size(); ++i) {
      const auto matrix = open(i);
      if (square_size(*matrix) != dimension) {
        throw InputError(
            fmt::format("{}: the matrix is {}, but candidate 0 is {} x {}; all must be "
                        "of one size",
                        matrix->source, hdf5::shape_text(matrix->shape), dimension, dimension));
      }
      if (H5Dread(matrix->dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, full.data()) <
          0) {
        hdf5::fail_truncated(matrix->source);
      }
      packer.add(full.data(), 1);
    }
    return packer.take();
  }

 private:
  [[nodiscard]] std::unique_ptr<hdf5::Dataset> open(std::size_t index) const {
    const std::string source = fmt::format("{}: candidate {}", variable_.source, index);
    const hid_t object =
        H5Rdereference2(variable_.dataset, H5P_DEFAULT, H5R_OBJECT, &references_[index]);
    if (object >= 0 && H5Iget_type(object) != H5I_DATASET) {
      H5Oclose(object);
      throw InputError(source + ": no full matrix (sparse or a structure); store full(H)");
    }
    return std::make_unique<hdf5::Dataset>(source, object);
  }

  static std::size_t square_size(const hdf5::Dataset& matrix) {
    const auto fail = [&](const std::string& problem) {
      throw InputError(fmt::format("{}: {}", matrix.source, problem));
    };
    if (H5Aexists(matrix.dataset, "MATLAB_empty") > 0) fail("the cell is empty; remove it");
    if (H5Tget_class(matrix.type) == H5T_COMPOUND) {
      fail("the matrix is complex; information matrices are real");
    }
    if (H5Tget_class(matrix.type) != H5T_FLOAT) fail("expected a double or single matrix");
    if (matrix.shape.size() != 2 || matrix.shape[0] != matrix.shape[1]) {
      fail(fmt::format("the matrix is {}, not square", hdf5::shape_text(matrix.shape)));
    }
    if (matrix.shape[0] == 0) fail("the cell is empty; remove it");
    matrix.require_stored();
    return matrix.shape[0];
  }

  const hdf5::Dataset& variable_;
  std::vector<hobj_ref_t> references_;
};

}  // namespace

StoredSet stored_mat73(const std::string& path, const std::string& variable) {
  const hdf5::QuietErrors quiet;
  const hdf5::Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (!file.valid()) {
    throw InputError(path + ": not readable as a MATLAB 7.3 file; it is truncated or damaged");
  }
  const std::string chosen = choose_variable(path, fitting_variables(path, file), variable);
  const hdf5::Dataset contents(fmt::format("{}: variable {}", path, chosen),
                               H5Dopen2(file, chosen.c_str(), H5P_DEFAULT));
  StoredSet set;
  set.source = contents.source;
  set.information.values = is_cell(contents) ? CellReader(contents).read(set.dimension)
                                             : hdf5::read_stack(contents, set.dimension);
  set.information.count = set.information.values.size();
  return set;
}

}  // namespace graybox
