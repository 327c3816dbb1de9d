// Pages and tables of designs: run orders against brute force, sensitivities against differences,
// poses against closed forms.
#include "diagnosis/design_page/design_page.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <string>
#include <vector>

#include "diagnosis/design_page/design_facts.hpp"
#include "diagnosis/design_page/design_stories.hpp"
#include "diagnosis/design_page/robot_poses.hpp"
#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/report/design_table.hpp"
#include "solvers/report/run_order.hpp"

namespace graybox {
namespace {

// Q random matrices of rank two, with coordinates.
InformationSet random_set(std::size_t candidates, std::size_t dimension, std::uint64_t seed,
                          const std::vector<std::string>& units = {"deg", "deg", "deg"}) {
  Random random(seed);
  AlignedArray information(candidates * packed_size(dimension));
  CandidateTable table{{"q1", "q2", "q3"}, units, {}};
  for (std::size_t i = 0; i < candidates; ++i) {
    Eigen::MatrixXd jacobian(2, static_cast<Eigen::Index>(dimension));
    for (double& entry : jacobian.reshaped()) entry = random.normal();
    const Eigen::MatrixXd matrix = jacobian.transpose() * jacobian;
    pack(matrix.data(), dimension, information.data() + i * packed_size(dimension));
    for (int k = 0; k < 3; ++k) table.values.push_back(std::round(90.0 * random.normal()));
  }
  return {dimension, std::move(information), std::move(table)};
}

AlignedArray array_of(const std::vector<double>& values) {
  AlignedArray array(values.size());
  std::ranges::copy(values, array.begin());
  return array;
}

std::vector<std::size_t> first(std::size_t count) {
  std::vector<std::size_t> all(count);
  std::iota(all.begin(), all.end(), std::size_t{0});
  return all;
}

// The length of a path as run_order.hpp defines it, anew.
double length_of(const InformationSet& set, const std::vector<std::size_t>& path,
                 const std::vector<double>& scale) {
  double length = 0.0;
  for (std::size_t k = 1; k < path.size(); ++k) {
    double step = 0.0;
    for (std::size_t c = 0; c < scale.size(); ++c) {
      step = std::max(
          step, std::abs(set.coordinates(path[k])[c] - set.coordinates(path[k - 1])[c]) / scale[c]);
    }
    length += step;
  }
  return length;
}

double shortest_by_trying(const InformationSet& set, const std::vector<double>& scale) {
  std::vector<std::size_t> path = first(set.candidate_count());
  double best = length_of(set, path, scale);
  while (std::ranges::next_permutation(path).found) {
    best = std::min(best, length_of(set, path, scale));
  }
  return best;
}

TEST(RunOrder, IsTheShortestOfAllUpToEightPoses) {
  for (std::uint64_t seed = 1; seed <= 24; ++seed) {
    const InformationSet set = random_set(2 + seed % 7, 3, seed);
    const RunOrder order = run_order(set, first(set.candidate_count()));
    EXPECT_TRUE(order.is_shortest);
    EXPECT_EQ(order.unit, "deg");
    EXPECT_NEAR(order.length, shortest_by_trying(set, {1.0, 1.0, 1.0}), 1e-9) << seed;
    EXPECT_NEAR(order.length, length_of(set, order.places, {1.0, 1.0, 1.0}), 1e-9);
  }
}

TEST(RunOrder, DividesCoordinatesOfOtherUnitsByTheirRanges) {
  const InformationSet set = random_set(7, 3, 5, {"deg", "N", "s"});
  std::vector<double> scale;
  for (std::size_t k = 0; k < 3; ++k) {
    double low = set.coordinates(0)[k], high = low;
    for (std::size_t i = 0; i < 7; ++i) {
      low = std::min(low, set.coordinates(i)[k]);
      high = std::max(high, set.coordinates(i)[k]);
    }
    scale.push_back(high - low);
  }
  const RunOrder order = run_order(set, first(7));
  EXPECT_EQ(order.unit, "");
  EXPECT_NEAR(order.length, shortest_by_trying(set, scale), 1e-12);
}

// One block after the other, though neighbours lie in different ones.
TEST(RunOrder, RunsBlockAfterBlock) {
  const InformationSet plain = random_set(6, 1, 1);
  CandidateTable table{{"x", "block"}, {"mm", ""}, {5, 1, 4, 2, 3, 1, 0, 2, 1, 1, 9, 2}};
  const InformationSet set(plain.dimension(), AlignedArray(plain.information(0).size() * 6, 1.0),
                           std::move(table));
  const RunOrder order = run_order(set, first(6));
  EXPECT_EQ(order.places, (std::vector<std::size_t>{0, 2, 4, 3, 1, 5}));
  EXPECT_EQ(order.length, 4.0 + 9.0);
  EXPECT_EQ(order.unit, "mm");
}

// Many candidates in a row, and on a square grid, where the shortest paths are known.
TEST(RunOrder, FindsKnownPathsOfManyCandidates) {
  Random random(4);
  std::vector<double> row, grid;
  for (int i = 0; i < 60; ++i) {
    row.push_back(random.normal());
  }
  for (int i = 0; i < 36; ++i) {
    const int place = (i * 23) % 36;  // in disorder
    grid.push_back(place / 6);
    grid.push_back(place % 6);
  }
  const InformationSet line(1, AlignedArray(60), {{"x"}, {"m"}, row});
  const auto [low, high] = std::ranges::minmax(row);
  const RunOrder along = run_order(line, first(60));
  EXPECT_FALSE(along.is_shortest);
  EXPECT_NEAR(along.length, high - low, 1e-9);
  const InformationSet square(1, AlignedArray(36), {{"x", "y"}, {"m", "m"}, grid});
  const RunOrder through = run_order(square, first(36));
  EXPECT_LE(through.length, 38.0);  // 35 is the least; four moves of 2 more, at most
  std::vector<std::size_t> places = through.places;
  std::ranges::sort(places);
  EXPECT_EQ(places, first(36));
}

// The shortest path from `last` through the places in `left` (a set of bits).
double shortest_through(const InformationSet& set, std::size_t left, std::size_t last,
                        std::vector<double>& known) {
  if (left == 0) return 0.0;
  double& best = known[left * set.candidate_count() + last];
  if (best >= 0.0) return best;
  double found = 1e300;
  for (std::size_t next = 0; next < set.candidate_count(); ++next) {
    const std::size_t bit = std::size_t{1} << next;
    if ((left & bit) == 0) continue;
    found = std::min(found, length_of(set, {last, next}, {1.0, 1.0, 1.0}) +
                                shortest_through(set, left & ~bit, next, known));
  }
  return best = found;
}

// With one pose more than is solved exactly, against the shortest path.
TEST(RunOrder, BeyondTheExactSizeIsNearlyTheShortest) {
  constexpr std::size_t kPoses = kOptimalOrder + 1;
  double mean = 0.0;
  constexpr int kSets = 12;
  for (int seed = 1; seed <= kSets; ++seed) {
    const InformationSet set = random_set(kPoses, 3, static_cast<std::uint64_t>(100 + seed));
    std::vector<double> known((std::size_t{1} << kPoses) * kPoses, -1.0);
    double shortest = 1e300;
    for (std::size_t start = 0; start < kPoses; ++start) {
      const std::size_t left = ((std::size_t{1} << kPoses) - 1) & ~(std::size_t{1} << start);
      shortest = std::min(shortest, shortest_through(set, left, start, known));
    }
    const RunOrder order = run_order(set, first(kPoses));
    EXPECT_FALSE(order.is_shortest);
    EXPECT_GE(order.length, shortest * (1.0 - 1e-12));
    EXPECT_LE(order.length, 1.03 * shortest) << seed;
    mean += order.length / shortest / kSets;
  }
  EXPECT_LE(mean, 1.005);
}

TEST(DesignTable, HasOneRowARunInEveryFormat) {
  const InformationSet set(1, array_of({1.0, 2.0, 3.0}),
                           {{"T_1", "a|b"}, {"%", ""}, {10.0, 1.0, 30.0, 2.0, 20.0, 3.0}});
  const std::vector<double> weights{0.25, 0.5, 0.25};
  const DesignSchedule schedule = design_schedule(set, weights);
  EXPECT_EQ(design_table(set, schedule, TableFormat::kCsv),
            "run,candidate,T_1 [%],a|b,weight\n1,0,10,1,0.25000000\n2,1,30,2,0.50000000\n"
            "3,2,20,3,0.25000000\n");
  const std::string latex = design_table(set, schedule, TableFormat::kLatex);
  EXPECT_NE(latex.find("run & candidate & T\\_1 [\\%] & a|b & weight \\\\"), std::string::npos);
  EXPECT_NE(latex.find("\\begin{tabular}{rrrrr}"), std::string::npos);
  const std::string markdown = design_table(set, schedule, TableFormat::kMarkdown);
  EXPECT_NE(markdown.find("| a\\|b |"), std::string::npos);
  EXPECT_EQ(std::ranges::count(markdown, '\n'), 5);
  const std::vector<std::int64_t> counts{0, 2, 1};
  EXPECT_NE(design_table(set, design_schedule(set, counts), TableFormat::kCsv).find(",2\n"),
            std::string::npos);
  EXPECT_THROW(static_cast<void>(table_format("html")), InputError);
}

// log Phi by the checker.
double log_value(const InformationSet& set, const std::vector<double>& weights,
                 const Criterion& criterion) {
  const auto d = static_cast<double>(set.dimension());
  const Certificate certificate = certify(set, {weights}, criterion);
  switch (criterion.kind()) {
    case CriterionKind::kD:
      return certificate.log_det / d;
    case CriterionKind::kDs:
      return certificate.criterion_value / static_cast<double>(criterion.interest().size());
    case CriterionKind::kG:
      return certificate.log_det / d;  // over the candidates: the slopes are those of D
    case CriterionKind::kCompound:
      return certificate.criterion_value;
    default:
      return -std::log(certificate.criterion_value);
  }
}

// Towards candidate i, log Phi rises by tr(G H_i) - 1 for each unit of weight.
TEST(DesignFacts, SensitivitiesAreSlopesOfTheCriterion) {
  constexpr std::size_t kCandidates = 9, kDimension = 4;
  const InformationSet set = random_set(kCandidates, kDimension, 11);
  const std::vector<double> weights(kCandidates, 1.0 / kCandidates);
  std::vector<double> square(packed_size(kDimension), 0.0);
  for (std::size_t k = 0; k < kDimension; ++k) {
    square[packed_index(k, k)] = 1.0 + static_cast<double>(k);
  }
  square[packed_index(1, 0)] = 0.5;
  for (const Criterion& criterion :
       {Criterion(), Criterion::a(), Criterion::l(square), Criterion::ds({1, 3}),
        Criterion::c(square), Criterion::i(square), Criterion::phi_p(2.5), Criterion::g(),
        Criterion::compound({{0.3, Criterion()}, {0.7, Criterion::a()}})}) {
    const std::vector<double> slopes = criterion_sensitivities(set, {weights}, criterion);
    ASSERT_EQ(slopes.size(), kCandidates);
    for (std::size_t i = 0; i < kCandidates; ++i) {
      constexpr double kStep = 1e-5;
      const auto moved = [&](double step) {
        std::vector<double> other = weights;
        for (double& weight : other) weight *= 1.0 - step;
        other[i] += step;
        return log_value(set, other, criterion);
      };
      EXPECT_NEAR(slopes[i] - 1.0, (moved(kStep) - moved(-kStep)) / (2 * kStep), 1e-6)
          << to_string(criterion.kind());
    }
  }
}

// G over a region: with the weight on the one point whose prediction is worst it is a slope, too,
// and at the optimum the largest is that of the certificate.
TEST(DesignFacts, SensitivitiesOfARegionAreThoseOfItsCertificate) {
  const InformationSet set = random_set(12, 3, 5);
  const PredictionRegion region = PredictionRegion::of_regressors(
      3, {1.0, 0.2, -0.5, 0.3, 1.5, 0.4, -0.2, 0.1, 2.0, 1.0, 1.0, 1.0});
  const Criterion criterion = Criterion::g(region);
  const Solution solution =
      ColumnGeneration().solve(set, {.duality_gap = 1e-9, .criterion = criterion}, nullptr);
  ASSERT_EQ(solution.design.dual_weights.size(), 4U);
  const Certificate proof = certify(set, solution.design, criterion);
  const std::vector<double> values = criterion_sensitivities(set, solution.design, criterion);
  ASSERT_EQ(values.size(), 12U);
  EXPECT_NEAR(std::ranges::max(values), 1.0 + proof.duality_gap, 1e-9);
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (solution.design.weights[i] < 1e-3) continue;
    EXPECT_NEAR(values[i], 1.0, 1e-6) << i;
  }
  // Anywhere else: the slope of -log G.
  const std::vector<double> weights(12, 1.0 / 12.0);
  const auto worst_variance = [&](const std::vector<double>& at) {
    return certify(set, {.weights = at, .dual_weights = {0.25, 0.25, 0.25, 0.25}}, criterion)
        .criterion_value;
  };
  std::vector<double> slopes;
  for (std::size_t j = 0; j < 4; ++j) {
    Design design{.weights = weights, .dual_weights = std::vector<double>(4, 0.0)};
    design.dual_weights[j] = 1.0;
    const std::vector<double> own = criterion_sensitivities(set, design, criterion);
    // The point whose bound is the tightest at M itself is the worst one: sum of w s is one.
    double mean = 0.0;
    for (const double value : own) mean += value / 12.0;
    if (std::abs(mean - 1.0) < 1e-9) slopes = own;
  }
  ASSERT_EQ(slopes.size(), 12U);
  for (std::size_t i = 0; i < 12; ++i) {
    const auto moved = [&](double step) {
      std::vector<double> other = weights;
      for (double& weight : other) weight *= 1.0 - step;
      other[i] += step;
      return -std::log(worst_variance(other));
    };
    EXPECT_NEAR(slopes[i] - 1.0, (moved(1e-5) - moved(-1e-5)) / 2e-5, 1e-5) << i;
  }
}

// A page without the picture says so.
TEST(DesignPage, SaysWhatItLacks) {
  const InformationSet set = random_set(6, 3, 2);
  const Criterion criterion = Criterion::g(PredictionRegion::of_regressors(3, {1.0, 0.0, 0.0}));
  const Design design{.weights = std::vector<double>(6, 1.0 / 6.0)};
  SolveOptions options;
  options.criterion = criterion;
  Solution solution;
  solution.design = design;
  const DesignStory story = solve_story(set, design, judge(set, "any", options, solution));
  EXPECT_TRUE(story.sensitivities.empty());
  EXPECT_NE(design_page(story, {}).find("There is no picture of the proof"), std::string::npos);
}

TEST(DesignFacts, StandardErrorsOfKnownMatrices) {
  // H_0 = diag(4, 0), H_1 = diag(0, 9), and a prior of diag(0, 7).
  const InformationSet set(2, array_of({4.0, 0.0, 0.0, 0.0, 0.0, 9.0}));
  const std::vector<double> errors = standard_errors(set, {1.0, 1.0}, {0.0, 0.0, 7.0});
  ASSERT_EQ(errors.size(), 2U);
  EXPECT_DOUBLE_EQ(errors[0], 0.5);
  EXPECT_DOUBLE_EQ(errors[1], 0.25);
  EXPECT_TRUE(standard_errors(set, {1.0, 0.0}).empty());  // singular
}

TEST(DesignFacts, OneSampleIsNoSample) {
  const InformationSet set = random_set(6, 3, 2);
  const Design design{std::vector<double>(6, 1.0 / 6.0)};
  const auto one = criterion_sensitivities(set, design, Criterion());
  const auto same = robust_sensitivities({&set, &set}, design, {0.25, 0.75});
  for (std::size_t i = 0; i < one.size(); ++i) EXPECT_NEAR(one[i], same[i], 1e-12);
}

// A column of 1 m, an arm of 0.5 m that an axis along y turns, and a hand of 0.25 m.
RobotModel two_axis_robot() {
  const auto at = [](double x, double z) {
    ChainRotation rotation;
    rotation.origin.translation() = Eigen::Vector3d(x, 0.0, z);
    rotation.axis = Eigen::Vector3d::UnitY();
    rotation.lower = -0.5 * std::numbers::pi;
    rotation.upper = 0.5 * std::numbers::pi;
    return rotation;
  };
  std::vector<ChainRotation> rotations{at(0.0, 1.0), at(0.5, 0.0)};
  rotations[1].body.centre_of_mass = Eigen::Vector3d(0.25, 0.0, 0.0);
  RobotModel robot{.name = "arm",
                   .chain = RigidChain(rotations, {0.0, 0.0, -9.81}),
                   .springs = {},
                   .joint_names = {"q1", "q2"},
                   .transmission = {},
                   .motor_inertia = {},
                   .motor_friction = {},
                   .controller = {},
                   .frequencies = {},
                   .parameters = {}};
  robot.springs = {{.name = "q1", .is_gearbox = true},
                   {.name = "q2", .joint = 1, .is_gearbox = true}};
  return robot;
}

TEST(RobotPoses, AreThoseOfThePlane) {
  const RobotModel robot = two_axis_robot();
  for (const auto& [q1, q2] : {std::pair(0.0, 0.0), std::pair(30.0, -45.0)}) {
    const auto points = robot_pose(robot, std::vector{q1, q2});
    ASSERT_EQ(points.size(), 4U);
    const double a = q1 * std::numbers::pi / 180.0, b = a + q2 * std::numbers::pi / 180.0;
    EXPECT_NEAR(points[2][0], 0.5 * std::cos(a), 1e-12);
    EXPECT_NEAR(points[2][2], 1.0 - 0.5 * std::sin(a), 1e-12);
    EXPECT_NEAR(points[3][0], 0.5 * std::cos(a) + 0.25 * std::cos(b), 1e-12);
    EXPECT_NEAR(points[3][2], 1.0 - 0.5 * std::sin(a) - 0.25 * std::sin(b), 1e-12);
  }
  EXPECT_EQ(count_beyond_limits(robot, std::vector{90.0, 91.0}), 1U);
  EXPECT_THROW(require_joint_angles(random_set(3, 2, 1), robot), InputError);
}

TEST(CertificatePlot, KeepsTheLargestOfManyCandidates) {
  const InformationSet set = random_set(5000, 2, 3);
  DesignStory story;
  story.set = &set;
  story.sensitivities.assign(5000, 0.5);
  story.sensitivities[1234] = 1.0;
  story.sensitivities[4999] = 0.9;
  const ComparisonPlot plot = certificate_plot(story);
  const PlotSeries& all = plot.series.front();
  EXPECT_LE(all.x.size(), 800U);
  EXPECT_TRUE(std::ranges::binary_search(all.x, 1234.0));
  EXPECT_TRUE(std::ranges::binary_search(all.x, 4999.0));
  EXPECT_DOUBLE_EQ(std::ranges::max(all.y), 1.0);
}

}  // namespace
}  // namespace graybox
