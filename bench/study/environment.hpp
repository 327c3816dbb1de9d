// Where and with what a study ran: recorded at each start, before its rows.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "bench/study/plan.hpp"

namespace graybox::bench {

// Processor, caches, memory, system, compiler, flags, library versions, vector width of the
// kernels, commit, load, date. Whatever can't be found out is an empty string.
[[nodiscard]] nlohmann::json describe_environment();

// The environment with the solvers that are not here, in the field `absent`; and those of a row.
[[nodiscard]] nlohmann::json describe_environment(const std::vector<AbsentSolver>& absent);
[[nodiscard]] std::vector<AbsentSolver> absent_solvers(const nlohmann::json& environment);

// What describe_environment() found of `key`, for a reader: "L1 32K, L2 512K", "25.3 GB".
[[nodiscard]] std::string environment_words(const nlohmann::json& environment,
                                            const std::string& key);

// SHA-256 of the running program, shortened: two runs are comparable only if it is the same.
[[nodiscard]] std::string program_hash();

// The hash of the files that a command line names: its words, without quotes, that are files. It is
// empty where none is. A program that is found on PATH, and files that files include, are not among
// them.
[[nodiscard]] std::string files_hash(const std::string& command);

// The commit of the working folder; a final "+" marks changes that are not committed. Empty outside
// one.
[[nodiscard]] std::string current_commit();

[[nodiscard]] double load_average();  // over one minute; 0 where unknown
[[nodiscard]] std::string utc_now();  // "2026-01-31T12:00:00Z"

}  // namespace graybox::bench
