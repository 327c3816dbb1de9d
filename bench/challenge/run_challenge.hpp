// Runs a diagnosis on every case of a challenge. Each is a process of its own that is given the
// case's folder and nothing else. Its working folder is the case's, and its environment is empty
// but for PATH and the counts of threads. No argument names another folder but the one for its
// answer. Where the system has Landlock, the process can open nothing but these two folders, the
// program and the system's libraries (confinement.hpp). Seed and truth are not known here.
//
//   answers/run.json                    which cases, command and options
//   answers/case_017/verdict.json ...   what the diagnosis writes
//   answers/case_017/run.json           its exit code and time; written last
//   answers/case_017/log.txt            what it printed
//
// Leaving laws out. With `without_named` (an earlier folder of answers) each case whose verdict
// names laws is run again with these laws taken out of the catalogue; the others are passed over.
// Which law is right is not known here: `score` takes those cases whose named law was the true one.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace graybox::bench {

struct RunOptions {
  std::filesystem::path cases, answers;
  std::vector<std::string> command;     // program and first arguments, "graybox diagnose"
  std::vector<std::string> without;     // laws, in all cases
  std::filesystem::path without_named;  // answers; empty: none
  int threads = 1;                      // cases at a time, one thread each
  double time_limit = 300.0;            // s, a case
  std::function<bool()> keep_going;     // asked often
  std::function<void(std::size_t, std::size_t)> report;
};

struct RunOutcome {
  std::size_t cases = 0;
  std::size_t already_there = 0;
  std::size_t failed = 0;  // no verdict: crashed, refused or out of time
  bool confined = true;    // all that were run now were kept from other folders by the system
  bool complete = false;   // false: asked to stop
};

// Throws InputError where a folder is wrong or holds the answers of another command.
RunOutcome run_challenge(const RunOptions& options);

// Laws that a verdict.json names, each once; empty where there is none.
[[nodiscard]] std::vector<std::string> laws_named(const std::filesystem::path& verdict);

}  // namespace graybox::bench
