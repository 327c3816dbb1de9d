#include "problems/formats/number_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"
#include "problems/files/input_file.hpp"
#include "problems/files/text_lines.hpp"
#include "problems/formats/npy_file.hpp"

namespace graybox {
namespace {

constexpr std::size_t kRowsBetweenStops = 1024;

std::vector<double> in_rows(const NpyArray& array) {
  const std::size_t rows = array.shape[0], columns = array.shape[1];
  std::vector<double> values(array.values.size());
  for (std::size_t i = 0; i < rows; ++i) {
    for (std::size_t j = 0; j < columns; ++j) {
      values[i * columns + j] = array.values[j * rows + i];
    }
  }
  return values;
}

NumberTable read_array(const std::string& path) {
  NpyArray array = read_npy_array(path);
  if (array.shape.size() != 2) {
    throw InputError(fmt::format("{}: the array has {} axes; expected two, rows and columns", path,
                                 array.shape.size()));
  }
  NumberTable table;
  table.path = path;
  table.rows = array.shape[0];
  table.columns = array.shape[1];
  table.values = array.fortran_order ? in_rows(array) : std::move(array.values);
  for (std::size_t k = 0; k < table.values.size(); ++k) {
    if (std::isfinite(table.values[k])) continue;
    throw InputError(
        fmt::format("{}: row {}, column {}: {} is not finite; remove or repair that row", path,
                    k / table.columns, k % table.columns, table.values[k]));
  }
  return table;
}

class TextTableReader {
 public:
  explicit TextTableReader(const std::string& path) : lines_(path) { table_.path = path; }

  NumberTable read() {
    std::string_view line;
    if (!lines_.next(line)) fail_empty();
    FieldSplitter splitter(line);
    std::string header;
    if (is_header(splitter.split(line))) {
      header = line;
      for (const std::string_view name : splitter.split(line)) table_.names.emplace_back(name);
      if (!lines_.next(line)) fail_empty();
      splitter = FieldSplitter(line);
    }
    table_.columns = splitter.split(line).size();
    do add(splitter.split(line));
    while (lines_.next(line));
    // Blanks in the only name, as in "time [s]", separate nothing.
    if (table_.columns == 1 && header.find_first_of(",;\t") == std::string::npos &&
        !header.empty()) {
      table_.names = {header};
    }
    if (!table_.names.empty() && table_.names.size() != table_.columns) {
      throw InputError(fmt::format("{}: header: {} columns are named, but a line has {} numbers",
                                   table_.path, table_.names.size(), table_.columns));
    }
    return std::move(table_);
  }

 private:
  [[noreturn]] void fail_empty() const {
    throw InputError(table_.path + ": there are no rows; expected numbers, one row a line");
  }

  void add(const std::vector<std::string_view>& fields) {
    if (fields.size() != table_.columns) {
      throw InputError(fmt::format("{}: line {}: {} numbers, but {} in the first row", table_.path,
                                   lines_.number(), fields.size(), table_.columns));
    }
    for (std::size_t column = 0; column < fields.size(); ++column) {
      const double value =
          number_in_table(table_.path, lines_.number(), std::to_string(column + 1), fields[column]);
      if (!std::isfinite(value)) {
        throw InputError(
            fmt::format("{}: line {}, column {}: {} is not finite; remove or repair that row",
                        table_.path, lines_.number(), column + 1, fields[column]));
      }
      table_.values.push_back(value);
    }
    table_.lines.push_back(lines_.number());
    if (++table_.rows % kRowsBetweenStops == 0) stop_if_requested();
  }

  LineReader lines_;
  NumberTable table_;
};

}  // namespace

NumberTable read_number_table(const std::string& path) {
  {
    const InputFile present(path);  // missing, a folder, empty
    if (present.head(6) == "\x93NUMPY") return read_array(path);
  }
  return TextTableReader(path).read();
}

std::string row_place(const NumberTable& table, std::size_t row) {
  return table.lines.empty() ? fmt::format("{}: row {}", table.path, row)
                             : fmt::format("{}: line {}", table.path, table.lines[row]);
}

}  // namespace graybox
