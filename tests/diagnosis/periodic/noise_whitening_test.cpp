// Noise that was estimated from few samples: what its errors do to chi-square and to scores,
// against drawn covariances.
#include "diagnosis/harmonic_balance/noise_whitening.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <complex>
#include <string>
#include <vector>

#include "diagnosis/periodic/candidate_products.hpp"
#include "problems/base/array_index.hpp"
#include "problems/base/random.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::VectorXcd;

constexpr Index kOutputs = 4;

// Entries of variance two, as whitened residuals are.
MatrixXcd drawn(Random& random, Index rows, Index columns) {
  MatrixXcd result(rows, columns);
  for (std::complex<double>& value : result.reshaped()) {
    const double real = random.normal();
    value = {real, random.normal()};
  }
  return result;
}

PeriodicData frame(Index lines) {
  PeriodicData data;
  data.first_line = 1;
  data.last_line = lines;
  data.outputs.assign(at(kOutputs), "y");
  for (Index k = 0; k <= lines; ++k) data.frequencies.push_back(static_cast<double>(k));
  return data;
}

MeasuredRecord record_of(std::size_t group) {
  MeasuredRecord record;
  record.group = group;
  return record;
}

struct Group {
  std::size_t records = 0;
  Index samples = 0;  // of each line
};

// Whitens new noise of each group by a covariance estimated from other noise, pooled over
// neighbouring lines to `wanted` samples: chi-square over its numbers. Sets the groups' pools.
double drawn_chi_square(Random& random, const std::vector<Group>& groups, double wanted,
                        PeriodicData& data) {
  const std::vector<double> frequencies(data.frequencies.begin() + 1, data.frequencies.end());
  double sum = 0.0, numbers = 0.0;
  data.noise_pools.clear();
  for (const Group& group : groups) {
    std::vector<LineScatter> lines;
    for (Index k = 0; k < data.line_count(); ++k) {
      const MatrixXcd noise = drawn(random, kOutputs, group.samples) / std::sqrt(2.0);
      lines.push_back({noise * noise.adjoint(), static_cast<double>(group.samples), {}});
    }
    const std::vector<OutputCovariance> pooled = pool_covariances(lines, frequencies, wanted);
    data.noise_pools.push_back(pool_of(lines, pooled));
    for (const OutputCovariance& one : pooled) {
      const double inflation = inverse_bias(one.degrees_of_freedom, kOutputs);
      const auto whitening =
          whitening_of(inflation * one.covariance, Eigen::VectorXd::Zero(kOutputs), 0.0);
      const auto count = static_cast<Index>(group.records);
      sum += (*whitening * drawn(random, kOutputs, count) / std::sqrt(2.0)).squaredNorm();
      numbers += static_cast<double>(2 * kOutputs * count);
    }
  }
  return sum / numbers;
}

// Groups of different sizes; a chi-square over its degrees of freedom has the variance two over
// them.
TEST(EffectiveDegreesOfFreedom, GiveTheVarianceOfChiSquareUnderEstimatedNoise) {
  constexpr Index kLines = 40;
  constexpr int kDraws = 4000;
  const std::vector<Group> groups = {{6, 6}, {3, 9}};
  PeriodicData data = frame(kLines);
  Random random(7);
  double mean = 0.0, squares = 0.0;
  for (int draw = 0; draw < kDraws; ++draw) {
    const double ratio = drawn_chi_square(random, groups, 36.0, data);
    mean += ratio / kDraws;
    squares += ratio * ratio / kDraws;
  }
  std::vector<MeasuredRecord> records;
  for (std::size_t group = 0; group < groups.size(); ++group) {
    records.insert(records.end(), groups[group].records, record_of(group));
  }
  const double numbers = data.numbers_in(records);
  const double freedom = effective_degrees_of_freedom(data, records, numbers);
  const double variance = squares - mean * mean;
  EXPECT_NEAR(mean, 1.0, 0.01);
  EXPECT_NEAR(variance * freedom / 2.0, 1.0, 0.1);
  // What known noise and what Fisher's F would say are too little.
  EXPECT_GT(variance * numbers / 2.0, 1.5);
  const double fisher = 1.0 / (1.0 / numbers + 1.0 / (2.0 * kOutputs * kLines * (6.0 + 9.0)));
  EXPECT_GT(variance * fisher / 2.0, 1.15);
}

