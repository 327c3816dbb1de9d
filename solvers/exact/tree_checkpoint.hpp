// The state of a branch-and-bound run, and its file: CBOR (RFC 8949) with the keys
//
//   format "graybox-exact-checkpoint/1", problem_hash, experiments, gap, seed,
//   pool [candidate...], incumbent [[candidate, count]...], incumbent_log_det (pool coordinates),
//   given_up_bound, nodes, created, seconds, seconds_to_mark, newton_steps,
//   boxes [bytes...], open [[bound, number, box, entry, lower, upper]...]
//
// Boxes are shared by the two halves of a branching and are stored once, 16 bytes an entry: member,
// lower and upper as 32-bit integers and start as float, little-endian. Written atomically.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/exact/exact_method.hpp"
#include "solvers/exact_bounds/node_relaxation.hpp"

namespace graybox {

struct TreeState {
  std::vector<std::size_t> pool;                                        // candidates
  std::vector<std::int64_t> incumbent;                                  // counts over the whole set
  double incumbent_log_det = -std::numeric_limits<double>::infinity();  // of sum m_i B_i
  double given_up_bound = -std::numeric_limits<double>::infinity();     // likewise
  std::int64_t nodes = 0;                                               // processed
  std::int64_t created = 0;                                             // numbers given out
  double seconds = 0.0;
  double seconds_to_mark = std::numeric_limits<double>::infinity();
  std::int64_t newton_steps = 0;
  std::vector<TreeNode> open;
};

void write_checkpoint(const std::string& path, const InformationSet& set,
                      const ExactOptions& options, const TreeState& state);

// Throws InputError, naming file and fix, where the file is missing, damaged, or of another set, M,
// gap or seed.
[[nodiscard]] TreeState read_checkpoint(const std::string& path, const InformationSet& set,
                                        const ExactOptions& options);

}  // namespace graybox
