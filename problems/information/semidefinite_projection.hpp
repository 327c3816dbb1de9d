// Information sets whose matrices are semidefinite only to the precision in which they were made:
// stored in single precision, or formed by finite differences. Rounding to single precision moves
// eigenvalues by up to 6e-8 sqrt(d) of the largest, which leaves a rank-deficient matrix with
// negative ones.
//
// A matrix whose smallest eigenvalue lies between -tolerance and -1e-9 times its largest is
// replaced by the nearest positive semidefinite matrix in the Frobenius norm: its negative
// eigenvalues become zero (Higham 1988). The problem that is solved and certified is the one with
// these matrices, and so is its content hash. Computed in extended precision without vector
// instructions, so that every build of graybox finds the same bits.
//
//   const ProjectedSet accepted = project_semidefinite(read_information_set(file));
//   if (accepted.changed.candidates > 0) print(describe(accepted.changed));
//
// Cost as InformationSet::validate().
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "problems/information/information_set.hpp"

namespace graybox {

// Accepts what single precision leaves up to d = 250.
inline constexpr double kDefaultSemidefiniteTolerance = 1e-6;
inline constexpr double kLargestSemidefiniteTolerance = 1e-2;

struct SemidefiniteChange {
  std::size_t candidates = 0;        // matrices that were replaced
  std::size_t worst_candidate = 0;   // the one with the smallest eigenvalue,
  double smallest_eigenvalue = 0.0;  // relative to the largest of its matrix; at most zero
};

struct ProjectedSet {
  InformationSet set;
  SemidefiniteChange changed;
};

// Whether a set may be one that leaves some parameter combination without any information. It is no
// problem by itself; earlier trials can make it one.
enum class SingularSum : std::int8_t { kRefused, kAllowed };

// Throws InputError for a tolerance outside [1e-9, 1e-2], for a matrix with an eigenvalue below
// -tolerance times its largest, and otherwise as InformationSet::validate().
[[nodiscard]] ProjectedSet project_semidefinite(InformationSet set,
                                                double tolerance = kDefaultSemidefiniteTolerance,
                                                SingularSum singular_sum = SingularSum::kRefused);

// One line without full stop: "12 matrices were made positive semidefinite ...". Empty where none
// was.
[[nodiscard]] std::string describe(const SemidefiniteChange& change);

}  // namespace graybox
