#include "solvers/external/external_solver.hpp"

#include <fmt/format.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <system_error>
#include <utility>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/shortened.hpp"
#include "problems/formats/information_set_file.hpp"
#include "solvers/core/sensitivity.hpp"
#include "solvers/core/tracer.hpp"
#include "solvers/external/cbf_file.hpp"
#include "solvers/external/child_process.hpp"
#include "solvers/report/design_file.hpp"

namespace graybox {
namespace {

namespace fs = std::filesystem;

constexpr double kGraceSeconds = 0.5;
constexpr double kGraceShare = 0.02;
constexpr double kLongestWait = 0.02;       // s between looks at the program
constexpr double kObserverInterval = 0.1;   // s between reports to the observer
constexpr std::size_t kLongestQuote = 200;  // characters of the program's last words

// A fresh folder, removed with all it holds.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string pattern = (fs::temp_directory_path() / "graybox-external-XXXXXX").string();
    if (mkdtemp(pattern.data()) == nullptr) {
      throw InputError(fmt::format("{}: can't be made: {}; set TMPDIR to a folder with room",
                                   pattern, std::strerror(errno)));
    }
    path_ = pattern;
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  [[nodiscard]] std::string file(const std::string& name) const { return (path_ / name).string(); }

 private:
  fs::path path_;
};

std::string last_line(const std::string& log) {
  std::ifstream stream(log);
  std::string last;
  for (std::string line; std::getline(stream, line);) {
    if (line.find_first_not_of(" \t\r") != std::string::npos) last = std::move(line);
  }
  return last.substr(0, kLongestQuote);
}

// The shell's exit codes for what it can't find and can't run.
constexpr int kNotFound = 127;
constexpr int kNotRunnable = 126;

std::string failure(const std::string& command, int exit_code, const std::string& log) {
  const std::string words = last_line(log);
  const bool of_shell = words.starts_with("external: ");
  if (exit_code == kNotFound && of_shell) {
    return fmt::format("no such program: {}", shortened(command));
  }
  if (exit_code == kNotRunnable && of_shell) {
    return fmt::format("{} can't be run; is it executable?", shortened(command));
  }
  const std::string how = exit_code < 0 ? fmt::format("ended by signal {}", -exit_code)
                                        : fmt::format("ended with exit code {}", exit_code);
  return words.empty() ? how : fmt::format("{}: {}", how, words);
}

SolveStatus claimed_status(const DesignFile& file, double gap, double asked_gap) {
  for (const SolveStatus status :
       {SolveStatus::kSolved, SolveStatus::kIterationLimit, SolveStatus::kTimeLimit}) {
    if (file.status == to_string(status)) return status;
  }
  const bool solved = file.status.empty() && gap <= asked_gap;
  return solved ? SolveStatus::kSolved : SolveStatus::kNumericalFailure;
}

// True if the program ended by itself, false if it had to be killed.
bool wait_for(ChildProcess& child, Tracer& tracer, double time_limit, bool observed) {
  double next_report = kObserverInterval;
  while (child.running()) {
    const bool out_of_time = tracer.out_of_time();
    const double now = tracer.seconds();
    if (observed && now >= next_report) {
      tracer.record(std::numeric_limits<double>::infinity(), 0);
      next_report = now + kObserverInterval;
    }
    const bool stop_requested = out_of_time && now <= time_limit;
    if (stop_requested || now > (1.0 + kGraceShare) * time_limit + kGraceSeconds) {
      child.kill();
      return false;
    }
    child.wait(kLongestWait);
  }
  return true;
}

// The same set with its matrices, which stay where they are.
InformationSet matrices_of(const InformationSet& set) {
  return {set.dimension(),
          AlignedArray::borrowed(set.data(), set.candidate_count() * set.packed_size()),
          set.candidates(), set.parameters(), set.name()};
}

void write_problem(const std::string& file, const InformationSet& set) {
  if (file.ends_with(".cbf")) {
    write_cbf(file, set);
  } else {
    // Programs of others know matrices alone.
    write_information_set(file, set.has_factors() ? matrices_of(set) : set);
  }
}

}  // namespace

ExternalSolver::ExternalSolver(std::string name)
    : ExternalSolver(name, name.substr(kPrefix.size())) {}

ExternalSolver::ExternalSolver(std::string name, std::string command)
    : name_(std::move(name)), command_(std::move(command)) {}

Solution ExternalSolver::solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer) const {
  Tracer tracer(set, options, observer);
  const double uniform = 1.0 / static_cast<double>(set.candidate_count());
  Design design{std::vector<double>(set.candidate_count(), uniform)};
  DesignFile file;
  const auto finish = [&](SolveStatus status, std::string message = {}) {
    const std::string repaired = describe(file.repair);
    if (!repaired.empty()) message += (message.empty() ? "" : "; ") + repaired;
    Solution solution =
        tracer.finish(std::move(design), status, file.counters.iterations, std::move(message));
    solution.account = std::move(file.account);
    solution.repair = file.repair;
    return solution;
  };

  tracer.pause();
  const TemporaryFolder folder;
  const std::string problem = folder.file("problem" + command_.set_ending());
  const std::string answer = folder.file("design.json");
  const std::string log = folder.file("output.txt");
  write_problem(problem, set);
  const std::vector<std::string> words = command_.words({.set_file = problem,
                                                         .design_file = answer,
                                                         .duality_gap = options.duality_gap,
                                                         .seconds = options.time_limit,
                                                         .seed = options.seed,
                                                         .threads = options.threads});
  tracer.resume();

  ChildProcess child(words, log);
  const bool ended = wait_for(child, tracer, options.time_limit, observer != nullptr);
  tracer.pause();
  if (ended && child.exit_code() != 0) {
    tracer.resume();
    return finish(SolveStatus::kNumericalFailure, failure(command_.text(), child.exit_code(), log));
  }
  if (!fs::exists(answer)) {
    tracer.resume();
    return ended ? finish(SolveStatus::kNumericalFailure, "wrote no design.json")
                 : finish(SolveStatus::kTimeLimit, "killed before it wrote a design.json");
  }
  try {
    file = read_design(answer, set, WeightCheck::kRepaired);
    design = std::move(file.design);
    const double gap = duality_gap(set, design.weights);
    tracer.resume();
    tracer.record(gap, file.counters.iterations);
    if (!ended) return finish(SolveStatus::kTimeLimit, "killed when its time was up");
    const SolveStatus status = claimed_status(file, gap, options.duality_gap);
    if (status != SolveStatus::kNumericalFailure || !file.message.empty()) {
      return finish(status, file.message);
    }
    return finish(status, fmt::format("ended with a duality gap of {:.2g}", gap));
  } catch (const InputError& error) {
    tracer.resume();
    return finish(ended ? SolveStatus::kNumericalFailure : SolveStatus::kTimeLimit, error.what());
  }
}

}  // namespace graybox
