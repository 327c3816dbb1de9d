#include "solvers/constrained/design_request.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <span>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/sha256.hpp"
#include "problems/files/text_lines.hpp"
#include "problems/files/yaml_field.hpp"
#include "problems/formats/information_set_file.hpp"
#include "problems/formats/symmetric_packer.hpp"
#include "solvers/constrained/block_sizes.hpp"
#include "solvers/constrained/candidate_selection.hpp"
#include "solvers/constrained/request_tables.hpp"

namespace graybox {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::string_view kFormat = "graybox-request/1";

RequestedConstraint read_constraint(const YamlField& entry) {
  entry.allow_keys({"name", "candidates", "coefficients", "at_most", "at_least", "equal"});
  RequestedConstraint out;
  const auto take = [&](const char* key, std::string& to) {
    if (entry.has(key)) to = entry.at(key).text();
  };
  take("candidates", out.candidates);
  take("coefficients", out.coefficients);
  take("at_most", out.at_most);
  take("at_least", out.at_least);
  take("equal", out.equal);
  out.name = out.candidates.empty() ? out.coefficients : out.candidates;
  take("name", out.name);
  if (out.candidates.empty() == out.coefficients.empty()) {
    entry.fail("give either candidates (a selection) or coefficients (a file or a coordinate)");
  }
  const bool has_bound = !out.at_most.empty() || !out.at_least.empty();
  if (has_bound == !out.equal.empty()) entry.fail("give at_most, at_least or both, or equal");
  return out;
}

void read_constraints(const YamlField& list, DesignRequest& request) {
  for (const YamlField& entry : list.items()) request.constraints.push_back(read_constraint(entry));
}

// Puts a request into numbers.
class Resolver {
 public:
  Resolver(const DesignRequest& request, const InformationSet& set)
      : request_(request), set_(set) {}

  DesignConstraints resolve() {
    require_consistent();
    bound_effort();
    add_limits();
    add_prior();
    if (!request_.block_sizes.empty()) {
      std::ranges::move(block_size_rows(set_, request_.block_sizes), std::back_inserter(out_.rows));
    }
    for (const RequestedConstraint& wanted : request_.constraints) add_constraint(wanted);
    if (!request_.constraints_file.empty()) add_file();
    std::ranges::copy(request_.numbers.rows, std::back_inserter(out_.rows));
    require_fits(out_, set_);
    return std::move(out_);
  }

 private:
  [[nodiscard]] std::string path(const std::string& name) const {
    return fs::path(name).is_absolute() ? name : (request_.folder / name).string();
  }

  void require_consistent() const {
    const RequestedNumbers& numbers = request_.numbers;
    if (request_.budget.has_value() == (request_.costs.empty() && numbers.costs.empty())) {
      throw InputError("costs and budget belong together; give both or neither");
    }
    if (request_.number().has_value() || request_.budget.has_value()) return;
    for (const auto& [name, none] :
         {std::pair{"prior", request_.prior.empty() && numbers.prior.empty()},
          std::pair{"done", request_.done.empty() && numbers.done.empty()},
          std::pair{"stock", request_.stock.empty() && numbers.stock.empty()},
          std::pair{"require", request_.require.empty()},
          std::pair{"block_sizes", request_.block_sizes.empty()}}) {
      if (none) continue;
      throw InputError(fmt::format(
          "{} counts experiments; say how many come next (experiments) or what they may cost "
          "(budget)",
          name));
    }
  }

  void bound_effort() {
    if (!request_.budget.has_value()) {
      out_ = number_of_experiments(set_, request_.number().value_or(1.0));
      return;
    }
    out_ = cost_budget(costs(), *request_.budget);
    if (const auto number = request_.number()) {
      out_.rows.push_back(number_of_experiments(set_, *number).rows.front());
    }
  }

  [[nodiscard]] std::vector<double> costs() const {
    if (!request_.numbers.costs.empty()) return request_.numbers.costs;
    double price = 0.0;
    if (parse_number(request_.costs, price)) {
      return std::vector<double>(set_.candidate_count(), price);
    }
    return candidate_numbers(set_, request_.costs, path(request_.costs), "costs");
  }

