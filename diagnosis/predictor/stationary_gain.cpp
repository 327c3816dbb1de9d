#include "diagnosis/predictor/stationary_gain.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kDoublings = 40;
constexpr double kSettled = 1e-10;    // relative change of P
constexpr double kForgetting = 1e-6;  // for what is neither seen nor dies away

struct LinearModel {
  MatrixXd a, c;
};

LinearModel linear_model(Predictor& predictor) {
  const Index n = predictor.state_count();
  LinearModel model{MatrixXd(n, n), MatrixXd(predictor.output_count(), n)};
  VectorXd outputs, state;
  for (Index i = 0; i < n; ++i) {
    state = VectorXd::Unit(n, i);
    predictor.linear_outputs(state, outputs);
    model.c.col(i) = outputs;
    predictor.linear_step(state);
    model.a.col(i) = state;
  }
  return model;
}

// Covariance of white force noise that is spread over each sample: on velocities by h/m, on
// positions by h^2/(2 m).
MatrixXd process_noise(const LumpedModel& model, Index states, double sample_time,
                       double intensity) {
  MatrixXd q = MatrixXd::Zero(states, states);
  Index free = 0, slot = 0;
  for (const bool imposed : model.imposed) free += imposed ? 0 : 1;
  for (std::size_t i = 0; i < model.imposed.size(); ++i) {
    if (model.imposed[i]) continue;
    const auto at = static_cast<Index>(i);
    const double rate = intensity / model.mass(at, at);
    const double v = rate * rate * sample_time;
    q(free + slot, free + slot) = v;
    q(slot, free + slot) = q(free + slot, slot) = 0.5 * sample_time * v;
    q(slot, slot) = sample_time * sample_time / 3.0 * v;
    ++slot;
  }
  return q;
}

}  // namespace

MatrixXd stationary_covariance(const MatrixXd& a, const MatrixXd& c, const MatrixXd& q,
                               const VectorXd& r) {
  const Index n = a.rows();
  MatrixXd f = (1.0 - kForgetting) * a.transpose();
  MatrixXd g = c.transpose() * r.cwiseInverse().asDiagonal() * c;
  MatrixXd p = q;
  for (int doubling = 0; doubling < kDoublings; ++doubling) {
    const Eigen::PartialPivLU<MatrixXd> w(MatrixXd::Identity(n, n) + g * p);
    const MatrixXd w_f = w.solve(f), w_g = w.solve(g);
    MatrixXd change = f.transpose() * p * w_f;
    change = 0.5 * (change + change.transpose()).eval();
    g += f * w_g * f.transpose();
    g = 0.5 * (g + g.transpose()).eval();
    f = f * w_f;
    p += change;
    if (!p.allFinite()) return p;
    if (change.norm() <= kSettled * p.norm()) break;
  }
  return p;
}

MatrixXd stationary_gain(Predictor& predictor, const LumpedModel& model, double sample_time,
                         double intensity, const VectorXd& noise) {
  const LinearModel linear = linear_model(predictor);
  const Index n = predictor.state_count();
  const MatrixXd zero = MatrixXd::Zero(n, linear.c.rows());
  // States differ by orders of magnitude: each by its own noise, outputs by theirs.
  const MatrixXd c = noise.cwiseInverse().asDiagonal() * linear.c;
  const MatrixXd q = process_noise(model, n, sample_time, intensity);
  const VectorXd ones = VectorXd::Ones(c.rows());
  const MatrixXd p = stationary_covariance(linear.a, c, q, ones);
  if (!p.allFinite()) return zero;
  const MatrixXd innovation = c * p * c.transpose() + MatrixXd::Identity(c.rows(), c.rows());
  const MatrixXd gain =
      innovation.ldlt().solve(c * p).transpose() * noise.cwiseInverse().asDiagonal();
  return gain.allFinite() ? gain : zero;
}

VectorXd error_by_noise(Predictor& predictor, const MatrixXd& gain, const VectorXd& noise,
                        Index horizon) {
  if (horizon == 0 || gain.size() == 0) return noise;
  constexpr Index kMost = 3000;  // samples: from there on it hardly grows, or is no use
  const LinearModel linear = linear_model(predictor);
  const Index n = linear.a.rows();
  const VectorXd variance = noise.cwiseAbs2();
  const MatrixXd keep = MatrixXd::Identity(n, n) - gain * linear.c;
  MatrixXd f = (1.0 - kForgetting) * keep * linear.a;
  MatrixXd s = gain * variance.asDiagonal() * gain.transpose();
  for (int doubling = 0; doubling < kDoublings; ++doubling) {
    const MatrixXd change = f * s * f.transpose();
    s += change;
    f = (f * f).eval();
    if (!s.allFinite() || change.norm() <= kSettled * s.norm()) break;
  }
  VectorXd sum = VectorXd::Zero(noise.size());
  const Index count = std::min(horizon, kMost);
  for (Index i = 0; i < count; ++i) {
    s = linear.a * s * linear.a.transpose();
    sum += (linear.c * s * linear.c.transpose()).diagonal() + variance;
  }
  const VectorXd error = (sum / static_cast<double>(count)).cwiseSqrt();
  return error.allFinite() ? error : noise;
}

}  // namespace graybox
