#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bench/pin_threads.hpp"
#include "cli/arguments/design_output_arguments.hpp"
#include "cli/arguments/robot_arguments.hpp"
#include "cli/arguments/set_arguments.hpp"
#include "cli/arguments/stiffness_arguments.hpp"
#include "cli/arguments/threads_argument.hpp"
#include "cli/commands/commands.hpp"
#include "cli/output/console.hpp"
#include "cli/output/design_output.hpp"
#include "cli/output/set_answer.hpp"
#include "cli/process/interrupt.hpp"
#include "diagnosis/design_page/design_stories.hpp"
#include "problems/base/error.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/files_together.hpp"
#include "problems/robot_information/robot_information.hpp"
#include "solvers/report/design_file.hpp"
#include "solvers/report/solve_report.hpp"
#include "solvers/robust/concentration_interior_point.hpp"
#include "solvers/robust/robust_column_generation.hpp"

namespace graybox::cli {
namespace {

using Json = nlohmann::ordered_json;

struct RobustArguments {
  std::vector<std::string> sets;
  double psd_tolerance = kDefaultSemidefiniteTolerance;
  RobotArguments robot;
  StiffnessArguments stiffness;
  std::string objective = "worst_case";
  std::string reference = "optimum";
  std::optional<double> largest_share;
  std::optional<double> of_positions;
  SolveOptions options;
  DesignOutputArguments shown;
  std::string output;
  bool json = false;

