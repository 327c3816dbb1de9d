// `graybox plot`: pictures of designs of every kind, and files that it leaves alone.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

namespace fs = std::filesystem;

class PlotCommand : public testing::CommandRunner {
 protected:
  void SetUp() override { make("problem robot --grid 60 -o set.h5"); }

  void make(const std::string& command) {
    const testing::Outcome made = graybox(command);
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }

  testing::Outcome plotted(const std::string& arguments, const std::string& folder) {
    const testing::Outcome outcome = graybox("plot " + arguments + " -o " + folder);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return outcome;
  }

  [[nodiscard]] fs::path place(const std::string& name) const { return folder_.file(name); }
  [[nodiscard]] bool has(const std::string& name) const { return fs::exists(place(name)); }
};

TEST_F(PlotCommand, ADesignAloneIsEnough) {
  make("solve set.h5 -o design.json");
  const testing::Outcome outcome = graybox("plot design.json");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  for (const char* name :
       {"weights", "weights_over_q2", "sensitivities", "sensitivities_over_q2"}) {
    EXPECT_TRUE(has("design_plots/" + std::string(name) + ".svg")) << name;
  }
  EXPECT_EQ(outcome.out.find("note:"), std::string::npos) << outcome.out;
}

TEST_F(PlotCommand, FindsTheSetBesideTheDesign) {
  make("solve set.h5 -o design.json");
  fs::create_directory(place("elsewhere"));
  fs::rename(place("set.h5"), place("elsewhere/set.h5"));
  const testing::Outcome lost = graybox("plot design.json");
  EXPECT_EQ(lost.exit_code, 2);
  EXPECT_NE(lost.err.find("add --set FILE"), std::string::npos) << lost.err;
  EXPECT_FALSE(has("design_plots"));
  fs::rename(place("design.json"), place("elsewhere/design.json"));
  plotted("elsewhere/design.json", "pictures");
  EXPECT_TRUE(has("pictures/weights.svg"));
}

TEST_F(PlotCommand, ExactDesignsAndRequestsAreDrawn) {
  make("exact set.h5 --experiments 14 --gap 0.05 -o exact.json");
  plotted("exact.json", "exact");
  EXPECT_TRUE(has("exact/counts.svg"));
  EXPECT_TRUE(has("exact/sensitivities.svg"));
  make("solve set.h5 --experiments 20 --stock 2 -o stock.json");
  plotted("stock.json", "stock");
  EXPECT_TRUE(has("stock/sensitivities.svg"));
}

TEST_F(PlotCommand, SaysWhereNoSensitivitiesAreDrawn) {
  make("solve set.h5 --floor A=0.9 -o floor.json");
  const testing::Outcome outcome = plotted("floor.json", "floor");
  EXPECT_NE(outcome.out.find("no sensitivities are drawn"), std::string::npos) << outcome.out;
  EXPECT_TRUE(has("floor/weights.svg"));
  EXPECT_FALSE(has("floor/sensitivities.svg"));
}

// Whoever made the file: E needs its dual matrix, and one line alone determines no plane.
TEST_F(PlotCommand, SaysWhatAFileLacks) {
  make("problem random --family r1g --candidates 40 --dimension 4 -o lines.h5");
  std::ofstream(place("e.json")) << R"({"format": "graybox-design/1", "criterion": {"name": "E"},
    "problem": "set.h5", "support": [{"index": 0, "weight": 0.5}, {"index": 7, "weight": 0.5}]})";
  EXPECT_NE(plotted("e.json", "e").out.find("lacks the dual matrix"), std::string::npos);
  std::ofstream(place("one.json")) << R"({"format": "graybox-design/1",
    "problem": "lines.h5", "support": [{"index": 0, "weight": 1}]})";
  EXPECT_NE(plotted("one.json", "one").out.find("singular"), std::string::npos);
}

TEST_F(PlotCommand, ReplacesItsOwnPicturesAndNoOthers) {
  make("solve set.h5 -o design.json");
  plotted("design.json", "pictures");
  plotted("design.json", "pictures");
  std::ofstream(place("pictures/sensitivities.svg")) << "<svg>my own</svg>\n";
  const testing::Outcome refused = graybox("plot design.json -o pictures");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_NE(refused.err.find("sensitivities.svg"), std::string::npos) << refused.err;
}

TEST_F(PlotCommand, RefusesAnotherSet) {
  make("solve set.h5 -o design.json");
  make("problem robot --grid 61 -o other.h5");
  const testing::Outcome outcome = graybox("plot design.json --set other.h5");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
}

}  // namespace
}  // namespace graybox
