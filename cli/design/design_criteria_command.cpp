// `graybox design criteria`: what each criterion makes of one set, and of the designs of the
// others.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "bench/pin_threads.hpp"
#include "cli/arguments/criterion_arguments.hpp"
#include "cli/arguments/set_arguments.hpp"
#include "cli/arguments/threads_argument.hpp"
#include "cli/commands/commands.hpp"
#include "cli/output/console.hpp"
#include "cli/process/interrupt.hpp"
#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/stop.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/files_together.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/core/inverse_cholesky.hpp"
#include "solvers/core/sensitivity.hpp"
#include "solvers/registry.hpp"
#include "solvers/report/solve_report.hpp"

namespace graybox::cli {
namespace {

struct CriteriaArguments {
  SetArguments set;
  std::string solver = "column_generation";
  std::string weights;
  std::string interest;
  SolveOptions options;
  int repetitions = 1;
  std::string output;
  bool json = false;
};

// One criterion, its optimal design, and what that design is worth to all of them.
struct Row {
  Criterion criterion;
  Solution solution;
  SolveReport report;
  double cpu_seconds = 0.0;          // median over the repetitions
  std::vector<double> efficiencies;  // under each criterion
  std::vector<double> deviations;    // of the parameters, for one experiment's worth of information
};

std::string_view name_of(const Row& row) { return to_string(row.criterion.kind()); }

std::vector<Row> rows_for(const CriteriaArguments& arguments, const InformationSet& set) {
  std::vector<Row> rows(3);
  rows[1].criterion = Criterion::a();
  rows[2].criterion = Criterion::e();
  for (const auto& [name, option] :
       {std::pair{"L", arguments.weights}, {"Ds", arguments.interest}}) {
    if (option.empty()) continue;
    const CriterionArguments chosen{
        .name = name, .weights = arguments.weights, .interest = arguments.interest};
    rows.emplace_back().criterion = chosen.read(set).value();
  }
  return rows;
}

double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

void solve_row(const CriteriaArguments& arguments, const Solver& solver, const InformationSet& set,
               Row& row) {
  SolveOptions options = arguments.options;
  options.criterion = row.criterion;
  std::vector<double> seconds;
  for (int k = 0; k < arguments.repetitions && !interrupted(); ++k) {
    Progress progress(fmt::format("{}, criterion {}", arguments.solver, name_of(row)));
    const double start = cpu_seconds();
    row.solution = solver.solve(set, options, &progress);
    seconds.push_back(cpu_seconds() - start);
  }
  if (seconds.empty()) throw Stopped();
  std::ranges::nth_element(seconds,
                           seconds.begin() + static_cast<std::ptrdiff_t>(seconds.size() / 2));
  row.cpu_seconds = seconds[seconds.size() / 2];
  row.report = judge(set, arguments.solver, options, row.solution);
}

// Square roots of the diagonal of M^-1.
std::vector<double> deviations(const InformationSet& set, const std::vector<double>& weights) {
  const std::size_t d = set.dimension();
  std::vector<double> matrix(set.packed_size()), squares(d, 0.0);
  information_matrix(set, weights, matrix);
  InverseCholesky inverse(d);
  if (!inverse.factor(matrix)) return std::vector<double>(d, std::nan(""));
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      const double x = inverse.inverse_factor()[packed_index(i, j)];
      squares[j] += x * x;
    }
  }
  for (double& x : squares) x = std::sqrt(x);
  return squares;
}

void compare(const InformationSet& set, std::vector<Row>& rows) {
  const std::vector<double>& dual =
      rows[2].solution.design.dual_matrix;  // E's; the bound is unused
  for (Row& row : rows) {
    const Design design{row.solution.design.weights, dual};
    for (const Row& judged : rows) {
      const Certificate certificate = certify(set, design, judged.criterion);
      row.efficiencies.push_back(relative_efficiency(set, judged.criterion,
                                                     certificate.criterion_value,
                                                     judged.report.certificate.criterion_value));
    }
    row.deviations = deviations(set, design.weights);
  }
}

std::string parameter_name(const InformationSet& set, std::size_t k) {
  return set.parameters().empty() ? fmt::format("{}", k) : set.parameters()[k];
}

void write_tables(const std::string& folder, const InformationSet& set,
                  const std::vector<Row>& rows) {
  std::string table =
      "criterion,status,value,duality_gap,rounding_bound,support_size,iterations,passes,"
      "cpu_seconds,candidates,dimension\n";
  std::string efficiency = "design", deviation = "parameter";
  for (const Row& row : rows) {
    const Certificate& proof = row.report.certificate;
    table += fmt::format("{},{},{},{:.3e},{:.1e},{},{},{:.2f},{:.6f},{},{}\n", name_of(row),
                         to_string(row.report.status), proof.criterion_value, proof.duality_gap,
                         proof.rounding_bound, proof.support_size, row.report.counters.iterations,
                         row.report.counters.passes, row.cpu_seconds, set.candidate_count(),
                         set.dimension());
    efficiency += fmt::format(",{}", name_of(row));
    deviation += fmt::format(",{}", name_of(row));
  }
  for (const Row& row : rows) {
    efficiency += fmt::format("\n{}", name_of(row));
    for (const double value : row.efficiencies) efficiency += fmt::format(",{:.6f}", value);
  }
  for (std::size_t k = 0; k < set.dimension(); ++k) {
    deviation += fmt::format("\n{}", parameter_name(set, k));
    for (const Row& row : rows) deviation += fmt::format(",{:.6g}", row.deviations[k]);
  }
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw InputError(fmt::format("{}: can't be made: {}", folder, error.message()));
  FilesTogether files;
  write_text_file(folder + "/criteria.csv", table);
  write_text_file(folder + "/criteria_efficiency.csv", efficiency + "\n");
  write_text_file(folder + "/criteria_deviations.csv", deviation + "\n");
  files.commit();
}

