// Frequency responses with their uncertainty, against a simulated loop whose response is known.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <complex>
#include <memory>
#include <numbers>
#include <tuple>
#include <vector>

#include "diagnosis/responses/closed_loop_bias.hpp"
#include "diagnosis/responses/confidence.hpp"
#include "diagnosis/responses/covariance_pool.hpp"
#include "diagnosis/responses/distortion.hpp"
#include "diagnosis/responses/local_polynomial.hpp"
#include "diagnosis/responses/periodic_response.hpp"
#include "diagnosis/responses/settling.hpp"
#include "diagnosis/signals/line_spectra.hpp"
#include "diagnosis/signals/multisine.hpp"
#include "diagnosis/simulation/closed_loop.hpp"
#include "diagnosis/simulation/exact_plant.hpp"
#include "problems/base/distributions.hpp"
#include "problems/base/error.hpp"
#include "problems/base/random.hpp"

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
  std::size_t settling_periods = 6;
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

FrequencyResponseEstimate empty_estimate(const CampaignOptions& options) {
  FrequencyResponseEstimate estimate;
  estimate.inputs = {"u_1", "u_2"};
  estimate.outputs = {"y_1", "y_2"};
  estimate.lines = options.lines;
  estimate.period = kPeriod;
  estimate.periods = options.periods;
  estimate.sample_time = kSampleTime;
  for (const std::size_t line : options.lines) estimate.frequencies.push_back(frequency_of(line));
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
    ClosedLoopOptions loop{.settling_periods = options.settling_periods,
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
        const MatrixXcd spectra = record_spectra(signals, transform);
        const PeriodicLayout layout{kPeriod, options.periods, options.lines};
        const PeriodicLayout silent{kPeriod, options.periods, detection_lines(layout)};
        result.push_back({m, static_cast<std::size_t>(e) + 1, line_spectra(spectra, layout, {}),
                          line_spectra(spectra, silent, {})});
      }
    }
    return result;
  }

  FrequencyResponseEstimate estimate(const CampaignOptions& options, std::uint64_t seed) {
    const auto all = records(options, seed);
    std::vector<const PeriodicRecord*> pointers;
    for (const PeriodicRecord& one : all) pointers.push_back(&one);
    FrequencyResponseEstimate result = empty_estimate(options);
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
    for (std::uint64_t seed = 1; seed <= 200; ++seed) coverage.add(estimate(options, seed));
    coverage.expect_nominal();
  }
}

TEST_F(TwoMotorLoop, TotalCovarianceOfRealisationsCoversTheTruthToo) {
  CampaignOptions options;
  options.realisations = 5;
  options.periods = 2;
  Coverage coverage(options.lines.size(), truth_at(options.lines));
  for (std::uint64_t seed = 1; seed <= 120; ++seed) {
    const auto result = estimate(options, seed);
    ASSERT_FALSE(result.total.empty());
    coverage.add(result);
  }
  coverage.expect_nominal();
}

// Nothing but noise differs: detection lines, realisations and settling are rejected as often as
// said.
TEST_F(TwoMotorLoop, TestsOfLinearityRejectALinearPlantAsOftenAsTheySay) {
  CampaignOptions options;
  options.periods = 2;
  options.realisations = 2;
  double odd = 0.0, odd_count = 0.0, even = 0.0, even_count = 0.0, total = 0.0, count = 0.0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    const auto result = estimate(options, seed);
    for (const DetectionLine& line : result.detection) {
      const double rejected = (line.p_value.array() < 0.05).cast<double>().mean();
      (line.even() ? even : odd) += rejected;
      (line.even() ? even_count : odd_count) += 1.0;
    }
    total += (result.nonlinearity_p_value.array() < 0.05).cast<double>().mean();
    count += 1.0;
  }
  EXPECT_EQ(odd_count, 100.0 * 23);  // odd lines 3 to 71 but for the 12 excited
  EXPECT_EQ(even_count, 100.0 * 34);
  EXPECT_NEAR(odd / odd_count, 0.05, 0.015);
  EXPECT_NEAR(even / even_count, 0.05, 0.015);
  EXPECT_NEAR(total / count, 0.05, 0.02);
}

