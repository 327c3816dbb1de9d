// Pictures of a design: what is drawn, against counts of it; names of files; what has no proof.
#include "diagnosis/design_page/design_charts.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "problems/base/packed_matrix.hpp"

namespace graybox {
namespace {

// The straight line a + b x on a grid of x, beside a constant and a second coordinate: optimal are
// its two ends, half each, and the sensitivity is (1 + x^2) / 2.
struct LineProblem {
  InformationSet set;
  std::vector<double> sensitivities;
};

LineProblem line_problem(std::size_t steps, std::size_t levels,
                         const std::vector<std::string>& names = {"x", "y", "z"}) {
  CandidateTable table{names, {"mm", "1", "1"}, {}};
  AlignedArray information(steps * levels * packed_size(2));
  std::vector<double> sensitivities;
  for (std::size_t i = 0; i < steps * levels; ++i) {
    const double x = -1.0 + 2.0 * static_cast<double>(i / levels) / static_cast<double>(steps - 1);
    const double h[] = {1.0, x, x * x};
    std::ranges::copy(h, information.begin() + static_cast<std::ptrdiff_t>(3 * i));
    table.values.insert(table.values.end(), {x, static_cast<double>(i % levels), 7.0});
    sensitivities.push_back(0.5 * (1.0 + x * x));
  }
  return {.set = {2, std::move(information), std::move(table)}, .sensitivities = sensitivities};
}

DesignStory ends_of(const LineProblem& line, std::size_t levels) {
  DesignStory story;
  story.set = &line.set;
  std::vector<double> weights(line.set.candidate_count(), 0.0);
  weights[0] = 0.5;
  weights[weights.size() - levels] = 0.5;
  story.schedule = design_schedule(line.set, weights);
  story.sensitivities = line.sensitivities;
  return story;
}

std::vector<std::string> names_of(const std::vector<DesignPicture>& pictures) {
  std::vector<std::string> names;
  for (const DesignPicture& picture : pictures) names.push_back(picture.name);
  return names;
}

TEST(DesignCharts, OneForEachCoordinateThatVaries) {
  const LineProblem line = line_problem(9, 3);
  EXPECT_EQ(names_of(design_pictures(ends_of(line, 3))),
            (std::vector<std::string>{"weights", "weights_over_x", "weights_over_y",
                                      "sensitivities", "sensitivities_over_x",
                                      "sensitivities_over_y", "sensitivity_map"}));
}

TEST(DesignCharts, SensitivitiesOverACoordinateAreItsLargestAndItsMean) {
  const LineProblem line = line_problem(5, 2);
  const std::vector<Chart> charts = sensitivity_charts(ends_of(line, 2));
  ASSERT_EQ(charts.size(), 2U);
  const std::vector<double> by_x{1.0, 0.625, 0.5, 0.625, 1.0};
  EXPECT_EQ(charts[0].x.label, "x [mm]");
  EXPECT_EQ(charts[0].series[0].y, by_x);
  EXPECT_EQ(charts[0].series[1].y, by_x);
  EXPECT_EQ(charts[1].series[0].y, (std::vector<double>{1.0, 1.0}));
  EXPECT_EQ(charts[1].series[1].y, (std::vector<double>{0.75, 0.75}));
  EXPECT_EQ(charts[0].series[3].x, (std::vector<double>{-1.0, 1.0}));  // in the design
}

TEST(DesignCharts, ACoordinateOfManyValuesIsCutIntoPieces) {
  const LineProblem line = line_problem(2001, 1);
  const std::vector<Chart> charts = sensitivity_charts(ends_of(line, 1));
  ASSERT_EQ(charts.size(), 1U);
  const ChartSeries& largest = charts[0].series[0];
  EXPECT_LE(largest.x.size(), 200U);
  EXPECT_GE(largest.x.size(), 100U);
  for (std::size_t k = 0; k < largest.x.size(); ++k) {
    const double x = std::min(1.0, std::abs(largest.x[k]) + 0.005);  // the far end of a piece
    EXPECT_NEAR(largest.y[k], 0.5 * (1.0 + x * x), 2e-3) << largest.x[k];
  }
}

TEST(DesignCharts, TheMapFramesWhatTheDesignHolds) {
  const LineProblem line = line_problem(4, 3);
  const std::vector<DesignPicture> pictures = design_pictures(ends_of(line, 3));
  const std::string& map = pictures.back().svg;
  std::size_t framed = 0;
  for (std::size_t at = map.find("stroke=\"#d55e00\""); at != std::string::npos;
       at = map.find("stroke=\"#d55e00\"", at + 1)) {
    ++framed;
  }
  EXPECT_EQ(framed, 2U);
}

TEST(DesignCharts, CountsAreCalledCounts) {
  const LineProblem line = line_problem(5, 1);
  DesignStory story = ends_of(line, 1);
  const std::vector<std::int64_t> counts{2, 0, 0, 0, 3};
  story.schedule = design_schedule(line.set, counts);
  EXPECT_EQ(names_of(design_pictures(story)),
            (std::vector<std::string>{"counts", "counts_over_x", "sensitivities",
                                      "sensitivities_over_x"}));
}

TEST(DesignCharts, NamesOfFilesAreSafeAndDiffer) {
  const LineProblem line = line_problem(5, 2, {"a/../b", "a____b", "z"});
  const std::vector<std::string> names = names_of(design_pictures(ends_of(line, 2)));
  EXPECT_EQ(std::set<std::string>(names.begin(), names.end()).size(), names.size());
  for (const std::string& name : names) {
    EXPECT_EQ(name.find_first_of("/.\\ "), std::string::npos) << name;
  }
}

TEST(DesignCharts, WithoutSensitivitiesTheAmountsAreLeft) {
  const LineProblem line = line_problem(5, 1);
  DesignStory story = ends_of(line, 1);
  story.sensitivities.clear();
  EXPECT_EQ(names_of(design_pictures(story)),
            (std::vector<std::string>{"weights", "weights_over_x"}));
}

}  // namespace
}  // namespace graybox
