// The reading half of design_file.hpp. It needs no solver, so that the fuzzer links it alone.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <string_view>
#include <type_traits>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/files/file_message.hpp"
#include "problems/files/json_file.hpp"
#include "solvers/report/design_file.hpp"

namespace graybox {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kFormat = "graybox-design/1";
constexpr double kSignTolerance = 1e-12;  // as certify() has them
constexpr double kSumTolerance = 1e-9;

// The path begins every message.
class DesignReader {
 public:
  DesignReader(const std::string& path, const InformationSet& set) : path_(path), set_(set) {}

  DesignFile read(WeightCheck check) {
    parse();
    DesignFile file;
    file.solver = text(root_, "solver");
    file.status = text(root_, "status");
    file.message = text(root_, "message");
    file.problem_hash = text(root_, "problem_hash");
    require_this_problem(file.problem_hash);
    file.asked_gap = number(object("options"), "options.", "duality_gap");
    const Json counters = object("counters");
    file.counters.seconds = number(counters, "counters.", "seconds").value_or(0.0);
    file.counters.passes = number(counters, "counters.", "passes").value_or(0.0);
    file.counters.iterations = whole(number(counters, "counters.", "iterations").value_or(0.0));
    file.criterion = criterion();
    file.limits = limits();
    file.floors = floors();
    file.objective = text(object("objective"), "name");
    file.account = account();
    file.design.weights = weights();
    if (check == WeightCheck::kRepaired) repair(file);
    if (check != WeightCheck::kForChecker) require_simplex(file.design.weights);
    file.design.dual_matrix = numbers<double>(root_, "", "dual_matrix");
    file.design.dual_weights = numbers<double>(root_, "", "dual_weights");
    return file;
  }

 private:
  [[noreturn]] void fail(const std::string& problem) const {
    throw InputError(in_file(path_, problem));
  }

  void parse() {
    root_ = read_json_file<Json>(path_);
    if (!root_.is_object()) fail(fmt::format("no JSON object; expected format {}", kFormat));
    const std::string format = text(root_, "format");
    if (format != kFormat) {
      fail(fmt::format("format is {}; expected {}", format.empty() ? "missing" : "'" + format + "'",
                       kFormat));
    }
  }

  // Beyond 2^53 doubles are no counts.
  static std::int64_t whole(double value) {
    constexpr double kLargest = 9007199254740992.0;
    return static_cast<std::int64_t>(std::clamp(value, 0.0, kLargest));
  }

  [[nodiscard]] std::string text(const Json& parent, const char* key) const {
    const auto found = parent.find(key);
    if (found == parent.end() || found->is_null()) return {};
    if (!found->is_string()) fail(fmt::format("{} must be text", key));
    return found->get<std::string>();
  }

  [[nodiscard]] Json object(const char* key) const {
    const auto found = root_.find(key);
    if (found == root_.end()) return Json::object();
    if (!found->is_object()) fail(fmt::format("{} must be an object", key));
    return *found;
  }

  [[nodiscard]] std::optional<double> number(const Json& parent, const char* where,
                                             const char* key) const {
    const auto found = parent.find(key);
    if (found == parent.end() || found->is_null()) return std::nullopt;
    if (!found->is_number()) fail(fmt::format("{}{} must be a number", where, key));
    return found->get<double>();
  }

  // An array of numbers; empty where there is none.
  template <typename Number>
  [[nodiscard]] std::vector<Number> numbers(const Json& parent, const char* where,
                                            const char* key) const {
    const auto found = parent.find(key);
    if (found == parent.end() || found->is_null()) return {};
    const auto fits = [](const Json& entry) {
      return std::is_integral_v<Number> ? entry.is_number_unsigned() : entry.is_number();
    };
    if (!found->is_array() || !std::ranges::all_of(*found, fits)) {
      fail(fmt::format("{}{} must be an array of {}", where, key,
                       std::is_integral_v<Number> ? "indices" : "numbers"));
    }
    return found->get<std::vector<Number>>();
  }

  [[nodiscard]] DesignLimits limits() const {
    DesignLimits found;
    const Json root = object("limits");
    for (const auto& [name, entry] : root.items()) {
      if (name == "concentration") {
        found.concentration = {share(entry, name), count(entry, name, "positions")};
      } else if (name == "block_share") {
        found.block_share = {share(entry, name), count(entry, name, "block_size")};
      } else {
        fail(fmt::format("unknown limit '{}'; the checker knows concentration and block_share",
                         name));
      }
    }
    try {
      require_fits(found, set_);
    } catch (const InputError& error) {
      fail(error.what());
    }
    return found;
  }

