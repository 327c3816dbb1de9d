#include "bench/study/study.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <tuple>
#include <utility>

#include "bench/study/environment.hpp"
#include "bench/study/own_sets.hpp"
#include "bench/study/process.hpp"
#include "bench/study/row_file.hpp"
#include "bench/study/run_row.hpp"
#include "bench/study/statistics.hpp"
#include "bench/study/study_sets.hpp"
#include "bench/study/worker.hpp"
#include "problems/base/error.hpp"
#include "problems/files/folder_lock.hpp"
#include "problems/files/temporary_name.hpp"
#include "problems/formats/information_set_file.hpp"
#include "solvers/external/external_solver.hpp"

namespace graybox::bench {
namespace {

namespace fs = std::filesystem;

// A set, in memory for the checker and in a file for the workers.
struct StudySet {
  InformationSet set;
  std::string hash;
  std::string file;
  SetOrigin origin;
};

class SetStore {
 public:
  SetStore(const StudySetup& setup, std::vector<OwnSet>& own, fs::path folder)
      : setup_(setup), own_(own), folder_(std::move(folder)) {}

  const StudySet& get(const std::string& family, std::size_t candidates) {
    auto& entry = sets_[{family, candidates}];
    if (!entry) {
      entry = std::make_unique<StudySet>(make(family, candidates));
      if (!fs::exists(entry->file)) write_information_set(entry->file, entry->set);
    }
    return *entry;
  }

 private:
  StudySet make(const std::string& family, std::size_t candidates) {
    const auto own = std::ranges::find(own_, family, &OwnSet::path);
    if (own != own_.end()) {
      std::string file = file_of("own", own->set, own->hash);
      return {std::move(own->set), own->hash, std::move(file), {"", 0, own->absolute}};
    }
    InformationSet set = setup_.make_set(family, candidates);
    std::string hash = set.content_hash();
    std::string file = file_of(family, set, hash);
    return {std::move(set), std::move(hash), std::move(file), {family, study_set_seed(family), ""}};
  }

  [[nodiscard]] std::string file_of(const std::string& name, const InformationSet& set,
                                    const std::string& hash) const {
    const std::string start = hash.substr(0, 12);
    return (folder_ / fmt::format("{}_{}_{}.h5", name, set.candidate_count(), start)).string();
  }

  const StudySetup& setup_;
  std::vector<OwnSet>& own_;  // each is taken out when it is first asked for
  fs::path folder_;
  std::map<std::pair<std::string, std::size_t>, std::unique_ptr<StudySet>> sets_;
};

struct ExternalProgram {
  std::string label_command;  // of a program with a label; empty where the name says it
  std::string command;
  std::string files;  // files_hash()
};

// A point of the plan and how far it has come.
struct PointState {
  StudyPoint point;
  std::vector<RunRow> runs;
  int wanted = 1;
  bool skipped = false;
};

// Points that differ in Q, in the draw or in d alone.
std::tuple<std::string, std::string, std::string> series_of(const StudyPoint& point) {
  const bool is_own = point.experiment == "own";  // a file by any name
  return {point.experiment, is_own ? point.family : study_set_name(point.family).family,
          point.solver};
}

bool stops_larger_sets(ReportStatus status) {
  return status == ReportStatus::kTimeLimit || status == ReportStatus::kOutOfMemory;
}

std::string describe(const PointState& state) {
  const RunRow& first = state.runs.front();
  std::vector<double> seconds;
  for (const RunRow& run : state.runs) seconds.push_back(run.seconds);
  const Quartiles q = quartiles(seconds);
  return fmt::format(
      "{} Q = {}, {}, gap {:.0e}: {} in {:.4g} s ({:.4g} to {:.4g}, {} run{}), "
      "checked gap {:.1e}, {:.4g} passes, {:.0f} MB{}{}",
      first.family, first.candidates, first.key.solver, first.key.duality_gap,
      to_string(first.status), q.median, q.lower, q.upper, seconds.size(),
      seconds.size() == 1 ? "" : "s", first.duality_gap, first.passes,
      1e-6 * static_cast<double>(first.peak_memory_bytes), first.message.empty() ? "" : "; ",
      first.message);
}

std::vector<OwnSetSize> sizes_of(const std::vector<OwnSet>& own) {
  std::vector<OwnSetSize> sizes;
  for (const OwnSet& each : own) sizes.push_back({each.path, each.set.candidate_count()});
  return sizes;
}

class StudyRunner {
 public:
  StudyRunner(const StudyOptions& options, const SolverRegistry& registry, const StudySetup& setup,
              Progress& progress)
      : options_(options),
        setup_(setup),
        progress_(progress),
        limits_(limits_of(options)),
        own_(read_own_sets(options.sets)),
        sets_(setup, own_, options.output / "work") {
    plan_ = make_plan(options, registry, setup.families, sizes_of(own_));
    for (const StudyPoint& point : plan_) states_.push_back({point, {}, 1, false});
    find_programs();
  }