  void add_limits() {
    out_.upper = request_.numbers.stock;
    if (!request_.stock.empty()) {
      double number = 0.0;
      out_.upper = parse_number(request_.stock, number)
                       ? std::vector<double>(set_.candidate_count(), number)
                       : candidate_numbers(set_, request_.stock, path(request_.stock), "stock");
    }
    if (!request_.forbid.empty()) {
      out_.upper.resize(set_.candidate_count(), kInfinity);
      for (const std::size_t i : select_candidates(set_, request_.forbid, "forbid")) {
        out_.upper[i] = 0.0;
      }
    }
    if (!request_.require.empty()) out_.lower = select_counts(set_, request_.require, "require");
  }

  void add_prior() {
    if (!request_.has_prior()) return;
    out_.prior = request_.numbers.prior;
    if (out_.prior.empty()) out_.prior.assign(set_.packed_size(), 0.0);
    if (out_.prior.size() != set_.packed_size()) refuse_prior("prior", 1, out_.prior.size());
    if (!request_.prior.empty()) add_prior_file(path(request_.prior));
    std::vector<double> done = request_.numbers.done;
    if (!request_.done.empty()) done = experiments_done(set_, path(request_.done));
    if (!done.empty()) add_done(done);
  }

  [[noreturn]] void refuse_prior(const std::string& source, std::size_t count,
                                 std::size_t packed) const {
    throw InputError(
        fmt::format("{}: {} matrices of {} parameters; a prior is one matrix of the set's {}",
                    source, count, dimension_from_packed_size(packed), set_.dimension()));
  }

  void add_prior_file(const std::string& file) {
    const InformationSet prior = read_information_set(file);
    if (prior.candidate_count() != 1 || prior.dimension() != set_.dimension()) {
      refuse_prior(file, prior.candidate_count(), prior.packed_size());
    }
    const auto h = prior.information(0);
    for (std::size_t k = 0; k < h.size(); ++k) out_.prior[k] += h[k];
  }

  void add_done(std::span<const double> done) {
    if (done.size() != set_.candidate_count()) {
      throw InputError(fmt::format("done: {} numbers; the set has {} candidates", done.size(),
                                   set_.candidate_count()));
    }
    for (std::size_t i = 0; i < done.size(); ++i) {
      if (!(done[i] >= 0.0 && std::isfinite(done[i]))) {
        throw InputError(
            fmt::format("done: candidate {}: {} is no number of experiments", i, done[i]));
      }
      const auto h = set_.information(i);
      for (std::size_t k = 0; done[i] != 0.0 && k < h.size(); ++k) {
        out_.prior[k] += done[i] * h[k];
      }
    }
  }

  void add_constraint(const RequestedConstraint& wanted) {
    LinearConstraint row{.name = wanted.name, .coefficients = {}};
    if (!wanted.candidates.empty()) {
      row.coefficients.assign(set_.candidate_count(), 0.0);
      const std::string what = fmt::format("constraint '{}'", wanted.name);
      for (const std::size_t i : select_candidates(set_, wanted.candidates, what)) {
        row.coefficients[i] = 1.0;
      }
    } else {
      row.coefficients = candidate_numbers(set_, wanted.coefficients, path(wanted.coefficients),
                                           fmt::format("constraint '{}'", wanted.name));
    }
    if (!wanted.equal.empty()) {
      add_bound(row, wanted.equal, true, true);
      return;
    }
    // Bounds of one kind stand in one row.
    const bool one = wanted.at_most.find('%') == wanted.at_least.find('%');
    if (!wanted.at_most.empty() && !wanted.at_least.empty() && one && !percent(wanted.at_most)) {
      row.lower = number(wanted.name, wanted.at_least);
      row.upper = number(wanted.name, wanted.at_most);
      out_.rows.push_back(std::move(row));
      return;
    }
    if (!wanted.at_most.empty()) add_bound(row, wanted.at_most, false, true);
    if (!wanted.at_least.empty()) add_bound(row, wanted.at_least, true, false);
  }

