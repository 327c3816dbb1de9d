// The linear maps of one step of the exponential Runge-Kutta method of fourth order of Cox and
// Matthews (J. Comput. Phys. 176, 2002, eqs. (26) to (29)) for y' = A y + N(y, t):
//
//   a = e^(Ah/2) y + (h/2) phi_1(Ah/2) N(y)         b = e^(Ah/2) y + (h/2) phi_1(Ah/2) N(a)
//   c = e^(Ah/2) a + (h/2) phi_1(Ah/2) (2 N(b) - N(y))
//   y+ = e^(Ah) y + F1 N(y) + F2 (N(a) + N(b)) + F3 N(c)
//   F1 = h (phi_1 - 3 phi_2 + 4 phi_3),  F2 = h (2 phi_2 - 4 phi_3),
//   F3 = h (4 phi_3 - phi_2),  at Ah.
//
// For A = 0 it is the classical Runge-Kutta method; for N linear in t and free of y it is exact.
//
// Sensitivities. With S = dy/dtheta, (y, S) obeys the same kind of equation with the matrix [A 0;
// dA/dtheta A], whose functions have the blocks f(A) and df(A)/dtheta. The step taken for it is
// therefore the exact derivative of the step taken for y: no inconsistency between the simulated
// output and its slopes, at any h. All phi_k and their derivatives come from the exponential of one
// block matrix (Van Loan 1978; Al-Mohy and Higham 2011, Theorem 2.1).
#pragma once

#include <Eigen/Core>
#include <vector>

namespace graybox {

struct ExponentialOperator {
  Eigen::MatrixXd matrix;
  std::vector<Eigen::MatrixXd> derivatives;  // by each parameter that A depends on
};

struct ExponentialOperators {
  ExponentialOperator half_flow, half_input;      // e^(Ah/2), (h/2) phi_1(Ah/2)
  ExponentialOperator flow, first, middle, last;  // e^(Ah), F1, F2, F3
};

// `derivatives`: dA by each parameter.
[[nodiscard]] ExponentialOperators exponential_operators(
    const Eigen::MatrixXd& a, const std::vector<Eigen::MatrixXd>& derivatives, double step);

}  // namespace graybox