  StudyOutcome run() {
    prepare_folder();
    RowFile rows(options_.output / "rows.jsonl");
    rows_ = &rows;
    rows.append(describe_environment(options_.absent));
    for (round_ = 0; round_ < limits_.repetitions && !outcome_.interrupted; ++round_) run_round();
    rows_ = nullptr;
    return outcome_;
  }

 private:
  void prepare_folder() {
    lock_.emplace(options_.output);
    require_own_folder();
    std::error_code error;
    fs::create_directories(options_.output / "work", error);
    if (error) {
      throw InputError(fmt::format("{}: the folder can't be made: {}", options_.output.string(),
                                   error.message()));
    }
    const fs::path file = options_.output / "rows.jsonl";
    if (options_.fresh) fs::remove(file);
    if (!fs::exists(file)) return;
    divide_rows(file, options_.output / "rows_of_other_builds.jsonl",
                [&](const auto& row) { return is_comparable(row); });
    for (RunRow& run : read_rows(file).runs) earlier_.insert_or_assign(run.key, std::move(run));
  }

  // A row is comparable where it is of the same build and, if it has the name of an own set or
  // program of today, of the same contents and command.
  [[nodiscard]] bool is_comparable(const nlohmann::json& row) const {
    if (row.contains("binary") && row["binary"] != setup_.binary) return false;
    const auto own = std::ranges::find(own_, row.value("family", std::string()), &OwnSet::path);
    if (own != own_.end() && row.value("problem", own->hash) != own->hash) return false;
    if (!row.contains("status")) return true;
    const auto program = programs_.find(row.value("solver", std::string()));
    return program == programs_.end() ||
           (row.value("command", std::string()) == program->second.label_command &&
            row.value("program", std::string()) == program->second.files);
  }

  // Rows are hours of work, and other files are not ours.
  void require_own_folder() const {
    const std::string folder = options_.output.string();
    if (fs::exists(options_.output / "rows.jsonl")) {
      if (options_.resume || options_.fresh) return;
      throw InputError(
          fmt::format("{}: holds the rows of an earlier study; --resume goes on with them, --fresh "
                      "deletes them, or choose another folder",
                      folder));
    }
    for (const auto& entry : fs::directory_iterator(options_.output)) {
      const std::string name = entry.path().filename().string();
      if (name == "work" || is_temporary_name(name)) continue;
      throw InputError(
          fmt::format("{}: is not empty and holds no study; choose another folder", folder));
    }
  }

  void run_round() {
    for (const std::size_t next : visiting_order(plan_, options_.seed, round_)) {
      PointState& state = states_[next];
      if (setup_.interrupted && setup_.interrupted()) outcome_.interrupted = true;
      if (outcome_.interrupted) return;
      if (state.skipped || static_cast<int>(state.runs.size()) != round_ ||
          round_ >= state.wanted) {
        continue;
      }
      visit(state);
      if (!state.runs.empty() && static_cast<int>(state.runs.size()) == state.wanted) {
        const ReportStatus status = state.runs.front().status;
        progress_.finish_point(describe(state), status != ReportStatus::kSolved);
      }
    }
  }

