// The reading half of design_file.hpp. It needs no solver, so that the fuzzer links it alone.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/files/json_fields.hpp"
#include "problems/files/json_file.hpp"
#include "solvers/report/design_file.hpp"

namespace graybox {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kSignTolerance = 1e-12;  // as certify() has them
constexpr double kSumTolerance = 1e-9;

// Criteria that fit a set, from their objects in a file.
class CriterionReader {
 public:
  CriterionReader(const JsonFields& fields, const InformationSet& set)
      : fields_(fields), set_(set) {}

  [[nodiscard]] Criterion read(const Json& entry) const {
    const CriterionKind kind = criterion_kind(fields_.text(entry, "name"));
    switch (kind) {
      case CriterionKind::kA:
        return Criterion::a();
      case CriterionKind::kE:
        return Criterion::e();
      case CriterionKind::kL:
        return Criterion::l(fields_.numbers(entry, "criterion.", "weights"));
      case CriterionKind::kDs:
        return Criterion::ds(fields_.indices(entry, "criterion.", "interest"));
      case CriterionKind::kC:
        return Criterion::c(fields_.numbers(entry, "criterion.", "weights"));
      case CriterionKind::kI:
        return Criterion::i(fields_.numbers(entry, "criterion.", "weights"));
      case CriterionKind::kPhiP:
        return Criterion::phi_p(fields_.number(entry, "criterion.", "p").value_or(std::nan("")));
      case CriterionKind::kG:
        return entry.contains("region") ? Criterion::g(region_of(entry["region"])) : Criterion::g();
      case CriterionKind::kCompound:
        return Criterion::compound(parts_of(entry));
      case CriterionKind::kD:
        break;
    }
    return {};
  }

 private:
  [[nodiscard]] PredictionRegion region_of(const Json& entry) const {
    if (!entry.is_object()) fields_.fail("criterion.region must be an object");
    return {set_.dimension(), fields_.numbers(entry, "criterion.region.", "rows"),
            fields_.indices(entry, "criterion.region.", "row_counts")};
  }

  // Parts that are compound themselves are refused before they are read, whatever their depth.
  [[nodiscard]] std::vector<CriterionPart> parts_of(const Json& entry) const {
    const auto found = entry.find("parts");
    if (found == entry.end() || !found->is_array())
      fields_.fail("criterion.parts must be an array");
    std::vector<CriterionPart> parts;
    for (const Json& part : *found) {
      if (!part.is_object() || !part.contains("criterion") || !part["criterion"].is_object()) {
        fields_.fail("criterion.parts: each must be an object with share and criterion");
      }
      const Json& inner = part["criterion"];
      if (criterion_kind(fields_.text(inner, "name")) == CriterionKind::kCompound) {
        fields_.fail("criterion.parts: a part can't be compound itself");
      }
      parts.push_back(
          {fields_.number(part, "criterion.parts.", "share").value_or(std::nan("")), read(inner)});
    }
    return parts;
  }

  const JsonFields& fields_;
  const InformationSet& set_;
};

class DesignReader {
 public:
  DesignReader(const std::string& path, const InformationSet& set)
      : fields_(path), criteria_(fields_, set), set_(set) {}

  DesignFile read(const std::string& path, WeightCheck check) {
    parse(path);
    DesignFile file;
    file.solver = fields_.text(root_, "solver");
    file.status = fields_.text(root_, "status");
    file.message = fields_.text(root_, "message");
    file.problem_hash = fields_.text(root_, "problem_hash");
    require_this_problem(file.problem_hash);
    file.asked_gap = fields_.number(fields_.object(root_, "options"), "options.", "duality_gap");
    const Json counters = fields_.object(root_, "counters");
    file.counters.seconds = fields_.number(counters, "counters.", "seconds").value_or(0.0);
    file.counters.passes = fields_.number(counters, "counters.", "passes").value_or(0.0);
    file.counters.iterations =
        whole(fields_.number(counters, "counters.", "iterations").value_or(0.0));
    file.criterion = criterion();
    file.limits = limits();
    file.floors = floors();
    file.objective = fields_.text(fields_.object(root_, "objective"), "name");
    file.account = account();
    file.design.weights = weights();
    if (check == WeightCheck::kRepaired) repair(file);
    if (check != WeightCheck::kForChecker) require_simplex(file.design.weights);
    file.design.dual_matrix = fields_.numbers(root_, "", "dual_matrix");
    file.design.dual_weights = fields_.numbers(root_, "", "dual_weights");
    return file;
  }

