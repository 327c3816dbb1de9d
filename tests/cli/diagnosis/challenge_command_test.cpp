// `graybox challenge`: from a seed to a score with a diagnosis that is a script, resumed, on any
// number of threads, and one clear line for wrong input.
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

namespace fs = std::filesystem;
using testing::Outcome;
using testing::read_text;
using testing::write_text;

// Says of every case that nothing is missing, and notes what it was given.
constexpr const char* kDiagnosis = R"(#!/bin/sh
test -f "$1" && test -f "$2/campaign.yaml" || exit 2
{ pwd; env | sort; echo "$@"; } > "$4/given.txt"
cat ../../truth/index.json ../case_002/model.yaml > "$4/peeped.txt"
echo '{"format": "graybox-verdict/1", "mismatch": {"detected": false}, "verdict": "none",' > "$4/v"
echo '"physics": [], "fit": {"after": {"validation": {"chi_square_per_dof": 1.0}}}}' >> "$4/v"
mv "$4/v" "$4/verdict.json"
)";

class ChallengeCommand : public testing::CommandRunner {
 protected:
  ChallengeCommand() {
    write_text(folder_.file("diagnosis.sh"), kDiagnosis);
    fs::permissions(folder_.file("diagnosis.sh"), fs::perms::owner_all);
  }

  Outcome make(const std::string& suffix, const std::string& more = {}) {
    return graybox("challenge make --seed 3 --cases 2 --family one_mass -o cases" + suffix +
                   " --truth truth" + suffix + " " + more);
  }
  Outcome run(const std::string& more = {}) {
    return graybox("challenge run cases -o answers --command '" + folder_.file("diagnosis.sh") +
                   "' " + more);
  }

  // Every file below a folder, with its contents.
  [[nodiscard]] std::map<std::string, std::string> contents(const std::string& folder) const {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(folder_.file(folder))) {
      if (!entry.is_regular_file()) continue;
      files[fs::relative(entry.path(), folder_.file(folder))] = read_text(entry.path());
    }
    return files;
  }
};

TEST_F(ChallengeCommand, MakesRunsAndScores) {
  ASSERT_EQ(make("").exit_code, 0);
  // The number of threads and an interruption change nothing.
  ASSERT_EQ(make("_2", "--threads 2").exit_code, 0);
  EXPECT_EQ(contents("cases"), contents("cases_2"));
  EXPECT_EQ(contents("truth"), contents("truth_2"));
  const auto before = contents("cases");
  fs::remove_all(folder_.file("cases/case_002"));
  fs::remove(folder_.file("truth/case_001.json"));
  ASSERT_EQ(make("").exit_code, 0);
  EXPECT_EQ(contents("cases"), before);
  for (const auto& entry : fs::recursive_directory_iterator(folder_.file("cases"))) {
    EXPECT_EQ(entry.last_write_time(), fs::last_write_time(folder_.file("cases"))) << entry.path();
  }
  for (const auto& [name, text] : before) {
    EXPECT_EQ(text.find("seed"), std::string::npos) << name;
  }

  ASSERT_EQ(run("--threads 2").exit_code, 0);
  const std::string given = read_text(folder_.file("answers/case_001/given.txt"));
  EXPECT_NE(given.find("/cases/case_001\n"), std::string::npos) << given;
  EXPECT_EQ(given.find("truth"), std::string::npos) << given;
  EXPECT_EQ(given.find("HOME="), std::string::npos) << given;
  // Where the system can forbid it, the process opens neither the truth nor another case.
  if (nlohmann::json::parse(read_text(folder_.file("answers/case_001/run.json")))["confined"]) {
    EXPECT_EQ(read_text(folder_.file("answers/case_001/peeped.txt")), "");
  }
  const auto again = nlohmann::json::parse(run("--json").out);
  EXPECT_EQ(again["already_there"], 2);

  const Outcome scored = graybox("challenge score cases answers --truth truth --json -o tables");
  ASSERT_EQ(scored.exit_code, 0) << scored.err;
  const auto score = nlohmann::json::parse(scored.out);
  EXPECT_EQ(score["rates"]["answered"]["hits"], 2);
  EXPECT_EQ(score["rates"]["false_alarms"]["hits"], 0);
  EXPECT_EQ(score["rates"]["detectable_named"]["hits"], 0);
  for (const char* table : {"cases", "rates", "confusion", "sizes", "classes"}) {
    EXPECT_TRUE(fs::exists(folder_.file("tables/challenge_" + std::string(table) + ".csv")));
  }
  EXPECT_NE(graybox("challenge score cases answers --truth truth").out.find("false_alarms"),
            std::string::npos);

  // A broken seal, another challenge's truth or answers, a seed that is no commit's.
  expect_refused("challenge score cases answers --truth truth --history h.csv", "--seed commit");
  expect_refused("challenge run cases -o answers --command false", "another challenge, command");
  expect_refused("challenge make --seed 4 --cases 2 -o cases --truth truth", "another challenge");
  write_text(folder_.file("truth/case_001.json"),
             read_text(folder_.file("truth/case_001.json")) + "\n");
  expect_refused("challenge score cases answers --truth truth", "changed after it was sealed");
  write_text(folder_.file("truth/index.json"), "{}");
  expect_refused("challenge score cases answers --truth truth", "not the truth that was sealed");
}

