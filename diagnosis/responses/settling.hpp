// Whether a periodic recording has settled: is its first period like the second?
//
// Where only noise differs, d(t) = x(t + N) - x(t) is stationary over t < N; a transient that dies
// makes it larger at the beginning. The mean squares of the first and the last quarter are
// compared,
//
//   F = m_1 / m_4 ~ F(n_e, n_e), about,    n_e = (N/4) / (1 + 2 sum_tau rho(tau)^2),
//
// rho the autocorrelation of d over its second half: as many independent values as a coloured
// signal has for its power (Bartlett 1946).
#pragma once

#include <Eigen/Core>
#include <cstddef>

namespace graybox {

// P-value; `signal` holds at least two periods. 1 where d vanishes but for rounding.
[[nodiscard]] double settling_p_value(const Eigen::Ref<const Eigen::VectorXd>& signal,
                                      std::size_t period);

}  // namespace graybox