// One output over a few of the lines: fewer samples say what its noise is, also where they are
// pooled with neighbours.
TEST(EffectiveDegreesOfFreedom, GiveTheVarianceInACellOfTheMap) {
  constexpr Index kLines = 40;
  const std::vector<double> frequencies = frame(kLines).frequencies;
  constexpr std::size_t kRecords = 4;
  for (const Index band : {Index{4}, Index{20}}) {
    Random random(19);
    const std::vector<double> lines_of(frequencies.begin() + 1, frequencies.end());
    NoisePool pool;
    double mean = 0.0, squares = 0.0;
    constexpr int kDraws = 4000;
    for (int draw = 0; draw < kDraws; ++draw) {
      std::vector<LineScatter> lines;
      for (Index k = 0; k < kLines; ++k) {
        const MatrixXcd noise = drawn(random, kOutputs, 6) / std::sqrt(2.0);
        lines.push_back({noise * noise.adjoint(), 6.0, {}});
      }
      const std::vector<OutputCovariance> pooled = pool_covariances(lines, lines_of, 36.0);
      pool = pool_of(lines, pooled);
      double sum = 0.0;
      for (Index k = 10; k < 10 + band; ++k) {
        const OutputCovariance& one = pooled[static_cast<std::size_t>(k)];
        const auto whitening =
            whitening_of(inverse_bias(one.degrees_of_freedom, kOutputs) * one.covariance,
                         Eigen::VectorXd::Zero(kOutputs), 0.0);
        sum +=
            (*whitening * drawn(random, kOutputs, kRecords) / std::sqrt(2.0)).row(0).squaredNorm();
      }
      mean += sum / kDraws;
      squares += sum * sum / kDraws;
    }
    const double numbers = 2.0 * kRecords * static_cast<double>(band);
    const double variance = squares - mean * mean;
    const double half = half_variance(pool, kOutputs, numbers, 1.0,
                                      static_cast<double>(band) / static_cast<double>(kLines));
    EXPECT_NEAR(mean, numbers, 0.1 * numbers) << band;
    // Of few lines, whose noise is pooled with that of lines beyond, a little less than that.
    EXPECT_LT(variance / (2.0 * half), 1.1) << band;
    EXPECT_GT(variance / (2.0 * half), 0.6) << band;
    EXPECT_GT(variance / (2.0 * numbers), 1.2) << band;  // if the noise were known
  }
}

// Noise of groups that the records are not of tells nothing about theirs.
TEST(EffectiveDegreesOfFreedom, CountTheNoiseOfTheRecordsOwnGroups) {
  PeriodicData data = frame(20);
  data.noise_pools = {{50.0, 5.0, 200.0}, {50.0, 5.0, 200.0}};
  const std::vector<MeasuredRecord> first(3, record_of(0));
  const double numbers = data.numbers_in(first);
  const double alone = effective_degrees_of_freedom(data, first, numbers);
  data.noise_pools[1].own = 1e6;
  EXPECT_DOUBLE_EQ(effective_degrees_of_freedom(data, first, numbers), alone);
  data.noise_pools[0].own = 1e6;
  EXPECT_GT(effective_degrees_of_freedom(data, first, numbers), 1.3 * alone);
}

TEST(EffectiveDegreesOfFreedom, AreAllOfThemWhereTheNoiseIsStatedOrVeryWellKnown) {
  PeriodicData data = frame(20);
  const std::vector<MeasuredRecord> records(3, record_of(0));
  EXPECT_EQ(effective_degrees_of_freedom(data, records, 400.0), 400.0);
  data.noise_pools = {{1e9, 1.0, 1e12}};
  EXPECT_NEAR(effective_degrees_of_freedom(data, records, 400.0), 400.0, 1e-3);
}

// (J^H W W J) / (J^H W J): how much larger a score's variance is than the information says.
double drawn_ratio(Random& random, Index samples, const VectorXcd& direction) {
  const MatrixXcd noise = drawn(random, kOutputs, samples) / std::sqrt(2.0);
  const Eigen::LLT<MatrixXcd> scatter(MatrixXcd(noise * noise.adjoint()));
  const VectorXcd weighted = scatter.solve(direction);
  return static_cast<double>(samples - kOutputs) * weighted.squaredNorm() /
         direction.dot(weighted).real();
}

TEST(NoiseDraws, ScatterAsScoresUnderEstimatedNoiseDo) {
  constexpr Index kSamples = 24;
  constexpr int kDraws = 20000;
  PeriodicData data = frame(1);
  data.noise_pools = {{static_cast<double>(kSamples), 1.0, 1.0}};
  NoiseDraws draws(data, 0, kDraws, 3, 0);
  MatrixXcd column = MatrixXcd::Zero(2 * kOutputs, 1);
  column(kOutputs + 1) = 1.0;  // line 1
  const Eigen::RowVectorXd scores = draws.products(column);
  Random random(11);
  const VectorXcd direction = drawn(random, kOutputs, 1).col(0);
  std::vector<double> found, expected;
  for (Index d = 0; d < scores.size(); ++d) {
    found.push_back(std::abs(scores(d)));
    expected.push_back(std::sqrt(drawn_ratio(random, kSamples, direction)) *
                       std::abs(random.normal()));
  }
  std::ranges::sort(found);
  std::ranges::sort(expected);
  // Distance of the two distributions, of which 1.95 sqrt(2 / n) is exceeded by one in 1000.
  double largest = 0.0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const auto below = std::ranges::lower_bound(expected, found[i]) - expected.begin();
    largest = std::max(largest, std::abs(static_cast<double>(below) - static_cast<double>(i)));
  }
  EXPECT_LT(largest / kDraws, 1.95 * std::sqrt(2.0 / kDraws));
  const auto power = [](const std::vector<double>& values) {
    double sum = 0.0;
    for (const double value : values) sum += value * value;
    return sum / static_cast<double>(values.size());
  };
  EXPECT_NEAR(power(found) / power(expected), 1.0, 0.05);
  EXPECT_NEAR(power(found), 24.0 / 21.0, 0.05);  // q / (q - n + 1)
}

TEST(NoiseDraws, AreNormalWhereTheNoiseIsStated) {
  constexpr int kDraws = 20000;
  const PeriodicData data = frame(1);
  NoiseDraws draws(data, 0, kDraws, 3, 0);
  MatrixXcd column = MatrixXcd::Zero(2 * kOutputs, 1);
  column(kOutputs) = 1.0;
  EXPECT_NEAR(draws.products(column).squaredNorm() / kDraws, 1.0, 0.04);
}

}  // namespace
}  // namespace graybox
