#include "solvers/blocks/two_step_design.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <numeric>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/robot_information/robot_information.hpp"
#include "problems/robot_information/robot_spectrum_information.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "tests/support/design_sets.hpp"
#include "tests/support/robot_test_support.hpp"

namespace graybox {
namespace {

using testing_sets::matrix_of;

constexpr double kGap = 1e-8;

TEST(MixedBlocks, AreTheWeightedSums) {
  const InformationSet set = testing_sets::wishart(3, 12, 2, 1);
  const CandidateBlocks blocks{3, {0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2}};
  std::vector<double> inner = equal_inner_weights(blocks);
  inner[0] = 0.4;
  inner[3] = 0.1;
  const InformationSet mixed = mixed_blocks(set, blocks, inner, 2);
  ASSERT_EQ(mixed.candidate_count(), 3U);
  for (std::size_t b = 0; b < 3; ++b) {
    Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(3, 3);
    for (std::size_t i = b; i < 12; i += 3) sum += inner[i] * matrix_of(set, i);
    EXPECT_LT((matrix_of(mixed, b) - sum).cwiseAbs().maxCoeff(), 1e-13);
  }
}

TEST(TwoStepDesign, OfOneBlockIsTheJointDesign) {
  const InformationSet set = testing_sets::wishart(4, 200, 2, 3);
  const TwoStepDesign two = two_step_design(set, equal_blocks(200, 200), {.duality_gap = kGap});
  EXPECT_EQ(two.mixture.status, SolveStatus::kSolved);
  EXPECT_LE(certify(set, two.design).duality_gap, 1.1 * kGap);
}

TEST(TwoStepDesign, EveryInnerDesignIsOptimalAloneAndTheMixtureAmongMixtures) {
  const InformationSet set = testing_sets::wishart(3, 300, 2, 5, 1.0);
  const CandidateBlocks blocks = equal_blocks(300, 30);
  const TwoStepDesign two = two_step_design(set, blocks, {.duality_gap = kGap, .threads = 2});
  EXPECT_EQ(two.unsolved_blocks, 0U);
  EXPECT_EQ(two.singular_blocks, 0U);
  const BlockMembers members(blocks);
  for (std::size_t b = 0; b < blocks.count; ++b) {
    Design inner;
    for (const std::size_t i : members.of(b)) inner.weights.push_back(two.inner[i]);
    EXPECT_LE(certify(set.subset(members.of(b)), inner).duality_gap, 1.1 * kGap);
  }
  const InformationSet mixed = mixed_blocks(set, blocks, two.inner);
  EXPECT_LE(certify(mixed, two.mixture.design).duality_gap, 1.1 * kGap);
  EXPECT_NEAR(certify(mixed, two.mixture.design).log_det, certify(set, two.design).log_det, 1e-12);
}

TEST(TwoStepDesign, IsNeverBetterThanTheJointDesign) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const InformationSet set = testing_sets::wishart(3, 120, 2, seed, 2.0);
    const TwoStepDesign two = two_step_design(set, equal_blocks(120, 10), {.duality_gap = kGap});
    const Certificate joint =
        certify(set, ColumnGeneration().solve(set, {.duality_gap = kGap}).design);
    const Certificate steps = certify(set, two.design);
    EXPECT_LE(steps.log_det, joint.log_det + joint.log_det_gap);
    // The certificate of the two-step design in the joint problem covers what it loses.
    EXPECT_GE(steps.log_det + steps.log_det_gap, joint.log_det);
  }
}

// Two blocks see one parameter each: alone they are singular, and equal weights stay.
TEST(TwoStepDesign, BlocksWithoutADesignKeepEqualWeights) {
  Eigen::MatrixXd first = Eigen::MatrixXd::Zero(2, 2), second = first;
  first(0, 0) = second(1, 1) = 1.0;
  const InformationSet set =
      testing_sets::from_matrices({first, 3.0 * first, second, 3.0 * second});
  const TwoStepDesign two = two_step_design(set, equal_blocks(4, 2), {.duality_gap = kGap});
  EXPECT_EQ(two.singular_blocks, 2U);
  EXPECT_EQ(two.inner, (std::vector<double>{0.5, 0.5, 0.5, 0.5}));
  EXPECT_NEAR(certify(set, two.design).log_det, 2.0 * std::log(1.0), 1e-7);  // 0.5 (1 + 3) / 2
}

