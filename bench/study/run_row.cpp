#include "bench/study/run_row.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "problems/base/error.hpp"

namespace graybox::bench {
namespace {

using nlohmann::json;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::size_t kTracePoints = 60;

constexpr std::array kSolveStatuses{SolveStatus::kSolved, SolveStatus::kIterationLimit,
                                    SolveStatus::kTimeLimit, SolveStatus::kNumericalFailure,
                                    SolveStatus::kUnsupported};

// JSON has no infinity: null stands for it.
json finite_or_null(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }
double number_or_infinity(const json& value) {
  return value.is_null() ? kInfinity : value.get<double>();
}

// Six significant digits: enough for a figure, half the bytes.
double rounded(double value) {
  return std::isfinite(value) ? std::stod(fmt::format("{:.6g}", value)) : value;
}

TracePoint trace_point(const json& entry) {
  return {entry.at(0).get<double>(), entry.at(1).get<double>(), number_or_infinity(entry.at(2)),
          entry.at(3).get<std::int64_t>()};
}

// "stated_seconds" and "stated_trace" of an answer or a row.
OwnAccount own_account(const json& entry) {
  OwnAccount account;
  if (const auto seconds = entry.find("stated_seconds"); seconds != entry.end()) {
    account.seconds = seconds->get<double>();
  }
  for (const json& pair : entry.value("stated_trace", json::array())) {
    account.trace.push_back(
        {pair.at(0).get<double>(), 0.0, number_or_infinity(pair.at(1)), std::int64_t{0}});
  }
  return account;
}

void add_account(const OwnAccount& account, json& out) {
  if (account.seconds) out["stated_seconds"] = *account.seconds;
  for (const TracePoint& point : account.trace) {
    out["stated_trace"].push_back(
        {rounded(point.seconds), finite_or_null(rounded(point.duality_gap))});
  }
}

WorkerAnswer parse_answer(const json& entry, std::size_t candidate_count) {
  WorkerAnswer answer;
  const auto status = entry.at("status").get<std::string>();
  answer.claimed = solve_status(status);
  answer.out_of_memory = status == "out_of_memory";
  answer.counters.iterations = entry.value("iterations", std::int64_t{0});
  answer.counters.passes = entry.value("passes", 0.0);
  answer.counters.seconds = entry.value("seconds", 0.0);
  answer.wall_seconds = entry.value("wall_seconds", 0.0);
  answer.cpu_seconds = entry.value("cpu_seconds", 0.0);
  answer.account = own_account(entry);
  if (const auto repair = entry.find("repair"); repair != entry.end()) {
    answer.repair = {repair->at(0).get<double>(), repair->at(1).get<double>()};
  }
  answer.peak_memory_bytes = entry.value("peak_memory_bytes", std::size_t{0});
  answer.baseline_memory_bytes = entry.value("baseline_memory_bytes", std::size_t{0});
  answer.message = entry.value("message", std::string());
  if (const auto support = entry.find("support"); support != entry.end() && !support->empty()) {
    answer.design.weights.assign(candidate_count, 0.0);
    for (const json& pair : *support) {
      const double weight = pair.at(1).is_null() ? std::nan("") : pair.at(1).get<double>();
      answer.design.weights.at(pair.at(0).get<std::size_t>()) = weight;
    }
  }
  return answer;
}

std::string last_line(const std::string& text) {
  const std::size_t end = text.find_last_not_of(" \r\n");
  if (end == std::string::npos) return {};
  const std::size_t start = text.find_last_of('\n', end);
  return text.substr(start == std::string::npos ? 0 : start + 1,
                     end - (start == std::string::npos ? 0 : start + 1) + 1);
}

std::string explain(const ProcessOutcome& outcome, const std::optional<WorkerAnswer>& answer) {
  switch (outcome.ending) {
    case ProcessEnding::kTimeLimit:
      return fmt::format("killed after {:.1f} s", outcome.seconds);
    case ProcessEnding::kMemoryLimit:
      return fmt::format("killed at {:.0f} MB",
                         1e-6 * static_cast<double>(outcome.peak_memory_bytes));
    case ProcessEnding::kInterrupted:
      return "interrupted";
    case ProcessEnding::kSignalled:
      return fmt::format("signal {}: {}", outcome.code, last_line(outcome.error_tail));
    case ProcessEnding::kExited:
      break;
  }
  if (answer) return answer->message;
  return fmt::format("exit code {} without an answer: {}", outcome.code,
                     last_line(outcome.error_tail));
}

json to_json(const SetOrigin& origin) {
  if (!origin.path.empty()) return {{"path", origin.path}};
  return {{"generator", origin.generator}, {"seed", origin.seed}};
}

SetOrigin set_origin(const json& row) {
  const json set = row.value("set", json::object());
  return {set.value("generator", std::string()), set.value("seed", std::uint64_t{0}),
          set.value("path", std::string())};
}

}  // namespace

void to_json(json& out, const RunRow& row) {
  out = {{"kind", "run"},
         {"experiment", row.key.experiment},
         {"family", row.family},
         {"candidates", row.candidates},
         {"dimension", row.dimension},
         {"problem", row.key.problem},
         {"solver", row.key.solver},
         {"gap", row.key.duality_gap},
         {"repetition", row.key.repetition},
         {"threads", row.key.threads},
         {"seed", row.key.seed},
         {"time_limit", row.key.time_limit},
         {"memory_limit", row.key.memory_limit},
         {"binary", row.key.binary},
         {"status", to_string(row.status)},
         {"claimed", row.claimed},
         {"seconds", row.seconds},
         {"wall_seconds", row.wall_seconds},
         {"process_seconds", row.process_seconds},
         {"cpu_seconds", row.cpu_seconds},
         {"solve_cpu_seconds", row.solve_cpu_seconds},
         {"duality_gap", finite_or_null(row.duality_gap)},
         {"rounding_bound", finite_or_null(row.rounding_bound)},
         {"log_det", finite_or_null(row.log_det)},
         {"passes", row.passes},
         {"iterations", row.iterations},
         {"support_size", row.support_size},
         {"peak_memory_bytes", row.peak_memory_bytes},
         {"baseline_memory_bytes", row.baseline_memory_bytes},
         {"load", row.load},
         {"date", row.date},
         {"message", row.message}};
  if (!row.key.command.empty()) out["command"] = row.key.command;
  if (!row.key.program.empty()) out["program"] = row.key.program;
  if (!row.origin.generator.empty() || !row.origin.path.empty()) out["set"] = to_json(row.origin);
  if (row.design.any()) out["design"] = row.design;
  add_account(row.account, out);
  if (row.repair.any()) {
    out["repair"] = {{"clipped", row.repair.clipped}, {"rescaled", row.repair.rescaled}};
  }
  json reached = json::object();
  for (const auto& [level, at] : row.reached) {
    reached[level] = {rounded(at.seconds), rounded(at.passes)};
  }
  out["reached"] = std::move(reached);
  json trace = json::array();
  for (const TracePoint& point : row.trace) {
    trace.push_back({rounded(point.seconds), rounded(point.passes),
                     finite_or_null(rounded(point.duality_gap)), point.iteration});
  }
  out["trace"] = std::move(trace);
}

void from_json(const json& in, RunRow& row) {
  row.key = {in.at("experiment"),
             in.at("problem"),
             in.at("solver"),
             in.at("gap"),
             in.at("repetition"),
             in.at("threads"),
             in.at("seed"),
             in.at("time_limit"),
             in.at("memory_limit"),
             in.at("binary"),
             in.value("command", std::string()),
             in.value("program", std::string())};
  row.origin = set_origin(in);
  in.at("family").get_to(row.family);
  in.at("candidates").get_to(row.candidates);
  in.at("dimension").get_to(row.dimension);
  row.status = report_status(in.at("status").get<std::string>());
  in.at("claimed").get_to(row.claimed);
  in.at("seconds").get_to(row.seconds);
  in.at("wall_seconds").get_to(row.wall_seconds);
  in.at("process_seconds").get_to(row.process_seconds);
  in.at("cpu_seconds").get_to(row.cpu_seconds);
  row.solve_cpu_seconds = in.value("solve_cpu_seconds", 0.0);
  row.account = own_account(in);
  row.design = in.value("design", StoredDesign());
  if (const auto repair = in.find("repair"); repair != in.end()) {
    row.repair = {repair->at("clipped").get<double>(), repair->at("rescaled").get<double>()};
  }
  row.duality_gap = number_or_infinity(in.at("duality_gap"));
  row.rounding_bound = number_or_infinity(in.at("rounding_bound"));
  row.log_det = in.at("log_det").is_null() ? -kInfinity : in.at("log_det").get<double>();
  in.at("passes").get_to(row.passes);
  in.at("iterations").get_to(row.iterations);
  in.at("support_size").get_to(row.support_size);
  in.at("peak_memory_bytes").get_to(row.peak_memory_bytes);
  in.at("baseline_memory_bytes").get_to(row.baseline_memory_bytes);
  in.at("load").get_to(row.load);
  in.at("date").get_to(row.date);
  in.at("message").get_to(row.message);
  row.reached.clear();
  for (const auto& [level, at] : in.at("reached").items())
    row.reached[level] = {at.at(0), at.at(1)};
  row.trace.clear();
  for (const json& entry : in.at("trace")) row.trace.push_back(trace_point(entry));
}

void to_json(json& out, const SkipRow& row) {
  out = {{"kind", "skip"},       {"experiment", row.experiment},
         {"family", row.family}, {"candidates", row.candidates},
         {"solver", row.solver}, {"gap", row.duality_gap},
         {"reason", row.reason}};
}

void from_json(const json& in, SkipRow& row) {
  row = {in.at("experiment"), in.at("family"), in.at("candidates"),
         in.at("solver"),     in.at("gap"),    in.at("reason")};
}

SolveStatus solve_status(std::string_view name) {
  for (const SolveStatus status : kSolveStatuses) {
    if (to_string(status) == name) return status;
  }
  return SolveStatus::kNumericalFailure;
}

WorkerOutput parse_worker_output(std::string_view output, std::size_t candidate_count) {
  WorkerOutput parsed;
  while (!output.empty()) {
    const std::size_t end = output.find('\n');
    const std::string_view line = output.substr(0, end);
    output.remove_prefix(end == std::string_view::npos ? output.size() : end + 1);
    if (!line.starts_with("{\"")) continue;
    const json entry = json::parse(line, nullptr, false);
    if (entry.is_discarded()) continue;  // torn by a kill
    try {
      if (entry.contains("trace")) parsed.trace.push_back(trace_point(entry["trace"]));
      if (entry.contains("answer")) parsed.answer = parse_answer(entry["answer"], candidate_count);
    } catch (const std::exception&) {
      continue;  // not of the protocol: a run without an answer is a crash
    }
  }
  return parsed;
}

ReportStatus classify(const ProcessOutcome& outcome, const std::optional<WorkerAnswer>& answer,
                      const Certificate& certificate, double asked_gap) {
  if (outcome.ending == ProcessEnding::kTimeLimit) return ReportStatus::kTimeLimit;
  if (outcome.ending == ProcessEnding::kMemoryLimit) return ReportStatus::kOutOfMemory;
  // SIGKILL that we did not send is the kernel short of memory.
  if (outcome.ending == ProcessEnding::kSignalled) {
    return outcome.code == SIGKILL ? ReportStatus::kOutOfMemory : ReportStatus::kCrashed;
  }
  if (!answer) return ReportStatus::kCrashed;
  if (answer->out_of_memory) return ReportStatus::kOutOfMemory;
  return graybox::judge(answer->claimed, asked_gap, certificate);
}

void judge(const InformationSet& set, const ProcessOutcome& outcome, const WorkerOutput& output,
           RunRow& row) {
  row.candidates = set.candidate_count();
  row.dimension = set.dimension();
  row.process_seconds = outcome.seconds;
  row.cpu_seconds = outcome.cpu_seconds;
  row.peak_memory_bytes = outcome.peak_memory_bytes;
  row.seconds = row.wall_seconds = outcome.seconds;
  row.message = explain(outcome, output.answer);
  if (!output.trace.empty()) row.passes = output.trace.back().passes;
  const std::size_t trace_points = row.key.repetition == 0 ? kTracePoints : 0;
  Certificate certificate;
  if (output.answer) {
    const WorkerAnswer& answer = *output.answer;
    certificate = certify(set, answer.design, Criterion(), row.key.duality_gap);
    row.claimed = answer.out_of_memory ? "out_of_memory" : to_string(answer.claimed);
    row.wall_seconds = answer.wall_seconds;
    row.seconds = std::min(answer.counters.seconds, answer.wall_seconds);
    row.solve_cpu_seconds = answer.cpu_seconds;
    row.account = answer.account;
    row.account.trace = thinned(answer.account.trace, trace_points);
    row.repair = answer.repair;
    row.passes = answer.counters.passes;
    row.iterations = answer.counters.iterations;
    row.peak_memory_bytes = std::max(answer.peak_memory_bytes, outcome.peak_memory_bytes);
    row.baseline_memory_bytes = answer.baseline_memory_bytes;
  }
  const bool certified = certificate.status == CertificateStatus::kCertified;
  row.duality_gap = certified ? certificate.duality_gap : kInfinity;
  row.rounding_bound = certified ? certificate.rounding_bound : kInfinity;
  row.log_det = certified ? certificate.log_det : -kInfinity;
  row.support_size = certified ? certificate.support_size : 0;
  row.status = classify(outcome, output.answer, certificate, row.key.duality_gap);
  row.reached = gaps_reached(output.trace, row.duality_gap, certified ? row.rounding_bound : 0.0);
  row.trace = thinned(output.trace, trace_points);
}

std::map<std::string, GapReached> gaps_reached(const std::vector<TracePoint>& trace,
                                               double checked_gap, double rounding_bound) {
  std::map<std::string, GapReached> reached;
  for (int decade = 1; decade <= 9; ++decade) {
    const double level = std::pow(10.0, -decade);
    if (!(checked_gap + rounding_bound <= level)) break;
    const auto first = std::ranges::find_if(
        trace, [&](const TracePoint& point) { return point.duality_gap <= level; });
    if (first == trace.end()) break;
    reached[fmt::format("1e-{}", decade)] = {first->seconds, first->passes};
  }
  return reached;
}

std::vector<TracePoint> thinned(const std::vector<TracePoint>& trace, std::size_t limit) {
  if (trace.size() <= limit) return trace;
  std::vector<TracePoint> kept;
  for (std::size_t k = 0; k < limit; ++k) {
    kept.push_back(trace[k * (trace.size() - 1) / std::max<std::size_t>(limit - 1, 1)]);
  }
  return kept;
}

}  // namespace graybox::bench
