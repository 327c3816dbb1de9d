// `graybox responses`: frequency responses with their uncertainty from the recordings of a
// campaign.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "cli/arguments/threads_argument.hpp"
#include "cli/arguments/time_limit_argument.hpp"
#include "cli/commands/commands.hpp"
#include "cli/output/console.hpp"
#include "cli/process/interrupt.hpp"
#include "diagnosis/responses/estimate_responses.hpp"
#include "diagnosis/responses/response_file.hpp"
#include "diagnosis/responses/response_summary.hpp"
#include "problems/base/error.hpp"

namespace graybox::cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kListedFindings = 12;  // in the text; all are in the JSON

struct ResponsesArguments {
  std::string campaign;
  std::string output;
  std::string method = "auto";
  std::string role = "estimation";
  bool separate = false;
  double degrees_of_freedom = 0.0;
  double from = 0.0, to = 0.0;
  std::size_t count = 50;
  int order = 2;
  bool direct = false;
  int threads = 1;
  bool json = false;
};

ResponseOptions options_of(const ResponsesArguments& arguments, CountProgress& progress) {
  ResponseOptions options;
  options.role =
      arguments.role == "validation" ? ExperimentRole::kValidation : ExperimentRole::kEstimation;
  options.separate_realisations = arguments.separate;
  if (arguments.method == "periodic") options.method = ResponseMethod::kPeriodic;
  if (arguments.method == "local_polynomial") options.method = ResponseMethod::kLocalPolynomial;
  options.leakage.order = arguments.order;
  options.periodic.degrees_of_freedom = arguments.degrees_of_freedom;
  options.local_polynomial = {.order = arguments.order,
                              .degrees_of_freedom = arguments.degrees_of_freedom,
                              .from = arguments.from,
                              .to = arguments.to,
                              .count = arguments.count,
                              .joint = !arguments.direct};
  options.threads = arguments.threads;
  options.keep_going = [] { return !interrupted(); };
  options.report = [&progress](std::size_t done, std::size_t) { (void)progress.update(done); };
  return options;
}

Json json_of(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

Json json_of(const FrequencyResponseEstimate& estimate) {
  const ResponseSummary summary = summarise(estimate);
  Json findings = Json::array();
  for (const Finding& finding : estimate.findings) {
    findings.push_back({{"check", finding.check}, {"message", finding.message}});
  }
  const double hertz = 1.0 / (2.0 * std::numbers::pi);
  return {{"position", estimate.position},
          {"level", estimate.level},
          {"realisation", estimate.realisation == 0 ? Json("all") : Json(estimate.realisation)},
          {"method", to_string(estimate.method)},
          {"realisations", estimate.realisations},
          {"recordings", estimate.recordings},
          {"periods", estimate.periods},
          {"frequencies", estimate.frequencies.size()},
          {"from_hz", estimate.frequencies.front() * hertz},
          {"to_hz", estimate.frequencies.back() * hertz},
          {"signal_to_noise_db",
           {{"median", json_of(summary.median_signal_to_noise)},
            {"least", json_of(summary.least_signal_to_noise)}}},
          {"relative_error", json_of(summary.median_error)},
          {"degrees_of_freedom", summary.degrees_of_freedom},
          {"total_over_noise_db", json_of(summary.total_over_noise)},
          {"odd_distortion_db", json_of(summary.odd_distortion)},
          {"even_distortion_db", json_of(summary.even_distortion)},
          {"largest_bias", json_of(summary.largest_bias)},
          {"feedback_share", json_of(summary.feedback_share)},
          {"findings", findings}};
}

std::string text_of(const std::optional<double>& value, const char* format = "{:.1f}") {
  return value ? fmt::format(fmt::runtime(format), *value) : "-";
}

std::string row_of(const FrequencyResponseEstimate& estimate) {
  const ResponseSummary summary = summarise(estimate);
  std::optional<double> percent = summary.median_error;
  if (percent) *percent *= 100.0;
  return fmt::format(
      "{:<28} {:>7} {:>6} {:>6} {:>6} {:>8} {:>7} {:>7} {:>7} {:>8}\n",
      estimate.position.empty() ? "-" : fmt::format("[{:g}]", fmt::join(estimate.position, ", ")),
      estimate.level > 0.0 ? fmt::format("{:g}", estimate.level) : "-", estimate.frequencies.size(),
      text_of(summary.median_signal_to_noise), text_of(summary.least_signal_to_noise),
      text_of(percent, "{:.2g}"), text_of(summary.total_over_noise),
      text_of(summary.odd_distortion), text_of(summary.even_distortion),
      text_of(summary.feedback_share, "{:.1g}"));
}

std::string text_of(const std::vector<FrequencyResponseEstimate>& estimates) {
  const FrequencyResponseEstimate& first = estimates.front();
  std::string text = fmt::format(
      "{} responses from {} to {}\n"
      "                                              SNR [dB]    error   total     odd    even  "
      "feedback\n"
      "position                       level  lines median  least      [%]    [dB]    [dB]    [dB] "
      "   share\n",
      estimates.size(), fmt::join(first.inputs, ", "), fmt::join(first.outputs, ", "));
  std::size_t findings = 0;
  std::string listed;
  for (const FrequencyResponseEstimate& estimate : estimates) {
    text += row_of(estimate);
    for (const Finding& finding : estimate.findings) {
      if (++findings <= kListedFindings) listed += fmt::format("  warning: {}\n", finding.message);
    }
  }
  if (findings > kListedFindings) {
    listed += fmt::format("  and {} more; --json lists all\n", findings - kListedFindings);
  }
  return text + listed;
}

int execute(const ResponsesArguments& arguments) {
  if (!arguments.output.empty()) check_response_file_name(arguments.output);
  const Campaign campaign = read_campaign(arguments.campaign);
  catch_interrupts(OnStop::kLosesNothing);
  std::vector<FrequencyResponseEstimate> estimates;
  {
    CountProgress progress("recording", campaign.experiments.size());
    estimates = estimate_responses(campaign, options_of(arguments, progress));
  }
  if (estimates.empty()) {
    fmt::print(stderr, "graybox: interrupted\n");
    return kShort;
  }
  if (!arguments.output.empty()) write_responses(arguments.output, estimates);
  if (arguments.json) {
    Json line{{"campaign", campaign.file.string()}, {"responses", Json::array()}};
    for (const auto& estimate : estimates) line["responses"].push_back(json_of(estimate));
    fmt::print("{}\n", line.dump());
    return kDone;
  }
  fmt::print("{}", text_of(estimates));
  if (!arguments.output.empty()) fmt::print("wrote {}\n", arguments.output);
  return kDone;
}

}  // namespace

