// The times of a log: which column, in which unit, and how samples follow each other.
//
// A column is the time if its title says so and it rises. In a file without header it may be the
// first column, if it rises in steps of about one size. Its unit comes from the title. Else it
// comes from stamps of the Unix epoch, from a position beside its velocity (column_rates.hpp), or
// from the size of the step, in this order. Steps that could be two units are left open.
//
// The sample time of uneven times is the median step; where a quarter of the steps is much shorter,
// as with steps of 60 and 120 ms in turn, it is theirs, so that every part of the log allows it.
#pragma once

#include <optional>
#include <string>
#include <utility>

#include "diagnosis/log_columns/log_recordings.hpp"

namespace graybox {

struct LogTime {
  std::string column;  // in its file; empty: none
  std::size_t file = 0;
  std::string unit;                         // empty: open
  std::string odd_unit = {};                // that its title states and that is none of a time
  std::string file_name = {};               // of the column
  std::string why;                          // of the unit
  double factor = 1.0;                      // of that unit that one recorded number is
  double median_step = 1.0;                 // of that unit; samples where there is no column
  double burst = -1.0;                      // LogRecording::burst, of that unit
  bool is_even = true;                      // within a tenth of a step
  double sample_time = 0.0;                 // s; 0: open
  std::string of_step = "the median step";  // what the sample time of uneven times is
  // One of so many samples is taken, from that one on: what was measured holds its values.
  Eigen::Index every = 1, from = 0;

  // Seconds that one of the recorded unit is; 0 where it is open.
  [[nodiscard]] double seconds() const;
  // What to ask where the unit is open.
  [[nodiscard]] std::string question() const;
};

// A column that nobody knows and that rises by other steps from row to row, as ticks of a clock do;
// null where there is none. One that rises evenly comes before others.
[[nodiscard]] const LogColumn* ticking_column(const LogRecording& recording);
// Whether numbers only rise, eight of ten steps by half to twice the median: as a clock's do, and
// no force's. Whether nearly all steps are of about one size, too.
[[nodiscard]] bool rises_as_time(const Eigen::VectorXd& values);
[[nodiscard]] bool rises_evenly(const Eigen::VectorXd& values);
// The unit of a time by the size of its steps; empty where two are as likely.
[[nodiscard]] std::string unit_of_step(double step);
// The likelier one where two are: s up to steps of 1, then ms, for an example in a question.
[[nodiscard]] std::string likely_unit_of_step(double step);
// The smallest and the largest step of a column from row to row, but for one in a hundred each.
[[nodiscard]] std::pair<double, double> steps_between_rows(const LogColumn& column);

// `stated`: s, what the user says; it stands in for a missing column, and for the unit of one whose
// title has none. Throws InputError for a time that is named and doesn't rise, and for one whose
// steps are not what was stated.
[[nodiscard]] LogTime find_time(const LogRecording& recording, std::optional<double> stated);

// A sample time with as few digits as its times allow: 0.00200003 is 0.002.
[[nodiscard]] double rounded_step(double step);

}  // namespace graybox
