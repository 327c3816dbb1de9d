#include "graybox/diagnosis/simulation/recording_writer.hpp"

#include <fmt/format.h>
#include <hdf5.h>

#include <iterator>

#include "graybox/problems/error.hpp"
#include "graybox/problems/formats/atomic_file.hpp"
#include "graybox/problems/formats/hdf5_support.hpp"

namespace graybox {
namespace {

void check(herr_t status, const std::filesystem::path& file) {
  if (status < 0) {
    throw InputError(fmt::format("{}: can't be written; is the disk full?", file.string()));
  }
}

void write_attribute(hid_t object, const char* name, const std::string& text) {
  const hdf5::Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type, text.size() + 1);
  const hdf5::Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const hdf5::Handle attribute(H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT),
                               H5Aclose);
  H5Awrite(attribute, type, text.c_str());
}

void write_hdf5_recording(const std::filesystem::path& file, double sample_time,
                          const std::vector<RecordedChannel>& channels) {
  const hdf5::QuietErrors quiet;
  AtomicFile target(file.string());
  {
    const hdf5::Handle out(
        H5Fcreate(target.temporary().c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT), H5Fclose);
    check(out.valid() ? 0 : -1, file);
    const hdf5::Handle scalar(H5Screate(H5S_SCALAR), H5Sclose);
    const hdf5::Handle attribute(
        H5Acreate2(out, "sample_time", H5T_IEEE_F64LE, scalar, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    check(H5Awrite(attribute, H5T_NATIVE_DOUBLE, &sample_time), file);
    // No times of writing: the same data are the same bytes.
    const hdf5::Handle creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    check(H5Pset_obj_track_times(creation, false), file);
    for (const RecordedChannel& channel : channels) {
      const auto size = static_cast<hsize_t>(channel.values.size());
      const hdf5::Handle space(H5Screate_simple(1, &size, nullptr), H5Sclose);
      const hdf5::Handle dataset(H5Dcreate2(out, channel.name.c_str(), H5T_IEEE_F64LE, space,
                                            H5P_DEFAULT, creation, H5P_DEFAULT),
                                 H5Dclose);
      check(H5Dwrite(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT,
                     channel.values.data()),
            file);
      write_attribute(dataset, "unit", channel.unit);
    }
    check(H5Fflush(out, H5F_SCOPE_LOCAL), file);
  }
  target.commit();
}

void write_csv_recording(const std::filesystem::path& file, double sample_time,
                         const std::vector<RecordedChannel>& channels) {
  fmt::memory_buffer text;
  fmt::format_to(std::back_inserter(text), "time");
  for (const RecordedChannel& channel : channels) {
    fmt::format_to(std::back_inserter(text), ",{}", channel.name);
  }
  const Eigen::Index size = channels.empty() ? 0 : channels.front().values.size();
  for (Eigen::Index t = 0; t < size; ++t) {
    fmt::format_to(std::back_inserter(text), "\n{:.12g}", sample_time * static_cast<double>(t));
    for (const RecordedChannel& channel : channels) {
      fmt::format_to(std::back_inserter(text), ",{}", channel.values(t));
    }
  }
  text.push_back('\n');
  write_text_file(file.string(), {text.data(), text.size()});
}

}  // namespace

void write_recording(const std::filesystem::path& file, double sample_time,
                     const std::vector<RecordedChannel>& channels) {
  if (file.extension() == ".h5") {
    write_hdf5_recording(file, sample_time, channels);
  } else {
    write_csv_recording(file, sample_time, channels);
  }
}

}  // namespace graybox
