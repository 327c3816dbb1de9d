// graybox solve, check, solvers and design criteria with --criterion: what users see.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "problems/formats/information_set_file.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/report/design_file.hpp"
#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

using testing::Outcome;
using testing::read_text;
using testing::write_text;
using Json = nlohmann::json;

class CriterionCommand : public testing::CommandRunner {
 protected:
  // 1, x, x^2 on 41 points of [-1, 1]; the parameters are x^0, x^1, x^2.
  void make_set() {
    ASSERT_EQ(graybox("problem regression --model polynomial --degree 2 --points 41 "
                      "--basis monomial -o set.h5")
                  .exit_code,
              0);
  }
};

TEST_F(CriterionCommand, SolveAndCheckEachCriterion) {
  make_set();
  write_text(folder_.file("W.csv"), "# slope and curvature\n1,0,0\n0,2,0.5\n0,0.5,1\n");
  write_text(folder_.file("c.csv"), "1,2,4\n");
  struct Case {
    std::string options, name;
    double value;  // NaN: not known in closed form
  };
  const double unknown = std::nan("");
  for (const Case& one :
       std::vector<Case>{{"--criterion D", "D", std::log(4.0 / 27.0)},
                         {"--criterion A", "A", 8.0},
                         {"--criterion E", "E", 0.2},
                         {"--criterion L --weights W.csv", "L", unknown},
                         {"--criterion L --weights c.csv", "L", 49.0},
                         {"--criterion L --weights 0=1,1=1,2=1", "L", 8.0},
                         {"--criterion Ds --interest 2", "Ds", std::log(0.25)},
                         {"--criterion c --combination 'x^2=1'", "c", 4.0},
                         {"--criterion c --combination '0=1,1=2,2=4'", "c", 49.0},
                         {"--criterion c --combination '0=1;1=1;2=1'", "c", 8.0},
                         {"--criterion c --combination c.csv", "c", 49.0},
                         {"--criterion I", "I", unknown},
                         {"--criterion I --region c.csv", "I", 49.0},
                         {"--criterion I --region set.h5", "I", unknown},
                         {"--criterion G", "G", 3.0},
                         {"--criterion phi_p --p 1", "phi_p", 8.0 / 3},
                         {"--criterion phi_p --p 0", "D", std::log(4.0 / 27.0)},
                         {"--criterion phi_p --p inf", "E", 0.2},
                         {"--criterion phi_p --p 0.5", "phi_p", unknown},
                         {"--criterion A=2", "compound", -std::log(8.0)},
                         {"--criterion D=1,Ds=3 --interest 2", "compound", unknown},
                         {"--criterion Ds --interest 'x^1, 2'", "Ds", unknown}}) {
    SCOPED_TRACE(one.options);
    const Outcome solved = graybox("solve set.h5 --gap 1e-8 --json -o design.json " + one.options);
    ASSERT_EQ(solved.exit_code, 0) << solved.err;
    const Json report = Json::parse(solved.out);
    EXPECT_EQ(report["criterion"], one.name);
    EXPECT_LE(report["duality_gap"].get<double>(), 1.1e-8);
    if (!std::isnan(one.value)) {
      EXPECT_NEAR(report["criterion_value"].get<double>(), one.value, 1e-6);
    }
    // The file says what it is for: check needs no option, and finds the same.
    const Outcome checked = graybox("check set.h5 design.json --json");
    EXPECT_EQ(checked.exit_code, 0) << checked.err << checked.out;
    const Json judged = Json::parse(checked.out);
    EXPECT_EQ(judged["criterion"], one.name);
    EXPECT_NEAR(judged["duality_gap"].get<double>(), report["duality_gap"].get<double>(), 1e-13);
    EXPECT_NE(graybox("solve set.h5 " + one.options).out.find("-efficiency"), std::string::npos);
  }
}

TEST_F(CriterionCommand, ADesignIsJudgedUnderAnotherCriterion) {
  make_set();
  ASSERT_EQ(graybox("solve set.h5 -o design.json").exit_code, 0);
  const Outcome outcome = graybox("check set.h5 design.json --criterion A --json");
  EXPECT_EQ(outcome.exit_code, 1);
  const Json report = Json::parse(outcome.out);
  EXPECT_EQ(report["status"], "inaccurate");                        // no claim was made for A
  EXPECT_NEAR(report["criterion_value"].get<double>(), 9.0, 1e-4);  // weights 1/3: tr M^-1 = 9
  EXPECT_LE(report["efficiency"].get<double>(), 8.0 / 9.0 + 1e-9);
}

