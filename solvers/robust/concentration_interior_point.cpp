#include "solvers/robust/concentration_interior_point.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <utility>
#include <vector>

#include "problems/base/error.hpp"
#include "solvers/core/tracer.hpp"
#include "solvers/interior_point/information_step.hpp"
#include "solvers/interior_point/interior_point.hpp"
#include "solvers/interior_point/nesterov_todd.hpp"
#include "solvers/interior_point/primal_interior_point_low_rank.hpp"

namespace graybox {
namespace {

using Eigen::MatrixXd;
using Vector = std::vector<double>;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

double dot(std::span<const double> a, std::span<const double> b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

double sum_of(std::span<const double> x) { return std::accumulate(x.begin(), x.end(), 0.0); }

// The iterate, or a step of it.
struct Iterate {
  explicit Iterate(std::size_t count)
      : weight(count),
        reduced_cost(count),
        excess(count),
        excess_price(count),
        room(count),
        room_price(count) {}

  Vector weight, reduced_cost;  // lambda, s
  Vector excess, excess_price;  // u, z
  Vector room, room_price;      // a, y
  double slack = 0.0;           // v
  double limit_price = 0.0;     // eta
  double level = 0.0;           // t
  double simplex_price = 0.0;   // nu
};

// What the products of complementary pairs shall become in a step, less what they are.
struct Targets {
  explicit Targets(std::size_t count) : weight(count), excess(count), room(count) {}

  Vector weight, excess, room;  // c, c_u, c_a
  double slack = 0.0;           // c_v
};

// The best iterate so far.
struct BestIterate {
  double gap = kInfinity;
  Vector weight, reduced_cost;
};

// What the elimination of all but the weights, t and eta leaves, for each candidate.
struct Elimination {
  explicit Elimination(std::size_t count)
      : stiffness(count),
        share(count),
        compliance(count),
        follow(count),
        follow_image(count),
        constant(count),
        ratios(count) {}

  Vector stiffness;             // h
  Vector share;                 // kappa
  Vector compliance;            // 1/(p + q)
  Vector follow;                // k
  Vector follow_image;          // K k
  Vector constant;              // b
  Vector ratios;                // D
  double compliance_sum = 0.0;  // tau
};

// The Newton system at an iterate, factorised, and the directions that it gives.
class ConcentrationSystem {
 public:
  ConcentrationSystem(const NormalizedSet& normal, const ConcentrationLimit& limit,
                      const SolveOptions& options, Tracer& tracer, NesterovTodd& scaling)
      : limit_(limit),
        tracer_(tracer),
        scaling_(scaling),
        information_step_(normal, scaling),
        system_(make_low_rank_primal_system(normal, options.threads)),
        count_(normal.candidate_count()),
        positions_(static_cast<double>(limit.positions)),
        eliminated_(count_),
        residual_traces_(count_),
        right_side_(count_),
        border_{Vector(count_), Vector(count_), Vector(count_)} {}

  // p, q and what follows from them, K + D^-1, and the border with its Schur complement.
  [[nodiscard]] bool factorise(const Iterate& at) {
    eliminated_.compliance_sum = at.slack / at.limit_price;
    double tied = 0.0, fixed = 0.0;
    for (std::size_t i = 0; i < count_; ++i) {
      const double p = at.excess_price[i] / at.excess[i];
      const double q = at.room_price[i] / at.room[i];
      const double own = at.reduced_cost[i] / at.weight[i];
      eliminated_.compliance[i] = 1.0 / (p + q);
      eliminated_.share[i] = q * eliminated_.compliance[i];
      eliminated_.stiffness[i] = p * eliminated_.share[i];
      eliminated_.ratios[i] = 1.0 / (own + eliminated_.stiffness[i]);
      eliminated_.follow[i] = eliminated_.stiffness[i] * eliminated_.ratios[i];
      const double lag = own * eliminated_.ratios[i];  // 1 - k
      tied += eliminated_.stiffness[i] * lag;
      fixed += eliminated_.share[i] * lag;
      eliminated_.compliance_sum += eliminated_.compliance[i];
    }
    if (!system_->factorise(scaling_.inverse_scaling(), eliminated_.ratios)) return false;
    information_step_.apply_hessian(eliminated_.follow, eliminated_.follow_image);
    Eigen::Matrix3d schur;
    schur << 0.0, sum_of(eliminated_.follow), 0.0,  //
        sum_of(eliminated_.follow), tied + dot(eliminated_.follow, eliminated_.follow_image),
        positions_ - fixed,  //
        0.0, positions_ - fixed, -eliminated_.compliance_sum;
    std::ranges::fill(border_[0], 1.0);
    border_[1] = eliminated_.follow_image;
    border_[2] = eliminated_.share;
    for (int column = 0; column < 3; ++column) {
      solved_ = border_[static_cast<std::size_t>(column)];
      system_->solve(solved_);
      inverse_border_[static_cast<std::size_t>(column)] = solved_;
      for (int row = 0; row < 3; ++row) {
        schur(row, column) -= dot(border_[static_cast<std::size_t>(row)], solved_);
      }
    }
    tracer_.count_passes(system_->factorise_passes() + 3.0 * system_->solve_passes() + 2.0);
    border_factor_.setThreshold(0.0);
    border_factor_.compute(schur);
    return schur.allFinite() && border_factor_.isInvertible();
  }

  // g = tr(G E G^T B_i); again whenever E has changed.
  void price_residual() {
    information_step_.residual_traces(residual_traces_);
    tracer_.count_passes(1.0);
  }

  // The whole Newton step for the targets and the scaling's E.
  [[nodiscard]] bool solve(const Iterate& at, const Targets& targets, Iterate& step) {
    const Eigen::Vector3d border_right = form_right_side(at, targets);
    solved_ = right_side_;
    system_->solve(solved_);
    Eigen::Vector3d x = border_right;
    for (int row = 0; row < 3; ++row) {
      x(row) -= dot(border_[static_cast<std::size_t>(row)], solved_);
    }
    x = border_factor_.solve(x).eval();
    step.simplex_price = x(0);
    step.level = x(1);
    step.limit_price = x(2);
    for (std::size_t i = 0; i < count_; ++i) {
      step.weight[i] = solved_[i] - x(0) * inverse_border_[0][i] - x(1) * inverse_border_[1][i] -
                       x(2) * inverse_border_[2][i] + eliminated_.follow[i] * x(1);
    }
    tracer_.count_passes(system_->solve_passes() + 2.0);
    recover_pairs(at, targets, step);
    return std::isfinite(sum_of(step.weight)) && x.allFinite();
  }

  // The step of M and W that belongs to the last direction.
  [[nodiscard]] const InformationStep& information_step() const { return information_step_; }

 private:
  // R = c/lambda + g - b, and the right side of the border.
  Eigen::Vector3d form_right_side(const Iterate& at, const Targets& targets) {
    double constants = 0.0, spread = 0.0;
    for (std::size_t i = 0; i < count_; ++i) {
      const double from_excess = targets.excess[i] / at.excess[i];
      const double from_room = targets.room[i] / at.room[i];
      eliminated_.constant[i] =
          (1.0 - eliminated_.share[i]) * from_room - eliminated_.share[i] * from_excess;
      right_side_[i] =
          residual_traces_[i] + targets.weight[i] / at.weight[i] - eliminated_.constant[i];
      constants += eliminated_.constant[i];
      spread += (from_excess + from_room) * eliminated_.compliance[i];
    }
    const double missing_price = sum_of(at.room_price) - positions_ * at.limit_price;
    const double missing_budget =
        limit_.share - positions_ * at.level - sum_of(at.excess) - at.slack;
    return {1.0 - sum_of(at.weight),
            constants + missing_price + dot(eliminated_.follow, right_side_),
            missing_budget - spread - targets.slack / at.limit_price};
  }

  // What was eliminated, each in the form that does not cancel.
  void recover_pairs(const Iterate& at, const Targets& targets, Iterate& step) {
    information_step_.compute(step.weight, step.reduced_cost);
    for (std::size_t i = 0; i < count_; ++i) {
      const double from_excess = targets.excess[i] / at.excess[i];
      const double from_room = targets.room[i] / at.room[i];
      const double relative = step.weight[i] - step.level;
      const double pushed =
          (from_excess + from_room - step.limit_price) * eliminated_.compliance[i];
      step.excess[i] = eliminated_.share[i] * relative + pushed;
      step.room[i] = (eliminated_.share[i] - 1.0) * relative + pushed;
      step.room_price[i] = eliminated_.stiffness[i] * relative +
                           eliminated_.share[i] * step.limit_price + eliminated_.constant[i];
      step.excess_price[i] = from_excess - at.excess_price[i] / at.excess[i] * step.excess[i];
      step.reduced_cost[i] = step.simplex_price - step.reduced_cost[i] + step.room_price[i];
    }
    step.slack = (targets.slack - at.slack * step.limit_price) / at.limit_price;
  }

  const ConcentrationLimit limit_;
  Tracer& tracer_;
  NesterovTodd& scaling_;
  InformationStep information_step_;
  std::unique_ptr<PrimalSystem> system_;
  std::size_t count_;
  double positions_;  // r
  Elimination eliminated_;
  Vector residual_traces_;  // g
  Vector right_side_, solved_;
  std::array<Vector, 3> border_;          // 1, K k, kappa
  std::array<Vector, 3> inverse_border_;  // (K + D^-1)^-1 of them
  Eigen::FullPivLU<Eigen::Matrix3d> border_factor_;
};

class ConcentrationNewton {
 public:
  ConcentrationNewton(const NormalizedSet& normal, const ConcentrationLimit& limit,
                      const SolveOptions& options, Tracer& tracer)
      : limit_(limit),
        options_(options),
        tracer_(tracer),
        evaluator_(normal),
        scaling_(normal.dimension()),
        system_(normal, limit, options, tracer, scaling_),
        count_(normal.candidate_count()),
        positions_(static_cast<double>(limit.positions)),
        dimension_(static_cast<double>(normal.dimension())),
        target_gap_(0.98 * options.duality_gap),
        at_(count_),
        step_(count_),
        targets_(count_),
        kept_targets_(count_) {
    const auto d = static_cast<Eigen::Index>(normal.dimension());
    w_ = MatrixXd::Identity(d, d);
  }

  Solution run() {
    constexpr std::int64_t kPatience = 15;
    constexpr std::int64_t kIterationLimit = 200;
    const std::int64_t limit =
        options_.iteration_limit > 0 ? options_.iteration_limit : kIterationLimit;
    std::ranges::fill(at_.weight, 1.0 / static_cast<double>(count_));
    for (std::int64_t since_progress = 0;; ++iteration_) {
      if (!evaluator_.evaluate(at_.weight)) {
        return fail("the information matrix of the iterate is numerically singular");
      }
      if (iteration_ == 0) start();
      const double gap = measure_gap(evaluator_);
      since_progress = gap < 0.9 * best_.gap ? 0 : since_progress + 1;
      keep_if_better(gap);
      if (gap <= target_gap_) return finish(SolveStatus::kSolved);
      if (tracer_.out_of_time()) return finish(SolveStatus::kTimeLimit);
      if (iteration_ >= limit) return finish(SolveStatus::kIterationLimit);
      if (since_progress >= kPatience) {
        return fail(fmt::format("no progress in {} iterations", kPatience));
      }
      if (!scaling_.compute(w_, evaluator_.factor(), evaluator_.inverse_factor())) {
        return fail("W is no longer positive definite");
      }
      if (!system_.factorise(at_)) return fail("the Newton system is numerically singular");
      if (!predict() || !correct() || !centre()) return fail("the Newton step is not finite");
      move();
    }
  }

 private:
  void start() {
    const auto q = static_cast<double>(count_);
    const double rho = positions_ / q;
    const double spare = limit_.share - rho;
    // M = I up to rounding, so that the evaluator's traces are the tr B_i.
    const double top = 1.1 * *std::ranges::max_element(evaluator_.traces());
    at_.limit_price = 2.0 * top / spare;
    const double mu = at_.limit_price * spare / (2.0 * q + 1.0);  // about s/Q where tr B_i is small
    const double price = at_.limit_price * rho;
    const double excess = mu / (at_.limit_price - price), room = mu / price;
    std::ranges::fill(at_.room_price, price);
    std::ranges::fill(at_.excess_price, at_.limit_price - price);
    std::ranges::fill(at_.excess, excess);
    std::ranges::fill(at_.room, room);
    at_.slack = mu / at_.limit_price;
    at_.level = 1.0 / q + room - excess;
    at_.simplex_price = top - price;
    for (std::size_t i = 0; i < count_; ++i) {
      at_.reduced_cost[i] = top - evaluator_.traces()[i];
    }
  }

  // L/d - 1 of the design that was evaluated last.
  double measure_gap(const DesignEvaluator& evaluator) {
    tracer_.count_passes(2.0);
    sensitivity_.assign(evaluator.traces().begin(), evaluator.traces().end());
    const double weight_sum = evaluator.weight_sum();
    return static_cast<double>(maximise_over_limit(sensitivity_, limit_).value) * weight_sum /
               dimension_ -
           1.0;
  }

  void keep_if_better(double gap) {
    tracer_.record(gap, iteration_);
    if (!(gap < best_.gap) && iteration_ > 0) return;
    best_.gap = gap;
    best_.weight = at_.weight;
    best_.reduced_cost = at_.reduced_cost;
  }

  bool predict() {
    system_.price_residual();
    for (std::size_t i = 0; i < count_; ++i) {
      targets_.weight[i] = -at_.weight[i] * at_.reduced_cost[i];
      targets_.excess[i] = -at_.excess[i] * at_.excess_price[i];
      targets_.room[i] = -at_.room[i] * at_.room_price[i];
    }
    targets_.slack = -at_.slack * at_.limit_price;
    if (!system_.solve(at_, targets_, step_)) return false;

    const double product = complementarity(0.0);
    const double predicted = complementarity(std::min(1.0, step_to_any_boundary()));
    const double ratio = std::clamp(predicted / product, 0.0, 1.0);
    const double floor = 0.02 * target_gap_ * dimension_;  // as InteriorPointRun::centring
    centring_ = std::max(ratio * ratio * ratio * product, floor) /
                (3.0 * static_cast<double>(count_) + 1.0);
    return true;
  }

  bool correct() {
    scaling_.add_second_order(system_.information_step().scaled_w_step());
    system_.price_residual();
    for (std::size_t i = 0; i < count_; ++i) {
      targets_.weight[i] += centring_ - step_.weight[i] * step_.reduced_cost[i];
      targets_.excess[i] += centring_ - step_.excess[i] * step_.excess_price[i];
      targets_.room[i] += centring_ - step_.room[i] * step_.room_price[i];
    }
    targets_.slack += centring_ - step_.slack * step_.limit_price;
    return system_.solve(at_, targets_, step_);
  }

  // Up to two of Gondzio's (1996) correctors: where a longer step would leave products far from
  // their target, the targets are changed by what would bring them back, and the changed direction
  // is taken if it does allow a longer step.
  bool centre() {
    double reached = std::min(1.0, step_to_any_boundary());
    for (int k = 0; k < 2 && reached < 0.95; ++k) {
      kept_targets_ = targets_;
      aim_at_products(std::min(1.0, 1.5 * reached + 0.3));
      if (!system_.solve(at_, targets_, step_)) return false;
      const double now = std::min(1.0, step_to_any_boundary());
      if (now < reached + 0.02) {
        std::swap(targets_, kept_targets_);
        return system_.solve(at_, targets_, step_);
      }
      reached = now;
    }
    return true;
  }

  void aim_at_products(double t) {
    const auto correction = [&](double x, double dx, double s, double ds) {
      const double product = (x + t * dx) * (s + t * ds);
      const double wanted = std::clamp(product, 0.1 * centring_, 10.0 * centring_);
      return std::max(wanted - product, -10.0 * centring_);
    };
    for (std::size_t i = 0; i < count_; ++i) {
      targets_.weight[i] +=
          correction(at_.weight[i], step_.weight[i], at_.reduced_cost[i], step_.reduced_cost[i]);
      targets_.excess[i] +=
          correction(at_.excess[i], step_.excess[i], at_.excess_price[i], step_.excess_price[i]);
      targets_.room[i] +=
          correction(at_.room[i], step_.room[i], at_.room_price[i], step_.room_price[i]);
    }
    targets_.slack += correction(at_.slack, step_.slack, at_.limit_price, step_.limit_price);
  }

  // The sum of all products after a step t.
  [[nodiscard]] double complementarity(double t) const {
    double sum = (at_.slack + t * step_.slack) * (at_.limit_price + t * step_.limit_price);
    for (std::size_t i = 0; i < count_; ++i) {
      sum += (at_.weight[i] + t * step_.weight[i]) *
                 (at_.reduced_cost[i] + t * step_.reduced_cost[i]) +
             (at_.excess[i] + t * step_.excess[i]) *
                 (at_.excess_price[i] + t * step_.excess_price[i]) +
             (at_.room[i] + t * step_.room[i]) * (at_.room_price[i] + t * step_.room_price[i]);
    }
    return sum;
  }

  static double boundary(double x, double dx) { return dx < 0.0 ? -x / dx : kInfinity; }

  // One length for all: a step of the prices without that of the weights would leave W M = I
  // behind, and runs with two lengths were found to stall.
  [[nodiscard]] double step_to_any_boundary() {
    return std::min({step_to_boundary(at_.weight, step_.weight),
                     step_to_boundary(at_.excess, step_.excess),
                     step_to_boundary(at_.room, step_.room), boundary(at_.slack, step_.slack),
                     step_to_boundary(at_.reduced_cost, step_.reduced_cost),
                     step_to_boundary(at_.excess_price, step_.excess_price),
                     step_to_boundary(at_.room_price, step_.room_price),
                     boundary(at_.limit_price, step_.limit_price),
                     scaling_.step_to_boundary(system_.information_step().scaled_w_step())});
  }

  void move() {
    const double t = std::min(1.0, boundary_fraction(best_.gap) * step_to_any_boundary());
    for (std::size_t i = 0; i < count_; ++i) {
      at_.weight[i] += t * step_.weight[i];
      at_.excess[i] += t * step_.excess[i];
      at_.room[i] += t * step_.room[i];
      at_.reduced_cost[i] += t * step_.reduced_cost[i];
      at_.excess_price[i] += t * step_.excess_price[i];
      at_.room_price[i] += t * step_.room_price[i];
    }
    at_.slack += t * step_.slack;
    at_.level += t * step_.level;
    at_.limit_price += t * step_.limit_price;
    at_.simplex_price += t * step_.simplex_price;
    w_ += t * system_.information_step().w_step();
  }

  Solution fail(const std::string& message) {
    message_ =
        fmt::format("{}; best duality gap {:.3g} in {} iterations", message, best_.gap, iteration_);
    return finish(best_.gap <= options_.duality_gap ? SolveStatus::kSolved
                                                    : SolveStatus::kNumericalFailure);
  }

  Solution finish(SolveStatus status) {
    if (status == SolveStatus::kSolved) clear_negligible_weights();
    const double sum = sum_of(best_.weight);
    for (double& weight : best_.weight) weight /= sum;
    return tracer_.finish({std::move(best_.weight)}, status, iteration_, std::move(message_));
  }

  // Sets the weights to zero that the pair (lambda_i, s_i) marks as outside the support, if the gap
  // stays within the target.
  void clear_negligible_weights() {
    Vector kept(count_);
    for (const double threshold : {1.0, 1e-2, 1e-4}) {
      for (std::size_t i = 0; i < count_; ++i) {
        const bool inside = best_.weight[i] * dimension_ >= threshold * best_.reduced_cost[i];
        kept[i] = inside ? best_.weight[i] : 0.0;
      }
      if (!restore_limit(kept) || !evaluator_.evaluate(kept)) continue;
      if (measure_gap(evaluator_) > target_gap_) continue;
      best_.weight = std::move(kept);
      return;
    }
  }

  // Renormalised weights exceed the limit by a little; mixing in the uniform design on the support
  // brings them back.
  bool restore_limit(Vector& weights) const {
    const double sum = sum_of(weights);
    if (!(sum > 0.0)) return false;
    for (double& weight : weights) weight /= sum;
    const double excess = concentration(weights, limit_.positions) - limit_.share;
    if (excess <= 0.0) return true;
    const auto support = static_cast<double>(
        std::ranges::count_if(weights, [](double weight) { return weight > 0.0; }));
    const double uniform = positions_ / support;
    if (!(uniform < limit_.share)) return false;
    const double mixed = excess / (excess + limit_.share - uniform);
    for (double& weight : weights) {
      if (weight > 0.0) weight = (1.0 - mixed) * weight + mixed / support;
    }
    return true;
  }

  const ConcentrationLimit limit_;
  const SolveOptions& options_;
  Tracer& tracer_;
  DesignEvaluator evaluator_;
  NesterovTodd scaling_;
  ConcentrationSystem system_;
  std::size_t count_;
  double positions_;  // r
  double dimension_;
  double target_gap_;
  MatrixXd w_;
  Iterate at_;
  Iterate step_;
  Targets targets_, kept_targets_;
  double centring_ = 0.0;  // sigma mu
  std::vector<Extended> sensitivity_;
  std::int64_t iteration_ = 0;
  BestIterate best_;
  std::string message_;
};

void require_fitting(const ConcentrationLimit& limit, std::size_t candidate_count) {
  const auto count = static_cast<double>(candidate_count);
  // Throws for whatever does not fit.
  static_cast<void>(concentration_limit(limit.share, static_cast<double>(limit.positions) / count,
                                        candidate_count));
}

}  // namespace

Solution solve_concentrated(const InformationSet& set, const ConcentrationLimit& limit,
                            const SolveOptions& options, SolveObserver* observer) {
  const std::size_t count = set.candidate_count();
  require_fitting(limit, count);
  if (limit.share == 1.0) return PrimalInteriorPointLowRank().solve(set, options, observer);
  Tracer tracer(set, options, observer);
  const double uniform_share = static_cast<double>(limit.positions) / static_cast<double>(count);
  if (limit.share <= uniform_share * (1.0 + 1e-12)) {
    return tracer.finish({Vector(count, 1.0 / static_cast<double>(count))}, SolveStatus::kSolved, 0,
                         "the limit leaves only equal weights");
  }
  const NormalizedSet normal(set, {.scale_rows = false, .threads = options.threads});
  tracer.count_passes(normal.passes());
  if (!normal.regular()) return unsupported(set, tracer, normal.message());
  return ConcentrationNewton(normal, limit, options, tracer).run();
}

}  // namespace graybox
