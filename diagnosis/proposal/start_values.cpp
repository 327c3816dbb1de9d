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

// Which side of its play a coupling lies on, -1 to 1: what lies within a tenth of the rms twist is
// between. A spring behind a play p pulls with k (twist - p/2 side).
Eigen::VectorXd sides_of(const Eigen::VectorXd& twist) {
  constexpr double kBetween = 0.1;
  const double between = kBetween * twist.norm() / std::sqrt(static_cast<double>(twist.size()));
  if (!(between > 0.0)) return Eigen::VectorXd::Zero(twist.size());
  return twist.unaryExpr([between](double x) { return std::clamp(x / between, -1.0, 1.0); });
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

// The sums over windows that both equations of motion hold.
class TwoMassSums {
 public:
  TwoMassSums(const Windows& windows, const Eigen::VectorXd& force, const Eigen::VectorXd& motor,
              const Eigen::VectorXd& load)
      : force_(windows.summed(force)),
        motor_(windows.accelerated(motor)),
        load_(windows.accelerated(load)) {
    const Eigen::VectorXd motor_speed = windows.velocity(motor),
                          load_speed = windows.velocity(load);
    Eigen::VectorXd twist = windows.position(motor) - windows.position(load);
    twist.array() -= twist.mean();  // the sensors' zeros differ
    const Eigen::Index n = force_.size();
    spring_.resize(n, 2);
    spring_ << windows.summed(twist), windows.summed(motor_speed - load_speed);
    play_ = windows.summed(sides_of(twist));
    motor_friction_ = friction(windows, motor_speed);
    load_friction_ = friction(windows, load_speed);
  }

  // The motor's equation, and the sum of both, in which spring and play cancel. The force stands on
  // both right sides, so that no small load and spring fit the second one.
  [[nodiscard]] TwoMassStart of_motor_and_sum() const {
    const Eigen::Index n = force_.size();
    const Eigen::VectorXd none = Eigen::VectorXd::Zero(n), ones = Eigen::VectorXd::Ones(n);
    const Eigen::MatrixXd nothing = Eigen::MatrixXd::Zero(n, 3);
    Eigen::MatrixXd columns(2 * n, 11);
    columns.topRows(n) << motor_, none, spring_, play_, motor_friction_, ones, nothing;
    columns.bottomRows(n) << motor_, load_, nothing, motor_friction_, none, load_friction_, ones;
    Eigen::VectorXd right(2 * n);
    right << force_, force_;
    return start_of(columns, right);
  }

  // Each equation by itself: nothing stands on the right of the load's.
  [[nodiscard]] TwoMassStart of_motor_and_load() const {
    const Eigen::Index n = force_.size();
    const Eigen::VectorXd none = Eigen::VectorXd::Zero(n), ones = Eigen::VectorXd::Ones(n);
    const Eigen::MatrixXd nothing = Eigen::MatrixXd::Zero(n, 3);
    Eigen::MatrixXd columns(2 * n, 10);
    columns.topRows(n) << motor_, none, spring_, motor_friction_, ones, nothing;
    columns.bottomRows(n) << none, load_, -spring_, nothing, load_friction_, ones;
    Eigen::VectorXd right(2 * n);
    right << force_, none;
    return start_of(columns, right);
  }

 private:
  [[nodiscard]] static TwoMassStart start_of(const Eigen::MatrixXd& columns,
                                             const Eigen::VectorXd& right) {
    const Eigen::VectorXd values = solve(columns, right).values;
    return {values(0), values(1), values(2), values(3)};
  }

  // Viscous and dry.
  [[nodiscard]] static Eigen::MatrixXd friction(const Windows& windows,
                                                const Eigen::VectorXd& speed) {
    const Eigen::VectorXd viscous = windows.summed(speed);
    Eigen::MatrixXd columns(viscous.size(), 2);
    columns << viscous, windows.summed(signs_of(speed));
    return columns;
  }

  Eigen::VectorXd force_, motor_, load_, play_;
  Eigen::MatrixXd spring_, motor_friction_, load_friction_;  // stiffness, damping; viscous, dry
};

bool is_positive(const TwoMassStart& start) {
  return start.motor > 0.0 && start.load > 0.0 && start.stiffness > 0.0;
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
  const Windows windows = windows_for({motor, load}, are_velocities, sample_time);
  const TwoMassSums sums(windows, force, motor, load);
  const TwoMassStart by_sum = sums.of_motor_and_sum();
  if (is_positive(by_sum)) return by_sum;
  const TwoMassStart by_each = sums.of_motor_and_load();
  if (!is_positive(by_each)) return {};
  return by_each;
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
