// The listings that README and docs quote are what the program prints.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>

#include "tests/support/command_runner.hpp"
#include "tests/support/quoted_listing.hpp"

namespace graybox {
namespace {

using testing::expect_quoted;
using testing::source_file;

using Listings = testing::CommandRunner;

// The information matrices f f^T of a cubic polynomial at 1001 points, as README.md makes them.
std::string cubic_polynomial() {
  std::string text;
  for (int k = 0; k <= 1000; ++k) {
    const double t = -1.0 + 0.002 * k;
    const std::array<double, 4> f{1.0, t, t * t, t * t * t};
    for (std::size_t i = 0; i < f.size(); ++i) {
      for (std::size_t j = 0; j <= i; ++j) {
        text += fmt::format("{:.17g}{}", f[i] * f[j], i == 3 && j == 3 ? '\n' : ',');
      }
    }
  }
  return text;
}

// The optimum on the whole interval has a quarter of the weight at -1, 1 and the roots of the
// derivative of the third Legendre polynomial (Hoel 1958); the grid misses two of them by little.
TEST_F(Listings, OfTheReadmesDesignAreWhatTheProgramPrints) {
  testing::write_text(folder_.file("set.csv"), cubic_polynomial());
  const testing::Outcome outcome = graybox("solve set.csv --gap 1e-9");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  expect_quoted("README.md", outcome.out, "column_generation: ");
  const testing::Outcome whole = graybox("exact set.csv --experiments 12");
  EXPECT_EQ(whole.exit_code, 0) << whole.out;
  EXPECT_NE(source_file("README.md").find("graybox exact set.npy --experiments 12"),
            std::string::npos);
  const double root = 1.0 / std::sqrt(5.0);
  const std::array<double, 4> support{-1.0, -root, root, 1.0};
  double vandermonde = 1.0;
  for (std::size_t i = 0; i < support.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) vandermonde *= support[i] - support[j];
  }
  const double optimum = 2.0 * std::log(std::abs(vandermonde)) - 4.0 * std::log(4.0);
  const std::string page = source_file("README.md"), label = "log det M ";
  EXPECT_NEAR(std::stod(page.substr(page.find(label) + label.size())), optimum, 1e-4);
}

TEST_F(Listings, OfAnEllipsoidAreWhatTheProgramPrints) {
  testing::write_text(folder_.file("motors.csv"),
                      source_file("docs/examples/ellipsoid/motors.csv"));
  const testing::Outcome outcome = graybox("ellipsoid motors.csv --drop 2");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  expect_quoted("docs/how_to/ellipsoid.md", outcome.out, "ellipsoid: ");
}

// The campaign of docs/how_to/constraints.md.
TEST_F(Listings, OfExperimentsUnderConstraintsAreWhatTheProgramPrints) {
  const std::string page = source_file("docs/how_to/constraints.md");
  const std::size_t from = page.find("format: graybox-request/1");
  testing::write_text(folder_.file("request.yaml"),
                      page.substr(from, page.find("```", from) - from));
  ASSERT_EQ(graybox("problem robot -o set.h5").exit_code, 0);
  ASSERT_EQ(
      graybox("exact set.h5 --experiments 8 --stock 1 --gap 0.001 -o last_week.json").exit_code, 0);
  const testing::Outcome relaxed = graybox("solve set.h5 --request request.yaml -o relaxed.json");
  ASSERT_EQ(relaxed.exit_code, 0) << relaxed.err;
  expect_quoted("docs/how_to/constraints.md", relaxed.out, "column_generation: ");
  const testing::Outcome exact = graybox("exact set.h5 --request request.yaml -o next.json");
  ASSERT_EQ(exact.exit_code, 0) << exact.err;
  expect_quoted("docs/how_to/constraints.md", exact.out, "branch_and_bound: ");
  for (const std::string design : {"relaxed.json", "next.json"}) {
    const testing::Outcome checked = graybox("check set.h5 " + design);
    EXPECT_EQ(checked.exit_code, 0) << checked.out << checked.err;
  }
}

TEST_F(Listings, OfAPlanAreWhatTheProgramPrints) {
  const std::string page = "docs/how_to/plan.md";
  ASSERT_EQ(graybox("problem random --family wis --candidates 60 --dimension 4 --seed 3 "
                    "-o plan_set.h5")
                .exit_code,
            0);
  const testing::Outcome plan =
      graybox("design plan plan_set.h5 --target 'sd(all) <= 0.2' --at-most 300");
  ASSERT_EQ(plan.exit_code, 0) << plan.err << plan.out;
  expect_quoted(page, plan.out, "plan_set.h5: ");
}

// The lines of docs/reference/formats.md that prove a design without graybox.
TEST_F(Listings, OfAProofWithoutGrayboxProveTheDesign) {
  if (std::system("/usr/bin/python3 -c 'import numpy' > /dev/null 2>&1") != 0) {
    GTEST_SKIP() << "not here: python3-numpy";
  }
  const std::string page = source_file("docs/reference/formats.md");
  const std::size_t from = page.find("import json\nimport numpy as np\n");
  ASSERT_NE(from, std::string::npos);
  testing::write_text(folder_.file("proof.py"), page.substr(from, page.find("```", from) - from));
  ASSERT_EQ(
      graybox("problem random --family wis --candidates 300 --dimension 5 -o set.npy").exit_code,
      0);
  ASSERT_EQ(graybox("solve set.npy --gap 1e-6 -o design.json").exit_code, 0);
  const testing::Outcome proof = graybox("--version && /usr/bin/python3 proof.py");
  const std::string first = "log det M = ", second = ", of no design above ";
  const std::size_t at = proof.out.find(first), then = proof.out.find(second);
  ASSERT_NE(then, std::string::npos) << proof.out << proof.err;
  const double log_det = std::stod(proof.out.substr(at + first.size()));
  const double bound = std::stod(proof.out.substr(then + second.size()));
  EXPECT_GE(bound, log_det - 1e-10);
  EXPECT_LE(bound, log_det + 5.0 * std::log1p(1e-6) + 1e-10);
}

// The thermometer of docs/how_to/own_model.md, as its Python makes it.
TEST_F(Listings, OfOnesOwnModelAreWhatTheProgramPrints) {
  const double final = 60.0, tau = 8.0;
  std::string jacobians = "final,tau\n", times = "time [s]\n";
  for (int k = 0; k < 600; ++k) {
    const double t = 0.1 + 59.9 * k / 599.0, decay = std::exp(-t / tau);
    jacobians += fmt::format("{:.17g},{:.17g}\n", 1.0 - decay, -final * t / (tau * tau) * decay);
    times += fmt::format("{:.17g}\n", t);
  }
  testing::write_text(folder_.file("jacobians.csv"), jacobians);
  testing::write_text(folder_.file("times.csv"), times);
  const testing::Outcome made =
      graybox("problem from-jacobians jacobians.csv --noise 0.2 --candidates times.csv -o set.h5");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const testing::Outcome solved = graybox("solve set.h5 --gap 1e-9");
  ASSERT_EQ(solved.exit_code, 0) << solved.err;
  expect_quoted("docs/how_to/own_model.md", made.out + solved.out, "wrote set.h5");
}

TEST_F(Listings, OfTheReadmesDiagnosisAreWhatTheProgramPrints) {
  const std::string drive = std::string(GRAYBOX_SOURCE_DIR) + "/docs/examples/fit/drive";
  const testing::Outcome outcome = graybox("diagnose " + drive + "/motor.yaml " + drive);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  expect_quoted("README.md", outcome.out);
}

TEST_F(Listings, OfADiagnosisAreWhatTheProgramPrints) {
  const std::string docs = std::string(GRAYBOX_SOURCE_DIR) + "/docs/examples/";
  ASSERT_EQ(graybox("simulate " + docs + "simulate/drive.yaml " + docs +
                    "simulate/drive_plan.yaml -o drive")
                .exit_code,
            0);
  const testing::Outcome outcome = graybox("diagnose " + docs + "diagnose/drive.yaml drive");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  expect_quoted("docs/how_to/diagnose.md", outcome.out);
  // The number of hypotheses.
  const std::string page = source_file("docs/how_to/diagnose.md");
  const std::size_t at = page.find(" hypotheses.)");
  ASSERT_NE(at, std::string::npos);
  const std::size_t begin = page.rfind(' ', at - 1) + 1;
  EXPECT_NE(outcome.out.find(page.substr(begin, at - begin) + " hypotheses were tested"),
            std::string::npos)
      << outcome.out;
}

}  // namespace
}  // namespace graybox
