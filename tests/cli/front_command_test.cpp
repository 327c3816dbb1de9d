// The front door: what graybox says of itself, to people and to shells.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

using testing::Outcome;
using testing::read_text;
using testing::write_text;

std::string source_file(const std::string& name) {
  return read_text(std::string(GRAYBOX_SOURCE_DIR) + "/" + name);
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

// What stands behind the prefix, of the lines that begin so.
std::vector<std::string> lines_after(const std::string& text, const std::string& prefix) {
  std::vector<std::string> found;
  for (const std::string& line : lines_of(text)) {
    if (line.starts_with(prefix)) found.push_back(line.substr(prefix.size()));
  }
  return found;
}

// Whether a help text has the option, in full or in a line of names.
bool states(const std::string& help, const std::string& option) {
  return std::regex_search(help, std::regex("[\\s,]" + option + "[\\s,]"));
}

// Rows of a terminal that the text takes.
std::size_t rows_of(const std::string& text, std::size_t columns) {
  std::size_t rows = 0;
  for (const std::string& line : lines_of(text)) {
    rows += std::max<std::size_t>(1, (line.size() + columns - 1) / columns);
  }
  return rows;
}

class FrontDoor : public testing::CommandRunner {
 protected:
  // The commands below `path` ("design "), as its help lists them.
  std::vector<std::string> commands_below(const std::string& path) {
    std::vector<std::string> names;
    bool is_list = false;
    for (const std::string& line : lines_of(graybox(path + "--help").out)) {
      if (line.empty()) is_list = false;
      // Neither a task's name nor a description that goes on.
      if (is_list && line.starts_with("  ") && line[2] != ' ') {
        names.push_back(line.substr(2, line.find(' ', 2) - 2));
      }
      if (line == "Subcommands:") is_list = true;
    }
    return names;
  }

  std::vector<std::string> all_commands() {
    std::vector<std::string> all;
    for (const std::string& name : commands_below("")) {
      all.push_back(name);
      for (const std::string& below : commands_below(name + " ")) {
        all.push_back(name + " " + below);
      }
    }
    return all;
  }

  // What a command's help says of its options and positionals.
  struct StatedOption {
    std::string name, description;
    bool is_required = false, is_positional = false;
    std::string type = {};  // "TEXT", "UINT:POSITIVE", "TEXT:{c,csv,urdf}"
    bool is_repeatable = false;
    // A value that it takes.
    [[nodiscard]] std::string value() const {
      if (type == "TEXT") return "other";
      const std::size_t brace = type.find('{');
      if (brace == std::string::npos) return "1";
      return type.substr(brace + 1, type.find_first_of(",}", brace) - brace - 1);
    }
    [[nodiscard]] bool writes() const {
      return !is_positional && type == "TEXT" &&
             std::regex_search(
                 description,
                 std::regex("write|(^folder of the (cases|answers|results)$)|^folder for|"
                            "keep the state|append|^file \\(c, urdf\\)|campaign folder"));
    }
  };

  static std::vector<StatedOption> options_in(const std::string& text) {
    std::vector<StatedOption> options;
    bool is_positional = false;
    const std::regex head(R"(  (?:-\w,)?(-?-?[\w-]+)( [^ ].*?)?(?:  +(.*))?)");
    for (const std::string& line : lines_of(text)) {
      if (line.empty()) is_positional = false;
      if (line == "Positionals:") is_positional = true;
      std::smatch parts;
      if (line.starts_with("    ") && !options.empty()) {
        const std::string more = line.substr(line.find_first_not_of(' '));
        options.back().description += (options.back().description.empty() ? "" : " ") + more;
      } else if ((is_positional || line.starts_with("  -")) &&
                 std::regex_match(line, parts, head)) {
        options.push_back({.name = parts[1],
                           .description = parts[3],
                           .is_required = parts[2].str().find("REQUIRED") != std::string::npos,
                           .is_positional = is_positional});
        const std::string type = parts[2];
        options.back().is_repeatable = type.find(" ...") != std::string::npos;
        options.back().type = type.substr(0, type.find_first_of("= ", 1)).erase(0, 1);
      } else if (line.empty() && !options.empty()) {
        options.push_back({.name = {}, .description = "-"});  // nothing goes on
      }
    }
    std::erase_if(options, [](const StatedOption& each) { return each.name.empty(); });
    return options;
  }

  // With those that the help names in a line, from their topics.
  std::vector<StatedOption> options_of(const std::string& command) {
    const std::string text = graybox(command + " --help").out;
    std::vector<StatedOption> options = options_in(text);
    const std::regex pointer(R"(\(in full: graybox (help \w+)\):\n)");
    for (std::sregex_iterator at(text.begin(), text.end(), pointer), end; at != end; ++at) {
      const std::string names = at->suffix().str().substr(0, at->suffix().str().find("\n\n"));
      for (const StatedOption& each : options_in(graybox((*at)[1]).out)) {
        if (states(names, each.name)) options.push_back(each);
      }
    }
    return options;
  }

  // The command with its positionals, and those required options that are not stated in `stated`.
  std::string with_what_it_needs(const std::string& command, const std::string& stated) {
    std::string line = command;
    for (const StatedOption& each : options_of(command)) {
      if (each.is_positional) line += " input";
      const bool is_missing = stated.find(each.name + " ") == std::string::npos;
      if (!each.is_positional && each.is_required && is_missing) {
        line += " " + each.name + " " + each.value();
      }
    }
    return line + " " + stated;
  }

  // Sources the script in a shell that is not interactive and asks for what follows these words.
  std::vector<std::string> completed(const std::string& words) {
    write_text(folder_.file("ask.bash"), "source ./graybox.bash\nCOMP_WORDS=(" + words +
                                             ")\nCOMP_CWORD=$((${#COMP_WORDS[@]} - 1))\n_graybox\n"
                                             "printf '%s\\n' \"${COMPREPLY[@]}\"\n");
    const std::string command =
        "cd '" + folder_.file("") + "' && bash --norc --noprofile ask.bash > replies 2> errors";
    EXPECT_EQ(std::system(command.c_str()), 0);
    EXPECT_EQ(read_text(folder_.file("errors")), "") << words;
    std::vector<std::string> replies = lines_of(read_text(folder_.file("replies")));
    std::erase(replies, "");
    return replies;
  }
};

TEST_F(FrontDoor, AloneItPrintsTheTasksWithACommandEach) {
  const Outcome outcome = graybox("");
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_EQ(outcome.err, "");
  const std::vector<std::string> commands = lines_after(outcome.out, "  graybox ");
  EXPECT_EQ(commands.size(), 8U);
  for (const std::string& command : commands) {
    // Well written, but in this folder there are no such files.
    const Outcome tried = graybox(command);
    EXPECT_EQ(tried.exit_code, 2) << command;
    EXPECT_EQ(tried.err.find("--help"), std::string::npos) << command << ": " << tried.err;
  }
}

TEST_F(FrontDoor, EveryHelpFitsAScreenAndHasAnExampleOfItsOwn) {
  const std::vector<std::string> commands = all_commands();
  EXPECT_GT(commands.size(), 35U);
  EXPECT_LE(rows_of(graybox("--help", "COLUMNS=80").out, 80), 50U);
  for (const std::string& command : commands) {
    const Outcome outcome = graybox(command + " --help", "COLUMNS=80");
    EXPECT_EQ(outcome.exit_code, 0) << command;
    EXPECT_LE(rows_of(outcome.out, 80), 50U) << command << ":\n" << outcome.out;
    const std::vector<std::string> examples = lines_after(outcome.out, "  graybox ");
    const auto is_own = [&](const std::string& example) { return example.starts_with(command); };
    EXPECT_TRUE(std::ranges::any_of(examples, is_own)) << command << ":\n" << outcome.out;
    for (const std::string& example : examples) {
      if (!is_own(example)) continue;
      std::istringstream words(example);
      for (std::string word; words >> word;) {
        const std::string option = word.substr(0, word.find('='));
        if (!option.starts_with("--") || example.substr(command.size()).find("  (") == 0) continue;
        const bool is_group = outcome.out.find("Subcommands:") != std::string::npos;
        const std::string described = outcome.out.substr(0, outcome.out.find("\nExample"));
        EXPECT_TRUE(is_group || states(described, option))
            << command << " has no option " << option << " of its example";
      }
    }
  }
}

// Beside the examples, which are there to be copied.
TEST_F(FrontDoor, HelpIsFoldedToTheTerminal) {
  const auto longest = [&](const std::string& command, const std::string& columns) {
    std::size_t size = 0;
    for (const std::string& line : lines_of(graybox(command, columns).out)) {
      if (line.starts_with("  graybox ") || line.starts_with("  scripts/")) continue;
      size = std::max(size, line.size());
    }
    return size;
  };
  std::vector<std::string> texts{"help", "help constraints", "help criteria"};
  for (const std::string& command : all_commands()) texts.push_back(command + " --help");
  for (const std::string& text : texts) {
    EXPECT_LE(longest(text, "COLUMNS=80"), 80U) << text;
    EXPECT_LE(longest(text, "COLUMNS=500"), 100U) << text;
  }
  EXPECT_GT(longest("solve --help", "COLUMNS=500"), 80U);
  // A file is no terminal.
  EXPECT_EQ(graybox("solve --help", "env -u COLUMNS").out,
            graybox("solve --help", "COLUMNS=80").out);
}

TEST_F(FrontDoor, TheHelpOfAllCommandsIsOrderedByTask) {
  const std::string help = graybox("--help").out;
  for (const std::string& task : lines_of(graybox("").out)) {
    if (!task.ends_with(':')) continue;
    EXPECT_NE(help.find("\n " + task + "\n"), std::string::npos) << task;
  }
  EXPECT_NE(help.find("\n  graybox diagnose "), std::string::npos);
}

TEST_F(FrontDoor, TopicsTellSharedOptionsInFull) {
  std::size_t named = 0;
  for (const std::string topic : {"constraints", "criteria"}) {
    const Outcome outcome = graybox("help " + topic, "COLUMNS=80");
    EXPECT_EQ(outcome.exit_code, 0);
    EXPECT_LE(rows_of(outcome.out, 80), 50U) << outcome.out;
    EXPECT_NE(graybox("help help").out.find("\n  " + topic + ' '), std::string::npos);
    for (const StatedOption& option : options_in(outcome.out)) {
      ++named;
      EXPECT_FALSE(option.description.empty()) << option.name;
      EXPECT_TRUE(states(graybox("solve --help").out, option.name)) << option.name;
    }
  }
  EXPECT_GT(named, 15U);
}

TEST_F(FrontDoor, BashCompletesCommandsOptionsWordsAndFiles) {
  using Replies = std::vector<std::string>;
  const Outcome script = graybox("completion bash");
  ASSERT_EQ(script.exit_code, 0);
  write_text(folder_.file("graybox.bash"), script.out);
  write_text(folder_.file("set.h5"), "");
  EXPECT_EQ(completed("graybox so"), (Replies{"solve", "solvers"}));
  EXPECT_EQ(completed("graybox design ro"), Replies{"robust"});
  EXPECT_EQ(completed("graybox help design ro"), Replies{"robust"});
  EXPECT_EQ(completed("graybox help con"), Replies{"constraints"});
  EXPECT_EQ(completed("graybox con"), Replies{});
  EXPECT_EQ(completed("graybox solve --cri"), Replies{"--criterion"});
  EXPECT_EQ(completed("graybox solve --p s"), Replies{});
  EXPECT_EQ(completed("graybox solve --solver column"), Replies{"column_generation"});
  EXPECT_EQ(completed("graybox solve --solver = column"), Replies{"column_generation"});
  EXPECT_EQ(completed("graybox solve s"), Replies{"set.h5"});
  EXPECT_EQ(completed("graybox solve set.h5 --trace s"), Replies{"set.h5"});
  EXPECT_EQ(completed("graybox solve --gap ''"), Replies{});
  EXPECT_EQ(completed("graybox export model.yaml --to ''"), (Replies{"c", "csv", "urdf"}));
  EXPECT_EQ(completed("graybox fit model.yaml campaign --lines l"), Replies{"local"});
  EXPECT_EQ(completed("graybox completion z"), Replies{"zsh"});
  // All commands and back-ends that there are.
  Replies names = commands_below("");
  EXPECT_EQ(completed("graybox ''"), names);
  const std::string solvers = graybox("solvers --json").out;
  const Replies completions = completed("graybox solve --solver ''");
  EXPECT_GT(completions.size(), 5U);
  for (const std::string& name : completions) {
    EXPECT_NE(solvers.find("\"name\":\"" + name + "\""), std::string::npos) << name;
  }
}

// What a refusal offers is what completion offers: "...choose a, b or c".
TEST_F(FrontDoor, CompletionOffersWhatTheRefusalOffers) {
  const Outcome script = graybox("completion bash");
  write_text(folder_.file("graybox.bash"), script.out);
  const std::pair<const char*, const char*> asked[] = {
      {"solve set.npy", "--criterion"},          {"check set.npy design.json", "--criterion"},
      {"exact set.npy", "--criterion"},          {"solve set.npy", "--format"},
      {"check set.npy design.json", "--format"}, {"exact set.npy", "--format"},
      {"design robust a.npy", "--objective"},    {"design robust a.npy", "--reference"},
      {"problem random -o a.h5", "--family"}};
  for (const auto& [command, option] : asked) {
    const std::string line = fmt::format("{} {} ", command, option);
    const Outcome refusal = graybox(line + "nonsense");
    EXPECT_EQ(refusal.exit_code, 2) << line;
    std::string offer = refusal.err.substr(refusal.err.find("nonsense") + 8);
    offer = std::regex_replace(offer, std::regex("\\([^)]*\\)|choose|one of| or "), " , ");
    std::set<std::string> offered;
    const std::regex word("[A-Za-z_0-9]+");
    for (std::sregex_iterator at(offer.begin(), offer.end(), word), end; at != end; ++at) {
      offered.insert(at->str());
    }
    const std::vector<std::string> replies = completed("graybox " + line + "''");
    EXPECT_EQ(std::set<std::string>(replies.begin(), replies.end()), offered) << refusal.err;
  }
}

TEST_F(FrontDoor, OtherShellsReadTheirScripts) {
  expect_refused("completion tcsh", "tcsh");
  for (const std::string shell : {"zsh", "fish"}) {
    const Outcome script = graybox("completion " + shell);
    ASSERT_EQ(script.exit_code, 0);
    write_text(folder_.file("script"), script.out);
    EXPECT_NE(script.out.find("column_generation"), std::string::npos);
    if (std::system((shell + " --version > /dev/null 2>&1").c_str()) != 0) continue;
    const std::string check = shell == "zsh" ? "zsh -n script" : "fish --no-execute script";
    EXPECT_EQ(std::system(("cd '" + folder_.file("") + "' && " + check).c_str()), 0) << shell;
    if (shell != "fish") continue;
    const std::string ask =
        "fish -c 'source script; complete -C \"graybox solve --solver column_g\"' > replies";
    EXPECT_EQ(std::system(("cd '" + folder_.file("") + "' && " + ask).c_str()), 0);
    EXPECT_TRUE(read_text(folder_.file("replies")).starts_with("column_generation"));
  }
}

// The table of docs/reference/exit_codes.md, each of its codes by a command that ends so.
TEST_F(FrontDoor, ExitCodesAreThoseOfTheirPage) {
  std::vector<std::string> codes;
  for (const std::string& line : lines_of(source_file("docs/reference/exit_codes.md"))) {
    std::smatch row;
    if (std::regex_match(line, row, std::regex(R"(\| (\d+) \|.*)"))) codes.push_back(row[1]);
  }
  EXPECT_EQ(codes, (std::vector<std::string>{"0", "1", "2", "130"}));
  EXPECT_EQ(
      graybox("problem regression --model polynomial --degree 1 --points 3 -o line.h5").exit_code,
      0);
  write_text(folder_.file("design.json"),
             R"({"format": "graybox-design/1", "status": "solved", "support": )"
             R"([{"index": 0, "weight": 0.5}, {"index": 1, "weight": 0.5}]})");
  EXPECT_EQ(graybox("check line.h5 design.json").exit_code, 1);
  expect_refused("check line.h5 missing.json", "missing.json");
  expect_refused("solve", "see graybox solve --help");
}

// A command that has nothing to hand over ends as any program does at Ctrl-C, but not without a
// word.
TEST_F(FrontDoor, CtrlCIsAnsweredInWords) {
  const Outcome outcome =
      graybox("problem robot --grid 4000000 -o big.h5",
              "timeout --foreground --preserve-status --signal=INT --kill-after=20 1");
  EXPECT_EQ(outcome.exit_code, 130);
  EXPECT_EQ(outcome.err, "graybox: interrupted\n");
  EXPECT_EQ(folder_.file_count(), 0U);
}

// What one has is a URDF and a log; a file of fields is asked for.
TEST_F(FrontDoor, UrdfAndTableAreToldWhatMakesAModelOfThem) {
  write_text(folder_.file("arm.urdf"), "<?xml version=\"1.0\"?>\n<robot name=\"arm\"/>\n");
  write_text(folder_.file("log.csv"), "t,speed\n0,1\n0.1,2\n");
  const Outcome urdf =
      graybox("diagnose arm.urdf '" GRAYBOX_SOURCE_DIR "/docs/examples/fit/drive'");
  EXPECT_EQ(urdf.exit_code, 2);
  EXPECT_NE(urdf.err.find("arm.urdf: is XML, as a URDF; 'graybox model arm.urdf LOG.csv'"),
            std::string::npos)
      << urdf.err;
  const Outcome table = graybox("recordings log.csv");
  EXPECT_EQ(table.exit_code, 2);
  EXPECT_NE(table.err.find("log.csv: is a table of data; 'graybox model log.csv'"),
            std::string::npos)
      << table.err;
}

TEST_F(FrontDoor, ColoursAreForTerminalsAlone) {
  ASSERT_EQ(graybox("problem random --family wis --candidates 3000 -o set.h5").exit_code, 0);
  const std::string drive = std::string(GRAYBOX_SOURCE_DIR) + "/docs/examples/fit/drive";
  const std::vector<std::string> commands{
      "solve set.h5 --solver multiplicative --time-limit 2 --gap 1e-14",
      "exact set.h5 -M 20 --time-limit 2",
      "diagnose " + drive + "/motor.yaml " + drive,
      "--help",
      "",
  };
  for (const std::string& command : commands) {
    const Outcome outcome = graybox(command);
    EXPECT_EQ((outcome.out + outcome.err).find('\033'), std::string::npos) << command;
    EXPECT_EQ((outcome.out + outcome.err).find('\r'), std::string::npos) << command;
  }
}

// Whatever a command writes, no second output replaces the first, and none an input: the help of
// each command says which options write.
TEST_F(FrontDoor, NoTwoOutputsAreOneFile) {
  std::filesystem::create_symlink("same", folder_.file("link"));
  std::size_t pairs = 0;
  for (const std::string& command : all_commands()) {
    const std::vector<StatedOption> options = options_of(command);
    for (const StatedOption& first : options) {
      for (const StatedOption& second : options) {
        if (&second <= &first || !first.writes() || !second.writes()) continue;
        ++pairs;
        const bool is_prefix = second.description.find("X_support.csv") != std::string::npos;
        const std::string a = is_prefix ? "same_support.csv" : "same";
        for (const std::string& b : {std::string("same"), std::string("./link")}) {
          if (is_prefix && b != "same") continue;
          const std::string line =
              with_what_it_needs(command, first.name + " " + a + " " + second.name + " " + b);
          expect_refused(line, "both write to it");
          const std::string named = graybox(line).err;  // in either order
          EXPECT_NE(named.find(first.name), std::string::npos) << named;
          EXPECT_NE(named.find(second.name), std::string::npos) << named;
        }
      }
    }
  }
  EXPECT_GT(pairs, 20U);
}

TEST_F(FrontDoor, NoOutputIsAnInput) {
  write_text(folder_.file("input"), "kept");
  std::filesystem::create_symlink("input", folder_.file("link"));
  std::size_t outputs = 0;
  for (const std::string& command : all_commands()) {
    const std::vector<StatedOption> options = options_of(command);
    if (std::ranges::none_of(options, &StatedOption::is_positional)) continue;
    for (const StatedOption& option : options) {
      // Folders and the beginnings of names are no files that exist.
      if (!option.writes() || option.description.find("X_support.csv") != std::string::npos) {
        continue;
      }
      ++outputs;
      expect_refused(with_what_it_needs(command, option.name + " ./link"),
                     "is an input of this command, too");
      EXPECT_EQ(read_text(folder_.file("input")), "kept");
    }
  }
  EXPECT_GT(outputs, 25U);
}

// --format '' is not --format left out: of any option of any command.
TEST_F(FrontDoor, EmptyValuesAreRefused) {
  std::size_t options = 0;
  for (const std::string& command : all_commands()) {
    for (const StatedOption& option : options_of(command)) {
      if (option.is_positional || option.type != "TEXT") continue;
      ++options;
      expect_refused(with_what_it_needs(command, option.name + " ''"), option.name);
    }
  }
  EXPECT_GT(options, 80U);
}

// An option that may be repeated takes one value each time: what stands behind it is an argument,
// and the command says the same as with the option at its end.
TEST_F(FrontDoor, RepeatableOptionsSwallowNoArgument) {
  std::size_t pairs = 0;
  for (const std::string& command : all_commands()) {
    std::string arguments;
    const std::vector<StatedOption> options = options_of(command);
    for (const StatedOption& each : options) arguments += each.is_positional ? " input" : "";
    if (arguments.empty()) continue;
    for (const StatedOption& option : options) {
      if (option.is_positional || !option.is_repeatable) continue;
      ++pairs;
      const std::string stated = " " + option.name + " " + option.value();
      // Twice: CLI11 leaves as many words at the end as there are arguments.
      const Outcome before = graybox(command + stated + arguments + stated),
                    behind = graybox(command + arguments + stated + stated);
      EXPECT_EQ(before.err, behind.err) << command << stated;
      EXPECT_EQ(before.exit_code, behind.exit_code) << command << stated;
    }
  }
  EXPECT_GT(pairs, 8U);
}

// Devices may be named as often as one likes.
TEST_F(FrontDoor, DevicesTakeSeveralOutputs) {
  ASSERT_EQ(graybox("problem regression --degree 1 --points 3 -o line.h5").exit_code, 0);
  EXPECT_EQ(graybox("solve line.h5 -o /dev/null --trace /dev/null --report /dev/null").exit_code,
            0);
}

// One version, wherever it stands.
TEST_F(FrontDoor, TheVersionIsThatOfTheChangelogAndTheCitation) {
  const std::string text = graybox("--version").out;
  std::smatch parts;
  ASSERT_TRUE(std::regex_match(
      text, parts, std::regex(R"(graybox (\d+\.\d+\.\d+) \(commit ([0-9a-f]{12}\+?|unknown)\)\n)")))
      << text;
  const std::string version = parts[1];
  const std::string changelog = source_file("CHANGELOG.md");
  const std::size_t first = changelog.find("\n## [", changelog.find("## [Unreleased]") + 1);
  EXPECT_EQ(changelog.substr(first + 5, version.size()), version);
  EXPECT_NE(source_file("CITATION.cff").find("\nversion: " + version + "\n"), std::string::npos);
}

}  // namespace
}  // namespace graybox
