// Columns from records, as loggers write them: {"t": 0.1, "joint": {"q": [1, 2]}, "mode": "run"}.
//
// A key of a record is a column; keys within keys are "joint.q", numbers of an array "joint.q[1]".
// A key that a record lacks, and null, are NaN there; true and false are 1 and 0. Keys that hold
// text are no columns, but for time stamps; one that holds text here and numbers there is refused
// with the record's number. Memory: the columns. Cost: a look-up a value.
#pragma once

#include <cstddef>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "diagnosis/recording_files/recording_file.hpp"
#include "diagnosis/recording_files/time_stamp.hpp"

namespace graybox::formats {

class RecordColumns {
 public:
  // `path` for messages.
  explicit RecordColumns(std::string path);

  // Throws InputError if this is no object, is nested too deep, or contradicts earlier records.
  void add(const nlohmann::json& record);
  // In the order in which the keys came up.
  [[nodiscard]] std::vector<RecordedColumn> columns() const;

 private:
  struct Values {
    std::vector<double> numbers;
    StampColumn stamps = {};
    bool has_text = false, has_numbers = false;
  };
  void add_value(const std::string& name, const nlohmann::json& value, int depth);
  Values& column(const std::string& name);
  [[noreturn]] void fail(const std::string& text) const;

  std::string path_;
  std::size_t records_ = 0;  // complete
  std::vector<std::string> names_;
  std::map<std::string, Values> values_;
};

}  // namespace graybox::formats
