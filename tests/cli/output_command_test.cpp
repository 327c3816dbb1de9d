// What the commands write, and what they leave alone.
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::built_executable;
using testing::Outcome;
using testing::read_text;
using testing::write_text;

const std::string kExamples = GRAYBOX_SOURCE_DIR "/docs/examples/";

constexpr const char* kPlan =
    "format: graybox-plan/1\nlevels: [2]\nrealisations: 2\nvalidation_realisations: 1\n"
    "period: 1000\nsettling_periods: 1\nperiods: 2\n"
    "frequencies: {from: 2, to: 80, count: 10, spacing: log}\n";

class OutputCommand : public testing::CommandRunner {
 protected:
  void SetUp() override {
    write_text(file("plan.yaml"), kPlan);
    write_text(file("csv_plan.yaml"), std::string(kPlan) + "data: csv\n");
    ASSERT_EQ(
        graybox("problem random --family rob --candidates 60 --dimension 6 -o set.h5").exit_code,
        0);
  }
  [[nodiscard]] std::string file(const std::string& name) const { return folder_.file(name); }

  Outcome simulate(const std::string& into, const std::string& plan = "plan.yaml") {
    return graybox("simulate " + kExamples + "simulate/drive.yaml " + plan + " -o " + into);
  }
  Outcome diagnose(const std::string& into) {
    return graybox("diagnose " + kExamples + "diagnose/rotor.yaml campaign --time-limit 20 -o " +
                   into);
  }
  void record_rotor() {
    ASSERT_EQ(graybox("simulate " + kExamples + "diagnose/rotor.yaml " + kExamples +
                      "diagnose/rotor_short_plan.yaml -o campaign")
                  .exit_code,
              0);
  }
  std::string study =
      "study --quick --solvers column_generation --max-candidates 50 "
      "--no-families -o ";

