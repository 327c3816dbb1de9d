#include "solvers/exact/exact_design_file.hpp"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/files/atomic_file.hpp"
#include "solvers/report/design_file.hpp"

namespace graybox {
namespace {

using Json = nlohmann::ordered_json;

void add_exact_keys(const ExactReport& report, Json& root) {
  const ExactSolution& solution = report.solution;
  const ExactCertificate& certificate = report.certificate;
  root["status"] = to_string(solution.status);
  root["message"] = solution.message;
  root["method"] = report.share.solver;
  root["experiments"] = certificate.experiments;
  root["counts"] = counts_json(solution.design.counts);
  root["proven_efficiency"] = certificate.proven_efficiency;
  root["log_det"] = certificate.log_det;
  root["log_det_bound"] = certificate.log_det_bound;
  root["covariance"] = certificate.covariance;
  root["covariance_bound"] = certificate.covariance_bound;
  root["nodes"] = solution.nodes;
  root["open_nodes"] = solution.open_nodes;
  root["survivors"] = solution.survivors;
  root["eliminated"] = report.share.candidates - solution.survivors;
  root["time_to_efficiency"] = solution.seconds_to_mark;
}

// The keys of an approximate design's report that mean something else of an exact one.
void tell_apart(const ExactReport& report, Json& root) {
  const ExactCertificate& certificate = report.certificate;
  for (const char* key :
       {"log_det", "duality_gap", "log_det_gap", "efficiency", "rounding_bound"}) {
    root[std::string("relaxed_") + key] = root[key];
  }
  root["criterion_value"] = certificate.log_det;
  root["duality_gap"] = 1.0 / certificate.proven_efficiency - 1.0;
  root["rounding_bound"] = certificate.rounding_bound;
  root["log_det_gap"] =
      certificate.log_det_bound - certificate.log_det + certificate.rounding_bound;
  root["efficiency"] = certificate.proven_efficiency;
}

// Checks what it reads; `path` begins every message.
class ClaimReader {
 public:
  ClaimReader(const std::string& path, const InformationSet& set, const Design& weights)
      : path_(path), set_(set), weights_(weights) {
    std::ifstream stream(path, std::ios::binary);
    root_ = Json::parse(stream, nullptr, false);
  }

  std::optional<ExactClaim> read() {
    if (!root_.is_object() || !root_.contains("counts")) return std::nullopt;
    ExactClaim claim;
    claim.design.counts.assign(set_.candidate_count(), 0);
    if (!root_["counts"].is_array()) fail("counts must be a list");
    for (const Json& entry : root_["counts"]) read_count(entry, claim);
    claim.experiments = whole(root_, "experiments", "experiments");
    if (claim.design.experiments() != claim.experiments || claim.experiments < 1) {
      fail(fmt::format("the counts sum to {}, experiments is {}", claim.design.experiments(),
                       claim.experiments));
    }
    require_weights(claim);
    if (root_.contains("method") && root_["method"].is_string()) {
      claim.method = root_["method"].get<std::string>();
    }
    for (const char* key :
         {"exact_log_det_bound", "log_det_bound"}) {  // the first is the former name
      if (root_.contains(key) && root_[key].is_number())
        claim.log_det_bound = root_[key].get<double>();
    }
    return claim;
  }

 private:
  [[noreturn]] void fail(const std::string& problem) const {
    throw InputError(fmt::format("{}: {}", path_, problem));
  }

  [[nodiscard]] std::int64_t whole(const Json& parent, const char* key,
                                   const std::string& where) const {
    if (!parent.is_object() || !parent.contains(key) || !parent[key].is_number_integer()) {
      fail(fmt::format("{} is missing or no whole number", where));
    }
    const auto value = parent[key].get<std::int64_t>();
    if (value < 0 || value > kMostExperiments) {
      fail(fmt::format("{} is {}; it must be from 0 to {}", where, value, kMostExperiments));
    }
    return value;
  }

  void read_count(const Json& entry, ExactClaim& claim) const {
    const std::int64_t index = whole(entry, "index", "an index in counts");
    if (index >= static_cast<std::int64_t>(set_.candidate_count())) {
      fail(fmt::format("counts: index {} is not below {}", index, set_.candidate_count()));
    }
    std::int64_t& count = claim.design.counts[static_cast<std::size_t>(index)];
    if (count != 0) fail(fmt::format("counts: index {} stands there twice", index));
    count = whole(entry, "count", fmt::format("the count of index {}", index));
  }

  void require_weights(const ExactClaim& claim) const {
    const Design shares = claim.design.weights();
    for (std::size_t i = 0; i < shares.weights.size(); ++i) {
      if (std::abs(shares.weights[i] - weights_.weights[i]) > 1e-9) {
        fail(fmt::format("index {} has weight {} in support, but count {} of {}", i,
                         weights_.weights[i], claim.design.counts[i], claim.experiments));
      }
    }
  }

  const std::string& path_;
  const InformationSet& set_;
  const Design& weights_;
  Json root_;
};

}  // namespace

Json counts_json(std::span<const std::int64_t> counts) {
  Json out = Json::array();
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] != 0) out.push_back({{"index", i}, {"count", counts[i]}});
  }
  return out;
}

ExactReport report_exact(const InformationSet& set, const Relaxation& relaxation,
                         std::string_view method, const ExactOptions& options,
                         ExactSolution solution) {
  ExactReport report;
  report.certificate =
      certify_exact(set, solution.design, options.experiments, relaxation, solution.log_det_bound);
  const SolveOptions asked{.duality_gap = options.gap,
                           .time_limit = options.time_limit,
                           .seed = options.seed,
                           .threads = options.threads};
  const Certificate relaxed = certify(set, solution.design.weights());
  report.share = report_without_design(
      set, method, asked,
      {.iterations = solution.iterations, .passes = 0.0, .seconds = solution.seconds});
  report.share.certificate = relaxed;
  report.solution = std::move(solution);
  return report;
}

Json to_json(const ExactReport& report) {
  Json root = to_json(report.share);
  tell_apart(report, root);
  add_exact_keys(report, root);
  return root;
}

void write_exact_design(const std::string& path, const InformationSet& set,
                        const ExactReport& report) {
  Json root = design_json(set, report.solution.design.weights(), report.share);
  add_exact_keys(report, root);
  write_text_file(path, root.dump(1) + "\n");
}

std::optional<ExactClaim> read_exact_claim(const std::string& path, const InformationSet& set,
                                           const Design& weights) {
  return ClaimReader(path, set, weights).read();
}

}  // namespace graybox
