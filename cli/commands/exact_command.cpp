// `graybox exact`: how often to run each experiment, with proof.
#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
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
#include "cli/output/exact_report_text.hpp"
#include "cli/output/exact_table.hpp"
#include "cli/output/set_answer.hpp"
#include "cli/process/interrupt.hpp"
#include "diagnosis/design_page/design_stories.hpp"
#include "problems/base/error.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/files_together.hpp"
#include "solvers/constrained_exact/constrained_exact_file.hpp"
#include "solvers/exact/exact_design_file.hpp"
#include "solvers/exact/exact_method.hpp"

namespace graybox::cli {
namespace {

constexpr double kNoLimit = std::numeric_limits<double>::infinity();

struct ExactArguments {
  SetArguments set;
  std::string method = "branch_and_bound";
  std::string experiments;
  ExactOptions options;
  CriterionArguments criterion;
  RequestArguments request;
  DesignOutputArguments shown;
  std::size_t top = 1;
  std::string output;
  std::string table;
  bool json = false;
};

// One line on stderr, rewritten a few times a second; silent unless stderr is a terminal.
class ExactLine : public ExactObserver {
 public:
  explicit ExactLine(std::string method)
      : method_(std::move(method)), terminal_(isatty(STDERR_FILENO) == 1) {}
  ExactLine(const ExactLine&) = delete;
  ExactLine& operator=(const ExactLine&) = delete;
  ~ExactLine() override {
    if (written_) std::fputs("\r\033[K", stderr);
  }

  bool on_progress(const ExactProgress& progress) override {
    const auto now = std::chrono::steady_clock::now();
    if (terminal_ && now >= next_) {
      next_ = now + std::chrono::milliseconds(200);
      written_ = true;
      fmt::print(stderr,
                 "\r\033[K{}: {:.0f} s, {} nodes, {} open, {} candidates left, log det {:.6f}, "
                 "bound {:.6f}, efficiency at least {:.6f}",
                 method_, progress.seconds, progress.nodes, progress.open, progress.survivors,
                 progress.log_det, progress.log_det_bound, progress.proven_efficiency);
      std::fflush(stderr);
    }
    return !interrupted();
  }