// A square or a cube of the first input is added to the first output.
TEST_F(TwoMotorLoop, SilentLinesTellOddFromEven) {
  CampaignOptions options;
  options.noise_psd_slope = 0.0;
  options.settling_periods = 30;
  for (const bool even : {false, true}) {
    std::vector<PeriodicRecord> records;
    RealTransform transform(kPeriod * options.periods);
    const PeriodicLayout layout{kPeriod, options.periods, options.lines};
    const PeriodicLayout silent{kPeriod, options.periods, detection_lines(layout)};
    for (Index e = 0; e < 2; ++e) {
      MatrixXd signals = record(options, e, 5, 50 + static_cast<std::uint64_t>(e));
      // Two motors may hold against each other for good: not counted.
      const Eigen::ArrayXd u = signals.col(2).array() - signals.col(2).mean();
      signals.col(0).array() += 0.02 * u.pow(even ? 2 : 3);
      const MatrixXcd spectra = record_spectra(signals, transform);
      records.push_back({1, static_cast<std::size_t>(e) + 1, line_spectra(spectra, layout, {}),
                         line_spectra(spectra, silent, {})});
    }
    FrequencyResponseEstimate result = empty_estimate(options);
    estimate_periodic_response({&records[0], &records[1]}, 2, {}, "test", result);
    double answered = 0.0, quiet = 0.0;
    for (const DetectionLine& line : result.detection) {
      (line.even() == even ? answered : quiet) +=
          line.level(0) * line.level(0) - line.noise(0) * line.noise(0);
    }
    EXPECT_GT(answered, 100.0 * std::abs(quiet)) << even;
  }
}

TEST_F(TwoMotorLoop, SeesATransientAndOnlyThat) {
  CampaignOptions options;
  options.periods = 2;
  int alarms = 0, seen = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    MatrixXd signals = record(options, 0, seed, seed);
    for (Index c = 0; c < 4; ++c) {
      alarms += settling_p_value(signals.col(c), kPeriod) < 0.01 ? 1 : 0;
    }
    const double rms = signals.col(0).norm() / std::sqrt(static_cast<double>(signals.rows()));
    for (Index t = 0; t < signals.rows(); ++t) {
      signals(t, 0) += 0.3 * rms * std::exp(-static_cast<double>(t) / 60.0);
    }
    seen += settling_p_value(signals.col(0), kPeriod) < 0.01 ? 1 : 0;
  }
  EXPECT_LE(alarms, 24);  // of 800
  EXPECT_GE(seen, 190);
}

// Outputs in mrad/s and inputs in kN m: G_hat, covariances and p-values scale with the units.
TEST_F(TwoMotorLoop, UnitsAndTheOrderOfChannelsDoNotMatter) {
  CampaignOptions options;
  options.realisations = 2;
  const auto all = records(options, 3);
  const auto estimate_of = [&](const Eigen::VectorXd& scale, const Eigen::VectorXi& order) {
    std::vector<PeriodicRecord> changed = all;
    std::vector<const PeriodicRecord*> pointers;
    for (PeriodicRecord& one : changed) {
      for (LineSpectra* spectra : {&one.spectra, &one.detection}) {
        spectra->values = (scale.asDiagonal() * spectra->values).eval()(order, Eigen::all).eval();
        for (MatrixXcd& samples : spectra->samples) {
          samples = (scale.asDiagonal() * samples).eval()(order, Eigen::all).eval();
        }
      }
      pointers.push_back(&one);
    }
    FrequencyResponseEstimate result = empty_estimate(options);
    estimate_periodic_response(pointers, 2, {}, "test", result);
    return result;
  };
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(6);
  Eigen::VectorXd scale(6);
  scale << 1e3, 10.0, 1e-3, 1e-3, 1.0, 1.0;
  Eigen::VectorXi straight(6), swapped(6);
  straight << 0, 1, 2, 3, 4, 5;
  swapped << 1, 0, 3, 2, 5, 4;
  const auto plain = estimate_of(ones, straight);
  const auto scaled = estimate_of(scale, straight);
  const auto turned = estimate_of(ones, swapped);
  const Eigen::Matrix2d exchange =
      Eigen::Vector2i(1, 0).asPermutation().toDenseMatrix().cast<double>();
  for (std::size_t k = 0; k < plain.lines.size(); ++k) {
    const MatrixXcd rescaled = scale.head(2).cwiseInverse().asDiagonal() * scaled.responses[k] *
                               scale.segment(2, 2).asDiagonal();
    EXPECT_LT((rescaled - plain.responses[k]).norm(), 1e-9 * plain.responses[k].norm());
    EXPECT_LT((exchange * turned.responses[k] * exchange - plain.responses[k]).norm(),
              1e-9 * plain.responses[k].norm());
    const auto& phi = plain.total[k].covariance;
    const MatrixXcd rescaled_phi = scale.head(2).cwiseInverse().asDiagonal() *
                                   scaled.total[k].covariance *
                                   scale.head(2).cwiseInverse().asDiagonal();
    EXPECT_LT((rescaled_phi - phi).norm(), 1e-8 * phi.norm());
  }
  EXPECT_LT((scaled.nonlinearity_p_value - plain.nonlinearity_p_value).norm(), 1e-6);
}

