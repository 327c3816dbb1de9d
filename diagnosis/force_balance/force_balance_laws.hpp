// Laws as columns of a force balance: which of their parameters the force is linear in, and the
// columns for given values of the others.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "graybox/diagnosis/force_balance/force_balance_data.hpp"
#include "graybox/problems/elements/law_catalogue.hpp"

namespace graybox {

// A law at a place with values of all its parameters.
struct PlacedLaw {
  const CandidatePlace* place = nullptr;
  const LawEntry* entry = nullptr;  // of the catalogue
  std::vector<double> parameters;

  [[nodiscard]] std::vector<std::size_t> linear() const;
  // Those that are refined: not linear, and not one that only sets the scale of another (the distance
  // of a balancer's anchor, for which its stiffness makes up; the velocity at which a friction is
  // stated).
  [[nodiscard]] std::vector<std::size_t> refined() const;
};

// One column for each linear parameter, at the present values of the others.
[[nodiscard]] Eigen::MatrixXd linear_columns(const PlacedLaw& law, const ForceBalanceRows& rows);
// The force at the present values.
[[nodiscard]] Eigen::VectorXd force_rows(const PlacedLaw& law, const ForceBalanceRows& rows);
// Columns of a law of these parameters (a shape of law_shapes.hpp).
[[nodiscard]] Eigen::VectorXd shape_rows(const CandidatePlace& place, const LawEntry& entry,
                                         std::span<const double> parameters,
                                         const ForceBalanceRows& rows);

// The laws that can be hypotheses at a place of a force balance.
[[nodiscard]] std::vector<const LawEntry*> force_balance_laws(const CandidatePlace& place);
[[nodiscard]] MotionScale motion_scale(const CandidatePlace& place, const ForceBalanceRows& rows);

}  // namespace graybox
