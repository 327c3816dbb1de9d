#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "bench/study/environment.hpp"
#include "bench/study/own_sets.hpp"
#include "bench/study/progress.hpp"
#include "bench/study/row_file.hpp"
#include "bench/study/study.hpp"
#include "bench/study/study_sets.hpp"
#include "bench/study/summary.hpp"
#include "bench/study/tables.hpp"
#include "bench/study/verify.hpp"
#include "bench/study/worker.hpp"
#include "bench/study_page/study_page.hpp"
#include "cli/commands/commands.hpp"
#include "cli/output/command_line.hpp"
#include "cli/process/interrupt.hpp"
#include "problems/base/error.hpp"
#include "problems/base/shortened.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/input_guard.hpp"
#include "solvers/external/external_solver.hpp"

namespace graybox::cli {
namespace {

constexpr const char* kWorkerCommand = "study-run";

struct StudyArguments {
  bench::StudyOptions options;
  std::string output = "results/latest";
  std::string instances;            // a folder of sets
  std::vector<std::string> named;   // LABEL=external:CMD
  std::vector<std::string> absent;  // LABEL=what it needs
  double time_limit = 0.0;
  std::size_t memory_limit = 0;
  bool quick = false;
  bool full = false;
  bool json = false;
};

constexpr std::string_view kLabelCharacters =
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-.+";

// "mine=external:./solve {npy}"
bench::NamedProgram named_program(const std::string& text) {
  const std::size_t end = text.find('=');
  const std::string name = text.substr(0, end);
  const bool is_label =
      !name.empty() && name.find_first_not_of(kLabelCharacters) == std::string::npos;
  const std::string solver = end == std::string::npos ? std::string() : text.substr(end + 1);
  if (!is_label || !solver.starts_with(ExternalSolver::kPrefix)) {
    throw InputError(
        fmt::format("--solver-name '{}': expected LABEL=external:CMD, the label of letters, digits "
                    "and _ - . +",
                    shortened(text)));
  }
  return {name, solver.substr(ExternalSolver::kPrefix.size())};
}

void add_programs(const std::vector<bench::NamedProgram>& programs, SolverRegistry& registry) {
  for (const bench::NamedProgram& program : programs) {
    if (std::ranges::find(registry.entries(), program.name, &SolverRegistry::Entry::name) !=
        registry.entries().end()) {
      throw InputError(
          fmt::format("--solver-name {}: is taken; choose another label", program.name));
    }
    registry.add(std::make_unique<ExternalSolver>(program.name, program.command));
  }
}

// "mosek=CVXPY with MOSEK and its licence"
bench::AbsentSolver absent_solver(const std::string& text) {
  const std::size_t end = text.find('=');
  if (end == 0 || end == std::string::npos || end + 1 == text.size()) {
    throw InputError(fmt::format("--absent '{}': expected LABEL=WHAT IT NEEDS", shortened(text)));
  }
  return {text.substr(0, end), text.substr(end + 1)};
}

bench::StudyOptions options_of(const StudyArguments& arguments) {
  bench::StudyOptions options = arguments.options;
  for (const std::string& text : arguments.named) options.programs.push_back(named_program(text));
  for (const std::string& text : arguments.absent) options.absent.push_back(absent_solver(text));
  if (!arguments.instances.empty()) {
    for (std::string& file : bench::instances_in(arguments.instances)) {
      options.sets.push_back(std::move(file));
    }
  }
  options.output = arguments.output;
  if (arguments.quick) options.mode = bench::StudyMode::kQuick;
  if (arguments.full) options.mode = bench::StudyMode::kFull;
  if (arguments.time_limit > 0.0) options.time_limit = arguments.time_limit;
  if (arguments.memory_limit > 0) options.memory_limit = arguments.memory_limit;
  return options;
}

bench::StudySetup setup() {
  return {.make_set = bench::make_study_set,
          .families = bench::study_families(),
          .worker = {std::filesystem::read_symlink("/proc/self/exe").string(), kWorkerCommand},
          .binary = bench::program_hash(),
          .interrupted = interrupted};
}

bool agree(const bench::StudyRows& rows) {
  return std::ranges::all_of(bench::check_agreement(rows.runs),
                             [](const bench::Agreement& each) { return each.agrees(); });
}

void print_json(const StudyArguments& arguments, const bench::StudyOutcome& outcome,
                const bench::StudyRows& rows) {
  const auto solved = std::ranges::count_if(
      rows.runs, [](const bench::RunRow& run) { return run.status == ReportStatus::kSolved; });
  nlohmann::ordered_json headlines = nlohmann::ordered_json::object();
  for (const bench::Headline& line : bench::headlines(bench::summarise_points(rows.runs))) {
    headlines[line.name] = line.value;
  }
  const nlohmann::ordered_json out{{"output", arguments.output},
                                   {"runs", rows.runs.size()},
                                   {"runs_made", outcome.runs_made},
                                   {"runs_found", outcome.runs_found},
                                   {"solved", solved},
                                   {"skipped", rows.skips.size()},
                                   {"interrupted", outcome.interrupted},
                                   {"agree", agree(rows)},
                                   {"headlines", headlines}};
  fmt::print("{}\n", out.dump());
}

// index.html of a study's rows.
void write_page(const bench::StudyRows& rows, const std::filesystem::path& folder,
                const std::filesystem::path& file, double seconds, const Invocation& invocation) {
  const PageFile source{.name = (folder / "rows.jsonl").string(), .role = "rows"};
  write_text_file(file.string(),
                  bench::study_page(rows, {.command = command_line(invocation.arguments),
                                           .files = {source},
                                           .seconds = seconds}));
}

int study(const StudyArguments& arguments, const Invocation& invocation) {
  const bench::StudyOptions options = options_of(arguments);
  SolverRegistry registry = make_registry();
  add_programs(options.programs, registry);
  bench::Progress progress;
  catch_interrupts();
  const bench::StudyOutcome outcome = run_study(options, registry, setup(), progress);
  const bench::StudyRows rows = bench::read_rows(options.output / "rows.jsonl");
  const std::string summary = bench::write_tables(rows, options.output);
  write_page(rows, options.output, options.output / "index.html", progress.seconds(), invocation);
  if (arguments.json) {
    print_json(arguments, outcome, rows);
  } else {
    fmt::print("{}\n", summary);
  }
  if (outcome.interrupted) {
    progress.say(
        fmt::format("interrupted after {} runs; the same command with --resume goes on "
                    "from here",
                    outcome.runs_made));
    return kShort;
  }
  progress.say(
      fmt::format("{} runs made, {} found done, {}; rows, tables, summary.md and index.html in {}",
                  outcome.runs_made, outcome.runs_found,
                  bench::readable_duration(progress.seconds()), arguments.output));
  return agree(rows) ? kDone : kShort;
}

void add_worker_command(CLI::App& app, Invocation& invocation) {
  auto* command = app.add_subcommand(kWorkerCommand, "One run of the study");
  command->group("");  // not listed: the study starts it
  auto arguments = std::make_shared<std::vector<std::string>>();
  command->add_option("arguments", *arguments, "SET SOLVER GAP SECONDS SEED THREADS")->required();
  command->callback([arguments, &invocation] {
    invocation.exit_code =
        bench::run_worker(bench::parse_worker_arguments(*arguments), make_registry());
  });
}

struct VerifyArguments {
  std::string rows;
  bool json = false;
};

int verify(const VerifyArguments& arguments) {
  std::filesystem::path file = arguments.rows;
  if (std::filesystem::is_directory(file)) file /= "rows.jsonl";
  catch_interrupts();
  const bench::RowVerification found = bench::verify_rows(file, bench::make_study_set, interrupted);
  if (arguments.json) {
    const nlohmann::ordered_json out{{"verified", found.verified},
                                     {"false", found.false_rows},
                                     {"without_set", found.without_set},
                                     {"without_design", found.without_design},
                                     {"without_answer", found.without_answer},
                                     {"unreadable", found.unreadable},
                                     {"interrupted", interrupted()},
                                     {"lines", found.lines}};
    fmt::print("{}\n", out.dump());
  } else {
    for (const std::string& line : found.lines) fmt::print("{}\n", line);
    fmt::print("{}{}\n", interrupted() ? "interrupted; so far " : "", describe(found));
  }
  return found.holds() && !interrupted() ? kDone : kShort;
}

void add_verify_command(CLI::App& study, Invocation& invocation) {
  auto* command =
      study.add_subcommand("verify", "Make the sets of a study again and certify its designs");
  auto arguments = std::make_shared<VerifyArguments>();
  command->add_option("rows", arguments->rows, "rows.jsonl, or the folder with it")->required();
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "No solver runs. Prints a line for each false row and for each set that can't be made "
      "again,\n"
      "and a total. Exit code 0 only if every row that holds a design is true.\n"
      "Example:\n"
      "  graybox study verify results/quick/rows.jsonl");
  command->callback([arguments, &invocation] { invocation.exit_code = verify(*arguments); });
}

struct PageArguments {
  std::string rows, output;
};

// The rows of a study, of whatever build: a page takes no part in the comparison.
int make_page(const PageArguments& arguments, const Invocation& invocation) {
  const auto start = std::chrono::steady_clock::now();
  std::filesystem::path file = arguments.rows;
  if (std::filesystem::is_directory(file)) file /= "rows.jsonl";
  if (!std::filesystem::exists(file)) {
    throw InputError(fmt::format("{}: there is no such file; give a study's folder, or rows.jsonl",
                                 file.string()));
  }
  note_input(file.string());
  const bench::StudyRows rows = bench::read_rows(file);
  if (rows.runs.empty()) {
    throw InputError(rows.unreadable == 0
                         ? fmt::format("{}: holds no run of a study", file.string())
                         : fmt::format("{}: holds no run of a study; {} of its lines are no rows "
                                       "(the first: line {})",
                                       file.string(), rows.unreadable, rows.first_unreadable));
  }
  const std::filesystem::path folder = file.parent_path();
  const std::string output =
      arguments.output.empty() ? (folder / "index.html").string() : arguments.output;
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  write_page(rows, folder, output, seconds.count(), invocation);
  fmt::print("wrote {}\n", output);
  if (const std::string note = unreadable_note(rows, file.string()); !note.empty()) {
    fmt::print("note: {}\n", note);
  }
  return kDone;
}

void add_page_command(CLI::App& study, Invocation& invocation) {
  auto* command = study.add_subcommand("page", "Write the page of a study from its rows");
  auto arguments = std::make_shared<PageArguments>();
  command->add_option("rows", arguments->rows, "rows.jsonl, or the folder with it")->required();
  command->add_option("-o,--output", arguments->output,
                      "file to write (default: index.html beside the rows)");
  command->footer(
      "Nothing runs. The page shows time against Q, profiles, all points, and each solver's worst\n"
      "instance. It is one file and loads nothing.\n"
      "Example:\n"
      "  graybox study page results/quick");
  command->callback(
      [arguments, &invocation] { invocation.exit_code = make_page(*arguments, invocation); });
}

constexpr const char* kStudyFooter =
    "Every run is a process of its own with hard limits; the checker's gap decides what counts\n"
    "as solved. Exit code 1 if certified answers disagree, or after Ctrl-C.\n"
    "Examples:\n"
    "  graybox study --quick -o results/quick\n"
    "  graybox study --solvers column_generation,dual_interior_point --max-candidates 2000\n"
    "  graybox study --full --resume -o results/reference\n"
    "  graybox study --sets a.npy b.h5 --solver-name 'mine=external:./solve {npy}' -o "
    "results/own\n"
    "Figures: scripts/figures results/quick";

void add_solver_labels(CLI::App& command, StudyArguments& arguments) {
  command
      .add_option("--solver-name", arguments.named,
                  "LABEL=external:CMD: a program of your own beside the back-ends; may be repeated")
      ->expected(1)
      ->take_all();
  command
      .add_option("--absent", arguments.absent,
                  "LABEL=WHAT IT NEEDS: a solver that is not here, said beside the results; may be "
                  "repeated")
      ->expected(1)
      ->take_all();
}

}  // namespace

