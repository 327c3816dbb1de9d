#include "solvers/report/design_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string_view>
#include <vector>

#include "problems/base/program_version.hpp"
#include "problems/files/atomic_file.hpp"
#include "solvers/core/sensitivity.hpp"

namespace graybox {
namespace {

using Json = nlohmann::ordered_json;

Json support_entry(const InformationSet& set, std::size_t index, double weight) {
  Json entry{{"index", index}, {"weight", weight}};
  const auto& names = set.candidates().names;
  const auto coordinates = set.coordinates(index);
  for (std::size_t k = 0; k < names.size(); ++k) entry["candidate"][names[k]] = coordinates[k];
  return entry;
}

Json criterion_entry(const InformationSet& set, const Criterion& criterion) {
  Json entry{{"name", to_string(criterion.kind())}};
  if (criterion.has_weights()) entry["weights"] = criterion.weights();
  if (criterion.kind() == CriterionKind::kPhiP) entry["p"] = criterion.p();
  if (criterion.region().count() > 0) {
    entry["region"] = {{"rows", criterion.region().rows()},
                       {"row_counts", criterion.region().row_counts()}};
  }
  for (const CriterionPart& part : criterion.parts()) {
    entry["parts"].push_back(
        {{"share", part.share}, {"criterion", criterion_entry(set, part.criterion)}});
  }
  if (criterion.kind() == CriterionKind::kDs) {
    entry["interest"] = criterion.interest();
    for (const std::size_t k : criterion.interest()) {
      if (!set.parameters().empty()) entry["parameters"].push_back(set.parameters()[k]);
    }
  }
  return entry;
}

// W = M^-1 d / max_i tr(M^-1 H_i), packed; empty where double precision can't invert M.
std::vector<double> dual_point(const InformationSet& set, const std::vector<double>& weights) {
  std::vector<double> packed(set.packed_size()), sensitivity(set.candidate_count());
  information_matrix(set, weights, packed);
  InverseFactor factor;
  if (!invert(packed, set.dimension(), factor)) return {};
  sensitivities(set, factor.trace_dual, sensitivity);
  const double scale = static_cast<double>(set.dimension()) / std::ranges::max(sensitivity);
  for (std::size_t i = 0, k = 0; i < set.dimension(); ++i) {
    for (std::size_t j = 0; j <= i; ++j, ++k) {
      packed[k] = factor.trace_dual[k] * (i == j ? scale : 0.5 * scale);  // there doubled
    }
  }
  return packed;
}

}  // namespace

Json design_json(const InformationSet& set, const Design& design, const SolveReport& report,
                 const DesignLimits& limits) {
  const Certificate& certificate = report.certificate;
  Json support = Json::array();
  for (std::size_t i = 0; i < design.weights.size(); ++i) {
    if (design.weights[i] != 0.0) support.push_back(support_entry(set, i, design.weights[i]));
  }
  Json root{{"format", kDesignFormat},
            {"written_by", written_by()},
            {"problem", report.problem},
            {"problem_hash", report.problem_hash},
            {"candidates", set.candidate_count()},
            {"dimension", set.dimension()},
            {"solver", report.solver},
            {"criterion", criterion_entry(set, report.options.criterion)},
            {"options",
             {{"duality_gap", report.options.duality_gap},
              {"time_limit", report.options.time_limit},
              {"iteration_limit", report.options.iteration_limit},
              {"seed", report.options.seed},
              {"threads", report.options.threads}}},
            {"status", to_string(report.status)},
            {"message", report.message},
            {"support", std::move(support)},
            {"certificate",
             {{"status", to_string(certificate.status)},
              {"duality_gap", certificate.duality_gap},
              {"rounding_bound", certificate.rounding_bound},
              {"criterion_value", certificate.criterion_value},
              {"log_det", certificate.log_det},
              {"log_det_gap", certificate.log_det_gap},
              {"efficiency", certificate.efficiency},
              {"worst_candidate", certificate.worst_candidate},
              {"clipped", certificate.clipped},
              {"renormalised", certificate.renormalised}}},
            {"log_det", certificate.log_det},
            {"counters",
             {{"iterations", report.counters.iterations},
              {"passes", report.counters.passes},
              {"seconds", report.counters.seconds}}}};
  if (limits.any()) root["limits"] = to_json(limits);
  if (!design.dual_matrix.empty()) root["dual_matrix"] = design.dual_matrix;
  if (!design.dual_weights.empty()) root["dual_weights"] = design.dual_weights;
  return root;
}

void write_design(const std::string& path, const InformationSet& set, const Design& design,
                  const SolveReport& report, const DesignLimits& limits) {
  Json root = design_json(set, design, report, limits);
  if (report.options.criterion.kind() == CriterionKind::kD && !limits.any() &&
      report.certificate.status == CertificateStatus::kCertified) {
    const std::vector<double> point = dual_point(set, design.weights);
    if (!point.empty()) root["dual_point"] = point;
  }
  write_text_file(path, root.dump(1) + "\n");
}

Json floors_json(const InformationSet& set, std::span<const EfficiencyFloor> floors) {
  Json all = Json::array();
  for (const EfficiencyFloor& floor : floors) {
    all.push_back({{"share", floor.share},
                   {"criterion", criterion_entry(set, floor.criterion)},
                   {"multiplier", floor.multiplier}});
  }
  return all;
}

void write_floored_design(const std::string& path, const InformationSet& set, const Design& design,
                          const SolveReport& report, std::span<const EfficiencyFloor> floors) {
  Json root = design_json(set, design, report);
  root["floors"] = floors_json(set, floors);
  write_text_file(path, root.dump(1) + "\n");
}

}  // namespace graybox
