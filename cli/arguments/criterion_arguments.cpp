#include "cli/arguments/criterion_arguments.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numeric>
#include <string_view>
#include <utility>
#include <vector>

#include "cli/arguments/option_groups.hpp"
#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/files/input_file.hpp"
#include "problems/formats/information_set_file.hpp"
#include "solvers/core/prediction_region.hpp"

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

// "a=1,b=4": one number for each parameter; zero for those that are not named.
std::vector<double> named_numbers(const InformationSet& set, const std::string& text,
                                  const std::string& option, std::string_view what) {
  std::vector<double> numbers(set.dimension(), 0.0);
  for (const std::string& part : split(text, ',')) {
    const std::size_t equals = part.find('=');
    if (equals == std::string::npos) {
      throw InputError(fmt::format("{}: '{}' is no name={}", option, part, what));
    }
    const std::vector<std::string> name{trimmed(std::string_view(part).substr(0, equals))};
    const std::size_t index = parameter_indices(set, name).front();
    const std::string value = trimmed(std::string_view(part).substr(equals + 1));
    numbers[index] = number(value, option + ": " + name.front());
  }
  return numbers;
}

// A diagonal W.
std::vector<double> named_weights(const InformationSet& set, const std::string& text) {
  const std::vector<double> diagonal = named_numbers(set, text, "--weights", "weight");
  std::vector<double> packed(set.packed_size(), 0.0);
  for (std::size_t k = 0; k < diagonal.size(); ++k) packed[packed_index(k, k)] = diagonal[k];
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

// Lines of d numbers, one after another.
std::vector<double> regressors(const InformationSet& set, const std::string& path) {
  std::vector<double> all;
  for (const std::vector<double>& row : read_rows(path)) {
    if (row.size() != set.dimension()) {
      throw InputError(fmt::format("{}: line {} has {} numbers; the set has {} parameters", path,
                                   all.size() / set.dimension() + 1, row.size(), set.dimension()));
    }
    all.insert(all.end(), row.begin(), row.end());
  }
  if (all.empty()) throw InputError(fmt::format("{}: no line of numbers", path));
  return all;
}

// W = sum_j c_j c_j^T.
Criterion read_combinations(const InformationSet& set, const std::string& text) {
  std::vector<double> all;
  if (text.find('=') == std::string::npos) {
    all = regressors(set, text);
  } else {
    for (const std::string& each : split(text, ';')) {
      const std::vector<double> c = named_numbers(set, each, "--combination", "factor");
      all.insert(all.end(), c.begin(), c.end());
    }
  }
  const PredictionRegion functions =
      PredictionRegion::of_regressors(set.dimension(), std::move(all));
  std::vector<double> weights = functions.mean_information();
  for (double& entry : weights) entry *= static_cast<double>(functions.count());
  return Criterion::c(std::move(weights));
}

bool is_table(const std::string& path) { return std::filesystem::path(path).extension() == ".csv"; }

// A CSV file with a regressor a line, or a second information set.
PredictionRegion read_region(const InformationSet& set, const std::string& path) {
  if (is_table(path))
    return PredictionRegion::of_regressors(set.dimension(), regressors(set, path));
  const InformationSet second = read_information_set(path);
  if (second.dimension() != set.dimension()) {
    throw InputError(fmt::format("{}: {} parameters; the set has {}", path, second.dimension(),
                                 set.dimension()));
  }
  return PredictionRegion::of_set(second);
}

Criterion read_prediction(const InformationSet& set, const std::string& path, CriterionKind kind) {
  if (path.empty()) {
    return kind == CriterionKind::kG ? Criterion::g() : Criterion::i(mean_information(set));
  }
  PredictionRegion region = read_region(set, path);
  return kind == CriterionKind::kG ? Criterion::g(std::move(region))
                                   : Criterion::i(region.mean_information());
}

double power_of(const std::string& text) {
  double p = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), p);
  if (error != std::errc() || end != text.data() + text.size()) {
    throw InputError(fmt::format("--p: '{}' is no number", text));
  }
  return p;
}

