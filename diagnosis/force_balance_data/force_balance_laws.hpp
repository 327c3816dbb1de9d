// Laws as columns of a force balance: which of their parameters the force is linear in, and the
// columns for given values of the others.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "diagnosis/force_balance_data/force_balance_data.hpp"
#include "problems/laws/law_catalogue.hpp"

namespace graybox {

// A law at a place with values of all its parameters.
struct PlacedLaw {
  const CandidatePlace* place = nullptr;
  const LawEntry* entry = nullptr;  // of the catalogue
  std::vector<double> parameters;
  // A payload's force on a joint is over the gain of its drive: 1/gain of each, where the gains are
  // unknown; 0: not told.
  Eigen::VectorXd inverse_gains = {};

  // Parameters in which the force is linear. Laws with memory have none; their force is multiplied
  // by a factor if all parameters with the unit of a force (or of a force over something) are.
  [[nodiscard]] std::vector<std::size_t> linear() const;
  [[nodiscard]] std::vector<std::size_t> scaled() const;
  // Those that shape the force, to be refined: not linear, and not one that only sets the scale of
  // another (the first of scaled(); LawParameter::sets_scale), nor where a payload's mass sits: at
  // the flange.
  [[nodiscard]] std::vector<std::size_t> refined() const;
  // Number of columns of law_columns, and their amplitudes written into the parameters.
  [[nodiscard]] Eigen::Index amplitudes() const;
  void set_amplitudes(const Eigen::Ref<const Eigen::VectorXd>& values);
};

// One column for each linear parameter, at the present values of the others; for a law without
// linear parameters its force.
[[nodiscard]] BalanceColumns law_columns(const PlacedLaw& law, const ForceBalanceData& data,
                                         const ForceBalanceRows& rows);
// The force at the present values: one column.
[[nodiscard]] BalanceColumns law_force_column(const PlacedLaw& law, const ForceBalanceData& data,
                                              const ForceBalanceRows& rows);
// Derivatives of the force by these parameters, central differences.
[[nodiscard]] BalanceColumns law_slopes(const PlacedLaw& law,
                                        std::span<const std::size_t> parameters,
                                        const ForceBalanceData& data, const ForceBalanceRows& rows);
// Columns of laws of these parameters (the basis of a shape of law_shapes.hpp).
[[nodiscard]] BalanceColumns basis_columns(const PlacedLaw& law,
                                           std::span<const std::vector<double>> basis,
                                           const ForceBalanceData& data,
                                           const ForceBalanceRows& rows);

// The laws that can be hypotheses at a place of a force balance; without positions only those that
// don't depend on them.
[[nodiscard]] std::vector<const LawEntry*> force_balance_laws(const CandidatePlace& place,
                                                              bool position_is_recorded = true);
[[nodiscard]] MotionScale motion_scale(const CandidatePlace& place, const ForceBalanceRows& rows);

}  // namespace graybox
