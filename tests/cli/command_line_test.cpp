// The real binary, as users and scripts see it: round trips, exit codes, one clear line for every
// wrong input, and nothing written by halves.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "problems/base/random.hpp"
#include "problems/families/families.hpp"
#include "problems/formats/information_set_file.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/registry.hpp"
#include "solvers/report/design_file.hpp"
#include "tests/support/command_runner.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using testing::Outcome;
using testing::read_text;
using testing::TemporaryFolder;
using testing::write_text;
using Json = nlohmann::json;

class CommandLine : public testing::CommandRunner {
 protected:
  void make(const std::string& arguments) {
    const Outcome outcome = graybox("problem " + arguments);
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  }

  // The solver to test with; all of them have their own tests.
  static std::string solver() {
    const SolverRegistry registry = make_registry();
    std::string first;
    for (const auto& entry : registry.entries()) {
      if (entry.name == "column_generation") return entry.name;
      if (first.empty() && entry.solver != nullptr) first = entry.name;
    }
    return first;
  }
};

const std::vector<std::string> kReportKeys{"solver",         "status",       "duality_gap",
                                           "log_det",        "seconds",      "passes",
                                           "iterations",     "support_size", "peak_memory_bytes",
                                           "rounding_bound", "efficiency",   "problem_hash"};

// ---- round trips -------------------------------------------------------------------------------

TEST_F(CommandLine, ProblemSolveCheck) {
  make("random --family wis --candidates 300 --dimension 5 --seed 4 -o set.h5");
  const InformationSet set = read_information_set(folder_.file("set.h5"));
  EXPECT_EQ(set.content_hash(), make_family("wis", 300, 5, 4).content_hash());

  const Outcome solved =
      graybox("solve set.h5 --solver " + solver() + " --gap 1e-8 --json -o design.json");
  ASSERT_EQ(solved.exit_code, 0) << solved.err;
  EXPECT_EQ(solved.err, "");
  EXPECT_EQ(std::ranges::count(solved.out, '\n'), 1);
  const Json report = Json::parse(solved.out);
  for (const std::string& key : kReportKeys) EXPECT_TRUE(report.contains(key)) << key;
  EXPECT_EQ(report["status"], "solved");
  EXPECT_EQ(report["problem_hash"], set.content_hash());

  // The printed gap is that of the design written, by our own checker in this process.
  const DesignFile design = read_design(folder_.file("design.json"), set);
  const Certificate certificate = certify(set, design.design);
  EXPECT_EQ(report["duality_gap"].get<double>(), certificate.duality_gap);
  EXPECT_LE(certificate.duality_gap, 1e-8 + certificate.rounding_bound);
  EXPECT_EQ(report["support_size"].get<std::size_t>(), certificate.support_size);

  const Outcome checked = graybox("check set.h5 design.json --json");
  EXPECT_EQ(checked.exit_code, 0) << checked.err;
  const Json judged = Json::parse(checked.out);
  for (const std::string& key : kReportKeys) EXPECT_TRUE(judged.contains(key)) << key;
  EXPECT_EQ(judged["duality_gap"], report["duality_gap"]);
  EXPECT_EQ(judged["solver"], solver());
}

TEST_F(CommandLine, EveryFormatIsSolvedToTheSameDesign) {
  make("random --family rob --candidates 200 --dimension 4 -o set.h5");
  const std::string solve = " --solver " + solver() + " --json -o design.json";
  const Json first = Json::parse(graybox("solve set.h5" + solve).out);
  for (const std::string extension : {"npy", "csv", "mat"}) {
    make("convert set.h5 -o copy." + extension);
    const Outcome outcome = graybox("solve copy." + extension + solve);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    const Json report = Json::parse(outcome.out);
    EXPECT_EQ(report["problem_hash"], first["problem_hash"]) << extension;
    EXPECT_EQ(report["log_det"], first["log_det"]) << extension;
    EXPECT_EQ(graybox("check set.h5 design.json").exit_code, 0) << extension;
  }
}

