// `graybox diagnose`: what physics a model lacks, from recordings.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <iterator>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cli/commands/commands.hpp"
#include "cli/output/command_line.hpp"
#include "cli/output/report_folder.hpp"
#include "cli/process/interrupt.hpp"
#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/force_balance/force_balance_mismatch.hpp"
#include "diagnosis/force_balance_data/measured_drive.hpp"
#include "diagnosis/load/load_mismatch_problem.hpp"
#include "diagnosis/prediction_error/prediction_diagnosis.hpp"
#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/recordings/experiment_recording.hpp"
#include "diagnosis/search/diagnosis_search.hpp"
#include "diagnosis/verdict/extended_model.hpp"
#include "diagnosis/verdict/next_plan.hpp"
#include "diagnosis/verdict/report_page.hpp"
#include "diagnosis/verdict/verdict_file.hpp"
#include "diagnosis/verdict/verdict_words.hpp"
#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"
#include "problems/files/yaml_field.hpp"
#include "problems/laws/law_catalogue.hpp"
#include "problems/laws/law_file.hpp"

namespace graybox::cli {
namespace {

struct Arguments {
  std::string model, campaign, output;
  std::vector<std::string> law_files, place_files;
  std::string method = "auto";
  int threads = 1;
  bool json = false;
  std::optional<double> time_limit;  // s
  SearchOptions search;
};

// The steps of the search, on one line of a terminal that is rewritten.
class StepProgress {
 public:
  StepProgress() : terminal_(isatty(fileno(stderr)) != 0) {}
  ~StepProgress() { show(""); }
  StepProgress(const StepProgress&) = delete;
  StepProgress& operator=(const StepProgress&) = delete;

  void show(const std::string& step) const {
    if (terminal_) fmt::print(stderr, "\r\033[K{}", step);
    if (terminal_) std::fflush(stderr);
  }

