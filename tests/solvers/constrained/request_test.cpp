// Requests: selections, files, and what is refused.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "problems/formats/information_set_file.hpp"
#include "solvers/constrained/candidate_selection.hpp"
#include "solvers/constrained/design_request.hpp"
#include "solvers/constrained/request_tables.hpp"
#include "tests/support/design_sets.hpp"
#include "tests/support/refusal.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using testing::expect_refused;
using testing::write_text;

// Ten candidates with coordinates q1 = 0, 10, ... and q2 = -1, 1, -1, ...
InformationSet grid() {
  const InformationSet set = testing_sets::wishart(2, 10, 2, 1);
  AlignedArray packed(set.candidate_count() * set.packed_size());
  std::copy_n(set.data(), packed.size(), packed.begin());
  CandidateTable table{{"q1", "q2"}, {"deg", ""}, {}};
  for (int i = 0; i < 10; ++i) {
    table.values.push_back(10.0 * i);
    table.values.push_back(i % 2 == 0 ? -1.0 : 1.0);
  }
  return InformationSet(2, std::move(packed), std::move(table));
}

TEST(CandidateSelection, ReadsIndicesRangesAndConditions) {
  const InformationSet set = grid();
  using Indices = std::vector<std::size_t>;
  EXPECT_EQ(select_candidates(set, "3, 1-2,3", "x"), (Indices{1, 2, 3}));
  EXPECT_EQ(select_candidates(set, "q1 >= 70", "x"), (Indices{7, 8, 9}));
  EXPECT_EQ(select_candidates(set, "q1>=70 & q2 = 1", "x"), (Indices{7, 9}));
  EXPECT_EQ(select_candidates(set, "0, q1 != 90 & q1 > 60 & q2 < 0", "x"), (Indices{0, 8}));
  const std::vector<double> counts = select_counts(set, "2:3, 5-6, 5", "x");
  EXPECT_EQ(counts[2], 3.0);
  EXPECT_EQ(counts[5], 2.0);
  EXPECT_EQ(counts[6], 1.0);
}

TEST(CandidateSelection, RefusesWhatItCantRead) {
  const InformationSet set = grid();
  for (const auto& [text, message] :
       std::vector<std::pair<std::string, std::string>>{{"", "empty"},
                                                        {"1,,2", "empty"},
                                                        {"10", "beyond the last candidate, 9"},
                                                        {"5-3", "ends before"},
                                                        {"-1", "no candidate"},
                                                        {"1.5", "no candidate"},
                                                        {"q3 > 1", "there are q1, q2"},
                                                        {"q1 > x", "needs a number"},
                                                        {"q1 > 1000", "holds for no candidate"}}) {
    expect_refused([&] { (void)select_candidates(set, text, "forbid"); }, message);
  }
  expect_refused([&] { (void)select_counts(set, "3:0", "require"); }, "positive count");
  expect_refused([&] { (void)select_candidates(testing_sets::wishart(2, 3, 2, 1), "q1 > 1", "f"); },
                 "coordinates");
}

class RequestFiles : public ::testing::Test {
 protected:
  DesignConstraints constraints(const std::string& yaml) {
    write_text(folder_.file("request.yaml"), "format: graybox-request/1\n" + yaml);
    return resolve(read_design_request(folder_.file("request.yaml")), set_);
  }
  void refused(const std::string& yaml, const std::string& message) {
    expect_refused([&] { (void)constraints(yaml); }, message);
  }

  testing::TemporaryFolder folder_;
  InformationSet set_ = grid();
};

TEST_F(RequestFiles, PutsEverythingIntoNumbers) {
  write_text(folder_.file("costs.csv"), "cost\n1\n2\n3\n4\n5\n6\n7\n8\n9\n10\n");
  write_text(folder_.file("done.csv"), "index,count\n3,2\n4\n");
  write_information_set(folder_.file("prior.csv"), testing_sets::wishart(2, 1, 2, 9));
  const DesignConstraints all = constraints(
      "experiments: 12\nbudget: 40\ncosts: costs.csv\nprior: prior.csv\ndone: done.csv\n"
      "stock: 2\nrequire: 1:2\nforbid: q1 > 70\n"
      "constraints:\n"
      "  - {name: left, candidates: q2 < 0, at_most: 25 %}\n"
      "  - {name: turn, coefficients: q1, at_least: 5, at_most: 100}\n"
      "  - {name: pair, candidates: '0, 1', equal: 3}\n");
  ASSERT_EQ(all.rows.size(), 5U);
  EXPECT_EQ(all.rows[0].coefficients[9], 10.0);
  EXPECT_EQ(all.rows[0].upper, 40.0);
  EXPECT_EQ(all.rows[1].lower, 12.0);
  EXPECT_EQ(all.rows[2].upper, 3.0);  // a quarter of 12
  EXPECT_EQ(all.rows[3].lower, 5.0);
  EXPECT_EQ(all.rows[3].coefficients[4], 40.0);
  EXPECT_EQ(all.rows[4].lower, all.rows[4].upper);
  EXPECT_EQ(all.upper[8], 0.0);
  EXPECT_EQ(all.upper[7], 2.0);
  EXPECT_EQ(all.lower[1], 2.0);
  const InformationSet prior = testing_sets::wishart(2, 1, 2, 9);
  EXPECT_NEAR(all.prior[0],
              prior.information(0)[0] + 2.0 * set_.information(3)[0] + set_.information(4)[0],
              1e-12);
}