  static bool percent(const std::string& text) { return text.find('%') != std::string::npos; }

  static double number(const std::string& name, const std::string& text) {
    double value = 0.0;
    const std::size_t sign = text.find('%');
    const std::string_view digits = trimmed(std::string_view(text).substr(0, sign));
    const bool more = sign != std::string::npos && !trimmed(text.substr(sign + 1)).empty();
    if (more || !parse_number(digits, value) || !std::isfinite(value)) {
      throw InputError(
          fmt::format("constraint '{}': '{}' is no bound; write 6 or 30 %", name, text));
    }
    return value;
  }

  // A share of all experiments, sum_i (a_i - share) x_i against zero, or a number.
  void add_bound(LinearConstraint row, const std::string& text, bool below, bool above) {
    double bound = number(row.name, text);
    if (percent(text)) {
      if (request_.number().has_value() || !request_.budget.has_value()) {
        bound *= 0.01 * request_.number().value_or(1.0);
      } else {
        for (double& a : row.coefficients) a -= 0.01 * bound;
        bound = 0.0;
      }
    }
    if (below) row.lower = bound;
    if (above) row.upper = bound;
    out_.rows.push_back(std::move(row));
  }

  void add_file() {
    const std::string file = path(request_.constraints_file);
    const std::string extension = fs::path(file).extension().string();
    if (extension == ".yaml" || extension == ".yml") {
      const YamlField root = YamlField::load(file);
      root.allow_keys({"constraints"});
      DesignRequest listed;
      read_constraints(root.at("constraints"), listed);
      for (RequestedConstraint& wanted : listed.constraints) {
        const fs::path beside = fs::path(file).parent_path() / wanted.coefficients;
        if (!wanted.coefficients.empty() && fs::exists(beside)) {
          wanted.coefficients = fs::absolute(beside).string();
        }
        add_constraint(wanted);
      }
      return;
    }
    std::ranges::move(constraint_table(set_, file), std::back_inserter(out_.rows));
  }

  const DesignRequest& request_;
  const InformationSet& set_;
  DesignConstraints out_;
};

}  // namespace

bool DesignRequest::has_prior() const {
  return !(prior.empty() && done.empty() && numbers.prior.empty() && numbers.done.empty());
}

std::optional<double> DesignRequest::number() const {
  if (experiments.has_value() || block_sizes.empty()) return experiments;
  return experiments_in_blocks(block_sizes);
}

bool DesignRequest::any() const {
  return experiments.has_value() || budget.has_value() || !constraints.empty() || numbers.any() ||
         std::ranges::any_of(std::array{&prior, &done, &costs, &stock, &require, &forbid,
                                        &block_sizes, &constraints_file},
                             [](const std::string* text) { return !text->empty(); });
}

DesignRequest read_design_request(const fs::path& path) {
  const YamlField root = YamlField::load(path);
  root.allow_keys({"format", "experiments", "prior", "done", "costs", "budget", "stock", "require",
                   "forbid", "block_sizes", "constraints"});
  if (root.at("format").text() != kFormat) {
    root.at("format").fail(fmt::format("expected {}", kFormat));
  }
  DesignRequest request;
  request.folder = path.parent_path();
  if (root.has("experiments")) request.experiments = root.at("experiments").positive();
  if (root.has("budget")) request.budget = root.at("budget").positive();
  const auto take = [&](const char* key, std::string& to) {
    if (root.has(key)) to = root.at(key).text();
  };
  take("prior", request.prior);
  take("done", request.done);
  take("costs", request.costs);
  take("stock", request.stock);
  take("require", request.require);
  take("forbid", request.forbid);
  take("block_sizes", request.block_sizes);
  if (!root.has("constraints")) return request;
  if (root.at("constraints").is_list()) {
    read_constraints(root.at("constraints"), request);
  } else {
    take("constraints", request.constraints_file);
  }
  return request;
}

