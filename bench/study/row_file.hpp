// rows.jsonl: the study's raw rows, one JSON object a line, one line a run. A line is appended and
// flushed to disk as soon as its run is over, so that whatever ends a study loses one run at most.
// A line torn by a kill is passed over on reading and cut off before the next is written.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "bench/study/run_row.hpp"

namespace graybox::bench {

struct StudyRows {
  std::vector<nlohmann::json> environments;
  std::vector<RunRow> runs;
  std::vector<SkipRow> skips;
  std::size_t unreadable = 0;        // lines that are no rows: torn, damaged, of another version
  std::size_t first_unreadable = 0;  // the first of them, counted from 1; 0: there is none
};

// Empty where there is no such file. Skips of points that were run after all are left out.
[[nodiscard]] StudyRows read_rows(const std::filesystem::path& file);

// "rows.jsonl: 3 lines are no rows of a study (the first: line 17) and are left out"; empty where
// all could be read.
[[nodiscard]] std::string unreadable_note(const StudyRows& rows, const std::string& file);

class RowFile {
 public:
  // Opens for appending, after the last whole line. Throws InputError if it can't be written.
  explicit RowFile(std::filesystem::path file);
  RowFile(const RowFile&) = delete;
  RowFile& operator=(const RowFile&) = delete;
  ~RowFile();

  void append(nlohmann::json row);

 private:
  std::filesystem::path path_;
  int descriptor_ = -1;
};

// Rewrites the file with only the lines kept (through a temporary file, then renamed); the others
// are appended to `rest`. Lines that are no JSON go. Nothing happens if all are kept.
void divide_rows(const std::filesystem::path& file, const std::filesystem::path& rest,
                 const std::function<bool(const nlohmann::json&)>& keep);

}  // namespace graybox::bench
