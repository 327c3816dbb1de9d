// Experiments that tell rival models apart: T-optimality (Atkinson and Fedorov, Biometrika 62,
// 1975; for several rivals Atkinson and Fedorov, Biometrika 62, 1975, p. 289).
//
// One model is taken for true and predicts y_i at candidate i, in units of the noise. Rival k is
// linear in its own parameters, f_ki(theta) = o_ki + J_ki theta, or linearised. However well it is
// fitted to the experiments of a design lambda, the misfit
//
//   T_k(lambda) = min over theta of  sum_i lambda_i |y_i - f_ki(theta)|^2
//
// is left, and N T_k is the non-centrality of the test against rival k after N experiments. The
// design makes min_k T_k as large as possible.
//
// With s the factor of the column y_i - o_ki beside J_ki, and M_k the information matrix of
// (theta, s), T_k is the Schur complement 1/[M_k^-1]_ss. With all blocks M_k on the diagonal of
// one information matrix, the largest of the [M^-1]_ss is what is to be small: criterion G over the
// unit vectors of the s (criterion.hpp), for one rival Ds. So no solver and no certificate is of
// its own here: a gap g says that no design has a min_k T_k above 1 + g times this one's.
//
//   DiscriminationProblem p = discrimination_problem(truth, {line}, noise);
//   column_generation.solve(p.set, {.criterion = p.criterion({})});
//
// Cost: matrices of sum_k (d_k + 1) parameters.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "problems/information/information_set.hpp"
#include "problems/information/jacobian_information.hpp"
#include "solvers/core/criterion.hpp"
#include "solvers/core/design.hpp"

namespace graybox {

struct DiscriminationProblem {
  InformationSet set;               // (theta, s) of rival 1, of rival 2, ...
  std::vector<std::string> rivals;  // their names
  std::vector<std::size_t> misfit;  // where the s stand

  // Maximise min_k T_k / scale_k; all scales are 1 where there are none. One rival: Ds.
  [[nodiscard]] Criterion criterion(std::span<const double> scales) const;
  // T_k alone.
  [[nodiscard]] Criterion criterion_of(std::size_t rival) const;
};

// `truth`: one column, y. `rivals`: columns J; one that is called "prediction" is o. Throws
// InputError where candidates or outputs differ, where a rival's parameters can't be estimated from
// all candidates together, and where a rival can predict all of y.
[[nodiscard]] DiscriminationProblem discrimination_problem(const Jacobians& truth,
                                                           std::span<const Jacobians> rivals,
                                                           const JacobianNoise& noise,
                                                           CandidateTable candidates = {});

// All T_k of a design; zero where M is singular.
[[nodiscard]] std::vector<double> misfits(const DiscriminationProblem& problem,
                                          const Design& design);

}  // namespace graybox
