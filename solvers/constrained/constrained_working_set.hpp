// ConstrainedWorkingSet: the problem of design_constraints.hpp on a few dozen candidates, by a
// primal-dual interior point.
//
// Mathematics. f = -log Phi(M), M = P + sum_i x_i H_i, is convex with gradient -w_i, w_i = tr(G
// H_i), and Hessian S (smooth_restricted_problem.hpp, which has S for all criteria but E: S_ij =
// tr(B_i B_j)/d for D). S is F F^T - V V^T with a row of F a member. E and G are made smooth by a
// barrier (criterion_frame.hpp). They and phi_p with p > 1 are followed from smooth to sharp; what
// smoothing costs is part of the gap. The rows have slacks s_j in [L_j, U_j] where L_j < U_j. With
// multipliers y of the
// rows and z >= 0 of the limits, the conditions of optimality are
//
//   w = A^T y + z^u - z^l,     A x = s,     y = v^u - v^l  (slacks),
//   z^l (x - l) = z^u (u - x) = v^l (s - L) = v^u (U - s) = mu -> 0.
//
// Newton's step eliminates the multipliers of the limits,
//
//   (S + Z) dx + A^T dy = w - A^T y + mu/(x - l) - mu/(u - x),     Z = z^l/(x - l) + z^u/(u - x),
//   A dx - D^-1 dy = s - A x + D^-1 g,                             D = v^l/(s - L) + v^u/(U - s),
//
// and solves for dy with the m x m Schur complement. Predictor and corrector (Mehrotra 1992) share
// the factors. All steps have one length, 0.995 of the way to the boundary. The step of f is held
// to where its second-order model holds, |B|_F of the change of M about one.
//
// It stops by the bound of multiplier_bound.hpp over its members, which is a proof, not an
// estimate. A last Newton step on the limits that are active then puts the weights that are zero
// to zero.
//
// Starts are warm: members keep x, y and z, lifted to the complementarity that the gap of the pool
// calls for.
//
// Cost of a step: n d^3 + n^2 p / 2 + n^3 / 6 + n^2 m for n members, n (d^3 + p^2 + p m) where n >
// 2 p.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <unordered_set>
#include <vector>

#include "problems/base/aligned_array.hpp"
#include "solvers/constrained/design_constraints.hpp"
#include "solvers/core/criterion.hpp"
#include "solvers/core/inverse_cholesky.hpp"
#include "solvers/restricted_problem/criterion_frame.hpp"

namespace graybox {

class ConstrainedWorkingSet {
 public:
  // `coordinates`: as CriterionFrame; `prior`: P in these coordinates, packed, or empty. Keeps a
  // reference to the constraints.
  ConstrainedWorkingSet(const Criterion& criterion, std::size_t dimension,
                        std::span<const double> coordinates, std::span<const double> prior,
                        const DesignConstraints& constraints);

  // Adds a candidate with its packed matrix, which is copied. False if it is there already.
  bool add(std::size_t candidate, const double* information);

  // Steps until the gap over the members is at most `tolerance`. `pool_gap`: of the last pricing of
  // candidates outside, where the steps begin. False where no further progress is possible.
  bool improve(double pool_gap, double tolerance);

  // Takes out members that are not run and whose reduced gain is below -threshold, but none twice:
  // where multipliers are not unique, it would come and go for ever.
  void drop(double threshold);

  [[nodiscard]] std::span<const std::size_t> candidates() const { return candidates_; }
  [[nodiscard]] std::span<const double> efforts() const { return {state_.x.data(), size()}; }
  // y, G and tr(G P), of the criterion itself where it was made smooth.
  [[nodiscard]] std::span<const double> multipliers() const { return true_multipliers_; }
  [[nodiscard]] std::span<const double> trace_dual() const { return true_dual_; }
  [[nodiscard]] double prior_gain() const { return true_prior_gain_; }
  [[nodiscard]] double sharpness() const { return sharpness_; }  // of E and G, as made smooth

  [[nodiscard]] bool regular() const { return regular_; }  // M at the last efforts
  [[nodiscard]] bool obeys_rows() const;                   // to a relative 1e-10
  [[nodiscard]] std::size_t size() const { return candidates_.size(); }

 private:
  using Index = Eigen::Index;
  using Vector = Eigen::VectorXd;
  using Matrix = Eigen::MatrixXd;
  // What has a lower and an upper limit, either of which may be infinite, with its multipliers.
  struct Limited {
    Vector lower, upper, at_lower, at_upper;  // bounds; multipliers
  };
  struct State {
    Vector x, y, s;
    Limited x_limits, s_limits;
  };
  struct Direction {
    Vector x, y, s, x_lower, x_upper, s_lower, s_upper;
  };

