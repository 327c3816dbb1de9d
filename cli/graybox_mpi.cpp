// graybox_mpi: column generation over MPI for sets larger than one machine's memory.
//   mpirun -n 4 graybox_mpi set.h5 --gap 1e-9 -o design.json
#include <fmt/format.h>
#include <mpi.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <memory>
#include <new>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "cli/arguments/set_arguments.hpp"
#include "cli/commands/commands.hpp"
#include "cli/front/help_formatter.hpp"
#include "cli/front/help_text.hpp"
#include "cli/output/trace_file.hpp"
#include "cli/process/interrupt.hpp"
#include "cli/process/start_up.hpp"
#include "problems/base/available_memory.hpp"
#include "problems/base/error.hpp"
#include "problems/base/program_version.hpp"
#include "problems/files/atomic_file.hpp"
#include "solvers/distributed/distributed_column_generation.hpp"
#include "solvers/distributed/distributed_set.hpp"
#include "solvers/distributed/mpi_transfer.hpp"
#include "solvers/report/design_file.hpp"
#include "solvers/report/solve_report.hpp"

namespace graybox::cli {
namespace {

constexpr const char* kSolver = "distributed_column_generation";

struct MpiArguments {
  SetArguments set;
  std::string output;
  std::string trace;
  SolveOptions options;
  bool json = false;
};

// Ctrl-C stops the first process's clock, and with it all.
class StopObserver : public SolveObserver {
 public:
  bool on_progress(const TracePoint& /*point*/) override { return !interrupted(); }
};

// As judge() of one process's run, from the certificate of all slices.
SolveReport report_of(const MpiArguments& arguments, const DistributedSet& set,
                      const DistributedDesign& design) {
  SolveReport report;
  report.solver = kSolver;
  report.problem = set.slice.name();
  report.problem_hash = set.content_hash;
  report.candidates = set.total;
  report.dimension = set.slice.dimension();
  report.options = arguments.options;
  report.certificate = design.certificate;
  report.status = judge(design.status, arguments.options.duality_gap, design.certificate);
  report.message = report.status == ReportStatus::kSolved ? std::string() : design.message;
  if (report.message.empty()) report.message = design.certificate.message;
  if (interrupted()) report.message = "interrupted; this is the best design so far";
  report.counters = design.counters;
  report.peak_memory_bytes = peak_memory_bytes();
  return report;
}

// The design in graybox-design/1: as of a set that holds the support alone, with the indices that
// its candidates have in the whole set.
void write_design(const std::string& path, const InformationSet& members,
                  const DistributedDesign& design, const SolveReport& report) {
  Design weights;
  for (const auto& [index, weight] : design.support) weights.weights.push_back(weight);
  nlohmann::ordered_json json = design_json(members, weights, report);
  json["candidates"] = report.candidates;
  std::size_t listed = 0;
  for (const auto& [index, weight] : design.support) {
    if (weight != 0.0) json["support"][listed++]["index"] = index;
  }
  write_text_file(path, json.dump(1) + "\n");
}

std::string text_of(const SolveReport& report, std::size_t processes) {
  const Certificate& certificate = report.certificate;
  std::string text = fmt::format("{}: {}", kSolver, to_string(report.status));
  if (!report.message.empty()) text += fmt::format(" ({})", report.message);
  return text + fmt::format(
                    "\n  duality gap   {:.3e}  (asked {:.3g}; rounding at most {:.1e})\n"
                    "  log det M     {:.12g}, support {}\n"
                    "  work          {} iterations, {:.2f} passes, {:.3g} s, {} processes\n",
                    certificate.duality_gap, report.options.duality_gap, certificate.rounding_bound,
                    certificate.log_det, certificate.support_size, report.counters.iterations,
                    report.counters.passes, report.counters.seconds, processes);
}

// The first process alone.
void hand_over(const MpiArguments& arguments, const InformationSet& members,
               const DistributedDesign& design, const SolveReport& report, std::size_t projected) {
  const std::size_t processes = mpi::size_of(MPI_COMM_WORLD);
  if (!arguments.trace.empty()) write_trace(arguments.trace, design.trace);
  if (!arguments.output.empty()) write_design(arguments.output, members, design, report);
  if (arguments.json) {
    nlohmann::ordered_json line = to_json(report);
    line["processes"] = processes;
    if (projected > 0) line["semidefinite_projection"] = {{"candidates", projected}};
    fmt::print("{}\n", line.dump());
  } else {
    fmt::print("{}", text_of(report, processes));
    if (projected > 0) fmt::print("note: {} matrices were made positive semidefinite\n", projected);
    if (!arguments.output.empty()) fmt::print("wrote {}\n", arguments.output);
  }
}

// Answers the error of writing files, or nothing.
std::string try_to_hand_over(const MpiArguments& arguments, const InformationSet& members,
                             const DistributedDesign& design, const SolveReport& report,
                             std::size_t projected) {
  try {
    hand_over(arguments, members, design, report, projected);
  } catch (const std::exception& error) {
    if (!standard_output_failed()) return error.what();
  }
  return {};
}

// Throws on every process alike, unless one has run out of memory.
int solve(const MpiArguments& arguments) {
  const std::size_t rank = mpi::rank_of(MPI_COMM_WORLD), processes = mpi::size_of(MPI_COMM_WORLD);
  const DistributedSet set = [&] {
    const ReadingLimit limit(arguments.options.time_limit, arguments.set.path);
    return read_distributed_set(
        MPI_COMM_WORLD, arguments.set.path,
        {.variable = arguments.set.variable, .factors = arguments.set.factors},
        arguments.set.psd_tolerance);
  }();
  catch_interrupts();
  StopObserver observer;
  const DistributedDesign design =
      solve_distributed(MPI_COMM_WORLD, set.slice, set.first, arguments.options, &observer);
  const SolveReport report = report_of(arguments, set, design);
  std::string error;
  if (!design.support.empty()) {
    const InformationSet members =
        gather_support(MPI_COMM_WORLD, set.slice, set.first, design.support);
    if (rank == 0) error = try_to_hand_over(arguments, members, design, report, set.projected);
  } else if (rank == 0) {
    fmt::print("{}", arguments.json ? to_json(report).dump() + "\n" : text_of(report, processes));
  }
  error = mpi::first_error(MPI_COMM_WORLD, error);
  if (!error.empty()) throw InputError(error);
  return report.status == ReportStatus::kSolved ? kDone : kShort;
}

// One line from one process is enough.
int complain(const std::string& line) {
  if (mpi::rank_of(MPI_COMM_WORLD) == 0) {
    std::fprintf(stderr, "graybox_mpi: %s\n", line.substr(0, line.find('\n')).c_str());
  }
  return kBadInput;
}

void add_options(CLI::App& app, MpiArguments& arguments) {
  SolveOptions& options = arguments.options;
  add_set_options(app, arguments.set);
  add_factors_option(app, arguments.set);
  app.add_option("--gap", options.duality_gap, "duality gap to reach")->capture_default_str();
  app.add_option("--time-limit", options.time_limit, "wall seconds (default: none)");
  app.add_option("--seed", options.seed, "of the samples")->capture_default_str();
  app.add_option("--threads", options.threads, "threads of each process")->capture_default_str();
  app.add_option("--trace", arguments.trace, "write the history of the run as JSON lines");
  app.add_option("-o,--output", arguments.output, "write the design as JSON");
  app.add_flag("--json", arguments.json, "print one machine-readable line");
  app.footer(
      "The checker decides, on all slices: status solved (exit code 0) means what it means for "
      "'graybox solve'. HDF5 is read slice by slice; other formats pass through the first process, "
      "which then needs the memory for the whole.\n"
      "Example:\n  mpirun -n 4 graybox_mpi set.h5 --gap 1e-9 -o design.json");
}

int run(int argc, char** argv) {
  CLI::App app(
      "D-optimal design over MPI: each process holds and prices a slice of the candidates.");
  app.formatter(std::make_shared<HelpFormatter>(terminal_columns()));
  MpiArguments arguments;
  add_options(app, arguments);
  app.set_version_flag("--version", written_by(), "Print version and commit and exit");
  try {
    app.parse(argc, argv);
    return solve(arguments);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() != 0) return complain(error.what());
    if (mpi::rank_of(MPI_COMM_WORLD) == 0) app.exit(error);  // --help, --version
    return kDone;
  } catch (const InputError& error) {
    return complain(error.what());
  }
}

}  // namespace
}  // namespace graybox::cli

int main(int argc, char** argv) {
  graybox::cli::start_up(argv);
  int provided = MPI_THREAD_SINGLE;
  MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &provided);
  int code = graybox::cli::kShort;
  try {
    code = graybox::cli::finish(graybox::cli::run(argc, argv), "graybox_mpi");
  } catch (const std::bad_alloc& error) {  // of this process alone: the others wait for it
    std::fprintf(stderr, "graybox_mpi: %s\n", graybox::describe_shortage(error).c_str());
    MPI_Abort(MPI_COMM_WORLD, graybox::cli::kShort);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "graybox_mpi: %s\n", error.what());
    MPI_Abort(MPI_COMM_WORLD, graybox::cli::kShort);
  }
  MPI_Finalize();
  return code;
}
