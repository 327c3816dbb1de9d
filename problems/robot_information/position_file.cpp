#include <fmt/format.h>

#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/files/file_kind.hpp"
#include "problems/files/input_guard.hpp"
#include "problems/files/text_lines.hpp"
#include "problems/robot_information/robot_grid.hpp"

namespace graybox {

PositionTable read_positions(const std::filesystem::path& file, std::size_t joint_count) {
  require_file(file);
  note_input(file.string());
  PositionTable table{joint_count, {}};
  LineReader lines(file.string());
  std::string_view line;
  if (!lines.next(line)) throw InputError(fmt::format("{}: holds no position", file.string()));
  FieldSplitter splitter(line);
  bool more = !is_header(splitter.split(line)) || lines.next(line);
  for (; more; more = lines.next(line)) {
    const std::vector<std::string_view>& cells = splitter.split(line);
    if (cells.size() != joint_count) {
      throw InputError(fmt::format("{}:{}: a position has {} angles in degrees, this line has {}",
                                   file.string(), lines.number(), joint_count, cells.size()));
    }
    for (const std::string_view cell : cells) {
      double value = 0.0;
      if (!parse_number(cell, value) || !std::isfinite(value)) {
        throw InputError(fmt::format("{}:{}: '{}' is not a finite number", file.string(),
                                     lines.number(), cell.substr(0, 40)));
      }
      table.degrees.push_back(value);
    }
  }
  if (table.degrees.empty()) {
    throw InputError(fmt::format("{}: holds no position", file.string()));
  }
  return table;
}

}  // namespace graybox