bool is_compound(const std::string& name) { return name.find('=') != std::string::npos; }

// "D=0.5,A=0.5".
std::vector<std::pair<CriterionKind, double>> shares_of(const std::string& name,
                                                        const std::string& option) {
  std::vector<std::pair<CriterionKind, double>> shares;
  for (const std::string& part : split(name, ',')) {
    const std::size_t equals = part.find('=');
    if (equals == std::string::npos) {
      throw InputError(fmt::format("{}: '{}' is no criterion=share", option, part));
    }
    const std::string kind = trimmed(std::string_view(part).substr(0, equals));
    shares.emplace_back(
        criterion_kind(kind),
        number(trimmed(std::string_view(part).substr(equals + 1)), option + ": " + kind));
  }
  return shares;
}

std::vector<CriterionKind> kinds_of(const std::string& name) {
  if (name.empty()) return {CriterionKind::kD};
  if (!is_compound(name)) return {criterion_kind(name)};
  std::vector<CriterionKind> kinds;
  for (const auto& [kind, share] : shares_of(name, "--criterion")) kinds.push_back(kind);
  return kinds;
}

// Whether `name` fits a pattern in which * stands for any text.
bool fits(std::string_view name, std::string_view pattern) {
  const std::size_t star = pattern.find('*');
  if (star == std::string_view::npos) return name == pattern;
  if (!name.starts_with(pattern.substr(0, star))) return false;
  for (std::size_t from = star; from <= name.size(); ++from) {
    if (fits(name.substr(from), pattern.substr(star + 1))) return true;
  }
  return false;
}

std::vector<std::size_t> named_by(const InformationSet& set, const std::string& name) {
  if (name.find('*') == std::string::npos) return parameter_indices(set, std::vector{name});
  std::vector<std::size_t> indices;
  for (std::size_t k = 0; k < set.parameters().size(); ++k) {
    if (fits(set.parameters()[k], name)) indices.push_back(k);
  }
  if (indices.empty()) {
    throw InputError(fmt::format("--interest: no parameter fits '{}'", name));
  }
  return indices;
}

// "a, b*, !c": names and patterns, less those after '!'. With these alone: all others.
std::vector<std::size_t> interest_indices(const InformationSet& set, const std::string& text) {
  std::vector<std::size_t> indices, left_out;
  bool named = false;
  for (const std::string& part : split(text, ',')) {
    const bool out = part.starts_with('!');
    named = named || !out;
    for (const std::size_t k : named_by(set, out ? trimmed(part.substr(1)) : part)) {
      (out ? left_out : indices).push_back(k);
    }
  }
  if (!named) {
    indices.resize(set.dimension());
    std::iota(indices.begin(), indices.end(), std::size_t{0});
  }
  std::erase_if(indices, [&](std::size_t k) { return std::ranges::count(left_out, k) > 0; });
  if (indices.empty()) throw InputError(fmt::format("--interest: '{}' leaves no parameter", text));
  return indices;
}

Criterion read_kind(const CriterionArguments& arguments, const InformationSet& set,
                    CriterionKind kind) {
  switch (kind) {
    case CriterionKind::kA:
      return Criterion::a();
    case CriterionKind::kE:
      return Criterion::e();
    case CriterionKind::kL:
      return Criterion::l(arguments.weights.find('=') == std::string::npos
                              ? weights_from_file(set, arguments.weights)
                              : named_weights(set, arguments.weights));
    case CriterionKind::kDs:
      return Criterion::ds(interest_indices(set, arguments.interest));
    case CriterionKind::kC:
      return read_combinations(set, arguments.combination);
    case CriterionKind::kI:
    case CriterionKind::kG:
      return read_prediction(set, arguments.region, kind);
    case CriterionKind::kPhiP:
      return Criterion::phi_p(power_of(arguments.p));
    case CriterionKind::kD:
    case CriterionKind::kCompound:
      break;
  }
  return {};
}

}  // namespace

