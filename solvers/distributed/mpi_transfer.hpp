// Arrays of any length over MPI, whose counts are int: sent in chunks. All are collective.
#pragma once

#include <mpi.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace graybox::mpi {

[[nodiscard]] std::size_t rank_of(MPI_Comm communicator);
[[nodiscard]] std::size_t size_of(MPI_Comm communicator);

// From the first process to all; the length must be the same everywhere.
void broadcast(MPI_Comm communicator, std::span<double> values);
void broadcast(MPI_Comm communicator, std::string& text);  // of any length
void broadcast(MPI_Comm communicator, std::uint64_t& value);

// values of all processes, one after the other, on the first; empty on the others.
[[nodiscard]] std::vector<double> gather(MPI_Comm communicator, std::span<const double> values);

// Sums over all processes, on all.
void sum(MPI_Comm communicator, std::span<double> values);
void sum(MPI_Comm communicator, std::span<long double> values);
[[nodiscard]] std::uint64_t sum(MPI_Comm communicator, std::uint64_t value);

// One process to another, in pieces.
void send(MPI_Comm communicator, std::span<const double> values, std::size_t to);
void receive(MPI_Comm communicator, std::span<double> values, std::size_t from);

// The error of the first process that has one, on all; empty if none has. Throws nothing.
[[nodiscard]] std::string first_error(MPI_Comm communicator, const std::string& error);

}  // namespace graybox::mpi
