#include "python/bindings/design.hpp"

#include <fmt/format.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "problems/base/error.hpp"
#include "python/bindings/call.hpp"
#include "python/bindings/design_files.hpp"
#include "python/bindings/information.hpp"
#include "python/bindings/plain_objects.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/constrained/constrained_design_file.hpp"
#include "solvers/core/warm_start.hpp"
#include "solvers/floors/floored_design.hpp"
#include "solvers/registry.hpp"
#include "solvers/report/design_file.hpp"
#include "solvers/report/solve_report.hpp"

namespace graybox::python {
namespace {

namespace py = pybind11;

const SolverRegistry& registry() {
  static const SolverRegistry all = make_registry();
  return all;
}

constexpr const char* kInterrupted = "interrupted; this is the best design so far";

SolveOptions options_of(const py::dict& arguments, const InformationSet& set) {
  SolveOptions options;
  options.duality_gap = py::cast<double>(arguments["gap"]);
  if (!arguments["time_limit"].is_none()) {
    options.time_limit = py::cast<double>(arguments["time_limit"]);
  }
  options.iteration_limit = py::cast<std::int64_t>(arguments["iteration_limit"]);
  options.seed = py::cast<std::uint64_t>(arguments["seed"]);
  options.threads = py::cast<int>(arguments["threads"]);
  options.criterion = criterion_of(arguments, set);
  return options;
}

// Whether the solver had more than its start (cli/commands/solve_command.cpp).
bool has_answer(const Solution& solution) {
  if (solution.status == SolveStatus::kUnsupported) return false;
  return solution.status == SolveStatus::kSolved ||
         std::ranges::any_of(solution.trace, [](const TracePoint& point) {
           return std::isfinite(point.duality_gap);
         });
}

py::array_t<double> array_of_trace(std::span<const TracePoint> trace) {
  py::array_t<double> rows({static_cast<py::ssize_t>(trace.size()), py::ssize_t{4}});
  auto to = rows.mutable_unchecked<2>();
  for (py::ssize_t k = 0; k < to.shape(0); ++k) {
    const TracePoint& point = trace[static_cast<std::size_t>(k)];
    to(k, 0) = point.seconds;
    to(k, 1) = point.passes;
    to(k, 2) = point.duality_gap;
    to(k, 3) = static_cast<double>(point.iteration);
  }
  return rows;
}

py::dict solve_request(const PythonSet& python_set, const std::string& solver,
                       const SolveOptions& options, DesignRequest request, Call& call) {
  const InformationSet& set = python_set.set();
  if (solver != ColumnGeneration().name()) {
    throw InputError(fmt::format("{} can't take constraints, costs or earlier trials; use {}",
                                 solver, ColumnGeneration().name()));
  }
  DesignConstraints constraints = resolve(request, set);
  SolveWatch watch(call, solver);
  std::vector<TracePoint> trace;
  ConstrainedReport report = call.run([&] {
    ConstrainedSolution solution = solve_constrained(set, constraints, options, &watch);
    if (stop_was_asked_for()) solution.message = kInterrupted;
    trace = solution.trace;
    return judge_constrained(set, solver, options, std::move(solution), std::move(request),
                             std::move(constraints));
  });
  py::dict fields = fields_of(report.report);
  fields["interrupted"] = call.interrupted();
  fields["trace"] = array_of_trace(trace);
  fields["weights"] = report.efforts.empty() ? py::object(py::none())
                                             : py::object(array_of(report.weights().weights));
  fields["multipliers"] = array_of(report.proof.multipliers);
  fields["efforts"] = array_of(std::vector<double>(report.efforts));
  if (!report.efforts.empty()) {
    fields["writer"] = DesignWriter{
        [information = held(python_set), &set, report = std::move(report)](const auto& path) {
          ConstrainedReport named = report;
          named.report.problem_hash = set.content_hash();
          write_constrained_design(path, set, named);
        }};
  }
  return fields;
}

// Under floors of other criteria.
py::dict solve_floors(const PythonSet& python_set, const std::string& solver,
                      const SolveOptions& options, std::vector<EfficiencyFloor> floors,
                      Call& call) {
  const InformationSet& set = python_set.set();
  if (solver != ColumnGeneration().name()) {
    throw InputError(
        fmt::format("{} can't take floors; use {}", solver, ColumnGeneration().name()));
  }
  SolveWatch watch(call, solver);
  Solution solution;
  FlooredCertificate proof;
  SolveReport report = call.run([&] {
    solution = solve_floored(set, options, floors, &watch);
    SolveReport judged = judge(set, solver, options, solution);
    proof = certify_floored(set, solution.design, options.criterion, floors, options.duality_gap);
    judged.certificate = proof.certificate;
    judged.status = judge(solution.status, options.duality_gap, proof.certificate);
    judged.message = stop_was_asked_for()       ? kInterrupted
                     : solution.message.empty() ? proof.certificate.message
                                                : solution.message;
    return judged;
  });
  py::dict fields = fields_of(report);
  fields["interrupted"] = call.interrupted();
  fields["trace"] = array_of_trace(solution.trace);
  fields["floors"] = floor_list(floors, proof.efficiencies);
  const bool answer = has_answer(solution);
  fields["weights"] = answer ? py::object(array_of(std::vector<double>(solution.design.weights)))
                             : py::object(py::none());
  fields["dual_matrix"] = array_of(std::vector<double>(solution.design.dual_matrix));
  if (answer) {
    fields["writer"] =
        DesignWriter{[information = held(python_set), &set, design = std::move(solution.design),
                      report = std::move(report), floors = std::move(floors)](const auto& path) {
          SolveReport named = report;
          named.problem_hash = set.content_hash();
          write_floored_design(path, set, design, named, floors);
        }};
  }
  return fields;
}

// Throws InputError for what floors and a start don't go with.
void require_alone(bool has_floors, bool has_start, const DesignRequest& request) {
  if (has_floors && request.any()) {
    throw InputError("floor can't be combined with constraints, costs or earlier trials");
  }
  if (has_start && has_floors) throw InputError("start can't be combined with floor");
  if (has_start && request.any()) {
    throw InputError("start can't be combined with constraints, costs or earlier trials");
  }
}

py::dict solve(const PythonSet& python_set, const py::dict& arguments, const py::dict& asked,
               const py::object& progress) {
  const InformationSet& set = python_set.set();
  const std::string name = py::cast<std::string>(arguments["solver"]);
  const Solver& solver = registry().at(name);
  SolveOptions options = options_of(arguments, set);
  DesignRequest request = request_of(asked);
  require_regular(python_set, request);
  std::vector<EfficiencyFloor> floors = floors_of(arguments, set);
  std::vector<double> start;  // outlives the run
  const bool has_start = arguments.contains("start") && !arguments["start"].is_none();
  require_alone(!floors.empty(), has_start, request);
  if (has_start) {
    start = number_list(arguments["start"], "start");
    require_start(start, set, solver);
    options.start = start;
  }
  Call call(progress);
  if (request.any()) return solve_request(python_set, name, options, std::move(request), call);
  if (!floors.empty()) return solve_floors(python_set, name, options, std::move(floors), call);
  SolveWatch watch(call, name);
  Solution solution;
  const SolveReport report = call.run([&] {
    solution = solver.solve(set, options, &watch);
    if (stop_was_asked_for() && solution.status == SolveStatus::kTimeLimit) {
      solution.message = kInterrupted;
    }
    return judge(set, solver.name(), options, solution);
  });
  py::dict fields = fields_of(report);
  fields["interrupted"] = call.interrupted();
  fields["trace"] = array_of_trace(solution.trace);
  const bool answer = has_answer(solution);
  fields["weights"] =
      answer ? py::object(array_of(std::move(solution.design.weights))) : py::object(py::none());
  fields["dual_matrix"] = array_of(std::move(solution.design.dual_matrix));
  return fields;
}

// From numbers alone, whoever made them.
py::dict certify_weights(const PythonSet& python_set, const py::object& weights,
                         const py::dict& arguments, const py::dict& asked) {
  const InformationSet& set = python_set.set();
  const Criterion criterion = criterion_of(arguments, set);
  const auto gap = py::cast<double>(arguments["gap"]);
  if (!(gap > 0.0 && std::isfinite(gap))) {
    throw InputError(fmt::format("gap {} must be positive and finite", gap));
  }
  const DesignRequest request = request_of(asked);
  require_regular(python_set, request);
  Design design{.weights = number_list(weights, "weights")};
  if (arguments.contains("dual_matrix") && !arguments["dual_matrix"].is_none()) {
    design.dual_matrix = number_list(arguments["dual_matrix"], "dual_matrix");
  }
  const std::vector<EfficiencyFloor> floors = floors_of(arguments, set);
  require_alone(!floors.empty(), false, request);
  Call call{py::none()};
  ConstrainedCertificate proof;
  FlooredCertificate floored;
  if (!floors.empty()) {
    floored = call.run([&] { return certify_floored(set, design, criterion, floors, gap); });
    proof.certificate = floored.certificate;
  } else if (request.any()) {
    const DesignConstraints constraints = resolve(request, set);
    proof = call.run(
        [&] { return certify_constrained(set, design.weights, constraints, criterion, gap); });
  } else {
    proof.certificate = call.run([&] { return certify(set, design, criterion, gap); });
  }
  py::dict fields = fields_of(proof.certificate);
  fields["violation"] = proof.violation;
  fields["proves_gap"] = proves(proof.certificate, gap);
  fields["floors"] = floor_list(floors, floored.efficiencies);
  if (call.interrupted()) throw Stopped();
  return fields;
}

void save_design(const PythonSet& python_set, const py::dict& arguments, const py::object& weights,
                 const std::string& path) {
  const InformationSet& set = python_set.set();
  const Design design{.weights = number_list(weights, "weights"),
                      .dual_matrix = number_list(arguments["dual_matrix"], "dual_matrix")};
  SolveOptions options;
  options.criterion = criterion_of(arguments, set);
  options.duality_gap = py::cast<double>(arguments["gap"]);
  const Solution claim{
      .design = design, .status = SolveStatus::kSolved, .trace = {}, .counters = {}, .message = {}};
  SolveReport report = judge(set, py::cast<std::string>(arguments["solver"]), options, claim);
  report.counters.seconds = py::cast<double>(arguments["seconds"]);
  report.counters.passes = py::cast<double>(arguments["passes"]);
  report.counters.iterations = py::cast<std::int64_t>(arguments["iterations"]);
  report.status = report_status(py::cast<std::string>(arguments["status"]));
  report.problem_hash = set.content_hash();
  write_design(path, set, design, report);
}

// The verdict on what a solver of the user's claims.
py::dict judge_claim(const PythonSet& python_set, const py::object& weights,
                     const std::string& claim, double gap) {
  SolveOptions options;
  options.duality_gap = gap;
  const Solution solution{.design = {.weights = number_list(weights, "weights")},
                          .status = solve_status(claim),
                          .trace = {},
                          .counters = {},
                          .message = {}};
  Call call{py::none()};
  const SolveReport report =
      call.run([&] { return judge(python_set.set(), "", options, solution); });
  if (call.interrupted()) throw Stopped();
  return fields_of(report);
}

// The library's rule (certificate.hpp), for figures that Python has.
bool proves_figures(bool certified, double gap, double rounding, double asked) {
  Certificate certificate;
  certificate.status = certified ? CertificateStatus::kCertified : CertificateStatus::kNotADesign;
  certificate.duality_gap = gap;
  certificate.rounding_bound = rounding;
  return proves(certificate, asked);
}

py::list solver_list() {
  py::list list;
  for (const SolverRegistry::Entry& entry : registry().entries()) {
    py::dict each;
    each["name"] = entry.name;
    each["description"] = entry.description;
    each["available"] = entry.solver != nullptr;
    std::vector<std::string> criteria;
    if (entry.solver != nullptr) {
      for (const CriterionKind kind : entry.solver->traits().criteria) {
        criteria.emplace_back(to_string(kind));
      }
    }
    each["criteria"] = criteria;
    each["takes_start"] = entry.solver != nullptr && entry.solver->traits().takes_start;
    list.append(each);
  }
  return list;
}

}  // namespace

py::dict fields_of(const Certificate& certificate) {
  py::dict fields;
  fields["status"] = to_string(certificate.status);
  fields["gap"] = certificate.duality_gap;
  fields["rounding_bound"] = certificate.rounding_bound;
  fields["log_det"] = certificate.log_det;
  fields["criterion_value"] = certificate.criterion_value;
  fields["log_det_gap"] = certificate.log_det_gap;
  fields["efficiency"] = certificate.efficiency;
  fields["worst_candidate"] = certificate.worst_candidate;
  fields["support_size"] = certificate.support_size;
  fields["clipped"] = certificate.clipped;
  fields["renormalised"] = certificate.renormalised;
  fields["message"] = certificate.message;
  return fields;
}

py::dict fields_of(const SolveReport& report) {
  py::dict fields;
  fields["solver"] = report.solver;
  fields["status"] = to_string(report.status);
  fields["message"] = report.message;
  fields["criterion"] = to_string(report.options.criterion.kind());
  fields["asked_gap"] = report.options.duality_gap;
  fields["seconds"] = report.counters.seconds;
  fields["passes"] = report.counters.passes;
  fields["iterations"] = report.counters.iterations;
  fields["certificate"] = fields_of(report.certificate);
  return fields;
}

py::list floor_list(std::span<const EfficiencyFloor> floors, std::span<const double> efficiencies) {
  py::list list;
  for (std::size_t k = 0; k < floors.size(); ++k) {
    py::dict each;
    each["criterion"] = to_string(floors[k].criterion.kind());
    each["share"] = floors[k].share;
    each["multiplier"] = floors[k].multiplier;
    each["efficiency"] =
        k < efficiencies.size() ? py::object(py::float_(efficiencies[k])) : py::object(py::none());
    list.append(each);
  }
  return list;
}

SolveStatus solve_status(const std::string& name) {
  for (const SolveStatus status : {SolveStatus::kSolved, SolveStatus::kIterationLimit,
                                   SolveStatus::kTimeLimit, SolveStatus::kNumericalFailure}) {
    if (to_string(status) == name) return status;
  }
  return SolveStatus::kNumericalFailure;
}

void add_design(py::module_& module) {
  module.def("solve", &solve);
  module.def("certify", &certify_weights);
  module.def("judge", &judge_claim);
  module.def("proves", &proves_figures);
  module.def("save_design", &save_design);
  module.def("solver_list", &solver_list);
}

}  // namespace graybox::python
