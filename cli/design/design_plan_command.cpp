// `graybox design plan`: how many experiments reach stated standard errors, and which.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "bench/pin_threads.hpp"
#include "cli/arguments/request_arguments.hpp"
#include "cli/arguments/set_arguments.hpp"
#include "cli/arguments/threads_argument.hpp"
#include "cli/commands/commands.hpp"
#include "cli/output/console.hpp"
#include "cli/output/exact_report_text.hpp"
#include "cli/output/exact_table.hpp"
#include "cli/output/set_answer.hpp"
#include "cli/process/interrupt.hpp"
#include "problems/base/error.hpp"
#include "problems/files/atomic_file.hpp"
#include "solvers/exact/exact_design_file.hpp"
#include "solvers/planning/cost_plan.hpp"
#include "solvers/planning/experiment_plan.hpp"
#include "solvers/planning/plan_request.hpp"

namespace graybox::cli {
namespace {

using Json = nlohmann::ordered_json;

struct PlanArguments {
  SetArguments set;
  std::vector<std::string> targets, detections;
  double power = 0.9, level = 0.05;
  double noise = 1.0;
  double gap = 1e-3;
  PlanOptions options{.at_most = 1000, .time_limit = 60.0, .seed = 1, .threads = 1};
  RequestArguments request;
  std::string experiments, table, output;
  bool json = false;
};

void require_consistent(const PlanArguments& arguments, const DesignRequest& request) {
  require_plannable(request, arguments.noise);
  if (arguments.experiments.empty() != arguments.table.empty()) {
    throw InputError("--table FILE and --experiments LIST (as 10:40) go together");
  }
  if (has_costs(request) && !arguments.table.empty()) {
    throw InputError(
        "--table counts experiments, without costs; plan once for each target instead");
  }
}

// Standard errors are asked for in the noise that will be there; the set's is 1.
std::vector<PrecisionTarget> read_targets(const PlanArguments& arguments,
                                          const InformationSet& set) {
  std::vector<PrecisionTarget> all;
  const auto add = [&](std::vector<PrecisionTarget> more) {
    std::ranges::move(more, std::back_inserter(all));
  };
  for (const std::string& text : arguments.targets) add(parse_precision_targets(set, text));
  for (const std::string& text : arguments.detections) {
    add(parse_detections(set, text, arguments.power, arguments.level));
  }
  if (all.empty()) throw InputError("target: say what is to be reached, as 'sd(k1) <= 0.02'");
  for (PrecisionTarget& target : all) target.standard_error /= arguments.noise;
  return all;
}

std::string asked(const PlanArguments& arguments, const PrecisionTarget& target) {
  if (target.effect == 0.0) return fmt::format("sd({})", target.text);
  return fmt::format("{} by {:.4g} seen with power {:.4g}", target.text, target.effect,
                     arguments.power);
}

double power_of(const PlanArguments& arguments, const PrecisionTarget& target, double error) {
  return detection_power(target.effect / error, arguments.level);
}

std::string describe_number(const PlanArguments& arguments, const ExperimentPlan& plan) {
  switch (plan.status) {
    case PlanStatus::kProven:
      return fmt::format("{} experiments reach every target; no smaller number does: proven\n",
                         plan.experiments);
    case PlanStatus::kReached:
      return fmt::format(
          "{} experiments reach every target; at least {} are needed, what lies between is open\n",
          plan.experiments, plan.least);
    case PlanStatus::kOutOfReach:
      return fmt::format("no design of {} experiments or fewer reaches every target: proven\n",
                         arguments.options.at_most);
    case PlanStatus::kNotFound:
      break;
  }
  return fmt::format("no design was found; at least {} experiments are needed\n", plan.least);
}

std::string describe_cost(const PlanArguments& arguments, const BudgetProblem& problem,
                          const CheapestPlan& plan) {
  switch (plan.status) {
    case PlanStatus::kProven:
      return fmt::format(
          "{} experiments for {:.8g} reach every target; none do for less than {:.8g}: proven\n",
          plan.experiments(), plan.cost, plan.least_cost);
    case PlanStatus::kReached:
      return fmt::format(
          "{} experiments for {:.8g} reach every target; at least {:.8g} is needed, what lies "
          "between is open\n",
          plan.experiments(), plan.cost, plan.least_cost);
    case PlanStatus::kOutOfReach:
      return fmt::format(
          "no design of {} experiments or fewer for {:g} reaches every target: proven\n",
          arguments.options.at_most, problem.budget);
    case PlanStatus::kNotFound:
      break;
  }
  return fmt::format("no design was found; at least {:.8g} is needed\n", plan.least_cost);
}

// What stands below the first line, of a plan of either kind.
template <class Plan>
std::string describe_rest(const PlanArguments& arguments,
                          const std::vector<PrecisionTarget>& targets, const Plan& plan) {
  std::string text;
  if (plan.status == PlanStatus::kOutOfReach && std::isfinite(plan.worst_ratio)) {
    text = fmt::format("the worst error stays above {:.4g} times its limit\n", plan.worst_ratio);
  }
  if (!plan.message.empty()) text += fmt::format("{}\n", plan.message);
  if (plan.counts.empty()) return text;
  text += fmt::format("\n  {:<44} {:>12} {:>12}\n", "target", "asked", "reached");
  for (std::size_t j = 0; j < targets.size(); ++j) {
    const double error = plan.standard_errors[j] * arguments.noise;
    text += fmt::format("  {:<44} {:>12.4g} {:>12.4g}", asked(arguments, targets[j]),
                        targets[j].standard_error * arguments.noise, error);
    if (targets[j].effect != 0.0) {
      text += fmt::format("   power {:.4g}", power_of(arguments, targets[j], error));
    }
    text += '\n';
  }
  return text + '\n';
}

Json targets_json(const PlanArguments& arguments, const std::vector<PrecisionTarget>& targets,
                  std::span<const double> errors) {
  Json list = Json::array();
  for (std::size_t j = 0; j < targets.size(); ++j) {
    Json entry{{"target", targets[j].text},
               {"standard_error_asked", targets[j].standard_error * arguments.noise}};
    if (targets[j].effect != 0.0) entry["effect"] = targets[j].effect;
    if (!errors.empty()) {
      const double error = errors[j] * arguments.noise;
      entry["standard_error"] = error;
      if (targets[j].effect != 0.0) entry["power"] = power_of(arguments, targets[j], error);
    }
    list.push_back(std::move(entry));
  }
  return list;
}

// What both kinds of plan write, without counts.
template <class Plan>
Json json_of(const PlanArguments& arguments, const InformationSet& set,
             const std::vector<PrecisionTarget>& targets, const Plan& plan) {
  return {{"format", "graybox-design/1"},
          {"solver", "plan"},
          {"problem_hash", set.content_hash()},
          {"candidates", set.candidate_count()},
          {"dimension", set.dimension()},
          {"status", to_string(plan.status)},
          {"message", plan.message},
          {"at_most", arguments.options.at_most},
          {"power", arguments.power},
          {"level", arguments.level},
          {"noise", arguments.noise},
          {"targets", targets_json(arguments, targets, plan.standard_errors)}};
}

void add_counts(const std::vector<std::int64_t>& counts, std::int64_t experiments, Json& root) {
  root["experiments"] = experiments;
  root["counts"] = counts_json(counts);
  root["support"] = Json::array();
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] == 0) continue;
    root["support"].push_back(
        {{"index", i},
         {"weight", static_cast<double>(counts[i]) / static_cast<double>(experiments)}});
  }
}