TEST_F(TwoMotorLoop, AMeasurementWhitensItsErrorOnAverage) {
  CampaignOptions options;
  const auto truth = truth_at(options.lines);
  double sum = 0.0;
  const int campaigns = 150;
  for (int seed = 1; seed <= campaigns; ++seed) {
    const auto result = estimate(options, static_cast<std::uint64_t>(seed));
    const ResponseMeasurement measurement = response_measurement(result);
    for (std::size_t k = 0; k < truth.size(); ++k) {
      const MatrixXcd error = result.responses[k] - truth[k];
      sum += (measurement.noise[k].left * error * measurement.noise[k].right).squaredNorm();
      // Lambda from the factors, but for the weight of an estimated covariance.
      const double q = result.noise[k].degrees_of_freedom;
      const MatrixXcd lambda = measurement.noise[k].covariance() * ((q - 2.0) / q);
      for (Index i = 0; i < 2; ++i) {
        for (Index j = 0; j < 2; ++j) {
          EXPECT_NEAR(lambda(j * 2 + i, j * 2 + i).real(), result.variance(k)(i, j),
                      1e-6 * result.variance(k)(i, j));
        }
      }
    }
  }
  EXPECT_NEAR(sum / (campaigns * 12.0 * 4.0), 1.0, 0.08);
}

// ---- closed-loop bias ---------------------------------------------------------------------------

MatrixXcd random_matrix(Random& random, Index rows, Index columns) {
  MatrixXcd z(rows, columns);
  for (Complex& entry : z.reshaped()) {
    const double real = random.normal();
    entry = Complex(real, random.normal()) * std::sqrt(0.5);
  }
  return z;
}

TEST(ClosedLoopBias, HasItsClosedForms) {
  for (const double power : {0.0, 0.4, 3.0, 20.0}) {
    EXPECT_NEAR(quotient_bias(Eigen::VectorXd::Constant(1, power))(0), std::exp(-power), 1e-12);
    // Equal inputs: exp(-s^2) (1 + s^2/2) for two.
    const Eigen::VectorXd two = quotient_bias(Eigen::VectorXd::Constant(2, power));
    EXPECT_NEAR(two(0), std::exp(-power) * (1.0 + 0.5 * power), 1e-11);
  }
  // One strong input leaves the bias of the other.
  EXPECT_NEAR(quotient_bias(Eigen::Vector2d(1e4, 0.5))(1), std::exp(-0.5), 0.01);
  EXPECT_EQ(quotient_bias(Eigen::Vector3d(70.0, 80.0, 90.0)).norm(), 0.0);
}

