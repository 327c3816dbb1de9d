// ReweighPass: one multiplicative step in a single read of the data,
//
//   w_i = tr(M^-1 H_i),   lambda_i <- lambda_i w_i / d,   M <- sum_i lambda_i H_i (new weights).
//
// or with the exponent 1/2 that other criteria take, w_i = tr(G H_i),
//
//   lambda_i <- lambda_i sqrt(w_i) / sum_j lambda_j sqrt(w_j),   M <- sum_i lambda_i H_i.
//
// Since sum_i lambda_i w_i = tr(M^-1 M) = d, the weights of the former normalise themselves.
// Candidates are worked on in blocks of fixed size whose partial sums are added in order: the
// result does not depend on the number of threads.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace graybox {

class ReweighPass {
 public:
  ReweighPass(std::size_t dimension, int threads) : dimension_(dimension), threads_(threads) {}

  // data: weights.size() packed matrices. Writes the sensitivities w, the new weights and the new
  // M.
  void run(const double* data, std::span<const double> trace_dual, std::span<double> weights,
           std::span<double> sensitivities, std::span<double> information);
  // The same with the exponent 1/2, G in trace-dual packing.
  void run_root(const double* data, std::span<const double> trace_dual, std::span<double> weights,
                std::span<double> sensitivities, std::span<double> information);

 private:
  void add_partial_sums(std::span<double> information) const;

  std::size_t dimension_;
  int threads_;
  std::vector<double> partial_;  // one packed sum a block
};

}  // namespace graybox
