// `graybox design discriminate`: experiments that tell rival models apart
// (discrimination_problem.hpp).
#include "cli/design/design_discriminate_command.hpp"

#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "cli/arguments/threads_argument.hpp"
#include "cli/output/console.hpp"
#include "cli/problem/jacobian_file.hpp"
#include "cli/process/interrupt.hpp"
#include "problems/base/error.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/files_together.hpp"
#include "problems/formats/information_set_file.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/discrimination/discrimination_problem.hpp"
#include "solvers/report/design_file.hpp"
#include "solvers/report/solve_report.hpp"

namespace graybox::cli {
namespace {

struct DiscriminateArguments {
  std::string truth;
  std::vector<std::string> rivals;
  std::size_t outputs = 0;
  std::string noise = "1";
  std::string coordinates;
  bool relative = false;
  SolveOptions options;
  std::string set;
  std::string output;
  bool json = false;
};

DiscriminationProblem read_problem(const DiscriminateArguments& arguments) {
  const Jacobians truth = read_jacobians(arguments.truth, arguments.outputs);
  std::vector<Jacobians> rivals;
  for (const std::string& path : arguments.rivals) {
    rivals.push_back(read_jacobians(path, arguments.outputs));
  }
  CandidateTable table;
  if (!arguments.coordinates.empty()) {
    table = read_coordinates(arguments.coordinates, truth.candidates);
  }
  return discrimination_problem(truth, rivals, read_noise(arguments.noise, truth.outputs),
                                std::move(table));
}

Solution run(const InformationSet& set, const SolveOptions& options) {
  Progress progress{std::string(ColumnGeneration().name())};
  Solution solution = ColumnGeneration().solve(set, options, &progress);
  if (interrupted() && solution.status == SolveStatus::kTimeLimit) {
    solution.message = "interrupted; this is the best design so far";
  }
  return solution;
}

// The largest T_k of each rival alone; fewer where a run was stopped or failed.
std::vector<double> best_misfits(const DiscriminationProblem& problem, SolveOptions options) {
  std::vector<double> best;
  for (std::size_t k = 0; k < problem.rivals.size(); ++k) {
    options.criterion = problem.criterion_of(k);
    const Solution solution = run(problem.set, options);
    if (solution.status != SolveStatus::kSolved) break;
    best.push_back(misfits(problem, solution.design)[k]);
  }
  return best;
}

nlohmann::ordered_json rivals_json(const DiscriminationProblem& problem,
                                   const std::vector<double>& reached,
                                   const std::vector<double>& best) {
  nlohmann::ordered_json all = nlohmann::ordered_json::array();
  for (std::size_t k = 0; k < reached.size(); ++k) {
    nlohmann::ordered_json each{{"name", problem.rivals[k]}, {"misfit", reached[k]}};
    if (!best.empty()) each["efficiency"] = reached[k] / best[k];
    all.push_back(std::move(each));
  }
  return all;
}

int discriminate(const DiscriminateArguments& arguments) {
  for (const std::string& file : {arguments.output, arguments.set}) {
    if (!file.empty()) require_writable(file);
  }
  const DiscriminationProblem problem = read_problem(arguments);
  SolveOptions options = arguments.options;
  catch_interrupts();
  std::vector<double> best;
  if (arguments.relative) {
    best = best_misfits(problem, options);
    if (best.size() < problem.rivals.size()) {
      throw InputError(fmt::format("{}: its own best design was not found within the limits",
                                   problem.rivals[best.size()]));
    }
  }
  options.criterion = problem.criterion(best);
  const Solution solution = run(problem.set, options);
  SolveReport report = judge(problem.set, ColumnGeneration().name(), options, solution);
  report.problem_hash = problem.set.content_hash();
  const std::vector<double> reached = misfits(problem, solution.design);
  FilesTogether files;
  if (!arguments.set.empty()) write_information_set(arguments.set, problem.set);
  if (!arguments.output.empty()) {
    write_design(arguments.output, problem.set, solution.design, report);
  }
  files.commit();
  if (arguments.json) {
    nlohmann::ordered_json line = to_json(report);
    line["rivals"] = rivals_json(problem, reached, best);
    fmt::print("{}\n", line.dump());
  } else {
    fmt::print("{}", describe(report));
    for (std::size_t k = 0; k < reached.size(); ++k) {
      fmt::print("  rival {}: misfit {:.8g} for one experiment's worth", problem.rivals[k],
                 reached[k]);
      if (!best.empty()) fmt::print(", {:.6f} of the most", reached[k] / best[k]);
      fmt::print("\n");
    }
    fmt::print("{}", describe_support(problem.set, solution.design));
    for (const std::string& file : {arguments.output, arguments.set}) {
      if (!file.empty()) fmt::print("wrote {}\n", file);
    }
  }
  return report.status == ReportStatus::kSolved ? kDone : kShort;
}

}  // namespace

void add_design_discriminate_command(CLI::App& design, Invocation& invocation) {
  auto* command = design.add_subcommand("discriminate", "Experiments that tell rival models apart");
  auto arguments = std::make_shared<DiscriminateArguments>();
  SolveOptions& options = arguments->options;
  command
      ->add_option("truth", arguments->truth,
                   "what the model taken for true predicts: CSV with one column, a row a "
                   "candidate and output")
      ->required();
  command
      ->add_option("rivals", arguments->rivals,
                   "Jacobians of each rival, as of 'graybox problem from-jacobians'; a column "
                   "'prediction' is what it predicts where its parameters are zero")
      ->required();
  command->add_option("--outputs", arguments->outputs, "rows of a candidate (default: 1)");
  command
      ->add_option("--noise", arguments->noise,
                   "standard deviation of an output, one for each, or a covariance matrix file")
      ->capture_default_str();
  command->add_option("--candidates", arguments->coordinates,
                      "CSV with the coordinates of the candidates");
  command->add_flag("--relative", arguments->relative,
                    "compare each rival's misfit with the most that a design reaches for it alone");
  command->add_option("--gap", options.duality_gap, "duality gap to reach")->capture_default_str();
  command->add_option("--time-limit", options.time_limit, "wall seconds of each solve");
  add_threads(*command, options.threads);
  command->add_option("--set", arguments->set,
                      "write the information set on which 'graybox check' proves the design");
  command->add_option("-o,--output", arguments->output, "write the design as JSON");
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "T-optimality: the design leaves the best fit of a rival as large a misfit (sum of squares\n"
      "over the noise's variance) as possible; with several rivals, the one that fits best.\n"
      "See docs/how_to/discriminate.md.\n"
      "Example:\n"
      "  graybox design discriminate truth.csv constant.csv line.csv -o design.json");
  command->callback([arguments, &invocation] { invocation.exit_code = discriminate(*arguments); });
}

}  // namespace graybox::cli