TEST(ClosedLoopBias, IsTheMeanOfQuotients) {
  Random random(2);
  const Eigen::Vector3d s(1.2, 1.5, 1.9);
  const Eigen::VectorXd expected = quotient_bias(s.cwiseAbs2());
  MatrixXcd sum = MatrixXcd::Zero(3, 3);
  const int draws = 40000;
  for (int k = 0; k < draws; ++k) {
    const MatrixXcd z = random_matrix(random, 3, 3);
    MatrixXcd a = z;
    a.diagonal() += s.cast<Complex>();
    const MatrixXcd quotient = z * a.inverse();
    if (quotient.norm() < 100.0) sum += quotient;  // the mean has no variance
  }
  sum /= draws;
  for (Index i = 0; i < 3; ++i) EXPECT_NEAR(sum(i, i).real(), expected(i), 0.03) << i;
}

// Noise of the input that the output's contains too, as feedback makes it: the bias that the
// samples of the noise predict is that of the estimates.
TEST(ClosedLoopBias, IsFoundFromSamplesOfTheNoise) {
  Random random(4);
  const MatrixXcd plant = random_matrix(random, 2, 2);
  const MatrixXcd feedback = 2.0 * random_matrix(random, 2, 2);
  MatrixXcd input = MatrixXcd::Zero(2, 2);
  input.diagonal() << 1.6, Complex(0.0, 1.3);
  MatrixXcd mean = MatrixXcd::Zero(2, 2);
  const int draws = 40000;
  int used = 0;
  for (int k = 0; k < draws; ++k) {
    const MatrixXcd noise = random_matrix(random, 2, 2);
    const MatrixXcd response = plant + feedback * noise * (input + noise).inverse();
    if (response.norm() > 100.0) continue;
    mean += response;
    ++used;
  }
  mean /= used;
  const MatrixXcd noise = random_matrix(random, 2, 4000);
  MatrixXcd samples(4, 4000);
  samples << (plant + feedback) * noise, noise;
  const ClosedLoopBias found =
      closed_loop_bias(mean, input * input.adjoint() + 2.0 * MatrixXcd::Identity(2, 2), samples);
  EXPECT_LT((found.bias - (mean - plant)).norm(), 0.15 * (mean - plant).norm());
  EXPECT_GT(found.share, 0.1);
}

// References so weak that noise takes over: Y U^-1 tends to -F^-1, and the share says so.
TEST_F(TwoMotorLoop, WeakReferencesGiveTheController) {
  CampaignOptions options;
  options.noise_psd_slope = 0.0;
  options.white_noise = 0.1;
  options.periods = 2;
  options.level = 1e-4;
  options.lines = {17, 21, 27};
  const double w = frequency_of(21);
  MatrixXcd controller_inverse = MatrixXcd::Zero(2, 2);
  for (Index i = 0; i < 2; ++i) {
    controller_inverse(i, i) = 1.0 / (controller().proportional(i) *
                                      (1.0 + kSampleTime / controller().integral_time(i) /
                                                 (1.0 - std::polar(1.0, -w * kSampleTime))));
  }
  MatrixXcd mean = MatrixXcd::Zero(2, 2);
  const int campaigns = 100;
  double share = 0.0;
  for (int seed = 1; seed <= campaigns; ++seed) {
    const auto result = estimate(options, static_cast<std::uint64_t>(seed));
    mean += result.responses[1] / campaigns;
    share += result.feedback_share[1] / campaigns;
  }
  EXPECT_LT((mean + controller_inverse).norm(), 0.1 * controller_inverse.norm());
  EXPECT_GT(share, 0.4);
}

// ---- local polynomials --------------------------------------------------------------------------

// White references for as many samples as asked, through the same loop.
class NoiseLoop : public TwoMotorLoop {
 protected:
  static constexpr std::size_t kSamples = 3000;

