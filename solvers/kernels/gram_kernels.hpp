// The two loops of the interior-point methods that do arithmetic rather than read memory, compiled
// for several vector widths and chosen once at run time. Each candidate's arithmetic is done in an
// order that is fixed for a given vector width. Results therefore do not depend on how the work is
// shared out among threads.
#pragma once

#include <cstddef>

namespace graybox {

struct GramKernels {
  // Lower triangle of gram (n x n, row-major, leading dimension n) += sum_i weights_i x_i x_i^T,
  // for `count` rows x_i of n numbers. Weights may have any sign. This call does the share `part`
  // of `parts` (whole rows of gram, dealt out in turn), so that threads can work on one result.
  // About count n^2 flops. workspace: gram_workspace_size(n) doubles, one for each thread.
  void (*gram)(const double* rows, std::size_t count, std::size_t n, const double* weights,
               std::size_t part, std::size_t parts, double* gram, double* workspace);

  // out_i = X H_i X^T for `count` packed symmetric d x d matrices H_i and a packed lower triangular
  // X (packed_matrix.hpp). About count (4/3) d^3 multiplications and additions. out may equal
  // matrices. workspace: congruence_workspace_size(d) doubles.
  void (*congruence)(const double* matrices, std::size_t count, std::size_t d, const double* x,
                     double* out, double* workspace);
};

[[nodiscard]] std::size_t gram_workspace_size(std::size_t n);
[[nodiscard]] std::size_t congruence_workspace_size(std::size_t d);

// The widest set this processor runs (problems/kernels/vector_width.hpp).
[[nodiscard]] const GramKernels& gram_kernels();

}  // namespace graybox
