// The design of docs/reference/cpp.md: a cubic polynomial on a grid, solved and proven.
#include <cstdio>
#include <utility>
#include <vector>

#include "graybox/problems/information/jacobian_information.hpp"
#include "graybox/solvers/certificates/certificate.hpp"
#include "graybox/solvers/registry.hpp"

int main() {
  graybox::Jacobians jacobians{.candidates = 1001, .outputs = 1, .parameters = 4, .values = {}};
  for (int k = 0; k <= 1000; ++k) {
    const double t = -1.0 + 0.002 * k;
    for (const double value : {1.0, t, t * t, t * t * t}) jacobians.values.push_back(value);
  }
  const graybox::InformationSet set = graybox::information_set_from_jacobians(
      std::move(jacobians), graybox::JacobianNoise::deviations(std::vector{1.0}));

  const graybox::SolverRegistry registry = graybox::make_registry();
  const graybox::Solver& solver = registry.at("column_generation");
  const graybox::Solution answer = solver.solve(set, {.duality_gap = 1e-9});
  const graybox::Certificate proof = graybox::certify(set, answer.design);  // trust only this
  std::printf("log det M %.6f, gap %.1e\n", proof.log_det, proof.duality_gap);
  return proof.duality_gap <= 1e-9 ? 0 : 1;
}
