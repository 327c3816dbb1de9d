// What a study compares: draws, the ladder of d, profiles and tables of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "bench/study/environment.hpp"
#include "bench/study/plan.hpp"
#include "bench/study/statistics.hpp"
#include "bench/study/study_sets.hpp"
#include "bench/study/tables.hpp"
#include "bench/study_page/comparison_tables.hpp"
#include "bench/study_page/page_facts.hpp"
#include "bench/study_page/study_page.hpp"
#include "problems/families/families.hpp"
#include "tests/support/study_solvers.hpp"

namespace graybox::bench {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// A row of one solver on one set, in seconds; infinite ones are not solved.
RunRow timed_row(const std::string& experiment, const std::string& solver,
                 const std::string& family, double seconds) {
  RunRow row;
  row.key = {experiment, family, solver, 1e-6, 0, 1, 7, 10.0, 1000, "binary", ""};
  row.family = family;
  row.candidates = 50;
  row.dimension = 12;
  row.passes = 4.5;
  row.duality_gap = 1e-7;
  row.seconds = std::isfinite(seconds) ? seconds : 3.0;
  row.status = std::isfinite(seconds) ? ReportStatus::kSolved : ReportStatus::kTimeLimit;
  return row;
}

TEST(Statistics, DataProfilesByHand) {
  const auto profiles = data_profiles({{3.0, 1.0, kInfinity, 3.0}, std::vector(4, kInfinity)});
  ASSERT_EQ(profiles.size(), 2U);
  ASSERT_EQ(profiles[0].size(), 2U);  // one of four within 1, three within 3
  EXPECT_EQ(profiles[0][0].budget, 1.0);
  EXPECT_EQ(profiles[0][0].share, 0.25);
  EXPECT_EQ(profiles[0][1].budget, 3.0);
  EXPECT_EQ(profiles[0][1].share, 0.75);
  EXPECT_TRUE(profiles[1].empty());
}

TEST(StudyPage, ListsWhatFailsAndWhereTheDefaultIsSlow) {
  std::vector<RunRow> runs{
      timed_row("families", kDefaultSolver, "a", 3.0), timed_row("families", "other", "a", 1.0),
      timed_row("families", kDefaultSolver, "b", 1.0), timed_row("families", "other", "b", 2.0),
      timed_row("families", "weak", "a", kInfinity)};
  runs.push_back(timed_row("families", "weak", "n", kInfinity));
  runs.back().key.experiment = "normalisation";
  const PageFacts facts = page_facts(summarise_points(runs));
  const PageTable failures = failures_table(facts);
  ASSERT_EQ(failures.rows.size(), 1U);
  EXPECT_EQ(failures.rows[0][0].text, "weak");
  EXPECT_EQ(failures.rows[0][2].text, "a");
  const PageTable slow = slow_table(kDefaultSolver, facts);
  ASSERT_EQ(slow.rows.size(), 1U);
  EXPECT_EQ(slow.rows[0][1].text, "a");
  EXPECT_EQ(slow.rows[0][4].text, "3");
  EXPECT_EQ(slow.rows[0][5].text, "other");
}

TEST(StudyPage, CountsOneAsOne) {
  StudyRows rows;
  rows.runs = {timed_row("families", "fast", "a", 1.0)};
  const auto says = [&](const std::string& words) {
    return study_page(rows, {}).find(words) != std::string::npos;
  };
  EXPECT_TRUE(says("1 of 1 run solved"));
  EXPECT_TRUE(says("Of its 1 point: solved 1."));
  EXPECT_TRUE(says("No problem has two certified answers"));
  rows.runs.push_back(timed_row("families", "weak", "a", 2.0));
  EXPECT_TRUE(says("2 of 2 runs solved"));
  rows.runs.push_back(timed_row("families", "fast", "b", 2.0));  // alone: nothing to agree with
  EXPECT_TRUE(says("All certified answers to the one problem agree"));
  rows.runs.push_back(timed_row("families", "weak", "b", 2.0));
  EXPECT_TRUE(says("answers to each of the 2 problems agree"));
  rows.runs.back().log_det = 1.0;
  EXPECT_TRUE(says("Certified answers disagree: b, Q = 50."));
  EXPECT_FALSE(says("answers to each of the 2 problems agree"));
}

TEST(StudyPage, SaysWhichSolversAreNotHere) {
  StudyRows rows;
  rows.runs = {timed_row("families", "fast", "a", 1.0)};
  rows.environments = {
      describe_environment({{"rare", "a licence & luck"}, {"fast", "nothing, for it ran"}})};
  const std::string page = study_page(rows, {});
  EXPECT_NE(page.find("not installed here: rare."), std::string::npos);
  EXPECT_NE(page.find("a licence &amp; luck"), std::string::npos);
  EXPECT_EQ(page.find("nothing, for it ran"), std::string::npos);  // it has run
  rows.environments.push_back(describe_environment({}));           // the last start counts
  EXPECT_EQ(study_page(rows, {}).find("not installed"), std::string::npos);
  for (const char* damaged : {R"({"absent": 3})", R"({"absent": [3, {"name": 4}, {}]})"}) {
    EXPECT_TRUE(absent_solvers(nlohmann::json::parse(damaged)).empty()) << damaged;
  }
}

TEST(Plan, DrawsAndDimensionsComeLast) {
  const SolverRegistry registry = testing::study_registry({"honest", "liar"});
  StudyOptions options;
  const StudyFamilies families{.whole = {}, .drawn = {"robot", "wis"}, .dimensions = {"wis"}};
  for (const auto& [mode, draws, steps] :
       {std::tuple{StudyMode::kQuick, 0U, 0U}, std::tuple{StudyMode::kStandard, 3U, 4U},
        std::tuple{StudyMode::kFull, 10U, 5U}}) {
    options.mode = mode;
    const auto plan = make_plan(options, registry, families);
    std::map<std::string, std::size_t> counts;
    for (const StudyPoint& point : plan) ++counts[point.experiment];
    EXPECT_EQ(counts["draws"], 2U * 2U * draws);
    EXPECT_EQ(counts["dimensions"], 2U * steps);
    EXPECT_EQ(plan.back().experiment, draws == 0 ? "families" : "dimensions");
    EXPECT_EQ(plan.back().candidates, draws == 0 ? kFullSize : kDrawSize);
    EXPECT_EQ(plan.back().duality_gap, kFamilyGap);
  }
  EXPECT_EQ(make_plan(options, registry, families).back().family, "wis_78");
}

TEST(Plan, NamesOfSetsAreTakenApart) {
  const auto is = [](const std::string& name, const std::string& family, std::size_t draw,
                     std::size_t dimension) {
    const StudySetName found = study_set_name(name);
    return found.family == family && found.draw == draw && found.dimension == dimension;
  };
  EXPECT_TRUE(is("wis", "wis", 0, 0));
  EXPECT_TRUE(is("wis_24", "wis", 0, 24));
  EXPECT_TRUE(is("wis_draw_3", "wis", 3, 0));
  EXPECT_TRUE(is("robot_units", "robot_units", 0, 0));
  EXPECT_TRUE(is("smr6", "smr6", 0, 0));
  EXPECT_TRUE(is("wis_024", "wis_024", 0, 0));
  EXPECT_TRUE(is("wis_draw_0", "wis_draw_0", 0, 0));
  EXPECT_TRUE(is("wis_99999999999999999999", "wis_99999999999999999999", 0, 0));
}

// The rows of a set, as strings of bytes.
std::set<std::string> rows_of(const InformationSet& set) {
  std::set<std::string> found;
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    const auto row = set.information(i);
    found.insert(
        std::string(reinterpret_cast<const char*>(&row[0]), set.packed_size() * sizeof(double)));
  }
  return found;
}