TEST_F(CommandLine, SubsetsAreNestedAndKeepCoordinates) {
  make("random --family smo --candidates 100 --dimension 3 -o set.h5");
  make("subset set.h5 --candidates 40 --seed 6 -o large.h5");
  make("subset set.h5 --candidates 15 --seed 6 -o small.h5");
  const InformationSet large = read_information_set(folder_.file("large.h5"));
  const InformationSet small = read_information_set(folder_.file("small.h5"));
  ASSERT_EQ(small.candidate_count(), 15U);
  for (std::size_t i = 0; i < 15; ++i) {
    EXPECT_TRUE(std::ranges::equal(small.information(i), large.information(i)));
    EXPECT_TRUE(std::ranges::equal(small.coordinates(i), large.coordinates(i)));
  }
}

TEST_F(CommandLine, RegressionProblemsHaveTheirKnownOptimum) {
  make("regression --model factorial --factors 4 --interactions 2 -o factorial.h5");
  make("regression --model polynomial --degree 2 --points 101 --basis legendre -o polynomial.h5");
  make("regression --model cube --levels 3 -o cube.h5");
  const auto log_det = [&](const std::string& set) {
    const Outcome outcome = graybox("solve " + set + " --gap 1e-9 --json --solver " + solver());
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return Json::parse(outcome.out)["log_det"].get<double>();
  };
  EXPECT_NEAR(log_det("factorial.h5"), 0.0, 1e-7);
  // 1/3 on -1, 0, 1: det of the monomial form is 4/27; P_2 = (3 x^2 - 1)/2 multiplies it by 9/4.
  EXPECT_NEAR(log_det("polynomial.h5"), std::log(1.0 / 3.0), 1e-7);
  EXPECT_NEAR(log_det("cube.h5"), 4.0 * std::log(4.0 / 27.0), 1e-7);
}

TEST_F(CommandLine, RobotPositionsFromACountAndAFile) {
  make("robot --grid 30 -o robot.h5");
  const InformationSet robot = read_information_set(folder_.file("robot.h5"));
  EXPECT_EQ(robot.candidate_count(), 30U);
  ASSERT_EQ(robot.candidates().names.size(), 6U);
  // The same positions from a file give the same matrices.
  std::string positions = "q1,q2,q3,q4,q5,q6\n";
  for (std::size_t i = 0; i < 30; ++i) {
    for (std::size_t k = 0; k < 6; ++k) {
      positions += std::to_string(robot.coordinates(i)[k]) + (k < 5 ? "," : "\n");
    }
  }
  write_text(folder_.file("positions.csv"), positions);
  make("robot --grid positions.csv --threads 2 -o same.h5");
  EXPECT_EQ(read_information_set(folder_.file("same.h5")).content_hash(), robot.content_hash());
  expect_refused("problem robot --grid nothere.csv -o x.h5", "nothere.csv");
  expect_refused("problem robot --grid 0 -o x.h5", "--grid 0: ");
  expect_refused("problem robot --model nothere.yaml -o x.h5", "nothere.yaml");
}

TEST_F(CommandLine, TheTraceIsJsonLinesWithFallingCost) {
  make("random --family wis --candidates 200 --dimension 4 -o set.h5");
  const Outcome outcome =
      graybox("solve set.h5 --gap 1e-7 --trace trace.jsonl --solver " + solver());
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  std::istringstream lines(read_text(folder_.file("trace.jsonl")));
  double seconds = 0.0;
  std::size_t count = 0;
  for (std::string line; std::getline(lines, line); ++count) {
    const Json point = Json::parse(line);
    EXPECT_GE(point["seconds"].get<double>(), seconds);
    seconds = point["seconds"];
    EXPECT_TRUE(point.contains("passes") && point.contains("duality_gap"));
  }
  EXPECT_GT(count, 0U);
}

// ---- numerical outcomes: exit code 1 -----------------------------------------------------------

