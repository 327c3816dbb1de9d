#include "solvers/report/design_file.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "problems/families/families.hpp"
#include "problems/families/regression.hpp"
#include "solvers/report/solve_report.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using testing::read_text;
using testing::TemporaryFolder;
using testing::write_text;
using Json = nlohmann::ordered_json;

// Quadratic regression on {-1, -1/2, 0, 1/2, 1}: the optimum is 1/3 on -1, 0 and 1.
InformationSet quadratic() {
  return polynomial_regression(2, even_points(5), PolynomialBasis::kMonomial).renamed("quadratic");
}

Solution claim(std::vector<double> weights, SolveStatus status) {
  Solution solution;
  solution.design.weights = std::move(weights);
  solution.status = status;
  solution.counters = {7, 3.25, 0.125};
  return solution;
}

const std::vector<double> kOptimal{1.0 / 3.0, 0.0, 1.0 / 3.0, 0.0, 1.0 / 3.0};

class DesignFileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    path_ = folder_.file("design.json");
    write(claim(kOptimal, SolveStatus::kSolved));
  }

  void write(const Solution& solution) {
    SolveReport report = judge(set_, "by_hand", {.duality_gap = 1e-7}, solution);
    report.problem_hash = set_.content_hash();
    write_design(path_, set_, solution.design, report);
  }

  // Changes the file and expects an error that contains the text.
  template <typename Change>
  void expect_error(Change change, const std::string& part) {
    Json json = Json::parse(read_text(path_));
    change(json);
    write_text(path_, json.dump());
    expect_error(part);
    write(claim(kOptimal, SolveStatus::kSolved));
  }

  void expect_error(const std::string& part) {
    try {
      static_cast<void>(read_design(path_, set_));
      ADD_FAILURE() << "no error; expected " << part;
    } catch (const InputError& error) {
      const std::string line = error.what();
      EXPECT_EQ(line.find(path_), 0U) << line;
      EXPECT_EQ(line.find('\n'), std::string::npos) << line;
      EXPECT_NE(line.find(part), std::string::npos) << line;
    }
  }

  TemporaryFolder folder_;
  std::string path_;
  InformationSet set_ = quadratic();
};

TEST_F(DesignFileTest, WeightsReadBackToTheBit) {
  const InformationSet large = make_family("wis", 300, 3, 1);
  std::vector<double> weights(300);
  double sum = 0.0;
  Random random(5);
  for (double& w : weights) sum += w = std::pow(random.uniform(), 8);
  for (double& w : weights) w /= sum;
  SolveReport report = judge(large, "x", {}, claim(weights, SolveStatus::kTimeLimit));
  report.problem_hash = large.content_hash();
  write_design(path_, large, {weights}, report);
  EXPECT_EQ(read_design(path_, large).design.weights, weights);
}

TEST_F(DesignFileTest, KeepsWhatTheRunSaid) {
  const DesignFile file = read_design(path_, set_);
  EXPECT_EQ(file.design.weights, kOptimal);
  EXPECT_EQ(file.solver, "by_hand");
  EXPECT_EQ(file.status, "solved");
  EXPECT_EQ(file.problem_hash, set_.content_hash());
  EXPECT_EQ(file.asked_gap, 1e-7);
  EXPECT_EQ(file.counters.iterations, 7);
  EXPECT_EQ(file.counters.passes, 3.25);
  EXPECT_EQ(file.counters.seconds, 0.125);
}

TEST_F(DesignFileTest, ListsTheSupportWithItsCoordinates) {
  const Json json = Json::parse(read_text(path_));
  EXPECT_EQ(json["format"], "graybox-design/1");
  ASSERT_EQ(json["support"].size(), 3U);
  EXPECT_EQ(json["support"][1]["index"], 2);
  EXPECT_EQ(json["support"][2]["candidate"]["x"], 1.0);
  EXPECT_EQ(json["certificate"]["status"], "certified");
  EXPECT_TRUE(json["options"]["time_limit"].is_null());
  // M = [1 0 2/3; 0 2/3 0; 2/3 0 2/3]: det = 2/3 (2/3 - 4/9) = 4/27.
  EXPECT_NEAR(json["log_det"].get<double>(), std::log(4.0 / 27.0), 1e-14);
}

TEST_F(DesignFileTest, AnotherProgramNeedsOnlyFormatAndSupport) {
  write_text(path_, R"({"format": "graybox-design/1", "support": [{"index": 3, "weight": 1}]})");
  const DesignFile file = read_design(path_, set_);
  EXPECT_EQ(file.design.weights, (std::vector<double>{0, 0, 0, 1, 0}));
  EXPECT_FALSE(file.asked_gap.has_value());
}

