// Log files as recordings: which files were taken together, and what each column may be.
//
// Files of one length whose columns complement each other are one recording (positions in one file,
// efforts in another). Files with the same columns are recordings of their own. Columns of another
// length than most (constants in a MAT file) are left out. Where a file's clock begins anew, each
// run is a recording, or the longest hundred are; single wrong stamps are mended (wrong_stamp.hpp).
// Where a title has no quantity, the name of its file may have one.
//
//   std::vector<LogRecording> logs = read_logs({"run_1.csv", "run_2.csv"}, {});
//   logs[0].columns[1].words.quantity
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/log_columns/column_words.hpp"

namespace graybox {

struct LogColumn {
  std::size_t file = 0;  // of LogRecording::files
  std::string name;      // in the file
  std::string stated_unit;
  ColumnWords words;
  Eigen::VectorXd values;             // in words.unit: what was recorded, times words.unit_factor
  bool answered = false;              // what it is was said by the user
  std::string joint;                  // said by the user: a joint's name, motor or load; else empty
  std::string evidence = {};          // what the data said of it, where its title says nothing
  bool differs_between_logs = false;  // one value in each log, not the same in all
  std::string number = {};            // "3", which names it, too, where names stood in a comment
  std::string file_name = {};         // for messages
  std::string origin = {};            // of a time that was not read as a number
  bool is_goal = false;               // of a servo: said by the user

  [[nodiscard]] bool moves() const;     // finite values are not all the same, here or in all logs
  [[nodiscard]] bool is_zero() const;   // finite values are all exactly zero, here and in all logs
  [[nodiscard]] bool has_gaps() const;  // some values are not finite
  [[nodiscard]] bool counts_rows() const;  // whole numbers, each larger than the last by the same
};

struct LogRecording {
  std::vector<std::filesystem::path> files;
  std::vector<std::string> keys;  // one a file: "position", ...; a single file has ""
  std::vector<LogColumn> columns;
  std::vector<std::string> left_out = {};  // columns of words, of its files
  std::optional<double> sample_time;       // s, as a file states it
  // A part of its files, from that row on (0: the first), where their clock begins anew.
  bool is_part = false;
  Eigen::Index first_row = 0;
  // Rows that are samples, of those of the files, where others are left out: without a time, or
  // written again within a burst (written_bursts.hpp). Empty: all are.
  std::vector<Eigen::Index> rows = {};
  double burst = -1.0;  // of the time column's unit; below 0: there are no bursts
  // Rows of its files that are in no recording; the first of a file's recordings counts them.
  Eigen::Index dropped_rows = 0;

  // "log.csv", or "log.csv, rows 501 to 900".
  [[nodiscard]] std::string label() const;
  [[nodiscard]] Eigen::Index samples() const { return columns.front().values.size(); }
  // The row of a sample in the files.
  [[nodiscard]] Eigen::Index file_row(Eigen::Index sample) const {
    return rows.empty() ? first_row + sample : rows[static_cast<std::size_t>(sample)];
  }
  // The column of that name in that file. Throws InputError naming the file where it is missing.
  [[nodiscard]] const LogColumn& at(std::size_t file, const std::string& name) const;
};

// What the user says of columns: NAME=QUANTITY[:UNIT][@JOINT], as in "enc=position:deg" or
// "u1=torque@joint_1". NAME is a column, an array without its [k], a range "2..7" of a file without
// header, or a pattern with * and ?. QUANTITY: time, position, velocity, acceleration, force or
// torque, current, voltage, command, goal, ignore, or a word that makes a title a drive, as pwm,
// duty and throttle. A goal is the reference of a position servo,
// whose drive is then the difference to the position. NAME may have its unit in brackets, or not.
struct ColumnAnswer {
  std::string names;
  LogQuantity quantity = LogQuantity::kUnknown;
  std::string unit;
  std::string joint = {};
  double unit_factor = 1.0;  // of "0.1 deg"; -1 of "-deg", a sensor that counts the other way
  bool is_goal = false;
  std::string written = {};  // the unit as the user wrote it
};
// Throws InputError for a text that is none.
[[nodiscard]] ColumnAnswer column_answer(const std::string& text);

// Throws InputError for files that can't be read, for an answer about a column that is not there,
// and where all recordings have less than 50 samples. Beside longer ones these are left out, with a
// sentence each in `remarks`. So is a log whose values are those of another, or a part of them,
// whatever the files are called: kept out of a fit it would check nothing.
[[nodiscard]] std::vector<LogRecording> read_logs(const std::vector<std::filesystem::path>& files,
                                                  const std::vector<ColumnAnswer>& answers,
                                                  std::vector<std::string>* remarks = nullptr);

}  // namespace graybox
