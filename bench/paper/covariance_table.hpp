// Table I of the paper: the positions of a design, each with the covariance it would give alone,
// and the candidates whose covariance alone is the least, the median and the largest.
//
// Covariance is the geometric mean (det H^-1)^(1/d) of the eigenvalues of H^-1, in units of the
// design's own, (det M^-1)^(1/d) with M = sum_i lambda_i H_i, which is 1 (paper, Section VI-D).
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/core/design.hpp"

namespace graybox::bench {

// (det H_i^-1)^(1/d) of each candidate; infinite where H_i is not numerically positive definite.
// Cost O(Q d^3).
[[nodiscard]] std::vector<double> single_candidate_covariances(const InformationSet& set);

// (det M^-1)^(1/d) of a design. Throws InputError if M is singular.
[[nodiscard]] double design_covariance(const InformationSet& set, const Design& design);

struct CovarianceRow {
  enum class Kind { kSupport, kMinimum, kMedian, kMaximum };
  Kind kind = Kind::kSupport;
  std::size_t candidate = 0;
  double covariance = 0.0;  // alone, relative to the design's
  double weight = 0.0;      // in the design
};

struct CovarianceTable {
  double design_covariance = 0.0;   // in the set's own units
  std::vector<CovarianceRow> rows;  // support in the order of candidates, then min, median, max
};

// The median of an even number of candidates is the lower of the two in the middle. Throws
// InputError if the design does not fit the set or is singular.
[[nodiscard]] CovarianceTable covariance_table(const InformationSet& set, const Design& design);

// Columns: row ("1", "2", ..., "Min", "Med", "Max"), candidate, its coordinates, covariance,
// weight.
[[nodiscard]] std::string to_csv(const InformationSet& set, const CovarianceTable& table);

}  // namespace graybox::bench
