// Frequency responses with their uncertainty, against a simulated loop whose response is known.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <complex>
#include <memory>
#include <numbers>
#include <optional>
#include <vector>

#include "graybox/diagnosis/responses/confidence.hpp"
#include "graybox/diagnosis/responses/covariance_pool.hpp"
#include "graybox/diagnosis/responses/line_spectra.hpp"
#include "graybox/diagnosis/responses/periodic_response.hpp"
#include "graybox/diagnosis/simulation/closed_loop.hpp"
#include "graybox/diagnosis/simulation/exact_plant.hpp"
#include "graybox/diagnosis/simulation/multisine.hpp"
#include "graybox/problems/distributions.hpp"
#include "graybox/problems/error.hpp"
#include "graybox/problems/random.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;

constexpr double kSampleTime = 0.002;
constexpr std::size_t kPeriod = 200;

// Two motors, each on a spring to a common load.
LinearMotion two_motors() {
  LinearMotion motion;
  motion.mass = Eigen::Vector3d(0.02, 0.03, 0.2).asDiagonal();
  motion.stiffness.resize(3, 3);
  motion.stiffness << 60.0, 0.0, -60.0, 0.0, 90.0, -90.0, -60.0, -90.0, 150.0;
  motion.damping = 2e-3 * motion.stiffness;
  motion.input = MatrixXd::Identity(3, 2);
  motion.position_output = MatrixXd::Zero(2, 3);
  motion.velocity_output = MatrixXd::Identity(2, 3);
  motion.rest = Eigen::Vector3d::Zero();
  motion.rest_input = Eigen::Vector2d::Zero();
  motion.rest_force = Eigen::Vector3d::Zero();
  return motion;
}

PiController controller() { return {Eigen::Vector2d(0.5, 0.7), Eigen::Vector2d(0.1, 0.2)}; }

// exp(A) by Taylor series of A / 2^10, squared.
MatrixXd exponential(const MatrixXd& a) {
  const MatrixXd small = a / 1024.0;
  MatrixXd sum = MatrixXd::Identity(a.rows(), a.cols()), term = sum;
  for (int k = 1; k < 20; ++k) {
    term = (term * small / k).eval();
    sum += term;
  }
  for (int k = 0; k < 10; ++k) sum = (sum * sum).eval();
  return sum;
}

// C (z - A_d)^-1 B_d of the plant with its input held between samples.
MatrixXcd held_response(const LinearMotion& motion, double w) {
  const Index n = motion.mass.rows(), m = motion.input.cols();
  const MatrixXd inverse = motion.mass.inverse();
  MatrixXd block = MatrixXd::Zero(2 * n + m, 2 * n + m);
  block.block(0, n, n, n).setIdentity();
  block.block(n, 0, n, n) = -inverse * motion.stiffness;
  block.block(n, n, n, n) = -inverse * motion.damping;
  block.block(n, 2 * n, n, m) = inverse * motion.input;
  const MatrixXd held = exponential(block * kSampleTime);
  MatrixXcd pencil = -held.topLeftCorner(2 * n, 2 * n).cast<Complex>();
  pencil.diagonal().array() += std::polar(1.0, w * kSampleTime);
  const MatrixXcd states =
      pencil.partialPivLu().solve(held.topRightCorner(2 * n, m).cast<Complex>());
  return motion.velocity_output.cast<Complex>() * states.bottomRows(n);
}

struct CampaignOptions {
  std::size_t periods = 4;
  std::size_t realisations = 1;
  double level = 1.0;
  double noise_psd_slope = 4e-10;
  double white_noise = 0.0;
  std::vector<std::size_t> lines{3, 5, 7, 9, 13, 17, 21, 27, 35, 45, 57, 71};
};

double frequency_of(std::size_t line) {
  return 2.0 * std::numbers::pi * static_cast<double>(line) /
         (static_cast<double>(kPeriod) * kSampleTime);
}

FrequencyResponseEstimate empty_estimate(const std::vector<std::size_t>& lines) {
  FrequencyResponseEstimate estimate;
  estimate.inputs = {"u_1", "u_2"};
  estimate.outputs = {"y_1", "y_2"};
  estimate.lines = lines;
  for (const std::size_t line : lines) estimate.frequencies.push_back(frequency_of(line));
  return estimate;
}

class TwoMotorLoop : public ::testing::Test {
 protected:
  // Outputs, inputs, references: [samples x 6].
  MatrixXd record(const CampaignOptions& options, Index sub_experiment, std::uint64_t phases,
                  std::uint64_t noise) {
    const Multisine signal({.period = kPeriod,
                            .lines = options.lines,
                            .relative_amplitude = {},
                            .inputs = 2,
                            .rms = options.level},
                           phases);
    ClosedLoopOptions loop{.settling_periods = 6,
                           .periods = options.periods,
                           .noise_psd_slope = options.noise_psd_slope,
                           .white_noise = {},
                           .seed = noise};
    if (options.white_noise > 0.0) {
      loop.white_noise = Eigen::Vector2d::Constant(options.white_noise);
    }
    const Recording recording = simulate_closed_loop(*plant_, controller(), kSampleTime,
                                                     signal.reference(sub_experiment), loop);
    MatrixXd columns(recording.output.cols(), 6);
    columns << recording.output.transpose(), recording.input.transpose(),
        recording.reference.transpose();
    return columns;
  }

