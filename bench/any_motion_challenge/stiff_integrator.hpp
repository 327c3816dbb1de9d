// StiffIntegrator: x' = f(x) by the linearly implicit Euler method, extrapolated (Deuflhard 1985;
// Hairer and Wanner, Solving Ordinary Differential Equations II, IV.9). It shares nothing with the
// integrators of the diagnosis (explicit Dormand and Prince in diagnosis/simulation, Runge and
// Kutta in diagnosis/predictor), and dry friction whose sign is rounded finely may be stiff for it.
//
// A step of length h is made of j = 1 ... 5 steps (I - (h/j) J) dx = (h/j) f(x), J = df/dx by
// differences once a step, and the five results are extrapolated by Aitken and Neville:
//
//   T_(j,1) the result of j steps,  T_(j,k+1) = T_(j,k) + (T_(j,k) - T_(j-1,k)) / (j/(j-k) - 1).
//
// T_(5,5) is of order 5, whatever J is; |T_(5,5) - T_(5,4)| sets the next h. L-stable in each part.
//
// None of these steps looks at f where it ends, so a friction that turns round within the last
// fifth of h would pass unseen. So a step is also refused where f there is not what it was before
// that fifth and J says: (h/5) |f(end) - f(last) - J (end - last)| above 10000 times the tolerance.
//
//   StiffIntegrator integrator({1e-8, 1e-10});
//   integrator.advance(rate, 0.002, state);
//
// Cost: n + 16 calls of f and five factorisations of n x n a step.
#pragma once

#include <Eigen/Core>
#include <functional>

namespace graybox::bench {

inline constexpr int kMostStates = 16;

class StiffIntegrator {
 public:
  using State = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMostStates, 1>;
  using Rate = std::function<void(const State& state, State& rate)>;  // sizes alike

  struct Tolerance {
    double relative = 1e-8, absolute = 1e-10;  // of each state, a step
  };

  explicit StiffIntegrator(Tolerance tolerance) : tolerance_(tolerance) {}

  // Through `duration`, s; the next step begins with the length that the last one suggests. Throws
  // UnstableMotion (diagnosis/simulation/plant.hpp) where steps vanish or a state is no number.
  void advance(const Rate& rate, double duration, State& state);

 private:
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMostStates, kMostStates>;

  // The error over the tolerance; `next` is T_(5,5).
  [[nodiscard]] double attempt(const Rate& rate, double step, const State& state, State& next);
  void differentiate(const Rate& rate, const State& state);

  Tolerance tolerance_;
  double step_ = 1e-4;
  State at_state_;  // f at the state of the step
  Matrix jacobian_;
};

}  // namespace graybox::bench
