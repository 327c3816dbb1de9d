#include "solvers/distributed/mpi_transfer.hpp"

#include <algorithm>

namespace graybox::mpi {
namespace {

constexpr std::size_t kChunk = std::size_t{1} << 24;  // numbers in one message: 128 MB
constexpr int kTag = 1;

// Calls work(begin, count) for one chunk after the other.
template <class Work>
void in_chunks(std::size_t size, const Work& work) {
  for (std::size_t begin = 0; begin < size; begin += kChunk) {
    work(begin, static_cast<int>(std::min(kChunk, size - begin)));
  }
}

}  // namespace

std::size_t rank_of(MPI_Comm communicator) {
  int rank = 0;
  MPI_Comm_rank(communicator, &rank);
  return static_cast<std::size_t>(rank);
}

std::size_t size_of(MPI_Comm communicator) {
  int size = 1;
  MPI_Comm_size(communicator, &size);
  return static_cast<std::size_t>(size);
}

void broadcast(MPI_Comm communicator, std::span<double> values) {
  in_chunks(values.size(), [&](std::size_t begin, int count) {
    MPI_Bcast(values.data() + begin, count, MPI_DOUBLE, 0, communicator);
  });
}

void broadcast(MPI_Comm communicator, std::uint64_t& value) {
  MPI_Bcast(&value, 1, MPI_UINT64_T, 0, communicator);
}

void broadcast(MPI_Comm communicator, std::string& text) {
  std::uint64_t size = text.size();
  broadcast(communicator, size);
  text.resize(size);
  in_chunks(size, [&](std::size_t begin, int count) {
    MPI_Bcast(text.data() + begin, count, MPI_CHAR, 0, communicator);
  });
}

std::vector<double> gather(MPI_Comm communicator, std::span<const double> values) {
  const std::size_t rank = rank_of(communicator), processes = size_of(communicator);
  const std::uint64_t size = values.size();
  std::vector<std::uint64_t> sizes(processes);
  MPI_Gather(&size, 1, MPI_UINT64_T, sizes.data(), 1, MPI_UINT64_T, 0, communicator);
  if (rank != 0) {
    send(communicator, values, 0);
    return {};
  }
  std::vector<double> all(values.begin(), values.end());
  for (std::size_t other = 1; other < processes; ++other) {
    const std::size_t before = all.size();
    all.resize(before + sizes[other]);
    receive(communicator, std::span(all).subspan(before), other);
  }
  return all;
}

void sum(MPI_Comm communicator, std::span<double> values) {
  in_chunks(values.size(), [&](std::size_t begin, int count) {
    MPI_Allreduce(MPI_IN_PLACE, values.data() + begin, count, MPI_DOUBLE, MPI_SUM, communicator);
  });
}

void sum(MPI_Comm communicator, std::span<long double> values) {
  in_chunks(values.size(), [&](std::size_t begin, int count) {
    MPI_Allreduce(MPI_IN_PLACE, values.data() + begin, count, MPI_LONG_DOUBLE, MPI_SUM,
                  communicator);
  });
}

std::uint64_t sum(MPI_Comm communicator, std::uint64_t value) {
  MPI_Allreduce(MPI_IN_PLACE, &value, 1, MPI_UINT64_T, MPI_SUM, communicator);
  return value;
}

void send(MPI_Comm communicator, std::span<const double> values, std::size_t to) {
  in_chunks(values.size(), [&](std::size_t begin, int count) {
    MPI_Send(values.data() + begin, count, MPI_DOUBLE, static_cast<int>(to), kTag, communicator);
  });
}

void receive(MPI_Comm communicator, std::span<double> values, std::size_t from) {
  in_chunks(values.size(), [&](std::size_t begin, int count) {
    MPI_Recv(values.data() + begin, count, MPI_DOUBLE, static_cast<int>(from), kTag, communicator,
             MPI_STATUS_IGNORE);
  });
}

std::string first_error(MPI_Comm communicator, const std::string& error) {
  const int processes = static_cast<int>(size_of(communicator));
  const int rank = static_cast<int>(rank_of(communicator));
  int failed = error.empty() ? processes : rank, first = processes;
  MPI_Allreduce(&failed, &first, 1, MPI_INT, MPI_MIN, communicator);
  if (first == processes) return {};
  std::string text = error;
  std::uint64_t size = text.size();
  MPI_Bcast(&size, 1, MPI_UINT64_T, first, communicator);
  text.resize(size);
  MPI_Bcast(text.data(), static_cast<int>(size), MPI_CHAR, first, communicator);
  return text;
}

}  // namespace graybox::mpi