  std::vector<MatrixXcd> noise_records(double level, double noise, std::uint64_t seed,
                                       std::size_t count) {
    std::vector<MatrixXcd> spectra;
    RealTransform transform(kSamples);
    for (std::size_t e = 0; e < count; ++e) {
      Random random(100 * seed + e);
      MatrixXd reference(2, kSamples);
      for (double& r : reference.reshaped()) r = level * random.normal();
      ClosedLoopOptions loop{.settling_periods = 0,
                             .periods = 1,
                             .noise_psd_slope = 0.0,
                             .white_noise = Eigen::Vector2d::Constant(noise),
                             .seed = 100 * seed + e};
      if (noise == 0.0) loop.white_noise.resize(0);
      const Recording recording =
          simulate_closed_loop(*plant_, controller(), kSampleTime, reference, loop);
      MatrixXd columns(recording.output.cols(), 6);
      columns << recording.output.transpose(), recording.input.transpose(),
          recording.reference.transpose();
      spectra.push_back(record_spectra(columns, transform));
    }
    return spectra;
  }

  FrequencyResponseEstimate estimate(const std::vector<MatrixXcd>& records, bool joint,
                                     double degrees_of_freedom = 0.0) {
    FrequencyResponseEstimate result;
    result.inputs = {"u_1", "u_2"};
    result.outputs = {"y_1", "y_2"};
    result.sample_time = kSampleTime;
    estimate_local_polynomial(records, kSamples, 2,
                              {.order = 2,
                               .degrees_of_freedom = degrees_of_freedom,
                               .from = 15.0,
                               .to = 150.0,
                               .count = 10,
                               .joint = joint},
                              "test", result);
    return result;
  }
};

TEST_F(NoiseLoop, LocalPolynomialsFindTheTruthFromOneRecordAndFromSeveral) {
  for (const std::size_t count : {1U, 3U}) {
    const auto result = estimate(noise_records(1.0, 0.0, 7, count), false);
    for (std::size_t k = 0; k < result.frequencies.size(); ++k) {
      const MatrixXcd truth = held_response(two_motors(), result.frequencies[k]);
      EXPECT_LT((result.responses[k] - truth).norm(), 0.02 * truth.norm()) << count << " " << k;
    }
  }
}

TEST_F(NoiseLoop, LocalPolynomialRegionsHoldTheTruth) {
  const int campaigns = 60;
  for (const bool joint : {false, true}) {
    double inside = 0.0, all = 0.0;
    for (int seed = 1; seed <= campaigns; ++seed) {
      const auto result =
          estimate(noise_records(1.0, 0.02, static_cast<std::uint64_t>(seed), 2), joint, 8.0);
      for (std::size_t k = 0; k < result.frequencies.size(); ++k) {
        const MatrixXcd truth = held_response(two_motors(), result.frequencies[k]);
        const double p = response_tail(
            response_statistic(result.noise[k], result.input_gram[k], result.responses[k] - truth),
            2, 2, result.noise[k].degrees_of_freedom);
        inside += p > 0.05 ? 1.0 : 0.0;
        all += 1.0;
      }
    }
    EXPECT_NEAR(inside / all, 0.95, 4.0 * std::sqrt(0.05 * 0.95 / all) + 0.005) << joint;
  }
}

// Under feedback the direct estimate is biased towards the controller, the joint one is not.
TEST_F(NoiseLoop, JointInputOutputTakesTheBiasOfFeedbackAway) {
  MatrixXcd direct = MatrixXcd::Zero(2, 2), joint = direct;
  const int campaigns = 80;
  MatrixXcd truth;
  double w = 0.0;
  for (int seed = 1; seed <= campaigns; ++seed) {
    const auto records = noise_records(1.0, 1.0, static_cast<std::uint64_t>(seed), 2);
    const auto by_input = estimate(records, false, 40.0);
    const auto by_reference = estimate(records, true, 40.0);
    w = by_input.frequencies[4];
    truth = held_response(two_motors(), w);
    direct += (by_input.responses[4] - truth) / campaigns;
    joint += (by_reference.responses[4] - truth) / campaigns;
  }
  // Equal powers of reference and noise: half way to -F^-1.
  MatrixXcd halfway = truth;
  for (Index i = 0; i < 2; ++i) {
    halfway(i, i) += 1.0 / (controller().proportional(i) *
                            (1.0 + kSampleTime / controller().integral_time(i) /
                                       (1.0 - std::polar(1.0, -w * kSampleTime))));
  }
  halfway *= -0.5;
  EXPECT_LT((direct - halfway).norm(), 0.2 * halfway.norm());
  EXPECT_LT(joint.norm(), 0.2 * halfway.norm());
}

