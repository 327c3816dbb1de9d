// `graybox design plan`: how many experiments reach stated standard errors, and which.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "bench/pin_threads.hpp"
#include "cli/arguments/request_arguments.hpp"
#include "cli/arguments/set_arguments.hpp"
#include "cli/commands/commands.hpp"
#include "cli/output/console.hpp"
#include "cli/output/exact_report_text.hpp"
#include "cli/output/exact_table.hpp"
#include "cli/output/set_answer.hpp"
#include "cli/process/interrupt.hpp"
#include "problems/base/error.hpp"
#include "problems/files/atomic_file.hpp"
#include "solvers/exact/exact_design_file.hpp"
#include "solvers/planning/experiment_plan.hpp"

namespace graybox::cli {
namespace {

using Json = nlohmann::ordered_json;

struct PlanArguments {
  SetArguments set;
  std::vector<std::string> targets, detections;
  double power = 0.9, level = 0.05;
  double noise = 1.0;
  PlanOptions options{.at_most = 1000, .time_limit = 60.0, .seed = 1, .threads = 1};
  RequestArguments request;
  std::string experiments, table, output;
  bool json = false;
};

void require_consistent(const PlanArguments& arguments, const DesignRequest& request) {
  if (request.budget.has_value() || !request.costs.empty()) {
    throw InputError("costs: a plan counts experiments; take 'graybox exact --budget' for costs");
  }
  if (request.experiments.has_value()) {
    throw InputError("experiments: their number is what a plan finds; limit it by --at-most");
  }
  if (!request.block_sizes.empty()) {
    throw InputError(
        "block_sizes: they fix the number of experiments, which a plan finds; limit blocks by "
        "constraints");
  }
  if (!(arguments.noise > 0.0) || !std::isfinite(arguments.noise)) {
    throw InputError("noise: a positive factor of the noise that the set assumes");
  }
  if (arguments.noise != 1.0 && !request.prior.empty()) {
    throw InputError("noise: scale the matrix of --prior yourself, the factor is the set's alone");
  }
  if (arguments.experiments.empty() != arguments.table.empty()) {
    throw InputError("--table FILE and --experiments LIST (as 10:40) go together");
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

ConstraintsOf constraints_of(const DesignRequest& request, const InformationSet& set) {
  return [&request, &set](std::int64_t experiments) {
    DesignRequest now = request;
    now.experiments = static_cast<double>(experiments);
    return resolve(now, set);
  };
}

std::string asked(const PlanArguments& arguments, const PrecisionTarget& target) {
  if (target.effect == 0.0) return fmt::format("sd({})", target.text);
  return fmt::format("{} by {:.4g} seen with power {:.4g}", target.text, target.effect,
                     arguments.power);
}

double power_of(const PlanArguments& arguments, const PrecisionTarget& target, double error) {
  return detection_power(target.effect / error, arguments.level);
}

std::string describe(const PlanArguments& arguments, const std::vector<PrecisionTarget>& targets,
                     const ExperimentPlan& plan) {
  std::string text;
  switch (plan.status) {
    case PlanStatus::kProven:
      text = fmt::format("{} experiments reach every target; no smaller number does: proven\n",
                         plan.experiments);
      break;
    case PlanStatus::kReached:
      text = fmt::format(
          "{} experiments reach every target; at least {} are needed, what lies between is open\n",
          plan.experiments, plan.least);
      break;
    case PlanStatus::kOutOfReach:
      text = fmt::format("no design of {} experiments or fewer reaches every target: proven\n",
                         arguments.options.at_most);
      if (std::isfinite(plan.worst_ratio)) {
        text +=
            fmt::format("the worst error stays above {:.4g} times its limit\n", plan.worst_ratio);
      }
      break;
    case PlanStatus::kNotFound:
      text = fmt::format("no design was found; at least {} experiments are needed\n", plan.least);
      break;
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
                  const ExperimentPlan& plan) {
  Json list = Json::array();
  for (std::size_t j = 0; j < targets.size(); ++j) {
    Json entry{{"target", targets[j].text},
               {"standard_error_asked", targets[j].standard_error * arguments.noise}};
    if (targets[j].effect != 0.0) entry["effect"] = targets[j].effect;
    if (!plan.counts.empty()) {
      const double error = plan.standard_errors[j] * arguments.noise;
      entry["standard_error"] = error;
      if (targets[j].effect != 0.0) entry["power"] = power_of(arguments, targets[j], error);
    }
    list.push_back(std::move(entry));
  }
  return list;
}

Json to_json(const PlanArguments& arguments, const InformationSet& set,
             const std::vector<PrecisionTarget>& targets, const ExperimentPlan& plan) {
  Json root{{"format", "graybox-design/1"},
            {"solver", "plan"},
            {"problem_hash", set.content_hash()},
            {"candidates", set.candidate_count()},
            {"dimension", set.dimension()},
            {"status", to_string(plan.status)},
            {"message", plan.message},
            {"experiments", plan.experiments},
            {"least_experiments", plan.least},
            {"at_most", arguments.options.at_most},
            {"power", arguments.power},
            {"level", arguments.level},
            {"noise", arguments.noise},
            {"targets", targets_json(arguments, targets, plan)},
            {"counts", counts_json(plan.counts)},
            {"support", Json::array()}};
  for (std::size_t i = 0; i < plan.counts.size(); ++i) {
    if (plan.counts[i] == 0) continue;
    root["support"].push_back(
        {{"index", i},
         {"weight", static_cast<double>(plan.counts[i]) / static_cast<double>(plan.experiments)}});
  }
  return root;
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
  const ConstraintsOf of = constraints_of(request, set);
  if (!arguments.table.empty()) {
    const bool is_whole = write_curve(arguments, set, of, targets);
    if (!arguments.json) fmt::print("wrote {}\n", arguments.table);
    return is_whole ? kDone : kShort;
  }
  const ExperimentPlan plan = plan_experiments(set, of, targets, arguments.options);
  const Json result = to_json(arguments, set, targets, plan);
  const bool is_written = !arguments.output.empty() && !plan.counts.empty();
  if (is_written) write_text_file(arguments.output, result.dump(1) + "\n");
  if (arguments.json) {
    fmt::print("{}\n", result.dump());
  } else {
    fmt::print("{}{}", set_headline(read), describe(arguments, targets, plan));
    if (!plan.counts.empty()) fmt::print("{}", describe_counts(set, {.counts = plan.counts}));
    if (is_written) fmt::print("wrote {}\n", arguments.output);
  }
  return plan.status == PlanStatus::kProven ? kDone : kShort;
}

}  // namespace

void add_design_plan_command(CLI::App& app, Invocation& invocation) {
  auto* command = app.add_subcommand(
      "plan", "How many experiments reach stated standard errors or see an effect, and which");
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
  add_request_options(*command, arguments->request, ExperimentsOption::kFound);
  command->add_option("--time-limit", options.time_limit, "wall seconds")->capture_default_str();
  command->add_option("--threads", options.threads, "threads")->capture_default_str();
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
      "  graybox design plan set.h5 --target 'sd(0) <= 0.1' --experiments 8:40 --table curve.csv");
  command->callback(
      [arguments, &invocation] { invocation.exit_code = design_plan(*arguments, invocation); });
}

}  // namespace graybox::cli
