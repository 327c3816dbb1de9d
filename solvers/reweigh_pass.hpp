// ReweighPass: one multiplicative step in a single read of the data,
//
//   w_i = tr(M^-1 H_i),   lambda_i <- lambda_i w_i / d,   M <- sum_i lambda_i H_i (new weights).
//
// Since sum_i lambda_i w_i = tr(M^-1 M) = d, the weights normalise themselves. Candidates are
// worked on in blocks of fixed size whose partial sums are added in order: the result does not
// depend on the number of threads.
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

 private:
  std::size_t dimension_;
  int threads_;
  std::vector<double> partial_;  // one packed sum a block
};

}  // namespace graybox