// A claim of solved does not help: neither does another dual matrix or another criterion's name.
TEST_F(CriterionCommand, AForgedDesignIsFoundOut) {
  make_set();
  ASSERT_EQ(graybox("solve set.h5 --criterion E --gap 1e-8 -o design.json").exit_code, 0);
  Json file = Json::parse(read_text(folder_.file("design.json")));
  EXPECT_EQ(file["criterion"]["name"], "E");
  ASSERT_EQ(file["dual_matrix"].size(), 6U);
  const auto check = [&](const Json& forged) {
    write_text(folder_.file("forged.json"), forged.dump());
    return graybox("check set.h5 forged.json --json");
  };
  Json forged = file;
  forged["dual_matrix"] = {1, 0, -5, 0, 0, 1};
  EXPECT_EQ(check(forged).exit_code, 1);
  EXPECT_EQ(Json::parse(check(forged).out)["status"], "claimed_but_wrong");
  forged = file;
  forged.erase("dual_matrix");  // found again by the checker
  EXPECT_EQ(check(forged).exit_code, 0);
  forged["criterion"] = {{"name", "A"}};
  EXPECT_EQ(check(forged).exit_code, 1);
}

TEST_F(CriterionCommand, FloorsAreKeptAndChecked) {
  make_set();
  const Outcome solved = graybox("solve set.h5 --floor A=0.95 --json -o design.json");
  ASSERT_EQ(solved.exit_code, 0) << solved.err << solved.out;
  const Json report = Json::parse(solved.out);
  EXPECT_EQ(report["criterion"], "D");
  EXPECT_GE(report["floors"][0]["efficiency"].get<double>(), 0.95);
  EXPECT_GT(report["floors"][0]["multiplier"].get<double>(), 0.0);
  // D's own design is A-efficient to 8/9: the mean of 1/4, 1/2, 1/4 and thirds.
  const double value = report["criterion_value"].get<double>();
  EXPECT_LT(value, std::log(4.0 / 27.0) - 1e-4);
  const Outcome checked = graybox("check set.h5 design.json --json");
  EXPECT_EQ(checked.exit_code, 0) << checked.out;
  EXPECT_NEAR(Json::parse(checked.out)["criterion_value"].get<double>(), value, 1e-12);
  // A floor that D's own design keeps costs nothing.
  const Json free = Json::parse(graybox("solve set.h5 --floor A=0.5,I=0.5 --json").out);
  EXPECT_NEAR(free["criterion_value"].get<double>(), std::log(4.0 / 27.0), 1e-5);
  // A file that claims a higher floor than it keeps, or another multiplier, is found out.
  Json forged = Json::parse(read_text(folder_.file("design.json")));
  forged["floors"][0]["share"] = 0.99;
  write_text(folder_.file("forged.json"), forged.dump());
  const Outcome found = graybox("check set.h5 forged.json --json");
  EXPECT_EQ(found.exit_code, 1);
  EXPECT_NE(Json::parse(found.out)["message"].get<std::string>().find("less than the floor"),
            std::string::npos);
  forged["floors"][0]["share"] = 0.95;
  forged["floors"][0]["multiplier"] = 0.0;
  write_text(folder_.file("forged.json"), forged.dump());
  EXPECT_EQ(graybox("check set.h5 forged.json").exit_code, 1);
  for (const char* const sharp : {"E", "G"}) {
    const Outcome kept =
        graybox(fmt::format("solve set.h5 --floor {}=0.95 --json -o sharp.json", sharp));
    ASSERT_EQ(kept.exit_code, 0) << sharp << kept.err << kept.out;
    EXPECT_GE(Json::parse(kept.out)["floors"][0]["efficiency"].get<double>(), 0.95) << sharp;
    EXPECT_EQ(graybox("check set.h5 sharp.json").exit_code, 0) << sharp;
  }
  expect_refused("solve set.h5 --floor E=0.99,G=0.99", "contradict");
  expect_refused("solve set.h5 --floor A=1.5", "between 0 and 1");
  expect_refused("solve set.h5 --floor A", "'A' is no criterion=share");
  expect_refused("solve set.h5 --floor A=0.9 --stock 1 --experiments 3",
                 "--floor can't be combined");
  expect_refused("solve set.h5 --floor A=0.9 --solver multiplicative",
                 "floors; use column_generation");
  expect_refused("solve set.h5 --floor Ds=0.9", "needs --interest");
}

