// The worker: one run of one solver on one set in a process of its own. It writes to standard
// output, a JSON object a line, a trace point as soon as it is there (so that a killed run leaves
// its trace) and at the end the answer:
//
//   {"trace":[seconds, passes, gap, iteration]}
//   {"answer":{"status":"solved","seconds":...,"passes":...,"support":[[index, weight], ...], ...}}
//
// The answer of an external program may add "stated_seconds", "stated_trace": [[seconds, gap], ...]
// and "repair": [clipped, rescaled].
//
// The gap in a trace is the solver's; infinity is null. The design is certified by the reader, in
// another process. Solvers that print do so on standard error.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "solvers/registry.hpp"

namespace graybox::bench {

struct WorkerRequest {
  std::string set_file;
  std::string solver;
  double duality_gap = 1e-6;
  double time_limit = 0.0;
  std::uint64_t seed = 1;
  int threads = 1;
};

// As arguments of the worker's command line, and back. parse_worker_arguments throws InputError.
[[nodiscard]] std::vector<std::string> worker_arguments(const WorkerRequest& request);
[[nodiscard]] WorkerRequest parse_worker_arguments(const std::vector<std::string>& arguments);

// Returns the exit code: 0 if an answer was written, whatever it is; 2 for bad input, with one line
// on standard error.
int run_worker(const WorkerRequest& request, const SolverRegistry& registry);

}  // namespace graybox::bench
