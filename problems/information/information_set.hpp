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
// Factor form. Where H_i = F_i^T F_i with F_i of k rows, a set may hold the factors instead: k d
// numbers a candidate in place of p. Rank one is k = 1: H_i = f_i f_i^T.
//
//   graybox::AlignedArray factors(2 * 1 * 2);            // Q = 2, k = 1, d = 2
//   std::ranges::copy(std::array{1., 0., 1., 1.}, factors.begin());
//   const auto lines = graybox::InformationSet::of_factors(2, 1, std::move(factors));
//   lines.packed(1, row);                                // 1, 1, 1
//
// What works on factors asks for them: column_generation under criterion D, the checker under D,
// validation, the formats. Everything else asks for matrices, with data() or information(). The
// first to do so has all of them made: Q p numbers more, from then on kept. Where they do not fit
// into memory, it throws InputError.
//
// A set is immutable after construction; solvers take it by const reference. Several threads may.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
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

// What a set holds.
enum class SetForm : std::int8_t { kMatrices, kFactors };

class InformationSet {
 public:
  // information.size() must be a multiple of p; throws InputError otherwise, and where the
  // candidate table or the parameter names do not fit Q or d.
  InformationSet(std::size_t dimension, AlignedArray information, CandidateTable candidates = {},
                 std::vector<std::string> parameters = {}, std::string name = {});
  // factors: Q matrices F_i of `rank` rows and `dimension` columns, each row-major, one after the
  // other. Throws as above.
  [[nodiscard]] static InformationSet of_factors(std::size_t dimension, std::size_t rank,
                                                 AlignedArray factors,
                                                 CandidateTable candidates = {},
                                                 std::vector<std::string> parameters = {},
                                                 std::string name = {});

  [[nodiscard]] std::size_t candidate_count() const { return candidate_count_; }  // Q
  [[nodiscard]] std::size_t dimension() const { return dimension_; }              // d
  [[nodiscard]] std::size_t packed_size() const { return packed_size_; }          // p
  // Of the numbers that are held: what one pass over the set reads.
  [[nodiscard]] std::size_t bytes() const { return numbers_.size() * sizeof(double); }

  // All packed matrices, and the one of a candidate. In factor form the first call makes them all.
  [[nodiscard]] const double* data() const {
    return rank_ == 0 ? numbers_.data() : expanded_data();
  }
  [[nodiscard]] std::span<const double> information(std::size_t candidate) const {
    return {data() + candidate * packed_size_, packed_size_};
  }
  // The packed matrix of one candidate, in either form: where it lies, or made in `buffer` of p
  // numbers.
  [[nodiscard]] std::span<const double> packed(std::size_t candidate,
                                               std::span<double> buffer) const;

  [[nodiscard]] bool has_factors() const { return rank_ > 0; }
  [[nodiscard]] std::size_t rank() const { return rank_; }  // k; 0 where matrices are held
  [[nodiscard]] bool has_matrices() const;                  // held, or made since
  // In factor form alone: all factors, and the k d numbers of a candidate.
  [[nodiscard]] const double* factors() const { return numbers_.data(); }
  [[nodiscard]] std::span<const double> factor(std::size_t candidate) const {
    return {numbers_.data() + candidate * rank_ * dimension_, rank_ * dimension_};
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
  // The same in either form, for it names the problem. One pass over the data; in factor form the
  // matrices are made a few at a time. Kept, unless somebody else owns the numbers.
  [[nodiscard]] std::string content_hash() const;

  // The candidates listed, in that order. Throws InputError for an index >= Q.
  [[nodiscard]] InformationSet subset(std::span<const std::size_t> indices) const;

  // Throws InputError naming the first candidate that is not finite or not positive semidefinite
  // (an eigenvalue below -1e-9 times the largest), or if the sum of all H_i is singular so that no
  // design is regular. Cost O(Q d^3).
  void validate() const;

 private:
  struct Derived;  // what is made once of the numbers, shared by copies
  InformationSet(std::size_t dimension, std::size_t rank, AlignedArray numbers,
                 CandidateTable candidates, std::vector<std::string> parameters, std::string name);
  [[nodiscard]] const double* expanded_data() const;
  [[nodiscard]] std::string computed_hash() const;
  [[nodiscard]] std::size_t numbers_each() const {
    return rank_ == 0 ? packed_size_ : rank_ * dimension_;
  }

  std::size_t dimension_;
  std::size_t packed_size_;
  std::size_t rank_;
  std::size_t candidate_count_;
  AlignedArray numbers_;
  std::shared_ptr<Derived> derived_;
  CandidateTable candidates_;
  std::vector<std::string> parameters_;
  std::string name_;
};

// The first `count` entries of one random permutation of 0 .. total-1 that depends on the seed
// alone: subsets of different sizes are nested, and the same for every back-end and machine.
[[nodiscard]] std::vector<std::size_t> nested_subset(std::size_t total, std::size_t count,
                                                     std::uint64_t seed);

}  // namespace graybox