DesignConstraints resolve(const DesignRequest& request, const InformationSet& set) {
  return Resolver(request, set).resolve();
}

std::string describe(const DesignRequest& request) {
  std::vector<std::string> parts;
  if (const auto number = request.number()) {
    parts.push_back(fmt::format("{:g} experiments", *number));
  }
  if (request.budget.has_value()) parts.push_back(fmt::format("a budget of {:g}", *request.budget));
  const auto add = [&](const char* what, const std::string& text) {
    if (!text.empty()) parts.push_back(fmt::format("{} {}", what, text));
  };
  const auto add_either = [&](const char* what, const std::string& text,
                              const std::vector<double>& values) {
    if (!values.empty()) parts.push_back(fmt::format("{} in numbers", what));
    add(what, text);
  };
  add_either("prior", request.prior, request.numbers.prior);
  add_either("done", request.done, request.numbers.done);
  add_either("stock", request.stock, request.numbers.stock);
  add("required", request.require);
  add("forbidden", request.forbid);
  add("blocks of", request.block_sizes);
  add("constraints", request.constraints_file);
  for (const RequestedConstraint& wanted : request.constraints) parts.push_back(wanted.name);
  for (const LinearConstraint& row : request.numbers.rows) parts.push_back(row.name);
  return fmt::format("{}", fmt::join(parts, ", "));
}

std::string content_hash(const DesignConstraints& constraints) {
  Sha256 hash;
  const auto add = [&](const std::vector<double>& values) {
    const std::uint64_t count = values.size();
    hash.update(&count, sizeof count);
    hash.update(values.data(), values.size() * sizeof(double));
  };
  add(constraints.prior);
  add(constraints.lower);
  add(constraints.upper);
  for (const LinearConstraint& row : constraints.rows) {
    add(row.coefficients);
    add({row.lower, row.upper});
  }
  return hash.hexadecimal();
}

namespace {

// Infinite numbers, of which limits have some, are null.
Json numbers_json(const RequestedNumbers& numbers) {
  Json out = Json::object();
  for (const auto& [key, values] :
       {std::pair{"prior", &numbers.prior}, std::pair{"done", &numbers.done},
        std::pair{"costs", &numbers.costs}, std::pair{"stock", &numbers.stock}}) {
    if (!values->empty()) out[key] = *values;
  }
  for (const LinearConstraint& row : numbers.rows) {
    out["rows"].push_back({{"name", row.name},
                           {"coefficients", row.coefficients},
                           {"lower", row.lower},
                           {"upper", row.upper}});
  }
  return out;
}

// A number, or null for one that is infinite.
double number_or(const Json& value, double infinite) {
  if (value.is_null()) return infinite;
  if (!value.is_number()) throw InputError("request.numbers must hold numbers");
  return value.get<double>();
}

std::vector<double> listed_numbers(const Json& parent, const char* key) {
  std::vector<double> out;
  const auto found = parent.find(key);
  if (found == parent.end()) return out;
  if (!found->is_array()) throw InputError(fmt::format("request.numbers.{} must be a list", key));
  for (const Json& value : *found) out.push_back(number_or(value, kInfinity));
  return out;
}

RequestedNumbers requested_numbers(const Json& entry) {
  if (!entry.is_object()) throw InputError("request.numbers must be an object");
  RequestedNumbers out{.prior = listed_numbers(entry, "prior"),
                       .done = listed_numbers(entry, "done"),
                       .costs = listed_numbers(entry, "costs"),
                       .stock = listed_numbers(entry, "stock"),
                       .rows = {}};
  if (!entry.contains("rows")) return out;
  if (!entry["rows"].is_array()) throw InputError("request.numbers.rows must be a list");
  for (const Json& row : entry["rows"]) {
    if (!row.is_object() || !row.contains("name") || !row["name"].is_string()) {
      throw InputError("request.numbers.rows must hold objects with a name");
    }
    out.rows.push_back({.name = row["name"].get<std::string>(),
                        .coefficients = listed_numbers(row, "coefficients"),
                        .lower = number_or(row.value("lower", Json()), -kInfinity),
                        .upper = number_or(row.value("upper", Json()), kInfinity)});
  }
  return out;
}

}  // namespace

