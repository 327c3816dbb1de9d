// `graybox exact`: how often to run each experiment, with proof.
#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "commands.hpp"
#include "console.hpp"
#include "graybox/bench/pin_threads.hpp"
#include "graybox/problems/formats/information_set_file.hpp"
#include "graybox/solvers/exact/exact_design_file.hpp"
#include "graybox/solvers/exact/exact_method.hpp"
#include "interrupt.hpp"

namespace graybox::cli {
namespace {

struct ExactArguments {
  std::string set;
  std::string variable;
  std::string method = "branch_and_bound";
  ExactOptions options;
  std::string output;
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
  require_exact_problem(set, options);
  const Relaxation relaxation =
      solve_relaxation(set, {.seed = options.seed, .threads = options.threads});
  ExactLine line{arguments.method};
  catch_interrupts();
  ExactSolution solution = method.solve(set, relaxation, options, &line);
  if (interrupted() && solution.status == ExactStatus::kTimeLimit) {
    solution.message = "interrupted; this is the best design so far";
  }
  return report_exact(set, relaxation, method.name(), options, std::move(solution));
}

std::string describe_exact(const ExactReport& report) {
  const ExactCertificate& certificate = report.certificate;
  const ExactSolution& solution = report.solution;
  std::string text = fmt::format("{}: {}", report.share.solver, to_string(solution.status));
  if (!solution.message.empty()) text += fmt::format(" ({})", solution.message);
  text += '\n';
  if (certificate.status == CertificateStatus::kCertified) {
    text += fmt::format(
        "  experiments   {} in {} candidates\n"
        "  covariance    {:.10g}; no design of {} experiments is below {:.10g}\n"
        "  D-efficiency  at least {:.8f} of the best exact design\n",
        certificate.experiments, certificate.support_size, certificate.covariance,
        certificate.experiments, certificate.covariance_bound, certificate.proven_efficiency);
  }
  if (solution.survivors > 0) {
    text += fmt::format("  candidates    {} of {} left by screening\n", solution.survivors,
                        report.share.candidates);
  }
  text += fmt::format("  work          {} nodes ({} open), {} iterations, {:.3g} s\n",
                      solution.nodes, solution.open_nodes, solution.iterations, solution.seconds);
  return text;
}

std::string describe_counts(const InformationSet& set, const ExactDesign& design) {
  constexpr std::size_t kShown = 40;
  const CandidateTable& table = set.candidates();
  std::string text = fmt::format("  {:>10} {:>12}", "count", "candidate");
  for (std::size_t k = 0; k < table.names.size(); ++k) {
    const std::string unit = table.units[k].empty() ? "" : " [" + table.units[k] + "]";
    text += fmt::format(" {:>12}", table.names[k] + unit);
  }
  text += '\n';
  std::size_t listed = 0;
  for (std::size_t i = 0; i < design.counts.size(); ++i) {
    if (design.counts[i] == 0 || listed++ >= kShown) continue;
    text += fmt::format("  {:>10} {:>12}", design.counts[i], i);
    for (const double value : set.coordinates(i)) text += fmt::format(" {:>12.6g}", value);
    text += '\n';
  }
  if (listed > kShown) text += fmt::format("  {:>10} and {} more\n", "...", listed - kShown);
  return text;
}

int exit_code(ExactStatus status) {
  return status == ExactStatus::kOptimal || status == ExactStatus::kFeasible ? kDone : kShort;
}

int exact(const ExactArguments& arguments, Invocation& invocation) {
  bench::pin_threads(arguments.options.threads, invocation.arguments);
  const InformationSet set = read_information_set(arguments.set, {.variable = arguments.variable});
  set.validate();
  ExactReport report = run(arguments, set);
  report.share.problem_hash = set.content_hash();
  const bool regular = report.solution.status != ExactStatus::kSingular;
  if (!arguments.output.empty() && regular) write_exact_design(arguments.output, set, report);
  if (arguments.json) {
    fmt::print("{}\n", to_json(report).dump());
  } else {
    fmt::print("{}: {}\n{}{}", set.name(), describe(set), describe_exact(report),
               describe_counts(set, report.solution.design));
    if (!arguments.output.empty() && regular) fmt::print("wrote {}\n", arguments.output);
  }
  return exit_code(report.solution.status);
}

}  // namespace

void add_exact_command(CLI::App& app, Invocation& invocation) {
  auto* command =
      app.add_subcommand("exact", "Whole numbers of experiments, with a proven efficiency");
  auto arguments = std::make_shared<ExactArguments>();
  ExactOptions& options = arguments->options;
  command->add_option("set", arguments->set, "information set: .h5, .npy, .csv or .mat")
      ->required();
  command->add_option("-M,--experiments", options.experiments, "experiments to run, M")->required();
  command
      ->add_option("--method", arguments->method,
                   "rounding, efficient_rounding, exchange or branch_and_bound")
      ->capture_default_str();
  command->add_option("--gap", options.gap, "proven loss of D-efficiency to stop at")
      ->capture_default_str();
  command->add_option("--time-limit", options.time_limit, "wall seconds (default: none)");
  command->add_option("--threads", options.threads, "threads")->capture_default_str();
  command->add_option("--seed", options.seed, "of the exchange's random starts")
      ->capture_default_str();
  command->add_option("--checkpoint", options.checkpoint,
                      "keep the state of branch_and_bound in this file");
  command->add_flag("--resume", options.resume, "go on from the checkpoint");
  command->add_option("--variable", arguments->variable, "variable of a .mat file with several");
  command->add_option("-o,--output", arguments->output, "write the design as JSON, with counts");
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "Covariance is (det sum_i m_i H_i)^(-1/d). The proven efficiency compares with the best "
      "design\n"
      "of M experiments that exists. Exit code 1: time was up first (the bound reached is stated), "
      "or\n"
      "no regular design was found. Ctrl-C stops and keeps the best design.\n"
      "Examples:\n"
      "  graybox exact set.h5 --experiments 20 --time-limit 300 --threads 2 -o design.json\n"
      "  graybox exact set.h5 --experiments 12 --checkpoint tree.cbor --time-limit 60\n"
      "  graybox exact set.h5 --experiments 12 --checkpoint tree.cbor --resume\n"
      "  graybox exact set.h5 --experiments 20 --method rounding --json");
  command->callback(
      [arguments, &invocation] { invocation.exit_code = exact(*arguments, invocation); });
}

}  // namespace graybox::cli