void add_responses_command(CLI::App& app, Invocation& invocation) {
  auto* command =
      app.add_subcommand("responses", "Estimate frequency responses with their uncertainty");
  auto arguments = std::make_shared<ResponsesArguments>();
  command
      ->add_option("campaign", arguments->campaign,
                   "graybox-campaign/1 file (YAML), or the folder of a campaign.yaml")
      ->required();
  command->add_option("-o,--output", arguments->output, "file to write: .h5 or .csv");
  command
      ->add_option(
          "--method", arguments->method,
          "periodic, local_polynomial, or auto: periodic where the campaign states periods")
      ->check(CLI::IsMember({"auto", "periodic", "local_polynomial"}))
      ->capture_default_str();
  command->add_option("--role", arguments->role, "which experiments: estimation or validation")
      ->check(CLI::IsMember({"estimation", "validation"}))
      ->capture_default_str();
  command->add_flag("--separate", arguments->separate, "a response for each realisation");
  command
      ->add_option(
          "--degrees-of-freedom", arguments->degrees_of_freedom,
          "of covariances, at least, by pooling neighbouring lines; 0: 4 times the outputs, or 8")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_option("--order", arguments->order, "of the local polynomials")
      ->check(CLI::Range(0, 8))
      ->capture_default_str();
  command->add_option("--from", arguments->from, "Hz, lowest frequency; local polynomials only")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--to", arguments->to, "Hz, highest frequency; local polynomials only")
      ->check(CLI::NonNegativeNumber);
  command
      ->add_option("--count", arguments->count,
                   "frequencies, on a logarithmic scale; local polynomials only")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  command->add_flag(
      "--direct", arguments->direct,
      "from inputs to outputs even where there are references; local polynomials only");
  add_threads(*command, arguments->threads);
  add_time_limit(*command, OnStop::kLosesNothing);
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "SNR: output over its noise; error: standard error of a row of the response; total: noise "
      "and\n"
      "distortion over noise; odd, even: what silent lines answer over the output; bias: by "
      "feedback,\n"
      "in standard errors. A dash: not known, or nothing.\n"
      "Exit codes: 0 done, perhaps with warnings; 1 interrupted; 2 the recordings don't allow it.\n"
      "Examples:\n"
      "  graybox responses campaign/ -o responses.h5\n"
      "  graybox responses campaign/ -o responses.csv --separate\n"
      "  graybox responses campaign/ --method local_polynomial --from 1 --to 60");
  command->callback([arguments, &invocation] { invocation.exit_code = execute(*arguments); });
}

}  // namespace graybox::cli
