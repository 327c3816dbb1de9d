// Exact machines whose angle is read in whole counts of a coarse encoder, and starts that are off
// by orders of magnitude: what is there is found, and nothing else.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <functional>
#include <numbers>
#include <string>

#include "diagnosis/prediction_verdict/prediction_diagnosis.hpp"
#include "diagnosis/recordings/campaign.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

constexpr double kStep = 1e-3;  // s

struct Machine {
  double inertia = 0.4, damping = 12.0, friction = 0.0;  // kg m^2, N m s/rad, N m
};

double square_and_sine(double t) {
  if (t <= 0.1) return 0.0;
  const double square = std::sin(2.0 * std::numbers::pi * 1.3 * t) > 0.0 ? 1.0 : -1.0;
  return 0.7 * square + 0.5 * std::sin(2.0 * std::numbers::pi * 2.3 * t);
}

// Two pulses, and rest before, between and after.
double two_pulses(double t) {
  if (t > 0.1 && t < 0.25) return 1.0;
  return t > 1.0 && t < 1.15 ? -1.0 : 0.0;
}

// The first half of the log for the fit, the second kept out.
class CoarseEncoder : public ::testing::Test {
 protected:
  Diagnosis diagnosed(const Machine& machine, double counts, const Machine& start, double drive,
                      const std::function<double(double)>& torque) {
    write_log(machine, counts, drive, torque);
    std::ofstream(folder_.file("model.yaml"))
        << "format: graybox-lumped/1\nsample_time: 0.001\nmotion: rotation\nmasses: {axis: "
        << start.inertia
        << "}\nelements:\n  - {name: bearing, location: {kind: element, mass: axis}, law: viscous, "
           "parameters: {damping: {value: "
        << start.damping
        << ", unit: N m s/rad}}}\ninputs:\n  - {name: torque, mass: axis}\noutputs:\n"
           "  - {name: angle, mass: axis, quantity: position}\n";
    std::ofstream(folder_.file("campaign.yaml"))
        << "format: graybox-campaign/1\nsample_time: 0.001\nchannels:\n"
           "  - {name: torque, unit: N m, is: input}\n  - {name: angle, unit: rad, is: output}\n"
           "hold: zero\nexperiments:\n  - {file: log.csv, segments: [[0, 1199]]}\n"
           "  - {file: log.csv, segments: [[1200, 2399]], role: validation}\n";
    result_ = diagnose_by_prediction(folder_.file("model.yaml"),
                                     read_campaign(folder_.file("campaign.yaml")), {}, 1);
    return result_.diagnosis;
  }
  [[nodiscard]] std::string first_law() const {
    if (result_.diagnosis.effects.empty()) return "";
    return result_.hypotheses[result_.diagnosis.effects[0].law.hypothesis].law;
  }

 private:
  void write_log(const Machine& machine, double counts, double drive,
                 const std::function<double(double)>& torque) const {
    constexpr int kSubsteps = 20;
    const double h = kStep / kSubsteps, width = 2.0 * std::numbers::pi / counts;
    std::ofstream file(folder_.file("log.csv"));
    file.precision(10);
    file << "torque,angle\n";
    double angle = 0.0, speed = 0.0;
    for (int k = 0; k < 2400; ++k) {
      const double u = drive * torque(kStep * k);
      file << u << ',' << width * std::round(angle / width) << '\n';
      for (int i = 0; i < kSubsteps; ++i) {
        const double dry = machine.friction * std::tanh(speed / 0.02);
        speed = (speed + h * (u - dry) / machine.inertia) /
                (1.0 + h * machine.damping / machine.inertia);
        angle += h * speed;
      }
    }
  }

  testing::TemporaryFolder folder_;
  PredictionDiagnosis result_;
};

// Differentiating counts twice makes such a start: 150 times too light.
TEST_F(CoarseEncoder, NothingIsFoundInARigidMachineWhereverTheFitBegins) {
  for (const double counts : {400.0, 600.0, 1000.0}) {
    for (const Machine& start : {Machine{0.0027, 11.4}, Machine{1.0, 0.01}, Machine{0.3, 10.0}}) {
      const Diagnosis diagnosis =
          diagnosed({0.4, 12.0, 0.0}, counts, start, 200.0, square_and_sine);
      EXPECT_EQ(diagnosis.verdict, Verdict::kNone)
          << counts << " counts from " << start.inertia << ": " << first_law();
      ASSERT_FALSE(diagnosis.after.model_parameters.empty());
      EXPECT_NEAR(diagnosis.after.model_parameters[0].value, 0.4, 0.02);
    }
  }
}

// Forces that no window of a tenth of a second shows beside the counts add up over the recording.
TEST_F(CoarseEncoder, DryFrictionIsFoundWhereNoWindowShowsIt) {
  for (const double counts : {400.0, 1000.0}) {
    const Diagnosis diagnosis =
        diagnosed({0.05, 0.3, 1.0}, counts, {0.04, 0.4, 0.0}, 5.0, square_and_sine);
    EXPECT_EQ(diagnosis.verdict, Verdict::kExplained);
    ASSERT_EQ(first_law(), "coulomb");
    const LawParameterEstimate& level = diagnosis.effects[0].law.parameters[0];
    EXPECT_NEAR(level.value, 1.0, 3.0 * level.standard_error + 0.01);
  }
}

// Counts that stand still are no white noise, and nothing is missing all the same.
TEST_F(CoarseEncoder, StandingBetweenPulsesIsNoDisturbance) {
  const Diagnosis diagnosis =
      diagnosed({0.4, 12.0, 0.0}, 400.0, {0.3, 10.0, 0.0}, 255.0, two_pulses);
  EXPECT_EQ(diagnosis.verdict, Verdict::kNone) << first_law();
}

}  // namespace
}  // namespace graybox
