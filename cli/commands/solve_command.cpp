#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "bench/pin_threads.hpp"
#include "cli/arguments/criterion_arguments.hpp"
#include "cli/arguments/design_output_arguments.hpp"
#include "cli/arguments/request_arguments.hpp"
#include "cli/arguments/set_arguments.hpp"
#include "cli/arguments/threads_argument.hpp"
#include "cli/commands/commands.hpp"
#include "cli/output/console.hpp"
#include "cli/output/constrained_report_text.hpp"
#include "cli/output/design_output.hpp"
#include "cli/output/floor_text.hpp"
#include "cli/output/set_answer.hpp"
#include "cli/output/trace_file.hpp"
#include "cli/process/interrupt.hpp"
#include "diagnosis/design_page/design_stories.hpp"
#include "problems/base/error.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/files_together.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/constrained/constrained_design_file.hpp"
#include "solvers/floors/efficiency_floor.hpp"
#include "solvers/floors/floored_design.hpp"
#include "solvers/registry.hpp"
#include "solvers/report/design_file.hpp"
#include "solvers/report/solve_report.hpp"

namespace graybox::cli {
namespace {

struct SolveArguments {
  SetArguments set;
  std::string solver = "column_generation";
  SolveOptions options;
  CriterionArguments criterion;
  RequestArguments request;
  DesignOutputArguments shown;
  std::string start;
  std::string trace;
  std::string output;
  bool json = false;
};

Solution run(const Solver& solver, const InformationSet& set, const SolveOptions& options) {
  Progress progress{std::string(solver.name())};
  catch_interrupts();
  Solution solution = solver.solve(set, options, &progress);
  if (interrupted() && solution.status == SolveStatus::kTimeLimit) {
    solution.message = "interrupted; this is the best design so far";
  }
  return solution;
}

// Without a gap on the way the design is the solver's start: no answer.
bool has_answer(const Solution& solution) {
  if (solution.status == SolveStatus::kUnsupported) return false;
  return solution.status == SolveStatus::kSolved ||
         std::ranges::any_of(solution.trace, [](const TracePoint& point) {
           return std::isfinite(point.duality_gap);
         });
}

void print(const SolveArguments& arguments, const ProjectedSet& read, const Solution& solution,
           const SolveReport& report) {
  const InformationSet& set = read.set;
  if (arguments.json) {
    print_line(read, to_json(report));
    return;
  }
  fmt::print("{}", set_headline(read));
  if (!has_answer(solution)) {
    fmt::print("{}: {} ({}); there is no design{}\n", report.solver, to_string(report.status),
               report.message.empty() ? "no reason given" : report.message,
               arguments.output.empty() ? "" : ", and nothing is written");
    return;
  }
  fmt::print("{}", describe(report));
  if (!solution.design.weights.empty()) fmt::print("{}", describe_support(set, solution.design));
  if (!arguments.output.empty()) fmt::print("wrote {}\n", arguments.output);
}

// Under constraints: by column generation, the one back-end that takes them.
int solve_request(const SolveArguments& arguments, const ProjectedSet& read,
                  const SolveOptions& options, DesignRequest request, const DesignOutput& shown) {
  const InformationSet& set = read.set;
  DesignConstraints constraints = resolve(request, set);
  Progress progress{arguments.solver};
  catch_interrupts();
  ConstrainedSolution solution = solve_constrained(set, constraints, options, &progress);
  if (interrupted() && solution.status == SolveStatus::kTimeLimit) {
    solution.message = "interrupted; this is the best design so far";
  }
  const std::vector<TracePoint> trace = solution.trace;
  ConstrainedReport report = judge_constrained(set, arguments.solver, options, std::move(solution),
                                               std::move(request), std::move(constraints));
  report.report.problem_hash = set.content_hash();
  const bool answer = !report.efforts.empty();
  FilesTogether files;
  if (!arguments.trace.empty()) write_trace(arguments.trace, trace);
  if (!arguments.output.empty() && answer) write_constrained_design(arguments.output, set, report);
  if (shown.has_page() && answer) {
    shown.write_page(constrained_story(set, report), {{arguments.set.path, "information set"}});
  }
  files.commit();
  if (shown.has_table() && answer) {
    shown.print_table(set, design_schedule(set, report.weights().weights));
  } else {
    print_answer(read, arguments.json, to_json(report),
                 describe_constrained(report) + (answer ? describe_efforts(set, report) : ""));
    if (answer && !arguments.json) shown.say_written(arguments.output);
  }
  return report.report.status == ReportStatus::kSolved ? kDone : kShort;
}

// Throws InputError for a back-end that can't take them.
void require_constrained(const SolveArguments& arguments) {
  if (arguments.solver != ColumnGeneration().name()) {
    throw InputError(
        fmt::format("{} can't take constraints, costs, earlier trials or floors; use {}",
                    arguments.solver, ColumnGeneration().name()));
  }
}

// A page draws sensitivities against the bound of one criterion; floors have another.
void require_no_page(const DesignOutput& shown) {
  if (shown.has_page()) throw InputError("--report draws no design with --floor; leave one out");
}

// Under floors of other criteria: by column generation on compound criteria.
int solve_floors(const SolveArguments& arguments, const ProjectedSet& read,
                 const SolveOptions& options, std::vector<EfficiencyFloor> floors,
                 const DesignOutput& shown) {
  const InformationSet& set = read.set;
  require_no_page(shown);
  Progress progress{arguments.solver};
  catch_interrupts();
  const Solution solution = solve_floored(set, options, floors, &progress);
  SolveReport report = judge(set, arguments.solver, options, solution);
  report.problem_hash = set.content_hash();
  const FlooredCertificate proof =
      certify_floored(set, solution.design, options.criterion, floors, options.duality_gap);
  report.certificate = proof.certificate;
  report.status = judge(solution.status, options.duality_gap, report.certificate);
  report.message = solution.message.empty() ? proof.certificate.message : solution.message;
  FilesTogether files;
  if (!arguments.trace.empty()) write_trace(arguments.trace, solution.trace);
  if (!arguments.output.empty()) {
    write_floored_design(arguments.output, set, solution.design, report, floors);
  }
  files.commit();
  if (shown.has_table()) {
    shown.print_table(set, design_schedule(set, solution.design.weights));
  } else if (arguments.json) {
    nlohmann::ordered_json line = to_json(report);
    line["floors"] = floors_json(set, floors);
    for (std::size_t k = 0; k < proof.efficiencies.size(); ++k) {
      line["floors"][k]["efficiency"] = proof.efficiencies[k];
    }
    print_line(read, std::move(line));
  } else {
    print(arguments, read, solution, report);
    fmt::print("{}", describe_floors(floors, proof.efficiencies));
  }
  return report.status == ReportStatus::kSolved ? kDone : kShort;
}

// Throws InputError for what floors can't be combined with.
void require_floors_alone(const SolveArguments& arguments, bool has_request) {
  if (arguments.criterion.floor.empty()) return;
  require_constrained(arguments);
  if (has_request) {
    throw InputError("--floor can't be combined with constraints, costs or earlier trials");
  }
}

// Throws InputError for back-ends and requests that can't begin from a design.
void require_start_fits(const SolveArguments& arguments, const Solver& solver, bool has_request) {
  if (arguments.start.empty()) return;
  if (has_request || !arguments.criterion.floor.empty()) {
    throw InputError(
        "--start can't be combined with constraints, costs, earlier trials or floors; leave it "
        "out");
  }
  if (!solver.traits().takes_start) {
    throw InputError(fmt::format("--start: {} can't begin from a design; leave it out or use {}",
                                 solver.name(), ColumnGeneration().name()));
  }
}

int solve(const SolveArguments& arguments, Invocation& invocation) {
  DesignOutput shown(arguments.shown, invocation.arguments);
  arguments.criterion.require_consistent();
  require_design_output(arguments.shown, arguments.json);
  DesignRequest request = arguments.request.read();
  const SolverRegistry registry = make_registry();
  const Solver& solver = registry.at(arguments.solver);
  if (request.any()) require_constrained(arguments);
  require_floors_alone(arguments, request.any());
  require_start_fits(arguments, solver, request.any());
  bench::pin_threads(arguments.options.threads, invocation.arguments);
  const ProjectedSet read = [&] {
    const ReadingLimit limit(arguments.options.time_limit, arguments.set.path);
    return read_set(arguments.set,
                    arguments.request.has_prior() ? SingularSum::kAllowed : SingularSum::kRefused,
                    FactorForm::kKept);
  }();
  const InformationSet& set = read.set;
  if (request.any() || !arguments.criterion.floor.empty()) static_cast<void>(set.data());
  for (const std::string& file : {arguments.output, arguments.trace}) {
    if (!file.empty()) require_writable(file);
  }
  shown.read_robot(set);
  SolveOptions options = arguments.options;
  options.criterion = arguments.criterion.read(set).value_or(Criterion());
  if (request.any()) {
    return solve_request(arguments, read, options, std::move(request), shown);
  }
  if (std::vector<EfficiencyFloor> floors = arguments.criterion.read_floors(set); !floors.empty()) {
    return solve_floors(arguments, read, options, std::move(floors), shown);
  }
  Design start;  // outlives the run
  if (!arguments.start.empty()) {
    start = read_design(arguments.start, set, WeightCheck::kRepaired).design;
    options.start = start.weights;
  }
  const Solution solution = run(solver, set, options);
  SolveReport report = judge(set, solver.name(), options, solution);
  report.problem_hash = set.content_hash();
  const bool has_design = has_answer(solution) && !solution.design.weights.empty();
  FilesTogether files;
  if (!arguments.trace.empty()) write_trace(arguments.trace, solution.trace);
  if (!arguments.output.empty() && has_answer(solution)) {
    write_design(arguments.output, set, solution.design, report);
  }
  if (has_design && shown.has_page()) {
    shown.write_page(solve_story(set, solution.design, report),
                     {{arguments.set.path, "information set"}});
  }
  files.commit();
  if (has_design && shown.has_table()) {
    shown.print_table(set, design_schedule(set, solution.design.weights));
  } else {
    print(arguments, read, solution, report);
    if (has_design && !arguments.json) shown.say_page();
  }
  return report.status == ReportStatus::kSolved ? kDone : kShort;
}

}  // namespace

void add_solve_command(CLI::App& app, Invocation& invocation) {
  auto* command = app.add_subcommand("solve", "Find an optimal design and certify it");
  auto arguments = std::make_shared<SolveArguments>();
  SolveOptions& options = arguments->options;
  add_set_options(*command, arguments->set);
  add_factors_option(*command, arguments->set);
  add_criterion_options(*command, arguments->criterion);
  add_floor_option(*command, arguments->criterion);
  add_request_options(*command, arguments->request);
  command->add_option("--gap", options.duality_gap, "duality gap to reach")->capture_default_str();
  add_design_output_options(*command, arguments->shown);
  command->add_option("--solver", arguments->solver,
                      "column_generation, or another of 'graybox solvers'");
  command->add_option("--start", arguments->start, "design to begin from, as -o has written it");
  command->add_option("--time-limit", options.time_limit, "wall seconds (default: none)");
  command->add_option("--iteration-limit", options.iteration_limit,
                      "iterations (default: the solver's own)");
  command->add_option("--seed", options.seed, "of randomised solvers")->capture_default_str();
  add_threads(*command, options.threads);
  command->add_option("--trace", arguments->trace, "write the history of the run as JSON lines");
  command->add_option("-o,--output", arguments->output, "write the design as JSON");
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "Exit code 0: the gap asked is proven, rounding included. Ctrl-C keeps the best (1).\n"
      "Examples:\n"
      "  graybox solve set.h5 --criterion E --gap 1e-5 -o design.json --report design.html\n"
      "  graybox solve set.h5 --criterion G --region points.csv --costs minutes.csv --budget 90");
  command->callback(
      [arguments, &invocation] { invocation.exit_code = solve(*arguments, invocation); });
}

}  // namespace graybox::cli
