// The columns of one data file, whatever its format:
//
//   .csv .tsv .txt .dat .log .lvm
//               a header with the columns' names, then numbers; separated by commas, semicolons,
//               tabs or blanks. Without a header the columns are called 1, 2, ...; the
//               last line with # or % before the numbers is one if it has as many names. A name may
//               carry its unit: "speed [rpm]", or a second line has the units. Headers of
//               oscilloscopes are read, too (recorder_header.hpp). Empty fields and Excel's errors
//               (#VALUE!) are NaN. Columns without a name are called by their number; those with
//               hardly a number are left out, and so are the last names of a header with more
//               names than all rows have fields.
//   .h5 .hdf5   every numeric dataset by its path "group/name"; attributes unit and sample_time
//   .mat        versions 5, 7 and 7.3: every real numeric matrix; fields of a structure as
//               "rec.speed"
//   .npy        one array, float32 or float64: columns 1, 2, ...
//   .json       arrays of numbers, or of equal rows of numbers, by their key "group.key"; null is
//               NaN; or an array of records {"key": number, ...} (record_columns.hpp), alone or
//               beside settings; or a table as pandas writes it
//   .jsonl .ndjson  a record a line
//   .csv.gz ... any of the texts above, packed with gzip
//
// Time stamps (time_stamp.hpp) are seconds, and so are whole seconds with nanoseconds beside them
// (time_parts.hpp).
//
// Column k of an array with two axes is "name[k]", k from 1. Time runs along the longer axis, which
// must be at least twice the shorter: a column of an array that leaves it open is refused, not
// guessed.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace graybox {

struct RecordedColumn {
  std::string name;
  std::string unit;  // as the file states it; empty if it doesn't
  Eigen::VectorXd values;
  std::string number = {};  // "3", which names it, too, where names stood in a comment
  std::string origin = {};  // of a time: the stamps, or the two columns, that it was read from
};

// Whether a name is a column's whole title, its unit in brackets included: "Force [V]" of the
// column Force in V. Blanks don't matter.
[[nodiscard]] bool is_whole_title(std::string_view text, std::string_view name,
                                  std::string_view unit);

struct RecordingFile {
  std::string path;
  std::vector<RecordedColumn> columns;
  std::vector<std::string> unclear_arrays;  // whose axes leave open which of them is time
  std::optional<double> sample_time;        // s, as the file states it
  std::vector<std::string> remarks = {};    // what the reader made of an odd file
  std::vector<std::string> left_out = {};   // columns of words

  // By name, number or whole title. Null if there is none.
  [[nodiscard]] const RecordedColumn* find(const std::string& name) const;
  // Throws InputError naming the columns there are.
  [[nodiscard]] const RecordedColumn& at(const std::string& name) const;
};

// Throws InputError with one line for a file that is missing, truncated, of another kind, or holds
// no numbers. Several threads may read different files. Cost: the whole file is in memory once.
[[nodiscard]] RecordingFile read_recording_file(const std::filesystem::path& path);

}  // namespace graybox
