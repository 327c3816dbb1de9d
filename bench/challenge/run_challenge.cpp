#include "bench/challenge/run_challenge.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <exception>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "bench/challenge/confinement.hpp"
#include "bench/challenge/seal.hpp"
#include "problems/base/error.hpp"
#include "problems/base/program_version.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/folder_lock.hpp"
#include "problems/files/temporary_name.hpp"
#include "solvers/external/child_process.hpp"

namespace graybox::bench {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
using Json = nlohmann::ordered_json;

std::vector<std::string> case_names(const fs::path& cases) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(cases)) {
    if (fs::exists(entry.path() / "campaign" / "campaign.yaml") &&
        entry.path().filename().string().front() != '.') {
      names.push_back(entry.path().filename().string());
    }
  }
  std::ranges::sort(names);
  return names;
}

bool is_leftover(const fs::directory_entry& entry) {
  return is_temporary_name(entry.path().filename().string());
}

void claim_answers(const RunOptions& options, const ChallengeHeader& header) {
  const Json stamp{{"format", "graybox-answers/1"},
                   {"truth_sha256", header.truth_sha256},
                   {"command", options.command},
                   {"without", options.without},
                   {"without_named", !options.without_named.empty()}};
  const fs::path file = options.answers / "run.json";
  if (std::ifstream stream(file); stream) {
    if (Json::parse(stream, nullptr, false) == stamp) return;
    throw InputError(
        fmt::format("{}: holds the answers of another challenge, command or choice of laws; choose "
                    "another folder",
                    options.answers.string()));
  }
  if (!std::ranges::all_of(fs::directory_iterator(options.answers), is_leftover)) {
    throw InputError(
        fmt::format("{}: is not empty; choose another folder", options.answers.string()));
  }
  write_text_file(file.string(), stamp.dump(2) + "\n");
}

// Files of the diagnosis itself: those words of the command that are files or programs on PATH.
std::vector<fs::path> files_of(const std::vector<std::string>& command) {
  std::vector<fs::path> files;
  for (const std::string& word : command) {
    if (word.find('/') != std::string::npos && fs::exists(word))
      files.push_back(fs::canonical(word));
  }
  return files;
}

// One case being diagnosed, by a thread of its own that can read the case's folder, its answer's
// and the system's, so that the process it starts can't either.
class CaseRun {
 public:
  CaseRun(const RunOptions& options, const std::string& name, std::vector<std::string> without)
      : case_(fs::canonical(options.cases / name)), without_(std::move(without)) {
    fs::create_directories(options.answers / name);
    answer_ = fs::canonical(options.answers / name);
    thread_ = std::jthread([this, &options](const std::stop_token& stop) {
      try {
        work(options, stop);
      } catch (...) {
        failure_ = std::current_exception();
      }
      finished_ = true;
    });
  }

  [[nodiscard]] bool finished() const { return finished_; }
  // Once finished. Throws what went wrong.
  [[nodiscard]] bool ok() {
    thread_.join();
    if (failure_) std::rethrow_exception(failure_);
    return ok_;
  }
  [[nodiscard]] bool confined() const { return confined_; }

