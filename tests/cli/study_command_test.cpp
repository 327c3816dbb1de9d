// `graybox study` on sets and with solvers that a user brings.
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::Outcome;
using testing::read_text;
using testing::write_text;

class StudyCommand : public testing::CommandRunner {
 protected:
  void SetUp() override {
    make_set("rob", 60, 4, "a.h5");
    make_set("wis", 70, 3, "b.npy");
  }
  [[nodiscard]] std::string file(const std::string& name) const { return folder_.file(name); }

  void make_set(const std::string& family, int candidates, int dimension, const std::string& name) {
    ASSERT_EQ(graybox("problem random --family " + family + " --candidates " +
                      std::to_string(candidates) + " --dimension " + std::to_string(dimension) +
                      " -o " + name)
                  .exit_code,
              0);
  }

  // The run rows of a study.
  [[nodiscard]] std::vector<json> runs(const std::string& folder) const {
    std::ifstream stream(file(folder + "/rows.jsonl"));
    std::vector<json> rows;
    for (std::string line; std::getline(stream, line);) {
      json row = json::parse(line);
      if (row["kind"] == "run") rows.push_back(std::move(row));
    }
    return rows;
  }

  const std::string study_ = "study --quick --solvers column_generation,cocktail ";
};

TEST_F(StudyCommand, RunsOnOwnSetsAlone) {
  const Outcome outcome = graybox(study_ + "--sets a.h5 b.npy -o results");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  std::set<std::string> solvers, sets;
  for (const json& row : runs("results")) {
    EXPECT_EQ(row["experiment"], "own");
    EXPECT_EQ(row["status"], "solved");
    EXPECT_EQ(row["set"]["path"], fs::path(file(row["family"])).lexically_normal().string());
    EXPECT_NE(outcome.out.find("| " + row["family"].get<std::string>() + " | " +
                               row["candidates"].dump() + " | " + row["dimension"].dump() + " | " +
                               row["problem"].get<std::string>() + " |"),
              std::string::npos)
        << outcome.out;
    solvers.insert(row["solver"]);
    sets.insert(row["family"]);
  }
  EXPECT_EQ(solvers, (std::set<std::string>{"cocktail", "column_generation"}));
  EXPECT_EQ(sets, (std::set<std::string>{"a.h5", "b.npy"}));
  const std::string profile = read_text(file("results/tables/profile_instances.csv"));
  EXPECT_NE(profile.find("a.h5/60,cocktail,"), std::string::npos) << profile;
  EXPECT_NE(profile.find("b.npy/70,column_generation,"), std::string::npos) << profile;
}

TEST_F(StudyCommand, TakesTheSetsOfAFolder) {
  fs::create_directories(file("mine/deeper"));
  fs::rename(file("a.h5"), file("mine/a.h5"));
  fs::rename(file("b.npy"), file("mine/b.npy"));
  write_text(file("mine/readme.txt"), "Two sets.\n");
  ASSERT_EQ(graybox(study_ + "--instances mine -o results").exit_code, 0);
  std::set<std::string> sets;
  for (const json& row : runs("results")) sets.insert(row["family"]);
  EXPECT_EQ(sets, (std::set<std::string>{"mine/a.h5", "mine/b.npy"}));
}

TEST_F(StudyCommand, RefusesSetsBeforeAnythingRuns) {
  ASSERT_EQ(graybox("problem convert a.h5 -o copy.csv").exit_code, 0);
  write_text(file("broken.npy"), "no array");
  write_text(file("indefinite.csv"), "1,0,-1\n1,0,1\n");
  fs::create_directory(file("empty"));
  expect_refused(study_ + "--sets a.h5 b.npy a.h5 -o results", "a.h5: is given twice");
  expect_refused(study_ + "--sets a.h5 b.npy copy.csv -o results",
                 "copy.csv: holds the same set as a.h5");
  expect_refused(study_ + "--sets a.h5 broken.npy -o results", "broken.npy");
  expect_refused(study_ + "--sets a.h5 indefinite.csv -o results", "indefinite.csv");
  expect_refused(study_ + "--sets a.h5 none.npy -o results", "none.npy");
  expect_refused(study_ + "--instances empty -o results", "empty: holds no information set");
  expect_refused(study_ + "--instances none -o results", "none: can't be read as a folder");
  expect_refused(study_ + "--sets a.h5 --max-candidates 50 -o results", "--max-candidates");
}

// The program writes the uniform design, which is certain to have a finite gap on these sets.
std::string uniform_program(int candidates) {
  std::string support;
  for (int i = 0; i < candidates; ++i) {
    support += std::string(i == 0 ? "" : ", ") + "{\"index\": " + std::to_string(i) +
               ", \"weight\": " + std::to_string(1.0 / candidates) + "}";
  }
  return "#!/bin/sh\n# arguments: WORDS, problem.h5, design.json, GAP, SECONDS\n"
         "test \"$1\" = one,two || exit 3\ncat > \"$3\" << 'end'\n"
         "{\"format\": \"graybox-design/1\", \"status\": \"iteration_limit\", \"support\": [" +
         support + "]}\nend\n";
}

