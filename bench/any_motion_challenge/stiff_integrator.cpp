#include "bench/any_motion_challenge/stiff_integrator.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "diagnosis/simulation/plant.hpp"

namespace graybox::bench {
namespace {

constexpr int kColumns = 5;
constexpr double kTurnTolerance = 1e4;
constexpr double kShortest = 1e-11;  // s

}  // namespace

void StiffIntegrator::differentiate(const Rate& rate, const State& state) {
  const Eigen::Index n = state.size();
  at_state_.resize(n);
  rate(state, at_state_);
  jacobian_.resize(n, n);
  State moved = state, there(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double change = 1e-7 * (std::abs(state(i)) + 1e-3);
    moved(i) = state(i) + change;
    rate(moved, there);
    jacobian_.col(i) = (there - at_state_) / change;
    moved(i) = state(i);
  }
}

double StiffIntegrator::attempt(const Rate& rate, double step, const State& state, State& next) {
  const Eigen::Index n = state.size();
  std::array<State, kColumns> row, above;  // T_(j,1) ..., of this j and the one before
  State slope(n), last(n);
  for (int j = 1; j <= kColumns; ++j) {
    const double part = step / j;
    const Eigen::PartialPivLU<Matrix> factors(Matrix(Matrix::Identity(n, n) - part * jacobian_));
    State at = state + factors.solve(State(part * at_state_));
    for (int k = 1; k < j; ++k) {
      rate(at, slope);
      last = at;
      at += factors.solve(State(part * slope));
    }
    row[0] = at;
    for (int k = 1; k < j; ++k) {
      const auto column = static_cast<std::size_t>(k);
      const double ratio = static_cast<double>(j) / (j - k);
      row[column] = row[column - 1] + (row[column - 1] - above[column - 1]) / (ratio - 1.0);
    }
    above = row;
  }
  next = row[kColumns - 1];
  State there(n);
  rate(next, there);
  const State turn = (step / kColumns) * (there - slope - jacobian_ * (next - last));
  double error = 0.0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double allowed = tolerance_.absolute + tolerance_.relative * std::abs(state(i));
    error = std::max({error, std::abs(next(i) - row[kColumns - 2](i)) / allowed,
                      std::abs(turn(i)) / (kTurnTolerance * allowed)});
    if (!std::isfinite(next(i)) || !std::isfinite(there(i)))
      return std::numeric_limits<double>::infinity();
  }
  return error;
}

void StiffIntegrator::advance(const Rate& rate, double duration, State& state) {
  double left = duration;
  State next;
  while (left > 1e-12 * duration) {
    differentiate(rate, state);
    if (!at_state_.allFinite()) throw UnstableMotion("a state is no number");
    for (;;) {
      const bool is_last = step_ >= left;
      const double step = is_last ? left : step_;
      const double error = attempt(rate, step, state, next);
      const double factor = std::clamp(0.8 * std::pow(std::max(error, 1e-10), -0.2), 0.1, 4.0);
      if (error <= 1.0) {
        state = next;
        left = is_last ? 0.0 : left - step;
        // A step cut short by the end of the segment tells nothing against longer ones.
        step_ = is_last ? std::max(step_, factor * step) : factor * step;
        break;
      }
      step_ = factor * step;
      if (!(step_ > kShortest)) throw UnstableMotion("the integrator's steps vanish");
    }
  }
}

}  // namespace graybox::bench