  std::vector<PeriodicRecord> records(const CampaignOptions& options, std::uint64_t seed) {
    std::vector<PeriodicRecord> result;
    RealTransform transform(kPeriod * options.periods);
    for (std::size_t m = 1; m <= options.realisations; ++m) {
      for (Index e = 0; e < 2; ++e) {
        const MatrixXd signals =
            record(options, e, 17 * seed + m, 1000 * seed + 10 * m + static_cast<std::uint64_t>(e));
        result.push_back(
            {m, static_cast<std::size_t>(e) + 1,
             line_spectra(signals, {kPeriod, options.periods, options.lines}, {}, transform)});
      }
    }
    return result;
  }

  FrequencyResponseEstimate estimate(const CampaignOptions& options, std::uint64_t seed) {
    const auto all = records(options, seed);
    std::vector<const PeriodicRecord*> pointers;
    for (const PeriodicRecord& one : all) pointers.push_back(&one);
    FrequencyResponseEstimate result = empty_estimate(options.lines);
    estimate_periodic_response(pointers, 2, {}, "test", result);
    return result;
  }

  std::unique_ptr<Plant> plant_ = exact_plant(two_motors(), kSampleTime);
};

// Share of estimates whose region of 95 % holds the truth, by line.
struct Coverage {
  Coverage(std::size_t lines, const std::vector<MatrixXcd>& responses)
      : truth(responses), whole(lines, 0.0), entries(lines, 0.0) {}
  void add(const FrequencyResponseEstimate& estimate) {
    ++count;
    for (std::size_t k = 0; k < truth.size(); ++k) {
      const MatrixXcd error = estimate.responses[k] - truth[k];
      const auto& covariance = estimate.best_covariance()[k];
      const double p = response_tail(response_statistic(covariance, estimate.input_gram[k], error),
                                     2, 2, covariance.degrees_of_freedom);
      whole[k] += p > 0.05 ? 1.0 : 0.0;
      const MatrixXd radius = confidence_radius(estimate, k, 0.95);
      entries[k] += (error.cwiseAbs().array() < radius.array()).cast<double>().mean();
    }
  }
  // Within four standard deviations of 95 %, at every line and on average.
  void expect_nominal() const {
    double mean_whole = 0.0, mean_entries = 0.0;
    const double deviation = std::sqrt(0.95 * 0.05 / count);
    for (std::size_t k = 0; k < truth.size(); ++k) {
      EXPECT_NEAR(whole[k] / count, 0.95, 4.0 * deviation) << "line " << k;
      EXPECT_NEAR(entries[k] / count, 0.95, 4.0 * deviation) << "line " << k;
      mean_whole += whole[k] / count / static_cast<double>(truth.size());
      mean_entries += entries[k] / count / static_cast<double>(truth.size());
    }
    EXPECT_NEAR(mean_whole, 0.95, 2.0 * deviation);
    EXPECT_NEAR(mean_entries, 0.95, 2.0 * deviation);
  }
  std::vector<MatrixXcd> truth;
  std::vector<double> whole, entries;
  double count = 0.0;
};

std::vector<MatrixXcd> truth_at(const std::vector<std::size_t>& lines) {
  std::vector<MatrixXcd> responses;
  for (const std::size_t line : lines) {
    responses.push_back(held_response(two_motors(), frequency_of(line)));
  }
  return responses;
}

TEST_F(TwoMotorLoop, WithoutNoiseTheResponseIsThatOfThePlantBehindItsHold) {
  CampaignOptions options;
  options.noise_psd_slope = 0.0;
  const auto result = estimate(options, 1);
  const auto truth = truth_at(options.lines);
  for (std::size_t k = 0; k < truth.size(); ++k) {
    EXPECT_LT((result.responses[k] - truth[k]).norm(), 1e-6 * truth[k].norm()) << k;
  }
}

TEST_F(TwoMotorLoop, RegionsOfNinetyFivePercentHoldTheTruthSoOften) {
  for (const std::size_t periods : {2U, 4U}) {
    SCOPED_TRACE(periods);
    CampaignOptions options;
    options.periods = periods;
    Coverage coverage(options.lines.size(), truth_at(options.lines));
    for (std::uint64_t seed = 1; seed <= 400; ++seed) coverage.add(estimate(options, seed));
    coverage.expect_nominal();
  }
}

TEST_F(TwoMotorLoop, TotalCovarianceOfRealisationsCoversTheTruthToo) {
  CampaignOptions options;
  options.realisations = 5;
  options.periods = 2;
  Coverage coverage(options.lines.size(), truth_at(options.lines));
  for (std::uint64_t seed = 1; seed <= 250; ++seed) {
    const auto result = estimate(options, seed);
    ASSERT_FALSE(result.total.empty());
    coverage.add(result);
  }
  coverage.expect_nominal();
}

}  // namespace
}  // namespace graybox
