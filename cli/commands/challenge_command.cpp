// `graybox challenge make|run|score`: the proof of the diagnosis on concealed data.
#include <fmt/format.h>

#include <charconv>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "bench/any_motion_challenge/any_motion_set.hpp"
#include "bench/challenge/make_challenge.hpp"
#include "bench/challenge/run_challenge.hpp"
#include "bench/challenge/score_challenge.hpp"
#include "bench/study/environment.hpp"
#include "cli/arguments/threads_argument.hpp"
#include "cli/commands/commands.hpp"
#include "cli/output/console.hpp"
#include "cli/process/interrupt.hpp"
#include "problems/base/error.hpp"

namespace graybox::cli {
namespace {

const bench::ChallengeSet& set_named(const std::string& name) {
  return name == bench::kAnyMotionSet ? bench::any_motion_set() : bench::periodic_set();
}

// Throws InputError for a family that the set has not.
void require_family(const bench::ChallengeSet& set, const std::string& family) {
  if (family.empty()) return;
  std::string names;
  for (const bench::Family each : set.families) {
    if (bench::to_string(each) == family) return;
    names += fmt::format("{}{}", names.empty() ? "" : ", ", bench::to_string(each));
  }
  throw InputError(
      fmt::format("challenge make: --family {}: the set {} has {}", family, set.name, names));
}

// ---- make ---------------------------------------------------------------------------------------

struct MakeArguments {
  bench::MakeOptions options;
  std::string seed, cases, truth, family, set{bench::kPeriodicSet};
  std::size_t count = 0;
  bool quick = false;
  bool json = false;
};

bench::ChallengeOrigin origin_of(const MakeArguments& arguments) {
  bench::ChallengeOrigin origin;
  const bench::ChallengeSet& set = set_named(arguments.set);
  require_family(set, arguments.family);
  origin.cases = arguments.count > 0 ? arguments.count
                 : arguments.quick   ? set.quick_cases
                                     : set.all_cases;
  origin.family = arguments.family;
  origin.set = set.name;
  const std::string& seed = arguments.seed;
  if (seed == "commit") {
    origin.commit = bench::current_commit();
    if (origin.commit.empty() || origin.commit.back() == '+') {
      throw InputError(
          "challenge make: --seed commit needs a folder of the sources in which all is committed");
    }
    origin.seed = bench::seed_of_commit(origin.commit);
    return origin;
  }
  const auto [end, error] = std::from_chars(seed.data(), seed.data() + seed.size(), origin.seed);
  if (error != std::errc() || end != seed.data() + seed.size()) {
    throw InputError(
        fmt::format("challenge make: --seed {}: must be a whole number or 'commit'", seed));
  }
  return origin;
}

int make(MakeArguments& arguments) {
  bench::MakeOptions& options = arguments.options;
  options.origin = origin_of(arguments);
  options.set = &set_named(arguments.set);
  options.cases = arguments.cases;
  options.truth = arguments.truth;
  catch_interrupts(OnStop::kLosesNothing);
  bench::MakeOutcome outcome;
  {
    CountProgress progress("step", 2 * options.origin.cases);
    options.keep_going = [] { return !interrupted(); };
    options.report = [&](std::size_t done, std::size_t) { (void)progress.update(done); };
    outcome = bench::make_challenge(options);
  }
  if (arguments.json) {
    const nlohmann::ordered_json line{{"cases", outcome.cases},
                                      {"complete", outcome.complete},
                                      {"truth_sha256", outcome.truth_sha256}};
    fmt::print("{}\n", line.dump());
  } else if (outcome.complete) {
    fmt::print("wrote {} cases into {}; seal of the truth: {}\n", outcome.cases, arguments.cases,
               outcome.truth_sha256);
  } else {
    fmt::print("interrupted; the same command goes on where it was\n");
  }
  return outcome.complete ? kDone : kShort;
}

void add_make(CLI::App& app, Invocation& invocation) {
  auto* command =
      app.add_subcommand("make", "Draw cases, seal their truth and simulate their recordings");
  auto arguments = std::make_shared<MakeArguments>();
  command
      ->add_option("--seed", arguments->seed,
                   "whole number, or 'commit': from the SHA-256 of the commit under test")
      ->required();
  command->add_option("-o,--output", arguments->cases, "folder of the cases")->required();
  command
      ->add_option("--truth", arguments->truth,
                   "write the truth into this folder, apart from the cases")
      ->required();
  auto* quick = command->add_flag("--quick", arguments->quick,
                                  "a tenth of the cases: 40 of 400, of any_motion 24 of 240");
  command->add_option("--cases", arguments->count, "so many cases, in the same proportions")
      ->check(CLI::Range(1, 100000))
      ->excludes(quick);
  command
      ->add_option("--family", arguments->family,
                   "only cases of robot, three_axis, one_mass, two_mass, oscillator or chain; of "
                   "any_motion axis_encoder, axis_tachometer, drive_encoders, drive_motor_encoder "
                   "or drive_tachometer")
      ->check(CLI::IsMember({"robot", "three_axis", "one_mass", "two_mass", "oscillator", "chain",
                             "axis_encoder", "axis_tachometer", "drive_encoders",
                             "drive_motor_encoder", "drive_tachometer"}));
  command
      ->add_option("--set", arguments->set,
                   "periodic: robots and drives under multisines; any_motion: axes and drives in "
                   "closed loop")
      ->check(CLI::IsMember({std::string(bench::kPeriodicSet), std::string(bench::kAnyMotionSet)}))
      ->capture_default_str();
  add_threads(*command, arguments->options.threads);
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "Ctrl-C loses the cases in hand; the same command goes on where it was.\n"
      "Example:\n  graybox challenge make --quick --seed commit -o cases --truth truth --threads "
      "2");
  command->callback([arguments, &invocation] { invocation.exit_code = make(*arguments); });
}

// ---- run ----------------------------------------------------------------------------------------

struct RunArguments {
  bench::RunOptions options;
  std::string cases, answers, command, without_named;
  bool json = false;
};

std::vector<std::string> words_of(const std::string& text) {
  std::vector<std::string> words;
  std::string word;
  for (const char letter : text + " ") {
    if (letter != ' ') {
      word += letter;
    } else if (!word.empty()) {
      words.push_back(std::exchange(word, {}));
    }
  }
  return words;
}

int run(RunArguments& arguments) {
  bench::RunOptions& options = arguments.options;
  options.cases = arguments.cases;
  options.answers = arguments.answers;
  options.without_named = arguments.without_named;
  options.command = words_of(arguments.command);
  if (options.command.empty()) {
    options.command = {std::filesystem::read_symlink("/proc/self/exe").string(), "diagnose"};
  }
  catch_interrupts();
  bench::RunOutcome outcome;
  {
    const std::size_t cases = bench::read_header(options.cases).cases;
    CountProgress progress("case", cases);
    options.keep_going = [] { return !interrupted(); };
    options.report = [&](std::size_t done, std::size_t) { (void)progress.update(done); };
    outcome = bench::run_challenge(options);
  }
  if (arguments.json) {
    const nlohmann::ordered_json line{
        {"answers", arguments.answers},           {"cases", outcome.cases},
        {"already_there", outcome.already_there}, {"failed", outcome.failed},
        {"confined", outcome.confined},           {"complete", outcome.complete}};
    fmt::print("{}\n", line.dump());
  } else if (outcome.complete) {
    fmt::print("{} cases answered ({} were), {} without a verdict; answers in {}\n", outcome.cases,
               outcome.already_there, outcome.failed, arguments.answers);
    if (!outcome.confined) {
      fmt::print(
          "this system has no Landlock: the diagnosis was trusted not to open other folders\n");
    }
  } else {
    fmt::print("interrupted; the same command goes on where it was\n");
  }
  return outcome.complete && outcome.failed == 0 ? kDone : kShort;
}

void add_run(CLI::App& app, Invocation& invocation) {
  auto* command = app.add_subcommand("run", "Diagnose every case, without its truth");
  auto arguments = std::make_shared<RunArguments>();
  bench::RunOptions& options = arguments->options;
  command->add_option("cases", arguments->cases, "folder of the cases")->required();
  command->add_option("-o,--output", arguments->answers, "folder of the answers")->required();
  add_threads(*command, options.threads, "cases at a time, one thread each");
  command->add_option("--time-limit", options.time_limit, "wall seconds a case")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--without", options.without,
                      "leave this law out of the catalogue; once for each");
  command->add_option("--without-named", arguments->without_named,
                      "answers of an earlier run: each case that names laws again, without them");
  command->add_option("--command", arguments->command,
                      "the diagnosis to run (default: this program's diagnose)");
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "Exit code 1 if a case has no verdict, or after Ctrl-C; the same command goes on where it "
      "was.\n"
      "Examples:\n"
      "  graybox challenge run cases -o answers\n"
      "  graybox challenge run cases -o answers_without --without-named answers");
  command->callback([arguments, &invocation] { invocation.exit_code = run(*arguments); });
}

