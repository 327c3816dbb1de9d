#include "python/bindings/robot_designs.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/studies/sequential_design.hpp"
#include "problems/base/available_memory.hpp"
#include "problems/base/error.hpp"
#include "problems/mechanisms/robot_elements.hpp"
#include "problems/mechanisms/robot_model.hpp"
#include "problems/robot_information/robot_grid.hpp"
#include "problems/robot_information/robot_information.hpp"
#include "problems/robot_information/robot_spectrum_information.hpp"
#include "python/bindings/call.hpp"
#include "python/bindings/design.hpp"
#include "python/bindings/information.hpp"
#include "python/bindings/option_ranges.hpp"
#include "python/bindings/plain_objects.hpp"
#include "solvers/blocks/block_designs.hpp"
#include "solvers/blocks/block_limited_certificate.hpp"
#include "solvers/report/solve_report.hpp"

namespace graybox::python {
namespace {

namespace py = pybind11;

constexpr int kMostPositions = 1000000000;
constexpr std::size_t kPositionBytes = 200;  // of the full grid and of what is taken from it

// "": the robot of graybox. What a linear model leaves out is told by the caller.
LinearRobot robot_of(const std::string& file) {
  return load_linear_robot(file.empty() ? default_robot_file() : std::filesystem::path(file));
}

// "paper", a number of positions, a CSV file, or angles in degrees [Q, joints].
PositionTable positions_of(const py::object& grid, const RobotModel& robot) {
  if (py::isinstance<py::str>(grid)) {
    const auto text = py::cast<std::string>(grid);
    return text == "paper" ? paper_grid() : read_positions(text, robot.joint_names.size());
  }
  if (py::isinstance<py::int_>(grid)) {
    const auto count = static_cast<std::size_t>(whole_number(grid, "grid", 1, kMostPositions));
    require_memory(count * kPositionBytes, fmt::format("grid={}: a grid so fine", count),
                   "choose a smaller grid");
    return robot_grid(count);
  }
  const auto angles = numbers(grid, "grid");
  const auto joints = robot.joint_names.size();
  if (angles.ndim() != 2 || static_cast<std::size_t>(angles.shape(1)) != joints ||
      angles.shape(0) == 0) {
    throw InputError(fmt::format(
        "grid: expected 'paper', a number, a file or angles in degrees [Q x {}]", joints));
  }
  return {joints, {angles.data(), angles.data() + angles.size()}};
}

std::unique_ptr<PythonSet> robot_set(const std::string& file, const py::object& grid,
                                     const py::object& stiffness, int threads) {
  RobotModel robot = robot_of(file).robot;
  const PositionTable positions = positions_of(grid, robot);
  if (!stiffness.is_none()) {
    const std::vector<double> factors = number_list(stiffness, "stiffness");
    if (factors.size() != robot.parameters.size() ||
        !std::ranges::all_of(factors, [](double x) { return x > 0.0 && std::isfinite(x); })) {
      throw InputError(fmt::format("stiffness: expected {} positive factors, one for each of {}",
                                   robot.parameters.size(),
                                   fmt::join(robot.parameter_names(), ", ")));
    }
    robot = with_stiffness_factors(
        robot, Eigen::Map<const Eigen::VectorXd>(factors.data(),
                                                 static_cast<Eigen::Index>(factors.size())));
  }
  Call call{py::none()};
  auto made = call.run([&] {
    return std::make_unique<PythonSet>(PythonSet{
        {robot_information_set(robot, positions, {.threads = threads}).renamed(robot.name), {}}});
  });
  if (call.interrupted()) throw Stopped();
  return made;
}

// ---- positions and spectra at once --------------------------------------------------------------

SolveOptions spectrum_options(const py::dict& arguments) {
  SolveOptions options;
  options.duality_gap = py::cast<double>(arguments["gap"]);
  if (!arguments["time_limit"].is_none()) {
    options.time_limit = py::cast<double>(arguments["time_limit"]);
  }
  options.seed = py::cast<std::uint64_t>(arguments["seed"]);
  options.threads = whole_number(arguments["threads"], "threads", 1, 1024);
  return options;
}

py::dict fields_of_block_design(BlockDesign design, const Certificate& certificate,
                                const CandidateBlocks& blocks, const SolveOptions& options,
                                std::size_t dimension) {
  std::vector<double> shares = block_shares(blocks, design.design.weights);
  py::dict fields;
  fields["status"] = to_string(judge(design.status, options.duality_gap, certificate));
  fields["message"] = design.message.empty() ? certificate.message : design.message;
  fields["asked_gap"] = options.duality_gap;
  fields["position_limit"] = design.limit;
  fields["seconds"] = design.counters.seconds;
  fields["passes"] = design.counters.passes;
  fields["iterations"] = design.counters.iterations;
  fields["certificate"] = fields_of(certificate);
  fields["covariance"] = std::exp(-certificate.log_det / static_cast<double>(dimension));
  fields["shares"] = array_of(std::move(shares));
  fields["weights"] = array_of(std::move(design.design.weights));
  return fields;
}

py::dict spectrum(const std::string& file, const py::object& grid, double limit,
                  const py::dict& arguments, const py::object& progress) {
  const RobotModel robot = robot_of(file).robot;
  const PositionTable positions = positions_of(grid, robot);
  const SolveOptions options = spectrum_options(arguments);
  const std::size_t lines = line_count(robot);
  check_block_limit({positions.count(), {}}, limit);
  require_memory(
      robot_spectrum_bytes(robot, positions.count()),
      fmt::format("the set of {} positions with {} lines each", positions.count(), lines),
      "choose a smaller grid");
  Call call(progress);
  SolveWatch watch(call, limit < 1.0 ? "block_limited" : "column_generation");
  auto made = std::make_unique<PythonSet>(call.run([&] {
    return PythonSet{{robot_spectrum_set(robot, positions, {.threads = options.threads}), {}}};
  }));
  if (call.interrupted()) throw Stopped();
  const InformationSet& set = made->set();
  const CandidateBlocks blocks = equal_blocks(set.candidate_count(), lines);
  BlockDesign design;
  Certificate certificate;
  call.run([&] {
    design = joint_design(set, blocks, options, limit, &watch);
    if (design.status == SolveStatus::kUnsupported) return;
    certificate = limit < 1.0 ? certify_block_limited(set, design.design, blocks, limit)
                              : certify(set, design.design, {}, options.duality_gap);
  });
  const bool interrupted = call.interrupted();
  if (design.status == SolveStatus::kUnsupported) {
    throw InputError(fmt::format("{}: {}", set.name(), design.message));
  }
  py::dict fields =
      fields_of_block_design(std::move(design), certificate, blocks, options, set.dimension());
  fields["interrupted"] = interrupted;
  fields["lines"] = lines;
  const CandidateTable& table = set.candidates();
  py::array_t<double> coordinates({set.candidate_count(), table.names.size()});
  std::ranges::copy(table.values, coordinates.mutable_data());
  fields["coordinates"] = coordinates;
  fields["coordinate_names"] = table.names;
  fields["information"] = py::cast(std::move(made));
  return fields;
}

// ---- measure, estimate, design again ------------------------------------------------------------

SequentialOptions sequential_options(const py::dict& arguments) {
  constexpr int kMost = 1000000;
  SequentialOptions options;
  options.stages = whole_number(arguments["stages"], "stages", 1, kMost);
  options.experiments_per_stage =
      whole_number(arguments["experiments_per_stage"], "experiments_per_stage", 1, kMost);
  options.repetitions = whole_number(arguments["repetitions"], "repetitions", 1, kMost);
  options.start_error = py::cast<double>(arguments["start_error"]);
  options.seed = py::cast<std::uint64_t>(arguments["seed"]);
  options.threads = whole_number(arguments["threads"], "threads", 1, 1024);
  return options;
}

py::dict row_of(const StageRecord& record) {
  py::dict row;
  row["repetition"] = record.repetition;
  row["strategy"] = to_string(record.strategy);
  row["stage"] = record.stage;
  row["experiments"] = record.experiments;
  row["positions"] = record.positions;
  row["parameter_error"] = record.parameter_error;
  row["largest_error"] = record.largest_error;
  row["expected_error"] = record.expected_error;
  row["design_efficiency"] = record.design_efficiency;
  row["fit_status"] = to_string(record.fit_status);
  row["lack_of_fit"] = record.lack_of_fit;
  row["theta"] = record.theta;
  return row;
}

py::dict row_of(const StageSummary& summary) {
  py::dict row;
  row["strategy"] = to_string(summary.strategy);
  row["stage"] = summary.stage;
  row["experiments"] = summary.experiments;
  row["repetitions"] = summary.repetitions;
  row["parameter_error"] = summary.parameter_error.median;
  row["expected_error"] = summary.expected_error.median;
  row["design_efficiency"] = summary.design_efficiency.median;
  row["rejected_fits"] = summary.rejected_fits;
  return row;
}

template <typename Row>
py::list rows_of(const std::vector<Row>& all) {
  py::list rows;
  for (const Row& each : all) rows.append(row_of(each));
  return rows;
}

py::dict sequential(const std::string& file, const py::object& grid, double noise,
                    const py::dict& arguments, const py::object& progress) {
  if (!(noise > 0.0) || !std::isfinite(noise)) {
    throw InputError(fmt::format("noise: must be positive, is {}", noise));
  }
  RobotModel robot = robot_of(file).robot;
  robot.velocity_psd_slope *= noise;
  const PositionTable positions = positions_of(grid, robot);
  const SequentialOptions options = sequential_options(arguments);
  Call call(progress);
  std::vector<StageRecord> records;
  std::size_t finished = 0;
  call.run([&] {
    run_sequential_study(robot, positions, options, [&](const std::vector<StageRecord>& one) {
      records.insert(records.end(), one.begin(), one.end());
      ++finished;
      return call.proceed(
          [&] { return fmt::format("repetition {} of {}", finished, options.repetitions); });
    });
  });
  std::ranges::stable_sort(records, {}, &StageRecord::repetition);
  py::dict data;
  data["repetitions"] = finished;
  data["asked_repetitions"] = options.repetitions;
  data["parameters"] = robot.parameter_names();
  data["records"] = rows_of(records);
  data["summary"] = rows_of(summarise(records));
  py::dict fields;
  fields["interrupted"] = call.interrupted();
  fields["data"] = data;
  return fields;
}

}  // namespace

void add_robot_designs(py::module_& module) {
  module.def("robot_set", &robot_set);
  module.def("spectrum", &spectrum);
  module.def("sequential", &sequential);
}

}  // namespace graybox::python
