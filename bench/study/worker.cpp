#include "bench/study/worker.hpp"

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <new>
#include <nlohmann/json.hpp>

#include "bench/study/process.hpp"
#include "problems/base/error.hpp"
#include "problems/formats/information_set_file.hpp"

namespace graybox::bench {
namespace {

using nlohmann::json;
using Clock = std::chrono::steady_clock;

json finite_or_null(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }

// Standard output as it was at the start; whatever solvers print goes to standard error.
class AnswerStream {
 public:
  AnswerStream() : descriptor_(dup(STDOUT_FILENO)) { dup2(STDERR_FILENO, STDOUT_FILENO); }
  AnswerStream(const AnswerStream&) = delete;
  AnswerStream& operator=(const AnswerStream&) = delete;
  ~AnswerStream() {
    std::fflush(stdout);
    dup2(descriptor_, STDOUT_FILENO);
    close(descriptor_);
  }

  void write_line(const json& object) const {
    const std::string line = object.dump(-1, ' ', false, json::error_handler_t::replace) + "\n";
    for (std::size_t done = 0; done < line.size();) {
      const ssize_t count = write(descriptor_, line.data() + done, line.size() - done);
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) return;  // nobody reads any more: the run is of no use
      done += static_cast<std::size_t>(count);
    }
  }

 private:
  int descriptor_;
};

// Passes on points at which the gap has fallen by 2 % or the time has grown by 5 %.
class TraceWriter : public SolveObserver {
 public:
  explicit TraceWriter(const AnswerStream& stream) : stream_(stream) {}
  bool on_progress(const TracePoint& point) override {
    const bool worth_it = first_ || point.duality_gap <= 0.98 * last_.duality_gap ||
                          point.seconds >= 1.05 * last_.seconds;
    if (worth_it) write(point);
    return true;
  }
  void write(const TracePoint& point) {
    first_ = false;
    last_ = point;
    stream_.write_line(
        {{"trace",
          {point.seconds, point.passes, finite_or_null(point.duality_gap), point.iteration}}});
  }
  [[nodiscard]] bool is_last(const TracePoint& point) const {
    return !first_ && last_.seconds == point.seconds;
  }

 private:
  const AnswerStream& stream_;
  bool first_ = true;
  TracePoint last_;
};

// Of this process or, for external programs, of what it started.
std::size_t peak_with_children() {
  rusage children{};
  getrusage(RUSAGE_CHILDREN, &children);
  return std::max(peak_resident_bytes(), static_cast<std::size_t>(children.ru_maxrss) * 1024);
}

double seconds_of(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

// The processor time of all threads of this process, and of programs that it has started and seen
// end.
double cpu_seconds() {
  double seconds = 0.0;
  for (const int whose : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage usage{};
    getrusage(whose, &usage);
    seconds += seconds_of(usage.ru_utime) + seconds_of(usage.ru_stime);
  }
  return seconds;
}

// What only external programs have to say.
void add_account(const Solution& solution, json& answer) {
  if (solution.account.seconds) answer["stated_seconds"] = *solution.account.seconds;
  for (const TracePoint& point : solution.account.trace) {
    answer["stated_trace"].push_back({point.seconds, finite_or_null(point.duality_gap)});
  }
  if (solution.repair.any()) {
    answer["repair"] = {solution.repair.clipped, solution.repair.rescaled};
  }
}

json answer_of(const Solution& solution, double wall_seconds, double cpu, std::size_t baseline) {
  json support = json::array();
  for (std::size_t i = 0; i < solution.design.weights.size(); ++i) {
    const double weight = solution.design.weights[i];
    if (weight != 0.0) support.push_back({i, finite_or_null(weight)});
  }
  json answer{{"status", to_string(solution.status)},
              {"seconds", solution.counters.seconds},
              {"wall_seconds", wall_seconds},
              {"cpu_seconds", cpu},
              {"passes", solution.counters.passes},
              {"iterations", solution.counters.iterations},
              {"peak_memory_bytes", peak_with_children()},
              {"baseline_memory_bytes", baseline},
              {"message", solution.message},
              {"support", std::move(support)}};
  add_account(solution, answer);
  return answer;
}

void solve_and_answer(const WorkerRequest& request, const SolverRegistry& registry,
                      const AnswerStream& stream) {
  const InformationSet set = read_information_set(request.set_file);
  const Solver& solver = registry.at(request.solver);
  const SolveOptions options{.duality_gap = request.duality_gap,
                             .time_limit = request.time_limit,
                             .seed = request.seed,
                             .threads = request.threads};
  // One read of the whole set, so that no run pays for the pages of the file.
  (void)set.content_hash();
  TraceWriter writer(stream);
  const std::size_t baseline = peak_resident_bytes();
  const double cpu = cpu_seconds();
  const auto start = Clock::now();
  const Solution solution = solver.solve(set, options, &writer);
  const std::chrono::duration<double> wall = Clock::now() - start;
  const double used = cpu_seconds() - cpu;
  if (!solution.trace.empty() && !writer.is_last(solution.trace.back())) {
    writer.write(solution.trace.back());
  }
  stream.write_line({{"answer", answer_of(solution, wall.count(), used, baseline)}});
}

double number(const std::string& name, const std::string& text) {
  try {
    return std::stod(text);
  } catch (const std::exception&) {
    throw InputError(fmt::format("worker argument {}: '{}' is no number", name, text));
  }
}

}  // namespace

std::vector<std::string> worker_arguments(const WorkerRequest& request) {
  return {request.set_file,
          request.solver,
          fmt::format("{:.17g}", request.duality_gap),
          fmt::format("{:.17g}", request.time_limit),
          std::to_string(request.seed),
          std::to_string(request.threads)};
}

WorkerRequest parse_worker_arguments(const std::vector<std::string>& arguments) {
  if (arguments.size() != 6) {
    throw InputError("a worker takes SET SOLVER GAP SECONDS SEED THREADS");
  }
  return {.set_file = arguments[0],
          .solver = arguments[1],
          .duality_gap = number("GAP", arguments[2]),
          .time_limit = number("SECONDS", arguments[3]),
          .seed = static_cast<std::uint64_t>(number("SEED", arguments[4])),
          .threads = static_cast<int>(number("THREADS", arguments[5]))};
}

int run_worker(const WorkerRequest& request, const SolverRegistry& registry) {
  const AnswerStream stream;
  try {
    solve_and_answer(request, registry, stream);
    return 0;
  } catch (const std::bad_alloc&) {
    stream.write_line({{"answer",
                        {{"status", "out_of_memory"},
                         {"peak_memory_bytes", peak_resident_bytes()},
                         {"message", "an allocation failed"}}}});
    return 0;
  } catch (const InputError& error) {
    fmt::print(stderr, "graybox: {}\n", error.what());
    return 2;
  }
}

}  // namespace graybox::bench
