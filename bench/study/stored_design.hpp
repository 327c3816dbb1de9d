// The design behind a row of the study, kept so that anybody can compute its gap again.
//
// Up to kLongestSupport weights stand in the row. More go to a side file beside the rows,
// designs/HASH.npy, a NumPy array [Q x 1] of all weights, HASH being the SHA-256 of their bytes:
// equal designs share one file, and a changed one is found.
//
//   "design": {"support": [[41, 0.25], [77, 0.75]]}
//   "design": {"file": "designs/5b1c...e0.npy"}
#pragma once

#include <cstddef>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

#include "solvers/core/design.hpp"

namespace graybox::bench {

inline constexpr std::size_t kLongestSupport = 64;

// Exactly what the solver handed over: also weights that are no design.
struct StoredDesign {
  std::vector<std::pair<std::size_t, double>> support;  // index and weight, all weights but zeros
  std::string file;  // or else the side file, from the rows' folder

  [[nodiscard]] bool any() const { return !support.empty() || !file.empty(); }
};

void to_json(nlohmann::json& json, const StoredDesign& design);  // not a number is null
void from_json(const nlohmann::json& json, StoredDesign& design);

// Writes the side file where there is to be one and it is not there. `folder` is that of the rows.
// Throws InputError if it can't be written.
[[nodiscard]] StoredDesign store_design(const Design& design, const std::filesystem::path& folder);

// The design again. Throws InputError for a side file that is missing or does not have its hash,
// and for an index that is no candidate's.
[[nodiscard]] Design stored_design(const StoredDesign& stored, std::size_t candidates,
                                   const std::filesystem::path& folder);

}  // namespace graybox::bench