TEST_F(DesignFileTest, RefusesWhatIsNoDesignOfThisSet) {
  expect_error([](Json& j) { j["format"] = "graybox-design/9"; }, "format is 'graybox-design/9'");
  expect_error([](Json& j) { j.erase("format"); }, "format is missing");
  expect_error([](Json& j) { j["problem_hash"] = std::string(64, '0'); }, "another problem");
  expect_error([](Json& j) { j["candidates"] = 6; }, "candidates is 6");
  expect_error([](Json& j) { j["dimension"] = 2; }, "dimension is 2");
  expect_error([](Json& j) { j["support"][0]["index"] = 5; }, "index 5 is no integer from 0 to 4");
  expect_error([](Json& j) { j["support"][0]["index"] = -1; }, "index -1");
  expect_error([](Json& j) { j["support"][0]["index"] = 1.5; }, "index 1.5");
  expect_error([](Json& j) { j["support"][0]["index"] = 2; }, "index 2 stands there twice");
  expect_error([](Json& j) { j["support"][0]["weight"] = "much"; }, "weight \"much\" is no number");
  expect_error([](Json& j) { j["support"][0]["weight"] = nullptr; }, "weight null is no number");
  expect_error([](Json& j) { j["support"][0].erase("weight"); }, "support[0]: expected");
  expect_error([](Json& j) { j["support"][0] = 3; }, "support[0]: expected");
  expect_error([](Json& j) { j["support"] = Json::array(); }, "support is missing or empty");
  expect_error([](Json& j) { j.erase("support"); }, "support is missing or empty");
  expect_error([](Json& j) { j["support"][0]["weight"] = -0.5; }, "weight -0.5 is negative");
  expect_error([](Json& j) { j["support"][0]["weight"] = 0.5; }, "sum to 1.1666666");
  expect_error([](Json& j) { j["solver"] = 3; }, "solver must be text");
  expect_error([](Json& j) { j["counters"] = 3; }, "counters must be an object");
  expect_error([](Json& j) { j["options"]["duality_gap"] = "small"; }, "options.duality_gap");
  expect_error([](Json& j) { j = Json::array(); }, "no JSON object");
}

// Whatever is wrong with whichever field: the message names the file, and once.
TEST_F(DesignFileTest, DamagedFieldsAreRefusedNamingTheFileOnce) {
  Json whole = Json::parse(read_text(path_));
  whole["criterion"] = {{"name", "compound"},
                        {"parts",
                         {{{"share", 0.5}, {"criterion", {{"name", "L"}, {"weights", {1, 0, 1}}}}},
                          {{"share", 0.5}, {"criterion", {{"name", "phi_p"}, {"p", 2}}}}}}};
  whole["floors"] = {
      {{"share", 0.5}, {"criterion", {{"name", "Ds"}, {"interest", {0}}}}, {"multiplier", 0.1}}};
  whole["limits"] = {{"concentration", {{"largest_share", 0.5}, {"positions", 2}}}};
  std::size_t refused = 0;
  const Json fields = whole.flatten();
  for (const auto& [field, value] : fields.items()) {
    for (const Json& damage : {Json(), Json("word"), Json(-1), Json::array(), Json::object()}) {
      Json damaged = whole;
      damaged[Json::json_pointer(field)] = damage;
      write_text(path_, damaged.dump());
      try {
        (void)read_design(path_, quadratic());
      } catch (const InputError& error) {
        const std::string line = error.what();
        ++refused;
        EXPECT_EQ(line.find(path_), 0U) << field << damage << line;
        EXPECT_EQ(line.rfind(path_), 0U) << field << damage << line;
        EXPECT_EQ(line.find('\n'), std::string::npos) << line;
      }
    }
  }
  EXPECT_GT(refused, 50U);
}

TEST_F(DesignFileTest, RefusesBrokenAndMissingFiles) {
  write_text(path_, read_text(path_).substr(0, 100));
  expect_error("not valid JSON");
  write_text(path_, "");
  expect_error("empty");
  std::filesystem::remove(path_);
  expect_error("can't be opened");
}

// Weak duality by hand: W obeys tr(W H_i) <= d, and -log det W is above log det M by the gap.
TEST_F(DesignFileTest, HoldsAPointOfTheDualThatProvesTheDesign) {
  const std::vector<double> weights{0.3, 0.1, 0.3, 0.0, 0.3};
  write(claim(weights, SolveStatus::kSolved));
  const std::vector<double> point = Json::parse(read_text(path_))["dual_point"];
  ASSERT_EQ(point.size(), set_.packed_size());
  const std::size_t d = set_.dimension();
  const auto symmetric = [&](std::span<const double> packed) {
    Eigen::MatrixXd full(static_cast<Eigen::Index>(d), static_cast<Eigen::Index>(d));
    unpack(packed.data(), d, full.data());
    return full;
  };
  const Eigen::MatrixXd W = symmetric(point);
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(W.rows(), W.cols());
  double most = 0.0;
  for (std::size_t i = 0; i < set_.candidate_count(); ++i) {
    const Eigen::MatrixXd H = symmetric(set_.information(i));
    most = std::max(most, (W * H).trace());
    M += weights[i] * H;
  }
  const double dimension = static_cast<double>(d);
  EXPECT_NEAR(most, dimension, 1e-12);
  const double above = -std::log(W.determinant()) - std::log(M.determinant());
  EXPECT_NEAR(above, dimension * std::log1p(certify(set_, {weights}).duality_gap), 1e-12);
  EXPECT_GT(above, 1e-3);
}