std::size_t shared_rows(const std::set<std::string>& a, const std::set<std::string>& b) {
  return static_cast<std::size_t>(
      std::ranges::count_if(a, [&](const auto& x) { return b.contains(x); }));
}

TEST(StudySets, DrawsOfTheRobotAreOfItsGridAndNotNested) {
  const auto all = rows_of(make_study_set("robot", kFullSize));
  const auto first = rows_of(make_study_set("robot_draw_1", 2000));
  const auto second = rows_of(make_study_set("robot_draw_2", 2000));
  const auto nested = rows_of(make_study_set("robot", 2000));
  EXPECT_EQ(shared_rows(first, all), first.size());
  EXPECT_EQ(shared_rows(second, all), second.size());
  // Hypergeometric: 2000^2 / 7920 = 505 in common with a standard deviation of 17; six of them.
  for (const auto& [a, b] : {std::pair{&first, &second}, std::pair{&first, &nested}}) {
    EXPECT_NEAR(static_cast<double>(shared_rows(*a, *b)), 505.0, 100.0);
  }
}

TEST(StudySets, DrawsAndDimensionsAreThoseOfTheFamilies) {
  EXPECT_EQ(make_study_set("wis_draw_3", 50).content_hash(),
            make_family("wis", 50, 0, kStudySetSeed + 3).content_hash());
  EXPECT_NE(make_study_set("wis_draw_3", 50).content_hash(),
            make_study_set("wis", 50).content_hash());
  EXPECT_EQ(make_study_set("dup_draw_1", 57).candidate_count(), 50U);
  EXPECT_EQ(make_study_set("r1g_78", 100).dimension(), 78U);
  for (const std::string& family : study_families().drawn) {
    EXPECT_TRUE(is_study_set(family + "_draw_10", kDrawSize)) << family;
  }
  for (const char* none : {"wis_draw_11", "cube3_draw_1", "wis_13", "smo_24", "nothing_6"}) {
    EXPECT_FALSE(is_study_set(none, kDrawSize)) << none;
  }
  EXPECT_FALSE(is_study_set("wis_78", kDrawSize + 1));
  EXPECT_FALSE(is_study_set("wis_draw_1", kDrawSize + 1));
}

