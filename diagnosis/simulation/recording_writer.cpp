#include "diagnosis/simulation/recording_writer.hpp"

#include <fmt/format.h>

#include <iterator>

#include "problems/files/atomic_file.hpp"
#include "problems/formats/hdf5_writer.hpp"

namespace graybox {
namespace {

void write_hdf5_recording(const std::filesystem::path& file, double sample_time,
                          const std::vector<RecordedChannel>& channels) {
  hdf5::write_file(file.string(), [&](const hdf5::Writer& writer, hid_t out) {
    writer.attribute(out, "sample_time", sample_time);
    for (const RecordedChannel& channel : channels) {
      const hdf5::Handle dataset =
          writer.dataset(out, channel.name.c_str(), {static_cast<hsize_t>(channel.values.size())},
                         channel.values.data());
      writer.attribute(dataset, "unit", channel.unit);
    }
  });
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
