#include "bench/study/row_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstring>
#include <fstream>
#include <limits>
#include <set>
#include <string>
#include <tuple>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/program_version.hpp"
#include "problems/files/atomic_file.hpp"

namespace graybox::bench {
namespace {

using nlohmann::json;

auto point_of(const RunRow& row) {
  return std::make_tuple(row.key.experiment, row.family, row.candidates, row.key.solver,
                         row.key.duality_gap);
}
auto point_of(const SkipRow& row) {
  return std::make_tuple(row.experiment, row.family, row.candidates, row.solver, row.duality_gap);
}

// What no run can be: what was written by hand, or damaged so that it still parses.
bool is_possible(const RunRow& row) {
  constexpr std::size_t kMost = std::numeric_limits<std::ptrdiff_t>::max();  // not of a minus sign
  return row.candidates > 0 && row.candidates <= kMost && row.dimension > 0 &&
         row.dimension <= kMost && row.seconds >= 0.0 && row.wall_seconds >= 0.0 &&
         row.process_seconds >= 0.0 && row.key.duality_gap > 0.0 && row.key.repetition >= 0;
}

// False for a line that is no row.
bool read_row(const std::string& line, StudyRows& rows) {
  const json row = json::parse(line, nullptr, false);
  if (row.is_discarded() || !row.is_object()) return false;
  try {
    const std::string kind = row.value("kind", std::string());
    if (kind == "run") {
      RunRow run = row.get<RunRow>();
      if (!is_possible(run)) return false;
      rows.runs.push_back(std::move(run));
    } else if (kind == "skip") {
      rows.skips.push_back(row.get<SkipRow>());
    } else if (kind == "environment") {
      rows.environments.push_back(row);
    } else {
      return false;
    }
  } catch (const std::exception&) {
    return false;
  }
  return true;
}

}  // namespace

StudyRows read_rows(const std::filesystem::path& file) {
  StudyRows rows;
  std::ifstream stream(file);
  std::size_t number = 0;
  for (std::string line; std::getline(stream, line);) {
    ++number;
    if (line.empty() || read_row(line, rows)) continue;
    if (rows.unreadable++ == 0) rows.first_unreadable = number;
  }
  using Point = decltype(point_of(std::declval<RunRow>()));
  std::set<Point> seen;
  for (const RunRow& row : rows.runs) seen.insert(point_of(row));
  // Of several skips of one point (from interrupted studies) the last one stands.
  std::vector<SkipRow> kept;
  for (auto row = rows.skips.rbegin(); row != rows.skips.rend(); ++row) {
    if (seen.insert(point_of(*row)).second) kept.push_back(*row);
  }
  rows.skips.assign(kept.rbegin(), kept.rend());
  return rows;
}

std::string unreadable_note(const StudyRows& rows, const std::string& file) {
  if (rows.unreadable == 0) return {};
  if (rows.unreadable == 1) {
    return fmt::format("{}: line {} is no row of a study and is left out", file,
                       rows.first_unreadable);
  }
  return fmt::format("{}: {} lines are no rows of a study (the first: line {}) and are left out",
                     file, rows.unreadable, rows.first_unreadable);
}

RowFile::RowFile(std::filesystem::path file) : path_(std::move(file)) {
  descriptor_ = open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (descriptor_ < 0) {
    throw InputError(fmt::format("{}: can't be written: {}", path_.string(), std::strerror(errno)));
  }
  off_t end = lseek(descriptor_, 0, SEEK_END);
  for (char last = 0; end > 0; --end) {
    if (pread(descriptor_, &last, 1, end - 1) != 1 || last == '\n') break;
  }
  if (ftruncate(descriptor_, end) != 0 || lseek(descriptor_, end, SEEK_SET) != end) {
    throw InputError(fmt::format("{}: a torn last line can't be cut off: {}", path_.string(),
                                 std::strerror(errno)));
  }
}

RowFile::~RowFile() {
  if (descriptor_ >= 0) close(descriptor_);
}

void RowFile::append(json row) {
  row["written_by"] = written_by();
  const std::string line = row.dump(-1, ' ', false, json::error_handler_t::replace) + "\n";
  for (std::size_t done = 0; done < line.size();) {
    const ssize_t count = write(descriptor_, line.data() + done, line.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) {
      throw InputError(
          fmt::format("{}: can't be written: {}", path_.string(), std::strerror(errno)));
    }
    done += static_cast<std::size_t>(count);
  }
  fdatasync(descriptor_);
}

void divide_rows(const std::filesystem::path& file, const std::filesystem::path& rest,
                 const std::function<bool(const json&)>& keep) {
  std::ifstream stream(file);
  std::string kept, others;
  bool all = true;
  for (std::string line; std::getline(stream, line);) {
    const json row = json::parse(line, nullptr, false);
    const bool is_row = !row.is_discarded();
    const bool stays = is_row && keep(row);
    all = all && stays;
    if (stays) kept += line + "\n";
    if (is_row && !stays) others += line + "\n";
  }
  if (all) return;
  // First the rest, so that a run that is killed here loses no row.
  if (!(std::ofstream(rest, std::ios::app) << others).flush()) {
    throw InputError(fmt::format("{}: can't be written; is the disk full?", rest.string()));
  }
  write_text_file(file.string(), kept);
}

}  // namespace graybox::bench
