#include "diagnosis/proposal/start_values.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "diagnosis/log_columns/motion_span.hpp"
#include "diagnosis/proposal/column_choice.hpp"
#include "diagnosis/signals/real_transform.hpp"

namespace graybox {
namespace {

// Windows: a share of the period of the fastest motion, which a window must not average away.
constexpr double kShareOfPeriod = 0.1;
constexpr int kRounds = 3;

struct Windows {
  Eigen::Index width;  // samples
  double step;         // s
  bool is_velocity;

  // J times this is the sum of forces.
  [[nodiscard]] Eigen::VectorXd accelerated(const Eigen::VectorXd& motion) const {
    const Eigen::Index n = motion.size() - 2 * width;
    if (is_velocity) return motion.tail(n) - motion.head(n);
    return motion.tail(n) - 2.0 * motion.segment(width, n) + motion.head(n);
  }
  // The same sum of a force.
  [[nodiscard]] Eigen::VectorXd summed(const Eigen::VectorXd& force) const {
    const Eigen::VectorXd once = boxes(force, is_velocity ? 2 * width : width) * step;
    return is_velocity ? once : Eigen::VectorXd(boxes(once, width) * step);
  }
  [[nodiscard]] Eigen::VectorXd velocity(const Eigen::VectorXd& motion) const {
    if (is_velocity) return motion;
    Eigen::VectorXd rate = Eigen::VectorXd::Zero(motion.size());
    const Eigen::Index n = motion.size(), half = std::max<Eigen::Index>(1, width / 4);
    for (Eigen::Index k = 0; k < n; ++k) {
      const Eigen::Index a = std::max<Eigen::Index>(0, k - half), b = std::min(n - 1, k + half);
      rate(k) = (motion(b) - motion(a)) / (static_cast<double>(b - a) * step);
    }
    return rate;
  }
  [[nodiscard]] Eigen::VectorXd position(const Eigen::VectorXd& motion) const {
    if (!is_velocity) return motion;
    Eigen::VectorXd sum(motion.size());
    double so_far = 0.0;
    for (Eigen::Index k = 0; k < motion.size(); ++k) sum(k) = so_far += motion(k) * step;
    return sum;
  }

