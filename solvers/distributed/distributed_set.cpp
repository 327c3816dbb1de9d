#include "solvers/distributed/distributed_set.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <new>
#include <optional>
#include <utility>
#include <vector>

#include "problems/base/available_memory.hpp"
#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/sha256.hpp"
#include "problems/formats/hdf5_file.hpp"
#include "problems/information/factor_form.hpp"
#include "problems/information/held_numbers.hpp"
#include "problems/information/set_validation.hpp"
#include "solvers/distributed/mpi_transfer.hpp"

namespace graybox {
namespace {

constexpr std::size_t kChunkNumbers = std::size_t{1} << 22;  // that are sent together

// Candidates of so many numbers each that are sent together.
std::size_t chunk_of(std::size_t each) { return std::max(kChunkNumbers / each, std::size_t{1}); }

// Throws what any process has caught on all of them.
void agree(MPI_Comm communicator, const std::string& error) {
  const std::string first = mpi::first_error(communicator, error);
  if (!first.empty()) throw InputError(first);
}

template <class Work>
std::string error_of(const Work& work) {
  try {
    work();
    return {};
  } catch (const std::bad_alloc& error) {
    return describe_shortage(error);
  } catch (const std::exception& error) {
    return error.what();
  }
}

bool is_hdf5(const std::string& path) { return path.ends_with(".h5") || path.ends_with(".hdf5"); }

// Matrices that are semidefinite only to the tolerance are made so (semidefinite_projection.hpp).
// Returns how many.
std::size_t project_slice(DistributedSet& set, double tolerance) {
  const std::vector<std::size_t> indefinite = indefinite_candidates(set.slice);
  if (indefinite.empty()) return 0;
  const std::size_t d = set.slice.dimension(), p = set.slice.packed_size();
  AlignedArray rows(set.slice.candidate_count() * p);
  std::copy_n(set.slice.data(), rows.size(), rows.begin());
  for (const std::size_t i : indefinite) {
    AlignedArray pair(2 * p, 0.0);  // with a regular matrix besides: a set needs one
    std::copy_n(set.slice.information(i).data(), p, pair.begin());
    for (std::size_t j = 0; j < d; ++j) pair[p + packed_index(j, j)] = 1.0;
    try {
      const ProjectedSet one = project_semidefinite(
          InformationSet(d, std::move(pair), {}, {}, set.slice.name()), tolerance);
      std::ranges::copy(one.set.information(0), rows.begin() + i * p);
    } catch (const InputError&) {
      throw InputError(fmt::format(
          "{}: candidate {}: the information matrix is not positive semidefinite; check how it was "
          "formed",
          set.slice.name(), set.first + i));
    }
  }
  set.slice = InformationSet(d, std::move(rows), {}, set.slice.parameters(), set.slice.name());
  return indefinite.size();
}

// The sum of all matrices, each over its own size, must be regular.
void check_sum(MPI_Comm communicator, const DistributedSet& set) {
  const std::size_t d = set.slice.dimension(), p = set.slice.packed_size();
  std::vector<long double> sum(p, 0.0L);
  std::vector<double> buffer(p);
  for (std::size_t i = 0; i < set.slice.candidate_count(); ++i) {
    const auto row = set.slice.packed(i, buffer);
    double size = 0.0;
    for (std::size_t j = 0; j < d; ++j) size = std::max(size, row[packed_index(j, j)]);
    if (!(size > 0.0)) continue;
    for (std::size_t k = 0; k < p; ++k) sum[k] += static_cast<long double>(row[k]) / size;
  }
  mpi::sum(communicator, std::span<long double>(sum));
  AlignedArray mean(p);
  for (std::size_t k = 0; k < p; ++k) {
    mean[k] = static_cast<double>(sum[k] / static_cast<long double>(set.total));
  }
  require_regular_sum(
      InformationSet(d, std::move(mean), {}, set.slice.parameters(), set.slice.name()));
}

// Candidates as the slice holds them are hashed as packed matrices, a few at a time.
void hash_candidates(const InformationSet& slice, std::span<const double> numbers, Sha256& hash) {
  if (!slice.has_factors()) return hash.update(numbers.data(), numbers.size_bytes());
  constexpr std::size_t kAtOnce = 256;
  const std::size_t each = numbers_each(slice), p = slice.packed_size();
  std::vector<double> packed(kAtOnce * p);
  while (!numbers.empty()) {
    const std::size_t count = std::min(kAtOnce, numbers.size() / each);
    for (std::size_t k = 0; k < count; ++k) {
      pack_factor(numbers.data() + k * each, slice.rank(), slice.dimension(),
                  packed.data() + k * p);
    }
    hash.update(packed.data(), count * p * sizeof(double));
    numbers = numbers.subspan(count * each);
  }
}

// On the first process; empty on the others.
std::string hash_of_all(MPI_Comm communicator, const DistributedSet& set) {
  const std::size_t each = numbers_each(set.slice);
  const std::size_t processes = mpi::size_of(communicator), rank = mpi::rank_of(communicator);
  const std::size_t chunk = chunk_of(each);
  const std::span<const double> mine = held_numbers(set.slice);
  if (rank != 0) {
    for (std::size_t from = 0; from < mine.size(); from += chunk * each) {
      mpi::send(communicator, mine.subspan(from, std::min(chunk * each, mine.size() - from)), 0);
    }
    return {};
  }
  Sha256 hash;
  const std::uint64_t shape[2] = {set.total, set.slice.dimension()};
  hash.update(shape, sizeof shape);
  hash_candidates(set.slice, mine, hash);
  std::vector<double> received(processes > 1 ? chunk * each : 0);
  for (std::size_t other = 1; other < processes; ++other) {
    const std::size_t begin = set.total * other / processes;
    const std::size_t end = set.total * (other + 1) / processes;
    for (std::size_t from = begin; from < end; from += chunk) {
      const auto part = std::span(received).first(std::min(chunk, end - from) * each);
      mpi::receive(communicator, part, other);
      hash_candidates(set.slice, part, hash);
    }
  }
  return hash.hexadecimal();
}

// The first process's whole set, shared out.
InformationSet share_out(MPI_Comm communicator, const std::optional<InformationSet>& whole,
                         const std::string& name) {
  const std::size_t processes = mpi::size_of(communicator), rank = mpi::rank_of(communicator);
  std::uint64_t total = whole ? whole->candidate_count() : 0;
  std::uint64_t dimension = whole ? whole->dimension() : 0;
  std::uint64_t factor_rows = whole ? whole->rank() : 0;  // none: matrices
  for (std::uint64_t* number : {&total, &dimension, &factor_rows}) {
    mpi::broadcast(communicator, *number);
  }
  if (total < processes) {
    throw InputError(
        fmt::format("{}: {} processes are too many for {} candidates", name, processes, total));
  }
  const std::size_t each = factor_rows == 0 ? packed_size(dimension) : factor_rows * dimension;
  const auto begin_of = [&](std::size_t process) { return total * process / processes; };
  AlignedArray mine((begin_of(rank + 1) - begin_of(rank)) * each);
  if (rank != 0) {
    mpi::receive(communicator, mine.span(), 0);
  } else {
    const std::span<const double> all = held_numbers(*whole);
    std::copy_n(all.begin(), mine.size(), mine.begin());
    for (std::size_t other = 1; other < processes; ++other) {
      const std::size_t from = begin_of(other), to = begin_of(other + 1);
      mpi::send(communicator, all.subspan(from * each, (to - from) * each), other);
    }
  }
  if (factor_rows == 0) return InformationSet(dimension, std::move(mine), {}, {}, name);
  return InformationSet::of_factors(dimension, factor_rows, std::move(mine), {}, {}, name);
}

DistributedSet read_slices(MPI_Comm communicator, const std::string& path, std::string& stated) {
  std::optional<InformationSlice> slice;
  agree(communicator, error_of([&] {
          slice.emplace(
              read_hdf5_slice(path, mpi::rank_of(communicator), mpi::size_of(communicator)));
        }));
  stated = slice->problem_hash;
  return {std::move(slice->set), slice->first, slice->total, {}, 0};
}

DistributedSet read_whole(MPI_Comm communicator, const std::string& path,
                          const ReadOptions& options) {
  std::optional<InformationSet> whole;
  const std::size_t rank = mpi::rank_of(communicator), processes = mpi::size_of(communicator);
  agree(communicator, error_of([&] {
          if (rank == 0) whole.emplace(read_information_set(path, options));
        }));
  std::string name = whole ? whole->name() : std::string();
  mpi::broadcast(communicator, name);
  InformationSet slice = share_out(communicator, whole, name);
  const std::size_t total = mpi::sum(communicator, slice.candidate_count());
  return {std::move(slice), total * rank / processes, total, {}, 0};
}

}  // namespace

DistributedSet read_distributed_set(MPI_Comm communicator, const std::string& path,
                                    const ReadOptions& options, double psd_tolerance) {
  std::string stated;
  // Options that are not for HDF5 are refused where all other formats are read.
  const bool in_slices = is_hdf5(path) && !options.factors && options.variable.empty();
  DistributedSet set =
      in_slices ? read_slices(communicator, path, stated) : read_whole(communicator, path, options);
  set.content_hash = hash_of_all(communicator, set);
  mpi::broadcast(communicator, set.content_hash);
  if (!stated.empty() && stated != set.content_hash) {
    throw InputError(
        fmt::format("{}: sha256: the numbers are not those that the file was written with; it is "
                    "damaged: copy it again",
                    path));
  }
  std::size_t mine = 0;
  agree(communicator, error_of([&] { mine = project_slice(set, psd_tolerance); }));
  set.projected = mpi::sum(communicator, mine);
  if (set.projected > 0) {  // the problem that is solved is another one
    set.content_hash = hash_of_all(communicator, set);
    mpi::broadcast(communicator, set.content_hash);
  }
  check_sum(communicator, set);  // throws on all alike
  return set;
}

}  // namespace graybox
