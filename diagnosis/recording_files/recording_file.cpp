#include "diagnosis/recording_files/recording_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "diagnosis/recording_files/gzip_text.hpp"
#include "diagnosis/recording_files/recording_formats.hpp"
#include "diagnosis/recording_files/time_parts.hpp"
#include "problems/base/error.hpp"
#include "problems/files/input_file.hpp"

namespace graybox {
namespace {

constexpr std::size_t kListedNames = 30;

std::string names_in(const RecordingFile& file) {
  std::string text;
  for (std::size_t k = 0; k < std::min(file.columns.size(), kListedNames); ++k) {
    text += (text.empty() ? "" : ", ") + file.columns[k].name;
  }
  if (file.columns.size() > kListedNames) {
    text += fmt::format(" and {} more", file.columns.size() - kListedNames);
  }
  return text;
}

[[noreturn]] void fail_unclear(const RecordingFile& file, const std::string& array) {
  throw InputError(fmt::format(
      "{}: {}: along which axis does time run? store at least twice as many samples as channels",
      file.path, array.empty() ? "the array" : array));
}

[[noreturn]] void fail_ending(const std::string& name, const std::string& ending) {
  throw InputError(fmt::format(
      "{}: unknown ending '{}'; known: .csv, .tsv, .txt, .dat, .log, .lvm, .h5, .hdf5, "
      ".mat, .npy, .json, .jsonl, .ndjson, and .csv, .txt, .dat, .json, .jsonl, .ndjson with "
      ".gz",
      name, ending));
}

using TextReader = RecordingFile (*)(const std::string& path, formats::PackedText text);

// Null for endings of other formats.
TextReader text_reader(const std::string& ending) {
  for (const char* table : {".csv", ".tsv", ".txt", ".dat", ".log", ".lvm"}) {
    if (ending == table) return &formats::read_csv_recording;
  }
  if (ending == ".json") return &formats::read_json_recording;
  if (ending == ".jsonl" || ending == ".ndjson") return &formats::read_json_lines;
  return nullptr;
}

// In small letters, as ".CSV" is ".csv".
std::string ending_of(const std::filesystem::path& path) {
  std::string ending = path.extension().string();
  std::ranges::transform(ending, ending.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return ending;
}

RecordingFile read_packed(const std::filesystem::path& path, const std::string& name) {
  const std::string inner = ending_of(path.stem());
  const TextReader read = text_reader(inner);
  if (read == nullptr) fail_ending(name, inner + ".gz");
  return read(name, unpacked_gzip(name));
}

RecordingFile read_by_ending(const std::filesystem::path& path, const std::string& name) {
  const std::string ending = ending_of(path);
  if (ending == ".gz") return read_packed(path, name);
  if (ending == ".h5" || ending == ".hdf5") {
    return formats::read_isolated(formats::kReadHdf5Recording, name);
  }
  if (ending == ".mat") return formats::read_isolated(formats::kReadMatRecording, name);
  if (ending == ".npy") return formats::read_npy_recording(name);
  const TextReader read = text_reader(ending);
  if (read == nullptr) fail_ending(name, ending);
  return read(name, {});
}

}  // namespace

bool is_whole_title(std::string_view text, std::string_view name, std::string_view unit) {
  if (unit.empty()) return false;
  const auto without_blanks = [](std::string_view part) {
    std::string result(part);
    std::erase(result, ' ');
    return result;
  };
  const std::string written = without_blanks(text), plain = without_blanks(name),
                    in_unit = without_blanks(unit);
  return written == fmt::format("{}[{}]", plain, in_unit) ||
         written == fmt::format("{}({})", plain, in_unit);
}

const RecordedColumn* RecordingFile::find(const std::string& name) const {
  auto found = std::ranges::find(columns, name, &RecordedColumn::name);
  if (found == columns.end() && !name.empty()) {
    found = std::ranges::find(columns, name, &RecordedColumn::number);
  }
  if (found == columns.end()) {
    found = std::ranges::find_if(columns, [&](const RecordedColumn& column) {
      return is_whole_title(name, column.name, column.unit);
    });
  }
  return found == columns.end() ? nullptr : &*found;
}

const RecordedColumn& RecordingFile::at(const std::string& name) const {
  if (const RecordedColumn* column = find(name)) return *column;
  const std::string array = name.substr(0, name.find('['));
  if (std::ranges::find(unclear_arrays, array) != unclear_arrays.end()) fail_unclear(*this, array);
  throw InputError(
      fmt::format("{}: there is no column '{}'; there are: {}", path, name, names_in(*this)));
}

RecordingFile read_recording_file(const std::filesystem::path& path) {
  const std::string name = path.string();
  { const InputFile present(name); }  // missing, a folder, empty
  RecordingFile file = read_by_ending(path, name);
  formats::join_time_parts(file);
  if (file.columns.empty()) {
    if (!file.unclear_arrays.empty()) fail_unclear(file, file.unclear_arrays.front());
    throw InputError(name + ": there are no columns of numbers");
  }
  return file;
}

namespace formats {

void add_array(const std::string& name, const std::string& unit, Eigen::Index rows,
               Eigen::Index columns, const double* values, RecordingFile& file) {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Map<const Rows> array(values, rows, columns);
  if (rows == 1 || columns == 1) {
    file.columns.push_back({name.empty() ? "1" : name, unit,
                            Eigen::Map<const Eigen::VectorXd>(values, rows * columns)});
    return;
  }
  if (std::max(rows, columns) < 2 * std::min(rows, columns)) {
    file.unclear_arrays.push_back(name);
    return;
  }
  const bool along_rows = rows > columns;
  for (Eigen::Index k = 0; k < std::min(rows, columns); ++k) {
    const std::string column =
        name.empty() ? std::to_string(k + 1) : fmt::format("{}[{}]", name, k + 1);
    file.columns.push_back(
        {column, unit,
         along_rows ? Eigen::VectorXd(array.col(k)) : Eigen::VectorXd(array.row(k).transpose())});
  }
}

}  // namespace formats
}  // namespace graybox
