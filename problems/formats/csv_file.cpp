#include "graybox/problems/formats/csv_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <string_view>
#include <utility>

#include "graybox/problems/error.hpp"
#include "graybox/problems/formats/atomic_file.hpp"
#include "graybox/problems/formats/input_file.hpp"
#include "graybox/problems/formats/symmetric_packer.hpp"
#include "graybox/problems/formats/text_lines.hpp"
#include "graybox/problems/packed_matrix.hpp"

namespace graybox {
namespace {

// The fields of a line; a separator is a comma, a semicolon or a run of blanks.
class FieldReader {
 public:
  explicit FieldReader(std::string_view line) : rest_(line) {}

  bool next(std::string_view& field) {
    if (done_) return false;
    const std::size_t end = std::min(rest_.find_first_of(",; \t"), rest_.size());
    field = rest_.substr(0, end);
    rest_ = trimmed(rest_.substr(end));
    if (rest_.empty()) {
      done_ = true;
    } else if (rest_.front() == ',' || rest_.front() == ';') {
      rest_ = trimmed(rest_.substr(1));  // a separator at the end leaves one empty field
    }
    return true;
  }

 private:
  std::string_view rest_;
  bool done_ = false;
};

struct Extent {
  std::size_t rows = 0;
  std::size_t columns = 0;
  bool header = false;
};

Extent measure(const std::string& path) {
  LineReader lines(path);
  Extent extent;
  std::string_view line;
  while (lines.next(line)) {
    if (extent.columns > 0) {
      ++extent.rows;
      continue;
    }
    bool numeric = true;
    std::size_t columns = 0;
    double ignored = 0.0;
    std::string_view field;
    for (FieldReader fields(line); fields.next(field); ++columns) {
      numeric = parse_number(field, ignored) && numeric;
    }
    if (!numeric && !extent.header) {
      extent.header = true;
      continue;
    }
    extent.columns = columns;
    extent.rows = 1;
  }
  return extent;
}

void parse_line(const std::string& path, std::size_t number, std::string_view line,
                std::size_t columns, double* values) {
  std::size_t column = 0;
  std::string_view field;
  for (FieldReader fields(line); fields.next(field);) {
    double value = 0.0;
    if (!parse_number(field, value)) {
      throw InputError(
          fmt::format("{}: line {}, field {}: '{}' is no number", path, number, column + 1, field));
    }
    if (!std::isfinite(value)) {
      throw InputError(
          fmt::format("{}: line {}, field {}: {} is not finite; remove or repair that "
                      "candidate",
                      path, number, column + 1, field));
    }
    if (column < columns) values[column] = value;
    ++column;
  }
  if (column != columns) {
    throw InputError(
        fmt::format("{}: line {}: {} numbers, but {} in the first; every line is one "
                    "packed matrix of equal size",
                    path, number, column, columns));
  }
}

}  // namespace

InformationSet read_csv(const std::string& path) {
  { const InputFile present(path); }  // missing, a folder, empty
  const Extent extent = measure(path);
  if (extent.rows == 0) {
    throw InputError(
        fmt::format("{}: there are no candidates; expected one packed matrix a line", path));
  }
  const std::size_t dimension = dimension_from_packed_size(extent.columns);
  if (dimension == 0) {
    throw InputError(
        fmt::format("{}: {} numbers a line is no packed size d(d+1)/2 (1, 3, 6, 10, "
                    "...); expected the lower triangle H11, H21, H22, ...",
                    path, extent.columns));
  }
  AlignedArray information(extent.rows * extent.columns);
  LineReader lines(path);
  std::string_view line;
  if (extent.header) lines.next(line);
  for (std::size_t row = 0; row < extent.rows && lines.next(line); ++row) {
    parse_line(path, lines.number(), line, extent.columns,
               information.data() + row * extent.columns);
  }
  return InformationSet(dimension, std::move(information), {}, {}, path);
}

void write_csv(const std::string& path, const InformationSet& set) {
  AtomicFile target(path);
  {
    std::ofstream stream(target.temporary(), std::ios::binary);
    fmt::memory_buffer buffer;
    auto out = std::back_inserter(buffer);
    for (std::size_t i = 1; i <= set.dimension(); ++i) {
      for (std::size_t j = 1; j <= i; ++j) fmt::format_to(out, "{}H_{}_{}", i > 1 ? "," : "", i, j);
    }
    buffer.push_back('\n');
    for (std::size_t i = 0; i < set.candidate_count(); ++i) {
      fmt::format_to(out, "{}\n", fmt::join(set.information(i), ","));
      if (buffer.size() < (std::size_t{1} << 20)) continue;
      stream.write(buffer.data(), static_cast<std::streamsize>(buffer.size()));
      buffer.clear();
    }
    stream.write(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    stream.close();
    if (!stream) throw InputError(fmt::format("{}: can't be written: disk full?", path));
  }
  target.commit();
}

}  // namespace graybox