 private:
  std::string method_;
  bool terminal_;
  bool written_ = false;
  std::chrono::steady_clock::time_point next_{};
};

ExactReport run(const ExactArguments& arguments, const InformationSet& set) {
  const ExactMethod& method = exact_method(arguments.method);
  const ExactOptions& options = arguments.options;
  require_exact_options(options);
  catch_interrupts();
  const Relaxation relaxation = solve_relaxation(
      set, {.time_limit = options.time_limit, .seed = options.seed, .threads = options.threads});
  ExactLine line{arguments.method};
  ExactSolution solution = method.solve(set, relaxation, options, &line);
  if (interrupted() && solution.status == ExactStatus::kTimeLimit) {
    solution.message = "interrupted; this is the best design so far";
  }
  return report_exact(set, relaxation, method.name(), options, std::move(solution));
}

int exit_code(ExactStatus status) {
  return status == ExactStatus::kOptimal || status == ExactStatus::kFeasible ? kDone : kShort;
}

int table(const ExactArguments& arguments, const InformationSet& set) {
  ExactLine line{arguments.method};
  catch_interrupts();
  const bool complete = write_exact_table(
      arguments.table, set, parse_experiments(arguments.experiments), arguments.options, line);
  if (!arguments.json) fmt::print("wrote {}\n", arguments.table);
  return complete ? kDone : kShort;
}

// Throws InputError for what does not go together.
void require_one_run(const ExactArguments& arguments, std::size_t runs) {
  if (arguments.table.empty() && runs > 1) {
    throw InputError(fmt::format("experiments: {} values need --table FILE", runs));
  }
  const bool shows = !(arguments.shown.page.empty() && arguments.shown.format.empty());
  if (!arguments.table.empty() &&
      (shows || !(arguments.output.empty() && arguments.options.checkpoint.empty()))) {
    throw InputError("--table takes neither --output, --report, --format nor --checkpoint");
  }
}

// Whether the tree of constrained_exact.hpp is asked for.
bool is_constrained(const ExactArguments& arguments) {
  return arguments.request.read().any() || arguments.top > 1 || !arguments.criterion.name.empty();
}

void require_constrained(const ExactArguments& arguments) {
  if (!arguments.table.empty() || !arguments.options.checkpoint.empty() ||
      arguments.method != "branch_and_bound") {
    throw InputError(
        "constraints, other criteria and --top go with branch_and_bound alone, without --table and "
        "--checkpoint");
  }
}

// What is to be found, from a request and from --experiments.
DesignRequest request_of(const ExactArguments& arguments) {
  DesignRequest request = arguments.request.read();
  if (!arguments.experiments.empty()) {
    const std::vector<std::int64_t> runs = parse_experiments(arguments.experiments);
    require_one_run(arguments, runs.size());
    request.experiments = static_cast<double>(runs.front());
  }
  if (!request.number().has_value() && !request.budget.has_value()) {
    throw InputError("experiments: say how many (--experiments), or what they may cost (--budget)");
  }
  return request;
}

int exact_request(const ExactArguments& arguments, Invocation& invocation) {
  DesignOutput shown(arguments.shown, invocation.arguments);
  arguments.criterion.require_consistent();
  require_constrained(arguments);
  DesignRequest request = request_of(arguments);
  bench::pin_threads(arguments.options.threads, invocation.arguments);
  const ProjectedSet read = [&] {
    const ReadingLimit limit(arguments.options.time_limit, arguments.set.path);
    return read_set(arguments.set,
                    arguments.request.has_prior() ? SingularSum::kAllowed : SingularSum::kRefused);
  }();
  const InformationSet& set = read.set;
  if (!arguments.output.empty()) require_writable(arguments.output);
  shown.read_robot(set);
  DesignConstraints constraints = resolve(request, set);
  const ConstrainedExactOptions options{
      .gap = arguments.options.gap,
      .time_limit = arguments.options.time_limit,
      .seed = arguments.options.seed,
      .threads = arguments.options.threads,
      .criterion = arguments.criterion.read(set).value_or(Criterion()),
      .top = arguments.top};
  catch_interrupts();
  ConstrainedExactSolution solution = [&] {
    ExactLine line{arguments.method};
    return solve_constrained_exact(set, constraints, options, &line);
  }();
  if (interrupted() && solution.status == ExactStatus::kTimeLimit) {
    solution.message = solution.designs.empty() ? "interrupted before there was a design"
                                                : "interrupted; this is the best design so far";
  }
  ConstrainedExactReport report = report_constrained_exact(
      set, options, std::move(solution), std::move(request), std::move(constraints));
  report.share.report.problem_hash = set.content_hash();
  const bool found = !report.solution.designs.empty() && report.share.experiments() > 0.0;
  if (!found && report.solution.message.empty()) {
    report.solution.message = "no experiment fits, and what is known already needs none";
  }
  FilesTogether files;
  if (!arguments.output.empty() && found) write_constrained_exact(arguments.output, set, report);
  if (shown.has_page() && found) {
    shown.write_page(constrained_exact_story(set, report),
                     {{arguments.set.path, "information set"}});
  }
  files.commit();
  if (shown.has_table() && found) {
    shown.print_table(set, design_schedule(set, report.solution.designs.front().counts));
  } else {
    print_answer(read, arguments.json, to_json(report), describe_constrained_exact(set, report));
    if (found && !arguments.json) shown.say_written(arguments.output);
  }
  return report.solution.status == ExactStatus::kOptimal ? kDone : kShort;
}

int exact(ExactArguments& arguments, Invocation& invocation) {
  DesignOutput shown(arguments.shown, invocation.arguments);
  require_design_output(arguments.shown, arguments.json);
  if (is_constrained(arguments)) return exact_request(arguments, invocation);
  if (arguments.experiments.empty()) throw InputError("experiments: say how many (--experiments)");
  const std::vector<std::int64_t> runs = parse_experiments(arguments.experiments);
  require_one_run(arguments, runs.size());
  arguments.options.experiments = runs.front();
  bench::pin_threads(arguments.options.threads, invocation.arguments);
  const bool one_run = arguments.table.empty();  // else the limit is each run's
  const ProjectedSet read = [&] {
    const ReadingLimit limit(one_run ? arguments.options.time_limit : kNoLimit, arguments.set.path);
    return read_set(arguments.set);
  }();
  const InformationSet& set = read.set;
  for (const std::string& file : {arguments.output, arguments.table}) {
    if (!file.empty()) require_writable(file);
  }
  if (!arguments.table.empty()) return table(arguments, set);
  shown.read_robot(set);
  ExactReport report = run(arguments, set);
  report.share.problem_hash = set.content_hash();
  const bool regular = report.solution.status != ExactStatus::kSingular;
  FilesTogether files;
  if (!arguments.output.empty() && regular) write_exact_design(arguments.output, set, report);
  if (shown.has_page() && regular) {
    shown.write_page(exact_story(set, report), {{arguments.set.path, "information set"}});
  }
  files.commit();
  if (shown.has_table() && regular) {
    shown.print_table(set, design_schedule(set, report.solution.design.counts));
  } else {
    print_answer(read, arguments.json, to_json(report),
                 describe_exact(report) + describe_counts(set, report.solution.design));
    if (regular && !arguments.json) shown.say_written(arguments.output);
  }
  return exit_code(report.solution.status);
}

}  // namespace

void add_exact_command(CLI::App& app, Invocation& invocation) {
  auto* command =
      app.add_subcommand("exact", "Whole numbers of experiments, with a proven efficiency");
  auto arguments = std::make_shared<ExactArguments>();
  ExactOptions& options = arguments->options;
  add_set_options(*command, arguments->set);
  command->add_option("-M,--experiments", arguments->experiments,
                      "experiments to run, M; with --table a list as 1:20,25,30");
  add_criterion_options(*command, arguments->criterion);
  add_request_options(*command, arguments->request, ExperimentsOption::kOwn);
  command->add_option("--gap", options.gap, "proven loss of efficiency to stop at")
      ->capture_default_str();
  add_design_output_options(*command, arguments->shown);
  command
      ->add_option("--method", arguments->method,
                   "rounding, efficient_rounding, exchange or branch_and_bound")
      ->capture_default_str();
  command->add_option("--top", arguments->top, "how many of the best designs to list")
      ->capture_default_str();
  command->add_option("--time-limit", options.time_limit, "wall seconds (default: none)");
  add_threads(*command, options.threads);
  command->add_option("--seed", options.seed, "of the exchange's random starts")
      ->capture_default_str();
  command->add_option("--checkpoint", options.checkpoint,
                      "keep the state of branch_and_bound in this file");
  command->add_flag("--resume", options.resume, "go on from the checkpoint");
  command->add_option("-o,--output", arguments->output, "write the design as JSON, with counts");
  command->add_option("--table", arguments->table,
                      "run every method for each M and write a CSV table");
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "Exit code 1: time was up (the bound reached is stated), or no regular design was found.\n"
      "Examples:\n"
      "  graybox exact set.h5 --experiments 20 --criterion E --gap 0.01 --report design.html\n"
      "  graybox exact set.h5 --experiments 1:100 --time-limit 20 --table exact_designs.csv");
  command->callback(
      [arguments, &invocation] { invocation.exit_code = exact(*arguments, invocation); });
}

}  // namespace graybox::cli
