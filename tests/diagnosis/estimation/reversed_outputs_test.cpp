// Signs and gears of the sensors of coupled masses, before any law: two masses on springs that the
// model lacks, and simulated drives whose second encoder is turned or behind a gear.
#include "diagnosis/prediction_error/reversed_outputs.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>

#include "diagnosis/prediction_error/search_start.hpp"
#include "tests/support/simulated_drives.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

// What is said of the recordings in a folder.
std::string faults_of(const testing::TemporaryFolder& folder) {
  const LumpedModel model = load_lumped_model(folder.file("drive.yaml"));
  PredictionData data(model, read_campaign(folder.file("campaign.yaml")), 1);
  const PredictionHypotheses hypotheses(model, data, {});
  limit_noise(data, model, 1);
  std::string said;
  for (const ChannelFault& fault : find_reversed_outputs(model, data, hypotheses, 1)) {
    said += fault.message + "\n";
  }
  return said;
}

// Two masses on a spring, each of which may hang on a wall by another one, pushed by held forces of
// random sizes. The model knows no wall.
class MassesOnSprings {
 public:
  explicit MassesOnSprings(unsigned seed) : random_(seed) {
    load_ = log_uniform(0.3, 3.0);
    shaft_ = log_uniform(400.0, 3000.0);
    to_wall_[seed % 2] = shaft_ * log_uniform(0.1, 3.0);
    if (seed % 3 == 0) to_wall_[(seed + 1) % 2] = shaft_ * log_uniform(0.1, 3.0);
  }

  void write(const testing::TemporaryFolder& folder) {
    testing::write_text(folder.file("drive.yaml"),
                        fmt::format(R"(format: graybox-lumped/1
sample_time: 0.01
motion: translation
masses: {{motor: {:.4g}, load: {:.4g}}}
elements:
  - name: coupling
    location: {{kind: element, between: [motor, load]}}
    law: stiffness
    parameters: {{stiffness: {{value: {:.4g}, unit: N/m}}}}
  - name: coupling_damping
    location: {{kind: element, between: [motor, load]}}
    law: viscous
    parameters: {{damping: {{value: 2, unit: N s/m}}}}
inputs:
  - {{name: force, mass: motor}}
outputs:
  - {{name: motor_position, mass: motor, quantity: position}}
  - {{name: load_position, mass: load, quantity: position}}
)",
                                    log_uniform(0.8, 1.25), load_ * log_uniform(0.8, 1.25),
                                    shaft_ * log_uniform(0.8, 1.25)));
    testing::write_text(folder.file("campaign.yaml"), R"(format: graybox-campaign/1
sample_time: 0.01
channels:
  - {name: force, unit: N, is: input}
  - {name: motor_position, unit: m, is: output}
  - {name: load_position, unit: m, is: output}
hold: zero
experiments:
  - {file: run.csv}
)");
    write_run(folder.file("run.csv"));
  }

 private:
  double log_uniform(double low, double high) {
    return std::exp(std::uniform_real_distribution<double>(std::log(low), std::log(high))(random_));
  }

  void write_run(const std::string& file) {
    constexpr double kStep = 0.01;
    constexpr int kSamples = 500, kSteps = 40;
    std::normal_distribution<double> normal;
    std::ofstream out(file);
    out << "force,motor_position,load_position\n";
    double x[2] = {0.0, 0.0}, v[2] = {0.0, 0.0}, force = 0.0;
    for (int k = 0; k < kSamples; ++k) {
      if (k % 9 == 0) force = 10.0 * normal(random_);
      out << fmt::format("{:.9g},{:.9g},{:.9g}\n", force, x[0] + 2e-6 * normal(random_),
                         x[1] + 2e-6 * normal(random_));
      for (int s = 0; s < kSteps; ++s) {
        const double pull = shaft_ * (x[0] - x[1]) + 2.0 * (v[0] - v[1]);
        v[0] += kStep / kSteps * (force - pull - to_wall_[0] * x[0] - 0.5 * v[0]);
        v[1] += kStep / kSteps * (pull - to_wall_[1] * x[1] - 0.3 * v[1]) / load_;
        for (int i = 0; i < 2; ++i) x[i] += kStep / kSteps * v[i];
      }
    }
  }

  std::mt19937_64 random_;
  double load_ = 1.0, shaft_ = 1000.0, to_wall_[2] = {0.0, 0.0};
};

// A spring to the wall that the model lacks is no wrong sign of either encoder.
TEST(ReversedOutputs, AreNoneWhereMassesMoveTogether) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const testing::TemporaryFolder folder;
    MassesOnSprings(seed).write(folder);
    const std::string said = faults_of(folder);
    EXPECT_EQ(said.find("position has the wrong sign"), std::string::npos) << seed << said;
  }
}

std::string faults_of_drive(double load_factor) {
  const testing::TemporaryFolder folder;
  SimulatedDrive({"nothing", true, 11, 0.0, load_factor})
      .write(std::filesystem::path(folder.file("")));
  return faults_of(folder);
}

// Behind a gear the load's encoder has the right sign and another scale.
TEST(ReversedOutputs, BehindAGearAreScaled) {
  for (const double ratio : {0.25, 4.0}) {
    const std::string said = faults_of_drive(ratio);
    EXPECT_EQ(said.find("wrong sign"), std::string::npos) << said;
    EXPECT_NE(said.find("times as far as motor_angle"), std::string::npos) << said;
    EXPECT_NE(said.find("kind: scale, of: [load_angle]"), std::string::npos) << said;
  }
  EXPECT_EQ(faults_of_drive(1.0), "");
  EXPECT_NE(faults_of_drive(-1.0).find("load_angle has the wrong sign"), std::string::npos);
}

}  // namespace
}  // namespace graybox
