#include "python/bindings/planning.hpp"

#include <fmt/format.h>
#include <pybind11/stl.h>

#include <cmath>
#include <cstdint>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include "problems/base/error.hpp"
#include "python/bindings/call.hpp"
#include "python/bindings/information.hpp"
#include "python/bindings/option_ranges.hpp"
#include "python/bindings/plain_objects.hpp"
#include "solvers/planning/cost_plan.hpp"
#include "solvers/planning/experiment_plan.hpp"
#include "solvers/planning/plan_request.hpp"

namespace graybox::python {
namespace {

namespace py = pybind11;
using Texts = std::vector<std::string>;

// As of `graybox design plan`: what the targets mean.
struct PlanQuestion {
  std::vector<PrecisionTarget> targets;  // in the noise that the set assumes
  double power, level, noise;
};

PlanQuestion question_of(const py::dict& arguments, const InformationSet& set) {
  PlanQuestion asked{.targets = {},
                     .power = py::cast<double>(arguments["power"]),
                     .level = py::cast<double>(arguments["level"]),
                     .noise = py::cast<double>(arguments["noise"])};
  const auto add = [&](std::vector<PrecisionTarget> more) {
    std::move(more.begin(), more.end(), std::back_inserter(asked.targets));
  };
  for (const std::string& text : py::cast<Texts>(arguments["targets"])) {
    add(parse_precision_targets(set, text));
  }
  for (const std::string& text : py::cast<Texts>(arguments["detect"])) {
    add(parse_detections(set, text, asked.power, asked.level));
  }
  if (asked.targets.empty()) {
    throw InputError("targets: say what is to be reached, as 'sd(k1) <= 0.02'");
  }
  for (PrecisionTarget& target : asked.targets) target.standard_error /= asked.noise;
  return asked;
}

PlanOptions options_of(const py::dict& arguments) {
  PlanOptions options;
  options.at_most = whole_number(arguments["at_most"], "at_most", 1, 1000000);
  if (!arguments["time_limit"].is_none()) {
    options.time_limit = py::cast<double>(arguments["time_limit"]);
  }
  options.seed = py::cast<std::uint64_t>(arguments["seed"]);
  options.threads = whole_number(arguments["threads"], "threads", 1, 1024);
  return options;
}

// `errors`: reached, in the set's noise; empty where nothing was found.
py::list rows_of(const PlanQuestion& asked, const std::vector<double>& errors) {
  py::list rows;
  for (std::size_t j = 0; j < asked.targets.size(); ++j) {
    const PrecisionTarget& target = asked.targets[j];
    py::dict row;
    row["target"] = target.text;
    row["asked"] = target.standard_error * asked.noise;
    row["reached"] = py::none();
    row["effect"] = py::none();
    row["power"] = py::none();
    if (target.effect != 0.0) row["effect"] = target.effect;
    if (!errors.empty()) {
      const double error = errors[j] * asked.noise;
      row["reached"] = error;
      if (target.effect != 0.0) row["power"] = detection_power(target.effect / error, asked.level);
    }
    rows.append(row);
  }
  return rows;
}

// What was asked, all of it fit for a plan.
struct CheckedPlan {
  DesignRequest request;
  PlanQuestion asked;
  PlanOptions options;
};

CheckedPlan checked_plan(const PythonSet& python_set, const py::dict& arguments,
                         const py::dict& asked_request) {
  DesignRequest request = request_of(asked_request);
  require_plannable(request, py::cast<double>(arguments["noise"]));
  CheckedPlan checked{std::move(request), question_of(arguments, python_set.set()), {}};
  require_regular(python_set, checked.request);
  checked.options = options_of(arguments);
  return checked;
}

// What both kinds of plan hand back.
template <class Found>
py::dict fields_of_plan(const PlanQuestion& asked, Found& found, Call& call) {
  py::dict fields;
  fields["interrupted"] = call.interrupted();
  fields["status"] = to_string(found.status);
  fields["message"] = found.message;
  fields["worst_ratio"] = found.worst_ratio;
  for (const char* name : {"cost", "least_cost", "least"}) fields[name] = py::none();
  fields["targets"] = rows_of(asked, found.standard_errors);
  fields["counts"] =
      found.counts.empty() ? py::object(py::none()) : py::object(array_of(std::move(found.counts)));
  return fields;
}

py::dict cheapest(const InformationSet& set, const CheckedPlan& checked, double gap, Call& call) {
  const BudgetProblem problem = budget_problem(checked.request, set, checked.options.at_most);
  CheapestPlan found = call.run([&] {
    return plan_cheapest(set, problem.constraints_of, problem.costs, checked.asked.targets,
                         {.budget = problem.budget,
                          .gap = gap,
                          .time_limit = checked.options.time_limit,
                          .seed = checked.options.seed,
                          .threads = checked.options.threads});
  });
  const std::int64_t experiments = found.experiments();
  py::dict fields = fields_of_plan(checked.asked, found, call);
  fields["experiments"] = experiments;
  fields["cost"] = found.cost;
  fields["least_cost"] = found.least_cost;
  return fields;
}

py::dict plan(const PythonSet& python_set, const py::dict& arguments, const py::dict& asked_request,
              const py::object& progress) {
  const InformationSet& set = python_set.set();
  const CheckedPlan checked = checked_plan(python_set, arguments, asked_request);
  Call call(progress);
  if (has_costs(checked.request)) {
    return cheapest(set, checked, py::cast<double>(arguments["gap"]), call);
  }
  ExperimentPlan found = call.run([&] {
    return plan_experiments(set, constraints_of_number(checked.request, set), checked.asked.targets,
                            checked.options);
  });
  py::dict fields = fields_of_plan(checked.asked, found, call);
  fields["experiments"] = found.experiments;
  fields["least"] = found.least;
  return fields;
}

// Rows of numbers of experiments: what the best whole numbers found for each of them reach.
py::list plan_curve(const PythonSet& python_set, const std::vector<std::int64_t>& experiments,
                    const py::dict& arguments, const py::dict& asked_request,
                    const py::object& progress) {
  const InformationSet& set = python_set.set();
  const CheckedPlan checked = checked_plan(python_set, arguments, asked_request);
  const PlanQuestion& asked = checked.asked;
  if (has_costs(checked.request)) {
    throw InputError("costs: the curve counts experiments; ask plan() for the cheapest ones");
  }
  Call call(progress);
  const std::vector<PrecisionPoint> points = call.run([&] {
    return precision_curve(set, constraints_of_number(checked.request, set), asked.targets,
                           experiments, checked.options);
  });
  if (call.interrupted()) throw Stopped();
  py::list rows;
  for (const PrecisionPoint& point : points) {
    py::dict row;
    row["experiments"] = point.experiments;
    row["least_ratio"] = point.least_ratio;
    row["ratio"] = point.ratio;
    row["targets"] = rows_of(asked, point.standard_errors);
    rows.append(row);
  }
  return rows;
}

}  // namespace

void add_planning(py::module_& module) {
  module.def("plan", &plan);
  module.def("plan_curve", &plan_curve);
}

}  // namespace graybox::python
