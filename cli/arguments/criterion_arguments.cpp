#include "cli/arguments/criterion_arguments.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <fstream>
#include <string_view>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/files/input_file.hpp"

namespace graybox::cli {
namespace {

std::string trimmed(std::string_view text) {
  const std::size_t from = text.find_first_not_of(" \t\r");
  if (from == std::string_view::npos) return {};
  return std::string(text.substr(from, text.find_last_not_of(" \t\r") - from + 1));
}

std::vector<std::string> split(std::string_view text, char separator) {
  std::vector<std::string> parts;
  while (true) {
    const std::size_t end = text.find(separator);
    parts.push_back(trimmed(text.substr(0, end)));
    if (end == std::string_view::npos) return parts;
    text.remove_prefix(end + 1);
  }
}

double number(const std::string& text, const std::string& where) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) {
    throw InputError(fmt::format("{}: '{}' is no number", where, text));
  }
  return value;
}

// "a=1,b=4": a diagonal W; parameters that are not named have weight zero.
std::vector<double> named_weights(const InformationSet& set, const std::string& text) {
  std::vector<double> packed(set.packed_size(), 0.0);
  for (const std::string& part : split(text, ',')) {
    const std::size_t equals = part.find('=');
    if (equals == std::string::npos) {
      throw InputError(fmt::format("--weights: '{}' is no name=weight", part));
    }
    const std::vector<std::string> name{trimmed(std::string_view(part).substr(0, equals))};
    const std::size_t index = parameter_indices(set, name).front();
    const std::string weight = trimmed(std::string_view(part).substr(equals + 1));
    packed[packed_index(index, index)] = number(weight, "--weights: " + name.front());
  }
  return packed;
}

std::vector<std::vector<double>> read_rows(const std::string& path) {
  { const InputFile present(path); }  // missing, a folder, empty
  std::ifstream stream(path);
  std::vector<std::vector<double>> rows;
  std::size_t line_number = 0;
  for (std::string line; std::getline(stream, line);) {
    ++line_number;
    line = trimmed(line);
    if (line.empty() || line.front() == '#') continue;
    std::vector<double>& row = rows.emplace_back();
    for (const std::string& field : split(line, ',')) {
      row.push_back(number(field, fmt::format("{}: line {}", path, line_number)));
    }
  }
  return rows;
}

// d lines of d numbers: W. One line of d numbers: the vector c of W = c c^T.
std::vector<double> weights_from_file(const InformationSet& set, const std::string& path) {
  const std::vector<std::vector<double>> rows = read_rows(path);
  const std::size_t d = set.dimension();
  const bool one_line = rows.size() == 1;
  if (!one_line && rows.size() != d) {
    throw InputError(fmt::format(
        "{}: {} lines; W takes {} lines of {} numbers, or one line for a single combination", path,
        rows.size(), d, d));
  }
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (rows[i].size() != d) {
      throw InputError(fmt::format("{}: row {} has {} numbers; the set has {} parameters", path,
                                   i + 1, rows[i].size(), d));
    }
  }
  std::vector<double> packed(packed_size(d));
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      if (!one_line && rows[i][j] != rows[j][i]) {
        throw InputError(fmt::format("{}: W is not symmetric: entry ({}, {}) is {}, ({}, {}) is {}",
                                     path, i + 1, j + 1, rows[i][j], j + 1, i + 1, rows[j][i]));
      }
      packed[packed_index(i, j)] = one_line ? rows[0][i] * rows[0][j] : rows[i][j];
    }
  }
  return packed;
}

}  // namespace

void CriterionArguments::require_consistent() const {
  const CriterionKind kind = name.empty() ? CriterionKind::kD : criterion_kind(name);
  if (!weights.empty() && kind != CriterionKind::kL) {
    throw InputError("--weights belongs to --criterion L");
  }
  if (!interest.empty() && kind != CriterionKind::kDs) {
    throw InputError("--interest belongs to --criterion Ds");
  }
  if (kind == CriterionKind::kL && weights.empty()) {
    throw InputError("--criterion L needs --weights: a file, or name=weight,...");
  }
  if (kind == CriterionKind::kDs && interest.empty()) {
    throw InputError("--criterion Ds needs --interest: names of parameters, separated by commas");
  }
}

std::optional<Criterion> CriterionArguments::read(const InformationSet& set) const {
  if (name.empty()) return std::nullopt;
  switch (criterion_kind(name)) {
    case CriterionKind::kA:
      return Criterion::a();
    case CriterionKind::kE:
      return Criterion::e();
    case CriterionKind::kL:
      return Criterion::l(weights.find('=') == std::string::npos ? weights_from_file(set, weights)
                                                                 : named_weights(set, weights));
    case CriterionKind::kDs:
      return Criterion::ds(parameter_indices(set, split(interest, ',')));
    case CriterionKind::kD:
      break;
  }
  return Criterion();
}

void add_criterion_options(CLI::App& command, CriterionArguments& arguments) {
  command.add_option("--criterion", arguments.name,
                     "D (default), A, E, L (with --weights) or Ds (with --interest)");
  command.add_option("--weights", arguments.weights,
                     "W of criterion L: name=weight,... (a diagonal W), or a CSV file with W, or "
                     "with one line for the variance of one combination of the parameters");
  command.add_option("--interest", arguments.interest,
                     "parameters of interest of criterion Ds: names or indices, with commas");
}

}  // namespace graybox::cli