  [[nodiscard]] double share(const Json& entry, const std::string& limit) const {
    const auto found = entry.is_object() ? entry.find("largest_share") : entry.end();
    if (found == entry.end() || !found->is_number()) {
      fail(fmt::format("limits.{}.largest_share must be a number", limit));
    }
    return found->get<double>();
  }

  [[nodiscard]] std::size_t count(const Json& entry, const std::string& limit,
                                  const char* key) const {
    const auto found = entry.is_object() ? entry.find(key) : entry.end();
    if (found == entry.end() || !found->is_number_unsigned() || *found == 0U) {
      fail(fmt::format("limits.{}.{} must be a positive integer", limit, key));
    }
    return found->get<std::size_t>();
  }

  [[nodiscard]] std::optional<Criterion> criterion() const {
    if (!root_.contains("criterion")) return std::nullopt;
    const Json entry = object("criterion");
    try {
      Criterion found = criterion_of(entry);
      found.require_fits(set_);
      return found;
    } catch (const InputError& error) {
      fail(error.what());
    }
  }

  [[nodiscard]] Criterion criterion_of(const Json& entry) const {
    const CriterionKind kind = criterion_kind(text(entry, "name"));
    switch (kind) {
      case CriterionKind::kA:
        return Criterion::a();
      case CriterionKind::kE:
        return Criterion::e();
      case CriterionKind::kL:
        return Criterion::l(numbers<double>(entry, "criterion.", "weights"));
      case CriterionKind::kDs:
        return Criterion::ds(numbers<std::size_t>(entry, "criterion.", "interest"));
      case CriterionKind::kC:
        return Criterion::c(numbers<double>(entry, "criterion.", "weights"));
      case CriterionKind::kI:
        return Criterion::i(numbers<double>(entry, "criterion.", "weights"));
      case CriterionKind::kPhiP:
        return Criterion::phi_p(number(entry, "criterion.", "p").value_or(std::nan("")));
      case CriterionKind::kG:
        return entry.contains("region") ? Criterion::g(region_of(entry["region"])) : Criterion::g();
      case CriterionKind::kCompound:
        return Criterion::compound(parts_of(entry));
      case CriterionKind::kD:
        break;
    }
    return {};
  }

  [[nodiscard]] std::vector<EfficiencyFloor> floors() const {
    const auto found = root_.find("floors");
    if (found == root_.end()) return {};
    if (!found->is_array()) fail("floors must be an array");
    std::vector<EfficiencyFloor> all;
    for (const Json& floor : *found) {
      if (!floor.is_object() || !floor.contains("criterion") || !floor["criterion"].is_object()) {
        fail("floors: each must be an object with share, criterion and multiplier");
      }
      try {
        all.push_back({.share = number(floor, "floors.", "share").value_or(std::nan("")),
                       .criterion = criterion_of(floor["criterion"]),
                       .multiplier = number(floor, "floors.", "multiplier").value_or(0.0)});
        all.back().criterion.require_fits(set_);
      } catch (const InputError& error) {
        fail(error.what());
      }
    }
    return all;
  }

  [[nodiscard]] PredictionRegion region_of(const Json& entry) const {
    if (!entry.is_object()) fail("criterion.region must be an object");
    return {set_.dimension(), numbers<double>(entry, "criterion.region.", "rows"),
            numbers<std::size_t>(entry, "criterion.region.", "row_counts")};
  }

  // Parts that are compound themselves are refused before they are read, whatever their depth.
  [[nodiscard]] std::vector<CriterionPart> parts_of(const Json& entry) const {
    const auto found = entry.find("parts");
    if (found == entry.end() || !found->is_array()) fail("criterion.parts must be an array");
    std::vector<CriterionPart> parts;
    for (const Json& part : *found) {
      if (!part.is_object() || !part.contains("criterion") || !part["criterion"].is_object()) {
        fail("criterion.parts: each must be an object with share and criterion");
      }
      const Json& inner = part["criterion"];
      if (criterion_kind(text(inner, "name")) == CriterionKind::kCompound) {
        fail("criterion.parts: a part can't be compound itself");
      }
      parts.push_back(
          {number(part, "criterion.parts.", "share").value_or(std::nan("")), criterion_of(inner)});
    }
    return parts;
  }

