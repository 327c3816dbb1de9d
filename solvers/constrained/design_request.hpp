// DesignRequest: what a user asks of the next experiments, in files and words, before it is put
// into numbers (design_constraints.hpp). One vocabulary for all commands: options of the command
// line, or
//
//   # request.yaml
//   format: graybox-request/1
//   experiments: 20                # how many come next; or a budget
//   prior: calibration.h5          # information that is there already: a set of one matrix
//   done: last_week.json           # what was run: a design with counts, or index,count
//   costs: minutes.csv             # one number a candidate, or the name of a coordinate
//   budget: 90                     # sum of the costs of what is run
//   stock: 1                       # each at most so often; or a file of Q numbers
//   require: 12:2, 40-45           # candidate_selection.hpp
//   forbid: q1 > 90 & q2 < 0
//   block_sizes: 4, 4, 4           # block_sizes.hpp
//   constraints:
//     - name: left side
//       candidates: q1 < 0
//       at_most: 30 %              # of all experiments; without % their number
//     - name: reconfigurations
//       coefficients: effort.csv   # one number a candidate, or the name of a coordinate
//       at_least: 5                # at_most, at_least, both, or equal
//
// Files are named relative to the file that names them. Files of one number a candidate are CSV
// with one column. A constraints file is the list above under `constraints:`, or CSV: one line a
// candidate, one column a constraint, whose head says name and bound, "left side <= 6" (<=, >=, =).
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/constrained/design_constraints.hpp"

namespace graybox {

// One entry of `constraints`, as written.
struct RequestedConstraint {
  std::string name;
  std::string candidates;    // a selection, or empty
  std::string coefficients;  // a file or a coordinate, or empty
  std::string at_most, at_least, equal;
};

// Numbers in place of files, from programs that have them in memory.
struct RequestedNumbers {
  std::vector<double> prior = {};              // packed lower triangle
  std::vector<double> done = {};               // how often each candidate was run, Q numbers
  std::vector<double> costs = {}, stock = {};  // Q numbers
  std::vector<LinearConstraint> rows = {};

  [[nodiscard]] bool any() const {
    return !(prior.empty() && done.empty() && costs.empty() && stock.empty() && rows.empty());
  }
};

struct DesignRequest {
  std::optional<double> experiments = {};
  std::optional<double> budget = {};
  std::string prior = {}, done = {}, costs = {}, stock = {}, require = {}, forbid = {};
  std::string block_sizes = {};
  std::string constraints_file = {};
  std::vector<RequestedConstraint> constraints = {};
  std::filesystem::path folder = {};  // that file names are relative to
  RequestedNumbers numbers = {};

  // Whether anything is asked for beyond the plain problem.
  [[nodiscard]] bool any() const;
  // How many come next, in all: as asked, or the sum of the blocks.
  [[nodiscard]] std::optional<double> number() const;
  // Whether there is information before the first experiment, so that a set may be singular.
  [[nodiscard]] bool has_prior() const;
};

// Throws InputError, naming line and field.
[[nodiscard]] DesignRequest read_design_request(const std::filesystem::path& path);

// In numbers, for this set. Without experiments and budget: shares of one, N = 1; then prior, done,
// stock and require, which are numbers, are refused. Throws InputError naming what does not fit.
[[nodiscard]] DesignConstraints resolve(const DesignRequest& request, const InformationSet& set);

// One line without full stop: "20 experiments, prior calibration.h5, stock 1, 2 constraints".
[[nodiscard]] std::string describe(const DesignRequest& request);

// SHA-256 of the numbers: whether a design was made for these constraints.
[[nodiscard]] std::string content_hash(const DesignConstraints& constraints);

// The object "request" of a design file: the request with file names relative to `folder`, its
// numbers under "numbers" with the names of RequestedNumbers, and `constraints_hash`. The inverse
// throws InputError.
[[nodiscard]] nlohmann::ordered_json to_json(const DesignRequest& request,
                                             const DesignConstraints& constraints,
                                             const std::filesystem::path& folder);
[[nodiscard]] DesignRequest design_request(const nlohmann::ordered_json& entry,
                                           const std::filesystem::path& folder);

}  // namespace graybox
