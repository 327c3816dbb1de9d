// Fits of laws to a balance of forces, as the search asks for them.
//
// Parameters in which the force is linear are solved for on compressed columns
// (balance_regression.hpp), the others of the laws by variable projection (shape_refinement.hpp),
// in turn with the noise that weighs the coordinates. Where the drives' gains are unknown and a
// payload is fitted, its force is over these: gains and payload follow in turn
// (payload_tangent.hpp).
#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>
#include <vector>

#include "diagnosis/force_balance/balance_hypotheses.hpp"
#include "diagnosis/force_balance/balance_regression.hpp"
#include "diagnosis/force_balance/shape_refinement.hpp"
#include "diagnosis/force_balance_data/force_balance_data.hpp"
#include "diagnosis/hypotheses/mismatch_problem.hpp"
#include "diagnosis/signals/coloured_noise.hpp"

namespace graybox {

class BalanceFitter {
 public:
  // Both must outlive it. `keep_going` is asked now and then; false: fits end unusable.
  BalanceFitter(const ForceBalanceData& data, const BalanceHypotheses& hypotheses,
                std::function<bool()> keep_going);

  // MismatchProblem::fit.
  [[nodiscard]] ExtendedFit fit(std::span<const LawStart> starts, const ExtendedFit* nearby) const;

  // Errors with given values of everything, samples x coordinates.
  [[nodiscard]] Eigen::MatrixXd residuals(const ExtendedFit& fit,
                                          const ForceBalanceRows& rows) const;
  // 1/gain of each joint's drive; empty where gains are known.
  [[nodiscard]] Eigen::VectorXd inverse_gains(const ExtendedFit& fit) const;
  [[nodiscard]] PlacedLaw placed_of(const ExtendedFit& fit, const FittedLaw& law) const;
  // Relative errors are of all coordinates together, as tables of published results have them.
  [[nodiscard]] Assessment assess(const ForceBalanceRows& rows, const Eigen::MatrixXd& error) const;

  [[nodiscard]] const ForceBalanceData& data() const { return data_; }
  [[nodiscard]] const BalanceHypotheses& hypotheses() const { return hypotheses_; }
  // The noise of each coordinate: what the model alone leaves, less what depends on the motion.
  [[nodiscard]] std::span<const ColouredNoise> noises() const { return noises_; }
  // Samples that those of a coordinate are worth.
  [[nodiscard]] double effective_samples(Eigen::Index coordinate) const {
    return effective_[static_cast<std::size_t>(coordinate)];
  }
  // Samples that they are worth, of all coordinates together.
  [[nodiscard]] double sample_count() const;

 private:
  struct AmplitudeFit;
  class FitBalance;

  [[nodiscard]] Eigen::Index coordinates() const { return data_.estimation.coordinates(); }
  [[nodiscard]] bool is_idle(Eigen::Index j) const {
    return data_.idle[static_cast<std::size_t>(j)];
  }
  void hold_untouched(std::span<const LawStart> starts, const ExtendedFit* nearby,
                      std::vector<RefinedLaw>& laws) const;
  [[nodiscard]] bool acts_on(std::size_t hypothesis, const std::vector<bool>& coordinates) const;
  [[nodiscard]] Eigen::VectorXd noise_of(const ExtendedFit* fit) const;
  [[nodiscard]] ExtendedFit fit_refined(std::span<const LawStart> starts,
                                        std::vector<RefinedLaw>& refined,
                                        Eigen::VectorXd noise) const;
  [[nodiscard]] std::vector<BalanceColumns> payload_slopes(const std::vector<RefinedLaw>& refined,
                                                           const AmplitudeFit& fit) const;
  [[nodiscard]] bool is_settled(const Eigen::VectorXd& noise, const Eigen::VectorXd& next,
                                double largest_ratio) const;
  void settle_gains(std::span<const LawStart> starts, std::vector<RefinedLaw>& laws,
                    ExtendedFit& result) const;
  [[nodiscard]] FitBalance balance_of(std::span<const RefinedLaw> laws) const;
  [[nodiscard]] AmplitudeFit with_amplitudes(const FitBalance& balance,
                                             std::span<const RefinedLaw> refined) const;
  [[nodiscard]] ExtendedFit described(std::span<const LawStart> starts,
                                      const AmplitudeFit& fit) const;
  void describe(std::span<const LawStart> starts, const AmplitudeFit& fit,
                ExtendedFit& result) const;

  const ForceBalanceData& data_;
  const BalanceHypotheses& hypotheses_;
  std::function<bool()> keep_going_;
  BalanceRegression regression_;
  Eigen::VectorXd first_inverse_gains_;  // of the model as given; empty where gains are known
  std::vector<ColouredNoise> noises_;
  std::vector<double> effective_;  // samples, by coordinate
};

}  // namespace graybox
