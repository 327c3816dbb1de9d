// PeriodicLaw: a law of the catalogue under periodic motion, from the lines of its deflection (or
// signal) to the lines of its force.
//
// Linear laws act line by line, F = s(w) Z: stiffness k, viscous j w d, inertia -w^2 J, mode
// -w^2 J kappa / (kappa - w^2 J) with kappa = J w_0^2 + 2 j w zeta w_0 J; on signals gain e, lag
// 1/(1 + j w T) - 1, delay e^(-j w T) - 1. Others are evaluated over a grid of times. Laws with a
// state run twice through the period and the second run counts; over one step of the grid the state
// follows the exponential of its linearised equation (Rosenbrock and Euler), exact for friction
// with bristles under constant velocity.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "graybox/diagnosis/periodic_mismatch/period_transform.hpp"
#include "graybox/problems/elements/law_catalogue.hpp"

namespace graybox {

// Deflection and rate over one period.
struct PeriodicMotion {
  Eigen::VectorXd deflection, rate;
  double step = 0.0;  // s, of the grid
};

class PeriodicLaw {
 public:
  // Keeps the entry, which belongs to the catalogue.
  PeriodicLaw(const LawEntry& entry, std::span<const double> parameters);

  [[nodiscard]] bool is_linear() const { return response(1.0).has_value(); }
  // s(w) of a linear law.
  [[nodiscard]] std::optional<std::complex<double>> response(double w) const;
  // f over the period of one that is not.
  void force(const PeriodicMotion& motion, Eigen::VectorXd& times) const;
  [[nodiscard]] bool has_states() const { return law_ != nullptr && law_->state_count() > 0; }
  // f_z and f_z' over the period, of a law without states, by central differences.
  void slopes(const PeriodicMotion& motion, Eigen::VectorXd& by_deflection,
              Eigen::VectorXd& by_rate) const;
  // (k, d) of the spring and damper nearest to the force of a law with states (its describing
  // function).
  [[nodiscard]] std::pair<double, double> describing_slopes(const PeriodicMotion& motion) const;

 private:
  void march(const PeriodicMotion& motion, Eigen::VectorXd& times) const;

  const LawEntry* entry_;
  std::vector<double> parameters_;
  std::shared_ptr<const Law> law_;  // null where response() says all
};

}  // namespace graybox
