#include "python/bindings/information.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <memory>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/formats/information_set_file.hpp"
#include "problems/formats/npy_file.hpp"
#include "problems/formats/symmetric_packer.hpp"
#include "problems/information/factor_form.hpp"
#include "problems/information/held_numbers.hpp"
#include "problems/information/set_validation.hpp"
#include "python/bindings/call.hpp"

namespace graybox::python {
namespace {

namespace py = pybind11;
using Array = py::array_t<double, py::array::c_style>;

constexpr const char* kSubject = "information set";

bool is_text(const py::handle& value) {
  return py::isinstance<py::str>(value) || py::hasattr(value, "__fspath__");
}

std::string text_of(const py::handle& value) {
  return py::str(py::isinstance<py::str>(value) ? py::reinterpret_borrow<py::object>(value)
                                                : value.attr("__fspath__")());
}

// A number or a text, as the texts of a request have them.
std::string word_of(const py::handle& value) {
  if (is_text(value)) return text_of(value);
  return fmt::format("{}", py::cast<double>(value));
}

bool is_single(const py::array& array) { return array.dtype().is(py::dtype::of<float>()); }

std::vector<std::size_t> shape_of(const py::array& array) {
  return {array.shape(), array.shape() + array.ndim()};
}

// The type as NumPy writes it in files, '<i8'.
[[noreturn]] void refuse_type(const std::string& name, const py::array& array) {
  throw InputError(
      wrong_dtype(name, fmt::format("'{}'", std::string(py::str(array.dtype().attr("str"))))));
}

// float64 and float32 of the machine's byte order.
bool is_known_type(const py::array& array) {
  const auto type = std::string(py::str(array.dtype().attr("str")));
  return type == "<f8" || type == "<f4";
}

bool is_used_in_place(const py::array& array) {
  const bool is_aligned = reinterpret_cast<std::uintptr_t>(array.data()) % alignof(double) == 0;
  return !is_single(array) && is_aligned && (array.flags() & py::array::c_style) != 0;
}

// Matrices in an array: packed ones of float64 where they are, others copied.
InformationSet set_of_array(const py::array& array, const std::string& name,
                            std::vector<std::string> parameters, CandidateTable table) {
  if (!is_known_type(array)) refuse_type(name, array);
  const std::size_t dimension = dimension_of_shape(name, shape_of(array));
  const auto count = static_cast<std::size_t>(array.shape(0));
  AlignedArray packed;
  if (array.ndim() == 2 && is_used_in_place(array)) {
    packed = AlignedArray::borrowed(static_cast<const double*>(array.data()),
                                    count * packed_size(dimension));
  } else {
    const Array values = Array::ensure(array);
    if (array.ndim() == 2) {
      packed = AlignedArray(static_cast<std::size_t>(values.size()));
      std::memcpy(packed.data(), values.data(), packed.size() * sizeof(double));
    } else {
      SymmetricPacker packer(name, dimension, count,
                             is_single(array) ? kSingleSymmetryTolerance : kSymmetryTolerance);
      packer.add(values.data(), count);
      packed = packer.take();
    }
  }
  require_finite(name, packed, dimension);
  return {dimension, std::move(packed), std::move(table), std::move(parameters), name};
}

// Factors F_i of H_i = F_i^T F_i: vectors [Q, d], or [Q, k, d]. Those of float64 in C order stay
// where they are.
InformationSet set_of_factors(const py::array& array, const std::string& name,
                              std::vector<std::string> parameters, CandidateTable table) {
  if (!is_known_type(array)) refuse_type(name, array);
  const std::vector<std::size_t> shape = shape_of(array);
  if ((shape.size() != 2 && shape.size() != 3) || std::ranges::count(shape, std::size_t{0}) > 0) {
    throw InputError(fmt::format("{}: shape ({}): expected factors [Q x d] or [Q x k x d]", name,
                                 fmt::join(shape, ", ")));
  }
  AlignedArray factors;
  if (is_used_in_place(array)) {
    factors = AlignedArray::borrowed(static_cast<const double*>(array.data()),
                                     static_cast<std::size_t>(array.size()));
  } else {
    const Array values = Array::ensure(array);
    factors = AlignedArray(static_cast<std::size_t>(values.size()));
    std::memcpy(factors.data(), values.data(), factors.size() * sizeof(double));
  }
  const std::size_t rank = shape.size() == 3 ? shape[1] : 1;
  require_finite_factors(name, std::as_const(factors).span(), rank, shape.back());
  return InformationSet::of_factors(shape.back(), rank, std::move(factors), std::move(table),
                                    std::move(parameters), name);
}

CandidateTable table_of(const py::object& coordinates, const py::object& names) {
  CandidateTable table;
  if (coordinates.is_none()) return table;
  const Array values = numbers(coordinates, "coordinates");
  if (values.ndim() != 2) throw InputError("coordinates: expected an array [Q x n]");
  if (!names.is_none()) table.names = py::cast<std::vector<std::string>>(names);
  for (auto k = static_cast<py::ssize_t>(table.names.size()); k < values.shape(1); ++k) {
    table.names.push_back(fmt::format("x{}", k + 1));
  }
  table.units.assign(table.names.size(), "");
  table.values.assign(values.data(), values.data() + values.size());
  return table;
}

std::unique_ptr<PythonSet> make_set(const py::object& source, const py::object& parameters,
                                    const py::object& coordinates, const py::object& names,
                                    double psd_tolerance, bool singular,
                                    const std::string& variable, bool factors) {
  const SingularSum sum = singular ? SingularSum::kAllowed : SingularSum::kRefused;
  std::vector<std::string> parameter_names;
  if (!parameters.is_none()) parameter_names = py::cast<std::vector<std::string>>(parameters);
  Call call{py::none()};
  if (is_text(source)) {
    const std::string path = text_of(source);
    auto made = call.run([&] {
      return std::make_unique<PythonSet>(
          PythonSet{project_semidefinite(
                        read_information_set(path, {.variable = variable, .factors = factors}),
                        psd_tolerance, sum),
                    sum});
    });
    if (call.interrupted()) throw Stopped();
    return made;
  }
  const py::array array = py::array::ensure(source);
  if (!array) {
    PyErr_Clear();
    throw InputError(
        fmt::format("{}: expected an array [Q x d x d] or packed [Q x p], or a file", kSubject));
  }
  InformationSet set = (factors ? set_of_factors : set_of_array)(
      array, kSubject, std::move(parameter_names), table_of(coordinates, names));
  const bool borrows = held_numbers(set).data() == array.data();
  auto made = call.run([&] {
    return std::make_unique<PythonSet>(
        PythonSet{project_semidefinite(std::move(set), psd_tolerance, sum), sum});
  });
  if (borrows) made->owner = array;
  if (call.interrupted()) throw Stopped();
  return made;
}

py::object argument(const py::dict& arguments, const char* name) {
  return arguments.contains(name) ? py::reinterpret_borrow<py::object>(arguments[name])
                                  : py::object(py::none());
}

// W: a matrix d x d, or the vector c of W = c c^T.
Criterion weighted_criterion(const py::object& value, const InformationSet& set) {
  const Array weights = numbers(value, "W");
  const auto d = static_cast<py::ssize_t>(set.dimension());
  const bool is_vector = weights.ndim() == 1 && weights.shape(0) == d;
  if (!is_vector && !(weights.ndim() == 2 && weights.shape(0) == d && weights.shape(1) == d)) {
    throw InputError(
        fmt::format("W: expected {} x {}, or {} numbers for a single combination", d, d, d));
  }
  std::vector<double> packed(set.packed_size());
  for (py::ssize_t i = 0; i < d; ++i) {
    for (py::ssize_t j = 0; j <= i; ++j) {
      if (!is_vector && weights.at(i, j) != weights.at(j, i)) {
        throw InputError(fmt::format("W: not symmetric: entry ({}, {}) is {}, ({}, {}) is {}",
                                     i + 1, j + 1, weights.at(i, j), j + 1, i + 1,
                                     weights.at(j, i)));
      }
      packed[packed_index(static_cast<std::size_t>(i), static_cast<std::size_t>(j))] =
          is_vector ? weights.at(i) * weights.at(j) : weights.at(i, j);
    }
  }
  return Criterion::l(std::move(packed));
}

// The rows of a matrix with d columns, or one vector.
PredictionRegion rows_of(const py::object& value, const char* name, const InformationSet& set) {
  const Array rows = numbers(value, name);
  const auto d = static_cast<py::ssize_t>(set.dimension());
  if (rows.ndim() < 1 || rows.ndim() > 2 || rows.shape(rows.ndim() - 1) != d) {
    throw InputError(fmt::format("{}: expected rows of {} numbers", name, d));
  }
  return PredictionRegion::of_regressors(set.dimension(), {rows.data(), rows.data() + rows.size()});
}

// W = sum of c c^T over the rows.
Criterion combined_criterion(const py::object& value, const InformationSet& set) {
  const PredictionRegion functions = rows_of(value, "W", set);
  std::vector<double> weights = functions.mean_information();
  for (double& entry : weights) entry *= static_cast<double>(functions.count());
  return Criterion::c(std::move(weights));
}

std::vector<std::size_t> interest_of(const py::object& value, const InformationSet& set) {
  std::vector<std::string> names;
  for (const py::handle& each : value) names.emplace_back(py::str(each));
  return parameter_indices(set, names);
}

// A text, a number or an array into the one place or the other.
void take(const py::object& value, const char* name, std::string& text,
          std::vector<double>& values) {
  if (value.is_none()) return;
  if (is_text(value) || py::isinstance<py::float_>(value) || py::isinstance<py::int_>(value)) {
    text = word_of(value);
  } else {
    values = number_list(value, name);
  }
}

std::vector<double> packed_matrix(const py::object& value) {
  const Array matrix = numbers(value, "prior");
  if (matrix.ndim() != 2) return number_list(value, "prior");
  if (matrix.shape(0) != matrix.shape(1)) throw InputError("prior: the matrix is not square");
  const auto d = static_cast<std::size_t>(matrix.shape(0));
  SymmetricPacker packer("prior", d, 1, kSymmetryTolerance);
  packer.add(matrix.data(), 1);
  const AlignedArray packed = packer.take();
  require_finite("prior", packed, d);
  return {packed.begin(), packed.end()};
}

// Rows of A with their bounds; `equal`: A x = b, else A x <= b.
void add_rows(const py::object& matrix, const py::object& bounds, bool equal,
              std::vector<LinearConstraint>& rows) {
  const std::string a = equal ? "A_eq" : "A_ub", b = equal ? "b_eq" : "b_ub";
  if (matrix.is_none() != bounds.is_none()) {
    throw InputError(fmt::format("{} and {} belong together; give both or neither", a, b));
  }
  if (matrix.is_none()) return;
  const Array values = numbers(matrix, a);
  const std::vector<double> limits = number_list(bounds, b);
  const bool is_one = values.ndim() == 1;
  const auto count = static_cast<std::size_t>(is_one ? 1 : values.shape(0));
  if (values.ndim() < 1 || values.ndim() > 2 || limits.size() != count) {
    throw InputError(fmt::format("{}: expected an array [m x Q] with m numbers in {}", a, b));
  }
  const std::size_t width =
      static_cast<std::size_t>(values.size()) / std::max<std::size_t>(1, count);
  for (std::size_t j = 0; j < count; ++j) {
    const double* row = values.data() + j * width;
    LinearConstraint wanted{.name = fmt::format("{}[{}]", a, j),
                            .coefficients = {row, row + width}};
    wanted.upper = limits[j];
    if (equal) wanted.lower = limits[j];
    rows.push_back(std::move(wanted));
  }
}

RequestedConstraint constraint_of(const py::handle& entry) {
  if (!py::isinstance<py::dict>(entry)) {
    throw InputError("constraints: expected a list of dicts with candidates and at_most, say");
  }
  RequestedConstraint out;
  for (const auto& [key, value] : py::cast<py::dict>(entry)) {
    const std::string name = py::str(key);
    std::string* to = name == "name"           ? &out.name
                      : name == "candidates"   ? &out.candidates
                      : name == "coefficients" ? &out.coefficients
                      : name == "at_most"      ? &out.at_most
                      : name == "at_least"     ? &out.at_least
                      : name == "equal"        ? &out.equal
                                               : nullptr;
    if (to == nullptr) {
      throw InputError(
          fmt::format("constraints: unknown key '{}'; expected name, candidates, "
                      "coefficients, at_most, at_least or equal",
                      name));
    }
    *to = word_of(value);
  }
  if (out.name.empty()) out.name = out.candidates.empty() ? out.coefficients : out.candidates;
  if (out.candidates.empty() == out.coefficients.empty()) {
    throw InputError("constraints: give either candidates or coefficients");
  }
  return out;
}

// "4, 4, 3-5", or numbers.
void take_block_sizes(const py::object& value, std::string& words) {
  if (value.is_none()) return;
  if (is_text(value)) {
    words = text_of(value);
    return;
  }
  words.clear();
  for (const double size : number_list(value, "block_sizes")) {
    words += fmt::format("{}{:g}", words.empty() ? "" : ", ", size);
  }
}

// [Q, k, d], as the set holds them; None where it holds matrices.
py::object factors_of(const py::object& self) {
  const auto& set = py::cast<const PythonSet&>(self).set();
  if (!set.has_factors()) return py::none();
  py::array view(py::dtype::of<double>(), {set.candidate_count(), set.rank(), set.dimension()},
                 set.factors(), self);
  view.attr("flags").attr("writeable") = false;
  return view;
}

// Names of criteria with a number each; empty for None.
std::vector<std::pair<CriterionKind, double>> shares_of(const py::object& value, const char* name) {
  std::vector<std::pair<CriterionKind, double>> out;
  if (value.is_none()) return out;
  if (!py::isinstance<py::dict>(value)) {
    throw InputError(fmt::format("{}: expected a dict of criteria, as {{'A': 0.9}}", name));
  }
  for (const auto& [key, number] : py::cast<py::dict>(value)) {
    out.emplace_back(criterion_kind(std::string(py::str(key))), py::cast<double>(number));
  }
  return out;
}

// Files named beside a request are those of the working folder.
std::string from_here(const std::string& name) {
  std::error_code error;
  if (name.empty() || !std::filesystem::exists(name, error)) return name;
  return std::filesystem::absolute(name).string();
}

// Throws InputError for what none of the criteria takes.
void require_taken(const py::dict& arguments, const std::vector<CriterionKind>& kinds) {
  using enum CriterionKind;
  const auto require = [&](const char* name, const std::vector<CriterionKind>& takers,
                           const char* message) {
    const auto takes = [&](CriterionKind kind) { return std::ranges::count(takers, kind) > 0; };
    if (!argument(arguments, name).is_none() && std::ranges::none_of(kinds, takes)) {
      throw InputError(message);
    }
  };
  require("W", {kL, kC}, "W belongs to criterion L or c");
  require("region", {kI, kG}, "region belongs to criterion I or G");
  require("p", {kPhiP}, "p belongs to criterion phi_p");
  require("interest", {kDs}, "interest belongs to criterion Ds");
}

Criterion criterion_of_kind(CriterionKind kind, const py::dict& arguments,
                            const InformationSet& set) {
  const py::object weights = argument(arguments, "W");
  const py::object interest = argument(arguments, "interest");
  const py::object region = argument(arguments, "region");
  const py::object p = argument(arguments, "p");
  switch (kind) {
    case CriterionKind::kA:
      return Criterion::a();
    case CriterionKind::kE:
      return Criterion::e();
    case CriterionKind::kL:
      if (weights.is_none()) throw InputError("criterion L needs W: a matrix, or a vector");
      return weighted_criterion(weights, set);
    case CriterionKind::kDs:
      if (interest.is_none()) throw InputError("criterion Ds needs interest: names of parameters");
      return Criterion::ds(interest_of(interest, set));
    case CriterionKind::kC:
      if (weights.is_none()) throw InputError("criterion c needs W: a vector, or rows of them");
      return combined_criterion(weights, set);
    case CriterionKind::kI:
      return Criterion::i(region.is_none() ? mean_information(set)
                                           : rows_of(region, "region", set).mean_information());
    case CriterionKind::kG:
      return region.is_none() ? Criterion::g() : Criterion::g(rows_of(region, "region", set));
    case CriterionKind::kPhiP:
      if (p.is_none())
        throw InputError("criterion phi_p needs p: 0 (D), 1 (A), inf (E) or between");
      return Criterion::phi_p(py::cast<double>(p));
    case CriterionKind::kCompound:
      throw InputError(
          "criterion: give the parts of a compound criterion, as {'D': 0.5, 'A': 0.5}");
    case CriterionKind::kD:
      break;
  }
  return {};
}

}  // namespace

void require_regular(const PythonSet& set, const DesignRequest& request) {
  if (set.sum == SingularSum::kAllowed && !request.has_prior()) require_regular_sum(set.set());
}

Array numbers(const py::handle& value, const std::string& name) {
  const py::array array = py::array::ensure(value);
  if (!array) PyErr_Clear();
  if (!array || std::string("fiub").find(array.dtype().kind()) == std::string::npos) {
    throw InputError(fmt::format("{}: expected numbers", name));
  }
  return Array::ensure(array);
}

std::vector<double> number_list(const py::handle& value, const std::string& name) {
  const Array values = numbers(value, name);
  if (values.ndim() > 1) throw InputError(fmt::format("{}: expected one axis", name));
  return {values.data(), values.data() + values.size()};
}

Criterion criterion_of(const py::dict& arguments, const InformationSet& set) {
  const py::object given = argument(arguments, "criterion");
  std::vector<CriterionKind> kinds;
  for (const auto& [kind, share] : shares_of(argument(arguments, "floor"), "floor")) {
    kinds.push_back(kind);
  }
  if (!py::isinstance<py::dict>(given)) {
    kinds.push_back(criterion_kind(text_of(given)));
    require_taken(arguments, kinds);
    return criterion_of_kind(kinds.back(), arguments, set);
  }
  std::vector<CriterionPart> parts;
  for (const auto& [name, share] : py::cast<py::dict>(given)) {
    kinds.push_back(criterion_kind(std::string(py::str(name))));
    parts.push_back({py::cast<double>(share), criterion_of_kind(kinds.back(), arguments, set)});
  }
  require_taken(arguments, kinds);
  return Criterion::compound(std::move(parts));
}

std::vector<EfficiencyFloor> floors_of(const py::dict& arguments, const InformationSet& set) {
  std::vector<EfficiencyFloor> floors;
  const auto multipliers = shares_of(argument(arguments, "floor_multipliers"), "floor_multipliers");
  for (const auto& [kind, share] : shares_of(argument(arguments, "floor"), "floor")) {
    EfficiencyFloor& floor = floors.emplace_back();
    floor.share = share;
    floor.criterion = criterion_of_kind(kind, arguments, set);
    for (const auto& [other, multiplier] : multipliers) {
      if (other == kind) floor.multiplier = multiplier;
    }
  }
  return floors;
}

DesignRequest request_of(const py::dict& arguments) {
  DesignRequest request;
  if (arguments.empty()) return request;
  const py::object file = argument(arguments, "request");
  if (!file.is_none()) request = read_design_request(text_of(file));
  const bool elsewhere = !file.is_none();
  const auto number = [&](const char* name, std::optional<double>& to) {
    const py::object value = argument(arguments, name);
    if (!value.is_none()) to = py::cast<double>(value);
  };
  number("experiments", request.experiments);
  number("budget", request.budget);
  const py::object prior = argument(arguments, "prior");
  if (!prior.is_none()) request.prior.clear();  // the file's
  if (is_text(prior)) {
    request.prior = elsewhere ? from_here(text_of(prior)) : text_of(prior);
  } else if (!prior.is_none()) {
    request.numbers.prior = packed_matrix(prior);
  }
  const auto take_either = [&](const char* name, std::string& text, std::vector<double>& values) {
    const py::object value = argument(arguments, name);
    if (value.is_none()) return;
    text.clear();  // the file's
    take(value, name, text, values);
    if (elsewhere) text = from_here(text);
  };
  take_either("done", request.done, request.numbers.done);
  take_either("costs", request.costs, request.numbers.costs);
  take_either("stock", request.stock, request.numbers.stock);
  std::vector<double> none;
  take(argument(arguments, "require"), "require", request.require, none);
  take(argument(arguments, "forbid"), "forbid", request.forbid, none);
  take_block_sizes(argument(arguments, "block_sizes"), request.block_sizes);
  const py::object constraints = argument(arguments, "constraints");
  if (is_text(constraints)) {
    request.constraints_file = elsewhere ? from_here(text_of(constraints)) : text_of(constraints);
  } else if (!constraints.is_none()) {
    request.constraints.clear();  // the file's
    for (const py::handle& entry : constraints) {
      request.constraints.push_back(constraint_of(entry));
    }
  }
  add_rows(argument(arguments, "A_ub"), argument(arguments, "b_ub"), false, request.numbers.rows);
  add_rows(argument(arguments, "A_eq"), argument(arguments, "b_eq"), true, request.numbers.rows);
  return request;
}

void add_information(py::module_& module) {
  py::class_<PythonSet>(module, "InformationSet",
                        "A set of candidate experiments that has been checked once.\n\n"
                        "source: matrices [Q, d, d], packed ones [Q, p] (float64 in C order: their "
                        "memory is used,\nso that they must not change), or a file. "
                        "factors=True: factors F of H = F'F, vectors [Q, d] or [Q, k, d].\n"
                        "coordinates: [Q, n], for forbid=\"x1 > 2\".\n"
                        "singular=True: some parameters may be without information, which "
                        "prior or done has then.")
      .def(py::init(&make_set), py::arg("source"), py::kw_only(),
           py::arg("parameters") = py::none(), py::arg("coordinates") = py::none(),
           py::arg("coordinate_names") = py::none(),
           py::arg("psd_tolerance") = kDefaultSemidefiniteTolerance, py::arg("singular") = false,
           py::arg("variable") = "", py::arg("factors") = false)
      .def_property_readonly("candidates",
                             [](const PythonSet& self) { return self.set().candidate_count(); })
      .def_property_readonly("dimension",
                             [](const PythonSet& self) { return self.set().dimension(); })
      .def_property_readonly("name", [](const PythonSet& self) { return self.set().name(); })
      .def_property_readonly("parameters",
                             [](const PythonSet& self) { return self.set().parameters(); })
      .def_property_readonly("content_hash",
                             [](const PythonSet& self) { return self.set().content_hash(); })
      .def_property_readonly("note",
                             [](const PythonSet& self) { return describe(self.projected.changed); })
      .def_property_readonly("factors", &factors_of)
      .def_property_readonly("has_matrices",
                             [](const PythonSet& self) { return self.set().has_matrices(); })
      .def_property_readonly("packed",
                             [](const py::object& self) {
                               const auto& set = py::cast<const PythonSet&>(self).set();
                               py::array view(py::dtype::of<double>(),
                                              {set.candidate_count(), set.packed_size()},
                                              set.data(), self);
                               view.attr("flags").attr("writeable") = false;
                               return view;
                             })
      .def("save", [](const PythonSet& self,
                      const py::object& path) { write_information_set(text_of(path), self.set()); })
      .def("__len__", [](const PythonSet& self) { return self.set().candidate_count(); });
}

}  // namespace graybox::python