  void require_this_problem(const std::string& stated) const {
    for (const auto& [key, value] : {std::pair{"candidates", set_.candidate_count()},
                                     std::pair{"dimension", set_.dimension()}}) {
      const auto there = number(root_, "", key);
      if (there.has_value() && *there != static_cast<double>(value)) {
        fail(fmt::format("{} is {}, but {} has {}; this design is of another problem", key, *there,
                         set_.name(), value));
      }
    }
    if (stated.empty()) return;
    const std::string hash = set_.content_hash();
    if (stated != hash) {
      fail(
          fmt::format("problem_hash starts {:.12} but {} has {:.12}; this design is of another "
                      "problem",
                      stated, set_.name(), hash));
    }
  }

  [[nodiscard]] OwnAccount account() const {
    OwnAccount account;
    account.seconds = number(root_, "", "seconds");
    if (!account.seconds) account.seconds = number(object("counters"), "counters.", "seconds");
    if (account.seconds && !(*account.seconds >= 0.0)) fail("seconds must not be negative");
    const auto trace = root_.find("trace");
    if (trace == root_.end() || trace->is_null()) return account;
    if (!trace->is_array()) fail("trace must be an array of [seconds, gap]");
    double last = 0.0;
    for (std::size_t k = 0; k < trace->size(); ++k) {
      account.trace.push_back(trace_point((*trace)[k], k));
      if (account.trace.back().seconds < last) fail(fmt::format("trace[{}] goes back in time", k));
      last = account.trace.back().seconds;
    }
    return account;
  }

  [[nodiscard]] TracePoint trace_point(const Json& entry, std::size_t k) const {
    const bool pair = entry.is_array() && entry.size() == 2 && entry[0].is_number() &&
                      (entry[1].is_number() || entry[1].is_null());
    if (!pair) fail(fmt::format("trace[{}]: expected [seconds, gap]", k));
    TracePoint point;
    point.seconds = entry[0].get<double>();
    point.duality_gap =
        entry[1].is_null() ? std::numeric_limits<double>::infinity() : entry[1].get<double>();
    return point;
  }

  // Weights that are a design as they are stay as they are.
  static void repair(DesignFile& file) {
    std::vector<double>& weights = file.design.weights;
    const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
    if (std::abs(sum - 1.0) <= kSumTolerance && std::ranges::min(weights) >= -kSignTolerance) {
      return;
    }
    file.repair = repair_weights(weights).value_or(WeightRepair());
  }

  void require_simplex(const std::vector<double>& weights) const {
    const auto least = std::ranges::min_element(weights);
    if (*least < -kSignTolerance) {
      fail(fmt::format("support: weight {} is negative (index {})", *least,
                       std::distance(weights.begin(), least)));
    }
    const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
    if (!(std::abs(sum - 1.0) <= kSumTolerance)) {
      fail(fmt::format("support: the weights sum to {:.12g}, not 1", sum));
    }
  }

  [[nodiscard]] std::vector<double> weights() const {
    const auto support = root_.find("support");
    if (support == root_.end() || !support->is_array() || support->empty()) {
      fail("support is missing or empty; expected [{\"index\": ..., \"weight\": ...}, ...]");
    }
    std::vector<double> all(set_.candidate_count(), 0.0);
    std::vector<bool> seen(set_.candidate_count(), false);
    for (std::size_t k = 0; k < support->size(); ++k) {
      const auto [index, weight] = support_point((*support)[k], k);
      if (seen[index]) fail(fmt::format("support[{}]: index {} stands there twice", k, index));
      seen[index] = true;
      all[index] = weight;
    }
    return all;
  }

  [[nodiscard]] std::pair<std::size_t, double> support_point(const Json& entry,
                                                             std::size_t k) const {
    const auto index = entry.is_object() ? entry.find("index") : entry.end();
    const auto weight = entry.is_object() ? entry.find("weight") : entry.end();
    if (index == entry.end() || weight == entry.end()) {
      fail(fmt::format("support[{}]: expected {{\"index\": ..., \"weight\": ...}}", k));
    }
    if (!index->is_number_integer() || *index < 0 || *index >= set_.candidate_count()) {
      fail(fmt::format("support[{}]: index {} is no integer from 0 to {}", k, index->dump(),
                       set_.candidate_count() - 1));
    }
    if (!weight->is_number() || !std::isfinite(weight->get<double>())) {
      fail(fmt::format("support[{}]: weight {} is no number", k, weight->dump()));
    }
    return {index->get<std::size_t>(), weight->get<double>()};
  }

  std::string path_;
  const InformationSet& set_;
  Json root_;
};

}  // namespace

DesignFile read_design(const std::string& path, const InformationSet& set, WeightCheck check) {
  return DesignReader(path, set).read(check);
}

}  // namespace graybox
