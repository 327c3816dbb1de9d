// What the commands print for people.
#pragma once

#include <chrono>
#include <string>

#include "problems/information/information_set.hpp"
#include "solvers/core/design.hpp"
#include "solvers/core/solver.hpp"
#include "solvers/report/solve_report.hpp"

namespace graybox::cli {

// What criterion_value is: "tr M^-1".
[[nodiscard]] const char* name_of_value(CriterionKind kind);

// "7920 candidates, 12 parameters, 4.9 MB".
[[nodiscard]] std::string describe(const InformationSet& set);

// The verdict, a few lines, and the heaviest support points with their coordinates.
[[nodiscard]] std::string describe(const SolveReport& report);
[[nodiscard]] std::string describe_support(const InformationSet& set, const Design& design);

// One line on stderr, rewritten a few times a second; silent unless stderr is a terminal. Stops the
// solver once the user has asked to (interrupt.hpp).
class Progress : public SolveObserver {
 public:
  explicit Progress(std::string solver);
  ~Progress() override;
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  bool on_progress(const TracePoint& point) override;

 private:
  std::string solver_;
  bool terminal_;
  bool written_ = false;
  std::chrono::steady_clock::time_point next_{};
};

// "sample 12 of 50" on stderr in the same way, for work that is counted.
class CountProgress {
 public:
  CountProgress(std::string noun, std::size_t total);
  ~CountProgress();
  CountProgress(const CountProgress&) = delete;
  CountProgress& operator=(const CountProgress&) = delete;
  // False once the user has asked to stop.
  bool update(std::size_t done);

 private:
  std::string noun_;
  std::size_t total_;
  bool terminal_;
};

}  // namespace graybox::cli