TEST(TwoStepDesign, DoesNotDependOnThreads) {
  const InformationSet set = testing_sets::wishart(3, 2000, 2, 5, 1.0);
  const CandidateBlocks blocks = equal_blocks(2000, 5);
  const TwoStepDesign one = two_step_design(set, blocks, {.duality_gap = kGap});
  const TwoStepDesign two = two_step_design(set, blocks, {.duality_gap = kGap, .threads = 3});
  EXPECT_EQ(one.design.weights, two.design.weights);
}

TEST(TwoStepDesign, StopsWhenTold) {
  class StopAtOnce : public SolveObserver {
    bool on_progress(const TracePoint&) override { return false; }
  } stop;
  const InformationSet set = testing_sets::wishart(3, 2000, 3, 5, 1.0);
  const TwoStepDesign two = two_step_design(set, equal_blocks(2000, 5), {}, &stop);
  EXPECT_EQ(two.mixture.status, SolveStatus::kTimeLimit);
  EXPECT_EQ(certify(set, two.design).status, CertificateStatus::kCertified);
}

// On the robot: flat spectra, spectra and positions in two steps, and both at once.
TEST(SpectrumDesigns, AreOrderedByWhatTheyMayChoose) {
  const RobotModel robot = robot_test::paper_robot();
  const PositionTable positions = robot_grid(6);
  const InformationSet set = robot_spectrum_set(robot, positions);
  const CandidateBlocks blocks = equal_blocks(set.candidate_count(), line_count(robot));
  const SolveOptions options{.duality_gap = kGap};
  const std::vector<double> flat = equal_inner_weights(blocks);
  const InformationSet flat_set = mixed_blocks(set, blocks, flat);
  const Solution flat_positions = ColumnGeneration().solve(flat_set, options);
  const TwoStepDesign two = two_step_design(set, blocks, options);
  const Solution joint = ColumnGeneration().solve(set, options);
  ASSERT_EQ(joint.status, SolveStatus::kSolved);

  // The flat spectrum is the one of robot_information, a feasible point of the joint problem.
  const Certificate study = certify(robot_information_set(robot, positions), flat_positions.design);
  const Certificate flat_design =
      certify(set, expanded_design(blocks, flat_positions.design.weights, flat));
  EXPECT_NEAR(flat_design.log_det, study.log_det, 1e-9);
  EXPECT_LE(study.duality_gap, 2.0 * kGap);

  const Certificate best = certify(set, joint.design);
  EXPECT_LE(best.duality_gap, 1.1 * kGap);
  EXPECT_LE(flat_design.log_det, best.log_det + best.log_det_gap);
  EXPECT_LE(certify(set, two.design).log_det, best.log_det + best.log_det_gap);

  // In each position alone the chosen spectrum is at least as good as the flat one.
  const InformationSet two_set = mixed_blocks(set, blocks, two.inner);
  for (std::size_t i = 0; i < positions.count(); ++i) {
    Design alone{std::vector<double>(positions.count(), 0.0)};
    alone.weights[i] = 1.0;
    EXPECT_GE(certify(two_set, alone).log_det + 12.0 * 1.1 * kGap,
              certify(flat_set, alone).log_det);
  }
}

// More power in every position multiplies the information and leaves the design as it is.
TEST(SpectrumDesigns, DoNotDependOnThePowerTheyShare) {
  const RobotModel robot = robot_test::paper_robot();
  const InformationSet set = robot_spectrum_set(robot, robot_grid(5));
  const InformationSet strong = robot_spectrum_set(
      robot, robot_grid(5), {.power = std::vector<double>(5, 7.0 * flat_power(robot))});
  const Certificate weak_design =
      certify(set, ColumnGeneration().solve(set, {.duality_gap = kGap}).design);
  const Solution strong_solution = ColumnGeneration().solve(strong, {.duality_gap = kGap});
  EXPECT_NEAR(certify(strong, strong_solution.design).log_det,
              weak_design.log_det + 12.0 * std::log(7.0), 3e-7);
  EXPECT_LE(certify(set, strong_solution.design).duality_gap, 1.1 * kGap);
}

TEST(TwoStepDesign, RefusesBlocksOfAnotherSet) {
  const InformationSet set = testing_sets::wishart(2, 10, 2, 1);
  EXPECT_THROW((void)two_step_design(set, equal_blocks(8, 2), {}), InputError);
}

}  // namespace
}  // namespace graybox
