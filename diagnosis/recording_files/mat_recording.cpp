#include <fmt/format.h>
#include <matio.h>

#include <algorithm>
#include <cstdint>

#include "diagnosis/recording_files/recording_formats.hpp"
#include "problems/base/error.hpp"
#include "problems/files/input_file.hpp"
#include "problems/formats/mat_file.hpp"
#include "problems/formats/mat_handles.hpp"
#include "problems/formats/mat_sizes.hpp"

namespace graybox::formats {
namespace {

template <typename Number>
std::vector<double> doubles(const matvar_t& variable, std::size_t count) {
  const auto* numbers = static_cast<const Number*>(variable.data);
  std::vector<double> values(count);
  std::transform(numbers, numbers + count, values.begin(),
                 [](Number number) { return static_cast<double>(number); });
  return values;
}

// Empty for what is not numeric.
std::vector<double> numbers_in(const matvar_t& variable, std::size_t count) {
  switch (variable.class_type) {
    case MAT_C_DOUBLE:
      return doubles<double>(variable, count);
    case MAT_C_SINGLE:
      return doubles<float>(variable, count);
    case MAT_C_INT8:
      return doubles<std::int8_t>(variable, count);
    case MAT_C_UINT8:
      return doubles<std::uint8_t>(variable, count);
    case MAT_C_INT16:
      return doubles<std::int16_t>(variable, count);
    case MAT_C_UINT16:
      return doubles<std::uint16_t>(variable, count);
    case MAT_C_INT32:
      return doubles<std::int32_t>(variable, count);
    case MAT_C_UINT32:
      return doubles<std::uint32_t>(variable, count);
    case MAT_C_INT64:
      return doubles<std::int64_t>(variable, count);
    case MAT_C_UINT64:
      return doubles<std::uint64_t>(variable, count);
    default:
      return {};
  }
}

void add_variable(const std::string& name, matvar_t* variable, RecordingFile& file);

void add_fields(const std::string& name, matvar_t* structure, RecordingFile& file) {
  if (structure->rank != 2 || element_count(*structure) != 1) return;
  const unsigned count = Mat_VarGetNumberOfFields(structure);
  char* const* names = Mat_VarGetStructFieldnames(structure);
  for (unsigned k = 0; k < count; ++k) {
    add_variable(name + "." + names[k], Mat_VarGetStructFieldByName(structure, names[k], 0), file);
  }
}

void add_variable(const std::string& name, matvar_t* variable, RecordingFile& file) {
  if (variable == nullptr) return;
  if (variable->class_type == MAT_C_STRUCT) {
    add_fields(name, variable, file);
    return;
  }
  if (variable->rank != 2 || variable->isComplex != 0 || variable->data == nullptr) return;
  const std::size_t count = element_count(*variable);
  if (count == 0 || !holds_its_numbers(*variable)) return;
  const std::vector<double> values = numbers_in(*variable, count);
  if (values.empty()) return;
  // MATLAB's columns are the rows of the transpose.
  add_array(name, "", static_cast<Eigen::Index>(variable->dims[1]),
            static_cast<Eigen::Index>(variable->dims[0]), values.data(), file);
}

// Version 7.3 is HDF5: structures are groups, MATLAB's own cells lie in the group #refs#.
RecordingFile read_version_73(const std::string& path) {
  RecordingFile file = read_hdf5_recording(path);
  std::erase_if(file.columns, [](const RecordedColumn& c) { return c.name.starts_with('#'); });
  for (RecordedColumn& column : file.columns) std::ranges::replace(column.name, '/', '.');
  for (std::string& name : file.unclear_arrays) std::ranges::replace(name, '/', '.');
  return file;
}

}  // namespace

RecordingFile read_mat_recording(const std::string& path) {
  if (InputFile(path).head(16).starts_with("MATLAB 7.3")) return read_version_73(path);
  require_complete_mat(path);
  Mat_LogInitFunc("graybox", [](int, char*) {});
  const MatFile mat(Mat_Open(path.c_str(), MAT_ACC_RDONLY));
  if (mat == nullptr) {
    throw InputError(path + ": no MATLAB file, or truncated; save it again");
  }
  RecordingFile file{.path = path, .columns = {}, .unclear_arrays = {}, .sample_time = {}};
  while (const MatVariable info{Mat_VarReadNextInfo(mat.get())}) {
    if (info->name == nullptr) continue;
    require_plausible_size(fmt::format("{}: variable {}", path, info->name), path, *info);
  }
  Mat_Rewind(mat.get());
  while (const MatVariable variable{Mat_VarReadNext(mat.get())}) {
    if (variable->name != nullptr) add_variable(variable->name, variable.get(), file);
  }
  return file;
}

}  // namespace graybox::formats