  // Exit code of the command with standard output elsewhere and files of at most so many bytes.
  int with_file_limit(const std::string& arguments, std::uintmax_t bytes) {
    const std::string command =
        "cd '" + file("") + "' && prlimit --fsize=" + std::to_string(bytes) + " '" +
        built_executable("bin/graybox") + "' " + arguments + " 2>&1 >/dev/null | cat > '" +
        logs_.file("err") + "'; exit ${PIPESTATUS[0]}";
    write_text(logs_.file("run.sh"), command + "\n");
    const int status = std::system(("bash '" + logs_.file("run.sh") + "'").c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  // The files below a folder that look like ones in the making.
  [[nodiscard]] std::size_t temporaries() const {
    std::size_t count = 0;
    for (const auto& entry : fs::recursive_directory_iterator(file(""))) {
      count += entry.path().filename().string().find(".graybox-") != std::string::npos ? 1U : 0U;
    }
    return count;
  }
};

struct Writer {
  std::string arguments;  // without -o
  std::string output;
};

std::vector<Writer> writers() {
  const std::string drive = kExamples + "fit/drive/";
  return {{"solve set.h5", "design.json"},
          {"solve set.h5 --trace trace.jsonl", "design.json"},
          {"exact set.h5 --experiments 8", "exact.json"},
          {"problem random --family rob --candidates 60 --dimension 6", "new.h5"},
          {"problem convert set.h5", "new.npy"},
          {"problem convert set.h5", "new.csv"},
          {"problem convert set.h5", "new.mat"},
          {"fit " + drive + "motor.yaml " + drive + "campaign.yaml", "fit.json"},
          {"responses " + kExamples + "responses/campaign.yaml", "responses.h5"},
          {"responses " + kExamples + "responses/campaign.yaml", "responses.csv"},
          {"recordings " + kExamples + "recordings/campaign.yaml", "recordings.json"}};
}

// Findings A1 and D2: whatever part of the file fits, the command says so, an older file stays, and
// nothing is left over.
TEST_F(OutputCommand, NoWriterTakesAFullDiskForSuccess) {
  for (const Writer& writer : writers()) {
    const std::string command = writer.arguments + " -o " + writer.output;
    const Outcome whole = graybox(command);
    ASSERT_LE(whole.exit_code, 1) << command << whole.err;
    const std::uintmax_t size = fs::file_size(file(writer.output));
    // Times that are printed in a file make it some digits shorter or longer.
    const std::uintmax_t nearly = size - std::min<std::uintmax_t>(size / 2, 64);
    for (const std::uintmax_t limit : {std::uintmax_t{0}, std::uintmax_t{1}, size / 2, nearly}) {
      write_text(logs_.file("old"), "old");
      fs::copy_file(logs_.file("old"), file(writer.output), fs::copy_options::overwrite_existing);
      EXPECT_EQ(with_file_limit(command, limit), 2) << command << ", limit " << limit;
      EXPECT_NE(read_text(logs_.file("err")).find("can't be written"), std::string::npos)
          << command << ", limit " << limit << ": " << read_text(logs_.file("err"));
      EXPECT_EQ(read_text(file(writer.output)), "old") << command << ", limit " << limit;
    }
    EXPECT_EQ(with_file_limit(command, 100 * size), whole.exit_code) << command;
    fs::remove(file(writer.output));
  }
  EXPECT_EQ(temporaries(), 0U);
}

// Finding A1, for folders.
TEST_F(OutputCommand, NoFolderOnAFullDiskIsTakenForSuccess) {
  record_rotor();
  const std::string drive = "simulate " + kExamples + "simulate/drive.yaml ";
  for (const std::string& command :
       {drive + "plan.yaml -o full", drive + "csv_plan.yaml -o full", study + "full",
        "diagnose " + kExamples + "diagnose/rotor.yaml campaign --time-limit 20 -o full"}) {
    for (const std::uintmax_t limit : {0U, 2000U}) {
      EXPECT_EQ(with_file_limit(command, limit), 2) << command << ", limit " << limit;
      EXPECT_NE(read_text(logs_.file("err")).find("can't be written"), std::string::npos)
          << command << ": " << read_text(logs_.file("err"));
      fs::remove_all(file("full"));
    }
  }
}

// Files of one answer belong together: where the disk is full at one of them, none of those of the
// answer before is touched.
TEST_F(OutputCommand, AFullDiskLeavesTheAnswerBeforeWhole) {
  const std::string rotor = kExamples + "diagnose/rotor.yaml";
  record_rotor();
  struct Answer {
    std::string command, folder;
    std::string full;  // the file that meets a full disk
  };
  const std::vector<Answer> answers{
      {"diagnose " + rotor + " campaign -o report", "report", "report.html"},
      {"design criteria set.h5 -o criteria", "criteria", "criteria_deviations.csv"},
      {"export " + rotor + " --to csv -o laws", "laws", "spring_motor.csv"},
      {study + "rows --resume", "rows/tables", "skipped.csv"}};
  for (const Answer& answer : answers) {
    ASSERT_LE(graybox(answer.command).exit_code, 1) << answer.command;
    const std::string full = file(answer.folder + "/" + answer.full);
    ASSERT_TRUE(fs::remove(full)) << full;
    fs::create_symlink("/dev/full", full);
    std::vector<std::string> others;
    for (const auto& entry : fs::recursive_directory_iterator(file(answer.folder))) {
      if (!entry.is_regular_file() || entry.is_symlink()) continue;
      if (entry.path().filename() == "verdict.json") continue;  // tells what is ours
      others.push_back(entry.path().string());
      write_text(others.back(), "the answer before");
    }
    ASSERT_FALSE(others.empty()) << answer.command;
    const Outcome outcome = graybox(answer.command);
    EXPECT_EQ(outcome.exit_code, 2) << answer.command << outcome.out;
    EXPECT_NE(outcome.err.find("can't be written"), std::string::npos) << outcome.err;
    for (const std::string& other : others) {
      EXPECT_EQ(read_text(other), "the answer before") << answer.command << ": " << other;
    }
    EXPECT_EQ(temporaries(), 0U) << answer.command;
  }
}

// Finding A2.
TEST_F(OutputCommand, WritesThroughDevicesPipesAndLinks) {
  EXPECT_EQ(graybox("solve set.h5 -o /dev/null").exit_code, 0);
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
  write_text(file("target.json"), "old");
  fs::create_symlink("target.json", file("link.json"));
  EXPECT_EQ(graybox("solve set.h5 -o link.json").exit_code, 0);
  EXPECT_TRUE(fs::is_symlink(file("link.json")));
  EXPECT_EQ(json::parse(read_text(file("target.json")))["format"], "graybox-design/1");
  // Into standard output, whether it is a pipe or a file: nothing of either text is lost.
  write_text(
      file("pipe.sh"),
      "'" + built_executable("bin/graybox") + "' solve set.h5 -o /dev/stdout | cat > piped\n'" +
          built_executable("bin/graybox") + "' solve set.h5 -o /dev/stdout > direct\n'" +
          built_executable("bin/graybox") + "' solve set.h5 -o >(cat > substituted) > out; wait\n");
  ASSERT_EQ(std::system(("cd '" + file("") + "' && bash pipe.sh && sleep 0.5").c_str()), 0);
  for (const char* name : {"piped", "direct"}) {
    const std::string text = read_text(file(name));
    EXPECT_NE(text.find("\"graybox-design/1\""), std::string::npos) << name << ": " << text;
    EXPECT_NE(text.find("wrote /dev/stdout"), std::string::npos) << name << ": " << text;
  }
  EXPECT_EQ(json::parse(read_text(file("substituted")))["format"], "graybox-design/1");
}

// Finding A6.
TEST_F(OutputCommand, NeverOverwritesAnInput) {
  ASSERT_EQ(simulate("campaign").exit_code, 0);
  ASSERT_EQ(graybox("solve set.h5 -o design.json").exit_code, 0);
  fs::create_hard_link(file("set.h5"), file("second_name.h5"));
  const std::string model = kExamples + "simulate/drive.yaml";
  fs::copy_file(model, file("model.yaml"));
  const std::vector<std::pair<std::string, std::string>> commands{
      {"solve set.h5 -o set.h5", "set.h5"},
      {"solve set.h5 -o ./campaign/../set.h5", "set.h5"},
      {"solve set.h5 -o second_name.h5", "set.h5"},
      {"solve set.h5 --trace set.h5", "set.h5"},
      {"problem convert set.h5 -o set.h5", "set.h5"},
      {"exact set.h5 --experiments 8 -o set.h5", "set.h5"},
      {"fit model.yaml campaign -o model.yaml", "model.yaml"},
      {"fit model.yaml campaign -o campaign/campaign.yaml", "campaign/campaign.yaml"},
      {"responses campaign -o campaign/p1_l1_r1_e1.h5", "campaign/p1_l1_r1_e1.h5"}};
  for (const auto& [arguments, input] : commands) {
    const std::string before = read_text(file(input));
    expect_refused(arguments, "is an input of this command, too");
    EXPECT_EQ(read_text(file(input)), before) << arguments;
  }
}

// The disk is full at the second of two files, or the first can't be kept: neither is there.
TEST_F(OutputCommand, WritesAllItsFilesOrNone) {
  const std::string drive = kExamples + "fit/drive/";
  for (const std::string& command :
       {std::string("solve set.h5 --report big -o "),
        std::string("solve set.h5 --floor A=0.5 "
                    "--trace /dev/full -o "),
        std::string("exact set.h5 --experiments 8 --report big -o "),
        std::string("exact set.h5 --experiments 8 --criterion A --report big -o "),
        std::string("solve set.h5 --budget 10 --trace trace.jsonl --report big -o "),
        "fit " + drive + "motor.yaml " + drive + "campaign.yaml --report big --write fitted -o "}) {
    EXPECT_EQ(with_file_limit(command + "small", 16'000), 2) << command;
    for (const char* name : {"small", "big", "fitted", "trace.jsonl"}) {
      EXPECT_FALSE(fs::exists(file(name))) << command << ": " << name;
    }
    EXPECT_EQ(temporaries(), 0U) << command;
  }
}

// Finding A7.
TEST_F(OutputCommand, TellsOfAFullStandardOutput) {
  for (const char* arguments :
       {"solve set.h5 --json > /dev/full 2>'", "solvers --json > /dev/full 2>'",
        "simulate --laws > /dev/full 2>'", "--help > /dev/full 2>'", "solvers >&- 2>'"}) {
    const std::string command = "cd '" + file("") + "' && '" + built_executable("bin/graybox") +
                                "' " + arguments + logs_.file("err") + "'";
    const int status = std::system(command.c_str());
    EXPECT_EQ(WEXITSTATUS(status), 1) << arguments;
    const std::string error = read_text(logs_.file("err"));
    EXPECT_EQ(error.find("graybox: standard output can't be written"), 0U) << arguments << error;
    EXPECT_EQ(std::ranges::count(error, '\n'), 1) << arguments << error;
  }
}

// Finding A3.
TEST_F(OutputCommand, DiagnoseTouchesOnlyWhatItsEarlierReportLists) {
  record_rotor();
  fs::create_directories(file("report/figures"));
  write_text(file("report/figures/thesis.svg"), "a");
  write_text(file("report/next_plan_mine.yaml"), "b");
  const Outcome outcome = diagnose("report");
  ASSERT_LE(outcome.exit_code, 1);
  // What is said to be written is what is.
  const std::string wrote = outcome.out.substr(outcome.out.find("wrote report/report.html"));
  // An earlier report of ours with more in it: the list says so.
  json verdict = json::parse(read_text(file("report/verdict.json")));
  ASSERT_TRUE(verdict["files"].is_array());
  for (const auto& name : verdict["files"]) {
    EXPECT_TRUE(fs::exists(file("report/" + name.get<std::string>()))) << name;
    const std::string said = name.get<std::string>().substr(0, name.get<std::string>().find('/'));
    EXPECT_NE(wrote.find(said), std::string::npos) << wrote;
  }
  verdict["files"].push_back("figures/law_9.svg");
  verdict["files"].push_back("../plan.yaml");
  write_text(file("report/verdict.json"), verdict.dump());
  write_text(file("report/figures/law_9.svg"), "ours");
  ASSERT_LE(diagnose("report").exit_code, 1);
  EXPECT_FALSE(fs::exists(file("report/figures/law_9.svg")));
  EXPECT_EQ(read_text(file("report/figures/thesis.svg")), "a");
  EXPECT_EQ(read_text(file("report/next_plan_mine.yaml")), "b");
  EXPECT_EQ(read_text(file("plan.yaml")), kPlan);
}

// Finding A3: the docs give the user's own --hidden file this name.
TEST_F(OutputCommand, DiagnoseRefusesAFolderWhoseFilesItWouldReplace) {
  record_rotor();
  fs::create_directories(file("mine"));
  write_text(file("mine/physics.yaml"), "c");
  expect_refused("diagnose " + kExamples + "diagnose/rotor.yaml campaign -o mine",
                 "mine: holds physics.yaml, which no earlier report here lists");
  EXPECT_EQ(read_text(file("mine/physics.yaml")), "c");
}

// Finding A4.
TEST_F(OutputCommand, StudyKeepsEarlierRowsUnlessAskedToDeleteThem) {
  ASSERT_EQ(graybox(study + "rows").exit_code, 0);
  const std::string rows = read_text(file("rows/rows.jsonl"));
  expect_refused(study + "rows", "rows: holds the rows of an earlier study; --resume");
  EXPECT_EQ(read_text(file("rows/rows.jsonl")), rows);
  ASSERT_EQ(graybox(study + "rows --resume").exit_code, 0);
  EXPECT_EQ(read_text(file("rows/rows.jsonl")).find(rows), 0U);
  ASSERT_EQ(graybox(study + "rows --fresh").exit_code, 0);
  EXPECT_NE(read_text(file("rows/rows.jsonl")).find(rows), 0U);
  expect_refused(study + "rows --fresh --resume", "--fresh");
}

// Finding A4.
TEST_F(OutputCommand, StudyRefusesAFolderOfOtherThings) {
  fs::create_directories(file("thesis"));
  write_text(file("thesis/summary.md"), "mine");
  expect_refused(study + "thesis", "thesis: is not empty and holds no study");
  EXPECT_EQ(read_text(file("thesis/summary.md")), "mine");
}

// Finding D1: what a killed run leaves never stops the same command.
TEST_F(OutputCommand, SimulateGoesOnInAFolderOfItsOwnLeftovers) {
  FILE* const ended = popen("sh -c 'echo $$'", "r");
  int process = 0;
  ASSERT_EQ(std::fscanf(ended, "%d", &process), 1);
  pclose(ended);
  fs::create_directory(file("campaign"));
  const std::string left =
      "campaign/.simulation.json.graybox-" + std::to_string(process) + "-Ab12Cd.tmp";
  write_text(file(left), "");
  write_text(file("campaign/simulation.json.Ab12Cd"), "");  // as releases before 0.1 left it
  EXPECT_EQ(simulate("campaign").exit_code, 0);
  EXPECT_FALSE(fs::exists(file(left)));
  fs::create_directory(file("mine"));
  write_text(file("mine/thesis.txt"), "");
  EXPECT_EQ(simulate("mine").exit_code, 2);
}

// Finding D6.
TEST_F(OutputCommand, TheLaterOfTwoRunsInAFolderIsToldSo) {
  for (const std::string& arguments :
       {"simulate " + kExamples + "simulate/drive.yaml plan.yaml -o busy", study + "busy"}) {
    const Outcome outcome = graybox(arguments, "mkdir -p busy && flock busy");
    EXPECT_EQ(outcome.exit_code, 2) << arguments;
    EXPECT_NE(outcome.err.find("busy: another graybox command is writing into this folder"),
              std::string::npos)
        << arguments << ": " << outcome.err;
    fs::remove_all(file("busy"));
  }
}

TEST_F(OutputCommand, DesignCriteriaMakesItsFolder) {
  EXPECT_EQ(graybox("design criteria set.h5 --repetitions 1 -o new/tables").exit_code, 0);
  EXPECT_TRUE(fs::exists(file("new/tables/criteria.csv")));
}

// Finding E3.
TEST_F(OutputCommand, AFailingExternalSolverGivesNoDesign) {
  for (const char* program : {"/bin/false", "/nonexistent", "true"}) {
    const Outcome outcome =
        graybox("solve set.h5 --solver external:" + std::string(program) + " -o none.json");
    EXPECT_EQ(outcome.exit_code, 1) << program;
    EXPECT_EQ(outcome.out.find("weight"), std::string::npos) << outcome.out;
    EXPECT_NE(outcome.out.find("there is no design, and nothing is written"), std::string::npos)
        << outcome.out;
    EXPECT_FALSE(fs::exists(file("none.json"))) << program;
  }
  const Outcome outcome = graybox("solve set.h5 --solver external:/nonexistent");
  EXPECT_NE(outcome.out.find("no such program: /nonexistent"), std::string::npos) << outcome.out;
}

// Finding E4.
TEST_F(OutputCommand, StatesVersionAndCommitEverywhere) {
  record_rotor();
  const Outcome version = graybox("--version");
  EXPECT_EQ(version.exit_code, 0);
  const std::string line = version.out.substr(0, version.out.find('\n'));
  EXPECT_EQ(line.find("graybox "), 0U) << line;
  EXPECT_NE(line.find(" (commit "), std::string::npos) << line;
  const std::string drive = kExamples + "fit/drive/";
  graybox("solve set.h5 -o design.json");
  graybox("exact set.h5 --experiments 8 -o exact.json");
  graybox("fit " + drive + "motor.yaml " + drive + "campaign.yaml -o fit.json");
  graybox("responses " + kExamples + "responses/campaign.yaml -o responses.h5");
  diagnose("report");
  graybox(study + "study");
  for (const char* name :
       {"design.json", "exact.json", "fit.json", "report/verdict.json", "report/report.html",
        "set.h5", "responses.h5", "campaign/simulation.json", "campaign/campaign.yaml",
        "campaign/p1_l1_r1_e1.h5", "study/rows.jsonl"}) {
    EXPECT_NE(read_text(file(name)).find(line), std::string::npos) << name;
  }
}

// Finding E4.
TEST_F(OutputCommand, HelpPrintsTheHelpOfACommand) {
  const Outcome all = graybox("help");
  EXPECT_EQ(all.exit_code, 0);
  EXPECT_NE(all.out.find("diagnose"), std::string::npos);
  EXPECT_EQ(all.out, graybox("--help").out);
  for (const std::string command : {"solve", "design robust"}) {
    const Outcome help = graybox("help " + command), option = graybox(command + " --help");
    EXPECT_EQ(help.exit_code, 0) << command;
    EXPECT_EQ(help.out, option.out) << command;
  }
  expect_refused("help frobnicate", "no command 'frobnicate'");
}

// A build of another commit and the same code is the same program for `study --resume`.
TEST_F(OutputCommand, TheCommitAloneMakesNoOtherProgram) {
  const std::string version = graybox("--version").out;
  const std::size_t start = version.find("(commit ") + 8;
  const std::string commit = version.substr(start, version.find(')') - start);
  if (commit == "unknown") GTEST_SKIP() << "built outside git";
  ASSERT_EQ(graybox(study + "rows").exit_code, 0);
  std::string bytes = read_text(built_executable("bin/graybox"));
  const std::size_t at = bytes.find(commit);
  ASSERT_NE(at, std::string::npos);
  bytes.replace(at, 12, "f00d5eed7e57");  // digits that stand nowhere else
  write_text(file("other"), bytes);
  fs::permissions(file("other"), fs::perms::owner_all);
  const std::string command =
      "cd '" + file("") + "' && ./other " + study + "rows --resume --json > json 2> err";
  ASSERT_EQ(std::system(command.c_str()), 0) << read_text(file("err"));
  EXPECT_EQ(json::parse(read_text(file("json")))["runs_made"], 0);
}

// Finding E7.
TEST_F(OutputCommand, ReadsSetsFromPipes) {
  ASSERT_EQ(graybox("problem convert set.h5 -o set.csv").exit_code, 0);
  const std::string program = "'" + built_executable("bin/graybox") + "' ";
  write_text(file("pipe.sh"), program + "solve <(cat set.csv) --json > a\n" +  //
                                  "cat set.h5 | " + program + "solve /dev/stdin --json > b\n" +
                                  program + "solve set.csv --json > c\n" + program +
                                  "solve <(echo 1,x,3) 2> err\n" + "echo $? > code\n");
  ASSERT_EQ(std::system(("cd '" + file("") + "' && bash pipe.sh").c_str()), 0);
  const json plain = json::parse(read_text(file("c")));
  for (const char* name : {"a", "b"}) {
    const std::string text = read_text(file(name));
    ASSERT_FALSE(text.empty()) << name;
    EXPECT_EQ(json::parse(text)["log_det"], plain["log_det"]) << name;
  }
  EXPECT_EQ(read_text(file("code")), "2\n");
  EXPECT_NE(read_text(file("err")).find("/dev/fd/"), std::string::npos) << read_text(file("err"));
}

}  // namespace
}  // namespace graybox
