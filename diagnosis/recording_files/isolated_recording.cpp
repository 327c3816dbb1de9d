#include <utility>

#include "diagnosis/recording_files/recording_formats.hpp"

namespace graybox::formats {
namespace {

void send(const RecordingFile& file, MessageWriter& answer) {
  answer.whole(static_cast<std::uint64_t>(ReadingStatus::kRead));
  answer.texts(file.unclear_arrays);
  answer.whole(file.sample_time ? 1 : 0);
  const double sample_time = file.sample_time.value_or(0.0);
  answer.numbers(&sample_time, 1);
  answer.whole(file.columns.size());
  for (const RecordedColumn& column : file.columns) {
    answer.text(column.name);
    answer.text(column.unit);
    answer.whole(static_cast<std::uint64_t>(column.values.size()));
    answer.numbers(column.values.data(), static_cast<std::size_t>(column.values.size()));
  }
}

template <RecordingFile (*kRead)(const std::string&)>
void send_recording(const std::vector<std::string>& arguments, MessageWriter& answer) {
  send(kRead(arguments[0]), answer);
}

}  // namespace

const ReadingTask kReadHdf5Recording{"hdf5_recording", &send_recording<&read_hdf5_recording>};
const ReadingTask kReadMatRecording{"mat_recording", &send_recording<&read_mat_recording>};

RecordingFile read_isolated(const ReadingTask& task, const std::string& path) {
  ReadingProcess child(task, {path});
  RecordingFile file{.path = path, .columns = {}, .unclear_arrays = {}, .sample_time = {}};
  file.unclear_arrays = child.texts();
  const bool states_sample_time = child.whole() != 0;
  double sample_time = 0.0;
  child.numbers(&sample_time, 1);
  if (states_sample_time) file.sample_time = sample_time;
  const std::uint64_t columns = child.whole();
  for (std::uint64_t k = 0; k < columns; ++k) {
    RecordedColumn column{child.text(), child.text(), {}};
    const std::uint64_t size = child.whole();
    child.require_memory(size);
    column.values.resize(static_cast<Eigen::Index>(size));
    child.numbers(column.values.data(), size);
    file.columns.push_back(std::move(column));
  }
  return file;
}

}  // namespace graybox::formats
