#include <fmt/format.h>

#include <algorithm>

#include "diagnosis/recording_files/recording_formats.hpp"
#include "problems/base/error.hpp"
#include "problems/formats/hdf5_support.hpp"

namespace graybox::formats {
namespace {

std::string text_attribute(const std::string& source, hid_t object, const char* name) {
  const auto text = hdf5::read_string_attribute(source, object, name);
  return text.empty() ? std::string() : text.front();
}

bool is_numeric(const hdf5::Dataset& dataset) {
  const H5T_class_t type = H5Tget_class(dataset.type);
  // MATLAB writes texts as numbers, and for an empty matrix its size.
  if (text_attribute(dataset.source, dataset.dataset, "MATLAB_class") == "char") return false;
  if (H5Aexists(dataset.dataset, "MATLAB_empty") > 0) return false;
  return (type == H5T_FLOAT || type == H5T_INTEGER) && dataset.shape.size() <= 2 &&
         !dataset.shape.empty();
}

// One dataset, if it holds numbers on one or two axes.
void add_dataset(const std::string& path, hid_t parent, const std::string& name,
                 RecordingFile& file) {
  const hdf5::Dataset dataset(path, parent, name.c_str());
  if (!is_numeric(dataset)) return;
  const auto rows = static_cast<Eigen::Index>(dataset.shape[0]);
  const auto columns =
      dataset.shape.size() == 2 ? static_cast<Eigen::Index>(dataset.shape[1]) : Eigen::Index{1};
  if (rows == 0 || columns == 0) return;
  dataset.require_stored();
  std::vector<double> values(static_cast<std::size_t>(rows * columns));
  if (H5Dread(dataset.dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) <
      0) {
    hdf5::fail_truncated(dataset.source);
  }
  add_array(name, text_attribute(dataset.source, dataset.dataset, "unit"), rows, columns,
            values.data(), file);
}

std::vector<std::string> dataset_names(hid_t root) {
  std::vector<std::string> names;
  const auto collect = [](hid_t, const char* name, const H5O_info_t* info, void* list) -> herr_t {
    if (info->type == H5O_TYPE_DATASET) {
      static_cast<std::vector<std::string>*>(list)->emplace_back(name);
    }
    return 0;
  };
  H5Ovisit(root, H5_INDEX_NAME, H5_ITER_INC, collect, &names);
  return names;
}

std::optional<double> sample_time_in(hid_t file) {
  if (H5Aexists(file, "sample_time") <= 0) return {};
  const hdf5::Handle attribute(H5Aopen(file, "sample_time", H5P_DEFAULT), H5Aclose);
  const hdf5::Handle space(H5Aget_space(attribute), H5Sclose);
  if (H5Sget_simple_extent_npoints(space) != 1) return {};
  double value = 0.0;
  if (H5Aread(attribute, H5T_NATIVE_DOUBLE, &value) < 0) return {};
  return value;
}

}  // namespace

RecordingFile read_hdf5_recording(const std::string& path) {
  const hdf5::QuietErrors quiet;
  const hdf5::Handle root(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (!root.valid()) {
    throw InputError(path + ": not readable as an HDF5 file; it is truncated, damaged or another");
  }
  RecordingFile file{
      .path = path, .columns = {}, .unclear_arrays = {}, .sample_time = sample_time_in(root)};
  for (const std::string& name : dataset_names(root)) add_dataset(path, root, name, file);
  return file;
}

}  // namespace graybox::formats