TEST_F(CriterionCommand, RivalModelsAreToldApart) {
  std::string truth = "y\n", constant = "level\n", line = "level,slope\n",
              shifted = "b,prediction\n";
  for (int k = -20; k <= 20; ++k) {
    const double x = k / 20.0;
    truth += std::to_string(1.0 + x + x * x) + "\n";
    constant += "1\n";
    line += "1," + std::to_string(x) + "\n";
    shifted += std::to_string(x) + ",1\n";
  }
  for (const auto& [name, text] : {std::pair{"truth.csv", truth},
                                   {"constant.csv", constant},
                                   {"line.csv", line},
                                   {"shifted.csv", shifted}}) {
    write_text(folder_.file(name), text);
  }
  const Outcome one = graybox("design discriminate truth.csv constant.csv --noise 0.1 --json");
  ASSERT_EQ(one.exit_code, 0) << one.err;
  EXPECT_NEAR(Json::parse(one.out)["rivals"][0]["misfit"].get<double>(), 126.5625, 1e-3);
  const Outcome two = graybox(
      "design discriminate truth.csv constant.csv line.csv --json --set both.h5 -o design.json");
  ASSERT_EQ(two.exit_code, 0) << two.err << two.out;
  EXPECT_NEAR(Json::parse(two.out)["rivals"][1]["misfit"].get<double>(), 0.25, 1e-5);
  EXPECT_EQ(graybox("check both.h5 design.json").exit_code, 0);
  const Outcome relative =
      graybox("design discriminate truth.csv constant.csv shifted.csv --relative --json");
  ASSERT_EQ(relative.exit_code, 0) << relative.err << relative.out;
  for (const Json& rival : Json::parse(relative.out)["rivals"]) {
    EXPECT_LE(rival["efficiency"].get<double>(), 1.0 + 1e-5);
    EXPECT_GT(rival["efficiency"].get<double>(), 0.3);
  }
  expect_refused("design discriminate line.csv constant.csv", "line.csv: 2 columns");
  expect_refused("design discriminate constant.csv line.csv", "no experiment tells them apart");
  write_text(folder_.file("short.csv"), "a\n1\n1\n");
  expect_refused("design discriminate truth.csv short.csv", "short.csv: 2 candidates");
}

TEST_F(CriterionCommand, WrongInputIsOneLine) {
  make_set();
  write_text(folder_.file("small.csv"), "1,0\n0,1\n");
  write_text(folder_.file("ragged.csv"), "1,0,0\n0,1\n0,0,1\n");
  write_text(folder_.file("words.csv"), "1,0,0\n0,one,0\n0,0,1\n");
  write_text(folder_.file("skew.csv"), "1,0,0\n1,1,0\n0,0,1\n");
  write_text(folder_.file("indefinite.csv"), "1,2,0\n2,1,0\n0,0,1\n");
  expect_refused("solve set.h5 --criterion Q", "unknown criterion 'Q'; choose D, A, E, L, Ds, c");
  expect_refused("solve set.h5 --criterion c", "needs --combination");
  expect_refused("solve set.h5 --criterion c --combination nobody=1", "unknown parameter 'nobody'");
  expect_refused("solve set.h5 --criterion c --combination '0=1;'", "'' is no name=factor");
  expect_refused("solve set.h5 --criterion c --combination small.csv", "line 1 has 2 numbers");
  expect_refused("solve set.h5 --criterion phi_p", "needs --p");
  expect_refused("solve set.h5 --criterion phi_p --p -1", "p is -1");
  expect_refused("solve set.h5 --criterion phi_p --p x", "'x' is no number");
  expect_refused("solve set.h5 --criterion I --region small.csv", "line 1 has 2 numbers");
  expect_refused("solve set.h5 --criterion G --region missing.h5", "missing.h5");
  expect_refused("solve set.h5 --region set.h5", "--region belongs to --criterion I or G");
  expect_refused("solve set.h5 --criterion E=1,E=1", "E stands there twice");
  expect_refused("solve set.h5 --criterion D=1,A", "'A' is no criterion=share");
  expect_refused("solve set.h5 --criterion D=1,A=-1", "must be positive");
  expect_refused("solve set.h5 --criterion compound", "D=0.5,A=0.5");
  expect_refused("solve set.h5 --criterion L", "needs --weights");
  expect_refused("solve set.h5 --criterion Ds", "needs --interest");
  expect_refused("solve set.h5 --criterion A --weights 0=1", "--weights belongs to --criterion L");
  expect_refused("solve set.h5 --interest 0", "--interest belongs to --criterion Ds");
  expect_refused("solve set.h5 --criterion Ds --interest 3",
                 "unknown parameter '3'; the parameters are x^0, x^1, x^2");
  ASSERT_EQ(graybox("problem convert set.h5 -o plain.csv").exit_code, 0);
  expect_refused("solve plain.csv --criterion Ds --interest 3",
                 "no names: give indices from 0 to 2");
  expect_refused("solve set.h5 --criterion Ds --interest 0,0", "parameter 0 is named twice");
  expect_refused("solve set.h5 --criterion Ds --interest ,", "unknown parameter ''");
  expect_refused("solve set.h5 --criterion L --weights small.csv", "2 lines");
  expect_refused("solve set.h5 --criterion L --weights ragged.csv", "row 2 has 2 numbers");
  expect_refused("solve set.h5 --criterion L --weights words.csv", "line 2: 'one' is no number");
  expect_refused("solve set.h5 --criterion L --weights skew.csv", "not symmetric");
  expect_refused("solve set.h5 --criterion L --weights indefinite.csv", "positive semidefinite");
  expect_refused("solve set.h5 --criterion L --weights 0=-1", "positive semidefinite");
  expect_refused("solve set.h5 --criterion L --weights 0=0", "not zero");
  expect_refused("solve set.h5 --criterion L --weights 0=x", "'x' is no number");
  expect_refused("solve set.h5 --criterion L --weights missing.csv", "missing.csv");
  expect_refused("design criteria set.h5 --interest nobody", "unknown parameter 'nobody'");
  expect_refused("design criteria set.h5 --repetitions 0", "--repetitions");
  expect_refused("design criteria set.h5 --solver multiplicative", "criterion E");
}

