#include "solvers/report/solve_report.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "problems/base/error.hpp"

namespace graybox {
namespace {

constexpr std::array<std::pair<ReportStatus, std::string_view>, 9> kNames{{
    {ReportStatus::kSolved, "solved"},
    {ReportStatus::kIterationLimit, "iteration_limit"},
    {ReportStatus::kTimeLimit, "time_limit"},
    {ReportStatus::kNumericalFailure, "numerical_failure"},
    {ReportStatus::kUnsupported, "unsupported"},
    {ReportStatus::kInaccurate, "inaccurate"},
    {ReportStatus::kClaimedButWrong, "claimed_but_wrong"},
    {ReportStatus::kCrashed, "crashed"},
    {ReportStatus::kOutOfMemory, "out_of_memory"},
}};

// A false claim beyond this factor of the asked gap is wrong, not merely inaccurate.
constexpr double kInaccurateFactor = 10.0;

ReportStatus status_of(SolveStatus status) {
  switch (status) {
    case SolveStatus::kSolved:
      return ReportStatus::kSolved;
    case SolveStatus::kIterationLimit:
      return ReportStatus::kIterationLimit;
    case SolveStatus::kTimeLimit:
      return ReportStatus::kTimeLimit;
    case SolveStatus::kNumericalFailure:
      return ReportStatus::kNumericalFailure;
    case SolveStatus::kUnsupported:
      break;
  }
  return ReportStatus::kUnsupported;
}

std::string explain(ReportStatus status, const SolveOptions& options, const Solution& solution,
                    const Certificate& certificate) {
  if (status == ReportStatus::kSolved || status == ReportStatus::kUnsupported) {
    return solution.message;
  }
  std::string line = solution.message;
  const auto add = [&](const std::string& more) { line += (line.empty() ? "" : "; ") + more; };
  const double gap = certificate.duality_gap, bound = certificate.rounding_bound;
  if (certificate.status != CertificateStatus::kCertified) {
    add(certificate.message);
  } else if (arithmetic_broke(certificate)) {
    add(fmt::format("the checked gap {:.3g} is negative beyond rounding ({:.1e}), which can't be",
                    gap, bound));
  } else if (status == ReportStatus::kInaccurate || status == ReportStatus::kClaimedButWrong) {
    add(fmt::format("the solver claimed a gap of {:.3g}, the checker finds {:.3g}",
                    options.duality_gap, gap));
  } else if (gap <= options.duality_gap) {
    add(fmt::format("the gap is {:.3g} give or take {:.1e}, which does not prove the {:.3g} asked",
                    gap, bound, options.duality_gap));
  }
  return line;
}

}  // namespace

std::string_view to_string(ReportStatus status) {
  for (const auto& [value, name] : kNames) {
    if (value == status) return name;
  }
  return "unknown";
}

ReportStatus report_status(std::string_view name) {
  for (const auto& [value, known] : kNames) {
    if (known == name) return value;
  }
  throw InputError(
      fmt::format("unknown status '{}'; expected solved, iteration_limit, time_limit, "
                  "numerical_failure, unsupported, inaccurate, claimed_but_wrong, "
                  "crashed or out_of_memory",
                  name));
}

ReportStatus judge(SolveStatus claim, double asked_gap, const Certificate& certificate) {
  if (claim == SolveStatus::kUnsupported) return ReportStatus::kUnsupported;
  if (proves(certificate, asked_gap)) return ReportStatus::kSolved;
  if (arithmetic_broke(certificate)) return ReportStatus::kNumericalFailure;
  if (claim != SolveStatus::kSolved) return status_of(claim);
  if (certificate.status != CertificateStatus::kCertified) return ReportStatus::kClaimedButWrong;
  const double gap = certificate.duality_gap;
  if (gap <= asked_gap) return ReportStatus::kNumericalFailure;
  return gap <= kInaccurateFactor * asked_gap ? ReportStatus::kInaccurate
                                              : ReportStatus::kClaimedButWrong;
}

SolveReport report_without_design(const InformationSet& set, std::string_view solver,
                                  const SolveOptions& options, const SolveCounters& counters) {
  SolveReport report;
  report.solver = solver;
  report.problem = set.name();
  report.candidates = set.candidate_count();
  report.dimension = set.dimension();
  report.options = options;
  report.options.start = {};  // its owner need not outlive the report
  report.counters = counters;
  report.peak_memory_bytes = peak_memory_bytes();
  report.certificate.duality_gap = std::numeric_limits<double>::infinity();
  report.certificate.log_det_gap = std::numeric_limits<double>::infinity();
  report.certificate.log_det = -std::numeric_limits<double>::infinity();
  report.certificate.criterion_value = std::numeric_limits<double>::quiet_NaN();
  return report;
}

SolveReport judge(const InformationSet& set, std::string_view solver, const SolveOptions& options,
                  const Solution& solution) {
  SolveReport report = report_without_design(set, solver, options, solution.counters);
  report.account = solution.account;
  report.repair = solution.repair;
  if (solution.status != SolveStatus::kUnsupported) {
    report.certificate = certify(set, solution.design, options.criterion, options.duality_gap);
  }
  report.status = judge(solution.status, options.duality_gap, report.certificate);
  report.message = explain(report.status, options, solution, report.certificate);
  return report;
}

nlohmann::ordered_json to_json(const SolveReport& report) {
  const Certificate& certificate = report.certificate;
  nlohmann::ordered_json line{{"solver", report.solver},
                              {"status", to_string(report.status)},
                              {"criterion", to_string(report.options.criterion.kind())},
                              {"criterion_value", certificate.criterion_value},
                              {"duality_gap", certificate.duality_gap},
                              {"rounding_bound", certificate.rounding_bound},
                              {"log_det", certificate.log_det},
                              {"log_det_gap", certificate.log_det_gap},
                              {"efficiency", certificate.efficiency},
                              {"seconds", report.counters.seconds},
                              {"passes", report.counters.passes},
                              {"iterations", report.counters.iterations},
                              {"support_size", certificate.support_size},
                              {"peak_memory_bytes", report.peak_memory_bytes},
                              {"problem", report.problem},
                              {"problem_hash", report.problem_hash},
                              {"candidates", report.candidates},
                              {"dimension", report.dimension},
                              {"asked_gap", report.options.duality_gap},
                              {"threads", report.options.threads},
                              {"seed", report.options.seed},
                              {"message", report.message}};
  if (report.account.seconds) line["stated_seconds"] = *report.account.seconds;
  if (report.repair.any()) {
    line["repair"] = {{"clipped", report.repair.clipped}, {"rescaled", report.repair.rescaled}};
  }
  return line;
}

std::uint64_t peak_memory_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;  // Linux counts kilobytes
}

}  // namespace graybox
