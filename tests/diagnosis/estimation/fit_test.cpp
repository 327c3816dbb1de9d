// What is said about a fit: which parameters the data determine, whether covariances are as
// predicted, the report; and fits of simulated recordings.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "diagnosis/estimation/fit_report.hpp"
#include "diagnosis/estimation/identifiability.hpp"
#include "diagnosis/studies/efficiency_study.hpp"
#include "diagnosis/studies/estimator_statistics.hpp"
#include "problems/base/distributions.hpp"
#include "problems/base/error.hpp"
#include "problems/base/random.hpp"
#include "problems/mechanisms/robot_model.hpp"

namespace graybox {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// |value| in units of its standard deviation must stay below five, for seeded draws.
constexpr double kFiveSigma = 5.0;

MatrixXd random_normal(Eigen::Index rows, Eigen::Index columns, Random& random) {
  MatrixXd matrix(rows, columns);
  for (double& value : matrix.reshaped()) value = random.normal();
  return matrix;
}

bool mentions(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

// ---- identifiability ----------------------------------------------------------------------------

const std::vector<std::string> kNames{"shaft", "belt", "mount"};

// Information of data that see these functions of the parameters (rows: gradients).
MatrixXd information_of(const MatrixXd& gradients) { return gradients.transpose() * gradients; }

TEST(Identifiability, IsTheInverseWhereAllIsSeen) {
  Random random(1);
  const VectorXd values = Eigen::Vector3d(2.0, -5.0, 1e6);
  MatrixXd gradients = random_normal(9, 3, random) * 100.0;
  gradients.col(2) *= 1e-6;
  const MatrixXd information = information_of(gradients);
  const Identifiability seen = examine_identifiability(information, values, kNames);
  const MatrixXd covariance = information.inverse();
  EXPECT_TRUE(seen.unseen.empty());
  for (Eigen::Index i = 0; i < 3; ++i) {
    EXPECT_TRUE(seen.determined(i));
    EXPECT_DOUBLE_EQ(seen.correlation()(i, i), 1.0);
    for (Eigen::Index j = 0; j < 3; ++j) {
      EXPECT_NEAR(seen.covariance(i, j), covariance(i, j),
                  1e-9 * std::sqrt(covariance(i, i) * covariance(j, j)));
    }
  }
  // Along the directions the errors multiply to the determinant of the relative covariance.
  const MatrixXd relative =
      values.cwiseInverse().asDiagonal() * covariance * values.cwiseInverse().asDiagonal();
  EXPECT_NEAR(seen.relative_standard_errors.prod(), std::sqrt(relative.determinant()),
              1e-6 * std::sqrt(relative.determinant()));
}

// Data that see a function of shaft and belt and, apart from that, the mount.
struct Combination {
  const char* words;
  double by_shaft, by_belt;  // gradient of the function
};

class Combinations : public ::testing::TestWithParam<Combination> {};

TEST_P(Combinations, AreNamedAndTheRestIsReported) {
  const Combination& seen_function = GetParam();
  const VectorXd values = Eigen::Vector3d(2.0, 3.0, 7.0);
  MatrixXd gradients(2, 3);
  gradients << seen_function.by_shaft, seen_function.by_belt, 0.0,  //
      0.0, 0.0, 10.0;
  const Identifiability seen = examine_identifiability(information_of(gradients), values, kNames);
  ASSERT_EQ(seen.unseen.size(), 1U);
  const UnseenCombination& unseen = seen.unseen.front();
  EXPECT_TRUE(std::isinf(unseen.relative_standard_error));
  EXPECT_TRUE(mentions(unseen.words, "shaft and belt")) << unseen.words;
  EXPECT_TRUE(mentions(unseen.words, seen_function.words)) << unseen.words;
  // Along the direction the function stays the same.
  EXPECT_NEAR(gradients.row(0).dot(unseen.direction.cwiseProduct(values)), 0.0, 1e-9);
  EXPECT_FALSE(seen.determined(0));
  EXPECT_FALSE(seen.determined(1));
  EXPECT_TRUE(seen.determined(2));
  EXPECT_NEAR(seen.covariance(2, 2), 0.01, 1e-12);
}

// At shaft 2, belt 3: gradients of a + b, a - b, a b, a / b, 1/a + 1/b.
INSTANTIATE_TEST_SUITE_P(Identifiability, Combinations,
                         ::testing::Values(Combination{"only their sum", 5.0, 5.0},
                                           Combination{"only their difference", 5.0, -5.0},
                                           Combination{"only their product", 3.0, 2.0},
                                           Combination{"only their ratio", 1.0 / 3.0, -2.0 / 9.0},
                                           Combination{"springs in series", -1.0 / 4.0,
                                                       -1.0 / 9.0}));

TEST(Identifiability, NamesAParameterWithoutEffectAndOneHardlySeen) {
  const VectorXd values = Eigen::Vector3d(2.0, 3.0, 7.0);
  const MatrixXd information =
      Eigen::Vector3d(100.0, 0.0, 1.0 / (14.0 * 14.0)).asDiagonal();  // mount to 200 %
  const Identifiability seen = examine_identifiability(information, values, kNames);
  ASSERT_EQ(seen.unseen.size(), 2U);
  EXPECT_TRUE(mentions(seen.unseen[0].words, "belt: the data do not see it"));
  EXPECT_TRUE(std::isinf(seen.unseen[0].relative_standard_error));
  EXPECT_TRUE(mentions(seen.unseen[1].words, "mount"));
  EXPECT_NEAR(seen.unseen[1].relative_standard_error, 2.0, 1e-9);
  EXPECT_TRUE(seen.determined(0));
  EXPECT_FALSE(seen.determined(1));
  EXPECT_FALSE(seen.determined(2));
}

TEST(Identifiability, SaysWhichAreWeakAndTakesCombinationsOfThreeApart) {
  const VectorXd values = Eigen::Vector3d(1.0, 1.0, 1.0);
  const Identifiability weak = examine_identifiability(
      Eigen::Vector3d(100.0, 1.0 / (0.3 * 0.3), 100.0).asDiagonal(), values, kNames);
  EXPECT_TRUE(weak.unseen.empty());
  ASSERT_EQ(weak.weak.size(), 1U);
  EXPECT_TRUE(mentions(weak.weak.front(), "belt"));
  // One function of three: two directions, each of them naming two parameters.
  const Identifiability three = examine_identifiability(
      information_of(MatrixXd(Eigen::RowVector3d(1.0, 2.0, 3.0))), values, kNames);
  ASSERT_EQ(three.unseen.size(), 2U);
  for (const UnseenCombination& unseen : three.unseen) {
    EXPECT_EQ((unseen.direction.array().abs() > 1e-9).count(), 2);
    EXPECT_NEAR(unseen.direction.dot(Eigen::Vector3d(1.0, 2.0, 3.0)), 0.0, 1e-9);
  }
}

TEST(Identifiability, RefusesWhatDoesNotFit) {
  const MatrixXd information = MatrixXd::Identity(3, 3);
  EXPECT_THROW((void)examine_identifiability(information, VectorXd::Ones(2), kNames), InputError);
  EXPECT_THROW((void)examine_identifiability(information, VectorXd::Ones(3), {"a"}), InputError);
  EXPECT_THROW((void)examine_identifiability(information * std::nan(""), VectorXd::Ones(3), kNames),
               InputError);
}

// ---- the report ---------------------------------------------------------------------------------

TEST(FitReport, WritesWhatIsKnownAndNullForTheRest) {
  FitReport report;
  report.model = "drive.yaml";
  report.campaign = "campaign.yaml";
  report.method = "a method";
  report.status = "converged";
  report.parameters = {{"shaft", "N m/rad", 2.0, 1.0}, {"belt", "N m/rad", 3.0, 1.0}};
  report.identifiability =
      examine_identifiability(MatrixXd(Eigen::Vector2d(25.0, 0.0).asDiagonal()),
                              Eigen::Vector2d(2.0, 3.0), {"shaft", "belt"});
  report.chi_square = 12.0;
  report.degrees_of_freedom = 10;
  report.starts = {{Eigen::Vector2d(1, 1), Eigen::Vector2d(2, 3), 12.0, true},
                   {Eigen::Vector2d(9, 9), {}, std::numeric_limits<double>::infinity(), false}};
  report.estimation = {
      .recordings = 6, .chi_square_per_dof = 1.2, .nrmse = 3.0, .variance_accounted_for = 99.9};
  const auto json = nlohmann::json::parse(fit_json(report).dump());
  EXPECT_EQ(json["format"], "graybox-fit/1");
  EXPECT_DOUBLE_EQ(json["parameters"][0]["standard_error"].get<double>(), 0.2);
  EXPECT_TRUE(json["parameters"][1]["standard_error"].is_null());
  EXPECT_DOUBLE_EQ(json["covariance"][0][0].get<double>(), 0.04);
  EXPECT_TRUE(json["covariance"][0][1].is_null());
  EXPECT_DOUBLE_EQ(json["correlation"][0][0].get<double>(), 1.0);
  EXPECT_DOUBLE_EQ(json["chi_square_per_dof"].get<double>(), 1.2);
  EXPECT_EQ(json["identifiability"]["unseen"].size(), 1U);
  EXPECT_TRUE(json["starts"][1]["chi_square"].is_null());
  EXPECT_TRUE(json["fit"]["validation"].is_null());
  EXPECT_EQ(json["fit"]["estimation"]["recordings"], 6);
  const std::string text = fit_text(report);
  EXPECT_TRUE(mentions(text, "not seen")) << text;
  EXPECT_TRUE(mentions(text, "1 of 2 starts")) << text;
  EXPECT_TRUE(mentions(text, "warning: not determined: belt")) << text;
}

// ---- covariances against predictions ------------------------------------------------------------

// Estimates that are normal with this covariance.
MatrixXd estimates_of(Eigen::Index count, const VectorXd& theta, const MatrixXd& covariance,
                      Random& random) {
  const MatrixXd factor = covariance.llt().matrixL();
  return (random_normal(count, theta.size(), random) * factor.transpose()).rowwise() +
         theta.transpose();
}

// With two parameters 2 det(S)^(1/2) is chi-square with 2 (n - 2) degrees of freedom.
TEST(EstimatorStatistics, DeterminantHasItsExactDistributionForTwoParameters) {
  Random random(3);
  const VectorXd theta = Eigen::Vector2d(1.0, 2.0);
  const MatrixXd covariance = information_of(random_normal(5, 2, random));
  const MatrixXd estimates = estimates_of(12, theta, covariance, random);
  const EfficiencyStatistics found = compare_with_prediction(estimates, theta, covariance);
  const double root =
      std::sqrt((sample_covariance(estimates) * covariance.inverse()).determinant());
  const auto limit = [&](double probability) {
    return root * 11.0 / (chi_square_quantile(probability, 20.0) / 2.0);
  };
  EXPECT_NEAR(found.determinant.lower, limit(0.975), 0.02 * limit(0.975));
  EXPECT_NEAR(found.determinant.upper, limit(0.025), 0.02 * limit(0.025));
  EXPECT_NEAR(found.determinant.estimate, limit(0.5), 0.02 * limit(0.5));
}

// Each interval holds the truth, and each test rejects it, as often as it says.
TEST(EstimatorStatistics, IntervalsAndTestsKeepTheirLevels) {
  Random random(4);
  const VectorXd theta = Eigen::Vector3d(1.0, 2.0, 3.0);
  const MatrixXd covariance = information_of(random_normal(6, 3, random));
  constexpr int kStudies = 400;
  int determinant = 0, trace = 0, variance = 0, eigenvalue = 0, unbiased = 0, equal = 0, twice = 0;
  for (int k = 0; k < kStudies; ++k) {
    const MatrixXd estimates = estimates_of(15, theta, covariance, random);
    const EfficiencyStatistics found = compare_with_prediction(estimates, theta, covariance, 1000);
    determinant += found.determinant.contains(1.0) ? 1 : 0;
    trace += found.trace.contains(1.0) ? 1 : 0;
    variance += found.variances[1].contains(1.0) ? 1 : 0;
    eigenvalue += found.eigenvalues(2) >= found.eigenvalues_lower(2) &&
                          found.eigenvalues(2) <= found.eigenvalues_upper(2)
                      ? 1
                      : 0;
    unbiased += found.bias_p_value >= 0.05 ? 1 : 0;
    EXPECT_EQ(found.trace.contains(1.0), found.trace_p_value >= 0.05);
    const MatrixXd others = estimates_of(25, theta, 2.0 * covariance, random);
    const CovarianceRatio ratio = compare_covariances(estimates, others, 1000);
    twice += ratio.determinant.contains(2.0) ? 1 : 0;
    equal += ratio.variances[0].contains(2.0) ? 1 : 0;
  }
  const double spread = std::sqrt(kStudies * 0.95 * 0.05);
  for (const int count : {determinant, trace, variance, eigenvalue, unbiased, equal, twice}) {
    EXPECT_NEAR(count, 0.95 * kStudies, 4.0 * spread);
  }
}

TEST(EstimatorStatistics, SeesATooLargeCovarianceAndABias) {
  Random random(5);
  const VectorXd theta = Eigen::Vector3d(1.0, 2.0, 3.0);
  const MatrixXd covariance = information_of(random_normal(6, 3, random));
  const MatrixXd wide = estimates_of(500, theta, 1.5 * covariance, random);
  const EfficiencyStatistics found = compare_with_prediction(wide, theta, covariance, 2000);
  EXPECT_TRUE(found.determinant.contains(1.5));
  EXPECT_FALSE(found.determinant.contains(1.0));
  EXPECT_LT(found.trace_p_value, 1e-6);
  VectorXd beside = theta;
  beside(1) += 0.3 * std::sqrt(covariance(1, 1));
  const EfficiencyStatistics biased = compare_with_prediction(
      estimates_of(500, beside, covariance, random), theta, covariance, 500);
  EXPECT_LT(biased.bias_p_value, 1e-4);
  EXPECT_GT(biased.bias(1), 3.0);
}

TEST(EstimatorStatistics, WilsonsIntervalSolvesItsQuadratic) {
  for (const std::size_t successes : {0U, 3U, 47U, 50U}) {
    const Interval share = share_of(successes, 50);
    const double z = normal_quantile(0.975);
    for (const double limit : {share.lower, share.upper}) {
      EXPECT_NEAR((share.estimate - limit) * (share.estimate - limit),
                  z * z * limit * (1.0 - limit) / 50.0, 1e-12);
    }
  }
}

TEST(EstimatorStatistics, RefusesWhatHasNoCovariance) {
  const MatrixXd few = MatrixXd::Zero(3, 3);
  const VectorXd theta = VectorXd::Zero(3);
  const MatrixXd unit = MatrixXd::Identity(3, 3);
  EXPECT_THROW((void)compare_with_prediction(few, theta, unit), InputError);
  Random random(1);
  MatrixXd estimates = random_normal(9, 3, random);
  EXPECT_THROW((void)compare_with_prediction(estimates, theta, -unit), InputError);
  EXPECT_THROW((void)compare_with_prediction(estimates, VectorXd::Zero(2), unit), InputError);
  EXPECT_THROW((void)compare_covariances(estimates, random_normal(9, 2, random)), InputError);
  estimates(0, 0) = std::nan("");
  EXPECT_THROW((void)compare_with_prediction(estimates, theta, unit), InputError);
  EXPECT_THROW((void)share_of(1, 0), InputError);
}

// ---- simulated campaigns ------------------------------------------------------------------------

// One position, as long as the study records. Noise makes the inputs, by way of the controller;
// taken for excitation it would promise errors up to 30 % smaller here. Free motion costs what the
// prediction leaves out.
TEST(EfficiencyStudy, FitsSimulatedRecordingsAsPreciselyAsItPredicts) {
  RobotModel robot = load_robot_model(default_robot_file());
  robot.velocity_psd_slope *= 1e-6;
  const EfficiencyStudy study(robot, {});
  VectorXd position(6);
  position << 45.0, 15.0, -150.0, 0.0, -90.0, 0.0;
  const StudiedDesign design{"one_position", {position * std::numbers::pi / 180.0}, {1}};
  const EstimateRow row = study.estimate(design, StudyData::kRecordings, 0);
  ASSERT_EQ(row.status, FitStatus::kConverged);
  EXPECT_LT(row.error_chi_square, chi_square_quantile(0.99999, 12.0));
  const auto dof = static_cast<double>(row.degrees_of_freedom);
  EXPECT_NEAR(row.chi_square / dof, 1.0, 2.0 * kFiveSigma * std::sqrt(2.0 / dof));
  const MatrixXd predicted = study.predicted_covariance(design, StudyData::kRecordings);
  for (Eigen::Index p = 0; p < predicted.rows(); ++p) {
    EXPECT_NEAR(std::sqrt(row.covariance(p, p) / predicted(p, p)), 1.07, 0.1) << p;
  }
  // Twice the experiments: half the covariance, and weights with more degrees of freedom.
  const MatrixXd twice =
      study.predicted_covariance({"two", design.positions, {2}}, StudyData::kRecordings);
  EXPECT_LT(twice(0, 0), 0.5 * predicted(0, 0));
  EXPECT_GT(twice(0, 0), 0.5 / 1.1 * predicted(0, 0));
}

}  // namespace
}  // namespace graybox
