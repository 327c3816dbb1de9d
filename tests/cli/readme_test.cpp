// The code that docs/how_to/add_a_solver.md and the headers show, compiled and run.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>

#include "docs/examples/torsney_solver.hpp"
#include "problems/information/information_set.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/core/solver.hpp"
#include "solvers/registry.hpp"

namespace {

std::string text_of(const std::string& path) {
  std::ifstream file(std::string(GRAYBOX_SOURCE_DIR) + "/" + path);
  EXPECT_TRUE(file) << path;
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

graybox::InformationSet two_candidates() {
  graybox::AlignedArray information(2 * 3);  // Q = 2, d = 2, p = 3
  std::ranges::copy(std::array{1., 0., 0., 0., 0., 1.}, information.begin());
  graybox::InformationSet set(2, std::move(information));
  set.validate();
  return set;
}

TEST(AddASolver, ShowsTheExampleWhole) {
  const std::string page = text_of("docs/how_to/add_a_solver.md");
  EXPECT_NE(page.find(text_of("docs/examples/torsney_solver.hpp")), std::string::npos)
      << "docs/how_to/add_a_solver.md and docs/examples/torsney_solver.hpp have drifted apart";
  EXPECT_NE(page.find(text_of("docs/examples/torsney_solver.cpp")), std::string::npos)
      << "docs/how_to/add_a_solver.md and docs/examples/torsney_solver.cpp have drifted apart";
}

TEST(AddASolver, ExampleIsCertified) {
  graybox::SolverRegistry registry = graybox::make_registry();
  registry.add(std::make_unique<TorsneySolver>());
  const graybox::InformationSet set = two_candidates();
  const graybox::Solution answer = registry.at("torsney").solve(set, {.duality_gap = 1e-9});
  EXPECT_EQ(answer.status, graybox::SolveStatus::kSolved);
  EXPECT_LE(graybox::certify(set, answer.design).duality_gap, 1e-9);
}

TEST(Headers, TheExampleOfTheSolverHeaderHolds) {
  const graybox::InformationSet set = two_candidates();
  const graybox::SolverRegistry registry = graybox::make_registry();
  const graybox::Solver& solver = registry.at("column_generation");
  const graybox::Solution answer = solver.solve(set, {.duality_gap = 1e-9});
  const graybox::Certificate proof = graybox::certify(set, answer.design);  // trust only this
  EXPECT_LE(proof.duality_gap, 1e-9);
  EXPECT_NEAR(proof.log_det, 2 * std::log(0.5), 1e-12);
}

}  // namespace
