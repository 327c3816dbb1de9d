#include "python/bindings/candidates.hpp"

#include <fmt/format.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <exception>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/stop.hpp"
#include "problems/information/candidate_space.hpp"
#include "problems/information/jacobian_information.hpp"
#include "python/bindings/call.hpp"
#include "python/bindings/design.hpp"
#include "python/bindings/information.hpp"
#include "python/bindings/plain_objects.hpp"
#include "solvers/column_generation/continuous_design.hpp"

namespace graybox::python {
namespace {

namespace py = pybind11;

JacobianNoise noise_of(const py::object& noise) {
  const auto values = numbers(noise, "noise");
  const std::span<const double> all(values.data(), static_cast<std::size_t>(values.size()));
  if (values.ndim() < 2) return JacobianNoise::deviations(all);
  if (values.shape(0) != values.shape(1)) throw InputError("noise: the covariance is not square");
  return JacobianNoise::covariance(all, static_cast<std::size_t>(values.shape(0)));
}

// values: [Q, r, d]; a set's matrices in packed form, [Q, p].
py::array_t<double> information_of_jacobians(const py::object& jacobians, const py::object& noise) {
  const auto values = numbers(jacobians, "Jacobians");
  if (values.ndim() != 3) throw InputError("Jacobians: expected an array [Q x r x d]");
  const auto extent = [&](int axis) { return static_cast<std::size_t>(values.shape(axis)); };
  const InformationSet set =
      information_set_from_jacobians({.candidates = extent(0),
                                      .outputs = extent(1),
                                      .parameters = extent(2),
                                      .values = {values.data(), values.data() + values.size()}},
                                     noise_of(noise));
  py::array_t<double> packed({set.candidate_count(), set.packed_size()});
  std::copy_n(set.data(), set.candidate_count() * set.packed_size(), packed.mutable_data());
  return packed;
}

// A box whose matrices come from a callable of a point. What it throws is kept: no exception may
// leave the searches' loops.
class CallableSpace : public CandidateSpace {
 public:
  CallableSpace(py::function matrix, std::vector<double> lower, std::vector<double> upper,
                std::size_t dimension)
      : matrix_(std::move(matrix)),
        lower_(std::move(lower)),
        upper_(std::move(upper)),
        dimension_(dimension) {}

  [[nodiscard]] std::size_t dimension() const override { return dimension_; }
  [[nodiscard]] std::span<const double> lower() const override { return lower_; }
  [[nodiscard]] std::span<const double> upper() const override { return upper_; }
  [[nodiscard]] std::unique_ptr<InformationEvaluator> evaluator() const override {
    return std::make_unique<Evaluator>(*this);
  }
  [[nodiscard]] bool has_failed() const { return failure_ != nullptr; }
  void rethrow() const {
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  class Evaluator : public InformationEvaluator {
   public:
    explicit Evaluator(const CallableSpace& space) : space_(space) {}
    void information(std::span<const double> point, std::span<double> packed) override {
      space_.evaluate(point, packed);
    }

   private:
    const CallableSpace& space_;
  };

  void evaluate(std::span<const double> point, std::span<double> packed) const {
    std::ranges::fill(packed, 0.0);
    if (failure_ || stop_was_asked_for()) return;
    const py::gil_scoped_acquire locked;
    try {
      const py::array_t<double> at(static_cast<py::ssize_t>(point.size()), point.data());
      const auto answer = numbers(matrix_(at), "information");
      const auto d = static_cast<py::ssize_t>(dimension_);
      if (answer.ndim() != 2 || answer.shape(0) != d || answer.shape(1) != d) {
        throw InputError(fmt::format("information: expected a matrix {} x {}", d, d));
      }
      pack(answer.data(), dimension_, packed.data());
    } catch (...) {
      failure_ = std::current_exception();
    }
  }

  py::function matrix_;
  std::vector<double> lower_, upper_;
  std::size_t dimension_;
  mutable std::exception_ptr failure_;
};

py::array_t<double> rows_of(const std::vector<double>& values, std::size_t columns) {
  py::array_t<double> rows({values.size() / columns, columns});
  std::ranges::copy(values, rows.mutable_data());
  return rows;
}

py::dict continuous(const py::function& matrix, const py::object& lower, const py::object& upper,
                    const PythonSet& grid, const py::dict& arguments, const py::object& progress) {
  const InformationSet& set = grid.set();
  CallableSpace space(matrix, number_list(lower, "lower"), number_list(upper, "upper"),
                      set.dimension());
  ContinuousOptions options;
  options.duality_gap = py::cast<double>(arguments["gap"]);
  options.seed = py::cast<std::uint64_t>(arguments["seed"]);
  options.random_points = py::cast<std::size_t>(arguments["random_points"]);
  options.random_starts = std::min<std::size_t>(options.random_starts, options.random_points);
  Call call(progress);
  ContinuousResult result;
  Certificate certificate;
  call.run([&] {
    result = solve_continuous(space, set, options, [&](const ContinuousRound& round) {
      return !space.has_failed() && call.proceed([&] {
        return fmt::format("round {}: log det {:.6f}, gap {:.2e}", round.round, round.log_det,
                           round.found_gap);
      });
    });
    if (space.has_failed() || stop_was_asked_for()) return;
    const DesignedSet designed = grid_and_support(space, set, result);
    certificate = certify(designed.set, designed.design, {}, options.duality_gap);
  });
  space.rethrow();
  py::dict fields;
  fields["interrupted"] = call.interrupted();
  fields["status"] = to_string(result.status);
  fields["points"] = rows_of(result.points, space.coordinate_count());
  fields["weights"] = array_of(std::move(result.weights));
  fields["log_det"] = result.log_det;
  fields["found_gap"] = result.gap;
  fields["grid_log_det"] = result.grid_log_det;
  fields["rounds"] = result.rounds.size();
  fields["certificate"] = fields_of(certificate);
  return fields;
}

}  // namespace

void add_candidates(py::module_& module) {
  module.def("information_of_jacobians", &information_of_jacobians);
  module.def("continuous", &continuous);
}

}  // namespace graybox::python
