// Logs of a carriage on a line: position, velocity, acceleration and force along a sum of sines.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <string>
#include <utility>

#include "diagnosis/force_balance/force_balance_mismatch.hpp"
#include "diagnosis/search/diagnosis_search.hpp"
#include "problems/base/random.hpp"
#include "tests/support/carriage_files.hpp"

namespace graybox::testing {

// A carriage moved along a sum of sines; the force is that of its mass, a law and noise.
class RecordedCarriage : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(::testing::TempDir()) /
              ::testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::create_directories(folder_);
    std::ofstream(folder_ / "drive.yaml") << kCarriageModel;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  // `memory`: correlation of the noise from sample to sample. `late`: s, by which the motion is
  // recorded behind the force.
  template <typename Force>
  void record(Force force, double noise, std::uint64_t seed, double memory = 0.0,
              double late = 0.0) {
    memory_ = memory;
    late_ = late;
    Random random(seed);
    write("run_1.csv", force, noise, 0.0, random);
    write("run_2.csv", force, noise, 1.3, random);
    std::ofstream(folder_ / "campaign.yaml") << kCarriageCampaign << R"(  - {file: run_1.csv}
  - {file: run_2.csv, role: validation}
)";
  }

  [[nodiscard]] std::unique_ptr<MismatchProblem> problem() const {
    return force_balance_problem(folder_ / "drive.yaml", read_campaign(folder_));
  }

  std::filesystem::path folder_;
  double limit_ = std::numeric_limits<double>::infinity();  // of the recorded force

 private:
  double memory_ = 0.0, late_ = 0.0;

  // Position, velocity and acceleration.
  static std::array<double, 3> motion_at(double t, double phase) {
    std::array<double, 3> motion{};
    for (const auto& [amplitude, w] :
         {std::pair{0.3, 1.1}, std::pair{0.1, 2.9}, std::pair{0.03, 6.1}}) {
      motion[0] += amplitude * std::sin(w * t + phase);
      motion[1] += amplitude * w * std::cos(w * t + phase);
      motion[2] -= amplitude * w * w * std::sin(w * t + phase);
    }
    return motion;
  }

  template <typename Force>
  void write(const std::string& name, Force force, double noise, double phase, Random& random) {
    std::ofstream file(folder_ / name);
    file.precision(12);
    file << "force,x,v,a\n";
    double disturbance = random.normal();
    for (int k = 0; k < 1500; ++k) {
      disturbance = memory_ * disturbance + std::sqrt(1.0 - memory_ * memory_) * random.normal();
      const double t = 0.01 * k;
      const auto [x, v, a] = motion_at(t, phase);
      const auto [then_x, then_v, then_a] = motion_at(t - late_, phase);
      const double acts = 12.0 * a + force(x, v) + noise * disturbance;
      file << std::clamp(acts, -limit_, limit_) << ',' << then_x << ',' << then_v << ',' << then_a
           << '\n';
    }
  }
};

inline const Hypothesis& named(const MismatchProblem& problem, const FoundEffect& effect) {
  return problem.hypotheses()[effect.law.hypothesis];
}

}  // namespace graybox::testing
