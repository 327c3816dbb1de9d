// Column generation over the processes of an MPI communicator, for sets that one machine's memory
// can't hold or one machine's memory bus reads too slowly. Each process owns a contiguous slice of
// the candidates and prices it; the first process keeps the working set (working_set.hpp), solves
// it, and broadcasts the p numbers of M^-1. Per pass each process reads its slice once and sends
// 2 d candidates; nothing else crosses the network.
//
//   MPI_Init(&argc, &argv);
//   const auto slice = ...;                          // this process's candidates
//   const graybox::DistributedDesign design =
//       graybox::solve_distributed(MPI_COMM_WORLD, slice, first_index, {.duality_gap = 1e-9});
//   if (design.status == graybox::SolveStatus::kSolved) ...          // the same on every process
//
// The stop test is the gap of a pass over all candidates of all slices, so a claim is a certificate
// up to double rounding. The answer depends on the number of processes only through the path taken.
#pragma once

#include <mpi.h>

#include <cstddef>
#include <utility>
#include <vector>

#include "graybox/problems/information_set.hpp"
#include "graybox/solvers/solver.hpp"

namespace graybox {

struct DistributedDesign {
  std::vector<std::pair<std::size_t, double>> support;  // (global index, weight), ascending
  SolveStatus status = SolveStatus::kNumericalFailure;
  double duality_gap = 0.0;
  double log_det = 0.0;
  SolveCounters counters;  // passes over the whole distributed set
};

// Collective. `first_index` is the global index of the slice's first candidate. All fields of the
// result are the same on every process.
[[nodiscard]] DistributedDesign solve_distributed(MPI_Comm communicator,
                                                  const InformationSet& slice,
                                                  std::size_t first_index,
                                                  const SolveOptions& options);

}  // namespace graybox