  // Runs the point once more, or finds that run done, or skips it.
  void visit(PointState& state) {
    if (round_ == 0) {
      if (const std::optional<std::string> reason = reason_to_skip(state.point)) {
        skip(state, *reason);
        return;
      }
    } else if (progress_.seconds() > limits_.budget_seconds) {
      state.wanted = round_;
      return;
    }
    const StudySet& set = sets_.get(state.point.family, state.point.candidates);
    RunRow row = new_row(state, set);
    if (const auto found = earlier_.find(row.key); found != earlier_.end()) {
      row = found->second;
      ++outcome_.runs_found;
    } else if (!make_run(state, set, row)) {
      return;
    }
    take(state, std::move(row));
  }

  std::optional<std::string> reason_to_skip(const StudyPoint& point) const {
    if (!point.skipped_because.empty()) return point.skipped_because;
    if (const auto stop = stopped_.find(series_of(point)); stop != stopped_.end()) {
      return stop->second;
    }
    if (progress_.seconds() > limits_.budget_seconds) {
      return fmt::format("the study's {} were over", readable_duration(limits_.budget_seconds));
    }
    return std::nullopt;
  }

  void skip(PointState& state, const std::string& reason) {
    const StudyPoint& point = state.point;
    state.skipped = true;
    const SkipRow row{point.experiment, point.family,      point.candidates,
                      point.solver,     point.duality_gap, reason};
    rows_->append(row);
    progress_.finish_point(fmt::format("{} Q = {}, {}, gap {:.0e}: not run, {}", point.family,
                                       point.candidates, point.solver, point.duality_gap, reason),
                           false);
  }

  RunRow new_row(const PointState& state, const StudySet& set) const {
    const StudyPoint& point = state.point;
    RunRow row;
    row.key = {point.experiment,  set.hash,         point.solver,
               point.duality_gap, round_,           options_.threads,
               options_.seed,     point.time_limit, limits_.memory_bytes,
               setup_.binary,     std::string(),    std::string()};
    if (const auto program = programs_.find(point.solver); program != programs_.end()) {
      row.key.command = program->second.label_command;
      row.key.program = program->second.files;
    }
    row.family = point.family;
    row.origin = set.origin;
    return row;
  }

  // What stands behind every external solver of the plan.
  void find_programs() {
    for (const NamedProgram& program : options_.programs) {
      programs_[program.name] = {program.command, program.command, files_hash(program.command)};
    }
    for (const StudyPoint& point : plan_) {
      if (!point.solver.starts_with(ExternalSolver::kPrefix)) continue;
      const std::string command = point.solver.substr(ExternalSolver::kPrefix.size());
      programs_.try_emplace(point.solver, ExternalProgram{"", command, files_hash(command)});
    }
  }

  // False if the run was interrupted; it then leaves no row.
  bool make_run(const PointState& state, const StudySet& set, RunRow& row) {
    const StudyPoint& point = state.point;
    progress_.start_run(fmt::format("{} Q = {}, {} (run {})", point.family, point.candidates,
                                    point.solver, round_ + 1),
                        runs_done(), runs_planned(), seconds_left());
    row.load = load_average();
    row.date = utc_now();
    const ProcessOutcome outcome = run_process(request_for(point, set));
    if (outcome.ending == ProcessEnding::kInterrupted) {
      outcome_.interrupted = true;
      return false;
    }
    const WorkerOutput output = parse_worker_output(outcome.output, set.set.candidate_count());
    judge(set.set, outcome, output, row);
    if (output.answer) row.design = store_design(output.answer->design, options_.output);
    rows_->append(row);
    ++outcome_.runs_made;
    return true;
  }