void CriterionArguments::require_consistent() const {
  std::vector<CriterionKind> kinds = kinds_of(name);
  if (!floor.empty()) {
    for (const auto& [kind, share] : shares_of(floor, "--floor")) kinds.push_back(kind);
  }
  const auto asked = [&](CriterionKind kind) { return std::ranges::count(kinds, kind) > 0; };
  if (!is_compound(name) && asked(CriterionKind::kCompound)) {
    throw InputError("a compound criterion is given by its parts: --criterion D=0.5,A=0.5");
  }
  const auto belongs = [](bool given, bool fits, const char* text) {
    if (given && !fits) throw InputError(text);
  };
  const bool predicts = asked(CriterionKind::kI) || asked(CriterionKind::kG);
  belongs(!weights.empty(), asked(CriterionKind::kL), "--weights belongs to --criterion L");
  belongs(!interest.empty(), asked(CriterionKind::kDs), "--interest belongs to --criterion Ds");
  belongs(!combination.empty(), asked(CriterionKind::kC), "--combination belongs to --criterion c");
  belongs(!region.empty(), predicts, "--region belongs to --criterion I or G");
  belongs(!p.empty(), asked(CriterionKind::kPhiP), "--p belongs to --criterion phi_p");
  const auto needs = [&](CriterionKind kind, const std::string& option, const char* text) {
    if (asked(kind) && option.empty()) throw InputError(text);
  };
  needs(CriterionKind::kL, weights, "--criterion L needs --weights: a file, or name=weight,...");
  needs(CriterionKind::kDs, interest,
        "--criterion Ds needs --interest: names of parameters, separated by commas");
  needs(CriterionKind::kC, combination,
        "--criterion c needs --combination: name=factor,..., or a file with a function a line");
  needs(CriterionKind::kPhiP, p, "--criterion phi_p needs --p: 0 (D), 1 (A), inf (E) or between");
}

std::optional<Criterion> CriterionArguments::read(const InformationSet& set) const {
  if (name.empty()) return std::nullopt;
  if (!is_compound(name)) return read_kind(*this, set, criterion_kind(name));
  std::vector<CriterionPart> parts;
  for (const auto& [kind, share] : shares_of(name, "--criterion")) {
    parts.push_back({share, read_kind(*this, set, kind)});
  }
  return Criterion::compound(std::move(parts));
}

std::vector<EfficiencyFloor> CriterionArguments::read_floors(const InformationSet& set) const {
  std::vector<EfficiencyFloor> floors;
  if (floor.empty()) return floors;
  for (const auto& [kind, share] : shares_of(floor, "--floor")) {
    floors.push_back({.share = share, .criterion = read_kind(*this, set, kind), .multiplier = 0.0});
  }
  return floors;
}

void add_floor_option(CLI::App& command, CriterionArguments& arguments) {
  command
      .add_option("--floor", arguments.floor,
                  "the least efficiency under other criteria: A=0.9,I=0.8")
      ->group(kCriterionOptions);
}

void add_criterion_options(CLI::App& command, CriterionArguments& arguments) {
  command.add_option("--criterion", arguments.name,
                     "D (default), A, E, L, Ds, c, I, G, phi_p, or several with their shares: "
                     "D=0.5,A=0.5");
  const auto add = [&](const char* name, std::string& value, const char* text) {
    command.add_option(name, value, text)->group(kCriterionOptions);
  };
  add("--weights", arguments.weights,
      "W of criterion L: name=weight,... (a diagonal W), or a CSV file with W, or with one line "
      "for the variance of one combination of the parameters");
  add("--interest", arguments.interest,
      "parameters of interest of criterion Ds: names or indices, with commas; 'joint_*' all that "
      "begin so, '!block_*' all but those");
  add("--combination", arguments.combination,
      "linear functions of criterion c: name=factor,... with semicolons between them, or a CSV "
      "file with a function a line");
  add("--region", arguments.region,
      "where I and G predict: a CSV file with a regressor a line, or an information set (default: "
      "the candidates)");
  add("--p", arguments.p, "of criterion phi_p: above 0 (D) over 1 (A) to inf (E)");
}

}  // namespace graybox::cli
