// InformationSet: Q candidate experiments, each with a symmetric positive semidefinite d x d
// information matrix H_i (paper, formula (5)). The matrices are packed lower triangles
// (packed_matrix.hpp), candidate after candidate, in one contiguous array of Q * p doubles,
// p = d (d + 1) / 2: the same bytes as a column-major p x Q array.
//
//   graybox::AlignedArray information(2 * 3);            // Q = 2, d = 2, p = 3
//   std::ranges::copy(std::array{1., 0., 0., 0., 0., 1.}, information.begin());
//   graybox::InformationSet set(2, std::move(information));
//   set.validate();                                      // throws InputError if it is no problem
//   assert(set.candidate_count() == 2);
//
// A set is immutable after construction; solvers take it by const reference.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "problems/base/aligned_array.hpp"

namespace graybox {

// Coordinates of the candidates: Q rows of n numbers, row-major, with a name and a unit for each
// of the n columns ("q1", "deg"). n = 0 where candidates have no coordinates.
struct CandidateTable {
  std::vector<std::string> names;
  std::vector<std::string> units;
  std::vector<double> values;
};

class InformationSet {
 public:
  // information.size() must be a multiple of p; throws InputError otherwise, and where the
  // candidate table or the parameter names do not fit Q or d.
  InformationSet(std::size_t dimension, AlignedArray information, CandidateTable candidates = {},
                 std::vector<std::string> parameters = {}, std::string name = {});

  [[nodiscard]] std::size_t candidate_count() const { return candidate_count_; }  // Q
  [[nodiscard]] std::size_t dimension() const { return dimension_; }              // d
  [[nodiscard]] std::size_t packed_size() const { return packed_size_; }          // p
  [[nodiscard]] std::size_t bytes() const { return information_.size() * sizeof(double); }
  [[nodiscard]] const double* data() const { return information_.data(); }
  [[nodiscard]] std::span<const double> information(std::size_t candidate) const {
    return {information_.data() + candidate * packed_size_, packed_size_};
  }
  [[nodiscard]] const CandidateTable& candidates() const { return candidates_; }
  [[nodiscard]] std::span<const double> coordinates(std::size_t candidate) const;
  [[nodiscard]] const std::vector<std::string>& parameters() const { return parameters_; }
  [[nodiscard]] const std::string& name() const { return name_; }  // for messages; a path or family
  [[nodiscard]] InformationSet renamed(std::string name) && {
    name_ = std::move(name);
    return std::move(*this);
  }

  // SHA-256, in hexadecimal, of Q and d as little-endian uint64 followed by the packed doubles.
  // One pass over the data.
  [[nodiscard]] std::string content_hash() const;

  // The candidates listed, in that order. Throws InputError for an index >= Q.
  [[nodiscard]] InformationSet subset(std::span<const std::size_t> indices) const;

  // Throws InputError naming the first candidate that is not finite or not positive semidefinite
  // (an eigenvalue below -1e-9 times the largest), or if the sum of all H_i is singular so that no
  // design is regular. Cost O(Q d^3).
  void validate() const;

 private:
  std::size_t dimension_;
  std::size_t packed_size_;
  std::size_t candidate_count_;
  AlignedArray information_;
  CandidateTable candidates_;
  std::vector<std::string> parameters_;
  std::string name_;
};

// The first `count` entries of one random permutation of 0 .. total-1 that depends on the seed
// alone: subsets of different sizes are nested, and the same for every back-end and machine.
[[nodiscard]] std::vector<std::size_t> nested_subset(std::size_t total, std::size_t count,
                                                     std::uint64_t seed);

}  // namespace graybox