 private:
  void work(const RunOptions& options, const std::stop_token& stop) {
    OpenPaths open{system_paths(), {answer_, "/dev/null"}};
    open.readable.push_back(case_);
    for (const fs::path& file : files_of(options.command)) open.readable.push_back(file);
    confined_ = confine_thread(open);
    const auto start = Clock::now();
    const auto seconds = [&] {
      return std::chrono::duration<double>(Clock::now() - start).count();
    };
    ChildProcess process(arguments(options), (answer_ / "log.txt").string());
    while (process.running() && seconds() < options.time_limit) {
      if (stop.stop_requested()) return;  // the process ends with its object
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    const bool out_of_time = process.running();
    process.kill();
    write_record(process.exit_code(), out_of_time, seconds());
  }

  // `env` clears the environment and enters the case's folder.
  [[nodiscard]] std::vector<std::string> arguments(const RunOptions& options) const {
    std::vector<std::string> words{"env",
                                   "-C",
                                   case_.string(),
                                   "-i",
                                   "PATH=/usr/local/bin:/usr/bin:/bin",
                                   "OMP_NUM_THREADS=1",
                                   "OPENBLAS_NUM_THREADS=1"};
    words.insert(words.end(), options.command.begin(), options.command.end());
    words.insert(words.end(), {"model.yaml", "campaign", "-o", answer_.string(), "--json"});
    for (const std::string& law : without_) words.insert(words.end(), {"--without", law});
    return words;
  }

  void write_record(int exit_code, bool out_of_time, double seconds) {
    ok_ =
        !out_of_time && fs::exists(answer_ / "verdict.json") && (exit_code == 0 || exit_code == 1);
    const Json record{{"format", "graybox-answer/1"},
                      {"written_by", written_by()},
                      {"status", out_of_time ? "time_limit"
                                 : ok_       ? "answered"
                                             : "failed"},
                      {"exit_code", exit_code},
                      {"seconds", seconds},
                      {"confined", confined_.load()},
                      {"without", without_}};
    write_text_file((answer_ / "run.json").string(), record.dump(2) + "\n");
  }

  fs::path case_, answer_;
  std::vector<std::string> without_;
  bool ok_ = false;
  std::exception_ptr failure_;
  std::atomic<bool> confined_ = false;
  std::atomic<bool> finished_ = false;
  std::jthread thread_;  // last: the others outlive it
};

bool was_answered(const fs::path& record) {
  std::ifstream stream(record);
  const Json json = Json::parse(stream, nullptr, false);
  return json.is_object() && json.value("status", "") == "answered";
}

struct Task {
  std::string name;
  std::vector<std::string> without;
};

std::vector<Task> tasks_of(const RunOptions& options) {
  std::vector<Task> tasks;
  for (const std::string& name : case_names(options.cases)) {
    Task task{name, options.without};
    if (!options.without_named.empty()) {
      const auto named = laws_named(options.without_named / name / "verdict.json");
      if (named.empty()) continue;
      task.without.insert(task.without.end(), named.begin(), named.end());
    }
    tasks.push_back(std::move(task));
  }
  return tasks;
}

}  // namespace

std::vector<std::string> laws_named(const fs::path& verdict) {
  std::ifstream stream(verdict);
  const Json json = Json::parse(stream, nullptr, false);
  std::vector<std::string> laws;
  if (!json.is_object() || !json.contains("physics")) return laws;
  for (const Json& effect : json.at("physics")) {
    const std::string law = effect.value("law", "");
    if (!law.empty() && std::ranges::find(laws, law) == laws.end()) laws.push_back(law);
  }
  return laws;
}

RunOutcome run_challenge(const RunOptions& options) {
  const ChallengeHeader header = read_header(options.cases);
  if (!options.without_named.empty() && !fs::exists(options.without_named / "run.json")) {
    throw InputError(fmt::format("{}: is no folder of answers", options.without_named.string()));
  }
  const std::vector<Task> tasks = tasks_of(options);
  if (tasks.empty()) {
    throw InputError(fmt::format("{}: no case to run", options.cases.string()));
  }
  const FolderLock lock(options.answers);
  claim_answers(options, header);
  RunOutcome outcome{.cases = tasks.size()};
  std::vector<const Task*> waiting;
  for (const Task& task : tasks) {
    const fs::path record = options.answers / task.name / "run.json";
    if (!fs::exists(record)) {
      waiting.push_back(&task);
      continue;
    }
    ++outcome.already_there;
    if (!was_answered(record)) ++outcome.failed;
  }
  std::ranges::reverse(waiting);  // taken from the back
  std::vector<std::unique_ptr<CaseRun>> running;
  std::size_t done = outcome.already_there;
  while (!waiting.empty() || !running.empty()) {
    if (options.keep_going && !options.keep_going()) return outcome;
    while (!waiting.empty() && running.size() < static_cast<std::size_t>(options.threads)) {
      running.push_back(
          std::make_unique<CaseRun>(options, waiting.back()->name, waiting.back()->without));
      waiting.pop_back();
    }
    std::erase_if(running, [&](const std::unique_ptr<CaseRun>& run) {
      if (!run->finished()) return false;
      if (!run->ok()) ++outcome.failed;
      outcome.confined &= run->confined();
      if (options.report) options.report(++done, tasks.size());
      return true;
    });
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  outcome.complete = true;
  return outcome;
}

}  // namespace graybox::bench
