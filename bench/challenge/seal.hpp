// The seal of a challenge: its truth is written before any recording, and the SHA-256 of its index
// (truth/index.json, which holds the SHA-256 of every case's truth) is published with the cases, in
// cases/challenge.json. Scoring refuses a truth that is not the one sealed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "bench/challenge/case_truth.hpp"

namespace graybox::bench {

// What is published with the cases: nothing that depends on the seed but the seal. A file without
// `set` is of the periodic one, here and in the index.
struct ChallengeHeader {
  std::size_t cases = 0;
  std::string truth_sha256;
  std::string set{kPeriodicSet};
};
// Where a challenge came from; sealed.
struct ChallengeOrigin {
  std::uint64_t seed = 0;
  std::string commit;  // whose SHA-256 the seed is; empty: the seed was given
  std::size_t cases = 0;
  std::string family;  // the only one; empty: all
  std::string set{kPeriodicSet};
};

// First 16 hexadecimal digits of the SHA-256 of the commit's name (40 digits, no newline).
[[nodiscard]] std::uint64_t seed_of_commit(const std::string& commit);

[[nodiscard]] std::filesystem::path truth_file(const std::filesystem::path& folder,
                                               const std::string& name);

// Writes truth/index.json of the files named and returns its SHA-256.
std::string seal_truth(const std::filesystem::path& folder, const ChallengeOrigin& origin,
                       const std::vector<std::string>& names);

void write_header(const std::filesystem::path& cases, const ChallengeHeader& header);
[[nodiscard]] ChallengeHeader read_header(const std::filesystem::path& cases);

struct UnsealedTruth {
  ChallengeOrigin origin;
  std::vector<CaseTruth> cases;
};
// Throws InputError if any file is not as it was sealed.
[[nodiscard]] UnsealedTruth unseal(const std::filesystem::path& folder,
                                   const ChallengeHeader& header);

}  // namespace graybox::bench
