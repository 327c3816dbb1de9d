// NumberTable: rows of numbers with names of columns: points, Jacobians, coordinates of candidates.
//
//   .npy   float64 or float32, two axes (npy_file.hpp); no names
//   other  text: one row a line, separated by commas, semicolons, tabs or blanks (text_lines.hpp).
//          A first line without any number is a header; empty lines and lines that begin with # are
//          skipped.
//
//   const graybox::NumberTable table = graybox::read_number_table("points.csv");
//   table.values[row * table.columns + column]
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace graybox {

struct NumberTable {
  std::string path;
  std::vector<std::string> names;  // of the columns; empty where the file has no header
  std::size_t rows = 0;
  std::size_t columns = 0;
  std::vector<double> values;      // row-major, all finite
  std::vector<std::size_t> lines;  // of the rows in the file, from 1; empty for .npy
};

// Throws InputError with file, line and column for what is no table of finite numbers with at least
// one row. One pass over the file; Ctrl-C and time limits are obeyed (stop.hpp).
[[nodiscard]] NumberTable read_number_table(const std::string& path);

// "points.csv: line 12" or "points.npy: row 11", for messages about a row.
[[nodiscard]] std::string row_place(const NumberTable& table, std::size_t row);

}  // namespace graybox
