// `graybox diagnose`: what physics a model lacks, from recordings.
#include <fmt/format.h>
#include <unistd.h>

#include <Eigen/Core>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "commands.hpp"
#include "graybox/diagnosis/hypotheses/load_mismatch_problem.hpp"
#include "graybox/diagnosis/recordings/campaign.hpp"
#include "graybox/diagnosis/recordings/experiment_recording.hpp"
#include "graybox/diagnosis/search/diagnosis_search.hpp"
#include "graybox/diagnosis/verdict/extended_model.hpp"
#include "graybox/diagnosis/verdict/next_plan.hpp"
#include "graybox/diagnosis/verdict/report_page.hpp"
#include "graybox/diagnosis/verdict/verdict_file.hpp"
#include "graybox/diagnosis/verdict/verdict_words.hpp"
#include "graybox/problems/elements/law_file.hpp"
#include "graybox/problems/error.hpp"
#include "graybox/problems/formats/atomic_file.hpp"
#include "graybox/problems/stop.hpp"
#include "graybox/problems/yaml_field.hpp"
#include "interrupt.hpp"

namespace graybox::cli {
namespace {

struct Arguments {
  std::string model, campaign, output;
  std::vector<std::string> law_files, place_files;
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

void require_known_laws(const std::vector<std::string>& laws,
                        std::span<const Hypothesis> hypotheses) {
  for (const std::string& law : laws) {
    const auto names_it = [&](const Hypothesis& hypothesis) { return hypothesis.law == law; };
    if (std::none_of(hypotheses.begin(), hypotheses.end(), names_it)) {
      throw InputError(
          fmt::format("--without {}: no hypothesis has such a law; 'graybox simulate --laws' lists "
                      "the laws",
                      law));
    }
  }
}

// Made before the work, which may take minutes; where that ends without a report, folders that are new go again.
class ReportFolder {
 public:
  explicit ReportFolder(const std::filesystem::path& folder) {
    const std::filesystem::path figures = folder / "figures";
    std::error_code error;
    for (auto made = figures; !made.empty() && !std::filesystem::exists(made, error);
         made = made.parent_path()) {
      if (made.has_filename()) made_.push_back(made);
    }
    std::filesystem::create_directories(figures, error);
    if (error) {
      throw InputError(fmt::format("{}: can't be made: {}", folder.string(), error.message()));
    }
  }
  ReportFolder(const ReportFolder&) = delete;
  ReportFolder& operator=(const ReportFolder&) = delete;
  ~ReportFolder() {
    std::error_code ignored;  // not empty: it stays
    for (const std::filesystem::path& made : made_) std::filesystem::remove(made, ignored);
  }

 private:
  std::vector<std::filesystem::path> made_;  // the innermost first
};

// A report of an earlier run with more figures and plans must not lend them to this one.
void remove_old(const std::filesystem::path& folder) {
  for (const auto& entry : std::filesystem::directory_iterator(folder / "figures")) {
    if (entry.path().extension() == ".svg") std::filesystem::remove(entry.path());
  }
  std::filesystem::remove(folder / "model_extended.yaml");
  std::filesystem::remove(folder / "physics.yaml");
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().filename().string().starts_with("next_plan_")) {
      std::filesystem::remove(entry.path());
    }
  }
}

// What `graybox simulate` needs to carry out the next experiment.
void write_next_plans(const Arguments& arguments, const Campaign& campaign,
                      const Diagnosis& diagnosis) {
  const NextQuestion question = next_question(diagnosis);
  if (question.rival == nullptr) return;
  const std::filesystem::path folder = arguments.output;
  const std::string format = YamlField::load(arguments.model).at("format").text();
  int number = 0;
  for (const std::string& plan :
       next_plans(*question.rival->next, campaign, format == "graybox-robot/1")) {
    write_text_file((folder / fmt::format("next_plan_{}.yaml", ++number)).string(), plan);
  }
}

void write_report(const Arguments& arguments, const Diagnosis& diagnosis,
                  std::span<const Hypothesis> hypotheses, const DiagnosedFiles& files) {
  const std::filesystem::path folder = arguments.output;
  remove_old(folder);
  for (const ReportFigure& figure : report_figures(diagnosis, hypotheses)) {
    write_text_file((folder / "figures" / (figure.name + ".svg")).string(), figure.svg);
  }
  const std::filesystem::path extended = folder / "model_extended.yaml";
  if (diagnosis.after.usable) {
    write_text_file(extended.string(),
                    extended_model_text(arguments.model, extended, diagnosis.after, hypotheses));
    write_text_file((folder / "physics.yaml").string(), physics_text(diagnosis.after, hypotheses));
  }
  write_text_file((folder / "report.html").string(), report_page(diagnosis, hypotheses, files));
  write_text_file((folder / "verdict.json").string(),
                  verdict_json(diagnosis, hypotheses, files).dump(2) + "\n");
}

// Clipped, constant or jittering channels: a saturated sensor looks like missing physics, too.
std::vector<std::string> warnings_of(const Campaign& campaign) {
  constexpr std::size_t kMost = 12;
  std::vector<std::string> warnings;
  for (const Finding& finding : examine_campaign(campaign)) warnings.push_back(finding.message);
  for (std::size_t i = 0; i < campaign.experiments.size(); ++i) {
    for (const Finding& finding : load_experiment(campaign, i).findings) {
      warnings.push_back(finding.message);
    }
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
std::unique_ptr<MismatchProblem> load(const Arguments& arguments, const Campaign& campaign) {
  try {
    return load_mismatch_problem(
        arguments.model, campaign,
        {.threads = arguments.threads,
         .keep_going = [] { return !stop_requested(); },
         .place_files = {arguments.place_files.begin(), arguments.place_files.end()}});
  } catch (const Stopped&) {
    return nullptr;
  }
}

Diagnosis stopped_at_once() {
  Diagnosis nothing;
  nothing.interrupted = true;
  return nothing;
}

int execute(Arguments& arguments) {
  if (arguments.time_limit) limit_process(*arguments.time_limit);
  for (const std::string& file : arguments.law_files) add_law_file(file);
  const Campaign campaign = read_campaign(arguments.campaign);
  std::optional<ReportFolder> folder;
  if (!arguments.output.empty()) folder.emplace(arguments.output);
  catch_interrupts();
  Eigen::setNbThreads(1);  // threads work on recordings, not on the small products of each
  const StepProgress progress;
  progress.show("reading the recordings, fitting the model");
  const std::unique_ptr<MismatchProblem> problem = load(arguments, campaign);
  if (problem) require_known_laws(arguments.search.excluded_laws, problem->hypotheses());
  arguments.search.proceed = [&progress](const std::string& step) {
    progress.show(step);
    return !stop_requested();
  };
  const Diagnosis diagnosis = problem ? diagnose(*problem, arguments.search) : stopped_at_once();
  const std::span<const Hypothesis> hypotheses =
      problem ? problem->hypotheses() : std::span<const Hypothesis>();
  progress.show("");
  const DiagnosedFiles files{arguments.model, campaign.file.string(), warnings_of(campaign)};
  if (!arguments.output.empty()) {
    write_report(arguments, diagnosis, hypotheses, files);
    write_next_plans(arguments, campaign, diagnosis);
  }
  if (arguments.json) {
    fmt::print("{}\n", verdict_json(diagnosis, hypotheses, files).dump());
  } else {
    fmt::print("verdict: {}\n", to_string(diagnosis.verdict));
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
  command->callback([arguments, &invocation] { invocation.exit_code = execute(*arguments); });
}

}  // namespace graybox::cli
