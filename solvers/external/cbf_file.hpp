// The D-optimal problem of a set as a file that conic solvers read: the Conic Benchmark Format,
// version 4 (Friberg, cblib.zib.de), which Mosek, SCIP-SDP and others take.
//
//   maximise    t_1 + ... + t_d                                                       (= log det M)
//   subject to  lambda >= 0,  sum_q lambda_q = 1
//               Z_jj >= exp(t_j),                            j = 1 .. d
//               ( sum_q lambda_q H_q   Z       )
//               ( Z'                   diag(Z) )  >= 0,      Z lower triangular
//
// The last block says that M - Z diag(Z)^-1 Z' >= 0. So det M is at least the product of the Z_jj.
// With M = L D L' and Z = L D the two are equal, so that the optimal value is log det M of the
// optimal design. Variables are, in this order, the Q weights, the d numbers t, and Z by rows.
//
// The matrices are written as they are: a set whose parameters differ by orders of magnitude is
// better scaled first. Zeros are not written. Cost: a line of text for each number of the set.
#pragma once

#include <string>

#include "problems/information/information_set.hpp"

namespace graybox {

// Writes the file in full or not at all. Throws InputError if it can't be written.
void write_cbf(const std::string& path, const InformationSet& set);

}  // namespace graybox
