#include "solvers/interior_point/primal_newton.hpp"

#include <algorithm>
#include <cmath>
#include <new>
#include <utility>

#include "solvers/core/lapack.hpp"
#include "solvers/core/tracer.hpp"
#include "solvers/interior_point/information_step.hpp"
#include "solvers/interior_point/interior_point.hpp"
#include "solvers/interior_point/nesterov_todd.hpp"

namespace graybox {
namespace {

using Eigen::MatrixXd;

class PrimalNewton {
 public:
  PrimalNewton(const NormalizedSet& normal, PrimalSystem& system, EqualityConstraints constraints,
               const SolveOptions& options, Tracer& tracer)
      : normal_(normal),
        system_(system),
        tracer_(tracer),
        constraints_(std::move(constraints)),
        evaluator_(normal),
        run_(normal, options, tracer),
        scaling_(normal.dimension()),
        information_step_(normal, scaling_),
        count_(normal.candidate_count()),
        weight_(count_, 1.0 / static_cast<double>(count_)),
        reduced_cost_(count_),
        target_(count_),
        weight_step_(count_),
        reduced_cost_step_(count_),
        inverse_constraints_(constraints_.count * count_),
        schur_(constraints_.count * constraints_.count),
        price_(constraints_.count, 0.0),
        price_step_(constraints_.count),
        w_(MatrixXd::Identity(static_cast<Eigen::Index>(normal.dimension()),
                              static_cast<Eigen::Index>(normal.dimension()))) {}

  Solution run() {
    bool evaluated = evaluator_.evaluate(weight_);
    if (evaluated) start();
    while (run_.proceed(evaluated, evaluator_, weight_)) {
      if (!scaling_.compute(w_, evaluator_.factor(), evaluator_.inverse_factor())) {
        run_.fail("W is no longer positive definite");
        break;
      }
      if (!factorise()) {
        run_.fail("the Newton system is numerically singular");
        break;
      }
      if (!predict() || !correct()) {
        run_.fail("the Newton step is not finite");
        break;
      }
      step();
      evaluated = evaluator_.evaluate(weight_);
    }
    return run_.finish(reduced_cost_);
  }

 private:
  [[nodiscard]] std::span<const double> constraint(std::size_t row) const {
    return constraints_.rows.span().subspan(row * count_, count_);
  }

  static double dot(std::span<const double> a, std::span<const double> b) {
    double sum = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
    return sum;
  }

  // M = I up to rounding at the start, so that the evaluator's traces are the tr B_i.
  void start() {
    price_[0] = 1.1 * *std::ranges::max_element(evaluator_.traces());
    for (std::size_t i = 0; i < count_; ++i) {
      reduced_cost_[i] = price_[0] - evaluator_.traces()[i];
    }
  }

  // The factor of K + S/Lambda, V and the Schur complement F V.
  bool factorise() {
    for (std::size_t i = 0; i < count_; ++i) target_[i] = weight_[i] / reduced_cost_[i];
    if (!system_.factorise(scaling_.inverse_scaling(), target_)) return false;
    std::ranges::copy(constraints_.rows, inverse_constraints_.begin());
    const std::size_t m = constraints_.count;
    for (std::size_t row = 0; row < m; ++row) {
      const auto column = inverse_constraints_.span().subspan(row * count_, count_);
      system_.solve(column);
      for (std::size_t k = 0; k < m; ++k) schur_[row * m + k] = dot(constraint(k), column);
    }
    tracer_.count_passes(system_.factorise_passes() +
                         static_cast<double>(m) * system_.solve_passes());
    return lapack::factorise_cholesky(m, schur_.data());
  }

  bool predict() {
    double product = 0.0;
    for (std::size_t i = 0; i < count_; ++i) {
      target_[i] = -weight_[i] * reduced_cost_[i];
      product -= target_[i];
    }
    if (!solve_direction()) return false;

    const double t = std::min(1.0, step_to_boundary(weight_, weight_step_));
    const double u = std::min({1.0, scaling_.step_to_boundary(information_step_.scaled_w_step()),
                               step_to_boundary(reduced_cost_, reduced_cost_step_)});
    double predicted = 0.0;
    for (std::size_t i = 0; i < count_; ++i) {
      predicted +=
          (weight_[i] + t * weight_step_[i]) * (reduced_cost_[i] + u * reduced_cost_step_[i]);
    }
    centring_ = run_.centring(product, predicted);
    return true;
  }

