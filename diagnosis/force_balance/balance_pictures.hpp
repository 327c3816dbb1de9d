// What a report shows of a balance of forces: forces of laws against the motion, curves over time,
// the range in which a model was checked, and what each law does along the recorded motion.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "diagnosis/force_balance_data/force_balance_data.hpp"
#include "diagnosis/force_balance_data/force_balance_laws.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"
#include "diagnosis/hypotheses/physical_evidence.hpp"

namespace graybox {

// The law's force at its place, and the same with what the fit leaves there. `rest`: samples x
// coordinates.
[[nodiscard]] ForcePicture force_picture(const ForceBalanceData& data, std::size_t hypothesis,
                                         const PlacedLaw& law, const Eigen::MatrixXd& rest);

// The first recordings of a role, every coordinate; NaN where a force does not count.
void add_curves(const ForceBalanceData& data, const ForceBalanceRows& rows,
                const Eigen::MatrixXd& rest, bool held_out, std::vector<ResidualCurve>& curves);

// The range of the recordings kept out; where none are, that of the fit's recordings.
[[nodiscard]] CheckedRange checked_range(const ForceBalanceData& data);

// What the model has at the law's place, and the law along the motion.
void describe_physics(const ForceBalanceData& data, const PlacedLaw& law,
                      PhysicalContext::OfLaw& own);

}  // namespace graybox
