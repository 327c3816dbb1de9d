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

class ConcentrationNewton {
 public:
  ConcentrationNewton(const NormalizedSet& normal, const ConcentrationLimit& limit,
                      const SolveOptions& options, Tracer& tracer)
      : normal_(normal),
        limit_(limit),
        options_(options),
        tracer_(tracer),
        evaluator_(normal),
        scaling_(normal.dimension()),
        information_step_(normal, scaling_),
        system_(make_low_rank_primal_system(normal, options.threads)),
        count_(normal.candidate_count()),
        positions_(static_cast<double>(limit.positions)),
        dimension_(static_cast<double>(normal.dimension())),
        target_gap_(0.98 * options.duality_gap),
        at_(count_),
        step_(count_),
        targets_(count_),
        kept_targets_(count_),
        stiffness_(count_),
        share_(count_),
        compliance_(count_),
        follow_(count_),
        follow_image_(count_),
        constant_(count_),
        ratios_(count_),
        residual_traces_(count_),
        right_side_(count_),
        border_{Vector(count_), Vector(count_), Vector(count_)} {
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
      since_progress = gap < 0.9 * best_gap_ ? 0 : since_progress + 1;
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
      if (!factorise()) return fail("the Newton system is numerically singular");
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
    if (!(gap < best_gap_) && iteration_ > 0) return;
    best_gap_ = gap;
    best_weight_ = at_.weight;
    best_reduced_cost_ = at_.reduced_cost;
  }