  ProcessRequest request_for(const StudyPoint& point, const StudySet& set) const {
    ProcessRequest request;
    request.command = setup_.worker;
    const auto program = programs_.find(point.solver);
    const WorkerRequest run{
        .set_file = set.file,
        .solver = program == programs_.end() ? point.solver : "external:" + program->second.command,
        .duality_gap = point.duality_gap,
        .time_limit = point.time_limit,
        .seed = options_.seed,
        .threads = options_.threads};
    for (std::string& argument : worker_arguments(run)) {
      request.command.push_back(std::move(argument));
    }
    const std::string threads = std::to_string(options_.threads);
    for (const char* name : {"OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS",
                             "BLIS_NUM_THREADS", "OMP_THREAD_LIMIT"}) {
      request.environment.emplace_back(name, threads);
    }
    request.environment.emplace_back("OMP_DYNAMIC", "false");
    request.time_limit = kill_after(point.time_limit);
    request.memory_limit = limits_.memory_bytes;
    request.interrupted = setup_.interrupted;
    return request;
  }

  void take(PointState& state, RunRow row) {
    const StudyPoint& point = state.point;
    if (round_ == 0 && stops_larger_sets(row.status) && point.experiment != "families") {
      const std::string where = point.experiment == "draws" || point.experiment == "dimensions"
                                    ? point.family
                                    : fmt::format("Q = {}", row.candidates);
      stopped_.try_emplace(series_of(point),
                           fmt::format("stopped at {}: {}", where, to_string(row.status)));
    }
    if (round_ == 0) {
      state.wanted = 1;
      if (point.repeated && row.status == ReportStatus::kSolved) {
        const double fitting = limits_.point_seconds / std::max(row.process_seconds, 1e-3);
        state.wanted = static_cast<int>(std::clamp(fitting, 1.0, double{1} * limits_.repetitions));
      }
    }
    state.runs.push_back(std::move(row));
  }

  [[nodiscard]] std::size_t runs_done() const {
    std::size_t done = 0;
    for (const PointState& state : states_) done += state.runs.size();
    return done;
  }
  [[nodiscard]] std::size_t runs_planned() const {
    std::size_t planned = 0;
    for (const PointState& state : states_) {
      planned += state.skipped ? 0 : static_cast<std::size_t>(state.wanted);
    }
    return planned;
  }

  // Repetitions cost what the first run cost; first runs are taken to cost the mean so far.
  [[nodiscard]] double seconds_left() const {
    double known = 0.0, spent = 0.0;
    std::size_t unknown = 0, first_runs = 0;
    for (const PointState& state : states_) {
      if (state.skipped) continue;
      if (state.runs.empty()) {
        ++unknown;
        continue;
      }
      ++first_runs;
      spent += state.runs.front().process_seconds;
      const int left = state.wanted - static_cast<int>(state.runs.size());
      known += left * state.runs.front().process_seconds;
    }
    const double mean = first_runs == 0 ? 0.2 : spent / static_cast<double>(first_runs);
    const double estimate = known + static_cast<double>(unknown) * mean;
    return std::max(0.0, std::min(estimate, limits_.budget_seconds - progress_.seconds()));
  }

  const StudyOptions& options_;
  const StudySetup& setup_;
  Progress& progress_;
  StudyLimits limits_;
  std::vector<OwnSet> own_;
  std::optional<FolderLock> lock_;
  SetStore sets_;
  std::map<std::string, ExternalProgram> programs_;  // by the solver's name
  std::vector<StudyPoint> plan_;
  std::vector<PointState> states_;  // of its points
  std::map<RunKey, RunRow> earlier_;
  std::map<std::tuple<std::string, std::string, std::string>, std::string> stopped_;
  RowFile* rows_ = nullptr;
  int round_ = 0;
  StudyOutcome outcome_;
};

}  // namespace

StudyOutcome run_study(const StudyOptions& options, const SolverRegistry& registry,
                       const StudySetup& setup, Progress& progress) {
  return StudyRunner(options, registry, setup, progress).run();
}

}  // namespace graybox::bench
