// RobustWorkingSet: the robust design problem (robust_problem.hpp) restricted to a few dozen
// candidates, by a primal-dual interior point: the inner problem of robust_column_generation.
//
// Both objectives are one: with groups g of samples and phi_g = sum_{s in g} a_s phi_s, maximise
// min_g phi_g. The average is one group of all samples with a_s = 1/N, the worst case N groups of
// one sample. In the scale-free epigraph form (the optimum has sum_i lambda_i = 1 of itself, as in
// working_set.hpp)
//
//   maximise t - d sum_i lambda_i   subject to  y_g = phi_g(lambda) - t >= 0,  lambda >= 0,
//
// with multipliers pi for y and s for lambda, w_g the vector of sum_s a_s tr(M_s^-1 H_{s,i}) and
// S = sum_g pi_g sum_s a_s [tr(M_s^-1 H_{s,i} M_s^-1 H_{s,j})]_ij:
//
//   s = d 1 - sum_g pi_g w_g,   sum_g pi_g = 1,   y = phi(lambda) - t,   lambda s, y pi = mu -> 0.
//
// Newton's step, with ds, dy and dpi eliminated, q = pi/y and w~ = sum q_g w_g / sum q_g (which
// eliminates dt):
//
//   [S + diag(s/lambda) + sum_g q_g (w_g - w~)(w_g - w~)^T] dlambda = right side.
//
// Predictor and corrector as Mehrotra 1992, one step length for all. The gap that ends a run is
// that of the normalised design and prices on the working set, in the form of certify_robust().
//
// Cost of an iteration for n members: N (n d^3 + n^2 p / 2) + G n^2 + n^3/3.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "problems/base/aligned_array.hpp"
#include "solvers/core/inverse_cholesky.hpp"
#include "solvers/robust/robust_problem.hpp"

namespace graybox {

class RobustWorkingSet {
 public:
  explicit RobustWorkingSet(const RobustProblem& problem);  // keeps a reference

  // Adds a candidate. One that is there, or whose matrices equal a member's in every sample, only
  // has its weight added to that member's. True if it is new.
  bool add(std::size_t candidate, double weight);
  // Drops members of zero weight whose sensitivity sum_s pi_s w_{s,i} is below `sensitivity`.
  void drop_below(double sensitivity);

  // The first sample whose information matrix is singular for the present weights; N if none.
  [[nodiscard]] std::size_t singular_sample();

  // Until the gap on the working set is at most `tolerance`, or rounding or `stop`, asked once an
  // iteration, ends it. The best design seen is kept, its negligible weights and prices set to
  // zero. False where the present weights are singular under some sample; nothing is then changed.
  bool optimise(double tolerance, const std::function<bool()>& stop);

  // All of the last successful optimise().
  [[nodiscard]] std::span<const std::size_t> members() const { return members_; }
  [[nodiscard]] std::span<const double> weights() const { return weights_; }  // of sum 1
  [[nodiscard]] std::span<const double> prices() const { return prices_; }    // pi_s, of sum 1
  // M_s^-1 in trace-dual packing.
  [[nodiscard]] std::span<const double> trace_dual(std::size_t s) const {
    return inverses_[s].trace_dual();
  }
  // exp((sum_s pi_s phi_s - objective)/d): what the gap of a pricing max w/d - 1 is multiplied by.
  [[nodiscard]] double spread() const { return spread_; }
  [[nodiscard]] double gap() const { return gap_; }
  [[nodiscard]] std::int64_t iterations() const { return iterations_; }

 private:
  // The interior point, or a step of it.
  struct Point {
    Eigen::VectorXd weight, cost;  // lambda, s
    Eigen::VectorXd slack, price;  // y, pi
    double level = 0.0;            // t
  };

  [[nodiscard]] bool equal_everywhere(std::size_t a, std::size_t b) const;
  void load_rows();
  bool evaluate(const Eigen::VectorXd& weight);
  double measure_gap(const Point& point);
  void start();
  bool factorise();
  bool factorise_system();
  void choose_centring();
  void solve_direction();
  [[nodiscard]] double step_to_boundary() const;
  bool move();
  void finish(double tolerance);

  const RobustProblem& problem_;
  std::size_t dimension_;
  std::size_t packed_size_;
  std::size_t stride_;  // row length of whitened_, a multiple of 8
  std::size_t sample_count_;
  Eigen::Index group_count_;
  std::vector<std::size_t> members_;
  std::vector<double> weights_;
  std::vector<double> prices_;
  std::vector<double> rows_;  // packed matrices of the members, sample after sample
  std::vector<InverseCholesky> inverses_;
  double spread_ = 1.0;
  double gap_ = 0.0;
  std::int64_t iterations_ = 0;

  Point at_, step_, best_;
  double best_gap_ = 0.0;
  Eigen::VectorXd value_;        // phi_g
  Eigen::MatrixXd sensitivity_;  // w_g in its columns
  Eigen::VectorXd mean_sensitivity_;
  Eigen::VectorXd weight_target_, slack_target_;  // of the products lambda s and y pi
  Eigen::VectorXd ratio_;                         // q
  Eigen::VectorXd centre_;                        // w~
  Eigen::MatrixXd system_;
  Eigen::LLT<Eigen::MatrixXd> factor_;
  std::vector<std::size_t> order_;  // 0 .. n-1
  AlignedArray whitened_;
  std::vector<double> scratch_, gram_, packed_, traces_;
};

}  // namespace graybox
