// What a fit leaves of each measured force, in percent of what was measured there (NRMSE). The
// recordings fitted and those kept out are told apart. Part of it follows from its own past.
#pragma once

#include <vector>

#include "diagnosis/force_balance/balance_fitter.hpp"
#include "diagnosis/force_balance_data/force_balance_data.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"

namespace graybox {

// Root mean square of what follows from its own past, over all forces.
[[nodiscard]] double autocorrelated_error(const BalanceFitter& fitter, const ForceBalanceData& data,
                                          const ExtendedFit& fit);

[[nodiscard]] std::vector<ChannelRest> balance_rests(const BalanceFitter& fitter,
                                                     const ForceBalanceData& data,
                                                     const ExtendedFit& fit);

}  // namespace graybox
