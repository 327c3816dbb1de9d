// Run under mpirun with any number of processes: the distributed solver must agree with the one
// that holds the whole set, and its claim must stand before the checker. Exit code 1 names what
// failed.
#include <mpi.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <utility>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/distributed/distributed_column_generation.hpp"
#include "solvers/report/solve_report.hpp"
#include "tests/hostile_sets/hostile_sets.hpp"

namespace {

using namespace graybox;

constexpr double kGap = 1e-9;

InformationSet wishart_set(std::size_t d, std::size_t count, std::size_t rank, std::uint64_t seed) {
  Random random(seed);
  AlignedArray information(count * packed_size(d));
  std::vector<double> g(d * rank);
  for (std::size_t i = 0; i < count; ++i) {
    for (double& x : g) x = random.normal();
    for (std::size_t r = 0, k = 0; r < d; ++r) {
      for (std::size_t c = 0; c <= r; ++c, ++k) {
        information[i * packed_size(d) + k] =
            std::inner_product(g.begin() + static_cast<std::ptrdiff_t>(r * rank),
                               g.begin() + static_cast<std::ptrdiff_t>((r + 1) * rank),
                               g.begin() + static_cast<std::ptrdiff_t>(c * rank), 0.0);
      }
    }
  }
  return InformationSet(d, std::move(information));
}

// Each candidate informs about one parameter; only the very last one about the last.
InformationSet needle_set(std::size_t d, std::size_t count) {
  AlignedArray information(count * packed_size(d), 0.0);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t j = i + 1 == count ? d - 1 : i % (d - 1);
    information[i * packed_size(d) + packed_index(j, j)] = 1.0;
  }
  return InformationSet(d, std::move(information));
}

// Vectors or thicker factors; the same problem as packed matrices.
InformationSet factor_set(std::size_t d, std::size_t count, std::size_t rank, std::uint64_t seed) {
  Random random(seed);
  AlignedArray factors(count * rank * d);
  for (double& x : factors.span()) x = random.normal();
  return InformationSet::of_factors(d, rank, std::move(factors));
}

// f(t) = (1, t, ..., t^(d-1)) on a grid that holds the optimum for d = 4: t = -1, -1/sqrt 5 ...
// with weights 1/4 (Fedorov 1972). The monomials of degree 15 need other coordinates.
InformationSet monomials(std::size_t d, std::size_t count) {
  AlignedArray factors(count * d);
  for (std::size_t i = 0; i < count; ++i) {
    double t = -1.0 + 2.0 * static_cast<double>(i) / static_cast<double>(count - 1);
    if (i == 7 || i + 8 == count) t = std::copysign(1.0 / std::sqrt(5.0), t);
    double power = 1.0;
    for (std::size_t j = 0; j < d; ++j, power *= t) factors[i * d + j] = power;
  }
  return InformationSet::of_factors(d, 1, std::move(factors));
}

// Of the set's slices, one for each process.
DistributedDesign solve_slices(const InformationSet& whole) {
  int rank = 0, processes = 1;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  MPI_Comm_size(MPI_COMM_WORLD, &processes);
  const std::size_t from = whole.candidate_count() * static_cast<std::size_t>(rank) /
                           static_cast<std::size_t>(processes);
  const std::size_t to = whole.candidate_count() * static_cast<std::size_t>(rank + 1) /
                         static_cast<std::size_t>(processes);
  std::vector<std::size_t> mine(to - from);
  std::iota(mine.begin(), mine.end(), from);
  const InformationSet slice = whole.subset(mine);
  DistributedDesign design = solve_distributed(MPI_COMM_WORLD, slice, from, {.duality_gap = kGap});
  if (slice.has_factors() && slice.has_matrices()) {
    std::printf("matrices were made of all factors\n");
    design.status = SolveStatus::kNumericalFailure;
  }
  return design;
}

