// Designs that are best under one criterion and keep others above a floor:
//
//   maximise  log Phi_0(M)   subject to   Phi_k(M) >= r_k Phi_k*,   k = 1 .. m,                 (1)
//
// with the information functions of certificate.hpp, Phi_k* the best of criterion k alone and
// shares 0 < r_k < 1: "at least 90 % A-efficient" is r = 0.9. Cook and Wong (JASA 89, 1994) show
// that the answer is that of a compound criterion, whose shares are the multipliers u_k >= 0.
//
// Certificate. With U = sum u_k, every design N that obeys (1) has
//
//   log Phi_0(N) <= log Phi_0(N) + sum_k u_k (log Phi_k(N) - b_k),      b_k = log r_k + log Phi_k*
//                <= log Phi_0(M) + sum_k u_k (log Phi_k(M) - b_k) + (1 + U) log(1 + g),
//
// g being the gap of M under the compound criterion of shares 1 and u_k (dual_bound.hpp). So
//
//   gap = exp((1 + U) log(1 + g) + sum_k u_k (log Phi_k(M) - b_k)) - 1.
//
// Phi_k* is not known, but the checker solves criterion k itself and has Phi_k* between two bounds.
// The lower one stands in b_k. The upper one is what M is held to, so that the floors hold for
// certain. Wrong multipliers only loosen the bound. G without a region is over the candidates.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/core/criterion.hpp"
#include "solvers/core/design.hpp"

namespace graybox {

struct EfficiencyFloor {
  double share = 0.0;  // r_k
  Criterion criterion;
  double multiplier = 0.0;  // u_k
};

// log Phi(M) of a design, in extended precision; minus infinity where M is singular.
struct LogPhi {
  double value = 0.0;
  double error = 0.0;  // at most
};
[[nodiscard]] LogPhi log_phi_of(const InformationSet& set, const Design& design,
                                const Criterion& criterion);

// Bounds of log Phi*, from a design that column_generation finds.
struct BestLogPhi {
  double least = 0.0;
  double most = 0.0;
};
[[nodiscard]] BestLogPhi best_log_phi(const InformationSet& set, const Criterion& criterion);

// Criterion 0 and the floors with their multipliers, as one; criterion 0 where all are zero.
[[nodiscard]] Criterion compound_of(const Criterion& objective,
                                    std::span<const EfficiencyFloor> floors);

// Throws InputError for a share that is not between 0 and 1, for a criterion that is compound or
// does not fit the set, and for E twice.
void require_fits(const Criterion& objective, std::span<const EfficiencyFloor> floors,
                  const InformationSet& set);

struct FlooredCertificate {
  Certificate certificate;           // of (1); a design below a floor is kNotADesign
  std::vector<double> efficiencies;  // Phi_k(M)/Phi_k*, at least; empty where M is singular
};
// Throws as require_fits(). `best`: of the floors, one each; found where empty.
[[nodiscard]] FlooredCertificate certify_floored(const InformationSet& set, const Design& design,
                                                 const Criterion& objective,
                                                 std::span<const EfficiencyFloor> floors,
                                                 double asked_gap = kFinestGap,
                                                 std::vector<BestLogPhi> best = {});

}  // namespace graybox
