// What the commands print for people.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

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
// The status as people read it: `interrupted` where the time limit was Ctrl-C.
[[nodiscard]] std::string_view status_word(ReportStatus status);
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

// "sample 12 of 50, about 3 min 5 s left" on stderr in the same way, for work that is counted. The
// line is there from the start. For one thread at a time.
class CountProgress {
 public:
  enum class Total : std::int8_t { kExact, kAtMost };  // of kAtMost pieces fewer may do

  // A stage that is not counted: its name alone.
  explicit CountProgress(std::string stage);
  CountProgress(std::string noun, std::size_t total);
  ~CountProgress();
  CountProgress(const CountProgress&) = delete;
  CountProgress& operator=(const CountProgress&) = delete;

  // What comes next; its time begins anew.
  void begin(std::string stage);
  void begin(std::string noun, std::size_t total, Total kind = Total::kExact);
  // So many pieces are finished. False once the user has asked to stop.
  bool update(std::size_t done);
  // Takes the line away, before something else is printed.
  void clear();

 private:
  using Clock = std::chrono::steady_clock;

  [[nodiscard]] std::string time_left(std::size_t done) const;
  void write(std::size_t done);

  std::string noun_;
  std::size_t total_ = 0;  // 0: not counted
  Total kind_ = Total::kExact;
  bool terminal_;
  bool written_ = false;
  bool counting_ = false;
  std::size_t before_ = 0;  // finished before start_, as where a run goes on from another
  Clock::time_point start_{};
  Clock::time_point next_{};
};

}  // namespace graybox::cli
