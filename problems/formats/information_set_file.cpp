#include "problems/formats/information_set_file.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <new>
#include <string_view>

#include "problems/base/available_memory.hpp"
#include "problems/base/error.hpp"
#include "problems/files/input_file.hpp"
#include "problems/files/temporary_name.hpp"
#include "problems/formats/csv_file.hpp"
#include "problems/formats/hdf5_file.hpp"
#include "problems/formats/mat_file.hpp"
#include "problems/formats/npy_file.hpp"

namespace graybox {
namespace {

enum class Format { kHdf5, kNpy, kCsv, kMat, kUnknown };

Format format_of_extension(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  std::ranges::transform(extension, extension.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (extension == ".h5" || extension == ".hdf5") return Format::kHdf5;
  if (extension == ".npy") return Format::kNpy;
  if (extension == ".csv" || extension == ".txt") return Format::kCsv;
  if (extension == ".mat") return Format::kMat;
  return Format::kUnknown;
}

Format format_of_content(std::string_view head) {
  if (head.starts_with("\x89HDF\r\n\x1a\n")) return Format::kHdf5;
  if (head.starts_with("\x93NUMPY")) return Format::kNpy;
  if (head.starts_with("MATLAB ")) return Format::kMat;
  return Format::kUnknown;
}

// A pipe, a terminal or `<(command)`, with all that comes from it kept in a file: readers look more
// than once.
class PipeContents {
 public:
  explicit PipeContents(const std::string& pipe) {
    std::error_code error;
    path_ = (std::filesystem::temp_directory_path(error) / "input").string();
    path_ = temporary_pattern(path_);
    const int file = mkstemps(path_.data(), kTemporaryEnding);
    if (file < 0) {
      throw InputError(fmt::format("{}: can't be kept in {}: {}; set TMPDIR to a folder with room",
                                   pipe, path_, std::strerror(errno)));
    }
    close(file);
    std::ifstream in(pipe, std::ios::binary);
    std::ofstream out(path_, std::ios::binary);
    if (in.peek() != std::ifstream::traits_type::eof()) out << in.rdbuf();
    out.close();
    if (in.bad() || !out) {
      unlink(path_.c_str());
      throw InputError(fmt::format("{}: can't be read to its end; is {} full?", pipe, path_));
    }
  }
  PipeContents(const PipeContents&) = delete;
  PipeContents& operator=(const PipeContents&) = delete;
  ~PipeContents() { unlink(path_.c_str()); }
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  std::string path_;
};

bool is_pipe(const std::string& path) {
  struct stat status {};
  return stat(path.c_str(), &status) == 0 &&
         (S_ISFIFO(status.st_mode) || S_ISCHR(status.st_mode) || S_ISSOCK(status.st_mode));
}

constexpr std::string_view kKnown = ".h5, .npy, .csv or .mat";

InformationSet read_file(const std::string& path, const ReadOptions& options, Format by_extension) {
  Format format = Format::kUnknown;
  {
    const InputFile file(path);
    format = format_of_content(file.head(8));
  }
  if (format == Format::kUnknown) {
    format = by_extension;
    if (format == Format::kHdf5) {
      throw InputError(fmt::format("{}: no HDF5 file (wrong first bytes)", path));
    }
  }
  if (!options.variable.empty() && format != Format::kMat) {
    throw InputError(fmt::format("{}: a variable can be chosen in .mat files only", path));
  }
  if (options.factors && format != Format::kNpy && format != Format::kCsv) {
    throw InputError(fmt::format("{}: --factors is for .npy and .csv files; {}", path,
                                 format == Format::kHdf5
                                     ? "an HDF5 file says itself what it holds: leave it out"
                                     : "other files hold matrices: leave it out"));
  }
  switch (format) {
    case Format::kHdf5:
      return read_hdf5(path);
    case Format::kNpy:
      return options.factors ? read_npy_factors(path) : read_npy(path);
    case Format::kCsv:
      return options.factors ? read_csv_factors(path) : read_csv(path);
    case Format::kMat:
      return read_mat(path, options.variable);
    case Format::kUnknown:
      break;
  }
  throw InputError(fmt::format("{}: unknown format; expected {}", path, kKnown));
}

// Reads what has come through a pipe; messages name the pipe.
InformationSet read_pipe(const std::string& pipe, const ReadOptions& options) {
  const PipeContents contents(pipe);
  try {
    return read_file(contents.path(), options, Format::kCsv).renamed(pipe);
  } catch (const InputError& error) {
    std::string line = error.what();
    if (const auto at = line.find(contents.path()); at != std::string::npos) {
      line.replace(at, contents.path().size(), pipe);
    }
    throw InputError(line);
  }
}

}  // namespace

InformationSet read_information_set(const std::string& path, const ReadOptions& options) {
  try {
    return is_pipe(path) ? read_pipe(path, options)
                         : read_file(path, options, format_of_extension(path));
  } catch (const std::bad_alloc& error) {
    throw InputError(fmt::format("{}: {}", path, describe_shortage(error)));
  }
}

void write_information_set(const std::string& path, const InformationSet& set) {
  switch (format_of_extension(path)) {
    case Format::kHdf5:
      return write_hdf5(path, set);
    case Format::kNpy:
      return write_npy(path, set);
    case Format::kCsv:
      return write_csv(path, set);
    case Format::kMat:
      return write_mat(path, set);
    case Format::kUnknown:
      break;
  }
  throw InputError(fmt::format("{}: the extension names no known format; use {}", path, kKnown));
}

}  // namespace graybox