Json to_json(const DesignRequest& request, const DesignConstraints& constraints,
             const fs::path& folder) {
  Json out = Json::object();
  const auto file = [&](const std::string& name) {
    double number = 0.0;
    const fs::path full = fs::path(name).is_absolute() ? fs::path(name) : request.folder / name;
    if (parse_number(name, number) || !fs::exists(full)) return name;  // a number or a coordinate
    std::error_code error;
    const fs::path relative = fs::relative(full, folder.empty() ? fs::path(".") : folder, error);
    return error || relative.empty() ? full.string() : relative.string();
  };
  const auto add = [&](const char* key, const std::string& text, bool is_file) {
    if (!text.empty()) out[key] = is_file ? file(text) : text;
  };
  if (request.experiments.has_value()) out["experiments"] = *request.experiments;
  if (request.budget.has_value()) out["budget"] = *request.budget;
  add("prior", request.prior, true);
  add("done", request.done, true);
  add("costs", request.costs, true);
  add("stock", request.stock, true);
  add("require", request.require, false);
  add("forbid", request.forbid, false);
  add("block_sizes", request.block_sizes, false);
  add("constraints_file", request.constraints_file, true);
  for (const RequestedConstraint& wanted : request.constraints) {
    Json entry{{"name", wanted.name}};
    for (const auto& [key, text] :
         {std::pair{"candidates", wanted.candidates},
          std::pair{"coefficients", wanted.coefficients.empty() ? "" : file(wanted.coefficients)},
          std::pair{"at_most", wanted.at_most}, std::pair{"at_least", wanted.at_least},
          std::pair{"equal", wanted.equal}}) {
      if (!text.empty()) entry[key] = text;
    }
    out["constraints"].push_back(std::move(entry));
  }
  if (request.numbers.any()) out["numbers"] = numbers_json(request.numbers);
  out["constraints_hash"] = content_hash(constraints);
  return out;
}

DesignRequest design_request(const Json& entry, const fs::path& folder) {
  DesignRequest request;
  request.folder = folder;
  const auto text = [](const Json& parent, const char* key) {
    const auto found = parent.find(key);
    if (found == parent.end()) return std::string();
    if (!found->is_string()) throw InputError(fmt::format("request.{} must be text", key));
    return found->get<std::string>();
  };
  const auto number = [&](const char* key, std::optional<double>& to) {
    const auto found = entry.find(key);
    if (found == entry.end()) return;
    if (!found->is_number()) throw InputError(fmt::format("request.{} must be a number", key));
    to = found->get<double>();
  };
  if (!entry.is_object()) throw InputError("request must be an object");
  number("experiments", request.experiments);
  number("budget", request.budget);
  request.prior = text(entry, "prior");
  request.done = text(entry, "done");
  request.costs = text(entry, "costs");
  request.stock = text(entry, "stock");
  request.require = text(entry, "require");
  request.forbid = text(entry, "forbid");
  request.block_sizes = text(entry, "block_sizes");
  request.constraints_file = text(entry, "constraints_file");
  if (entry.contains("numbers")) request.numbers = requested_numbers(entry["numbers"]);
  if (!entry.contains("constraints")) return request;
  if (!entry["constraints"].is_array()) throw InputError("request.constraints must be a list");
  for (const Json& wanted : entry["constraints"]) {
    if (!wanted.is_object()) throw InputError("request.constraints must hold objects");
    request.constraints.push_back({.name = text(wanted, "name"),
                                   .candidates = text(wanted, "candidates"),
                                   .coefficients = text(wanted, "coefficients"),
                                   .at_most = text(wanted, "at_most"),
                                   .at_least = text(wanted, "at_least"),
                                   .equal = text(wanted, "equal")});
  }
  return request;
}

}  // namespace graybox