TEST_F(NoiseLoop, LocalPolynomialsRefuseWhatTheyCannotDo) {
  const auto records = noise_records(1.0, 0.0, 1, 1);
  FrequencyResponseEstimate result;
  result.inputs = {"u_1", "u_2"};
  result.outputs = {"y_1", "y_2"};
  result.sample_time = kSampleTime;
  EXPECT_THROW(estimate_local_polynomial(records, kSamples, 2, {.from = 300.0}, "test", result),
               InputError);
  EXPECT_THROW(estimate_local_polynomial(records, kSamples, 2, {.degrees_of_freedom = 5000.0},
                                         "test", result),
               InputError);
  auto dependent = records;
  dependent.front().col(3) = 2.0 * dependent.front().col(2);
  EXPECT_THROW(estimate_local_polynomial(dependent, kSamples, 2, {.joint = false}, "test", result),
               InputError);
}

// ---- distributions of regions -------------------------------------------------------------------

TEST(ResponseRegions, TheTraceStatisticHasTheTailItIsGiven) {
  Random random(3);
  for (const auto& [outputs, inputs, q] :
       {std::tuple{2, 2, 6}, std::tuple{6, 6, 24}, std::tuple{3, 1, 8}, std::tuple{1, 4, 7}}) {
    int rejected = 0;
    const int draws = 3000;
    for (int k = 0; k < draws; ++k) {
      const MatrixXcd samples = random_matrix(random, outputs, q);
      const OutputCovariance covariance{samples * samples.adjoint() / static_cast<double>(q),
                                        static_cast<double>(q), 1};
      const double statistic = response_statistic(covariance, MatrixXcd::Identity(inputs, inputs),
                                                  random_matrix(random, outputs, inputs));
      const double p = response_tail(statistic, static_cast<std::size_t>(outputs),
                                     static_cast<std::size_t>(inputs), q);
      rejected += p < 0.05 ? 1 : 0;
    }
    EXPECT_NEAR(rejected / double{draws}, 0.05, 0.015) << outputs << " " << inputs;
  }
  EXPECT_NEAR(response_tail(response_threshold(0.95, 6, 6, 24), 6, 6, 24), 0.05, 1e-10);
  EXPECT_THROW((void)response_threshold(0.95, 6, 6, 7), InputError);
}

TEST(ResponseRegions, DiscoveriesKeepOrderAndRate) {
  const std::vector<bool> found = discoveries({0.5, 1e-6, 0.04, 0.9, 2e-3}, 0.05);
  EXPECT_EQ(found, (std::vector<bool>{false, true, false, false, true}));
  EXPECT_EQ(discoveries({}, 0.05).size(), 0U);
}

TEST(CovariancePool, TakesNeighboursUntilThereAreEnough) {
  std::vector<LineScatter> lines;
  std::vector<double> frequencies;
  for (std::size_t k = 1; k <= 9; ++k) {
    frequencies.push_back(static_cast<double>(k));
    // Power rises with the square of frequency: pooling keeps each line's own level.
    const double power = 3.0 * static_cast<double>(k * k);
    lines.push_back({2.0 * power * MatrixXcd::Identity(2, 2), 2.0, {3 * k, 3 * k + 1}});
  }
  const auto pooled = pool_covariances(lines, frequencies, 6.0);
  for (std::size_t k = 0; k < 9; ++k) {
    EXPECT_EQ(pooled[k].pooled_lines, 3U) << k;
    EXPECT_NEAR(pooled[k].covariance(0, 0).real(), 3.0 * frequencies[k] * frequencies[k], 1e-9);
    EXPECT_NEAR(pooled[k].degrees_of_freedom, 6.0, 1e-12);
  }
}

}  // namespace
}  // namespace graybox
