// The bound that any multipliers give on a linear function over the designs of
// design_constraints.hpp. With y_j >= 0 where row j has no lower bound, y_j <= 0 where it has no
// upper one, and r_i = g_i - sum_j a_ji y_j, weak duality of linear programmes says for each x that
// obeys the constraints
//
//   sum_i g_i x_i <= sum_j max(y_j L_j, y_j U_j) + sum_i max(r_i l_i, r_i u_i).              (1)
//
// Where u_i is infinite, r_i must not be positive: y_0 is raised until none is, which costs little
// where y is nearly optimal. From then on u_i = U_0 / a_0i, which row 0 implies, stands in for
// infinity. Any y gives a bound, so nobody needs to be trusted for it. Each r_i is taken at the
// upper end of what rounding leaves of it.
//
// Cost: Q m.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "solvers/constrained/design_constraints.hpp"

namespace graybox {

template <class Real>
struct MultiplierBound {
  Real value = 0;
  Real rounding = 0;              // the sum (1) is not above value + rounding
  std::vector<Real> multipliers;  // y as used
  std::size_t best = 0;           // position of the largest r_i
};

// `gains`: g_i of the candidates listed in `candidates`, of all where that is empty; those that are
// not listed are taken to have x_i = l_i = 0. `reduced`, where not empty, receives r_i.
template <class Real>
[[nodiscard]] MultiplierBound<Real> multiplier_bound(const DesignConstraints& constraints,
                                                     std::span<const std::size_t> candidates,
                                                     std::span<const double> gains,
                                                     std::span<const double> multipliers,
                                                     std::span<double> reduced = {});

extern template MultiplierBound<double> multiplier_bound(const DesignConstraints&,
                                                         std::span<const std::size_t>,
                                                         std::span<const double>,
                                                         std::span<const double>,
                                                         std::span<double>);
extern template MultiplierBound<long double> multiplier_bound(const DesignConstraints&,
                                                              std::span<const std::size_t>,
                                                              std::span<const double>,
                                                              std::span<const double>,
                                                              std::span<double>);

}  // namespace graybox