  [[nodiscard]] bool limited() const { return largest_share || of_positions; }
};

// The samples' own optima are found this precisely.
constexpr double kReferenceGap = 1e-9;

// ---- the samples --------------------------------------------------------------------------------

struct Samples {
  std::vector<InformationSet> sets;
  std::vector<Eigen::VectorXd> thetas;      // empty where the sets came from files
  std::vector<SemidefiniteChange> changed;  // empty where the sets were made here
  std::string description;
};

ProjectedSet read_sample(const RobustArguments& arguments, const std::string& file) {
  return read_set({.path = file, .variable = {}, .psd_tolerance = arguments.psd_tolerance});
}

Samples read_samples(const RobustArguments& arguments) {
  const std::vector<std::string>& files = arguments.sets;
  Samples samples;
  for (const std::string& file : files) {
    ProjectedSet read = read_sample(arguments, file);
    samples.sets.push_back(std::move(read.set));
    samples.changed.push_back(read.changed);
  }
  samples.description =
      fmt::format("{} information sets, each {}", files.size(), describe(samples.sets.front()));
  return samples;
}

Samples make_samples(const RobustArguments& arguments) {
  const RobotModel robot = load_robot(arguments.robot);
  const PositionTable positions = load_positions(arguments.robot, robot);
  const StiffnessArguments& stiffness = arguments.stiffness;
  Samples samples;
  samples.thetas =
      latin_hypercube_stiffness(stiffness.options, stiffness.samples, robot.parameters.size());
  samples.sets.reserve(stiffness.samples);
  CountProgress progress("information matrices of sample", stiffness.samples);
  for (const Eigen::VectorXd& theta : samples.thetas) {
    samples.sets.push_back(robot_information_set(with_stiffness_factors(robot, theta), positions,
                                                 {.threads = arguments.options.threads})
                               .renamed(fmt::format("sample {}", samples.sets.size())));
    static_cast<void>(progress.update(samples.sets.size()));
  }
  samples.description =
      fmt::format("{}: {} samples of its stiffness within {:g} % (seed {}), each {}", robot.name,
                  stiffness.samples, 100.0 * stiffness.options.uncertainty, stiffness.options.seed,
                  describe(samples.sets.front()));
  return samples;
}

// ---- one design for all samples -----------------------------------------------------------------

// exp(phi_s/d) for the samples' own optima: the D-efficiency under each sample.
std::vector<double> efficiencies(const RobustCertificate& proof, const SampleOptima& optima,
                                 std::size_t dimension) {
  std::vector<double> values;
  for (std::size_t s = 0; s < proof.log_det.size(); ++s) {
    values.push_back(
        std::exp((proof.log_det[s] - optima.log_det[s]) / static_cast<double>(dimension)));
  }
  return values;
}

Json objective_entry(const RobustArguments& arguments, const Samples& samples,
                     const SampleOptima& optima, const RobustCertificate& proof,
                     const std::vector<double>& efficiency) {
  Json list = Json::array();
  for (std::size_t s = 0; s < efficiency.size(); ++s) {
    Json entry{{"name", samples.sets[s].name()}};
    if (!samples.changed.empty()) add_change(samples.changed[s], entry);
    if (!samples.thetas.empty()) {
      entry["theta"] = std::vector<double>(samples.thetas[s].begin(), samples.thetas[s].end());
    }
    entry["log_det"] = proof.log_det[s];
    entry["optimum"] = optima.log_det[s];
    entry["efficiency"] = efficiency[s];
    entry["price"] = proof.prices[s];
    list.push_back(std::move(entry));
  }
  return {{"name", arguments.objective},
          {"reference", arguments.reference},
          {"value", proof.certificate.log_det},
          {"reference_gap", optima.duality_gap},
          {"samples", std::move(list)}};
}

SolveReport report_of(const InformationSet& set, std::string solver, const SolveOptions& options,
                      const Solution& solution, Certificate certificate) {
  SolveReport report;
  report.solver = std::move(solver);
  report.candidates = set.candidate_count();
  report.dimension = set.dimension();
  report.options = options;
  report.status = judge(solution.status, options.duality_gap, certificate);
  report.message = solution.message;
  if (interrupted() && solution.status == SolveStatus::kTimeLimit) {
    report.message = "interrupted; this is the best design so far";
  }
  if (report.message.empty()) report.message = certificate.message;
  report.certificate = std::move(certificate);
  report.counters = solution.counters;
  report.peak_memory_bytes = peak_memory_bytes();
  return report;
}

void write(const std::string& path, const InformationSet& set, const Design& design,
           const SolveReport& report, const Json& objective, const DesignLimits& limits = {}) {
  Json root = design_json(set, design, report, limits);
  root["objective"] = objective;
  write_text_file(path, root.dump(1) + "\n");
}

std::string describe_work(const SolveReport& report) {
  return fmt::format(
      "  work          {} iterations, {:.1f} passes, {:.3g} s; peak memory {:.0f} MB\n",
      report.counters.iterations, report.counters.passes, report.counters.seconds,
      static_cast<double>(report.peak_memory_bytes) / 1e6);
}

std::string describe_status(const SolveReport& report) {
  const std::string message = report.message.empty() ? "" : " (" + report.message + ")";
  return fmt::format("{}: {}{}\n", report.solver, status_word(report.status), message);
}

std::string describe_gap(const SolveReport& report) {
  const Certificate& certificate = report.certificate;
  return fmt::format("  duality gap   {:.3e}  (asked {:.3g}; rounding at most {:.1e})\n",
                     certificate.duality_gap, report.options.duality_gap,
                     certificate.rounding_bound);
}

void print_robust(const RobustArguments& arguments, const Samples& samples,
                  const SolveReport& report, const Design& design, std::vector<double> efficiency) {
  const Certificate& certificate = report.certificate;
  fmt::print("{}\n", samples.description);
  for (std::size_t s = 0; s < samples.changed.size(); ++s) {
    if (samples.changed[s].candidates == 0) continue;
    fmt::print("{}: {}", samples.sets[s].name(), change_note(samples.changed[s]));
  }
  fmt::print("{}", describe_status(report));
  if (certificate.status == CertificateStatus::kCertified) {
    const bool average = arguments.objective == "average";
    fmt::print("  objective     {} = {:.10g}, at most {:.2e} below the optimum\n",
               average ? "mean log det M" : "smallest log det M less its reference",
               certificate.log_det, certificate.log_det_gap);
    fmt::print("{}", describe_gap(report));
    std::ranges::sort(efficiency);
    double mean = 0.0;
    for (const double value : efficiency) mean += value / static_cast<double>(efficiency.size());
    fmt::print(
        "  D-efficiency  under the samples, each against its own optimum: smallest {:.4f}, median "
        "{:.4f}, mean {:.4f}\n",
        efficiency.front(), efficiency[efficiency.size() / 2], mean);
  }
  fmt::print("{}{}", describe_work(report), describe_support(samples.sets.front(), design));
  if (!arguments.output.empty()) fmt::print("wrote {}\n", arguments.output);
}

std::vector<PageFile> files_of(const RobustArguments& arguments) {
  std::vector<PageFile> files;
  for (const std::string& set : arguments.sets) files.push_back({set, "information set"});
  if (files.empty()) {
    files.push_back(
        {arguments.robot.model.empty() ? default_robot_file().string() : arguments.robot.model,
         "robot"});
  }
  return files;
}

SampleOptima counted_optima(const RobustProblem& problem, const SolveOptions& options) {
  CountProgress progress("optimum of sample", problem.samples.size());
  return sample_optima(problem.samples, options,
                       [&](std::size_t done) { static_cast<void>(progress.update(done)); });
}

int design_for_samples(const RobustArguments& arguments, DesignOutput& shown) {
  if (!(arguments.reference == "optimum" || arguments.reference == "none")) {
    throw InputError(
        fmt::format("unknown reference '{}'; choose optimum or none", arguments.reference));
  }
  RobustProblem problem;
  problem.objective = robust_objective(arguments.objective);
  const Samples samples = [&] {
    const ReadingLimit limit(arguments.options.time_limit, "the samples");
    return arguments.sets.empty() ? make_samples(arguments) : read_samples(arguments);
  }();
  catch_interrupts();
  for (const InformationSet& set : samples.sets) problem.samples.push_back(&set);
  require_shared_candidates(problem);

  SolveOptions reference = arguments.options;
  reference.duality_gap = std::min(kReferenceGap, arguments.options.duality_gap);
  const SampleOptima optima = counted_optima(problem, reference);
  if (problem.objective == RobustObjective::kWorstCase && arguments.reference == "optimum") {
    problem.references = optima.log_det;
  }
  Progress progress("robust_column_generation");
  const RobustSolution answer = solve_robust(problem, arguments.options, &progress);
  const Design& design = answer.solution.design;
  const RobustCertificate proof = certify_robust(problem, design, answer.prices);
  SolveReport report = report_of(problem.first(), "robust_column_generation", arguments.options,
                                 answer.solution, proof.certificate);
  report.problem = samples.description;
  if (report.message.empty()) {
    report.message = interrupted() && optima.status == SolveStatus::kTimeLimit
                         ? "interrupted before the optimum of every sample was found"
                         : optima.message;
  }

  const std::vector<double> efficiency = efficiencies(proof, optima, problem.first().dimension());
  const Json objective = objective_entry(arguments, samples, optima, proof, efficiency);
  FilesTogether files;
  if (!arguments.output.empty()) {
    write(arguments.output, problem.first(), design, report, objective);
  }
  if (shown.has_page()) {
    if (arguments.sets.empty()) shown.set_robot(load_robot(arguments.robot));
    shown.write_page(robust_story(problem.samples, design, report, proof.prices, efficiency,
                                  arguments.objective),
                     files_of(arguments));
  }
  files.commit();
  if (arguments.json) {
    Json line = to_json(report);
    line["objective"] = objective;
    fmt::print("{}\n", line.dump());
  } else {
    print_robust(arguments, samples, report, design, efficiency);
    shown.say_page();
  }
  return report.status == ReportStatus::kSolved ? kDone : kShort;
}

// ---- the concentration limit --------------------------------------------------------------------

ProjectedSet single_set(const RobustArguments& arguments) {
  if (arguments.sets.size() > 1) {
    throw InputError(fmt::format("the concentration limit takes one information set; {} are given",
                                 arguments.sets.size()));
  }
  if (!arguments.sets.empty()) return read_sample(arguments, arguments.sets.front());
  const RobotModel robot = load_robot(arguments.robot);
  return {robot_information_set(robot, load_positions(arguments.robot, robot),
                                {.threads = arguments.options.threads})
              .renamed(robot.name),
          {}};
}

void print_concentrated(const ProjectedSet& read, const SolveReport& report,
                        const ConcentrationLimit& limit, const ConcentrationCertificate& proof) {
  fmt::print("{}{}", set_headline(read), describe_status(report));
  if (proof.certificate.status == CertificateStatus::kCertified) {
    fmt::print(
        "  limit         at most {:g} of the weight on any {} positions; the heaviest hold "
        "{:.9f}\n"
        "  log det M     {:.10g}, at most {:.2e} below the optimum under the limit\n{}"
        "  price         {:.4g}: what log det M gains for each unit of the share\n",
        limit.share, limit.positions, proof.concentration, proof.certificate.log_det,
        proof.certificate.log_det_gap, describe_gap(report), proof.price);
  }
  fmt::print("{}", describe_work(report));
}

int design_under_limit(const RobustArguments& arguments, DesignOutput& shown) {
  if (!arguments.largest_share || !arguments.of_positions) {
    throw InputError(
        "--largest-share and --of-positions go together: at most this share of the experiments in "
        "this fraction of the positions");
  }
  const ProjectedSet read = [&] {
    const ReadingLimit limit(arguments.options.time_limit, "the information set");
    return single_set(arguments);
  }();
  catch_interrupts();
  const InformationSet& set = read.set;
  const ConcentrationLimit limit =
      concentration_limit(*arguments.largest_share, *arguments.of_positions, set.candidate_count());
  Progress progress("concentration_interior_point");
  const Solution solution = solve_concentrated(set, limit, arguments.options, &progress);
  const ConcentrationCertificate proof = certify_concentrated(set, solution.design, limit);
  SolveReport report = report_of(set, "concentration_interior_point", arguments.options, solution,
                                 proof.certificate);
  report.problem = set.name();
  report.problem_hash = set.content_hash();

  const Json objective{{"name", "concentration_limit"},
                       {"largest_share", limit.share},
                       {"positions", limit.positions},
                       {"concentration", proof.concentration},
                       {"price", proof.price}};
  const bool has_design = solution.status != SolveStatus::kUnsupported;
  FilesTogether files;
  if (!arguments.output.empty() && has_design) {
    write(arguments.output, set, solution.design, report, objective, {.concentration = limit});
  }
  if (shown.has_page() && has_design) {
    if (arguments.sets.empty()) shown.set_robot(load_robot(arguments.robot));
    DesignStory story = solve_story(set, solution.design, report);
    story.sensitivity_words =
        "The bound of 1 is that of a design without a limit on its concentration; how far "
        "candidates stand above it is what the limit costs.";
    shown.write_page(std::move(story), files_of(arguments));
  }
  files.commit();
  if (arguments.json) {
    Json line = to_json(report);
    line["objective"] = objective;
    print_line(read, std::move(line));
  } else {
    print_concentrated(read, report, limit, proof);
    if (has_design) fmt::print("{}", describe_support(set, solution.design));
    if (!arguments.output.empty() && has_design) fmt::print("wrote {}\n", arguments.output);
    if (has_design) shown.say_page();
  }
  return report.status == ReportStatus::kSolved ? kDone : kShort;
}

// ---- the command --------------------------------------------------------------------------------

// The options that only one of the three uses make no sense with the others.
void require_consistent(const CLI::App& command, const RobustArguments& arguments) {
  const auto refuse = [&](std::initializer_list<const char*> names, const char* why) {
    for (const char* name : names) {
      if (command.count(name) > 0) throw InputError(fmt::format("{} {}", name, why));
    }
  };
  if (!arguments.sets.empty()) {
    refuse({"--model", "--grid", "--samples", "--uncertainty"},
           "is for samples of a robot; leave it out where information sets are given");
  }
  if (arguments.limited()) {
    refuse({"--objective", "--reference", "--samples", "--uncertainty"},
           "does not go with the concentration limit");
  }
}

}  // namespace

void add_design_robust_command(CLI::App& design, Invocation& invocation) {
  auto* command = design.add_subcommand(
      "robust", "One design for many samples of what is not known, or under a concentration limit");
  auto arguments = std::make_shared<RobustArguments>();
  SolveOptions& options = arguments->options;
  command->add_option("sets", arguments->sets,
                      "information sets over the same candidates (default: samples of a robot)");
  add_psd_tolerance(*command, arguments->psd_tolerance);
  add_robot_options(*command, arguments->robot);
  add_stiffness_options(*command, arguments->stiffness);
  command->add_option("--objective", arguments->objective, "average or worst_case")
      ->capture_default_str();
  command
      ->add_option("--reference", arguments->reference,
                   "of the worst case: optimum (D-efficiency) or none (log det itself)")
      ->capture_default_str();
  command->add_option("--largest-share", arguments->largest_share,
                      "concentration limit: at most this share of the experiments ...");
  command->add_option("--of-positions", arguments->of_positions,
                      "... in any positions that are this fraction of all");
  command->add_option("--gap", options.duality_gap, "duality gap to reach")->capture_default_str();
  command->add_option("--time-limit", options.time_limit, "wall seconds of the solver");
  add_threads(*command, options.threads);
  command->add_option("-o,--output", arguments->output, "write the design as JSON");
  add_report_option(*command, arguments->shown);
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "The checker decides: status solved (exit code 0) means that it proved the gap to be at "
      "most\n"
      "the gap asked, rounding included. Ctrl-C stops the solver and keeps its best design (exit "
      "code 1).\n"
      "Examples:\n"
      "  graybox design robust --samples 50 --uncertainty 0.5 --report page.html\n"
      "  graybox design robust --objective average --samples 50 --seed 3 -o average.json\n"
      "  graybox design robust a.h5 b.h5 c.h5 --objective worst_case --json\n"
      "  graybox design robust set.h5 --largest-share 0.5 --of-positions 0.01 -o spread.json");
  command->callback([command, arguments, &invocation] {
    require_consistent(*command, *arguments);
    bench::pin_threads(arguments->options.threads, invocation.arguments);
    DesignOutput shown(arguments->shown, invocation.arguments);
    require_design_output(arguments->shown, arguments->json);
    invocation.exit_code = arguments->limited() ? design_under_limit(*arguments, shown)
                                                : design_for_samples(*arguments, shown);
  });
}

}  // namespace graybox::cli