bool agrees(const InformationSet& whole, const char* what) {
  const DistributedDesign answer = solve_slices(whole);
  Design design{std::vector<double>(whole.candidate_count(), 0.0)};
  for (const auto& [index, weight] : answer.support) design.weights[index] = weight;
  const Certificate proof = certify(whole, design);
  const Certificate local =
      certify(whole, ColumnGeneration().solve(whole, {.duality_gap = kGap}).design);
  const bool good =
      answer.status == SolveStatus::kSolved && proof.duality_gap <= kGap + 1e-12 &&
      std::abs(proof.log_det - local.log_det) <= proof.log_det_gap + local.log_det_gap + 1e-10 &&
      std::abs(answer.certificate.log_det - proof.log_det) < 1e-8 &&
      std::abs(answer.certificate.duality_gap - proof.duality_gap) <=
          answer.certificate.rounding_bound + proof.rounding_bound;
  if (!good) {
    std::printf("%s: status %d, gap %.3e, log det %.12g against %.12g\n", what,
                static_cast<int>(answer.status), proof.duality_gap, proof.log_det, local.log_det);
  }
  return good;
}

// Closed form: four points, a quarter of the weight each.
bool finds_the_four_points() {
  const InformationSet set = monomials(4, 2001);
  const DistributedDesign answer = solve_slices(set);
  bool good = answer.status == SolveStatus::kSolved && answer.support.size() == 4;
  for (const auto& [index, weight] : answer.support) {
    const double t = std::abs(set.factor(index)[1]);
    good &= std::abs(weight - 0.25) < 1e-9 && (t == 1.0 || t == 1.0 / std::sqrt(5.0));
  }
  if (!good) std::printf("not the four points, but %zu\n", answer.support.size());
  return good;
}

bool is_sound(const InformationSet& set) {
  try {
    set.validate();
    return true;
  } catch (const InputError&) {
    return false;
  }
}

// What is claimed of sets made to be hard is true, and few are left that one process solves.
bool claims_only_what_is_so() {
  constexpr std::size_t kFewest = 8;  // candidates, for three processes
  Random random(29);
  std::size_t solvable = 0, solved = 0;
  bool good = true;
  for (std::size_t n = 0; n < 8 * testing_sets::hostile_kinds().size(); ++n) {
    const InformationSet set =
        testing_sets::hostile_set(n % testing_sets::hostile_kinds().size(), random);
    if (set.candidate_count() < kFewest || !is_sound(set)) continue;
    const Solution local = ColumnGeneration().solve(set, {.duality_gap = kGap});
    const DistributedDesign answer = solve_slices(set);
    const bool is_solved = judge(answer.status, kGap, answer.certificate) == ReportStatus::kSolved;
    if (answer.status == SolveStatus::kSolved && !is_solved) {
      std::printf("%s: claims to be solved, gap %.3e\n", set.name().c_str(),
                  answer.certificate.duality_gap);
      good = false;
    }
    if (local.status != SolveStatus::kSolved) continue;
    ++solvable;
    solved += is_solved ? 1U : 0U;
  }
  std::printf("%zu of %zu hostile sets solved\n", solved, solvable);
  return good && solvable > 50 &&
         static_cast<double>(solved) >= 0.97 * static_cast<double>(solvable);
}

}  // namespace

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  bool good = agrees(wishart_set(6, 5000, 6, 1), "full rank");
  good &= agrees(wishart_set(8, 3000, 1, 2), "rank one");
  good &= agrees(wishart_set(1, 7, 1, 3), "one parameter");
  good &= agrees(needle_set(4, 20000), "a needle");
  good &= agrees(factor_set(8, 3000, 1, 5), "vectors");
  good &= agrees(factor_set(5, 4000, 3, 6), "factors of rank three");
  good &= agrees(monomials(16, 4000), "monomials, which are whitened");
  good &= finds_the_four_points();
  good &= claims_only_what_is_so();
  MPI_Finalize();
  return good ? 0 : 1;
}