 private:
  void parse(const std::string& path) {
    root_ = read_json_file<Json>(path);
    if (!root_.is_object())
      fields_.fail(fmt::format("no JSON object; expected format {}", kDesignFormat));
    const std::string format = fields_.text(root_, "format");
    if (format != kDesignFormat) {
      fields_.fail(fmt::format("format is {}; expected {}",
                               format.empty() ? "missing" : "'" + format + "'", kDesignFormat));
    }
  }

  // Beyond 2^53 doubles are no counts.
  static std::int64_t whole(double value) {
    constexpr double kLargest = 9007199254740992.0;
    return static_cast<std::int64_t>(std::clamp(value, 0.0, kLargest));
  }

  [[nodiscard]] DesignLimits limits() const {
    DesignLimits found;
    const Json root = fields_.object(root_, "limits");
    for (const auto& [name, entry] : root.items()) {
      if (name == "concentration") {
        found.concentration = {share(entry, name), count(entry, name, "positions")};
      } else if (name == "block_share") {
        found.block_share = {share(entry, name), count(entry, name, "block_size")};
      } else {
        fields_.fail(fmt::format(
            "unknown limit '{}'; the checker knows concentration and block_share", name));
      }
    }
    try {
      require_fits(found, set_);
    } catch (const InputError& error) {
      fields_.fail(error.what());
    }
    return found;
  }

  [[nodiscard]] double share(const Json& entry, const std::string& limit) const {
    const auto found = entry.is_object() ? entry.find("largest_share") : entry.end();
    if (found == entry.end() || !found->is_number()) {
      fields_.fail(fmt::format("limits.{}.largest_share must be a number", limit));
    }
    return found->get<double>();
  }

  [[nodiscard]] std::size_t count(const Json& entry, const std::string& limit,
                                  const char* key) const {
    const auto found = entry.is_object() ? entry.find(key) : entry.end();
    if (found == entry.end() || !found->is_number_unsigned() || *found == 0U) {
      fields_.fail(fmt::format("limits.{}.{} must be a positive integer", limit, key));
    }
    return found->get<std::size_t>();
  }

  [[nodiscard]] std::optional<Criterion> criterion() const {
    if (!root_.contains("criterion")) return std::nullopt;
    const Json entry = fields_.object(root_, "criterion");
    try {
      Criterion found = criteria_.read(entry);
      found.require_fits(set_);
      return found;
    } catch (const InputError& error) {
      fields_.fail(error.what());
    }
  }

  [[nodiscard]] std::vector<EfficiencyFloor> floors() const {
    const auto found = root_.find("floors");
    if (found == root_.end()) return {};
    if (!found->is_array()) fields_.fail("floors must be an array");
    std::vector<EfficiencyFloor> all;
    for (const Json& floor : *found) {
      if (!floor.is_object() || !floor.contains("criterion") || !floor["criterion"].is_object()) {
        fields_.fail("floors: each must be an object with share, criterion and multiplier");
      }
      try {
        all.push_back({.share = fields_.number(floor, "floors.", "share").value_or(std::nan("")),
                       .criterion = criteria_.read(floor["criterion"]),
                       .multiplier = fields_.number(floor, "floors.", "multiplier").value_or(0.0)});
        all.back().criterion.require_fits(set_);
      } catch (const InputError& error) {
        fields_.fail(error.what());
      }
    }
    return all;
  }

