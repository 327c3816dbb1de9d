// `graybox ellipsoid`: what is written is checked again, also after tampering, and what is refused.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>

#include "problems/base/random.hpp"
#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

using Json = nlohmann::json;

class EllipsoidCommand : public testing::CommandRunner {
 protected:
  void write_points(int count, double offset = 0.0) {
    Random random(1);
    std::string text = "a,b,c\n";
    for (int i = 0; i < count; ++i) {
      text += fmt::format("{:.17g},{:.17g},{:.17g}\n", offset + random.normal(),
                          2.0 * random.normal(), random.normal());
    }
    testing::write_text(folder_.file("points.csv"), text);
  }

  Json read(const std::string& name) { return Json::parse(testing::read_text(folder_.file(name))); }

  void write(const std::string& name, const Json& json) {
    testing::write_text(folder_.file(name), json.dump());
  }
};

TEST_F(EllipsoidCommand, WritesWhatItChecks) {
  write_points(400, 1e6);
  const testing::Outcome found = graybox("ellipsoid points.csv --gap 1e-9 -o e.json --json");
  ASSERT_EQ(found.exit_code, 0) << found.err;
  const Json printed = Json::parse(found.out), file = read("e.json");
  EXPECT_EQ(file["format"], "graybox-ellipsoid/1");
  EXPECT_EQ(file["names"], (Json{"a", "b", "c"}));
  EXPECT_EQ(file["centre"], printed["centre"]);
  EXPECT_LE(file["volume_bound"].get<double>(), 1e-9);
  EXPECT_LE(file["largest_distance"].get<double>(), 1.0);
  double sum = 0.0;
  for (const Json& entry : file["contact"]) {
    sum += entry["weight"].get<double>();
    EXPECT_NEAR(entry["distance"].get<double>(), 1.0, 1e-8);
  }
  EXPECT_NEAR(sum, 1.0, 1e-12);
  const testing::Outcome checked = graybox("ellipsoid points.csv --check e.json --gap 1e-9 --json");
  EXPECT_EQ(checked.exit_code, 0) << checked.out;
  EXPECT_EQ(Json::parse(checked.out)["contains_all"], true);
}

// Without weights or factor, as another program writes it: the bound comes from graybox's weights.
TEST_F(EllipsoidCommand, ChecksTheEllipsoidOfAnotherProgram) {
  testing::write_text(folder_.file("square.csv"), "1,1\n-1,1\n1,-1\n-1,-1\n");
  write("own.json", {{"format", "graybox-ellipsoid/1"},
                     {"centre", {0.0, 0.0}},
                     {"shape", {{0.5, 0.0}, {0.0, 0.4}}}});
  const testing::Outcome wide = graybox("ellipsoid square.csv --check own.json --json");
  EXPECT_EQ(wide.exit_code, 1);
  const Json verdict = Json::parse(wide.out);
  EXPECT_EQ(verdict["contains_all"], true);
  EXPECT_NEAR(verdict["log_volume"].get<double>(), std::log(std::numbers::pi / std::sqrt(0.2)),
              1e-12);
  EXPECT_NEAR(verdict["volume_bound"].get<double>(), 0.5 / std::sqrt(0.2) - 1.0, 1e-6);
  write("own.json", {{"format", "graybox-ellipsoid/1"},
                     {"centre", {0.0, 0.0}},
                     {"shape", {{0.5, 0.0}, {0.0, 0.51}}}});
  const testing::Outcome narrow = graybox("ellipsoid square.csv --check own.json");
  EXPECT_EQ(narrow.exit_code, 1);
  EXPECT_NE(narrow.out.find("does NOT contain all points"), std::string::npos) << narrow.out;
}

TEST_F(EllipsoidCommand, SeesTampering) {
  write_points(100);
  ASSERT_EQ(graybox("ellipsoid points.csv -o e.json").exit_code, 0);
  Json shifted = read("e.json");
  shifted["centre"][1] = shifted["centre"][1].get<double>() + 1e-6;
  write("shifted.json", shifted);
  EXPECT_EQ(graybox("ellipsoid points.csv --check shifted.json").exit_code, 1);
  Json wide = read("e.json");
  wide["factor"][0][0] = 0.5 * wide["factor"][0][0].get<double>();
  write("wide.json", wide);
  EXPECT_EQ(graybox("ellipsoid points.csv --check wide.json").exit_code, 1);
  Json weights = read("e.json");
  weights["contact"][0]["weight"] = 0.0;
  write("weights.json", weights);
  EXPECT_EQ(graybox("ellipsoid points.csv --check weights.json").exit_code, 1);
}

