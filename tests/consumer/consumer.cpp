// Two parameters, three experiments: the first sees parameter 1, the second parameter 2, the third
// a little of both. The best plan splits the effort evenly between the first two.
#include <algorithm>
#include <array>
#include <cstdio>

#include "graybox/problems/information/information_set.hpp"
#include "graybox/solvers/certificates/certificate.hpp"
#include "solvers/registry.hpp"

int main() {
  constexpr std::array<double, 3 * kExperiments> kPacked = {1, 0, 0, 0, 0, 4, 0.2, 0, 0.8};
  graybox::AlignedArray information(kPacked.size());
  std::ranges::copy(kPacked, information.begin());
  const graybox::InformationSet set(2, std::move(information));
  set.validate();

  const graybox::Certificate best = graybox::certify(set, {{0.5, 0.5, 0.0}});
  const graybox::Certificate worse = graybox::certify(set, {{0.4, 0.4, 0.2}});
  std::printf("optimal plan: duality gap %.1e; another: %.2f\n", best.duality_gap,
              worse.duality_gap);
  return best.duality_gap < 1e-12 && worse.duality_gap > 0.1 ? 0 : 1;
}
