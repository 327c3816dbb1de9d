// What recordings have in common after their free motion was taken out: the covariance that is
// stated, in closed form and by Monte Carlo, and what it does to held-out recordings.
#include "diagnosis/harmonic_balance/common_error.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "diagnosis/free_motion/transients.hpp"
#include "diagnosis/harmonic_balance/real_products.hpp"
#include "diagnosis/periodic/periodic_mismatch.hpp"
#include "diagnosis/simulation/simulated_campaign.hpp"
#include "problems/base/random.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/support/two_mass_drive.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

struct Motion {
  MatrixXcd seen;
  MatrixXd information;
};

Motion random_motion(Index numbers, Index states, double size) {
  Random random(3);
  Motion motion{MatrixXcd(numbers, states), MatrixXd::Identity(states, states)};
  for (Index i = 0; i < numbers; ++i) {
    for (Index j = 0; j < states; ++j) {
      motion.seen(i, j) = size * std::complex<double>(random.normal(), random.normal());
    }
    if (i >= 3) continue;
    const VectorXd row = motion.seen.row(i).real();
    motion.information += 0.1 * row * row.transpose();
  }
  return motion;
}

TEST(CommonError, MakesNumbersIndependent) {
  const Motion motion = random_motion(9, 4, 0.7);
  const CommonError error = common_error(motion.seen, Eigen::LLT<MatrixXd>(motion.information));
  ASSERT_EQ(error.variances.size(), 4);
  const MatrixXd moved = as_real(motion.seen);
  const MatrixXd covariance =
      MatrixXd::Identity(18, 18) + moved * motion.information.inverse() * moved.transpose();
  // Column by column: Cov^(-1/2) of the unit vectors.
  MatrixXcd root(9, 18);
  for (Index i = 0; i < 9; ++i) {
    root.col(2 * i) = VectorXcd::Unit(9, i);
    root.col(2 * i + 1) = std::complex<double>(0.0, 1.0) * VectorXcd::Unit(9, i);
  }
  error.take_out(root);
  const MatrixXd real = as_real(root);
  EXPECT_LT((real - real.transpose()).norm(), 1e-12);
  EXPECT_LT((real * covariance * real - MatrixXd::Identity(18, 18)).norm(), 1e-10);
  const MatrixXcd directions = error.inverse_directions();
  const MatrixXd inverse =
      MatrixXd::Identity(18, 18) - as_real(directions) * as_real(directions).transpose();
  EXPECT_LT((inverse - covariance.inverse()).norm(), 1e-10);
}

TEST(CommonError, LeavesOutWhatIsFarLessThanTheNoise) {
  const Motion motion = random_motion(9, 4, 1e-3);
  const CommonError error = common_error(motion.seen, Eigen::LLT<MatrixXd>(motion.information));
  EXPECT_EQ(error.variances.size(), 0);
  MatrixXcd columns = motion.seen;
  error.take_out(columns);
  EXPECT_EQ(columns, motion.seen);
  EXPECT_EQ(error.inverse_directions().cols(), 0);
}

Campaign drive_from_rest(const testing::TemporaryFolder& folder, const std::string& levels,
                         int seed) {
  testing::write_text(folder.file("model.yaml"), testing::kRingingDrive);
  testing::write_text(folder.file("plan.yaml"),
                      "format: graybox-plan/1\nlevels: " + levels +
                          "\nrealisations: 2\nperiod: 500\nsettling_periods: 0\nperiods: 4\n"
                          "frequencies: {from: 1, to: 60, count: 40, spacing: log}\n");
  const SimulatedSystem system = load_system(folder.file("model.yaml"), std::nullopt);
  const auto campaign = folder.file("campaign_" + std::to_string(seed));
  SimulationOptions options;
  options.seed = static_cast<std::uint64_t>(seed);
  simulate_campaign(system, read_plan(folder.file("plan.yaml"), system), campaign, options);
  return read_campaign(campaign);
}

TEST(CommonError, HasTheCovarianceThatIsStated) {
  const testing::TemporaryFolder folder;
  double along = 0.0, stated = 0.0, independent = 0.0, count = 0.0;
  for (int seed = 1; seed <= 24; ++seed) {
    const Campaign campaign = drive_from_rest(folder, "[0.1, 0.3]", seed);
    const auto family = plant_family(folder.file("model.yaml"));
    PeriodicData data = read_periodic_data(campaign, *family, {});
    const ModelState model = evaluate_model(*family, data, family->start_values(), {}, true, 1);
    clear_transients(*family, model, {}, data);
    SteadyStateSolver solver(*family, data, {});
    for (const MeasuredRecord& record : data.estimation) {
      VectorXcd residual = solver.solve(model, record, nullptr).residual.reshaped();
      ASSERT_TRUE(record.common_error);
      const CommonError& error = *record.common_error;
      along += (error.directions.transpose() * as_real(residual)).squaredNorm();
      record.decorrelate(residual);
      independent += (error.directions.transpose() * as_real(residual)).squaredNorm();
      stated += (1.0 + error.variances.array()).sum();
      count += static_cast<double>(error.variances.size());
    }
  }
  ASSERT_GT(count, 200.0);
  EXPECT_GT(stated / count, 1.1);  // else there is nothing to tell apart
  const double deviation = std::sqrt(2.0 / count);
  EXPECT_NEAR(along / stated, 1.0, 4.0 * deviation);
  EXPECT_NEAR(independent / count, 1.0, 4.0 * deviation);
}

// Little is known from weak recordings; strong ones see how wrong it is, which is no missing
// physics.
TEST(HeldOut, AllowsForTheErrorsOfTheFittedParameters) {
  const testing::TemporaryFolder folder;
  double raw = 0.0, within = 0.0, joint = 0.0;
  constexpr int kCampaigns = 4;
  for (int seed = 1; seed <= kCampaigns; ++seed) {
    Campaign campaign = drive_from_rest(folder, "[0.02, 0.6]", 100 + seed);
    for (Experiment& experiment : campaign.experiments) {
      if (experiment.level > 0.1) experiment.role = ExperimentRole::kValidation;
    }
    const auto problem = periodic_mismatch_problem(folder.file("model.yaml"), campaign);
    const ExtendedFit fit = problem->fit({}, nullptr);
    ASSERT_TRUE(fit.usable) << fit.trouble;
    raw += problem->validate(fit)->chi_square_per_dof() / kCampaigns;
    within += problem->predict_held_out(fit)->within_errors.chi_square_per_dof() / kCampaigns;
    // What chi-square of all recordings, fitted together, is above that of the weak ones.
    double numbers = 0.0;
    for (Experiment& experiment : campaign.experiments) {
      numbers += experiment.role == ExperimentRole::kValidation ? 1.0 : 0.0;
      experiment.role = ExperimentRole::kEstimation;
    }
    const auto all = periodic_mismatch_problem(folder.file("model.yaml"), campaign);
    numbers *= all->sample_count() / static_cast<double>(campaign.experiments.size());
    joint += (all->fit({}, nullptr).deviance - fit.deviance) / numbers / kCampaigns;
  }
  EXPECT_GT(raw, 1.5);
  EXPECT_NEAR(within, 1.0, 0.1);
  EXPECT_NEAR(joint, within, 0.03);
}

}  // namespace
}  // namespace graybox