  // p, q and what follows from them, K + D^-1, and the border with its Schur complement.
  bool factorise() {
    compliance_sum_ = at_.slack / at_.limit_price;
    double tied = 0.0, fixed = 0.0;
    for (std::size_t i = 0; i < count_; ++i) {
      const double p = at_.excess_price[i] / at_.excess[i];
      const double q = at_.room_price[i] / at_.room[i];
      const double own = at_.reduced_cost[i] / at_.weight[i];
      compliance_[i] = 1.0 / (p + q);
      share_[i] = q * compliance_[i];
      stiffness_[i] = p * share_[i];
      ratios_[i] = 1.0 / (own + stiffness_[i]);
      follow_[i] = stiffness_[i] * ratios_[i];
      const double lag = own * ratios_[i];  // 1 - k
      tied += stiffness_[i] * lag;
      fixed += share_[i] * lag;
      compliance_sum_ += compliance_[i];
    }
    if (!system_->factorise(scaling_.inverse_scaling(), ratios_)) return false;
    information_step_.apply_hessian(follow_, follow_image_);
    corner_ << 0.0, sum_of(follow_), 0.0,                                         //
        sum_of(follow_), tied + dot(follow_, follow_image_), positions_ - fixed,  //
        0.0, positions_ - fixed, -compliance_sum_;
    std::ranges::fill(border_[0], 1.0);
    border_[1] = follow_image_;
    border_[2] = share_;
    Eigen::Matrix3d schur = corner_;
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

  bool predict() {
    price_residual();
    for (std::size_t i = 0; i < count_; ++i) {
      targets_.weight[i] = -at_.weight[i] * at_.reduced_cost[i];
      targets_.excess[i] = -at_.excess[i] * at_.excess_price[i];
      targets_.room[i] = -at_.room[i] * at_.room_price[i];
    }
    targets_.slack = -at_.slack * at_.limit_price;
    if (!solve_direction()) return false;

    const double product = complementarity(0.0);
    const double predicted = complementarity(std::min(1.0, step_to_any_boundary()));
    const double ratio = std::clamp(predicted / product, 0.0, 1.0);
    const double floor = 0.02 * target_gap_ * dimension_;  // as InteriorPointRun::centring
    centring_ = std::max(ratio * ratio * ratio * product, floor) /
                (3.0 * static_cast<double>(count_) + 1.0);
    return true;
  }

  bool correct() {
    scaling_.add_second_order(information_step_.scaled_w_step());
    price_residual();
    for (std::size_t i = 0; i < count_; ++i) {
      targets_.weight[i] += centring_ - step_.weight[i] * step_.reduced_cost[i];
      targets_.excess[i] += centring_ - step_.excess[i] * step_.excess_price[i];
      targets_.room[i] += centring_ - step_.room[i] * step_.room_price[i];
    }
    targets_.slack += centring_ - step_.slack * step_.limit_price;
    return solve_direction();
  }

  // Up to two of Gondzio's (1996) correctors: where a longer step would leave products far from
  // their target, the targets are changed by what would bring them back, and the changed direction
  // is taken if it does allow a longer step.
  bool centre() {
    double reached = std::min(1.0, step_to_any_boundary());
    for (int k = 0; k < 2 && reached < 0.95; ++k) {
      kept_targets_ = targets_;
      aim_at_products(std::min(1.0, 1.5 * reached + 0.3));
      if (!solve_direction()) return false;
      const double now = std::min(1.0, step_to_any_boundary());
      if (now < reached + 0.02) {
        std::swap(targets_, kept_targets_);
        return solve_direction();
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

  // The whole Newton step for the targets and the scaling's E.
  bool solve_direction() {
    const Eigen::Vector3d border_right = form_right_side();
    solved_ = right_side_;
    system_->solve(solved_);
    Eigen::Vector3d x = border_right;
    for (int row = 0; row < 3; ++row) {
      x(row) -= dot(border_[static_cast<std::size_t>(row)], solved_);
    }
    x = border_factor_.solve(x).eval();
    step_.simplex_price = x(0);
    step_.level = x(1);
    step_.limit_price = x(2);
    for (std::size_t i = 0; i < count_; ++i) {
      step_.weight[i] = solved_[i] - x(0) * inverse_border_[0][i] - x(1) * inverse_border_[1][i] -
                        x(2) * inverse_border_[2][i] + follow_[i] * x(1);
    }
    tracer_.count_passes(system_->solve_passes() + 2.0);
    recover_pairs();
    return std::isfinite(sum_of(step_.weight)) && x.allFinite();
  }

  // R = c/lambda + g - b, and the right side of the border.
  Eigen::Vector3d form_right_side() {
    double constants = 0.0, spread = 0.0;
    for (std::size_t i = 0; i < count_; ++i) {
      const double from_excess = targets_.excess[i] / at_.excess[i];
      const double from_room = targets_.room[i] / at_.room[i];
      constant_[i] = (1.0 - share_[i]) * from_room - share_[i] * from_excess;
      right_side_[i] = residual_traces_[i] + targets_.weight[i] / at_.weight[i] - constant_[i];
      constants += constant_[i];
      spread += (from_excess + from_room) * compliance_[i];
    }
    const double missing_price = sum_of(at_.room_price) - positions_ * at_.limit_price;
    const double missing_budget =
        limit_.share - positions_ * at_.level - sum_of(at_.excess) - at_.slack;
    return {1.0 - sum_of(at_.weight), constants + missing_price + dot(follow_, right_side_),
            missing_budget - spread - targets_.slack / at_.limit_price};
  }

  // What was eliminated, each in the form that does not cancel.
  void recover_pairs() {
    information_step_.compute(step_.weight, step_.reduced_cost);
    for (std::size_t i = 0; i < count_; ++i) {
      const double from_excess = targets_.excess[i] / at_.excess[i];
      const double from_room = targets_.room[i] / at_.room[i];
      const double relative = step_.weight[i] - step_.level;
      const double pushed = (from_excess + from_room - step_.limit_price) * compliance_[i];
      step_.excess[i] = share_[i] * relative + pushed;
      step_.room[i] = (share_[i] - 1.0) * relative + pushed;
      step_.room_price[i] = stiffness_[i] * relative + share_[i] * step_.limit_price + constant_[i];
      step_.excess_price[i] = from_excess - at_.excess_price[i] / at_.excess[i] * step_.excess[i];
      step_.reduced_cost[i] = step_.simplex_price - step_.reduced_cost[i] + step_.room_price[i];
    }
    step_.slack = (targets_.slack - at_.slack * step_.limit_price) / at_.limit_price;
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
                     scaling_.step_to_boundary(information_step_.scaled_w_step())});
  }

  void move() {
    const double t = std::min(1.0, boundary_fraction(best_gap_) * step_to_any_boundary());
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
    w_ += t * information_step_.w_step();
  }

  Solution fail(const std::string& message) {
    message_ =
        fmt::format("{}; best duality gap {:.3g} in {} iterations", message, best_gap_, iteration_);
    return finish(best_gap_ <= options_.duality_gap ? SolveStatus::kSolved
                                                    : SolveStatus::kNumericalFailure);
  }

  Solution finish(SolveStatus status) {
    if (status == SolveStatus::kSolved) clear_negligible_weights();
    const double sum = sum_of(best_weight_);
    for (double& weight : best_weight_) weight /= sum;
    return tracer_.finish({std::move(best_weight_)}, status, iteration_, std::move(message_));
  }

  // Sets the weights to zero that the pair (lambda_i, s_i) marks as outside the support, if the gap
  // stays within the target.
  void clear_negligible_weights() {
    Vector kept(count_);
    for (const double threshold : {1.0, 1e-2, 1e-4}) {
      for (std::size_t i = 0; i < count_; ++i) {
        const bool inside = best_weight_[i] * dimension_ >= threshold * best_reduced_cost_[i];
        kept[i] = inside ? best_weight_[i] : 0.0;
      }
      if (!restore_limit(kept) || !evaluator_.evaluate(kept)) continue;
      if (measure_gap(evaluator_) > target_gap_) continue;
      best_weight_ = std::move(kept);
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

  const NormalizedSet& normal_;
  const ConcentrationLimit limit_;
  const SolveOptions& options_;
  Tracer& tracer_;
  DesignEvaluator evaluator_;
  NesterovTodd scaling_;
  InformationStep information_step_;
  std::unique_ptr<PrimalSystem> system_;
  std::size_t count_;
  double positions_;  // r
  double dimension_;
  double target_gap_;
  MatrixXd w_;
  Iterate at_;
  Iterate step_;
  Targets targets_, kept_targets_;
  Vector stiffness_;        // h
  Vector share_;            // kappa
  Vector compliance_;       // 1/(p + q)
  Vector follow_;           // k
  Vector follow_image_;     // K k
  Vector constant_;         // b
  Vector ratios_;           // D
  Vector residual_traces_;  // g
  Vector right_side_, solved_;
  double compliance_sum_ = 0.0;           // tau
  std::array<Vector, 3> border_;          // 1, K k, kappa
  std::array<Vector, 3> inverse_border_;  // (K + D^-1)^-1 of them
  Eigen::Matrix3d corner_;
  Eigen::FullPivLU<Eigen::Matrix3d> border_factor_;
  double centring_ = 0.0;  // sigma mu
  std::vector<Extended> sensitivity_;
  std::int64_t iteration_ = 0;
  double best_gap_ = kInfinity;
  Vector best_weight_, best_reduced_cost_;
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