TEST_F(StudyCommand, NamesProgramsWhoseCommandsMayHoldCommas) {
  make_set("rob", 50, 2, "c.npy");
  write_text(file("uniform.sh"), uniform_program(50));
  const std::string command = study_ + "--sets c.npy -o results --solver-name ";
  const std::string mine = "'mine=external:sh uniform.sh one,two' ";
  ASSERT_EQ(graybox(command + mine + "--solver-name 'other=external:sh uniform.sh one'").exit_code,
            0);
  std::map<std::string, json> of;
  for (const json& row : runs("results")) of[row["solver"]] = row;
  ASSERT_EQ(of.size(), 4U);
  EXPECT_EQ(of["mine"]["status"], "iteration_limit") << of["mine"];
  EXPECT_EQ(of["mine"]["command"], "sh uniform.sh one,two");
  EXPECT_EQ(of["mine"]["support_size"], 50);
  EXPECT_EQ(of["other"]["message"], "ended with exit code 3");
  EXPECT_FALSE(of["cocktail"].contains("command"));
}

// The program states a second of its own, reaches a gap early by its own word, and misses the
// simplex by a millionth.
TEST_F(StudyCommand, ShowsWhatAProgramSaysOfItsRunBesideWhatWasMeasured) {
  write_text(file("two.csv"), "1,0,0\n0,0,1\n");
  write_text(
      file("mine.sh"),
      "echo '{\"format\": \"graybox-design/1\", \"seconds\": 0.000001, \"trace\": [[1e-7, 0.05], "
      "[1e-6, 1e-7]], \"support\": [{\"index\": 0, \"weight\": 0.5}, {\"index\": 1, "
      "\"weight\": 0.5000002}]}' > \"$2\"\n");
  const Outcome outcome =
      graybox(study_ + "--sets two.csv -o results --solver-name 'mine=external:sh mine.sh'");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("(1e-06 by its own clock)"), std::string::npos) << outcome.out;
  for (const json& row : runs("results")) {
    if (row["solver"] != "mine") {
      EXPECT_FALSE(row.contains("stated_seconds"));
      continue;
    }
    EXPECT_EQ(row["status"], "solved");
    EXPECT_EQ(row["stated_seconds"], 1e-6);
    EXPECT_GT(row["seconds"], 1e-4);  // a shell was started
    EXPECT_NEAR(row["repair"]["rescaled"].get<double>(), 2e-7, 1e-15);
    EXPECT_LT(row["duality_gap"], 3e-7);
    EXPECT_GT(row["reached"]["1e-6"][0], 1e-4);  // measured, too
    EXPECT_EQ(row.contains("stated_trace"), row["repetition"] == 0);
  }
  const std::string own = read_text(file("results/tables/own_clock.csv"));
  EXPECT_NE(own.find("own,two.csv,2,mine,1e-06,1e-1,1e-07\n"), std::string::npos) << own;
  EXPECT_NE(own.find("own,two.csv,2,mine,1e-06,1e-6,1e-06\n"), std::string::npos) << own;
  const Outcome solved = graybox("solve two.csv --solver 'external:sh mine.sh' --json");
  const json line = json::parse(solved.out);
  EXPECT_EQ(line["stated_seconds"], 1e-6);
  EXPECT_NEAR(line["repair"]["rescaled"].get<double>(), 2e-7, 1e-15);
}

TEST_F(StudyCommand, ResumesWhatIsTheSameAndRunsAgainWhatIsNot) {
  write_text(file("mine.sh"), uniform_program(60));
  const std::string command = study_ + "--sets a.h5 b.npy -o results --json --solver-name ";
  const json first = json::parse(graybox(command + "'mine=external:sh mine.sh one,two'").out);
  const json again =
      json::parse(graybox(command + "'mine=external:sh mine.sh one,two' --resume").out);
  EXPECT_EQ(again["runs_made"], 0);
  EXPECT_EQ(again["runs_found"], first["runs_made"]);

  // Another command by the same name: its two points, and nothing else.
  const json renamed =
      json::parse(graybox(command + "'mine=external:sh mine.sh one,two more' --resume").out);
  EXPECT_EQ(renamed["runs_made"], 2);
  for (const json& row : runs("results")) {
    EXPECT_TRUE(row["solver"] != "mine" || row["command"] == "sh mine.sh one,two more") << row;
  }

  // The same command, after an edit of the program that it names.
  write_text(file("mine.sh"), uniform_program(60) + "# changed\n");
  const json edited =
      json::parse(graybox(command + "'mine=external:sh mine.sh one,two more' --resume").out);
  EXPECT_EQ(edited["runs_made"], 2);
  EXPECT_EQ(edited["runs"], first["runs_made"]);

  // Another set by the same name.
  make_set("wis", 90, 3, "b.npy");
  ASSERT_EQ(graybox(command + "'mine=external:sh mine.sh one,two more' --resume").exit_code, 0);
  std::set<std::string> hashes;
  for (const json& row : runs("results")) {
    if (row["family"] == "b.npy") hashes.insert(row["problem"]);
    EXPECT_TRUE(row["family"] != "b.npy" || row["candidates"] == 90) << row;
  }
  EXPECT_EQ(hashes.size(), 1U);
}