  bool correct() {
    scaling_.add_second_order(information_step_.scaled_w_step());
    for (std::size_t i = 0; i < count_; ++i) {
      target_[i] += centring_ - weight_step_[i] * reduced_cost_step_[i];
    }
    return solve_direction();
  }

  // Solves (b) for c = target_ and the scaling's E. For dlambda = dnu = 0, complete_direction()
  // leaves
  // -g in the place of ds.
  bool solve_direction() {
    std::ranges::fill(weight_step_, 0.0);
    std::ranges::fill(price_step_, 0.0);
    complete_direction();
    for (std::size_t i = 0; i < count_; ++i) {
      weight_step_[i] = target_[i] / weight_[i] - reduced_cost_step_[i];
    }
    system_.solve(weight_step_);
    tracer_.count_passes(system_.solve_passes());
    for (std::size_t k = 0; k < price_.size(); ++k) {
      const double missing = constraints_.right_side[k] - dot(constraint(k), weight_);
      price_step_[k] = dot(constraint(k), weight_step_) - missing;
    }
    lapack::solve_cholesky(price_.size(), schur_.data(), 1, price_step_.data());
    double size = 0.0;
    for (std::size_t i = 0; i < count_; ++i) {
      for (std::size_t k = 0; k < price_.size(); ++k) {
        weight_step_[i] -= price_step_[k] * inverse_constraints_[k * count_ + i];
      }
      size += std::abs(weight_step_[i]);
    }
    complete_direction();
    return std::isfinite(size);
  }

  // dW~, dW and ds = F^T dnu - tr(dW B_i) from dlambda and dnu.
  void complete_direction() {
    information_step_.compute(weight_step_, reduced_cost_step_);
    for (std::size_t i = 0; i < count_; ++i) {
      reduced_cost_step_[i] = -reduced_cost_step_[i];
      for (std::size_t k = 0; k < price_.size(); ++k) {
        reduced_cost_step_[i] += constraint(k)[i] * price_step_[k];
      }
    }
    tracer_.count_passes(2.0);
  }

  void step() {
    const double fraction = boundary_fraction(evaluator_.gap());
    const double t = std::min(1.0, fraction * step_to_boundary(weight_, weight_step_));
    const double boundary = std::min(scaling_.step_to_boundary(information_step_.scaled_w_step()),
                                     step_to_boundary(reduced_cost_, reduced_cost_step_));
    const double u = std::min(1.0, fraction * boundary);
    for (std::size_t i = 0; i < count_; ++i) {
      weight_[i] += t * weight_step_[i];
      reduced_cost_[i] += u * reduced_cost_step_[i];
    }
    for (std::size_t k = 0; k < price_.size(); ++k) price_[k] += u * price_step_[k];
    w_ += u * information_step_.w_step();
  }

  const NormalizedSet& normal_;
  PrimalSystem& system_;
  Tracer& tracer_;
  EqualityConstraints constraints_;
  DesignEvaluator evaluator_;
  InteriorPointRun run_;
  NesterovTodd scaling_;
  InformationStep information_step_;
  std::size_t count_;
  std::vector<double> weight_;        // lambda
  std::vector<double> reduced_cost_;  // s
  std::vector<double> target_;        // c
  std::vector<double> weight_step_, reduced_cost_step_;
  AlignedArray inverse_constraints_;  // V, a row of Q for each constraint
  std::vector<double> schur_;         // F V
  std::vector<double> price_;         // nu
  std::vector<double> price_step_;
  MatrixXd w_;
  double centring_ = 0.0;  // sigma mu
};

}  // namespace

EqualityConstraints simplex_constraint(std::size_t candidate_count) {
  return {1, AlignedArray(candidate_count, 1.0), {1.0}};
}

Solution solve_primal(const InformationSet& set, const SolveOptions& options,
                      SolveObserver* observer, const MakePrimalSystem& make_system) {
  Tracer tracer(set, options, observer);
  const NormalizedSet normal(set, {.scale_rows = false,
                                   .accuracy = kRowAccuracy * options.duality_gap,
                                   .threads = options.threads});
  tracer.count_passes(normal.passes());
  if (!normal.regular()) return unsupported(set, tracer, normal.message());
  std::unique_ptr<PrimalSystem> system;
  try {
    system = make_system(normal, options.threads);
  } catch (const std::bad_alloc&) {
    return unsupported(set, tracer, "the Newton matrix does not fit into memory");
  }
  return PrimalNewton(normal, *system, simplex_constraint(set.candidate_count()), options, tracer)
      .run();
}

}  // namespace graybox
