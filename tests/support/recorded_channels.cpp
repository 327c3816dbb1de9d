#include "tests/support/recorded_channels.hpp"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>

#include "diagnosis/recording_files/recording_file.hpp"
#include "diagnosis/signal_faults/sample_statistics.hpp"

namespace graybox::testing {
namespace {

namespace fs = std::filesystem;

double sample_time_of(const std::string& set) {
  static const std::map<std::string, double> kTimes = {
      {"BRFD", 1.0 / 1024},          {"EMPS", 0.001},           {"KR300", 0.004},
      {"ODrive_cogging", 1.0 / 440}, {"Silverbox", 16384.0e-7}, {"TIAGo", 0.01},
      {"two_mass_bench", 0.0004},    {"UR10e", 0.01},           {"TX40", 0.0002}};
  return kTimes.at(set);
}

bool is_time(const std::string& set, const std::string& column) {
  return column == "t" || column == "time" || column == "data[1]" ||
         ((set == "UR10e" || set == "ODrive_cogging") && column == "1");
}

bool is_position(const std::string& set, const std::string& file, const std::string& column) {
  if (set == "TX40") return file.starts_with("pos");
  if (set == "TIAGo") return file.ends_with("position.csv");
  if (set == "UR10e") return std::stoi(column) <= 7;
  if (set == "ODrive_cogging") return false;  // its times are uneven
  if (set == "BRFD") return column == "data[2]";
  if (column.find("ref") != std::string::npos) return false;
  return column == "qm" || column.starts_with("theta") || column.find("_pos_") != std::string::npos;
}

std::vector<fs::path> files_in(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string ending = entry.path().extension().string();
    if (ending == ".csv" || ending == ".mat" || ending == ".npy" || ending == ".json") {
      files.push_back(entry.path());
    }
  }
  std::ranges::sort(files);
  return files;
}

void add_channels(const fs::path& path, std::vector<RecordedChannel>& channels) {
  const std::string set = path.parent_path().filename().string();
  const std::string file = path.filename().string();
  if (file.starts_with("coggingmap")) return;  // a table by position, no signal
  for (const RecordedColumn& column : read_recording_file(path).columns) {
    if (column.values.size() <= 500 || is_time(set, column.name)) continue;
    if (set == "KR300" && !column.name.starts_with("rec.")) continue;
    if (!column.values.allFinite() || has_few_levels(column.values)) continue;
    channels.push_back({set, file, column.name, sample_time_of(set),
                        is_position(set, file, column.name), column.values});
  }
}

}  // namespace

const std::vector<RecordedChannel>& recorded_channels() {
  static const std::vector<RecordedChannel> kChannels = [] {
    std::vector<RecordedChannel> channels;
    const char* folder = std::getenv("GRAYBOX_RECORDINGS");
    if (folder == nullptr || !fs::is_directory(folder)) return channels;
    for (const fs::path& file : files_in(folder)) add_channels(file, channels);
    return channels;
  }();
  return kChannels;
}

}  // namespace graybox::testing