 private:
  bool terminal_;
};

[[noreturn]] void refuse_law(const std::string& law) {
  throw InputError(fmt::format(
      "--without {}: no hypothesis has such a law; 'graybox simulate --laws' lists the laws", law));
}

void require_known_laws(const std::vector<std::string>& laws,
                        std::span<const Hypothesis> hypotheses) {
  for (const std::string& law : laws) {
    const auto names_it = [&](const Hypothesis& hypothesis) { return hypothesis.law == law; };
    if (std::none_of(hypotheses.begin(), hypotheses.end(), names_it)) refuse_law(law);
  }
}

// For a drive, whose two methods try different laws.
void require_laws_of_the_catalogue(const std::vector<std::string>& laws) {
  for (const std::string& law : laws) {
    if (find_law(law, false) == nullptr && find_law(law, true) == nullptr) refuse_law(law);
  }
}

// What every report may hold. Figures and plans have names of their own (report_folder.hpp).
const std::vector<std::string> kReportFiles{"report.html", "verdict.json", "model_extended.yaml",
                                            "physics.yaml"};

// What `graybox simulate` needs to carry out the next experiment.
void add_next_plans(const Arguments& arguments, const Campaign& campaign,
                    const Diagnosis& diagnosis, std::map<std::string, std::string>& texts) {
  const NextQuestion question = next_question(diagnosis);
  if (question.rival == nullptr) return;
  const std::string format = YamlField::load(arguments.model).at("format").text();
  int number = 0;
  for (const std::string& plan :
       next_plans(*question.rival->next, campaign, format == "graybox-robot/1")) {
    texts[fmt::format("next_plan_{}.yaml", ++number)] = plan;
  }
}

// What a reader may save from the page.
ReportContext context_of(const std::map<std::string, std::string>& texts, PageOrigin origin) {
  ReportContext context{.origin = std::move(origin)};
  for (const auto& [name, text] : texts) {
    if (name.starts_with("next_plan_")) {
      context.plans.push_back({name, text, "the experiment to make"});
    } else if (name == "model_extended.yaml") {
      context.models.push_back({name, text, "the model with the laws found"});
    } else if (name == "physics.yaml") {
      context.models.push_back({name, text, "these laws alone, for --physics"});
    }
  }
  return context;
}

void write_report(const Arguments& arguments, const Campaign& campaign, const Diagnosis& diagnosis,
                  std::span<const Hypothesis> hypotheses, const DiagnosedFiles& files,
                  PageOrigin origin, ReportFolder& folder, nlohmann::ordered_json& verdict) {
  std::map<std::string, std::string> texts;
  for (ReportFigure& figure : report_figures(diagnosis, hypotheses)) {
    texts["figures/" + figure.name + ".svg"] = std::move(figure.svg);
  }
  if (diagnosis.after.usable) {
    texts["model_extended.yaml"] = extended_model_text(
        arguments.model, folder.file("model_extended.yaml"), diagnosis.after, hypotheses);
    texts["physics.yaml"] = physics_text(diagnosis.after, hypotheses);
  }
  add_next_plans(arguments, campaign, diagnosis, texts);
  const ReportContext context = context_of(texts, std::move(origin));
  texts["report.html"] = report_page(diagnosis, hypotheses, files, context);
  folder.write(texts, verdict);
}

// Clipped, constant or jittering channels: a saturated sensor looks like missing physics, too.
// Files that were read are added to `origin`.
std::vector<std::string> warnings_of(const Campaign& campaign, PageOrigin& origin) {
  constexpr std::size_t kMost = 12;
  std::vector<std::string> warnings;
  CopyFinder copies;
  for (const Finding& finding : examine_campaign(campaign)) warnings.push_back(finding.message);
  for (std::size_t i = 0; i < campaign.experiments.size(); ++i) {
    ExperimentRecording recording = load_experiment(campaign, i);
    copies.examine(campaign.experiments[i], recording);
    origin.files.push_back(
        {campaign.experiments[i].name, name_of(campaign.experiments[i].role), recording.samples});
    for (const Finding& finding : recording.findings) warnings.push_back(finding.message);
  }
  if (warnings.size() > kMost) {
    const std::size_t more = warnings.size() - kMost;
    warnings.resize(kMost);
    warnings.push_back(
        fmt::format("{} more; 'graybox recordings {}' lists all", more, campaign.file.string()));
  }
  return warnings;
}

int exit_code_of(const Diagnosis& diagnosis) {
  return diagnosis.verdict == Verdict::kUnknown ? kShort : kDone;
}

// Null where it was stopped before there was a problem to search in.
std::unique_ptr<MismatchProblem> load(const Arguments& arguments, const Campaign& campaign,
                                      const RigidRobotModel* drive) {
  try {
    if (drive != nullptr) {
      return drive_balance_problem(
          *drive, campaign,
          {.threads = arguments.threads, .keep_going = [] { return !stop_requested(); }});
    }
    return load_mismatch_problem(
        arguments.model, campaign,
        {.threads = arguments.threads,
         .keep_going = [] { return !stop_requested(); },
         .place_files = {arguments.place_files.begin(), arguments.place_files.end()}});
  } catch (const Stopped&) {
    return nullptr;
  }
}

Diagnosis stopped_before_the_search(const SearchOptions& options) {
  Diagnosis diagnosis;
  diagnosis.interrupted = true;
  diagnosis.reasons = verdict_reasons(diagnosis, options);
  diagnosis.verdict = verdict_of(diagnosis.reasons);
  return diagnosis;
}

// What a diagnosis goes by, and why, in one line.
struct Method {
  std::string name;  // periodic, force_balance, prediction_error
  std::string reason;
  bool is_lumped = false;                // the model's format, which leaves a choice
  std::optional<RigidRobotModel> drive;  // a lumped model that is measured as a whole
};

// Why a lumped model and its recordings are none for harmonic balance; empty if they are.
std::string why_not_periodic(const LumpedModel& model, const Campaign& campaign) {
  const bool is_periodic = std::ranges::all_of(
      campaign.experiments,
      [](const Experiment& experiment) { return experiment.excitation.has_value(); });
  if (!is_periodic) return "the recordings have no period ('excitation')";
  if (campaign.hold != InputHold::kZero) {
    return "the inputs are not held between samples ('hold')";
  }
  const bool has_accelerations = std::ranges::any_of(model.outputs, [](const LumpedOutput& output) {
    return output.quantity == LumpedOutput::Quantity::kAcceleration;
  });
  return has_accelerations ? "accelerations are measured" : "";
}

Method chosen_method(const Arguments& arguments, const Campaign& campaign) {
  const std::string format = YamlField::load(arguments.model).at("format").text();
  Method method{"", "it was asked for", format == "graybox-lumped/1", {}};
  std::optional<LumpedModel> lumped;
  if (method.is_lumped) {
    lumped = load_lumped_model(arguments.model);
    method.drive = measured_drive(*lumped);
  }
  if (arguments.method == "prediction_error" ||
      (arguments.method == "force_balance" && method.drive)) {
    method.name = arguments.method;
    return method;
  }
  if (arguments.method == "force_balance" && method.is_lumped) {
    throw InputError(fmt::format(
        "--method force_balance: {} must be one mass whose only force and whose position or "
        "velocity are recorded, without laws other than viscous, stiffness and offset: leave these "
        "out, since they are looked for, or say prediction_error",
        arguments.model));
  }
  const bool is_rigid = format == "graybox-rigid-robot/1";
  method.name = is_rigid ? "force_balance" : "periodic";
  if (arguments.method != "auto" && arguments.method != method.name) {
    throw InputError(fmt::format("--method {}: {} is a {} model: say {}{}", arguments.method,
                                 arguments.model, format, method.name,
                                 method.is_lumped ? " or prediction_error" : ""));
  }
  if (arguments.method == "auto" && lumped) {
    const std::string why_not = why_not_periodic(*lumped, campaign);
    if (!why_not.empty()) {
      method.name = "prediction_error";
      method.reason = why_not;
    }
  }
  return method;
}

// Where a lumped model leaves a choice.
std::string method_line(const Method& method) {
  if (!method.is_lumped || method.name == "periodic") return "";
  const bool is_balance = method.name == "force_balance";
  return fmt::format("By {}, since {}.", is_balance ? "the balance of forces" : "prediction error",
                     method.reason);
}

struct Answer {
  std::unique_ptr<MismatchProblem> problem;  // keeps the hypotheses, of two methods
  PredictionDiagnosis by_prediction;
  Diagnosis diagnosis;
  [[nodiscard]] std::span<const Hypothesis> hypotheses() const {
    return problem ? problem->hypotheses() : std::span<const Hypothesis>(by_prediction.hypotheses);
  }
};

Answer answer_by_prediction(const Arguments& arguments, const Campaign& campaign) {
  Answer answer;
  answer.by_prediction =
      diagnose_by_prediction(arguments.model, campaign, arguments.search, arguments.threads);
  answer.diagnosis = answer.by_prediction.diagnosis;
  return answer;
}

// `drive`, if not null: a lumped model as the force balance of its one mass.
Answer answer_by_problem(Arguments& arguments, const Campaign& campaign,
                         const RigidRobotModel* drive = nullptr) {
  Answer answer;
  answer.problem = load(arguments, campaign, drive);
  if (!answer.problem) {
    answer.diagnosis = stopped_before_the_search(arguments.search);
    return answer;
  }
  // Laws of signals, which the other method of a drive may leave out, are none of its balance.
  if (drive == nullptr) {
    require_known_laws(arguments.search.excluded_laws, answer.problem->hypotheses());
  }
  answer.diagnosis = diagnose(*answer.problem, arguments.search);
  return answer;
}

// None where the balance finds nothing, or can't be set up: the drive stands still, say.
std::optional<Answer> found_by_balance(const RigidRobotModel& drive, Arguments& arguments,
                                       const Campaign& campaign) {
  try {
    Answer answer = answer_by_problem(arguments, campaign, &drive);
    const Diagnosis& diagnosis = answer.diagnosis;
    if (!diagnosis.channel_faults.empty() || !diagnosis.effects.empty()) return answer;
  } catch (const InputError&) {
  }
  return {};
}

// By the method chosen. Where the prediction error leaves doubt, and the drive is measured as a
// whole, its force balance is asked, too, and answers if it has found something.
Answer answer_by(Method& method, Arguments& arguments, const Campaign& campaign) {
  if (method.is_lumped && method.name != "periodic" && !arguments.place_files.empty()) {
    throw InputError("--places: a lumped model in any motion is diagnosed at its own places alone");
  }
  if (method.is_lumped && method.name != "periodic") {
    require_laws_of_the_catalogue(arguments.search.excluded_laws);
  }
  if (method.name != "prediction_error") {
    return answer_by_problem(
        arguments, campaign,
        method.name == "force_balance" && method.drive ? &*method.drive : nullptr);
  }
  Answer predicted = answer_by_prediction(arguments, campaign);
  const std::string& doubt = predicted.by_prediction.doubt;
  if (arguments.method != "auto" || doubt.empty() || !method.drive) return predicted;
  std::optional<Answer> balanced = found_by_balance(*method.drive, arguments, campaign);
  if (!balanced) return predicted;
  method.name = "force_balance";
  method.reason = fmt::format("a diagnosis by prediction error is in doubt (failed: {})", doubt);
  return *std::move(balanced);
}

int execute(Arguments& arguments, const Invocation& invocation) {
  const auto start = std::chrono::steady_clock::now();
  if (arguments.time_limit) limit_process(*arguments.time_limit);
  for (const std::string& file : arguments.law_files) add_law_file(file);
  const Campaign campaign = read_campaign(arguments.campaign);
  std::optional<ReportFolder> folder;
  if (!arguments.output.empty()) folder.emplace(arguments.output, kReportFiles);
  catch_interrupts();
  const StepProgress progress;
  progress.show("reading the recordings, fitting the model");
  arguments.search.proceed = [&progress](const std::string& step) {
    progress.show(step);
    return !stop_requested();
  };
  Method method = chosen_method(arguments, campaign);
  const Answer answer = answer_by(method, arguments, campaign);
  const Diagnosis& diagnosis = answer.diagnosis;
  const std::span<const Hypothesis> hypotheses = answer.hypotheses();
  progress.show("");
  PageOrigin origin{.command = command_line(invocation.arguments),
                    .files = {{arguments.model, "model"}, {campaign.file.string(), "campaign"}}};
  DiagnosedFiles files{arguments.model, campaign.file.string(), warnings_of(campaign, origin)};
  if (method.is_lumped && std::ranges::any_of(campaign.experiments, [](const Experiment& each) {
        return !each.load.empty();
      })) {
    files.warnings.push_back(
        "load: models of masses know no loads, so all recordings were taken for one machine: "
        "state it as a robot of one joint (graybox-rigid-robot/1), or diagnose those with a load "
        "by themselves");
  }
  if (answer.problem) {
    std::ranges::copy(answer.problem->remarks(), std::back_inserter(files.warnings));
  }
  nlohmann::ordered_json verdict = verdict_json(diagnosis, hypotheses, files);
  verdict["method"] = method.name;
  if (folder) {
    origin.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    write_report(arguments, campaign, diagnosis, hypotheses, files, std::move(origin), *folder,
                 verdict);
  }
  if (arguments.json) {
    fmt::print("{}\n", verdict.dump());
  } else {
    fmt::print("verdict: {}\n", to_string(diagnosis.verdict));
    if (const std::string line = method_line(method); !line.empty()) {
      fmt::print("{}\n", line);
    }
    for (const std::string& line : verdict_words(diagnosis, hypotheses)) {
      fmt::print("{}\n", line);
    }
    for (const std::string& line : files.warnings) fmt::print("The recordings: {}\n", line);
    if (!arguments.output.empty()) {
      fmt::print("wrote {}/report.html, verdict.json, {}figures\n", arguments.output,
                 diagnosis.after.usable ? "model_extended.yaml, physics.yaml, " : "");
    }
  }
  return exit_code_of(diagnosis);
}

}  // namespace

void add_diagnose_command(CLI::App& app, Invocation& invocation) {
  auto* command = app.add_subcommand(
      "diagnose",
      "Find the physics that a model lacks, from recordings: where, what, and how sure");
  auto arguments = std::make_shared<Arguments>();
  command->add_option("model", arguments->model, "model file (YAML)")->required();
  command
      ->add_option("campaign", arguments->campaign,
                   "graybox-campaign/1 file (YAML), or the folder of a campaign.yaml")
      ->required();
  command->add_option("-o,--output", arguments->output,
                      "write report.html, verdict.json, model_extended.yaml, physics.yaml and "
                      "figures into this folder");
  command
      ->add_option("--method", arguments->method,
                   "periodic, force_balance or prediction_error (default: what the model and the "
                   "recordings ask for)")
      ->check(CLI::IsMember({"auto", "periodic", "force_balance", "prediction_error"}));
  command->add_option("--threads", arguments->threads, "threads")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  command
      ->add_option("--level", arguments->search.level,
                   "false alarms where nothing is missing, all hypotheses together")
      ->check(CLI::Range(0.0005, 0.5))
      ->capture_default_str();
  command
      ->add_option("--effects", arguments->search.effect_limit,
                   "effects to look for, at most (default: 4, or 24 where the noise is not known)")
      ->check(CLI::Range(1, 50));
  command->add_option("--without", arguments->search.excluded_laws,
                      "leave these laws out of the catalogue");
  command->add_option("--laws", arguments->law_files,
                      "laws of your own, graybox-laws/1 files, besides the catalogue");
  command->add_option("--places", arguments->place_files,
                      "places of your own, graybox-places/1 files, besides those of the model");
  command->add_flag("--ignore-faults", arguments->search.ignore_channel_faults,
                    "search although wires, signs or units look wrong");
  command
      ->add_option("--time-limit", arguments->time_limit,
                   "stop after so many seconds with what has been found until then")
      ->check(CLI::Range(0.01, 1e6));
  command->add_option("--seed", arguments->search.seed, "of the draws that calibrate the tests")
      ->capture_default_str();
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "Exit codes: 0 nothing missing, explained or ambiguous; 1 unknown; 2 bad input.\n"
      "Examples:\n"
      "  graybox diagnose robot.yaml campaign/ -o report --threads 2\n"
      "  graybox diagnose drive.yaml campaign/ --without coulomb --json\n"
      "  graybox diagnose drive.yaml campaign/ --laws my_laws.yaml --places my_places.yaml -o "
      "report");
  command->callback(
      [arguments, &invocation] { invocation.exit_code = execute(*arguments, invocation); });
}

}  // namespace graybox::cli