// Two far points are the first to go, and the file says so to whoever checks it.
TEST_F(EllipsoidCommand, DropsOutliers) {
  write_points(200);
  const std::string points = testing::read_text(folder_.file("points.csv"));
  testing::write_text(folder_.file("points.csv"), points + "40,0,0\n0,0,-30\n");
  const testing::Outcome found = graybox("ellipsoid points.csv --drop 2 -o e.json");
  ASSERT_EQ(found.exit_code, 0) << found.err;
  const Json file = read("e.json");
  ASSERT_EQ(file["dropped"].size(), 2U);
  EXPECT_EQ(file["dropped"][0]["index"].get<int>() + file["dropped"][1]["index"].get<int>(), 401);
  for (const Json& entry : file["dropped"]) {
    EXPECT_NEAR(entry["weight"].get<double>(), 0.25, 0.01);
    EXPECT_LT(entry["volume_factor"].get<double>(), 0.3);
  }
  EXPECT_EQ(graybox("ellipsoid points.csv --check e.json").exit_code, 0);
  ASSERT_EQ(graybox("ellipsoid points.csv --drop 0 -o all.json").exit_code, 0);
  EXPECT_FALSE(read("all.json").contains("dropped"));
}

TEST_F(EllipsoidCommand, RefusesWhatHasNoEllipsoid) {
  const auto refuse = [&](const std::string& text, const std::string& message) {
    testing::write_text(folder_.file("bad.csv"), text);
    expect_refused("ellipsoid bad.csv", message);
  };
  refuse("", "bad.csv: the file is empty");
  refuse("a,b\n", "bad.csv: there are no rows");
  refuse("a,b\n1,2\n3,4\n", "at least 3 are needed");
  refuse("1,2\n3,nan\n4,5\n", "bad.csv: line 2, column 2: nan is not finite");
  refuse("1,2\n3,x\n4,5\n", "bad.csv: line 2, column 2: 'x' is no number");
  refuse("1,2\n3\n4,5\n", "bad.csv: line 2: 1 numbers, but 2 in the first row");
  refuse("a,b\n1,2\n1,2\n1,2\n", "column 'a' is 1 in every row");
  refuse("a,b\n1,2\n2,4\n3,6\n4,8\n", "column 'b' follows from the others");
  refuse("a,b,c\n1,2\n2,4\n3,6\n", "3 columns are named, but a line has 2 numbers");
  refuse("1,1e300\n2,1\n3,2\n", "choose another unit");
  write_points(10);
  expect_refused("ellipsoid points.csv --drop 7", "fewer than 4 are left; drop fewer");
  expect_refused("ellipsoid points.csv --gap 0", "--gap");
  expect_refused("ellipsoid points.csv --check none.json", "none.json: can't be opened");
}

TEST_F(EllipsoidCommand, RefusesWhatIsNoEllipsoidFile) {
  write_points(10);
  ASSERT_EQ(graybox("ellipsoid points.csv -o e.json").exit_code, 0);
  const auto refuse = [&](const char* key, const Json& value, const std::string& message) {
    Json file = read("e.json");
    file[key] = value;
    write("bad.json", file);
    expect_refused("ellipsoid points.csv --check bad.json", message);
  };
  refuse("format", "graybox-design/1", "no object of format graybox-ellipsoid/1");
  refuse("centre", {1.0, 2.0}, "centre must have 3 finite numbers");
  refuse("factor", {{1, 0, 0}, {0, 1, 0}, {0, 0, -1}}, "positive diagonal");
  refuse("factor", {{1, 0, 0}, {0, 1, 0}}, "factor must have 3 rows");
  refuse("contact", {{{"index", 10}, {"weight", 1.0}}}, "index must be an integer from 0 to 9");
  refuse("dropped", {{{"index", -1}}}, "dropped[0]: index must be an integer from 0 to 9");
  refuse("centred", true, "the centre is not zero");
  testing::write_text(folder_.file("bad.json"), R"({"centre": [0, 1E1000, 0]})");
  expect_refused("ellipsoid points.csv --check bad.json",
                 "bad.json: centre[1]: the number 1E1000 is too large");
}

}  // namespace
}  // namespace graybox
