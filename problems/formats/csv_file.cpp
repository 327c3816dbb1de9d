#include "problems/formats/csv_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <fstream>
#include <iterator>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "problems/base/available_memory.hpp"
#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/input_file.hpp"
#include "problems/files/text_lines.hpp"
#include "problems/formats/number_table.hpp"
#include "problems/formats/symmetric_packer.hpp"
#include "problems/information/factor_form.hpp"

namespace graybox {
namespace {

// The entry (row, column) of a matrix that a column of the table holds, from 1.
struct Entry {
  std::size_t row = 0;
  std::size_t column = 0;
};

// "H_2_1" or "H21".
std::optional<Entry> entry_named(std::string_view name) {
  if (name.empty() || (name.front() != 'H' && name.front() != 'h')) return std::nullopt;
  name.remove_prefix(1);
  if (name.size() == 2 && std::isdigit(static_cast<unsigned char>(name[0])) != 0 &&
      std::isdigit(static_cast<unsigned char>(name[1])) != 0) {
    return Entry{static_cast<std::size_t>(name[0] - '0'), static_cast<std::size_t>(name[1] - '0')};
  }
  Entry entry;
  for (std::size_t* index : {&entry.row, &entry.column}) {
    if (name.empty() || name.front() != '_') return std::nullopt;
    name.remove_prefix(1);
    const auto [rest, error] = std::from_chars(name.data(), name.data() + name.size(), *index);
    if (error != std::errc()) return std::nullopt;
    name.remove_prefix(static_cast<std::size_t>(rest - name.data()));
  }
  return name.empty() ? std::optional<Entry>(entry) : std::nullopt;
}

// Where each column belongs in the packed lower triangle; empty if the header does not say.
class ColumnOrder {
 public:
  ColumnOrder(const std::string& path, const std::vector<std::string_view>& header)
      : path_(path), names_(header.begin(), header.end()) {
    const auto is_entry = [](std::string_view name) { return entry_named(name).has_value(); };
    const auto named = std::ranges::count_if(header, is_entry);
    if (named == 0) return;
    if (const auto other = std::ranges::find_if_not(header, is_entry); other != header.end()) {
      fail(fmt::format("column '{}' is no entry H_i_j, but others are; name all so, or none",
                       *other));
    }
    place_columns();
  }

  [[nodiscard]] const std::vector<std::size_t>& positions() const { return positions_; }

 private:
  [[noreturn]] void fail(const std::string& problem) const {
    throw InputError(fmt::format("{}: header: {}", path_, problem));
  }

  void place_columns() {
    const std::size_t dimension = dimension_from_packed_size(names_.size());
    if (dimension == 0) {
      fail(
          fmt::format("{} columns are no packed size d(d+1)/2 (1, 3, 6, 10, ...); write one "
                      "triangle, H_1_1, H_2_1, H_2_2, ...",
                      names_.size()));
    }
    std::vector<std::string_view> holder(names_.size());  // the column that fills each place
    for (const std::string_view name : names_) {
      const Entry entry = *entry_named(name);
      const auto [low, high] = std::minmax(entry.row, entry.column);
      if (low < 1 || high > dimension) {
        fail(fmt::format("{} is outside a matrix of {} parameters; {} columns are H_1_1 to H_{}_{}",
                         name, dimension, names_.size(), dimension, dimension));
      }
      const std::size_t position = packed_index(high - 1, low - 1);
      if (!holder[position].empty()) {
        fail(holder[position] == name
                 ? fmt::format("{} is there twice; write each entry once", name)
                 : fmt::format("{} and {} are the same entry; write one triangle", holder[position],
                               name));
      }
      holder[position] = name;
      positions_.push_back(position);
    }
  }

  const std::string& path_;
  std::vector<std::string> names_;
  std::vector<std::size_t> positions_;
};

struct Extent {
  std::size_t rows = 0;
  std::size_t columns = 0;
  bool header = false;
  std::vector<std::size_t> positions;  // of the columns in the packed triangle; empty: in order
};

Extent measure(const std::string& path) {
  LineReader lines(path);
  Extent extent;
  std::string_view line;
  if (!lines.next(line)) return extent;
  FieldSplitter fields(line);
  extent.header = is_header(fields.split(line));
  if (extent.header) {
    extent.positions = ColumnOrder(path, fields.split(line)).positions();
    if (!lines.next(line)) return extent;
    fields = FieldSplitter(line);  // a title above the table has no separators
  }
  extent.columns = fields.split(line).size();
  do ++extent.rows;
  while (lines.next(line));
  if (!extent.positions.empty() && extent.positions.size() != extent.columns) {
    throw InputError(fmt::format("{}: header: {} columns are named, but a line has {} numbers",
                                 path, extent.positions.size(), extent.columns));
  }
  return extent;
}

void parse_line(const std::string& path, std::size_t number, const Extent& extent,
                const std::vector<std::string_view>& fields, double* values) {
  for (std::size_t column = 0; column < fields.size(); ++column) {
    const std::string_view field = fields[column];
    const double value = number_in_table(path, number, std::to_string(column + 1), field);
    if (!std::isfinite(value)) {
      throw InputError(
          fmt::format("{}: line {}, column {}: {} is not finite; remove or repair that "
                      "candidate",
                      path, number, column + 1, field));
    }
    if (column >= extent.columns) continue;
    values[extent.positions.empty() ? column : extent.positions[column]] = value;
  }
  if (fields.size() != extent.columns) {
    throw InputError(
        fmt::format("{}: line {}: {} numbers, but {} in the first; every line is one "
                    "packed matrix of equal size",
                    path, number, fields.size(), extent.columns));
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
  require_memory_for_numbers(
      static_cast<long double>(extent.rows) * static_cast<long double>(extent.columns), path);
  AlignedArray information(extent.rows * extent.columns);
  LineReader lines(path);
  std::string_view line;
  if (extent.header) lines.next(line);
  std::optional<FieldSplitter> fields;
  for (std::size_t row = 0; row < extent.rows && lines.next(line); ++row) {
    if (!fields) fields.emplace(line);
    parse_line(path, lines.number(), extent, fields->split(line),
               information.data() + row * extent.columns);
  }
  return InformationSet(dimension, std::move(information), {}, {}, path);
}

InformationSet read_csv_factors(const std::string& path) {
  NumberTable table = read_number_table(path);
  AlignedArray factors(table.values.size());
  std::ranges::copy(table.values, factors.begin());
  require_finite_factors(path, factors.span(), 1, table.columns);
  return InformationSet::of_factors(table.columns, 1, std::move(factors), {},
                                    std::move(table.names), path);
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
