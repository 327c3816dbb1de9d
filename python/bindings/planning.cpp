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
#include "solvers/planning/experiment_plan.hpp"

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
  if (!(asked.noise > 0.0) || !std::isfinite(asked.noise)) {
    throw InputError("noise: a positive factor of the noise that the set assumes");
  }
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

void require_plannable(const DesignRequest& request, double noise) {
  if (request.budget || !request.costs.empty() || !request.numbers.costs.empty()) {
    throw InputError("costs: a plan counts experiments; take exact(..., budget=...) for costs");
  }
  if (request.experiments) {
    throw InputError("experiments: their number is what a plan finds; limit it by at_most");
  }
  if (noise != 1.0 && !(request.prior.empty() && request.numbers.prior.empty())) {
    throw InputError("noise: scale the matrix prior yourself, the factor is the set's alone");
  }
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

ConstraintsOf constraints_of(const DesignRequest& request, const InformationSet& set) {
  return [&request, &set](std::int64_t experiments) {
    DesignRequest now = request;
    now.experiments = static_cast<double>(experiments);
    return resolve(now, set);
  };
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
  CheckedPlan checked{request_of(asked_request), question_of(arguments, python_set.set()), {}};
  require_plannable(checked.request, checked.asked.noise);
  require_regular(python_set, checked.request);
  checked.options = options_of(arguments);
  return checked;
}

py::dict plan(const PythonSet& python_set, const py::dict& arguments, const py::dict& asked_request,
              const py::object& progress) {
  const InformationSet& set = python_set.set();
  const CheckedPlan checked = checked_plan(python_set, arguments, asked_request);
  const PlanQuestion& asked = checked.asked;
  Call call(progress);
  ExperimentPlan found = call.run([&] {
    return plan_experiments(set, constraints_of(checked.request, set), asked.targets,
                            checked.options);
  });
  py::dict fields;
  fields["interrupted"] = call.interrupted();
  fields["status"] = to_string(found.status);
  fields["message"] = found.message;
  fields["experiments"] = found.experiments;
  fields["least"] = found.least;
  fields["worst_ratio"] = found.worst_ratio;
  fields["targets"] = rows_of(asked, found.standard_errors);
  fields["counts"] =
      found.counts.empty() ? py::object(py::none()) : py::object(array_of(std::move(found.counts)));
  return fields;
}

// Rows of numbers of experiments: what the best whole numbers found for each of them reach.
py::list plan_curve(const PythonSet& python_set, const std::vector<std::int64_t>& experiments,
                    const py::dict& arguments, const py::dict& asked_request,
                    const py::object& progress) {
  const InformationSet& set = python_set.set();
  const CheckedPlan checked = checked_plan(python_set, arguments, asked_request);
  const PlanQuestion& asked = checked.asked;
  Call call(progress);
  const std::vector<PrecisionPoint> points = call.run([&] {
    return precision_curve(set, constraints_of(checked.request, set), asked.targets, experiments,
                           checked.options);
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
