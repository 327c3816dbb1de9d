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

// Covariance of force noise that holds within a sample, independent from one to the next.
MatrixXd process_noise(Predictor& predictor, const LumpedModel& model, double sample_time,
                       double intensity) {
  const Index n = predictor.state_count();
  MatrixXd q = MatrixXd::Zero(n, n);
  for (std::size_t i = 0; i < model.imposed.size(); ++i) {
    if (model.imposed[i]) continue;
    VectorXd pushed = VectorXd::Zero(n);
    predictor.linear_step(pushed, static_cast<Index>(i), intensity / std::sqrt(sample_time));
    q += pushed * pushed.transpose();
  }
  return q;
}

}  // namespace

LinearPredictor linear_predictor(Predictor& predictor, Index pushed) {
  const Index n = predictor.state_count();
  LinearPredictor model{MatrixXd(n, n), MatrixXd(predictor.output_count(), n), VectorXd::Zero(n)};
  VectorXd outputs, state;
  for (Index i = 0; i < n; ++i) {
    state = VectorXd::Unit(n, i);
    predictor.linear_outputs(state, outputs);
    model.c.col(i) = outputs;
    predictor.linear_step(state);
    model.a.col(i) = state;
  }
  if (pushed >= 0) predictor.linear_step(model.b, pushed);
  return model;
}

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
  const LinearPredictor linear = linear_predictor(predictor);
  const Index n = predictor.state_count();
  const MatrixXd zero = MatrixXd::Zero(n, linear.c.rows());
  // States differ by orders of magnitude: each by its own noise, outputs by theirs.
  const MatrixXd c = noise.cwiseInverse().asDiagonal() * linear.c;
  MatrixXd q = process_noise(predictor, model, sample_time, intensity);
  if (const DisturbanceForce& d = predictor.disturbance(); d.is_there()) {
    const Index at = predictor.disturbance_state();
    q(at, at) = d.deviation * d.deviation * -std::expm1(-2.0 * sample_time / d.memory);
    VectorXd pushed = VectorXd::Zero(n);
    predictor.linear_step(pushed, d.coordinate, d.white);
    q += pushed * pushed.transpose();
  }
  const VectorXd ones = VectorXd::Ones(c.rows());
  const MatrixXd p = stationary_covariance(linear.a, c, q, ones);
  if (!p.allFinite()) return zero;
  const MatrixXd innovation = c * p * c.transpose() + MatrixXd::Identity(c.rows(), c.rows());
  const MatrixXd gain =
      innovation.ldlt().solve(c * p).transpose() * noise.cwiseInverse().asDiagonal();
  return gain.allFinite() ? gain : zero;
}

VectorXd error_by_noise(Predictor& predictor, const MatrixXd& gain, const VectorXd& noise,
                        Index horizon, double sample_time, const DisturbanceForce& disturbance) {
  const bool is_free = horizon == 0 || gain.size() == 0;
  if (is_free && !disturbance.is_there()) return noise;
  constexpr Index kMost = 30000;  // samples
  const LinearPredictor linear = linear_predictor(predictor, disturbance.coordinate);
  const Index n = linear.a.rows();
  const VectorXd variance = noise.cwiseAbs2();
  // The error before a correction, then the disturbance.
  const double kept = !disturbance.is_there() ? 0.0 : std::exp(-sample_time / disturbance.memory);
  MatrixXd open = MatrixXd::Zero(n + 1, n + 1), noises = open;
  open.topLeftCorner(n, n) = linear.a;
  open.topRightCorner(n, 1) = linear.b;
  open(n, n) = kept;
  MatrixXd f = open;
  const double size = disturbance.deviation;
  noises(n, n) = size * size * (1.0 - kept * kept);
  if (disturbance.is_there()) {
    noises.topLeftCorner(n, n) =
        disturbance.white * disturbance.white * linear.b * linear.b.transpose();
  }
  const MatrixXd forced = noises;
  if (!is_free) {
    f.topLeftCorner(n, n) -= linear.a * gain * linear.c;
    const MatrixXd corrected = linear.a * gain;
    noises.topLeftCorner(n, n) += corrected * variance.asDiagonal() * corrected.transpose();
  }
  f *= 1.0 - kForgetting;
  MatrixXd s = noises;
  for (int doubling = 0; doubling < kDoublings; ++doubling) {
    const MatrixXd change = f * s * f.transpose();
    s += change;
    f = (f * f).eval();
    if (!s.allFinite() || change.norm() <= kSettled * s.norm()) break;
  }
  // The first sample of a forecast has the error before its correction.
  const Index count = is_free ? 1 : std::min(horizon, kMost);
  VectorXd sum = VectorXd::Zero(noise.size());
  for (Index i = 0; i < count; ++i) {
    sum += (linear.c * s.topLeftCorner(n, n) * linear.c.transpose()).diagonal() + variance;
    s = open * s * open.transpose() + forced;
  }
  const VectorXd error = (sum / static_cast<double>(count)).cwiseSqrt();
  return error.allFinite() ? error : noise;
}

}  // namespace graybox
