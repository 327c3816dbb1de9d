#include "python/bindings/robust.hpp"

#include <fmt/format.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "problems/base/error.hpp"
#include "python/bindings/call.hpp"
#include "python/bindings/design.hpp"
#include "python/bindings/information.hpp"
#include "python/bindings/option_ranges.hpp"
#include "python/bindings/plain_objects.hpp"
#include "solvers/report/solve_report.hpp"
#include "solvers/robust/concentration_interior_point.hpp"
#include "solvers/robust/robust_column_generation.hpp"

namespace graybox::python {
namespace {

namespace py = pybind11;

constexpr double kReferenceGap = 1e-9;  // of the samples' own optima, as in the command

SolveOptions options_of(const py::dict& arguments) {
  SolveOptions options;
  options.duality_gap = py::cast<double>(arguments["gap"]);
  if (!arguments["time_limit"].is_none()) {
    options.time_limit = py::cast<double>(arguments["time_limit"]);
  }
  options.threads = whole_number(arguments["threads"], "threads", 1, 1024);
  return options;
}

// What both designs have in common.
py::dict fields_of_solution(const std::string& solver, const SolveOptions& options,
                            Solution solution, const Certificate& certificate, bool interrupted) {
  py::dict fields;
  fields["interrupted"] = interrupted;
  fields["solver"] = solver;
  fields["status"] = to_string(judge(solution.status, options.duality_gap, certificate));
  std::string message = solution.message.empty() ? certificate.message : solution.message;
  if (interrupted) message = "interrupted; this is the best design so far";
  fields["message"] = message;
  fields["asked_gap"] = options.duality_gap;
  fields["seconds"] = solution.counters.seconds;
  fields["passes"] = solution.counters.passes;
  fields["iterations"] = solution.counters.iterations;
  fields["certificate"] = fields_of(certificate);
  fields["weights"] = solution.design.weights.empty()
                          ? py::object(py::none())
                          : py::object(array_of(std::move(solution.design.weights)));
  return fields;
}

RobustProblem problem_of(const std::vector<const PythonSet*>& sets, const py::dict& arguments) {
  if (sets.empty()) throw InputError("sets: give at least one information set");
  RobustProblem problem;
  problem.objective =
      robust_objective(one_of(arguments["objective"], "objective", {"average", "worst_case"}));
  for (const PythonSet* set : sets) problem.samples.push_back(&set->set());
  require_shared_candidates(problem);
  return problem;
}

py::dict robust(const std::vector<const PythonSet*>& sets, const py::dict& arguments,
                const py::object& progress) {
  RobustProblem problem = problem_of(sets, arguments);
  const std::string reference = one_of(arguments["reference"], "reference", {"optimum", "none"});
  const SolveOptions options = options_of(arguments);
  SolveOptions alone = options;
  alone.duality_gap = std::min(kReferenceGap, options.duality_gap);
  Call call(progress);
  SolveWatch watch(call, "robust_column_generation");
  SampleOptima optima;
  RobustSolution answer;
  RobustCertificate proof;
  call.run([&] {
    optima = sample_optima(problem.samples, alone);
    if (problem.objective == RobustObjective::kWorstCase && reference == "optimum") {
      problem.references = optima.log_det;
    }
    answer = solve_robust(problem, options, &watch);
    proof = certify_robust(problem, answer.solution.design, answer.prices);
  });
  if (answer.solution.message.empty()) answer.solution.message = optima.message;
  py::dict fields =
      fields_of_solution("robust_column_generation", options, std::move(answer.solution),
                         proof.certificate, call.interrupted());
  const auto d = static_cast<double>(problem.first().dimension());
  std::vector<double> efficiencies;
  for (std::size_t s = 0; s < proof.log_det.size(); ++s) {
    efficiencies.push_back(std::exp((proof.log_det[s] - optima.log_det[s]) / d));
  }
  fields["objective"] = to_string(problem.objective);
  fields["value"] = proof.certificate.log_det;
  fields["log_dets"] = array_of(std::move(proof.log_det));
  fields["optima"] = array_of(std::move(optima.log_det));
  fields["efficiencies"] = array_of(std::move(efficiencies));
  fields["prices"] = array_of(std::move(proof.prices));
  return fields;
}

// From weights alone. `references`: None, or c_s of each set.
py::dict certify_robust_weights(const std::vector<const PythonSet*>& sets,
                                const py::object& weights, const py::object& prices,
                                const py::object& references, const py::dict& arguments) {
  RobustProblem problem = problem_of(sets, arguments);
  if (!references.is_none()) problem.references = number_list(references, "references");
  require_shared_candidates(problem);
  const Design design{.weights = number_list(weights, "weights")};
  const std::vector<double> multipliers =
      prices.is_none() ? std::vector<double>() : number_list(prices, "prices");
  Call call{py::none()};
  const RobustCertificate proof =
      call.run([&] { return certify_robust(problem, design, multipliers); });
  if (call.interrupted()) throw Stopped();
  return fields_of(proof.certificate);
}

py::dict concentrated(const PythonSet& python_set, double largest_share, double of_candidates,
                      const py::dict& arguments, const py::object& progress) {
  const InformationSet& set = python_set.set();
  require_regular(python_set, {});
  const ConcentrationLimit limit =
      concentration_limit(largest_share, of_candidates, set.candidate_count());
  const SolveOptions options = options_of(arguments);
  Call call(progress);
  SolveWatch watch(call, "concentration_interior_point");
  Solution solution;
  ConcentrationCertificate proof;
  call.run([&] {
    solution = solve_concentrated(set, limit, options, &watch);
    proof = certify_concentrated(set, solution.design, limit);
  });
  py::dict fields = fields_of_solution("concentration_interior_point", options, std::move(solution),
                                       proof.certificate, call.interrupted());
  fields["largest_share"] = limit.share;
  fields["of"] = limit.positions;
  fields["concentration"] = proof.concentration;
  fields["price"] = proof.price;
  return fields;
}

py::dict certify_concentrated_weights(const PythonSet& python_set, const py::object& weights,
                                      double largest_share, std::size_t of) {
  const Design design{.weights = number_list(weights, "weights")};
  const ConcentrationLimit limit{.share = largest_share, .positions = of};
  Call call{py::none()};
  const ConcentrationCertificate proof =
      call.run([&] { return certify_concentrated(python_set.set(), design, limit); });
  if (call.interrupted()) throw Stopped();
  return fields_of(proof.certificate);
}

}  // namespace

void add_robust(py::module_& module) {
  module.def("robust", &robust);
  module.def("certify_robust", &certify_robust_weights);
  module.def("concentrated", &concentrated);
  module.def("certify_concentrated", &certify_concentrated_weights);
}

}  // namespace graybox::python
