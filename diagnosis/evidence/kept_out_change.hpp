// What changed between the recordings of a fit and those kept out: sizes of the same model and laws
// that are others when those kept out are fitted by themselves.
//
// A change is told where that fit takes at least half of the squared error kept out. Named are
// sizes v that differ by more than kChangeErrors standard errors,
//
//   z = |v_k - v_f| / sqrt(s_k^2 + s_f^2) > 4.5,
//
// and by more than a tenth of the larger one. A law that only resembles what is there changes its
// size with the motion; so this says what differs, and not why.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/hypotheses/mismatch_problem.hpp"

namespace graybox {

inline constexpr double kChangeErrors = 4.5;

struct ChangedSize {
  std::optional<std::size_t> law;  // of the fit's, in its order; none: the model's own parameter
  LawParameterEstimate in_fit, kept_out;
  double z = 0.0;
};

struct KeptOutChange {
  // NRMSE of the recordings kept out, in %: as the fit predicts them, and fitted by themselves.
  double error_predicted = 0.0, error_fitted = 0.0;
  std::vector<ChangedSize> sizes;  // the surest first
};

// `own`: the same model and laws fitted to the recordings kept out, and what that leaves there.
// None where nothing is named.
[[nodiscard]] std::optional<KeptOutChange> kept_out_change(const ExtendedFit& fit,
                                                           double error_predicted,
                                                           const ExtendedFit& own,
                                                           double error_fitted);

// The errors of sizes that changed allow for it: two fits are apart by sqrt(2) standard deviations
// of each.
void widen_errors(const KeptOutChange& change, ExtendedFit& fit);

}  // namespace graybox