// Two machines in closed loop: the same on any number of threads, diagnosed by this program, scored
// with the name of their set.
TEST_F(ChallengeCommand, MakesRunsAndScoresInAnyMotion) {
  const std::string make =
      "challenge make --set any_motion --seed 4 --cases 2 --family "
      "axis_tachometer ";
  ASSERT_EQ(graybox(make + "-o cases --truth truth").exit_code, 0);
  ASSERT_EQ(graybox(make + "-o cases_2 --truth truth_2 --threads 2").exit_code, 0);
  EXPECT_EQ(contents("cases"), contents("cases_2"));
  EXPECT_EQ(contents("truth"), contents("truth_2"));
  const auto header = nlohmann::json::parse(read_text(folder_.file("cases/challenge.json")));
  EXPECT_EQ(header["set"], "any_motion");
  for (const auto& [name, text] : contents("cases")) {
    EXPECT_EQ(text.find("seed"), std::string::npos) << name;
    EXPECT_EQ(text.find("controller"), std::string::npos) << name;
  }
  ASSERT_EQ(graybox("challenge run cases -o answers --threads 2").exit_code, 0);
  const Outcome scored = graybox("challenge score cases answers --truth truth --json -o tables");
  ASSERT_EQ(scored.exit_code, 0) << scored.err;
  const auto score = nlohmann::json::parse(scored.out);
  EXPECT_EQ(score["set"], "any_motion");
  EXPECT_EQ(score["rates"]["answered"]["hits"], 2);
  EXPECT_NE(read_text(folder_.file("tables/challenge_rates.csv")).find("\nany_motion,answered,"),
            std::string::npos);
  EXPECT_TRUE(fs::exists(folder_.file("tables/challenge_any_motion_refusal.csv")));
}