TEST_F(DesignFileTest, LeavesWeightsToTheCheckerIfAsked) {
  Json json = Json::parse(read_text(path_));
  json["support"][0]["weight"] = 0.5;
  write_text(path_, json.dump());
  const DesignFile file = read_design(path_, set_, WeightCheck::kForChecker);
  EXPECT_EQ(certify(set_, file.design).status, CertificateStatus::kNotADesign);
}

// ---- the verdict on a claim --------------------------------------------------------------------

TEST(SolveReport, TheCheckerDecides) {
  const InformationSet set = quadratic();
  const auto status = [&](std::vector<double> weights, SolveStatus said, double gap) {
    return judge(set, "x", {.duality_gap = gap}, claim(std::move(weights), said)).status;
  };
  // Near the optimum: moving weight e from 0 to -1 and 1 changes the largest sensitivity at 0,
  // which is 3 (1/3) / (1/3 - e), so the gap is about 3 e.
  const double e = 1e-6;
  const std::vector<double> near{1.0 / 3.0 + e / 2.0, 0.0, 1.0 / 3.0 - e, 0.0, 1.0 / 3.0 + e / 2.0};
  const std::vector<double> singular{1.0, 0.0, 0.0, 0.0, 0.0};
  const std::vector<double> no_design{0.5, 0.0, 0.0, 0.0, 0.0};
  EXPECT_EQ(status(kOptimal, SolveStatus::kSolved, 1e-12), ReportStatus::kSolved);
  EXPECT_EQ(status(kOptimal, SolveStatus::kTimeLimit, 1e-12), ReportStatus::kSolved);
  EXPECT_EQ(status(near, SolveStatus::kSolved, 4e-6), ReportStatus::kSolved);
  EXPECT_EQ(status(near, SolveStatus::kSolved, 1e-6), ReportStatus::kInaccurate);
  EXPECT_EQ(status(near, SolveStatus::kSolved, 1e-7), ReportStatus::kClaimedButWrong);
  EXPECT_EQ(status(near, SolveStatus::kTimeLimit, 1e-7), ReportStatus::kTimeLimit);
  EXPECT_EQ(status(near, SolveStatus::kIterationLimit, 1e-7), ReportStatus::kIterationLimit);
  EXPECT_EQ(status(near, SolveStatus::kNumericalFailure, 1e-7), ReportStatus::kNumericalFailure);
  EXPECT_EQ(status(singular, SolveStatus::kSolved, 1.0), ReportStatus::kClaimedButWrong);
  EXPECT_EQ(status(no_design, SolveStatus::kSolved, 1.0), ReportStatus::kClaimedButWrong);
  EXPECT_EQ(status({}, SolveStatus::kUnsupported, 1.0), ReportStatus::kUnsupported);
}

TEST(SolveReport, JsonCarriesTheKeysAndNullForInfinity) {
  const InformationSet set = quadratic();
  const SolveReport report =
      judge(set, "x", {}, claim({1.0, 0.0, 0.0, 0.0, 0.0}, SolveStatus::kTimeLimit));
  const Json json = Json::parse(to_json(report).dump());
  for (const char* key : {"solver", "status", "duality_gap", "log_det", "seconds", "passes",
                          "iterations", "support_size", "peak_memory_bytes", "rounding_bound",
                          "efficiency", "problem_hash", "message"}) {
    EXPECT_TRUE(json.contains(key)) << key;
  }
  EXPECT_EQ(json["status"], "time_limit");
  EXPECT_TRUE(json["duality_gap"].is_null());
  EXPECT_GT(json["peak_memory_bytes"].get<double>(), 1e6);
}

TEST(SolveReport, NamesOfStatusesReadBack) {
  for (const auto status :
       {ReportStatus::kSolved, ReportStatus::kIterationLimit, ReportStatus::kTimeLimit,
        ReportStatus::kNumericalFailure, ReportStatus::kUnsupported, ReportStatus::kInaccurate,
        ReportStatus::kClaimedButWrong, ReportStatus::kCrashed, ReportStatus::kOutOfMemory}) {
    EXPECT_EQ(report_status(to_string(status)), status);
  }
  EXPECT_THROW(static_cast<void>(report_status("splendid")), InputError);
}

}  // namespace
}  // namespace graybox
