// PeriodicLaw: a law of the catalogue under periodic motion, from the lines of its deflection (or
// signal) to the lines of its force.
//
// Linear laws act line by line, F = s(w) Z. For forces s is: stiffness k, viscous j w d, inertia
// -w^2 J, mode -w^2 J kappa / (kappa - w^2 J) with kappa = J w_0^2 + 2 j w zeta w_0 J. On signals
// it is: gain e, lag 1/(1 + j w T) - 1, delay e^(-j w T) - 1. Others are evaluated over a grid of
// times. Laws with a state run twice through the period and the second run counts; over one step of
// the grid the state follows the exponential of its linearised equation (Rosenbrock and Euler),
// exact for friction with bristles under constant velocity.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "diagnosis/harmonic_balance/period_transform.hpp"
#include "problems/laws/law_catalogue.hpp"

namespace graybox {

// Deflection and rate over one period.
struct PeriodicMotion {
  Eigen::VectorXd deflection, rate;
  double step = 0.0;  // s, of the grid
};

// What a small change of the motion does to a law's force, over the grid of the period:
//   df = f_z dz + f_z' dz' + f_s ds,
// and where the law has a state s, from each time to the next
//   ds_next = growth ds + s_z dz + s_z' dz',  dz and dz' halfway,
// through the period twice from ds = 0, as the state itself.
struct LawTangent {
  Eigen::VectorXd by_deflection, by_rate;
  Eigen::VectorXd by_state, growth, state_by_deflection, state_by_rate;  // empty without a state

  void apply(const PeriodicMotion& change, Eigen::VectorXd& times) const;
};

// A linear force: J z'' + d z' + k z, or that of a mass J that hangs on a spring k and a damper d.
struct LinearForce {
  double inertia = 0.0, damping = 0.0, stiffness = 0.0;
  bool swings = false;

  // s(w).
  [[nodiscard]] std::complex<double> response(double w) const;
  // Of the mass to the place, where it swings.
  [[nodiscard]] std::complex<double> transmission(double w) const;
};

// Throws InputError for a law of several states, which no PeriodicLaw follows.
void require_one_state(const LawEntry& entry);

class PeriodicLaw {
 public:
  // Keeps the entry, which belongs to the catalogue.
  PeriodicLaw(const LawEntry& entry, std::span<const double> parameters);

  [[nodiscard]] bool is_linear() const { return response(1.0).has_value(); }
  // s(w) of a linear law.
  [[nodiscard]] std::optional<std::complex<double>> response(double w) const;
  // Of a linear law that is a force; empty for others.
  [[nodiscard]] std::optional<LinearForce> linear_force() const;
  // f over the period of one that is not.
  void force(const PeriodicMotion& motion, Eigen::VectorXd& times) const;
  [[nodiscard]] bool has_states() const { return law_ != nullptr && law_->state_count() > 0; }
  // By finite differences.
  void linearise(const PeriodicMotion& motion, LawTangent& tangent) const;
  // (k, d) of the spring and damper nearest to the force of a law with states (its describing
  // function).
  [[nodiscard]] std::pair<double, double> describing_slopes(const PeriodicMotion& motion) const;

 private:
  // The state one step of the grid later, under the mean motion of the step.
  struct Advance {
    double state = 0.0;
    double growth = 1.0;  // e^(slope h), of small differences in the state
  };
  [[nodiscard]] Advance advanced(double deflection, double rate, double state, double step) const;
  void march(const PeriodicMotion& motion, Eigen::VectorXd& states) const;
  void linearise_state(const PeriodicMotion& motion, double dz, double dv,
                       LawTangent& tangent) const;

  const LawEntry* entry_;
  std::vector<double> parameters_;
  std::shared_ptr<const Law> law_;  // null where response() says all
};

}  // namespace graybox