TEST_F(RequestFiles, SharesOfABudgetStayShares) {
  const DesignConstraints all =
      constraints("budget: 40\ncosts: 2\nconstraints:\n  - {candidates: 0-4, at_most: 25 %}\n");
  EXPECT_DOUBLE_EQ(all.rows[1].coefficients[0], 0.75);
  EXPECT_DOUBLE_EQ(all.rows[1].coefficients[9], -0.25);
  EXPECT_EQ(all.rows[1].upper, 0.0);
}

TEST_F(RequestFiles, ReadsConstraintsFromTables) {
  std::string table = "left <= 3,turns >= 2, both = 4\n";
  for (int i = 0; i < 10; ++i) table += "1,0.5," + std::to_string(i) + "\n";
  write_text(folder_.file("rows.csv"), table);
  const DesignConstraints all = constraints("experiments: 5\nconstraints: rows.csv\n");
  ASSERT_EQ(all.rows.size(), 4U);
  EXPECT_EQ(all.rows[1].name, "left");
  EXPECT_EQ(all.rows[1].upper, 3.0);
  EXPECT_EQ(all.rows[2].lower, 2.0);
  EXPECT_EQ(all.rows[3].coefficients[7], 7.0);
}

TEST_F(RequestFiles, ReadsATableOfOneConstraint) {
  for (const std::string head : {"left side <= 3", "\"left side <= 3\"", "left side<=3"}) {
    std::string table = head + "\n";
    for (int i = 0; i < 10; ++i) table += "1\n";
    write_text(folder_.file("rows.csv"), table);
    const DesignConstraints all = constraints("experiments: 5\nconstraints: rows.csv\n");
    ASSERT_EQ(all.rows.size(), 2U);
    EXPECT_EQ(all.rows[1].name, "left side");
  }
}

TEST_F(RequestFiles, RefusesWithTheFieldAndTheRemedy) {
  refused("stock: 1\n", "experiments");
  refused("experiments: -2\n", "experiments");
  refused("experiments: 5\nbudget: 3\n", "costs and budget belong together");
  refused("budget: 3\ncosts: missing.csv\n", "neither a file nor a coordinate");
  refused("budget: 3\ncosts: -1\n", "cost of candidate 0");
  refused("experiments: 5\nprior: missing.h5\n", "missing.h5");
  refused("experiments: 5\nwrong: 1\n", "wrong");
  refused("experiments: 5\nconstraints:\n  - {candidates: 1}\n", "at_most");
  refused("experiments: 5\nconstraints:\n  - {candidates: 1, equal: 1, at_most: 2}\n", "equal");
  refused("experiments: 5\nconstraints:\n  - {at_most: 2}\n", "candidates");
  refused("experiments: 5\nconstraints:\n  - {candidates: 1, at_most: many}\n",
          "'many' is no bound");
  refused("experiments: 5\nrequire: 1:3\nstock: 2\n", "candidate 1 is required 3 times");
  write_text(folder_.file("short.csv"), "1\n2\n");
  refused("budget: 5\ncosts: short.csv\n", "2 lines of numbers for 10 candidates");
  write_text(folder_.file("done.csv"), "11,1\n");
  refused("experiments: 5\ndone: done.csv\n", "index from 0 to 9");
  write_text(folder_.file("other.json"), R"({"counts": [], "candidates": "x"})");
  refused("experiments: 5\ndone: other.json\n", "a design of another set");
  write_text(folder_.file("other.json"), R"({"counts": [], "problem_hash": "abc"})");
  refused("experiments: 5\ndone: other.json\n", "a design of another set");
  refused("experiments: 5\nconstraints:\n  - {candidates: 1, at_most: 30 % of all}\n", "no bound");
  write_text(folder_.file("done.json"), "{\"format\": 1}");
  refused("experiments: 5\ndone: done.json\n", "no design with counts");
}

TEST_F(RequestFiles, SurvivesTheWayThroughADesignFile) {
  write_text(folder_.file("stock.csv"), "1\n1\n1\n1\n1\n2\n2\n2\n2\n2\n");
  write_text(folder_.file("request.yaml"),
             "format: graybox-request/1\nexperiments: 6\nstock: stock.csv\n"
             "constraints:\n  - {name: left, candidates: q2 < 0, at_most: 50 %}\n");
  const DesignRequest request = read_design_request(folder_.file("request.yaml"));
  const DesignConstraints before = resolve(request, set_);
  const auto entry = to_json(request, before, folder_.file(""));
  EXPECT_EQ(entry["stock"], "stock.csv");
  const DesignConstraints after = resolve(design_request(entry, folder_.file("")), set_);
  EXPECT_EQ(content_hash(after), content_hash(before));
  EXPECT_EQ(entry["constraints_hash"], content_hash(before));
}

}  // namespace
}  // namespace graybox