TEST_F(CriterionCommand, WrongDesignFilesAreOneLine) {
  make_set();
  const std::string head =
      R"({"format": "graybox-design/1", "support": [{"index": 0, "weight": 1}],)";
  const auto refused = [&](const std::string& rest, const std::string& text) {
    write_text(folder_.file("bad.json"), head + rest + "}");
    expect_refused("check set.h5 bad.json", text);
  };
  refused(R"("criterion": {"name": "B"})", "bad.json: unknown criterion 'B'");
  refused(R"("criterion": "A")", "criterion must be an object");
  refused(R"("criterion": {"name": "Ds", "interest": [5]})", "there is no parameter 5");
  refused(R"("criterion": {"name": "Ds", "interest": [-1]})", "array of indices");
  refused(R"("criterion": {"name": "L", "weights": [1, 0]})", "no packed lower triangle");
  refused(R"("criterion": {"name": "L", "weights": [1]})", "W is 1 x 1");
  refused(R"("dual_matrix": ["a"])", "dual_matrix must be an array of numbers");
}

TEST_F(CriterionCommand, UnsupportedSolversSaySo) {
  make_set();
  const Outcome outcome =
      graybox("solve set.h5 --criterion A --solver fedorov_wynn --json -o design.json");
  EXPECT_EQ(outcome.exit_code, 1);
  const Json report = Json::parse(outcome.out);
  EXPECT_EQ(report["status"], "unsupported");
  EXPECT_NE(report["message"].get<std::string>().find("criterion A"), std::string::npos);
  for (const Json& solver : Json::parse(graybox("solvers --json").out)) {
    if (solver["name"] == "column_generation") {
      EXPECT_EQ(solver["criteria"],
                (Json{"D", "A", "E", "L", "Ds", "c", "I", "phi_p", "G", "compound"}));
    } else if (solver["name"] == "fedorov_wynn") {
      EXPECT_EQ(solver["criteria"], Json::array({"D"}));
    }
  }
}

TEST_F(CriterionCommand, ComparesCriteria) {
  make_set();
  const Outcome outcome =
      graybox("design criteria set.h5 --weights 1=1,2=1 --interest 2 --json -o .");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const Json rows = Json::parse(outcome.out);
  ASSERT_EQ(rows.size(), 5U);
  for (const Json& row : rows) {
    for (const auto& [name, value] : row["efficiencies"].items()) {
      EXPECT_LE(value.get<double>(), 1.0 + 1e-8);
      if (name == row["criterion"]) {
        EXPECT_NEAR(value.get<double>(), 1.0, 1e-12);
      }
    }
  }
  EXPECT_NEAR(rows[0]["efficiencies"]["A"].get<double>(), 8.0 / 9.0, 1e-6);
  EXPECT_NEAR(rows[1]["standard_deviations"]["x^2"].get<double>(), 2.0,
              1e-6);  // weights 1/4 1/2 1/4
  for (const std::string name : {"criteria", "criteria_efficiency", "criteria_deviations"}) {
    const std::string table = read_text(folder_.file(name + ".csv"));
    EXPECT_GE(std::ranges::count(table, '\n'), 4) << name;
  }
  EXPECT_NE(graybox("design criteria set.h5").out.find("efficiency under"), std::string::npos);
}

}  // namespace
}  // namespace graybox
