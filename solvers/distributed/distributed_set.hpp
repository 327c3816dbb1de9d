// An information set whose candidates are shared out among the processes of a communicator, in
// contiguous slices of nearly equal length.
//
//   const DistributedSet set = read_distributed_set(MPI_COMM_WORLD, "set.h5");
//   set.slice.candidate_count() of set.total candidates, from set.first on
//
// HDF5 is read slice by slice, packed matrices or factors: no process holds the whole set. Of other
// formats the first process reads the whole and sends the others their slices. A set in factor form
// stays in it (information_set.hpp). Every matrix is checked and, within
// the tolerance, made positive semidefinite as project_semidefinite() does it. The sum of all must
// be regular. A hash that the file states must be that of the numbers: the first process forms it
// of all slices, which stream through it once.
#pragma once

#include <mpi.h>

#include <cstddef>
#include <string>

#include "problems/formats/information_set_file.hpp"
#include "problems/information/information_set.hpp"
#include "problems/information/semidefinite_projection.hpp"

namespace graybox {

struct DistributedSet {
  InformationSet slice;
  std::size_t first = 0;      // global index of the slice's first candidate
  std::size_t total = 0;      // Q
  std::string content_hash;   // of the whole set
  std::size_t projected = 0;  // matrices that were made positive semidefinite, in all slices
};

// Collective. Throws the same InputError on every process.
[[nodiscard]] DistributedSet read_distributed_set(
    MPI_Comm communicator, const std::string& path, const ReadOptions& options = {},
    double psd_tolerance = kDefaultSemidefiniteTolerance);

}  // namespace graybox