nlohmann::ordered_json to_json(const ProjectedSet& read, const std::vector<Row>& rows) {
  const InformationSet& set = read.set;
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Row& row : rows) {
    nlohmann::ordered_json entry = graybox::to_json(row.report);
    entry["cpu_seconds"] = row.cpu_seconds;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      entry["efficiencies"][std::string(name_of(rows[k]))] = row.efficiencies[k];
    }
    for (std::size_t k = 0; k < set.dimension(); ++k) {
      entry["standard_deviations"][parameter_name(set, k)] = row.deviations[k];
    }
    add_change(read.changed, entry);
    list.push_back(std::move(entry));
  }
  return list;
}

void print(const InformationSet& set, const std::vector<Row>& rows) {
  fmt::print("{}: {}\n\n", set.name(), describe(set));
  fmt::print("{:<10} {:>9} {:>10} {:>8} {:>7} {:>9}   efficiency under", "design for", "value",
             "gap", "support", "passes", "CPU ms");
  for (const Row& row : rows) fmt::print(" {:>7}", name_of(row));
  fmt::print("\n");
  for (const Row& row : rows) {
    const Certificate& proof = row.report.certificate;
    fmt::print("{:<10} {:>9.4g} {:>10.1e} {:>8} {:>7.1f} {:>9.2f}   {:<16}", name_of(row),
               proof.criterion_value, proof.duality_gap, proof.support_size,
               row.report.counters.passes, 1e3 * row.cpu_seconds, "");
    for (const double value : row.efficiencies) fmt::print(" {:>7.3f}", value);
    fmt::print("\n");
  }
  fmt::print("\nstandard deviation of each parameter, for one experiment's worth of information\n");
  for (std::size_t k = 0; k < set.dimension(); ++k) {
    fmt::print("{:<25}", parameter_name(set, k));
    for (const Row& row : rows) fmt::print(" {:>9.4g}", row.deviations[k]);
    fmt::print("\n");
  }
}

int design_criteria(const CriteriaArguments& arguments, Invocation& invocation) {
  if (arguments.repetitions < 1) throw InputError("--repetitions must be at least 1");
  const SolverRegistry registry = make_registry();
  const Solver& solver = registry.at(arguments.solver);
  bench::pin_threads(arguments.options.threads, invocation.arguments);
  const ProjectedSet read = read_set(arguments.set);
  const InformationSet& set = read.set;
  std::vector<Row> rows = rows_for(arguments, set);
  catch_interrupts();
  for (Row& row : rows) {
    solve_row(arguments, solver, set, row);
    if (row.report.status == ReportStatus::kUnsupported) throw InputError(row.report.message);
    if (row.report.status != ReportStatus::kSolved) invocation.exit_code = kShort;
  }
  compare(set, rows);
  if (!arguments.output.empty()) write_tables(arguments.output, set, rows);
  if (arguments.json) {
    fmt::print("{}\n", to_json(read, rows).dump());
  } else {
    fmt::print("{}", change_note(read.changed));
    print(set, rows);
    if (!arguments.output.empty()) fmt::print("wrote {}/criteria*.csv\n", arguments.output);
  }
  return invocation.exit_code;
}

}  // namespace

void add_design_criteria_command(CLI::App& app, Invocation& invocation) {
  auto* command = app.add_subcommand(
      "criteria", "Compare the designs for D, A, E, and for L and Ds where asked for");
  auto arguments = std::make_shared<CriteriaArguments>();
  SolveOptions& options = arguments->options;
  options.duality_gap = 1e-9;
  add_set_options(*command, arguments->set);
  command->add_option("--weights", arguments->weights, "L too, with this W (see 'graybox solve')");
  command->add_option("--interest", arguments->interest, "Ds too, with these parameters");
  command->add_option("--solver", arguments->solver, "back-end that solves all of them")
      ->capture_default_str();
  command->add_option("--gap", options.duality_gap, "duality gap to reach")->capture_default_str();
  command->add_option("--time-limit", options.time_limit, "wall seconds for each criterion");
  add_threads(*command, options.threads);
  command->add_option("--repetitions", arguments->repetitions, "CPU time: median over so many runs")
      ->capture_default_str();
  command->add_option("-o,--output", arguments->output,
                      "folder for criteria.csv, criteria_efficiency.csv, criteria_deviations.csv");
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "Efficiency of a design under a criterion: how much of the best possible it reaches; 0.8 "
      "says\n"
      "that it takes 1/0.8 times as many experiments. See docs/how_to/criteria.md.\n"
      "Example:\n"
      "  graybox design criteria set.h5 --interest joint_1.gearbox,joint_2.gearbox -o tables");
  command->callback(
      [arguments, &invocation] { invocation.exit_code = design_criteria(*arguments, invocation); });
}

}  // namespace graybox::cli