  // One of the criteria that make up f, and its share.
  struct Part {
    double share;
    CriterionFrame frame;
  };
  // (S + Z)^-1 through I + F^T Z^-1 F, where members are more than its columns.
  struct ByColumns {
    bool used = false;
    Eigen::LLT<Matrix> factor = {};
    Vector inverse_stiffness = {};
    Matrix scaled_gram = {};
    Matrix solved_downdates = {};
    Eigen::LLT<Matrix> downdate = {};  // I - V^T (F F^T + Z)^-1 V
  };
  // Where some efforts stand at their limits and some rows bind.
  struct Face {
    std::vector<Eigen::Index> free;  // efforts that do not
    std::vector<Eigen::Index> rows;
    Vector limits;  // of these rows
  };

  void keep(const std::vector<Eigen::Index>& kept);
  void resize();
  void start(double pool_gap);
  void centre(const Vector& value, double mu, Limited& limited) const;
  bool evaluate();
  bool descend(double tolerance);
  void set_sharpness(double sharpness);
  bool follow_sharpness(double tolerance);
  void form_gram_rows();
  void form_rows_of(const Part& part, std::size_t first);
  void form_outer_terms(const Part& part, std::size_t& column, Index& downdate);
  [[nodiscard]] Vector limit_stiffness() const;
  bool factorise_hessian();
  [[nodiscard]] Matrix solve_hessian(const Matrix& right) const;
  bool factorise();
  // mu / distance of each limit, upwards from the lower and downwards from the upper ones.
  struct Push {
    Vector up, down;
  };
  static Push push_of(const Vector& value, const Limited& limits, double mu, const Vector* step,
                      const Vector* lower_step, const Vector* upper_step);
  static void multiplier_steps(const Vector& value, const Limited& limits, const Push& push,
                               const Vector& step, Vector& lower_step, Vector& upper_step);
  void solve(double mu, const Direction* predicted, Direction& step);
  [[nodiscard]] double step_length(const Direction& step) const;
  [[nodiscard]] double model_length(const Direction& step) const;
  [[nodiscard]] double complementarity() const;
  [[nodiscard]] double complementarity_after(const Direction& step, double length) const;
  [[nodiscard]] Eigen::Index limit_count() const;
  void step(bool centring);
  void move(const Direction& step, double length);
  void measure_gap();
  Face snap_to_face();
  bool step_in(const Face& face);
  void polish();
  [[nodiscard]] double infeasibility() const;
  [[nodiscard]] const double* row(std::size_t k) const { return rows_.data() + k * packed_size_; }

  const DesignConstraints& constraints_;
  std::size_t dimension_, packed_size_;
  std::vector<Part> parts_;
  InverseCholesky inverse_;
  bool is_determinant_;  // criterion D
  std::vector<double> prior_;
  std::vector<std::size_t> candidates_;
  std::unordered_set<std::size_t> members_, dropped_;
  std::vector<double> rows_;  // packed matrices of the members
  std::vector<double> matrix_;

  State state_;
  Direction predictor_, corrector_;
  double length_ = 0.0;       // of the last step
  Vector is_slack_;           // 1 for rows with L < U, 0 for equations
  Matrix a_;                  // rows of the members, m x n
  Vector gain_;               // w
  std::vector<double> dual_;  // G of f
  double prior_gain_ = 0.0;   // tr(G P)
  std::vector<double> true_dual_, true_multipliers_;
  double true_prior_gain_ = 0.0;
  bool is_smoothed_ = false;    // E or G
  double sharpness_ = 1.0;      // of E and G, and what p is held to
  double largest_power_ = 1.0;  // p
  double smoothing_ = 1.0;      // the largest factor between the gaps of criterion and f
  bool regular_ = false;
  double gap_ = 0.0;       // over the members
  std::size_t fresh_ = 0;  // members from here on have never been solved for

  std::vector<std::size_t> listed_;  // members whose rows g_i are formed
  AlignedArray gram_rows_;
  using GramMap =
      Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;
  GramMap gram_;      // listed x stride, the rows g_i
  Matrix downdates_;  // V of the members listed
  std::vector<double> traces_, scratch_, root_weight_;
  Matrix hessian_factor_;  // of S + Z, or
  ByColumns columns_;
  Matrix half_, rotated_, unpacked_;
  Vector inverse_slack_;
  Eigen::LDLT<Matrix> schur_factor_;
};

}  // namespace graybox
