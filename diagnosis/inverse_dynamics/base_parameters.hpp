// Base parameters: the combinations of the columns' parameters that the torques depend on, found
// numerically (Gautier 1991).
//
// With W the columns at many motions, W p is unchanged when a dependent column is replaced by what
// it is of the independent ones before it, W_d = W_i K. So W p = W_i (p_i + K p_d): the base
// parameter of an independent column is its own parameter plus K times those of the dependent ones
// ("XX2R = XX2 - YY2"). Columns are taken in their order, from the base of the robot outwards,
// which gives the regrouping of Khalil and Dombre 2002 (Section 9.4: YY_j into XX_j and ZZ_{j-1},
// ...). A column is dependent if less than `tolerance` of its length is left after projection on
// the independent ones (orthogonalised twice; Giraud and others 2005), and without effect if it is
// zero.
//
//   const BaseParameters base = structural_base_parameters(columns, joints);
//   base.names          // "ZZ1R", "XX2R", "MX2", ...
//   base.relations      // "XX2R = XX2 - YY2"
//
// Cost O(m p^2) for m rows and p columns.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "diagnosis/inverse_dynamics/torque_columns.hpp"
#include "diagnosis/plausibility/fitted_physics.hpp"

namespace graybox {

struct BaseParameters {
  std::vector<Eigen::Index> columns;  // independent, rising
  Eigen::MatrixXd regrouping;         // base parameters = regrouping * parameters
  std::vector<std::string> names;  // of the columns; with an R where others are regrouped into it
  std::vector<std::string> relations;       // one for each name with an R
  std::vector<std::string> without_effect;  // parameters of zero columns

  [[nodiscard]] Eigen::Index size() const { return static_cast<Eigen::Index>(columns.size()); }
};

// Of these columns; `names` are theirs.
[[nodiscard]] BaseParameters base_parameters(const Eigen::MatrixXd& columns,
                                             const std::vector<std::string>& names,
                                             double tolerance);

// What a base parameter may be: where it is a sum of masses and moments of inertia alone it is
// positive as they are; a difference, a product of inertia and a first moment may have either sign.
// A parameter of an element ("friction.damping") goes by its unit.
[[nodiscard]] QuantityKind base_parameter_kind(const std::string& name, const std::string& unit,
                                               const std::vector<std::string>& relations);

// The base parameters of the model, found at random positions, velocities and accelerations, the
// same each time. They regroup what no motion whatever can tell apart.
[[nodiscard]] BaseParameters structural_base_parameters(TorqueColumns& columns,
                                                        Eigen::Index joints);

}  // namespace graybox
