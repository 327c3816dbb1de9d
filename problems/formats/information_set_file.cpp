#include "graybox/problems/formats/information_set_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <string_view>

#include "graybox/problems/error.hpp"
#include "graybox/problems/formats/csv_file.hpp"
#include "graybox/problems/formats/hdf5_file.hpp"
#include "graybox/problems/formats/input_file.hpp"
#include "graybox/problems/formats/mat_file.hpp"
#include "graybox/problems/formats/npy_file.hpp"

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

constexpr std::string_view kKnown = ".h5, .npy, .csv or .mat";

}  // namespace

InformationSet read_information_set(const std::string& path, const ReadOptions& options) {
  Format format = Format::kUnknown;
  {
    const InputFile file(path);
    format = format_of_content(file.head(8));
  }
  if (format == Format::kUnknown) {
    format = format_of_extension(path);
    if (format == Format::kHdf5) {
      throw InputError(fmt::format("{}: no HDF5 file (wrong first bytes)", path));
    }
  }
  if (!options.variable.empty() && format != Format::kMat) {
    throw InputError(fmt::format("{}: a variable can be chosen in .mat files only", path));
  }
  switch (format) {
    case Format::kHdf5:
      return read_hdf5(path);
    case Format::kNpy:
      return read_npy(path);
    case Format::kCsv:
      return read_csv(path);
    case Format::kMat:
      return read_mat(path, options.variable);
    case Format::kUnknown:
      break;
  }
  throw InputError(fmt::format("{}: unknown format; expected {}", path, kKnown));
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
