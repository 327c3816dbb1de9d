// Bodies that are not quite what the model states: their standard inertial parameters are free
// about the stated values, with a prior.
//
// A drawing knows masses to some per cent, and knows no cables, grease and covers. Let a body have
// mass m and radius r, r^2 = trace(I) / (2 m) with I about its frame's origin. The standard
// deviations of the prior are `share` times m for the mass, m r for the first moments and m r^2 for
// the moments of inertia. The model's columns are then W d, d the departures from what is stated,
// and the fit minimises sum (rest / s_j)^2 + precision d^2 (generalised least squares with a prior;
// Theil and Goldberger 1961). Residuals follow each other in time, so that N of them say as much as
// N_eff independent ones: the precision is N / N_eff over the variance.
//
// Where drive gains g_j are unknown, joint j has departures d / g_j of its own, with the prior's
// standard deviations over |g_j|, so that the fit stays linear.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/force_balance_data/force_balance_data.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"
#include "diagnosis/plausibility/fitted_physics.hpp"
#include "problems/mechanisms/rigid_body_regressor.hpp"

namespace graybox {

// Whether any body may be freed. It may in a robot with several joints, whose model says that its
// bodies are uncertain. None may be free already.
[[nodiscard]] bool may_free_bodies(const ForceBalanceData& data);

// The prior's standard deviations for a body with these standard parameters.
[[nodiscard]] StandardParameters prior_deviations(const StandardParameters& stated, double share);

// Adds the bodies' departures to the model's parameters. `worth`: N_eff / N. `inverse_gains`: about
// 1/gain of each joint, 0 where it is not told; empty where gains are known. None where no body may
// be freed, or none is stated.
[[nodiscard]] std::optional<ForceBalanceData> with_uncertain_bodies(
    const ForceBalanceData& data, double worth, const Eigen::VectorXd& inverse_gains);

// The bodies as a fit of such data has them, and by how many of their standard errors the
// parameters must change, at most, until the body can exist (plausibility.hpp). Empty where no body
// is free, and where each joint has departures of its own.
[[nodiscard]] std::vector<PhysicalBody> fitted_bodies(
    const ForceBalanceData& data, const std::vector<LawParameterEstimate>& model_parameters);

// "mass of joint_2's link 312 ± 8 kg (stated: 339)" of the parameters that are off by more than
// two standard errors, those that are off most first. Of departures of several joints it is that
// with the least standard error.
[[nodiscard]] std::vector<std::string> departures_from_stated(
    const ForceBalanceData& data, const std::vector<LawParameterEstimate>& model_parameters);

}  // namespace graybox