// A handful of cases by the program's own diagnosis, and once more without the laws that it named:
// what was named then is not named now, and no answer is both wrong and sure.
TEST_F(ChallengeCommand, DiagnosesAHandfulAndAgainWithoutTheLawsItNamed) {
  const std::string cases = "challenge make --seed 20 --cases 6 --family oscillator --threads 2 ";
  ASSERT_EQ(graybox(cases + "-o cases --truth truth").exit_code, 0);
  const std::string run = "challenge run cases --threads 2 --json ";
  ASSERT_EQ(graybox(run + "-o answers").exit_code, 0);
  ASSERT_EQ(graybox(run + "-o without --without-named answers").exit_code, 0);
  std::size_t named = 0;
  for (int number = 1; number <= 6; ++number) {
    const std::string file = "/case_00" + std::to_string(number) + "/verdict.json";
    const auto first = nlohmann::json::parse(read_text(folder_.file("answers" + file)));
    if (first["physics"].empty()) continue;
    ++named;
    const auto again = nlohmann::json::parse(read_text(folder_.file("without" + file)));
    std::set<std::string> laws;
    for (const auto& effect : first["physics"]) laws.insert(effect["law"].get<std::string>());
    for (const auto& effect : again["physics"]) {
      EXPECT_FALSE(laws.contains(effect["law"].get<std::string>())) << effect["law"];
    }
  }
  EXPECT_GE(named, 2U);
  const auto score = nlohmann::json::parse(
      graybox("challenge score cases answers --truth truth --left-out without --json -o tables")
          .out);
  const auto& rates = score["rates"];
  EXPECT_EQ(rates["answered"]["hits"], 6);
  EXPECT_EQ(rates["detectable_detected"]["hits"], rates["detectable_detected"]["of"]);
  EXPECT_GE(rates["detectable_named"]["hits"], 1);
  EXPECT_EQ(rates["wrong_and_confident"]["hits"], 0);
  EXPECT_GE(rates["left_out_honest"]["of"], 1);
  EXPECT_EQ(rates["left_out_honest"]["hits"], rates["left_out_honest"]["of"]);
  EXPECT_TRUE(fs::exists(folder_.file("tables/challenge_left_out.csv")));
}

TEST_F(ChallengeCommand, CountsCasesWithoutVerdict) {
  ASSERT_EQ(make("").exit_code, 0);
  const Outcome outcome = graybox("challenge run cases -o answers --command false --json");
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_EQ(nlohmann::json::parse(outcome.out)["failed"], 2);
  write_text(folder_.file("slow.sh"), "#!/bin/sh\nsleep 60\n");
  fs::permissions(folder_.file("slow.sh"), fs::perms::owner_all);
  const Outcome slow = graybox("challenge run cases -o slow --command '" + folder_.file("slow.sh") +
                               "' --time-limit 0.2 --threads 3 --json");
  EXPECT_EQ(nlohmann::json::parse(slow.out)["failed"], 2) << slow.err;
  const auto score =
      nlohmann::json::parse(graybox("challenge score cases answers --truth truth --json").out);
  EXPECT_EQ(score["rates"]["answered"]["hits"], 0);
  EXPECT_EQ(score["not_run"], 0);  // run, without an answer
}

// A run that is still going, or was killed, is no run of all cases.
TEST_F(ChallengeCommand, SaysWhichCasesHaveNotBeenRun) {
  ASSERT_EQ(make("").exit_code, 0);
  ASSERT_EQ(graybox("challenge run cases -o answers --command false --json").exit_code, 1);
  fs::remove(folder_.file("answers/case_002/run.json"));
  const Outcome text = graybox("challenge score cases answers --truth truth");
  EXPECT_EQ(text.exit_code, 0);
  EXPECT_NE(text.out.find("1 of them have not been run to their end"), std::string::npos);
  const Outcome json = graybox("challenge score cases answers --truth truth --json");
  EXPECT_EQ(nlohmann::json::parse(json.out)["not_run"], 1);
}

TEST_F(ChallengeCommand, RefusesBadInput) {
  expect_refused("challenge make --seed x -o c --truth t", "whole number or 'commit'");
  expect_refused("challenge make --seed 1 -o c", "--truth");
  expect_refused("challenge make --seed 1 -o c --truth c/t", "must not lie in each other");
  expect_refused("challenge make --seed 1 -o c --truth t --family cars", "--family");
  expect_refused("challenge make --seed 1 -o c --truth t --set cars", "--set");
  expect_refused("challenge make --seed 1 -o c --truth t --set any_motion --family robot",
                 "the set any_motion has axis_encoder");
  expect_refused("challenge make --seed 1 -o c --truth t --quick --cases 3", "--cases");
  expect_refused("challenge make --seed 1 -o . --truth t", "not lie in each other");
  expect_refused("challenge make --seed commit -o c --truth t", "all is committed");
  expect_refused("challenge run nowhere -o a", "no folder of challenge cases");
  expect_refused("challenge run nowhere -o a --threads 0", "--threads");
  expect_refused("challenge score nowhere a --truth t", "no folder of challenge cases");
  expect_refused("challenge", "subcommand");
}

}  // namespace
}  // namespace graybox
