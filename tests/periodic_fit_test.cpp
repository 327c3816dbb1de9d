// Fits of a linear drive to its own recordings: where the fit starts is not where it ends, unless a prior
// says so.
#include "graybox/diagnosis/periodic_mismatch/periodic_fit.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "graybox/diagnosis/periodic_mismatch/periodic_data.hpp"
#include "graybox/diagnosis/periodic_mismatch/plant_family.hpp"
#include "graybox/diagnosis/simulation/simulated_campaign.hpp"
#include "temporary_folder.hpp"
#include "two_mass_drive.hpp"

namespace graybox {
namespace {

using testing::two_mass_drive;
using testing::write_text;

// Recordings of a shaft of 30 N m/rad, and a model that believes in 22.
class PeriodicFits : public ::testing::Test {
 protected:
  void SetUp() override {
    write_text(folder_.file("truth.yaml"), two_mass_drive("30", "0.05"));
    write_text(folder_.file("model.yaml"), two_mass_drive("22", "0.05"));
    write_text(folder_.file("plan.yaml"),
               "format: graybox-plan/1\nlevels: [0.2]\nrealisations: 2\nperiod: 500\n"
               "settling_periods: 6\nperiods: 4\n"
               "frequencies: {from: 1, to: 60, count: 30, spacing: log}\n");
    const SimulatedSystem system = load_system(folder_.file("truth.yaml"), std::nullopt);
    simulate_campaign(system, read_plan(folder_.file("plan.yaml"), system),
                      folder_.file("campaign"), {});
    family_ = plant_family(folder_.file("model.yaml"));
    data_ = read_periodic_data(read_campaign(folder_.file("campaign")), *family_, {});
    own_.resize(static_cast<Eigen::Index>(family_->parameters().size()));
    for (Eigen::Index p = 0; p < own_.size(); ++p) {
      const ModelParameter& parameter = family_->parameters()[static_cast<std::size_t>(p)];
      own_(p) = parameter.start;
      if (parameter.unit == "N m/rad") shaft_ = p;
    }
  }

  testing::TemporaryFolder folder_;
  std::unique_ptr<PlantFamily> family_;
  PeriodicData data_;
  Eigen::VectorXd own_;
  Eigen::Index shaft_ = -1;
};

TEST_F(PeriodicFits, FindTheSameOptimumFromTheModelsOwnValuesAndFromThere) {
  const PeriodicFit plain = fit_periodic_gradually(*family_, data_, {own_}, {}, {});
  const PeriodicFit near = fit_periodic_near_own_values(*family_, data_, {}, {});
  ASSERT_TRUE(plain.converged && near.converged);
  ASSERT_GE(shaft_, 0);
  const Eigen::VectorXd errors = standard_errors(near.information);
  EXPECT_LT(std::abs(near.parameters(shaft_) - 30.0), 5.0 * errors(shaft_));
  EXPECT_LT(((near.parameters - plain.parameters).array() / errors.array()).abs().maxCoeff(), 0.1);
  EXPECT_NEAR(near.chi_square, plain.chi_square, 0.1);  // the prior is not in the last fit
}

// The prior is about the model's own values, wherever the fit starts, and as strong as it says.
TEST_F(PeriodicFits, HoldParametersByThePriorAsStronglyAsItSays) {
  const PeriodicFit free = fit_periodic(*family_, data_, {own_}, {}, {});
  PeriodicFitOptions held;
  held.prior_deviation = 1e-7;
  const PeriodicFit fixed = fit_periodic(*family_, data_, {free.parameters}, {}, held);
  EXPECT_LT((fixed.parameters.array() / own_.array()).log().abs().maxCoeff(), 1e-3);
  held.prior_deviation = 1e3;
  const PeriodicFit loose = fit_periodic(*family_, data_, {own_}, {}, held);
  const Eigen::VectorXd errors = standard_errors(free.information);
  EXPECT_LT(((loose.parameters - free.parameters).array() / errors.array()).abs().maxCoeff(), 0.1);
}

}  // namespace
}  // namespace graybox
