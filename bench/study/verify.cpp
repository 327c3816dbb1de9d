#include "bench/study/verify.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "bench/study/own_sets.hpp"
#include "bench/study/row_file.hpp"
#include "bench/study/study_sets.hpp"
#include "bench/study/tables.hpp"
#include "problems/base/error.hpp"
#include "problems/files/input_file.hpp"

namespace graybox::bench {
namespace {

namespace fs = std::filesystem;
using SetMaker = std::function<InformationSet(const std::string&, std::size_t)>;

constexpr double kLogDetTolerance = 1e-12;  // times d + |log det M|
constexpr double kLongDouble = 1e-14;       // of 1 + gap, where the bounds are smaller still

std::string name_of(const RunRow& row) {
  return fmt::format("{} Q = {}, {}, gap {:.0e}, run {}", row.family, row.candidates,
                     row.key.solver, row.key.duality_gap, row.key.repetition + 1);
}

// The file of an own set: where it was, or as it was named from here.
std::string file_of(const RunRow& row) {
  return fs::exists(row.origin.path) ? row.origin.path : row.family;
}

// Throws InputError where the set can't be made again.
InformationSet set_of(const RunRow& row, const SetMaker& make_set) {
  const SetOrigin& origin = row.origin;
  if (origin.path.empty() && !is_study_set(origin.generator, row.candidates)) {
    throw InputError(fmt::format("{} Q = {}: is no set of the study", row.family, row.candidates));
  }
  const std::uint64_t seed = study_set_seed(origin.generator);
  if (origin.path.empty() && origin.seed != seed) {
    throw InputError(fmt::format("{}: this build makes it with the seed {} alone, not {}",
                                 row.family, seed, origin.seed));
  }
  InformationSet set = origin.path.empty() ? make_set(origin.generator, row.candidates)
                                           : read_own_set(file_of(row)).set;
  if (const std::string hash = set.content_hash(); hash != row.key.problem) {
    throw InputError(
        fmt::format("{} Q = {}: is now another set; its hash starts {:.12}, in the "
                    "rows {:.12}",
                    row.family, row.candidates, hash, row.key.problem));
  }
  return set;
}

// Ended by the fence: what was left then is charged as it is.
bool was_stopped(ReportStatus status) {
  return status == ReportStatus::kTimeLimit || status == ReportStatus::kOutOfMemory ||
         status == ReportStatus::kCrashed;
}

bool same_gap(const RunRow& row, const Certificate& found) {
  const bool certified = found.status == CertificateStatus::kCertified;
  if (!certified || !std::isfinite(row.duality_gap)) {
    return certified == std::isfinite(row.duality_gap);
  }
  // A row can't make room for a false gap by stating a wide bound.
  const double stated = std::min(row.rounding_bound, 10.0 * found.rounding_bound);
  const double room =
      found.rounding_bound + std::max(stated, kLongDouble * (1.0 + std::abs(found.duality_gap)));
  return std::abs(row.duality_gap - found.duality_gap) <= room;
}

bool same_log_det(const RunRow& row, const Certificate& found) {
  if (found.status != CertificateStatus::kCertified) return true;
  const double scale = static_cast<double>(row.dimension) + std::abs(found.log_det);
  return std::abs(row.log_det - found.log_det) <= kLogDetTolerance * scale;
}

// What is false about a row; nothing if it is true.
std::optional<std::string> falsehood(const RunRow& row, const InformationSet& set,
                                     const fs::path& folder) {
  Certificate found;
  try {
    found = certify(set, stored_design(row.design, set.candidate_count(), folder), Criterion(),
                    row.key.duality_gap);
  } catch (const InputError& error) {
    return error.what();
  }
  const std::string gap = found.status == CertificateStatus::kCertified
                              ? fmt::format("a gap of {:.3g}", found.duality_gap)
                              : fmt::format("none ({})", found.message);
  if (!same_gap(row, found)) {
    return fmt::format("states a gap of {:.3g}, the checker finds {}", row.duality_gap, gap);
  }
  if (!same_log_det(row, found)) {
    return fmt::format("states log det M = {:.12g}, the checker finds {:.12g}", row.log_det,
                       found.log_det);
  }
  if (found.status == CertificateStatus::kCertified && row.support_size != found.support_size) {
    return fmt::format("states a support of {}, the design has {}", row.support_size,
                       found.support_size);
  }
  const ReportStatus status = judge(solve_status(row.claimed), row.key.duality_gap, found);
  if (status != row.status && !was_stopped(row.status)) {
    return fmt::format("is called {}, but is {} with {}", to_string(row.status), to_string(status),
                       gap);
  }
  return std::nullopt;
}

// Rows with a design of one set.
using SetRows = std::vector<const RunRow*>;

std::vector<SetRows> rows_by_set(const std::vector<RunRow>& runs, RowVerification& found) {
  std::map<std::pair<std::string, std::string>, std::size_t> places;
  std::vector<SetRows> sets;
  for (const RunRow& row : runs) {
    if (!row.design.any()) {
      ++(std::isfinite(row.duality_gap) ? found.without_design : found.without_answer);
      continue;
    }
    const auto [place, is_new] = places.try_emplace({row.family, row.key.problem}, sets.size());
    if (is_new) sets.emplace_back();
    sets[place->second].push_back(&row);
  }
  return sets;
}

}  // namespace

RowVerification verify_rows(const fs::path& file, const SetMaker& make_set,
                            const std::function<bool()>& interrupted) {
  { const InputFile present(file.string()); }  // missing, a folder, empty
  const StudyRows rows = read_rows(file);
  RowVerification found;
  found.unreadable = rows.unreadable;
  for (const SetRows& of_set : rows_by_set(rows.runs, found)) {
    try {
      const InformationSet set = set_of(*of_set.front(), make_set);
      for (const RunRow* row : of_set) {
        if (interrupted && interrupted()) return found;
        const auto what = falsehood(*row, set, file.parent_path());
        ++(what ? found.false_rows : found.verified);
        if (what) found.lines.push_back(fmt::format("{}: {}", name_of(*row), *what));
      }
    } catch (const InputError& error) {
      found.without_set += of_set.size();
      found.lines.push_back(
          fmt::format("{}; {} rows can't be verified", error.what(), of_set.size()));
    }
  }
  return found;
}

std::string describe(const RowVerification& found) {
  std::string line =
      fmt::format("{} verified, {} false", counted(found.verified, "row"), found.false_rows);
  const auto add = [&](std::size_t count, const char* one, const char* several) {
    if (count > 0) line += fmt::format("; {} {}", count, count == 1 ? one : several);
  };
  add(found.without_set, "not verifiable: its set can't be made again",
      "not verifiable: their sets can't be made again");
  add(found.without_design, "not verifiable: a row of an earlier release holds no design",
      "not verifiable: rows of an earlier release hold no designs");
  add(found.without_answer, "run left no design and claims nothing",
      "runs left no design and claim nothing");
  add(found.unreadable, "line is no row", "lines are no rows");
  return line;
}

}  // namespace graybox::bench