// Rows of one solver, as experiment and family.
std::vector<PointSummary> points_of(
    const std::vector<std::pair<std::string, std::string>>& experiments) {
  std::vector<RunRow> runs;
  for (const auto& [experiment, family] : experiments) {
    runs.push_back(timed_row(experiment, "honest", family, 1.0));
  }
  return summarise_points(runs);
}

TEST(Tables, NestedSubsetsStayOutOfProfilesWhereOthersAreRun) {
  const auto nested =
      profile_data(points_of({{"scaling", "robot"}, {"normalisation", "robot_units"}}));
  EXPECT_EQ(nested.instances, std::vector<std::string>{"robot/50"});
  const ProfileData data = profile_data(points_of({{"scaling", "robot"},
                                                   {"draws", "robot_draw_1"},
                                                   {"draws", "wis_draw_1"},
                                                   {"draws", "robot_draw_2"},
                                                   {"dimensions", "wis_24"},
                                                   {"own", "wis_48"}}));
  EXPECT_EQ(data.instances,
            (std::vector<std::string>{"robot_draw_1/50", "wis_draw_1/50", "robot_draw_2/50",
                                      "wis_24/50", "wis_48/50"}));
  EXPECT_EQ(data.groups, (std::vector<std::size_t>{0, 1, 0, 1, 2}));  // own files are no family
  EXPECT_EQ(data.passes, std::vector(1, std::vector(5, 4.5)));
}

TEST(Tables, RatiosAreTurnedToOneSolver) {
  const PairedRatio twice{.ratio = 2.0, .lower = 1.0, .upper = 4.0, .instances = 3, .groups = 2};
  const std::vector<SolverRatio> ratios{
      {.gap = 1e-6, .solver = "a", .against = "b", .ratio = twice},
      {.gap = 1e-6, .solver = "b", .against = "c", .ratio = twice},
      {.gap = 1e-6, .solver = "b", .against = kVirtualBest, .ratio = twice}};
  const auto turned = ratios_against("b", ratios);
  ASSERT_EQ(turned.size(), 2U);
  EXPECT_EQ(turned[0].solver, "a");
  EXPECT_EQ(turned[0].ratio.ratio, 2.0);
  EXPECT_EQ(turned[1].solver, "c");
  EXPECT_EQ(turned[1].against, "b");
  EXPECT_EQ(turned[1].ratio.ratio, 0.5);
  EXPECT_EQ(turned[1].ratio.lower, 0.25);
  EXPECT_EQ(turned[1].ratio.upper, 1.0);
}

}  // namespace
}  // namespace graybox::bench
