// graybox solve --start: what it saves, and what is refused.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

using nlohmann::json;
using testing::Outcome;
using testing::read_text;
using testing::write_text;

class StartCommand : public testing::CommandRunner {
 protected:
  void SetUp() override {
    make_set("1", "set.h5");
    ASSERT_EQ(graybox("solve set.h5 --gap 1e-10 -o start.json").exit_code, 0);
  }
  void make_set(const std::string& seed, const std::string& name) {
    ASSERT_EQ(graybox("problem random --family wis --candidates 2000 --dimension 6 --seed " + seed +
                      " -o " + name)
                  .exit_code,
              0);
  }
  json solved(const std::string& arguments) {
    const Outcome outcome = graybox("solve set.h5 --json " + arguments);
    EXPECT_EQ(outcome.exit_code, 0) << arguments << ": " << outcome.err << outcome.out;
    return json::parse(outcome.out);
  }
  // The design with a change to it.
  template <typename Change>
  void write_changed(Change change) {
    json design = json::parse(read_text(folder_.file("start.json")));
    change(design);
    write_text(folder_.file("changed.json"), design.dump());
  }
};

TEST_F(StartCommand, FromTheOptimumOnePassIsEnough) {
  const json cold = solved("--gap 1e-9"), warm = solved("--gap 1e-9 --start start.json");
  EXPECT_LT(warm["passes"], 1.1);
  EXPECT_GT(cold["passes"], 2.0);
  EXPECT_EQ(warm["problem_hash"], cold["problem_hash"]);
  EXPECT_NEAR(warm["log_det"].get<double>(), cold["log_det"].get<double>(), 6 * 1e-9);
}

TEST_F(StartCommand, BackEndsGoOnWhereAnotherLeftOff) {
  for (const std::string solver : {"multiplicative", "multiplicative_accelerated", "fedorov_wynn",
                                   "vertex_exchange", "randomized_exchange", "cocktail"}) {
    const json warm = solved("--start start.json --solver " + solver);
    EXPECT_EQ(warm["iterations"], 0) << solver;
  }
}

TEST_F(StartCommand, WhatIsNoStartIsRefusedInOneLine) {
  make_set("2", "other.h5");
  expect_refused("solve other.h5 --start start.json", "start.json: problem_hash");
  ASSERT_EQ(
      graybox("problem random --family wis --candidates 50 --dimension 6 -o small.h5").exit_code,
      0);
  expect_refused("solve small.h5 --start start.json", "start.json: candidates is 2000");
  write_changed([](json& design) {
    for (json& entry : design["support"]) entry["weight"] = 0.0;
  });
  expect_refused("solve set.h5 --start changed.json",
                 "changed.json: support: the weights sum to 0");
  write_changed([](json& design) { design["support"][0]["index"] = 2000; });
  expect_refused("solve set.h5 --start changed.json", "changed.json: support[0]: index 2000");
  expect_refused("solve set.h5 --start missing.json", "missing.json");
}

TEST_F(StartCommand, WhatCanNotBeginFromADesignSaysSo) {
  expect_refused("solve set.h5 --start start.json --solver dual_interior_point",
                 "dual_interior_point can't begin from a design");
  expect_refused("solve set.h5 --start start.json --solver external:true",
                 "can't begin from a design");
  expect_refused("solve set.h5 --start start.json --experiments 20", "--start can't be combined");
  expect_refused("solve set.h5 --start start.json --floor A=0.9", "--start can't be combined");
}

}  // namespace
}  // namespace graybox
