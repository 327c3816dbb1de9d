#include "python/bindings/diagnosis.hpp"

#include <fmt/format.h>
#include <pybind11/stl.h>

#include <array>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/runs/diagnosis_run.hpp"
#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"
#include "python/bindings/call.hpp"
#include "python/bindings/option_ranges.hpp"
#include "python/bindings/plain_objects.hpp"

namespace graybox::python {
namespace {

namespace py = pybind11;

DiagnosisRequest request_of(const py::dict& arguments) {
  DiagnosisRequest request;
  request.model = py::cast<std::string>(arguments["model"]);
  request.campaign = py::cast<std::string>(arguments["campaign"]);
  request.report = py::cast<std::string>(arguments["report"]);
  request.law_files = py::cast<std::vector<std::string>>(arguments["laws"]);
  request.place_files = py::cast<std::vector<std::string>>(arguments["places"]);
  request.method = one_of(arguments["method"], "method",
                          {"auto", "periodic", "force_balance", "prediction_error"});
  request.threads = whole_number(arguments["threads"], "threads", 1, 1024);
  SearchOptions& search = request.search;
  search.level = number(arguments["level"], "level", 0.0005, 0.5);
  search.seed = py::cast<std::uint64_t>(arguments["seed"]);
  search.excluded_laws = py::cast<std::vector<std::string>>(arguments["without"]);
  search.ignore_channel_faults = py::cast<bool>(arguments["ignore_faults"]);
  if (!arguments["effects"].is_none()) {
    search.effect_limit =
        static_cast<std::size_t>(whole_number(arguments["effects"], "effects", 1, 50));
  }
  return request;
}

py::dict diagnose_files(const py::dict& arguments, const py::object& progress) {
  DiagnosisRequest request = request_of(arguments);
  double seconds = std::numeric_limits<double>::infinity();
  if (!arguments["time_limit"].is_none()) {
    seconds = number(arguments["time_limit"], "time_limit", 0.01, 1e6);
  }
  Call call(progress);
  request.search.proceed = [&call](const std::string& step) {
    return call.proceed([&] { return step; });
  };
  std::map<std::string, std::string> figures;
  std::string model;
  const DiagnosisAnswer answer = call.run([&] {
    const TimeLimit limit(seconds);
    const std::string file = request.model;
    DiagnosisAnswer found = run_diagnosis(std::move(request));
    figures = found.figures();
    model = found.extended_model(file, "model_extended.yaml");
    return found;
  });
  py::dict fields;
  fields["interrupted"] = call.interrupted();
  fields["verdict"] = plain_object(answer.verdict);
  fields["figures"] = figures;
  fields["model"] = model.empty() ? py::object(py::none()) : py::object(py::str(model));
  return fields;
}

}  // namespace

void add_diagnosis(py::module_& module) { module.def("diagnose", &diagnose_files); }

}  // namespace graybox::python