TEST_F(CommandLine, CheckJudgesAnybodysDesign) {
  make("regression --model polynomial --degree 1 --points 3 -o line.h5");
  const auto check = [&](const std::string& support) {
    write_text(folder_.file("design.json"),
               R"({"format": "graybox-design/1", "status": "solved", "support": )" + support + "}");
    const Outcome outcome = graybox("check line.h5 design.json --gap 1e-9 --json");
    return std::pair(outcome.exit_code, Json::parse(outcome.out));
  };
  const auto good = check(R"([{"index": 0, "weight": 0.5}, {"index": 2, "weight": 0.5}])");
  EXPECT_EQ(good.first, 0);
  EXPECT_EQ(good.second["status"], "solved");
  // Weight 1/2 on -1 and 0: M = [1 -1/2; -1/2 1/2], the sensitivity at 1 is 10, the gap 4.
  const auto poor = check(R"([{"index": 0, "weight": 0.5}, {"index": 1, "weight": 0.5}])");
  EXPECT_EQ(poor.first, 1);
  EXPECT_EQ(poor.second["status"], "claimed_but_wrong");
  EXPECT_NEAR(poor.second["duality_gap"].get<double>(), 4.0, 1e-12);
  const auto singular = check(R"([{"index": 0, "weight": 1}])");
  EXPECT_EQ(singular.first, 1);
  EXPECT_TRUE(singular.second["duality_gap"].is_null());
  const auto short_of_one = check(R"([{"index": 0, "weight": 0.5}, {"index": 2, "weight": 0.4}])");
  EXPECT_EQ(short_of_one.first, 1);
  EXPECT_NE(short_of_one.second["message"].get<std::string>().find("sum to 0.9"),
            std::string::npos);
}

TEST_F(CommandLine, ALimitLeavesADesignAndExitCodeOne) {
  make("random --family wis --candidates 2000 --dimension 6 -o set.h5");
  const Outcome outcome = graybox(
      "solve set.h5 --solver multiplicative --iteration-limit 3 --gap 1e-9 --json -o design.json");
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_EQ(Json::parse(outcome.out)["status"], "iteration_limit");
  const InformationSet set = read_information_set(folder_.file("set.h5"));
  EXPECT_EQ(read_design(folder_.file("design.json"), set).status, "iteration_limit");
}

TEST_F(CommandLine, CtrlCKeepsTheBestDesign) {
  make("random --family smo --candidates 5000 -o set.h5");
  const Outcome outcome = graybox(
      "solve set.h5 --solver multiplicative --gap 1e-15 --time-limit 60 --json -o design.json",
      "timeout --foreground --preserve-status --signal=INT 2");
  ASSERT_EQ(outcome.exit_code, 1) << outcome.err;
  const Json report = Json::parse(outcome.out);
  EXPECT_EQ(report["status"], "time_limit");
  EXPECT_NE(report["message"].get<std::string>().find("interrupted"), std::string::npos);
  const InformationSet set = read_information_set(folder_.file("set.h5"));
  EXPECT_EQ(certify(set, read_design(folder_.file("design.json"), set).design).status,
            CertificateStatus::kCertified);
}

// ---- wrong input: exit code 2 ------------------------------------------------------------------

TEST_F(CommandLine, WrongUsageIsOneLine) {
  expect_refused("problem", "subcommand");
  expect_refused("frobnicate", "unknown command 'frobnicate'; choose one of solve, design, exact");
  expect_refused("problem nonsense -o x.h5", "unknown command 'nonsense'");
  expect_refused("solve", "set is required; see graybox solve --help");
  expect_refused("solve set.h5 --frobnicate", "--frobnicate");
  expect_refused("solve set.h5 --gap small", "small");
  expect_refused("problem random --family wis", "--output is required");
  expect_refused("problem random --family nonsense -o x.h5", "choose one of rob, wis");
  expect_refused("problem random --family wis --candidates 0 -o x.h5", "--candidates");
  expect_refused("problem random --family cube3 --candidates 9 -o x.h5", "2187");
  expect_refused("problem random --family wis --candidates 20 -o x.xyz", "names no known format");
  expect_refused("problem random --family wis --candidates 20 -o nowhere/x.h5", "nowhere/x.h5");
  expect_refused("problem regression --model polynomial --degree 5 --points 4 -o x.h5",
                 "6 distinct");
  expect_refused("problem regression --model nonsense -o x.h5", "--model");
}

