// `graybox design spectrum`: positions and excitation spectra at once (docs/how_to/spectrum.md).
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "bench/pin_threads.hpp"
#include "cli/arguments/robot_arguments.hpp"
#include "cli/arguments/threads_argument.hpp"
#include "cli/commands/commands.hpp"
#include "cli/output/console.hpp"
#include "cli/output/spectrum_tables.hpp"
#include "cli/process/interrupt.hpp"
#include "problems/base/available_memory.hpp"
#include "problems/base/error.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/files_together.hpp"
#include "problems/robot_information/robot_spectrum_information.hpp"
#include "solvers/blocks/block_limited_certificate.hpp"
#include "solvers/report/design_file.hpp"
#include "solvers/report/solve_report.hpp"

namespace graybox::cli {
namespace {

struct SpectrumArguments {
  RobotArguments robot;
  SolveOptions options;
  std::vector<double> limits;
  bool compare = false;
  std::string comparison;  // files
  std::string spectra;
  std::string robustness;
  std::size_t samples = 100;
  std::string output;
  bool json = false;
};

// The problem with all that belongs to it.
struct SpectrumProblem {
  RobotModel robot;
  PositionTable positions;
  InformationSet set;
  CandidateBlocks blocks;
};

SpectrumProblem make_problem(const SpectrumArguments& arguments) {
  // Weights, sensitivities, labels and the checker's extended weights, of each candidate.
  constexpr std::size_t kWorkBytes = 64;
  RobotModel robot = load_robot(arguments.robot);
  PositionTable positions = load_positions(arguments.robot, robot);
  const std::size_t lines = line_count(robot);
  const CandidateBlocks names{positions.count(), {}};
  for (const double limit : arguments.limits) check_block_limit(names, limit);
  require_memory(
      robot_spectrum_bytes(robot, positions.count()) + positions.count() * lines * kWorkBytes,
      fmt::format("the set of {} positions with {} lines each", positions.count(), lines),
      "choose a smaller --grid");
  InformationSet set = robot_spectrum_set(robot, positions, {.threads = arguments.options.threads});
  CandidateBlocks blocks = equal_blocks(set.candidate_count(), lines);
  return {std::move(robot), std::move(positions), std::move(set), std::move(blocks)};
}

BlockDesign solve(const SpectrumProblem& problem, const SolveOptions& options, double limit) {
  Progress progress(limit < 1.0 ? "block_limited" : "column_generation");
  return joint_design(problem.set, problem.blocks, options, limit, &progress);
}

// The designs to compare, in the order of the tables; the first is the one that is written.
std::vector<ComparedDesign> all_designs(const SpectrumArguments& arguments,
                                        const SpectrumProblem& problem) {
  const SolveOptions& options = arguments.options;
  const InformationSet& set = problem.set;
  const CandidateBlocks& blocks = problem.blocks;
  std::vector<ComparedDesign> rows;
  const auto add = [&](BlockDesign design) {
    if (design.status == SolveStatus::kUnsupported) {
      throw InputError(fmt::format("{}: {}", set.name(), design.message));
    }
    rows.push_back(compared(set, blocks, std::move(design)));
    return !interrupted();
  };
  const std::vector<double> limits =
      arguments.limits.empty() ? std::vector<double>{1.0} : arguments.limits;
  for (const double limit : limits) {
    if (!add(solve(problem, options, limit))) return rows;
  }
  if (!arguments.compare) return rows;
  Progress progress("comparison");
  BlockDesign flat = flat_design(set, blocks, options, &progress);
  if (!add(flat)) return rows;
  if (!add(blocks_first_design(set, blocks, flat, options, &progress))) return rows;
  (void)add(two_step_block_design(set, blocks, options, &progress));
  return rows;
}

SolveReport report_of(const SpectrumArguments& arguments, const SpectrumProblem& problem,
                      const BlockDesign& design) {
  Solution solution;
  solution.design = design.design;
  solution.status = design.status;
  solution.counters = design.counters;
  solution.message = design.message;
  const bool limited = design.limit < 1.0;
  SolveReport report =
      judge(problem.set, limited ? "block_limited_column_generation" : "column_generation",
            arguments.options, solution);
  if (limited) {
    report.certificate =
        certify_block_limited(problem.set, design.design, problem.blocks, design.limit);
    report.status = judge(design.status, arguments.options.duality_gap, report.certificate);
    report.message = fmt::format(
        "{}{}at most {:g} of the weight in a position; the certificate is that of this limit",
        design.message, design.message.empty() ? "" : "; ", design.limit);
  }
  if (interrupted() && design.status == SolveStatus::kTimeLimit) {
    report.message = "interrupted; this is the best design so far";
  }
  return report;
}

void write_files(const SpectrumArguments& arguments, const SpectrumProblem& problem,
                 const std::vector<ComparedDesign>& rows, const SolveReport& report) {
  FilesTogether files;
  if (!arguments.output.empty()) {
    const double limit = rows.front().of.limit;
    DesignLimits limits;
    if (limit < 1.0) limits.block_share = {limit, line_count(problem.robot)};
    write_design(arguments.output, problem.set, rows.front().of.design, report, limits);
  }
  if (!arguments.spectra.empty()) {
    write_text_file(arguments.spectra,
                    spectra_csv(problem.robot, problem.set, problem.blocks, rows));
  }
  if (!arguments.comparison.empty()) write_text_file(arguments.comparison, comparison_csv(rows));
  if (!arguments.robustness.empty()) {
    write_text_file(arguments.robustness,
                    robustness_csv(problem.robot, problem.positions, problem.blocks, rows,
                                   arguments.samples, arguments.options.threads));
  }
  files.commit();
}

void print(const SpectrumArguments& arguments, const SpectrumProblem& problem,
           const std::vector<ComparedDesign>& rows, const SolveReport& report) {
  const ComparedDesign& main = rows.front();
  if (arguments.json) {
    nlohmann::ordered_json json = to_json(report);
    json["position_limit"] = main.of.limit;
    json["covariance"] = main.covariance;
    json["positions"] = main.positions;
    json["set_bytes"] = problem.set.bytes();
    if (rows.size() > 1) json["comparison"] = comparison_json(rows);
    fmt::print("{}\n", json.dump());
    return;
  }
  fmt::print("{}: {} positions, {} lines each: {}\n{}{}  covariance    {:.6g} in {} positions\n",
             problem.set.name(), problem.positions.count(), line_count(problem.robot),
             describe(problem.set), describe(report), describe_support(problem.set, main.of.design),
             main.covariance, main.positions);
  if (rows.size() > 1) fmt::print("{}", comparison_text(rows));
  for (const std::string* file :
       {&arguments.output, &arguments.spectra, &arguments.comparison, &arguments.robustness}) {
    if (!file->empty()) fmt::print("wrote {}\n", *file);
  }
}

// Folders that are missing are found before the work, not after it.
void check_outputs(const SpectrumArguments& arguments) {
  for (const std::string* file :
       {&arguments.output, &arguments.spectra, &arguments.comparison, &arguments.robustness}) {
    if (!file->empty()) const AtomicFile writable(*file);
  }
}

int design_spectrum(SpectrumArguments arguments, Invocation& invocation) {
  arguments.compare = arguments.compare || !arguments.comparison.empty();
  check_outputs(arguments);
  bench::pin_threads(arguments.options.threads, invocation.arguments);
  catch_interrupts();
  const SpectrumProblem problem = make_problem(arguments);
  const std::vector<ComparedDesign> rows = all_designs(arguments, problem);
  SolveReport report = report_of(arguments, problem, rows.front().of);
  report.problem_hash = problem.set.content_hash();
  write_files(arguments, problem, rows, report);
  print(arguments, problem, rows, report);
  const bool all_solved = std::ranges::all_of(
      rows, [](const ComparedDesign& row) { return row.of.status == SolveStatus::kSolved; });
  return report.status == ReportStatus::kSolved && all_solved && !interrupted() ? kDone : kShort;
}

}  // namespace

void add_design_spectrum_command(CLI::App& design, Invocation& invocation) {
  auto* command = design.add_subcommand(
      "spectrum", "Positions and excitation spectra of a robot at once, under limits on power");
  auto arguments = std::make_shared<SpectrumArguments>();
  SolveOptions& options = arguments->options;
  add_robot_options(*command, arguments->robot);
  command->add_option("--gap", options.duality_gap, "duality gap to reach")->capture_default_str();
  command->add_option("--time-limit", options.time_limit, "wall seconds a design (default: none)");
  command->add_option("--seed", options.seed, "of the samples the method draws")
      ->capture_default_str();
  add_threads(*command, options.threads);
  command
      ->add_option("--position-limit", arguments->limits,
                   "largest share of the time in any position, as in 0.1; several, separated by "
                   "commas, for a comparison, the first is written (default: no limit)")
      ->delimiter(',');
  command->add_flag("--compare", arguments->compare,
                    "also the flat spectrum, and positions and spectra one after the other");
  command->add_option("--comparison", arguments->comparison,
                      "write the comparison as CSV (implies --compare)");
  command->add_option("--spectra", arguments->spectra,
                      "write the spectra as CSV: position, frequency, axis, power, share of time");
  command->add_option("--robustness", arguments->robustness,
                      "write as CSV what the designs are worth where the stiffness is another");
  command->add_option("--samples", arguments->samples, "draws of the stiffness for --robustness")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("-o,--output", arguments->output, "write the design as JSON");
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "Power: in each position at most that of the flat spectrum, over all frequencies and axes.\n"
      "Memory: 0.2 MB a position of the robot of graybox, 1.7 GB for the paper's 7920.\n"
      "Exit code 0 if every design reached the gap; Ctrl-C keeps what there is (exit code 1).\n"
      "Examples:\n"
      "  graybox design spectrum -o design.json --spectra spectra.csv\n"
      "  graybox design spectrum --grid 500 --compare --json\n"
      "  graybox design spectrum --position-limit 0.1 -o design.json\n"
      "  graybox design spectrum --position-limit 1,0.1,0.05,0.02 --comparison comparison.csv");
  command->callback(
      [arguments, &invocation] { invocation.exit_code = design_spectrum(*arguments, invocation); });
}

}  // namespace graybox::cli
