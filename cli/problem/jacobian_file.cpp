#include "cli/problem/jacobian_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/files/input_file.hpp"
#include "problems/files/text_lines.hpp"
#include "problems/formats/npy_file.hpp"
#include "problems/formats/number_table.hpp"

namespace graybox::cli {
namespace {

bool is_array(const std::string& path) { return InputFile(path).head(6) == "\x93NUMPY"; }

// Takes the column `candidate` out of the table; empty where there is none.
std::vector<double> take_candidates(NumberTable& table) {
  const auto name = std::ranges::find(table.names, "candidate");
  if (name == table.names.end()) return {};
  const auto column = static_cast<std::size_t>(name - table.names.begin());
  std::vector<double> labels, rest;
  for (std::size_t k = 0; k < table.values.size(); ++k) {
    (k % table.columns == column ? labels : rest).push_back(table.values[k]);
  }
  table.names.erase(name);
  table.values = std::move(rest);
  --table.columns;
  if (table.columns == 0) throw InputError(table.path + ": there is no column but 'candidate'");
  return labels;
}

// Rows a candidate, which must be the same for all.
std::size_t rows_together(const NumberTable& table, const std::vector<double>& labels) {
  std::size_t outputs = 0;
  std::set<double> seen;
  for (std::size_t from = 0; from < labels.size();) {
    std::size_t to = from;
    while (to < labels.size() && labels[to] == labels[from]) ++to;
    if (!seen.insert(labels[from]).second) {
      throw InputError(fmt::format("{}: candidate {} is there already; keep its rows together",
                                   row_place(table, from), labels[from]));
    }
    if (outputs == 0) outputs = to;
    if (to - from != outputs) {
      throw InputError(
          fmt::format("{}: candidate {} has {} rows, but the first has {}; write one for each "
                      "output",
                      row_place(table, from), labels[from], to - from, outputs));
    }
    from = to;
  }
  return outputs;
}

void require_outputs(const std::string& path, std::size_t asked, std::size_t found) {
  if (asked == 0 || asked == found) return;
  throw InputError(
      fmt::format("{}: has {} rows a candidate, but --outputs is {}", path, found, asked));
}

Jacobians read_three_axes(const std::string& path, NpyArray array, std::size_t outputs) {
  if (array.fortran_order) {
    throw InputError(path + ": is stored column by column; save numpy.ascontiguousarray() of it");
  }
  require_outputs(path, outputs, array.shape[1]);
  Jacobians jacobians;
  jacobians.candidates = array.shape[0];
  jacobians.outputs = array.shape[1];
  jacobians.parameters = array.shape[2];
  jacobians.values = std::move(array.values);
  jacobians.source = path;
  return jacobians;
}

std::vector<std::string_view> parts(std::string_view text) {
  std::vector<std::string_view> found;
  for (;;) {
    const std::size_t comma = text.find(',');
    found.push_back(trimmed(text.substr(0, comma)));
    if (comma == std::string_view::npos) return found;
    text.remove_prefix(comma + 1);
  }
}

// The numbers of a text like "0.1,0.2"; nothing where one is no number.
std::optional<std::vector<double>> listed_numbers(std::string_view text) {
  std::vector<double> values;
  for (const std::string_view part : parts(text)) {
    double value = 0.0;
    if (!parse_number(part, value)) return std::nullopt;
    values.push_back(value);
  }
  return values;
}

std::vector<double> named_numbers(const std::string& text, const Jacobians& jacobians) {
  std::vector<double> values(jacobians.parameters, std::nan(""));
  for (const std::string_view part : parts(text)) {
    const std::size_t sign = part.find('=');
    const std::string_view name = trimmed(part.substr(0, sign));
    const auto found = std::ranges::find(jacobians.names, name);
    if (found == jacobians.names.end()) {
      throw InputError(fmt::format("--at: {} has no column '{}'", jacobians.source, name));
    }
    double& value = values[static_cast<std::size_t>(found - jacobians.names.begin())];
    if (sign == std::string_view::npos || !parse_number(trimmed(part.substr(sign + 1)), value)) {
      throw InputError(fmt::format("--at: '{}' is no name=value", part));
    }
  }
  for (std::size_t j = 0; j < values.size(); ++j) {
    if (!std::isfinite(values[j])) {
      throw InputError(fmt::format("--at: no number for '{}'", jacobians.names[j]));
    }
  }
  return values;
}

// A column's number of a nominal value, by names where both files have them.
std::vector<double> nominal_of_table(const NumberTable& table, const Jacobians& jacobians) {
  const std::size_t count = table.values.size();
  if (count != jacobians.parameters || (table.rows != 1 && table.columns != 1)) {
    throw InputError(fmt::format("{}: {} x {} numbers; expected one row of {}, as {} has columns",
                                 table.path, table.rows, table.columns, jacobians.parameters,
                                 jacobians.source));
  }
  if (table.names.size() != count || jacobians.names.size() != count) return table.values;
  std::vector<double> values(count);
  for (std::size_t j = 0; j < count; ++j) {
    const auto found = std::ranges::find(table.names, jacobians.names[j]);
    if (found == table.names.end()) {
      throw InputError(fmt::format("{}: header: there is no column '{}', which {} has", table.path,
                                   jacobians.names[j], jacobians.source));
    }
    values[j] = table.values[static_cast<std::size_t>(found - table.names.begin())];
  }
  return values;
}

}  // namespace

Jacobians read_jacobians(const std::string& path, std::size_t outputs) {
  if (is_array(path)) {
    NpyArray array = read_npy_array(path);
    if (array.shape.size() == 3) return read_three_axes(path, std::move(array), outputs);
  }
  NumberTable table = read_number_table(path);
  const std::vector<double> labels = take_candidates(table);
  if (!labels.empty()) {
    const std::size_t found = rows_together(table, labels);
    require_outputs(path, outputs, found);
    outputs = found;
  }
  Jacobians jacobians;
  jacobians.outputs = std::max<std::size_t>(outputs, 1);
  if (table.rows % jacobians.outputs != 0) {
    throw InputError(fmt::format("{}: {} rows are no multiple of --outputs {}", path, table.rows,
                                 jacobians.outputs));
  }
  jacobians.candidates = table.rows / jacobians.outputs;
  jacobians.parameters = table.columns;
  jacobians.values = std::move(table.values);
  jacobians.names = std::move(table.names);
  jacobians.source = path;
  return jacobians;
}

JacobianNoise read_noise(const std::string& text, std::size_t outputs) {
  if (auto numbers = listed_numbers(text)) {
    if (numbers->size() == 1) numbers->resize(outputs, numbers->front());
    if (numbers->size() != outputs) {
      throw InputError(
          fmt::format("--noise: {} standard deviations, but {} outputs; give one, or "
                      "one for each",
                      numbers->size(), outputs));
    }
    return JacobianNoise::deviations(*numbers);
  }
  const NumberTable table = read_number_table(text);
  if (table.rows != outputs || table.columns != outputs) {
    throw InputError(fmt::format("{}: {} x {} numbers; the covariance of {} outputs is {} x {}",
                                 text, table.rows, table.columns, outputs, outputs, outputs));
  }
  return JacobianNoise::covariance(table.values, outputs);
}

BlockEffects read_block_effects(const std::string& path, const Jacobians& jacobians,
                                std::size_t blocks) {
  NumberTable table = read_number_table(path);
  (void)take_candidates(table);
  const std::size_t rows = jacobians.candidates * jacobians.outputs;
  if (table.rows != rows) {
    throw InputError(fmt::format("{}: {} rows, but {} has {}; write one for each of them", path,
                                 table.rows, jacobians.source, rows));
  }
  return {.blocks = blocks,
          .effects = table.columns,
          .values = std::move(table.values),
          .names = std::move(table.names),
          .source = path};
}

std::vector<double> read_nominal(const std::string& text, const Jacobians& jacobians) {
  if (text.find('=') != std::string::npos) return named_numbers(text, jacobians);
  if (auto numbers = listed_numbers(text)) return *numbers;
  return nominal_of_table(read_number_table(text), jacobians);
}

CandidateTable read_coordinates(const std::string& path, std::size_t candidates) {
  NumberTable table = read_number_table(path);
  if (table.rows != candidates) {
    throw InputError(fmt::format("{}: {} rows, but there are {} candidates; write one row for each",
                                 path, table.rows, candidates));
  }
  CandidateTable coordinates;
  for (std::size_t j = 0; j < table.columns; ++j) {
    std::string name = table.names.empty() ? fmt::format("x{}", j + 1) : table.names[j];
    std::string unit;
    const std::size_t bracket = name.find('[');
    if (bracket != std::string::npos && bracket > 0 && name.ends_with(']')) {
      unit = name.substr(bracket + 1, name.size() - bracket - 2);
      name = trimmed(std::string_view(name).substr(0, bracket));
    }
    coordinates.names.push_back(std::move(name));
    coordinates.units.push_back(std::move(unit));
  }
  coordinates.values = std::move(table.values);
  return coordinates;
}

}  // namespace graybox::cli