TEST_F(CommandLine, WrongFilesAreOneLine) {
  make("random --family wis --candidates 30 --dimension 3 -o set.h5");
  make("random --family wis --candidates 30 --dimension 3 --seed 2 -o other.h5");
  ASSERT_EQ(graybox("solve other.h5 -o other.json --solver " + solver()).exit_code, 0);
  write_text(folder_.file("bad.csv"), "1,2,3\n4,5,x\n");
  write_text(folder_.file("indefinite.csv"), "1,0,1\n1,2,1\n");
  write_text(folder_.file("singular.csv"), "1,0,0\n2,0,0\n");
  write_text(folder_.file("bad.json"), "{");
  write_text(folder_.file("huge.json"), R"({"support": [{"index": 0, "weight": 1E1000}]})");
  const std::string by = " -o x.json --solver " + solver();
  expect_refused("solve nothere.h5" + by, "nothere.h5: can't be opened");
  expect_refused("solve bad.csv" + by, "bad.csv: line 2, column 3");
  expect_refused("solve indefinite.csv" + by,
                 "candidate 1: the information matrix is not positive");
  expect_refused("solve singular.csv" + by, "singular");
  expect_refused("solve set.h5 --gap 0" + by, "--gap: 0 must be a positive number");
  expect_refused("solve set.h5 --time-limit -1" + by, "time limit");
  expect_refused("solve set.h5 --threads 0" + by, "--threads: 0 must be a whole number");
  expect_refused("solve set.h5 -o x.json --solver nonsense", "unknown solver 'nonsense'");
  expect_refused("solve set.h5 --variable Hi" + by, ".mat files only");
  expect_refused("check set.h5 other.json", "another problem");
  expect_refused("check set.h5 bad.json", "not valid JSON");
  expect_refused("check set.h5 huge.json", "huge.json: support[0].weight: the number 1E1000 is");
  expect_refused("check set.h5 nothere.json", "nothere.json: can't be opened");
  expect_refused("problem subset set.h5 --candidates 31 -o x.h5", "subset of 31");
}

// Finding E1.
TEST_F(CommandLine, InfiniteGapsNegativeSeedsAndHordesOfThreadsAreRefused) {
  make("random --family wis --candidates 30 --dimension 3 -o set.h5");
  for (const char* command : {"solve set.h5", "exact set.h5 -M 5", "design criteria set.h5"}) {
    const std::string text(command);
    expect_refused(text + " --gap inf", "--gap: inf must be a positive number");
    expect_refused(text + " --gap nan", "--gap: nan must be a positive number");
    expect_refused(text + " --threads 100000", "from 1 to 1024");
  }
  expect_refused("solve set.h5 --seed -1", "--seed: -1 must be a whole number from 0 on");
  expect_refused("exact set.h5 -M 5 --seed -1", "--seed: -1 must be a whole number from 0 on");
  expect_refused("simulate set.yaml plan.yaml --seed -1", "--seed: -1 must be");
  expect_refused("problem robot --threads 1025 -o x.h5", "from 1 to 1024");
}

// Finding E2.
TEST_F(CommandLine, AGapBelowRoundingIsANumericalFailureNotAWrongClaim) {
  make("random --family wis --candidates 40 --dimension 3 -o set.h5");
  const SolverRegistry registry = make_registry();
  for (const auto& entry : registry.entries()) {
    if (entry.solver == nullptr) continue;
    const Outcome outcome =
        graybox("solve set.h5 --gap 1e-300 --iteration-limit 300 --json --solver " + entry.name);
    EXPECT_EQ(outcome.exit_code, 1) << entry.name;
    const std::string status = Json::parse(outcome.out)["status"];
    EXPECT_TRUE(status == "numerical_failure" || status == "iteration_limit")
        << entry.name << ": " << status;
  }
}

// ---- sets that are nearly semidefinite ----------------------------------------------------------