// Every generator of the study makes its set again; multiplicative leaves many weights.
TEST_F(StudyCommand, VerifiesTheRowsOfAStudy) {
  ASSERT_EQ(graybox("study --quick --max-candidates 50 --solvers column_generation,multiplicative "
                    "-o results")
                .exit_code,
            0);
  const Outcome outcome = graybox("study verify results/rows.jsonl");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out;
  const std::size_t count = runs("results").size();
  EXPECT_EQ(outcome.out, std::to_string(count) + " rows verified, 0 false\n");
  EXPECT_EQ(json::parse(graybox("study verify results --json").out)["verified"], count);
  expect_refused("study verify none.jsonl", "none.jsonl");
}

TEST_F(StudyCommand, SaysWhichSolversAreNotHere) {
  const std::string words = study_ + "--sets a.h5 -o results ";
  ASSERT_EQ(graybox(words + "--absent 'mosek=CVXPY with MOSEK and its licence'").exit_code, 0);
  const std::string needs = "CVXPY with MOSEK and its licence";
  EXPECT_NE(read_text(file("results/summary.md")).find("| mosek | " + needs), std::string::npos);
  EXPECT_NE(read_text(file("results/index.html")).find(needs), std::string::npos);
  for (const char* wrong : {"mosek", "=needs", "mosek="}) {
    expect_refused(words + "--resume --absent " + wrong, "expected LABEL=WHAT IT NEEDS");
  }
}

TEST_F(StudyCommand, FindsADamagedWeightASideFileAndAChangedSet) {
  make_set("flat", 200, 3, "b.npy");  // nearly equal candidates keep nearly equal weights
  ASSERT_EQ(
      graybox("study --quick --solvers multiplicative,column_generation --gap 0.01 --sets a.h5 "
              "b.npy -o results")
          .exit_code,
      0);
  ASSERT_EQ(graybox("study verify results").exit_code, 0);
  ASSERT_TRUE(fs::exists(file("results/designs")));

  const std::string rows = read_text(file("results/rows.jsonl"));
  const std::size_t at = rows.find("\"support\":[[");
  const std::size_t weight = rows.find(',', at) + 1;
  write_text(file("results/damaged.jsonl"),
             rows.substr(0, weight) + "0.01" + rows.substr(rows.find(']', weight)));
  const Outcome damaged = graybox("study verify results/damaged.jsonl");
  EXPECT_EQ(damaged.exit_code, 1);
  EXPECT_NE(damaged.out.find(": states a gap of "), std::string::npos) << damaged.out;
  EXPECT_NE(damaged.out.find(", 1 false\n"), std::string::npos) << damaged.out;

  const std::string side = fs::directory_iterator(file("results/designs"))->path().string();
  const std::string bytes = read_text(side);
  write_text(side, bytes.substr(0, bytes.size() - 1) + "@");
  const Outcome changed = graybox("study verify results");
  EXPECT_EQ(changed.exit_code, 1);
  EXPECT_NE(changed.out.find("does not have the hash"), std::string::npos) << changed.out;
  write_text(side, bytes);
  ASSERT_EQ(graybox("study verify results").exit_code, 0);

  make_set("flat", 200, 3, "b.npy");
  ASSERT_EQ(graybox("study verify results").exit_code, 0);  // the same set again
  make_set("rob", 200, 3, "b.npy");
  const Outcome moved = graybox("study verify results");
  EXPECT_EQ(moved.exit_code, 1);
  EXPECT_NE(moved.out.find("b.npy Q = 200: is now another set"), std::string::npos) << moved.out;
}

TEST_F(StudyCommand, SaysThatRowsOfEarlierReleasesCanNotBeVerified) {
  ASSERT_EQ(graybox(study_ + "--sets a.h5 -o results").exit_code, 0);
  std::string old;
  for (json row : runs("results")) {
    row.erase("design");
    old += row.dump() + "\n";
  }
  write_text(file("old.jsonl"), old);
  const Outcome outcome = graybox("study verify old.jsonl");
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_EQ(outcome.out, "0 rows verified, 0 false; " + std::to_string(runs("results").size()) +
                             " not verifiable: rows of an earlier release hold no designs\n");
}

TEST_F(StudyCommand, RefusesNamesThatAreNone) {
  const std::string command = study_ + "--sets a.h5 -o results --solver-name ";
  expect_refused(command + "mine", "--solver-name 'mine': expected LABEL=external:CMD");
  expect_refused(command + "mine=cocktail", "expected LABEL=external:CMD");
  expect_refused(command + "'my solver=external:true'", "expected LABEL=external:CMD");
  expect_refused(command + "cocktail=external:true", "--solver-name cocktail: is taken");
  expect_refused(command + "a=external:true --solver-name a=external:false",
                 "--solver-name a: is taken");
  expect_refused(command + "a=external:", "names no program");
}

}  // namespace
}  // namespace graybox
