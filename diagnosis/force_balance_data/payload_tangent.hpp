// The balance of forces about the payloads that a fit has found, where drives' gains are unknown.
//
// There a joint measures e_j = (bodies_j + m P_j) / g_j with P_j the force of a unit payload, which
// is no sum of columns: both m and 1/g_j are asked for. About m0, P0 and s0_j = 1/g_j it is one,
//
//     e_j + s0_j m0 P0_j = (bodies_j + m0 P0_j) / g_j + m s0_j P_j
//
// (Gauss and Newton). Where a payload outweighs the bodies, as at a wrist, fits that take gains and
// payload in turn run away from each other; this one does not. A joint whose bodies do not tell its
// gain has one from the payload: a column m0 P0_j of its own.
#pragma once

#include <span>
#include <vector>

#include "diagnosis/force_balance_data/force_balance_laws.hpp"

namespace graybox {

struct PayloadTangent {
  ForceBalanceRows rows;             // for a regression; further columns of the model at the end
  std::vector<Eigen::Index> loaded;  // the joints of these columns
};

// The rows with what `payloads` (with inverse_gains) carry in the columns of the gains.
[[nodiscard]] PayloadTangent about_payloads(const ForceBalanceData& data,
                                            std::span<const PlacedLaw> payloads);

// What 1/gain of each joint's drive changes: the payload's force without gains.
[[nodiscard]] BalanceColumns force_before_gains(const PlacedLaw& payload,
                                                const ForceBalanceData& data,
                                                const ForceBalanceRows& rows);

}  // namespace graybox
