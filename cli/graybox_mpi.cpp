// graybox_mpi: column generation over MPI for sets larger than one machine's memory.
//   mpirun -n 4 graybox_mpi set.h5 --gap 1e-9 -o design.json
#include <fmt/format.h>
#include <mpi.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "graybox/problems/error.hpp"
#include "graybox/problems/formats/atomic_file.hpp"
#include "graybox/problems/formats/hdf5_file.hpp"
#include "graybox/solvers/distributed/distributed_column_generation.hpp"

namespace {

struct Arguments {
  std::string set;
  std::string output;
  double gap = 1e-6;
  double time_limit = std::numeric_limits<double>::infinity();
};

// The design in graybox-design/1, which `graybox check` certifies.
void write_design(const Arguments& arguments, const graybox::InformationSlice& slice,
                  const graybox::DistributedDesign& design) {
  nlohmann::json json = {{"format", "graybox-design/1"},
                         {"problem", arguments.set},
                         {"candidates", slice.total},
                         {"dimension", slice.set.dimension()},
                         {"solver", "distributed_column_generation"},
                         {"status", graybox::to_string(design.status)},
                         {"support", nlohmann::json::array()}};
  if (!slice.problem_hash.empty()) json["problem_hash"] = slice.problem_hash;
  for (const auto& [index, weight] : design.support) {
    json["support"].push_back({{"index", index}, {"weight", weight}});
  }
  graybox::write_text_file(arguments.output, json.dump(2) + "\n");
}

// One process may fail alone (its slice is damaged); the others must hear of it, and one line is
// enough. Returns true if all went well everywhere.
bool all_well(const std::string& error, int rank, int processes) {
  int failed = error.empty() ? processes : rank, first = processes;
  MPI_Allreduce(&failed, &first, 1, MPI_INT, MPI_MIN, MPI_COMM_WORLD);
  if (rank == first) std::fprintf(stderr, "graybox_mpi: %s\n", error.c_str());
  return first == processes;
}

int run(const Arguments& arguments, int rank, int processes) {
  std::optional<graybox::InformationSlice> slice;
  std::string error;
  try {
    if (!(arguments.gap > 0.0)) throw graybox::InputError("--gap must be positive, as in 1e-9");
    if (!(arguments.time_limit > 0.0)) throw graybox::InputError("--time-limit must be positive");
    slice.emplace(graybox::read_hdf5_slice(arguments.set, static_cast<std::size_t>(rank),
                                           static_cast<std::size_t>(processes)));
  } catch (const std::exception& exception) {
    error = exception.what();
  }
  if (!all_well(error, rank, processes)) return 2;
  const graybox::DistributedDesign design = graybox::solve_distributed(
      MPI_COMM_WORLD, slice->set, slice->first,
      {.duality_gap = arguments.gap, .time_limit = arguments.time_limit});
  if (rank == 0) {
    fmt::print(
        "{}: gap {:.2e}, log det {:.12g}, support {}, {:.0f} passes, {:.3f} s, {} "
        "processes\n",
        graybox::to_string(design.status), design.duality_gap, design.log_det,
        design.support.size(), design.counters.passes, design.counters.seconds, processes);
    try {
      if (!arguments.output.empty()) write_design(arguments, *slice, design);
    } catch (const std::exception& exception) {
      error = exception.what();
    }
  }
  if (!all_well(error, rank, processes)) return 2;
  return design.status == graybox::SolveStatus::kSolved ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  int rank = 0, processes = 1;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  MPI_Comm_size(MPI_COMM_WORLD, &processes);
  CLI::App app(
      "D-optimal design over MPI: each process holds and prices a slice of the candidates.");
  Arguments arguments;
  app.add_option("set", arguments.set, "information set, HDF5")->required();
  app.add_option("--gap", arguments.gap, "duality gap to reach")->capture_default_str();
  app.add_option("--time-limit", arguments.time_limit, "seconds");
  app.add_option("-o,--output", arguments.output, "design file to write");
  app.footer("Example:\n  mpirun -n 4 graybox_mpi set.h5 --gap 1e-9 -o design.json");
  int code = 0;
  try {
    app.parse(argc, argv);
    code = run(arguments, rank, processes);
  } catch (const CLI::ParseError& error) {
    if (rank == 0) app.exit(error);
    code = error.get_exit_code() == 0 ? 0 : 2;
  }
  MPI_Finalize();
  return code;
}
