// Column generation over the processes of an MPI communicator, for sets that one machine's memory
// can't hold or one machine's memory bus reads too slowly. Each process owns a contiguous slice of
// the candidates and prices it; the first process keeps the working set (working_set.hpp), solves
// it, and broadcasts the p numbers of M^-1. Per pass each process reads its slice once and sends
// 2 d candidates; nothing else crosses the network. Slices in factor form (information_set.hpp) are
// priced by their factors with X, M^-1 = X^T X: no matrices are made but of the candidates sent.
//
//   MPI_Init(&argc, &argv);
//   const auto slice = ...;                          // this process's candidates
//   const graybox::DistributedDesign design =
//       graybox::solve_distributed(MPI_COMM_WORLD, slice, first_index, {.duality_gap = 1e-9});
//   if (graybox::judge(design.status, 1e-9, design.certificate) == graybox::ReportStatus::kSolved)
//
// The stop test is the gap of a pass over all candidates of all slices. What it is worth is decided
// by the checker (distributed_certificate.hpp), which ends every run. Where the checker finds less
// than was asked for, the slices are whitened by the mean of all candidates in extended precision.
// The run is repeated there; that costs a second copy of each slice. The answer depends on the
// number of processes only through the path taken, and not on the number of threads.
#pragma once

#include <mpi.h>

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/core/solver.hpp"
#include "solvers/distributed/distributed_certificate.hpp"

namespace graybox {

struct DistributedDesign {
  std::vector<std::pair<std::size_t, double>> support;  // (global index, weight), ascending
  SolveStatus status = SolveStatus::kNumericalFailure;  // what the method says
  Certificate certificate;                              // what the checker says
  std::string message;
  SolveCounters counters;         // passes over the whole set, samples and lists included
  std::vector<TracePoint> trace;  // on the first process
};

// Collective. `first_index` is the global index of the slice's first candidate. All fields of the
// result but the counters and the trace are the same on every process; the first process's clock
// counts, and its observer. Throws InputError for options out of range.
[[nodiscard]] DistributedDesign solve_distributed(MPI_Comm communicator,
                                                  const InformationSet& slice,
                                                  std::size_t first_index,
                                                  const SolveOptions& options,
                                                  SolveObserver* observer = nullptr);

}  // namespace graybox