 private:
  // Sums over a window, of a signal linear between samples.
  static Eigen::VectorXd boxes(const Eigen::VectorXd& signal, Eigen::Index width) {
    Eigen::VectorXd total(signal.size());
    total(0) = 0.0;
    for (Eigen::Index k = 1; k < signal.size(); ++k) {
      total(k) = total(k - 1) + 0.5 * (signal(k) + signal(k - 1));
    }
    const Eigen::Index n = signal.size() - width;
    return total.tail(n) - total.head(n);
  }
};

Windows windows_for(const std::vector<Eigen::VectorXd>& motions, bool are_velocities, double step) {
  const double fastest = std::max(0.2, motion_frequency(motions, are_velocities, step));
  const auto width = static_cast<Eigen::Index>(std::lround(kShareOfPeriod / (fastest * step)));
  const Eigen::Index largest = motions.front().size() / 8;
  return {std::clamp<Eigen::Index>(width, 2, std::max<Eigen::Index>(2, largest)), step,
          are_velocities};
}

Eigen::VectorXd signs_of(const Eigen::VectorXd& velocity) {
  const double still = 0.01 * velocity.cwiseAbs().maxCoeff();
  return velocity.unaryExpr([still](double v) { return std::clamp(v / still, -1.0, 1.0); });
}

struct LeastSquares {
  Eigen::VectorXd values;
  Eigen::VectorXd errors;  // if rows were independent
};

// Rows that are far off, as of spikes, count less each round (Huber's weights).
LeastSquares solve(const Eigen::MatrixXd& columns, const Eigen::VectorXd& right) {
  const Eigen::VectorXd scales = columns.colwise().norm().cwiseMax(1e-300);
  const Eigen::MatrixXd scaled = columns * scales.cwiseInverse().asDiagonal();
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(right.size()), values;
  double spread = 0.0;
  for (int round = 0; round < kRounds; ++round) {
    values =
        (weights.asDiagonal() * scaled).colPivHouseholderQr().solve(weights.asDiagonal() * right);
    const Eigen::VectorXd rest = (right - scaled * values).cwiseAbs();
    spread = std::sqrt(rest.squaredNorm() / static_cast<double>(right.size()));
    if (!(spread > 0.0)) break;
    weights = (rest / (1.5 * spread)).cwiseMax(1.0).cwiseInverse().cwiseSqrt();
  }
  const Eigen::MatrixXd normal = scaled.transpose() * scaled;
  const Eigen::VectorXd variances =
      normal.completeOrthogonalDecomposition().pseudoInverse().diagonal();
  return {values.cwiseQuotient(scales), (spread * variances.cwiseSqrt()).cwiseQuotient(scales)};
}

struct Spectra {
  Eigen::VectorXd frequency;  // Hz
  Eigen::VectorXcd force, acceleration;
};

Spectra spectra_of(const Eigen::VectorXd& force, const Eigen::VectorXd& motion, bool is_velocity,
                   double step) {
  const Eigen::Index n = motion.size();
  RealTransform transform(static_cast<std::size_t>(n));
  const auto tapered = [n](Eigen::VectorXd signal) {
    signal.array() -= signal.mean();
    for (Eigen::Index k = 0; k < n; ++k) {
      const double turn =
          2.0 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(n - 1);
      signal(k) *= 0.5 - 0.5 * std::cos(turn);
    }
    return signal;
  };
  Spectra spectra;
  spectra.force = transform.run(tapered(force));
  spectra.acceleration = transform.run(tapered(motion));
  spectra.frequency.resize(spectra.force.size());
  for (Eigen::Index k = 0; k < spectra.frequency.size(); ++k) {
    spectra.frequency(k) = static_cast<double>(k) / (static_cast<double>(n) * step);
    const std::complex<double> s(0.0, 2.0 * std::numbers::pi * spectra.frequency(k));
    spectra.acceleration(k) *= is_velocity ? s : s * s;
  }
  return spectra;
}

// 1/J and the share of the acceleration that J leaves, with the drive's antiresonance and
// resonance; zero for one mass.
std::pair<double, double> fit_pair(const Spectra& spectra, double anti, double resonance) {
  constexpr double kDamping = 0.05;  // of critical
  std::complex<double> along = 0.0;
  double square = 0.0, total = 0.0;
  std::vector<std::complex<double>> model(static_cast<std::size_t>(spectra.frequency.size()));
  for (Eigen::Index k = 1; k < spectra.frequency.size(); ++k) {
    const std::complex<double> s(0.0, spectra.frequency(k));
    std::complex<double> h = 1.0;
    if (resonance > 0.0) {
      h = (s * s + 2.0 * kDamping * anti * s + anti * anti) /
          (s * s + 2.0 * kDamping * resonance * s + resonance * resonance);
      h *= resonance * resonance / (anti * anti);
    }
    const std::complex<double> m = h * spectra.force(k);
    along += std::conj(m) * spectra.acceleration(k);
    square += std::norm(m);
    total += std::norm(spectra.acceleration(k));
  }
  const double inverse = along.real() / square;
  return {inverse, 1.0 - inverse * along.real() / total};
}

}  // namespace

std::optional<TwoMassStart> start_two_masses(const Eigen::VectorXd& force,
                                             const Eigen::VectorXd& motor,
                                             const Eigen::VectorXd& load, bool are_velocities,
                                             double sample_time) {
  Windows windows = windows_for({motor, load}, are_velocities, sample_time);
  const Eigen::VectorXd v_motor = windows.velocity(motor), v_load = windows.velocity(load);
  const Eigen::VectorXd twist = windows.position(motor) - windows.position(load);
  const Eigen::VectorXd rate = v_motor - v_load;
  const auto friction = [&](const Eigen::VectorXd& v) { return windows.summed(signs_of(v)); };
  const Eigen::VectorXd right = windows.summed(force);
  const Eigen::Index n = right.size();
  // Both equations of motion in one: motor, load, spring, damper, and friction of each.
  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(2 * n, 10);
  columns.topRows(n) << windows.accelerated(motor), Eigen::VectorXd::Zero(n), windows.summed(twist),
      windows.summed(rate), windows.summed(v_motor), friction(v_motor), Eigen::VectorXd::Ones(n),
      Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(n);
  columns.bottomRows(n) << Eigen::VectorXd::Zero(n), windows.accelerated(load),
      -windows.summed(twist), -windows.summed(rate), Eigen::VectorXd::Zero(n),
      Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(n), windows.summed(v_load), friction(v_load),
      Eigen::VectorXd::Ones(n);
  Eigen::VectorXd both = Eigen::VectorXd::Zero(2 * n);
  both.head(n) = right;
  const LeastSquares fit = solve(columns, both);
  const TwoMassStart start{fit.values(0), fit.values(1), fit.values(2), fit.values(3)};
  if (!(start.motor > 0.0 && start.load > 0.0 && start.stiffness > 0.0)) return {};
  return start;
}

std::optional<TwoMassStart> start_one_encoder(const Eigen::VectorXd& force,
                                              const Eigen::VectorXd& motor, bool is_velocity,
                                              double sample_time) {
  constexpr int kSteps = 25;
  const Spectra spectra = spectra_of(force, motor, is_velocity, sample_time);
  const double lowest = 0.5, highest = 0.2 / sample_time;
  const double alone = fit_pair(spectra, 0.0, 0.0).second;
  double least = 0.9 * alone;
  std::optional<TwoMassStart> best;
  for (int i = 0; i < kSteps; ++i) {
    const double anti = lowest * std::pow(highest / lowest, static_cast<double>(i) / kSteps);
    for (const double ratio : {1.1, 1.25, 1.5, 2.0, 3.0, 5.0}) {
      const auto [inverse, rest] = fit_pair(spectra, anti, anti * ratio);
      if (!(rest < least) || !(inverse > 0.0)) continue;
      least = rest;
      // anti^2 = k / load and resonance^2 = k (1 / motor + 1 / load).
      const double total = 1.0 / inverse, motor_inertia = total / (ratio * ratio);
      const double turn = 2.0 * std::numbers::pi * anti, load = total - motor_inertia;
      best = TwoMassStart{motor_inertia, load, load * turn * turn, 0.1 * load * turn};
    }
  }
  return best;
}

double follows_at_once(const Eigen::VectorXd& force, const Eigen::VectorXd& motion,
                       bool is_velocity) {
  double most = 0.0;
  for (const Eigen::Index width : {2, 4, 8, 16}) {
    if (force.size() < 8 * width) break;
    const Windows windows{width, 1.0, is_velocity};
    const double each = correlation(windows.summed(force), windows.accelerated(motion));
    if (std::abs(each) > std::abs(most)) most = each;
  }
  return most;
}

}  // namespace graybox