// "experiments,least_worst_ratio,worst_ratio,sd(k1),...,power(k1),...": false if it is not whole.
bool write_curve(const PlanArguments& arguments, const InformationSet& set, const ConstraintsOf& of,
                 const std::vector<PrecisionTarget>& targets) {
  const std::vector<std::int64_t> numbers = parse_experiments(arguments.experiments);
  const std::vector<PrecisionPoint> points =
      precision_curve(set, of, targets, numbers, arguments.options);
  std::string text = "experiments,least_worst_ratio,worst_ratio";
  for (const PrecisionTarget& target : targets) text += fmt::format(",\"sd({})\"", target.text);
  for (const PrecisionTarget& target : targets) {
    if (target.effect != 0.0) text += fmt::format(",\"power({})\"", target.text);
  }
  text += '\n';
  for (const PrecisionPoint& point : points) {
    text += fmt::format("{},{:.6g},{:.6g}", point.experiments, point.least_ratio, point.ratio);
    std::vector<double> errors = point.standard_errors;
    errors.resize(targets.size(), std::numeric_limits<double>::infinity());
    for (const double error : errors) text += fmt::format(",{:.6g}", error * arguments.noise);
    for (std::size_t j = 0; j < targets.size(); ++j) {
      if (targets[j].effect == 0.0) continue;
      text += fmt::format(",{:.6g}", power_of(arguments, targets[j], errors[j] * arguments.noise));
    }
    text += '\n';
  }
  write_text_file(arguments.table, text);
  return points.size() == numbers.size();
}

// Writes and prints a plan of either kind.
int answer(const PlanArguments& arguments, const ProjectedSet& read,
           const std::vector<std::int64_t>& counts, const Json& result, const std::string& text,
           PlanStatus status) {
  const bool runs_any = std::ranges::any_of(counts, [](std::int64_t n) { return n > 0; });
  const bool is_written = !arguments.output.empty() && runs_any;
  if (is_written) write_text_file(arguments.output, result.dump(1) + "\n");
  if (arguments.json) {
    fmt::print("{}\n", result.dump());
  } else {
    fmt::print("{}{}", set_headline(read), text);
    if (runs_any) fmt::print("{}", describe_counts(read.set, {.counts = counts}));
    if (is_written) fmt::print("wrote {}\n", arguments.output);
  }
  return status == PlanStatus::kProven ? kDone : kShort;
}

