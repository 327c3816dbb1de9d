// Prints the table of docs/normalisation.md: the dual interior-point method on the paper's dual (10)
// as written, with its rows scaled, whitened, and both, on sets whose parameters are measured in
// units further and further apart. Run as: normalisation > table.md
#include <fmt/format.h>

#include <cmath>
#include <string>

#include "graybox/bench/study/study_sets.hpp"
#include "graybox/problems/packed_matrix.hpp"
#include "graybox/solvers/certificate.hpp"
#include "graybox/solvers/dual_newton.hpp"

namespace {

using namespace graybox;

// Parameter j in units of 10^(decades (j/(d-1) - 1/2)): H_jk times both units.
InformationSet in_units(const InformationSet& set, double decades) {
  const std::size_t d = set.dimension(), p = set.packed_size();
  std::vector<double> unit(d);
  for (std::size_t j = 0; j < d; ++j) {
    const double share = static_cast<double>(j) / static_cast<double>(d - 1);
    unit[j] = std::pow(10.0, decades * (share - 0.5));
  }
  AlignedArray information(set.candidate_count() * p);
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    for (std::size_t a = 0; a < d; ++a) {
      for (std::size_t b = 0; b <= a; ++b) {
        const std::size_t k = packed_index(a, b);
        information[i * p + k] = unit[a] * unit[b] * set.information(i)[k];
      }
    }
  }
  return InformationSet(d, std::move(information));
}

std::string outcome(const InformationSet& set, NormalizedSetOptions coordinates) {
  const Solution solution =
      solve_dual(set, {.duality_gap = 1e-8}, nullptr, coordinates, make_dense_range_system);
  const double gap = certify(set, solution.design).duality_gap;
  return fmt::format("{}{}, {:.1e}", solution.status == SolveStatus::kSolved ? "" : "**fails** ",
                     solution.counters.iterations, gap);
}

}  // namespace

int main() {
  fmt::print("| set | units apart (decades) | as written | rows scaled | whitened | both |\n");
  fmt::print("|---|---|---|---|---|---|\n");
  for (const std::string family : {"rob", "robot"}) {
    for (const std::size_t count : {200UL, 7920UL}) {
      const InformationSet set = bench::make_study_set(family, count);
      for (const double decades : {0.0, 4.0, 8.0, 10.0, 12.0}) {
        const InformationSet scaled = in_units(set, decades);
        fmt::print("| {} {} | {} | {} | {} | {} | {} |\n", family, count, decades,
                   outcome(scaled, {.whiten = false, .scale_rows = false}),
                   outcome(scaled, {.whiten = false, .scale_rows = true}),
                   outcome(scaled, {.whiten = true, .scale_rows = false}), outcome(scaled, {}));
      }
    }
  }
}