  void require_this_problem(const std::string& stated) const {
    for (const auto& [key, value] : {std::pair{"candidates", set_.candidate_count()},
                                     std::pair{"dimension", set_.dimension()}}) {
      const auto there = fields_.number(root_, "", key);
      if (there.has_value() && *there != static_cast<double>(value)) {
        fields_.fail(fmt::format("{} is {}, but {} has {}; this design is of another problem", key,
                                 *there, set_.name(), value));
      }
    }
    if (stated.empty()) return;
    const std::string hash = set_.content_hash();
    if (stated != hash) {
      fields_.fail(
          fmt::format("problem_hash starts {:.12} but {} has {:.12}; this design is of another "
                      "problem",
                      stated, set_.name(), hash));
    }
  }

  [[nodiscard]] OwnAccount account() const {
    OwnAccount account;
    account.seconds = fields_.number(root_, "", "seconds");
    if (!account.seconds)
      account.seconds = fields_.number(fields_.object(root_, "counters"), "counters.", "seconds");
    if (account.seconds && !(*account.seconds >= 0.0)) fields_.fail("seconds must not be negative");
    const auto trace = root_.find("trace");
    if (trace == root_.end() || trace->is_null()) return account;
    if (!trace->is_array()) fields_.fail("trace must be an array of [seconds, gap]");
    double last = 0.0;
    for (std::size_t k = 0; k < trace->size(); ++k) {
      account.trace.push_back(trace_point((*trace)[k], k));
      if (account.trace.back().seconds < last)
        fields_.fail(fmt::format("trace[{}] goes back in time", k));
      last = account.trace.back().seconds;
    }
    return account;
  }

  [[nodiscard]] TracePoint trace_point(const Json& entry, std::size_t k) const {
    const bool pair = entry.is_array() && entry.size() == 2 && entry[0].is_number() &&
                      (entry[1].is_number() || entry[1].is_null());
    if (!pair) fields_.fail(fmt::format("trace[{}]: expected [seconds, gap]", k));
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
      fields_.fail(fmt::format("support: weight {} is negative (index {})", *least,
                               std::distance(weights.begin(), least)));
    }
    const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
    if (!(std::abs(sum - 1.0) <= kSumTolerance)) {
      fields_.fail(fmt::format("support: the weights sum to {:.12g}, not 1", sum));
    }
  }

  [[nodiscard]] std::vector<double> weights() const {
    const auto support = root_.find("support");
    if (support == root_.end() || !support->is_array() || support->empty()) {
      fields_.fail(
          "support is missing or empty; expected [{\"index\": ..., \"weight\": ...}, ...]");
    }
    std::vector<double> all(set_.candidate_count(), 0.0);
    std::vector<bool> seen(set_.candidate_count(), false);
    for (std::size_t k = 0; k < support->size(); ++k) {
      const auto [index, weight] = support_point((*support)[k], k);
      if (seen[index])
        fields_.fail(fmt::format("support[{}]: index {} stands there twice", k, index));
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
      fields_.fail(fmt::format("support[{}]: expected {{\"index\": ..., \"weight\": ...}}", k));
    }
    const std::optional<std::size_t> at = JsonFields::index_below(entry, set_.candidate_count());
    if (!at) {
      fields_.fail(fmt::format("support[{}]: index {} is no integer from 0 to {}", k, index->dump(),
                               set_.candidate_count() - 1));
    }
    if (!weight->is_number() || !std::isfinite(weight->get<double>())) {
      fields_.fail(fmt::format("support[{}]: weight {} is no number", k, weight->dump()));
    }
    return {*at, weight->get<double>()};
  }

  JsonFields fields_;
  CriterionReader criteria_;
  const InformationSet& set_;
  Json root_;
};

}  // namespace

DesignFile read_design(const std::string& path, const InformationSet& set, WeightCheck check) {
  return DesignReader(path, set).read(path, check);
}

}  // namespace graybox