int cheapest_plan(const PlanArguments& arguments, const ProjectedSet& read,
                  const DesignRequest& request, const std::vector<PrecisionTarget>& targets) {
  const InformationSet& set = read.set;
  const PlanOptions& options = arguments.options;
  const BudgetProblem problem = budget_problem(request, set, options.at_most);
  const CheapestPlan plan = plan_cheapest(set, problem.constraints_of, problem.costs, targets,
                                          {.budget = problem.budget,
                                           .gap = arguments.gap,
                                           .time_limit = options.time_limit,
                                           .seed = options.seed,
                                           .threads = options.threads});
  Json result = json_of(arguments, set, targets, plan);
  result["budget"] = problem.budget;
  result["cost"] = plan.cost;
  result["least_cost"] = plan.least_cost;
  add_counts(plan.counts, plan.experiments(), result);
  return answer(arguments, read, plan.counts, result,
                describe_cost(arguments, problem, plan) + describe_rest(arguments, targets, plan),
                plan.status);
}

int design_plan(const PlanArguments& arguments, Invocation& invocation) {
  const DesignRequest request = arguments.request.read();
  require_consistent(arguments, request);
  bench::pin_threads(arguments.options.threads, invocation.arguments);
  const ProjectedSet read = [&] {
    const ReadingLimit limit(arguments.options.time_limit, arguments.set.path);
    return read_set(arguments.set,
                    arguments.request.has_prior() ? SingularSum::kAllowed : SingularSum::kRefused);
  }();
  const InformationSet& set = read.set;
  const std::vector<PrecisionTarget> targets = read_targets(arguments, set);
  for (const std::string& file : {arguments.output, arguments.table}) {
    if (!file.empty()) require_writable(file);
  }
  catch_interrupts();
  if (has_costs(request)) return cheapest_plan(arguments, read, request, targets);
  const ConstraintsOf of = constraints_of_number(request, set);
  if (!arguments.table.empty()) {
    const bool is_whole = write_curve(arguments, set, of, targets);
    if (!arguments.json) fmt::print("wrote {}\n", arguments.table);
    return is_whole ? kDone : kShort;
  }
  const ExperimentPlan plan = plan_experiments(set, of, targets, arguments.options);
  Json result = json_of(arguments, set, targets, plan);
  result["least_experiments"] = plan.least;
  add_counts(plan.counts, plan.experiments, result);
  return answer(arguments, read, plan.counts, result,
                describe_number(arguments, plan) + describe_rest(arguments, targets, plan),
                plan.status);
}

}  // namespace

void add_design_plan_command(CLI::App& app, Invocation& invocation) {
  auto* command = app.add_subcommand("plan",
                                     "How many experiments, or which cheapest ones, reach stated "
                                     "standard errors or see an effect");
  auto arguments = std::make_shared<PlanArguments>();
  PlanOptions& options = arguments->options;
  add_set_options(*command, arguments->set);
  command->add_option("--target", arguments->targets,
                      "'sd(k1) <= 0.02', 'sd(2*k1 - k2) <= 2 %' or 'sd(all) <= 5 %'; repeatable");
  command->add_option("--detect", arguments->detections,
                      "a change that is to be seen: 'k1 by 0.05'; repeatable");
  command->add_option("--power", arguments->power, "probability with which --detect is seen")
      ->capture_default_str();
  command->add_option("--level", arguments->level, "probability of a false alarm in each test")
      ->capture_default_str();
  command
      ->add_option("--noise", arguments->noise,
                   "standard deviation of the noise over that which the set assumes")
      ->capture_default_str();
  command->add_option("--at-most", options.at_most, "experiments, at most")
      ->capture_default_str()
      ->check(CLI::Range(std::int64_t{1}, std::int64_t{1000000}));
  command->add_option("--gap", arguments->gap, "of the cost to prove, relative, with --costs")
      ->capture_default_str();
  add_request_options(*command, arguments->request, ExperimentsOption::kFound);
  command->add_option("--time-limit", options.time_limit, "wall seconds")->capture_default_str();
  add_threads(*command, options.threads);
  command->add_option("--seed", options.seed, "of the search for whole numbers")
      ->capture_default_str();
  command->add_option("-o,--output", arguments->output, "write the design as JSON, with counts");
  command->add_option("--experiments", arguments->experiments,
                      "numbers of experiments for --table, as 10:40");
  command->add_option("--table", arguments->table,
                      "write a CSV table of what each number of experiments reaches instead");
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "Each matrix of the set must be the information of one experiment with its noise, so that\n"
      "the covariance is (sum_i m_i H_i)^-1. 2 % is 0.02. Exit code 1: the number is not proven "
      "to\n"
      "be the smallest, or there is none. See docs/how_to/plan.md.\n"
      "Examples:\n"
      "  graybox design plan set.h5 --target 'sd(all) <= 5 %' -o design.json\n"
      "  graybox design plan set.h5 --detect 'joint_1.gearbox by 10 %' --power 0.8\n"
      "  graybox design plan set.h5 --target 'sd(all) <= 0.1' --costs minutes.csv\n"
      "  graybox design plan set.h5 --target 'sd(0) <= 0.1' --experiments 8:40 --table curve.csv");
  command->callback(
      [arguments, &invocation] { invocation.exit_code = design_plan(*arguments, invocation); });
}

}  // namespace graybox::cli
