// `graybox model`: a first model.yaml and campaign.yaml from logs.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/commands/commands.hpp"
#include "cli/process/interrupt.hpp"
#include "diagnosis/proposal/proposal.hpp"
#include "diagnosis/runs/proposed_files.hpp"
#include "problems/base/error.hpp"

namespace graybox::cli {
namespace {

struct Arguments {
  std::vector<std::string> files, columns;
  std::string folder = ".";
  bool one_mass = false, two_masses = false, linear = false, rotary = false, overwrite = false;
  ProposalRequest request;
};

bool is_urdf(const std::string& file) {
  return file.ends_with(".urdf") || file.ends_with(".URDF") || file.ends_with(".urdf.xml");
}

// "one mass", "two-masses": words for the machine in the place of a file, where there is none.
std::optional<ProposedMachine> machine_named(const std::string& file) {
  const bool is_one = file == "one mass" || file == "one-mass";
  const bool is_two = file == "two masses" || file == "two-masses";
  if ((!is_one && !is_two) || std::filesystem::exists(file)) return {};
  return is_one ? ProposedMachine::kOneMass : ProposedMachine::kTwoMasses;
}

// The options for the machine, with the words for it that stand among the files.
Arguments with_named_machine(Arguments arguments) {
  std::erase_if(arguments.files, [&](const std::string& file) {
    const std::optional<ProposedMachine> machine = machine_named(file);
    if (!machine) return false;
    const bool is_one = *machine == ProposedMachine::kOneMass;
    (is_one ? arguments.one_mass : arguments.two_masses) = true;
    return true;
  });
  if (arguments.one_mass && arguments.two_masses) {
    throw InputError("one mass or two masses: say one of both");
  }
  return arguments;
}

// Names with anything but letters, digits and a few signs in quotes, as a shell wants them.
std::string for_shell(const std::string& word) {
  const bool is_plain = std::ranges::all_of(word, [](unsigned char c) {
    return std::isalnum(c) != 0 ||
           std::string_view("_-./=:,+").find(static_cast<char>(c)) != std::string_view::npos;
  });
  return is_plain && !word.empty() ? word : "'" + word + "'";
}

// Throws InputError for an option that would change nothing, with or without a URDF.
void require_applicable(const Arguments& arguments, const ProposalRequest& request) {
  const bool is_robot = !request.urdf.empty();
  struct Rule {
    bool is_given, needs_robot;
    const char* text;
  };
  for (const Rule& rule :
       {Rule{arguments.one_mass || arguments.two_masses, false,
             "--one-mass and --two-masses: not beside a URDF, which says what moves"},
        Rule{arguments.linear || arguments.rotary, false,
             "--linear and --rotary: not beside a URDF, which says how its joints move"},
        Rule{request.no_drive, false, "--no-drive: not beside a URDF: its joints have drives"},
        Rule{request.gain.has_value(), false,
             "--gain: not beside a URDF: each drive's gain is estimated, or stands in "
             "campaign.yaml"},
        Rule{!request.base.empty(), true, "--base: names a link of a URDF, and none is given"},
        Rule{!request.tip.empty(), true, "--tip: names a link of a URDF, and none is given"}}) {
    if (rule.is_given && rule.needs_robot != is_robot) throw InputError(rule.text);
  }
  if (request.no_drive && request.gain) {
    throw InputError("--gain: is of a drive, and --no-drive says that there is none");
  }
}

ProposalRequest request_of(const Arguments& given) {
  const Arguments arguments = with_named_machine(given);
  if (arguments.files.empty()) {
    throw InputError(fmt::format("{}: give a log, too: graybox model --{} LOG.csv",
                                 given.files.front(),
                                 arguments.one_mass ? "one-mass" : "two-masses"));
  }
  ProposalRequest request = arguments.request;
  request.command = "graybox model";
  if (given.files.size() > arguments.files.size()) {
    request.command += arguments.one_mass ? " --one-mass" : " --two-masses";
  }
  for (const std::string& file : arguments.files) {
    if (is_urdf(file) && request.urdf.empty()) {
      request.urdf = file;
    } else {
      request.logs.emplace_back(file);
    }
    request.command += " " + for_shell(file);
  }
  for (const std::string& column : arguments.columns)
    request.columns.push_back(column_answer(column));
  request.folder = arguments.folder;
  if (arguments.linear) request.motion = MotionKind::kLinear;
  if (arguments.rotary) request.motion = MotionKind::kRotary;
  if (arguments.one_mass) request.machine = ProposedMachine::kOneMass;
  if (arguments.two_masses) request.machine = ProposedMachine::kTwoMasses;
  require_applicable(arguments, request);
  if (!request.urdf.empty()) request.machine = ProposedMachine::kRobot;
  if (request.logs.empty()) {
    throw InputError(fmt::format("{}: give a log beside the URDF: graybox model {} LOG.csv",
                                 request.urdf.string(), request.urdf.string()));
  }
  return request;
}

// ---- the terminal -------------------------------------------------------------------------------

bool is_terminal() { return isatty(fileno(stdin)) != 0 && isatty(fileno(stdout)) != 0; }

// Adds the answer to the request. False where the user gives none.
bool take_answer(const OpenQuestion& question, const std::string& line, ProposalRequest& request) {
  try {
    if (question.kind == OpenQuestion::Kind::kSampleTime && line.find('=') != std::string::npos) {
      request.columns.push_back(column_answer(line));  // the column that has the time
      return true;
    }
    const double number = std::stod(line);
    if (question.kind == OpenQuestion::Kind::kSampleTime && number > 0.0) {
      request.sample_time = number;
      return true;
    }
    if (question.kind == OpenQuestion::Kind::kCountsPerTurn && number > 0.0) {
      request.counts_per_turn = number;
      return true;
    }
    const auto place = static_cast<std::size_t>(number);
    if (question.kind == OpenQuestion::Kind::kChoice && place >= 1 &&
        place <= question.choices.size()) {
      for (const std::string& each : question.choices[place - 1].columns) {
        request.columns.push_back(column_answer(each));
      }
      request.no_drive = request.no_drive || question.choices[place - 1].no_drive;
      return true;
    }
  } catch (const std::logic_error&) {  // no number
  } catch (const InputError&) {        // no answer
  }
  return false;
}

ModelProposal ask(ProposalRequest& request) {
  constexpr int kMostQuestions = 40;
  ModelProposal proposal = propose_model(request);
  for (int k = 0; k < kMostQuestions && is_terminal(); ++k) {
    const auto open = std::ranges::find_if(proposal.questions, [](const OpenQuestion& each) {
      return each.kind != OpenQuestion::Kind::kInFile;
    });
    if (open == proposal.questions.end()) break;
    fmt::print("{}\n", open->text);
    for (std::size_t i = 0; i < open->choices.size(); ++i) {
      fmt::print("  {}  {}\n", i + 1, open->choices[i].label);
    }
    fmt::print("> ");
    std::fflush(stdout);
    std::string line;
    if (!std::getline(std::cin, line) || !take_answer(*open, line, request)) break;
    proposal = propose_model(request);
  }
  return proposal;
}

// ---- what is printed ----------------------------------------------------------------------------

void print_guesses(const ModelProposal& proposal) {
  std::size_t subject = 0, value = 0;
  constexpr std::size_t kWidest = 34;
  for (const ProposedGuess& guess : proposal.guesses) {
    subject = std::max(subject, guess.subject.size());
    value = std::max(value, std::min(kWidest, guess.value.size()));
  }
  for (const ProposedGuess& guess : proposal.guesses) {
    if (guess.reason.empty()) {
      fmt::print("{:<{}}  {}\n", guess.subject, subject, guess.value);
    } else {
      fmt::print("{:<{}}  {:<{}}  {}\n", guess.subject, subject, guess.value, value, guess.reason);
    }
  }
  for (const std::string& note : proposal.notes) fmt::print("note: {}\n", note);
}

int execute(const Arguments& arguments) {
  ProposalRequest request = request_of(arguments);
  if (!arguments.overwrite) refuse_existing_proposal(request);
  catch_interrupts();
  ModelProposal proposal = ask(request);
  const std::vector<std::string> findings = write_proposal(request, proposal);
  print_guesses(proposal);
  for (const std::string& finding : findings) fmt::print("recordings: {}\n", finding);
  const std::string model = (request.folder / "model.yaml").lexically_normal().string(),
                    campaign = (request.folder / "campaign.yaml").lexically_normal().string();
  for (const OpenQuestion& question : proposal.questions) {
    fmt::print("open: {}{}\n", question.text,
               question.option.empty() ? "" : fmt::format(" ({})", question.option));
  }
  if (!proposal.questions.empty()) {
    std::fflush(stdout);
    fmt::print(
        stderr,
        "graybox: {} open question{}: answer by the options above and --overwrite, or in the "
        "lines marked '# ANSWER:' of {} and {}\n",
        proposal.questions.size(), proposal.questions.size() == 1 ? "" : "s", model, campaign);
    return kBadInput;
  }
  fmt::print("Next: graybox {} {} {}\n", proposal.is_too_short ? "fit" : "diagnose",
             for_shell(model), for_shell(campaign));
  return kDone;
}

void add_options(CLI::App& command, Arguments& arguments) {
  command
      .add_option("files", arguments.files,
                  "logs (CSV, MAT, HDF5, ...), for a robot its URDF first")
      ->required();
  auto* one =
      command.add_flag("--one-mass", arguments.one_mass, "one mass (unless the log shows two)");
  command
      .add_flag("--two-masses", arguments.two_masses, "two masses and a spring; one or two sensors")
      ->excludes(one);
  command.add_option("-o,--output", arguments.folder, "folder for model.yaml and campaign.yaml")
      ->capture_default_str();
  command
      .add_option("--column", arguments.columns,
                  "NAME=QUANTITY[:UNIT][@JOINT]: what a column is; ignore: not used")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command.add_option("--sample-time", arguments.request.sample_time, "s; instead of a time column")
      ->check(CLI::PositiveNumber);
  command.add_option("--gain", arguments.request.gain,
                     "N m (N) for one recorded unit of the drive");
  command.add_flag("--no-drive", arguments.request.no_drive,
                   "no force acts: a run-down or a free swing");
  command.add_option("--counts-per-turn", arguments.request.counts_per_turn, "of the encoder")
      ->check(CLI::PositiveNumber);
  auto* linear = command.add_flag("--linear", arguments.linear, "the masses move along a line");
  command.add_flag("--rotary", arguments.rotary, "they turn")->excludes(linear);
  command.add_option("--base", arguments.request.base, "link of the URDF before the first joint");
  command.add_option("--tip", arguments.request.tip, "link behind the last joint");
  command.add_flag("--overwrite", arguments.overwrite, "replace model.yaml and campaign.yaml");
}

}  // namespace

void add_model_command(CLI::App& app, Invocation& invocation) {
  auto* command = app.add_subcommand("model", "Propose model.yaml and campaign.yaml from logs");
  auto arguments = std::make_shared<Arguments>();
  add_options(*command, *arguments);
  command->footer(
      "With several logs the last is kept out of the fit; one log is cut in two.\n"
      "Exit codes: 0 written; 2 bad input, or open questions (marked '# ANSWER:' in the files).\n"
      "Examples:\n"
      "  graybox model --one-mass run_1.csv run_2.csv -o axis\n"
      "  graybox model motor.csv --column 'enc=position:deg' --gain 0.12\n"
      "  graybox model swing.csv --no-drive -o swing\n"
      "  graybox model robot.urdf position.csv effort.csv -o robot\n"
      "  graybox model robot.urdf log.csv --column '2..7=position' --column '8..13=current'\n"
      "Then: graybox diagnose axis/model.yaml axis/campaign.yaml");
  command->callback([arguments, &invocation] { invocation.exit_code = execute(*arguments); });
}

}  // namespace graybox::cli
