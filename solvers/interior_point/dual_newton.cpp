#include "solvers/interior_point/dual_newton.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "problems/base/packed_matrix.hpp"
#include "solvers/core/tracer.hpp"
#include "solvers/interior_point/augmented_system.hpp"
#include "solvers/interior_point/interior_point.hpp"
#include "solvers/interior_point/nesterov_todd.hpp"

namespace graybox {
namespace {

using Eigen::MatrixXd;

class DualNewton {
 public:
  DualNewton(const NormalizedSet& normal, AugmentedSystem& system, const SolveOptions& options,
             Tracer& tracer)
      : normal_(normal),
        system_(system),
        tracer_(tracer),
        evaluator_(normal),
        run_(normal, options, tracer),
        scaling_(normal.dimension()),
        d_(static_cast<Eigen::Index>(normal.dimension())),
        count_(normal.candidate_count()),
        scale_(symmetric_scale(normal.dimension())),
        entries_(normal.packed_size()),
        slack_(count_),
        multiplier_(count_),
        target_(count_),
        slack_step_(count_),
        multiplier_step_(count_),
        w_step_(d_, d_),
        scaled_step_(d_, d_),
        product_(d_, d_) {}

  Solution run() {
    start();
    while (run_.proceed(evaluator_.evaluate(multiplier_), evaluator_, multiplier_)) {
      if (!scaling_.compute(w_, evaluator_.factor(), evaluator_.inverse_factor())) {
        run_.fail("W is no longer positive definite");
        break;
      }
      if (!factorise()) {
        run_.fail("the p x p system is numerically singular");
        break;
      }
      if (!predict() || !correct()) {
        run_.fail("the Newton step is not finite");
        break;
      }
      step();
    }
    return run_.finish(slack_);
  }

 private:
  void start() {
    const double d = static_cast<double>(d_);
    double largest = 0.0;
    for (std::size_t i = 0; i < count_; ++i) {
      slack_[i] = trace(normal_.row(i));
      largest = std::max(largest, slack_[i] * normal_.row_norms()[i]);
    }
    tracer_.count_passes(1.0);
    const double theta = d / (1.1 * largest);
    w_ = theta * MatrixXd::Identity(d_, d_);
    for (std::size_t i = 0; i < count_; ++i) {
      const double norm = normal_.row_norms()[i];
      slack_[i] = d / norm - theta * slack_[i];
      multiplier_[i] = norm / (theta * static_cast<double>(count_));
    }
  }

  [[nodiscard]] double trace(std::span<const double> packed) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < normal_.dimension(); ++i) sum += packed[packed_index(i, i)];
    return sum;
  }

  bool factorise() {
    for (std::size_t i = 0; i < count_; ++i) target_[i] = multiplier_[i] / slack_[i];
    tracer_.count_passes(1.0);
    return system_.factorise(scaling_.inverse_scaling(), target_);
  }

  // t_i = -c_i/z_i for c_i = -s_i z_i.
  bool predict() {
    double product = 0.0;
    for (std::size_t i = 0; i < count_; ++i) {
      target_[i] = slack_[i];
      product += slack_[i] * multiplier_[i];
    }
    if (!solve_direction()) return false;

    const double t = std::min(
        {1.0, scaling_.step_to_boundary(scaled_step_), step_to_boundary(slack_, slack_step_)});
    const double u = std::min(1.0, step_to_boundary(multiplier_, multiplier_step_));
    double predicted = 0.0;
    for (std::size_t i = 0; i < count_; ++i) {
      predicted += (slack_[i] + t * slack_step_[i]) * (multiplier_[i] + u * multiplier_step_[i]);
    }
    centring_ = run_.centring(product, predicted);
    return true;
  }

  bool correct() {
    scaling_.add_second_order(scaled_step_);
    for (std::size_t i = 0; i < count_; ++i) {
      target_[i] -= (centring_ - slack_step_[i] * multiplier_step_[i]) / multiplier_[i];
    }
    return solve_direction();
  }

  // Solves (c) for the scaling's E and t = target_.
  bool solve_direction() {
    const std::size_t p = normal_.packed_size();
    product_.noalias() = scaling_.residual() * scaling_.inverse_scaling();
    w_step_.noalias() = scaling_.inverse_scaling().transpose() * product_;
    pack(w_step_.data(), normal_.dimension(), entries_.data());
    for (std::size_t k = 0; k < p; ++k) entries_[k] *= scale_[k];
    system_.solve(entries_, target_, multiplier_step_, slack_step_);
    tracer_.count_passes(2.0);
    if (!std::ranges::all_of(entries_, [](double x) { return std::isfinite(x); })) return false;
    for (double& step : slack_step_) step = -step;

    for (std::size_t k = 0; k < p; ++k) entries_[k] /= scale_[k];
    unpack(entries_.data(), normal_.dimension(), w_step_.data());
    product_.noalias() = w_step_ * scaling_.inverse_scaling().transpose();
    scaled_step_.noalias() = scaling_.inverse_scaling() * product_;
    return true;
  }

  void step() {
    const double fraction = boundary_fraction(evaluator_.gap());
    const double boundary =
        std::min(scaling_.step_to_boundary(scaled_step_), step_to_boundary(slack_, slack_step_));
    const double t = std::min(1.0, fraction * boundary);
    const double u = std::min(1.0, fraction * step_to_boundary(multiplier_, multiplier_step_));
    w_ += t * w_step_;
    for (std::size_t i = 0; i < count_; ++i) {
      slack_[i] += t * slack_step_[i];
      multiplier_[i] += u * multiplier_step_[i];
    }
  }

  const NormalizedSet& normal_;
  AugmentedSystem& system_;
  Tracer& tracer_;
  DesignEvaluator evaluator_;
  InteriorPointRun run_;
  NesterovTodd scaling_;
  Eigen::Index d_;
  std::size_t count_;
  std::vector<double> scale_;                        // 1 or sqrt(2)
  std::vector<double> entries_;                      // right side of (c), then dW
  std::vector<double> slack_, multiplier_, target_;  // s, z, t
  std::vector<double> slack_step_, multiplier_step_;
  MatrixXd w_, w_step_;
  MatrixXd scaled_step_;  // dW~
  MatrixXd product_;
  double centring_ = 0.0;  // sigma mu
};

}  // namespace

Solution solve_dual(const InformationSet& set, const SolveOptions& options, SolveObserver* observer,
                    NormalizedSetOptions coordinates, const MakeRangeSystem& make_system) {
  Tracer tracer(set, options, observer);
  coordinates.threads = options.threads;
  coordinates.accuracy = kRowAccuracy * options.duality_gap;
  const NormalizedSet normal(set, coordinates);
  tracer.count_passes(normal.passes());
  if (!normal.regular()) return unsupported(set, tracer, normal.message());
  AugmentedSystem system(normal, make_system(normal, options.threads), options.threads);
  return DualNewton(normal, system, options, tracer).run();
}

}  // namespace graybox