// ---- score --------------------------------------------------------------------------------------

struct ScoreArguments {
  std::string cases, answers, truth, left_out, output, history;
  bool json = false;
};

int score(const ScoreArguments& arguments) {
  const bench::Score result = bench::score_challenge(
      {arguments.cases, arguments.answers, arguments.truth, arguments.left_out});
  if (!arguments.history.empty()) bench::append_history(result, arguments.history);
  if (!arguments.output.empty()) bench::write_score_tables(result, arguments.output);
  fmt::print("{}{}", arguments.json ? bench::score_json(result).dump() : bench::score_text(result),
             arguments.json ? "\n" : "");
  return kDone;
}

void add_score(CLI::App& app, Invocation& invocation) {
  auto* command = app.add_subcommand("score", "Unseal the truth and tabulate the answers");
  auto arguments = std::make_shared<ScoreArguments>();
  command->add_option("cases", arguments->cases, "folder of the cases")->required();
  command->add_option("answers", arguments->answers, "folder of the answers")->required();
  command->add_option("--truth", arguments->truth, "folder of the truth")->required();
  command->add_option("--left-out", arguments->left_out, "answers of run --without-named");
  command->add_option("-o,--output", arguments->output, "folder for tables (CSV)");
  command->add_option("--history", arguments->history,
                      "append the counts to this CSV; only for challenges of --seed commit");
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "A truth that is not the one sealed with the cases is refused (exit code 2).\n"
      "Example:\n  graybox challenge score cases answers --truth truth -o tables");
  command->callback([arguments, &invocation] { invocation.exit_code = score(*arguments); });
}

}  // namespace

void add_challenge_command(CLI::App& app, Invocation& invocation) {
  auto* command =
      app.add_subcommand("challenge", "Prove the diagnosis on cases whose physics is concealed");
  command->require_subcommand(1);
  add_make(*command, invocation);
  add_run(*command, invocation);
  add_score(*command, invocation);
  command->footer(
      "Examples:\n"
      "  graybox challenge make --quick --seed commit -o cases --truth truth\n"
      "  graybox challenge run cases -o answers\n"
      "  graybox challenge score cases answers --truth truth");
}

}  // namespace graybox::cli