// Lower triangles of v v^T for a few vectors, in single precision: eigenvalues of about -1e-8.
std::string single_precision_set(double sign = 1.0) {
  std::string text;
  Random random(11);
  for (int i = 0; i < 12; ++i) {
    double v[4];
    for (double& x : v) x = random.normal();
    for (int a = 0; a < 4; ++a) {
      for (int b = 0; b <= a; ++b) {
        const auto entry = static_cast<float>(sign * v[a] * v[b]);
        text += fmt::format("{}{}", a + b == 0 ? "" : ",", static_cast<double>(entry));
      }
    }
    text += "\n";
  }
  return text;
}

// Finding S3.
TEST_F(CommandLine, SetsInSinglePrecisionAreSolvedAndWhatWasChangedIsSaid) {
  write_text(folder_.file("single.csv"), single_precision_set());
  const Outcome text = graybox("solve single.csv -o design.json");
  EXPECT_EQ(text.exit_code, 0) << text.err;
  EXPECT_NE(text.out.find("made positive semidefinite"), std::string::npos) << text.out;
  const Json line = Json::parse(graybox("solve single.csv --json").out);
  EXPECT_GT(line["semidefinite_projection"]["candidates"], 0);
  EXPECT_LT(line["semidefinite_projection"]["smallest_eigenvalue"], -1e-9);
  EXPECT_GT(line["semidefinite_projection"]["smallest_eigenvalue"], -1e-6);
  EXPECT_EQ(graybox("check single.csv design.json").exit_code, 0);  // the same problem
  EXPECT_EQ(graybox("exact single.csv -M 6").exit_code, 0);
}

// Finding S3.
TEST_F(CommandLine, ThePsdToleranceDecidesHowFarFromSemidefiniteASetMayBe) {
  write_text(folder_.file("single.csv"), single_precision_set());
  write_text(folder_.file("negative.csv"), single_precision_set(-1.0));
  expect_refused("solve single.csv --psd-tolerance 1e-9", "accept it with --psd-tolerance");
  expect_refused("solve negative.csv", "is not positive semidefinite");
  expect_refused("solve negative.csv --psd-tolerance 1e-2", "is not positive semidefinite");
  expect_refused("solve single.csv --psd-tolerance 0.5", "--psd-tolerance 0.5 must be from");
}

// ---- what it says ------------------------------------------------------------------------------

TEST_F(CommandLine, SolversAreListed) {
  const Outcome outcome = graybox("solvers --json");
  EXPECT_EQ(outcome.exit_code, 0);
  const Json list = Json::parse(outcome.out);
  const SolverRegistry registry = make_registry();
  ASSERT_EQ(list.size(), registry.entries().size());
  for (std::size_t i = 0; i < list.size(); ++i) {
    EXPECT_EQ(list[i]["name"], registry.entries()[i].name);
    EXPECT_EQ(list[i]["available"].get<bool>(), registry.entries()[i].solver != nullptr);
    EXPECT_EQ(list[i]["available"].get<bool>(), list[i]["reason"].get<std::string>().empty());
    EXPECT_FALSE(list[i]["description"].get<std::string>().empty());
  }
  const Outcome plain = graybox("solvers");
  for (const auto& entry : registry.entries()) {
    EXPECT_NE(plain.out.find(entry.name), std::string::npos);
  }
}

TEST_F(CommandLine, HelpHasExamples) {
  for (const std::string command :
       {"", "problem robot", "problem random", "problem regression", "problem subset",
        "problem convert", "solvers", "solve", "check"}) {
    const Outcome outcome = graybox(command + " --help");
    EXPECT_EQ(outcome.exit_code, 0) << command;
    EXPECT_NE(outcome.out.find("Example"), std::string::npos) << command;
    EXPECT_NE(outcome.out.find("  graybox " + command), std::string::npos) << command;
  }
}

TEST_F(CommandLine, SolveTellsPeopleWhereTheWeightStands) {
  make("regression --model polynomial --degree 1 --points 3 -o line.h5");
  const Outcome outcome = graybox("solve line.h5 -o design.json --solver " + solver());
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  for (const char* part :
       {"solved", "duality gap", "D-efficiency", "0.5000", "wrote design.json"}) {
    EXPECT_NE(outcome.out.find(part), std::string::npos) << outcome.out;
  }
}

}  // namespace
}  // namespace graybox
