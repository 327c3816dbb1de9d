#include "python/bindings/design_files.hpp"

#include <fmt/format.h>
#include <pybind11/stl.h>

#include <optional>
#include <utility>
#include <vector>

#include "problems/base/error.hpp"
#include "python/bindings/call.hpp"
#include "python/bindings/design.hpp"
#include "python/bindings/exact.hpp"
#include "python/bindings/plain_objects.hpp"
#include "solvers/constrained_exact/constrained_exact_file.hpp"
#include "solvers/exact/exact_design_file.hpp"
#include "solvers/report/design_file.hpp"

namespace graybox::python {
namespace {

namespace py = pybind11;

// What a file holds, before it is judged.
struct ReadDesign {
  DesignFile file;
  std::optional<ConstrainedClaim> request;
  std::optional<ExactClaim> exact;
  SolveOptions options;
};

ReadDesign read(const InformationSet& set, const std::string& path, std::optional<double> gap) {
  ReadDesign out{.file = read_design(path, set, WeightCheck::kForChecker),
                 .request = read_constrained_claim(path),
                 .exact = {},
                 .options = {}};
  out.exact = read_exact_claim(path, set, out.file.design);
  out.options.criterion = out.file.criterion.value_or(Criterion());
  out.options.duality_gap = gap.value_or(out.file.asked_gap.value_or(out.options.duality_gap));
  return out;
}

ConstrainedReport judge_request(const InformationSet& set, const std::string& path,
                                const ReadDesign& design) {
  DesignConstraints constraints = resolve(*design.request, set, path);
  ConstrainedSolution solution;
  solution.efforts = design.file.design.weights;
  solution.status = solve_status(design.file.status);
  solution.counters = design.file.counters;
  const LinearConstraint& total = constraints.rows.front();
  const double experiments =
      design.request->experiments.value_or(total.upper / row_value(total, solution.efforts));
  for (double& effort : solution.efforts) effort *= experiments;
  return judge_constrained(set, design.file.solver, design.options, std::move(solution),
                           design.request->request, std::move(constraints));
}

// Without a request, as an approximate design.
SolveReport judge_shares(const InformationSet& set, const ReadDesign& design,
                         std::vector<double>& efficiencies) {
  const DesignFile& file = design.file;
  const Solution claim{.design = file.design,
                       .status = solve_status(file.status),
                       .trace = {},
                       .counters = file.counters,
                       .message = {}};
  SolveReport report = judge(set, file.solver, design.options, claim);
  if (!file.floors.empty()) {
    FlooredCertificate proof = certify_floored(set, file.design, design.options.criterion,
                                               file.floors, design.options.duality_gap);
    report.certificate = proof.certificate;
    efficiencies = std::move(proof.efficiencies);
  } else if (file.limits.any()) {
    report.certificate = certify_limited(set, file.design, file.limits);
  }
  report.status = judge(claim.status, design.options.duality_gap, report.certificate);
  return report;
}

py::dict load(const PythonSet& python_set, const std::string& path, std::optional<double> gap) {
  const InformationSet& set = python_set.set();
  const ReadDesign design = read(set, path, gap);
  py::dict fields;
  Call call{py::none()};
  if (design.exact) fields["counts"] = array_of(design.exact->design.counts);
  if (design.request) {
    require_regular(python_set, design.request->request);
    double efficiency = 0.0;
    ConstrainedReport report = call.run([&] {
      ConstrainedReport judged = judge_request(set, path, design);
      if (design.exact) efficiency = relaxed_efficiency(set, judged);
      return judged;
    });
    fields["report"] = fields_of(report.report);
    if (design.exact) fields["exact"] = fields_of_exact_check(set, report, efficiency);
    fields["multipliers"] = array_of(report.proof.multipliers);
    fields["efforts"] = array_of(std::move(report.efforts));
  } else {
    require_regular(python_set, {});
    std::vector<double> efficiencies;
    ExactCertificate exact;
    const SolveReport report = call.run([&] {
      if (design.exact) {
        exact = certify_exact(set, design.exact->design, design.exact->experiments,
                              solve_relaxation(set));
      }
      return judge_shares(set, design, efficiencies);
    });
    fields["report"] = fields_of(report);
    fields["floors"] = floor_list(design.file.floors, efficiencies);
    if (design.exact) fields["exact"] = fields_of(exact);
  }
  if (call.interrupted()) throw Stopped();
  fields["weights"] = array_of(design.file.design.weights);
  fields["dual_matrix"] = array_of(design.file.design.dual_matrix);
  return fields;
}

}  // namespace

py::object held(const PythonSet& set) { return py::cast(&set, py::return_value_policy::reference); }

py::dict fields_of_exact_check(const InformationSet& set, const ConstrainedReport& report,
                               double efficiency) {
  const Certificate& certificate = report.report.certificate;
  py::dict fields;
  fields["status"] = to_string(certificate.status);
  fields["experiments"] = static_cast<std::int64_t>(std::llround(report.experiments()));
  fields["support_size"] = certificate.support_size;
  fields["log_det"] = certificate.log_det;
  fields["criterion_value"] = certificate.criterion_value;
  fields["rounding_bound"] = certificate.rounding_bound;
  fields["bound"] = value_bound(certificate.criterion_value, efficiency,
                                report.report.options.criterion, set.dimension());
  fields["efficiency"] = efficiency;
  fields["message"] = certificate.message;
  fields["violation"] = report.proof.violation;
  return fields;
}

void add_design_files(py::module_& module) {
  py::class_<DesignWriter>(module, "DesignWriter")
      .def("write", [](const DesignWriter& self, const std::string& path) { self.write(path); });
  module.def("load_design", &load);
}

}  // namespace graybox::python
