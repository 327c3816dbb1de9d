// The best cubic regression on [-1, 1] has four points of equal weight, two of them at the ends:
// solved by the default back-end, and proven.
#include <algorithm>
#include <cmath>
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
  const graybox::Solution answer =
      registry.at("column_generation").solve(set, {.duality_gap = 1e-9});
  const graybox::Certificate proof = graybox::certify(set, answer.design);
  const std::vector<double>& weights = answer.design.weights;
  std::printf("gap %.1e, weight of the ends %.4f and %.4f\n", proof.duality_gap, weights.front(),
              weights.back());
  return proof.duality_gap <= 1e-9 && std::abs(weights.front() - 0.25) < 1e-4 &&
                 std::abs(weights.back() - 0.25) < 1e-4
             ? 0
             : 1;
}
