#include "python/bindings/exact.hpp"

#include <fmt/format.h>
#include <pybind11/stl.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "problems/base/error.hpp"
#include "python/bindings/call.hpp"
#include "python/bindings/design_files.hpp"
#include "python/bindings/information.hpp"
#include "python/bindings/plain_objects.hpp"
#include "solvers/constrained_exact/constrained_exact_file.hpp"
#include "solvers/exact/exact_design_file.hpp"
#include "solvers/exact/exact_method.hpp"

namespace graybox::python {
namespace {

namespace py = pybind11;

constexpr const char* kInterrupted = "interrupted; this is the best design so far";

ExactOptions options_of(const py::dict& arguments) {
  ExactOptions options;
  options.gap = py::cast<double>(arguments["gap"]);
  if (!arguments["time_limit"].is_none()) {
    options.time_limit = py::cast<double>(arguments["time_limit"]);
  }
  options.seed = py::cast<std::uint64_t>(arguments["seed"]);
  options.threads = py::cast<int>(arguments["threads"]);
  return options;
}

py::dict plain_exact(const PythonSet& python_set, const std::string& method_name,
                     const ExactOptions& options, Call& call) {
  const InformationSet& set = python_set.set();
  const ExactMethod& method = exact_method(method_name);
  require_exact_options(options);
  ExactWatch watch(call, method_name);
  ExactReport report = call.run([&] {
    const Relaxation relaxation = solve_relaxation(
        set, {.time_limit = options.time_limit, .seed = options.seed, .threads = options.threads});
    ExactSolution solution = method.solve(set, relaxation, options, &watch);
    if (stop_was_asked_for() && solution.status == ExactStatus::kTimeLimit) {
      solution.message = kInterrupted;
    }
    return report_exact(set, relaxation, method.name(), options, std::move(solution));
  });
  py::dict fields;
  fields["interrupted"] = call.interrupted();
  fields["status"] = to_string(report.solution.status);
  fields["message"] = report.solution.message;
  fields["criterion_value"] = report.certificate.log_det;
  fields["log_det"] = report.certificate.log_det;
  fields["bound"] = report.certificate.log_det_bound;
  fields["efficiency"] = report.certificate.proven_efficiency;
  fields["nodes"] = report.solution.nodes;
  fields["seconds"] = report.solution.seconds;
  fields["designs"] = py::list();
  fields["counts"] = py::none();
  if (report.solution.status == ExactStatus::kSingular) return fields;
  fields["counts"] = array_of(std::vector<std::int64_t>(report.solution.design.counts));
  fields["writer"] = DesignWriter{
      [information = held(python_set), &set, report = std::move(report)](const auto& path) {
        ExactReport named = report;
        named.share.problem_hash = set.content_hash();
        write_exact_design(path, set, named);
      }};
  return fields;
}

py::dict requested_exact(const PythonSet& python_set, const ConstrainedExactOptions& options,
                         DesignRequest request, Call& call) {
  const InformationSet& set = python_set.set();
  DesignConstraints constraints = resolve(request, set);
  ExactWatch watch(call, "branch_and_bound");
  ConstrainedExactReport report = call.run([&] {
    ConstrainedExactSolution solution = solve_constrained_exact(set, constraints, options, &watch);
    if (stop_was_asked_for() && solution.status == ExactStatus::kTimeLimit) {
      solution.message =
          solution.designs.empty() ? "interrupted before there was a design" : kInterrupted;
    }
    return report_constrained_exact(set, options, std::move(solution), std::move(request),
                                    std::move(constraints));
  });
  py::list designs;
  for (const RankedDesign& design : report.solution.designs) {
    designs.append(array_of(std::vector<std::int64_t>(design.counts)));
  }
  py::dict fields;
  fields["interrupted"] = call.interrupted();
  fields["status"] = to_string(report.solution.status);
  fields["message"] = report.solution.message;
  const Certificate& certificate = report.share.report.certificate;
  fields["criterion_value"] = certificate.criterion_value;
  fields["log_det"] = certificate.log_det;
  fields["bound"] = value_bound(certificate.criterion_value, report.proven_efficiency,
                                options.criterion, set.dimension());
  fields["efficiency"] = report.proven_efficiency;
  fields["nodes"] = report.solution.nodes;
  fields["seconds"] = report.solution.seconds;
  fields["designs"] = designs;
  fields["counts"] = py::len(designs) == 0 ? py::object(py::none()) : py::object(designs[0]);
  if (py::len(designs) == 0 || !(report.share.experiments() > 0.0)) return fields;
  fields["writer"] = DesignWriter{
      [information = held(python_set), &set, report = std::move(report)](const auto& path) {
        ConstrainedExactReport named = report;
        named.share.report.problem_hash = set.content_hash();
        write_constrained_exact(path, set, named);
      }};
  return fields;
}

py::dict exact(const PythonSet& python_set, const py::dict& arguments, const py::dict& asked,
               const py::object& progress) {
  const InformationSet& set = python_set.set();
  ExactOptions options = options_of(arguments);
  DesignRequest request = request_of(asked);
  const auto top = py::cast<std::size_t>(arguments["top"]);
  const auto method = py::cast<std::string>(arguments["method"]);
  const Criterion criterion = criterion_of(arguments, set);
  Call call(progress);
  require_regular(python_set, request);
  DesignRequest beyond_number = request;
  beyond_number.experiments.reset();
  const bool is_plain = !beyond_number.any() && top == 1 && criterion.kind() == CriterionKind::kD;
  if (is_plain) {
    if (!request.experiments) throw InputError("experiments: say how many (experiments)");
    if (*request.experiments != std::floor(*request.experiments)) {
      throw InputError(fmt::format("experiments: {} is no whole number", *request.experiments));
    }
    options.experiments = static_cast<std::int64_t>(*request.experiments);
    return plain_exact(python_set, method, options, call);
  }
  if (method != "branch_and_bound") {
    throw InputError("constraints, other criteria and top go with branch_and_bound alone");
  }
  if (!request.number() && !request.budget) {
    throw InputError("experiments: say how many (experiments), or what they may cost (budget)");
  }
  return requested_exact(python_set,
                         {.gap = options.gap,
                          .time_limit = options.time_limit,
                          .seed = options.seed,
                          .threads = options.threads,
                          .criterion = criterion,
                          .top = top},
                         std::move(request), call);
}

std::vector<std::int64_t> counts_of(const py::object& counts) {
  std::vector<std::int64_t> whole;
  for (const double count : number_list(counts, "counts")) {
    if (count != std::floor(count)) {
      throw InputError(fmt::format("counts: {} is no whole number", count));
    }
    whole.push_back(static_cast<std::int64_t>(count));
  }
  return whole;
}

// Under a request, or for another criterion than D.
py::dict certify_request(const InformationSet& set, std::vector<std::int64_t> counts,
                         const Criterion& criterion, DesignRequest request) {
  if (!request.number() && !request.budget) {
    request.experiments = static_cast<double>(ExactDesign{counts}.experiments());
  }
  ConstrainedSolution solution;
  solution.efforts.assign(counts.begin(), counts.end());
  solution.status = SolveStatus::kTimeLimit;  // nothing is claimed
  SolveOptions options;
  options.criterion = criterion;
  DesignConstraints constraints = resolve(request, set);
  Call call{py::none()};
  double efficiency = 0.0;
  const ConstrainedReport report = call.run([&] {
    ConstrainedReport judged = judge_constrained(set, "", options, std::move(solution),
                                                 std::move(request), std::move(constraints));
    efficiency = relaxed_efficiency(set, judged);
    return judged;
  });
  if (call.interrupted()) throw Stopped();
  return fields_of_exact_check(set, report, efficiency);
}

py::dict certify_counts(const PythonSet& python_set, const py::object& counts, double bound,
                        const py::dict& arguments, const py::dict& asked) {
  const InformationSet& set = python_set.set();
  const Criterion criterion = criterion_of(arguments, set);
  DesignRequest request = request_of(asked);
  require_regular(python_set, request);
  ExactDesign design{counts_of(counts)};
  DesignRequest beyond_number = request;
  beyond_number.experiments.reset();
  const bool has_other_number =
      request.experiments && *request.experiments != static_cast<double>(design.experiments());
  if (beyond_number.any() || has_other_number || criterion.kind() != CriterionKind::kD) {
    return certify_request(set, std::move(design.counts), criterion, std::move(request));
  }
  Call call{py::none()};
  const ExactCertificate certificate = call.run([&] {
    return certify_exact(set, design, design.experiments(), solve_relaxation(set), bound);
  });
  if (call.interrupted()) throw Stopped();
  return fields_of(certificate);
}

}  // namespace

py::dict fields_of(const ExactCertificate& certificate) {
  py::dict fields;
  fields["status"] = to_string(certificate.status);
  fields["experiments"] = certificate.experiments;
  fields["support_size"] = certificate.support_size;
  fields["log_det"] = certificate.log_det;
  fields["rounding_bound"] = certificate.rounding_bound;
  fields["bound"] = certificate.log_det_bound;
  fields["efficiency"] = certificate.proven_efficiency;
  fields["message"] = certificate.message;
  return fields;
}

void add_exact(py::module_& module) {
  module.def("exact", &exact);
  module.def("certify_exact", &certify_counts);
}

}  // namespace graybox::python