void add_study_command(CLI::App& app, Invocation& invocation) {
  add_worker_command(app, invocation);
  auto* command =
      app.add_subcommand("study", "Run every back-end against Q and on every family, fairly");
  auto arguments = std::make_shared<StudyArguments>();
  bench::StudyOptions& options = arguments->options;
  command->add_option("-o,--output", arguments->output, "folder of the results")
      ->capture_default_str();
  auto* quick = command->add_flag("--quick", arguments->quick, "about 2 minutes: low limits");
  command->add_flag("--full", arguments->full, "to the end: 15 minutes to hours")->excludes(quick);
  auto* resume = command->add_flag("--resume", options.resume, "go on with what is there");
  command->add_flag("--fresh", options.fresh, "delete the rows that are there")->excludes(resume);
  command->add_option("--solvers", options.solvers, "back-ends, separated by commas (default: all)")
      ->delimiter(',');
  add_solver_labels(*command, *arguments);
  auto* sets = command->add_option("--sets", options.sets,
                                   "sets of your own (.h5, .npy, .csv, .mat), and nothing else");
  auto* instances = command->add_option("--instances", arguments->instances,
                                        "the same with all sets of a folder");
  command
      ->add_option("--max-candidates", options.max_candidates,
                   "largest set: of 50, 100, 200, 500, 1000, 2000, 4000, 7920 those below")
      ->capture_default_str()
      ->excludes(sets)
      ->excludes(instances);
  command
      ->add_option("--gap", options.duality_gap,
                   "duality gap of the runs against Q, or on own sets")
      ->capture_default_str();
  command->add_option("--time-limit", arguments->time_limit,
                      "seconds a run (default: 10, quick 2, full 1800)");
  command
      ->add_option("--memory-limit", arguments->memory_limit,
                   "resident memory a run (default: 4GB, full 8GB)")
      ->transform(CLI::AsSizeValue(true));
  command->add_option("--threads", options.threads, "threads a run")->capture_default_str();
  command->add_option("--seed", options.seed, "of randomised solvers")->capture_default_str();
  command->add_flag("!--no-families", options.families, "the robot's subsets alone")
      ->excludes(sets)
      ->excludes(instances);
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(kStudyFooter);
  add_verify_command(*command, invocation);
  add_page_command(*command, invocation);
  command->callback([command, arguments, &invocation] {
    if (command->get_subcommands().empty()) invocation.exit_code = study(*arguments, invocation);
  });
}

}  // namespace graybox::cli
