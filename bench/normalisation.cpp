// Prints the table of docs/explanation/normalisation.md: the dual interior-point method on the
// paper's dual (10) as written, with its rows scaled, whitened, and both, on sets whose parameters
// are measured in units further and further apart. Run as: normalisation > table.md
#include <fmt/format.h>

#include <string>

#include "bench/study/study_sets.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/interior_point/dual_newton.hpp"

namespace {

using namespace graybox;

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
        const InformationSet scaled = bench::in_units(set, decades);
        fmt::print("| {} {} | {} | {} | {} | {} | {} |\n", family, count, decades,
                   outcome(scaled, {.whiten = false, .scale_rows = false}),
                   outcome(scaled, {.whiten = false, .scale_rows = true}),
                   outcome(scaled, {.whiten = true, .scale_rows = false}), outcome(scaled, {}));
      }
    }
  }
}
