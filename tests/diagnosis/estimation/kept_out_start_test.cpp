// The state in which free runs of recordings kept out begin: by the model that was found, however
// poor the model was by which it was sought.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>
#include <random>
#include <string>

#include "diagnosis/prediction_verdict/prediction_diagnosis.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

constexpr const char* kSpring =
    "  - {name: spring, location: {kind: element, mass: cart}, law: stiffness, parameters: "
    "{stiffness: {value: 50, unit: N/m}}}\n";

void write_model(const std::filesystem::path& file, const std::string& spring) {
  std::ofstream(file)
      << "format: graybox-lumped/1\nsample_time: 0.01\nmotion: translation\nmasses: {cart: 2}\n"
      << "elements:\n"
      << spring
      << "  - {name: damper, location: {kind: element, mass: cart}, law: viscous, parameters: "
         "{damping: {value: 0.02, unit: N s/m}}}\n"
      << "inputs:\n  - {name: force, mass: cart}\noutputs:\n"
      << "  - {name: y, mass: cart, quantity: position}\n";
}

// A cart on a spring that hardly damps, pushed by held forces; its position has white noise.
void write_run(const std::filesystem::path& file, std::mt19937& random) {
  constexpr int kSamples = 2000, kHeld = 20, kParts = 50;
  constexpr double kStep = 0.01, kMass = 2.0, kStiffness = 50.0, kDamping = 0.02, kNoise = 1e-3;
  std::normal_distribution<double> normal;
  std::ofstream out(file);
  out << "time,force,y\n";
  double x = 0.0, v = 0.0, force = 0.0;
  for (int k = 0; k < kSamples; ++k) {
    if (k % kHeld == 0) force = 3.0 * normal(random);
    out << fmt::format("{:.6g},{:.9g},{:.9g}\n", kStep * k, force, x + kNoise * normal(random));
    for (int part = 0; part < kParts; ++part) {
      v += (force - kStiffness * x - kDamping * v) / kMass * kStep / kParts;
      x += v * kStep / kParts;
    }
  }
}

class KeptOutStart : public ::testing::Test {
 protected:
  // Error kept out of what was found, % of the signal.
  [[nodiscard]] double error_of(const std::string& model) const {
    const PredictionDiagnosis result = diagnose_by_prediction(
        folder_.file(model), read_campaign(folder_.file("campaign.yaml")), SearchOptions{});
    return result.diagnosis.validation_after.value().nrmse;
  }

  testing::TemporaryFolder folder_;
};

TEST_F(KeptOutStart, AModelThatWasFoundPredictsAsWellAsOneThatWasGiven) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    std::mt19937 random(seed);
    for (const char* run : {"run_1.csv", "run_2.csv"}) write_run(folder_.file(run), random);
    std::ofstream(folder_.file("campaign.yaml"))
        << "format: graybox-campaign/1\nsample_time: 0.01\nchannels:\n"
           "  - {name: force, unit: N, is: input}\n  - {name: y, unit: m, is: output}\n"
           "hold: zero\nexperiments:\n  - {file: run_1.csv}\n"
           "  - {file: run_2.csv, role: validation}\n";
    write_model(folder_.file("given.yaml"), kSpring);
    write_model(folder_.file("lacks.yaml"), "");
    const double given = error_of("given.yaml"), found = error_of("lacks.yaml");
    EXPECT_LT(found, 1.2 * given) << seed;
  }
}

}  // namespace
}  // namespace graybox
