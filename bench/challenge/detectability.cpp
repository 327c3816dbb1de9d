#include "bench/challenge/detectability.hpp"

#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <unsupported/Eigen/MatrixFunctions>

#include "bench/challenge/case_experiment.hpp"
#include "diagnosis/signals/real_transform.hpp"
#include "problems/base/distributions.hpp"

namespace graybox::bench {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXcd stiffness_at(const LinearDynamics& dynamics, double w) {
  return dynamics.stiffness.cast<Complex>() + Complex(0.0, w) * dynamics.damping -
         w * w * dynamics.mass.cast<Complex>();
}

// Of the last period of each row, at some lines.
MatrixXcd lines_of(const MatrixXd& signals, std::size_t period, std::size_t first,
                   std::size_t count) {
  RealTransform transform(period);
  MatrixXcd lines(signals.rows(), static_cast<Index>(count));
  for (Index i = 0; i < signals.rows(); ++i) {
    const VectorXd last = signals.row(i).tail(static_cast<Index>(period));
    lines.row(i) = transform.run(last).segment(static_cast<Index>(first), lines.cols()).transpose();
  }
  return lines;
}

}  // namespace

double left_over(const VectorXd& r, const MatrixXd& jacobian) {
  if (jacobian.cols() == 0) return r.squaredNorm();
  // Columns of one size, so that the rank is told from directions and not from units.
  MatrixXd scaled = jacobian;
  for (Index p = 0; p < scaled.cols(); ++p) {
    const double norm = scaled.col(p).norm();
    if (norm > 0.0) scaled.col(p) /= norm;
  }
  const VectorXd fitted = scaled * scaled.colPivHouseholderQr().solve(r);
  return (r - fitted).squaredNorm();
}

double required_noncentrality(double degrees_of_freedom, double level, double power) {
  const double threshold = chi_square_quantile(1.0 - level, degrees_of_freedom);
  double low = 0.0, high = 10.0 + 10.0 * std::sqrt(2.0 * degrees_of_freedom);
  for (int k = 0; k < 50; ++k) {
    const double middle = 0.5 * (low + high);
    const double reached = noncentral_chi_square_tail(threshold, degrees_of_freedom, middle);
    (reached < power ? low : high) = middle;
  }
  return high;
}

std::optional<double> smallest_detectable_size(const std::function<double(double)>& lambda_at,
                                               double required, double largest,
                                               const std::function<bool()>& keep_going) {
  constexpr int kTrials = 9;
  double size = 0.02 * largest, low = 0.0, high = std::numeric_limits<double>::infinity();
  bool from_failure = false;
  for (int trial = 0; trial < kTrials; ++trial) {
    if (keep_going && !keep_going()) return {};
    const double lambda = lambda_at(size);
    if (lambda >= 0.8 * required && lambda <= 1.25 * required) return size;
    if (!(lambda < required)) {
      high = size;
      from_failure = std::isnan(lambda);
    } else {
      low = size;
      if (size >= largest) return {};
    }
    double step = std::isnan(lambda)
                      ? 0.1
                      : std::clamp(std::sqrt(required / std::max(lambda, 1e-300)), 0.01, 100.0);
    double next = std::min(size * step, largest);
    if (low > 0.0 && std::isfinite(high)) {
      const double middle = std::sqrt(low * high);
      if (next <= low * 1.02 || next >= high / 1.02) next = middle;
    }
    size = next;
  }
  // A law that sets in at once: the upper end is detectable.
  if (std::isfinite(high) && !from_failure && low > 0.0) return high;
  return {};
}

namespace {

constexpr double kStep = 1e-5;  // of a parameter, relative

LinearDynamics moved(LinearDynamics dynamics, const LinearDynamics::Derivative& change,
                     double step) {
  if (change.mass.size() > 0) dynamics.mass += step * change.mass;
  if (change.damping.size() > 0) dynamics.damping += step * change.damping;
  if (change.stiffness.size() > 0) dynamics.stiffness += step * change.stiffness;
  return dynamics;
}

}  // namespace

SampledDynamics::SampledDynamics(const LinearDynamics& dynamics, double sample_time)
    : sample_time_(sample_time), nominal_(sampled(dynamics, sample_time)) {
  for (const auto& change : dynamics.derivatives) {
    beside_.push_back({sampled(moved(dynamics, change, -kStep), sample_time),
                       sampled(moved(dynamics, change, kStep), sample_time)});
  }
}

SampledDynamics::StateSpace SampledDynamics::sampled(const LinearDynamics& dynamics,
                                                     double sample_time) {
  const Index n = dynamics.mass.rows(), inputs = dynamics.input.cols();
  const auto mass = dynamics.mass.partialPivLu();
  MatrixXd joint = MatrixXd::Zero(2 * n + inputs, 2 * n + inputs);
  joint.block(0, n, n, n).setIdentity();
  joint.block(n, 0, n, n) = -mass.solve(dynamics.stiffness);
  joint.block(n, n, n, n) = -mass.solve(dynamics.damping);
  joint.block(n, 2 * n, n, inputs) = mass.solve(dynamics.input);
  const MatrixXd power = MatrixXd(joint * sample_time).exp();
  StateSpace result{power.topLeftCorner(2 * n, 2 * n), power.topRightCorner(2 * n, inputs),
                    MatrixXd(dynamics.position_output.rows(), 2 * n)};
  result.output << dynamics.position_output, dynamics.velocity_output;
  return result;
}

MatrixXcd SampledDynamics::response(const StateSpace& system, Complex shift) {
  MatrixXcd pencil = -system.transition.cast<Complex>();
  pencil.diagonal().array() += shift;
  return system.output.cast<Complex>() * pencil.partialPivLu().solve(system.input.cast<Complex>());
}

ResponseAt SampledDynamics::at(double w) const {
  const Complex shift = std::polar(1.0, w * sample_time_);
  ResponseAt result{response(nominal_, shift), {}};
  for (const auto& [below, above] : beside_) {
    result.derivatives.emplace_back((response(above, shift) - response(below, shift)) /
                                    (2.0 * kStep));
  }
  return result;
}

Detectability::Detectability(const CaseSystem& system, std::uint64_t seed)
    : system_(&system),
      seed_(seed),
      first_line_(system.plan().lines.front()),
      line_count_(system.plan().lines.back() - first_line_ + 1) {
  for (const ExperimentSet& set : system.plan().sets) {
    if (set.validation) continue;
    Record record{set, spectra({}, set), {}};
    const SampledDynamics dynamics(system.linear(set.position), system.plan().sample_time);
    for (std::size_t k = 0; k < line_count_; ++k) {
      record.responses.push_back(dynamics.at(frequency(first_line_ + k)));
    }
    records_.push_back(std::move(record));
  }
}

double Detectability::frequency(std::size_t line) const {
  const ChallengePlan& plan = system_->plan();
  return 2.0 * std::numbers::pi * static_cast<double>(line) /
         (static_cast<double>(plan.period) * plan.sample_time);
}

Detectability::Spectra Detectability::spectra(const std::vector<Element>& elements,
                                              const ExperimentSet& set) const {
  const Recording recording = simulate_experiment(*system_, elements, set, 0, false, seed_);
  const std::size_t period = system_->plan().period;
  return {lines_of(recording.input, period, first_line_, line_count_),
          lines_of(recording.output, period, first_line_, line_count_)};
}

MatrixXd Detectability::noise() const {
  const ChallengePlan& plan = system_->plan();
  MatrixXd deviation(system_->output_count(), static_cast<Index>(line_count_));
  for (Index k = 0; k < deviation.cols(); ++k) {
    const double w = frequency(first_line_ + static_cast<std::size_t>(k));
    const double step = 2.0 * std::sin(0.5 * w * plan.sample_time) / plan.sample_time;
    for (Index i = 0; i < deviation.rows(); ++i) {
      const double white = system_->white_noise().size() > 0 ? system_->white_noise()(i) : 0.0;
      deviation(i, k) = std::sqrt((system_->noise_psd_slope() * step * step + white * white) /
                                  static_cast<double>(plan.periods));
    }
  }
  return deviation;
}

double Detectability::degrees_of_freedom() const {
  const auto numbers = 2.0 * static_cast<double>(line_count_ * records_.size()) *
                       static_cast<double>(system_->output_count() * system_->input_count());
  return numbers - static_cast<double>(system_->parameter_factors().size());
}

double Detectability::noncentrality(const std::vector<Element>& elements) const {
  const MatrixXd deviation = noise();
  const Index outputs = deviation.rows(), lines = deviation.cols();
  const auto parameters = static_cast<Index>(system_->parameter_factors().size());
  const Index numbers = 2 * outputs * lines * static_cast<Index>(records_.size());
  VectorXd residual(numbers);
  MatrixXd jacobian(numbers, parameters);
  Index row = 0;
  for (const Record& record : records_) {
    const Spectra with = spectra(elements, record.set);
    for (Index k = 0; k < lines; ++k) {
      const ResponseAt& at = record.responses[static_cast<std::size_t>(k)];
      const Eigen::VectorXcd weight =
          (std::numbers::sqrt2 * deviation.col(k).cwiseInverse()).cast<Complex>();
      const Eigen::VectorXcd effect =
          weight.cwiseProduct(with.output.col(k) - record.without.output.col(k) -
                              at.response * (with.input.col(k) - record.without.input.col(k)));
      residual.segment(row, outputs) = effect.real();
      residual.segment(row + outputs, outputs) = effect.imag();
      for (Index p = 0; p < parameters; ++p) {
        const Eigen::VectorXcd change =
            weight.cwiseProduct(at.derivatives[static_cast<std::size_t>(p)] * with.input.col(k));
        jacobian.col(p).segment(row, outputs) = change.real();
        jacobian.col(p).segment(row + outputs, outputs) = change.imag();
      }
      row += 2 * outputs;
    }
  }
  return static_cast<double>(system_->input_count()) * left_over(residual, jacobian);
}

PlaceScale Detectability::scale_at(const ChallengePlace& place) const {
  PlaceScale scale;
  scale.turns = place.turns;
  scale.stiffness = place.spring;
  if (place.location.is_flange) return scale;
  const bool is_force = place.location.kind == LocationKind::kElement;
  double deflection = 0.0, rate = 0.0, acceleration = 0.0, force = 0.0, offset = 0.0;
  for (const Record& record : records_) {
    const LinearDynamics dynamics = system_->linear(record.set.position);
    if (is_force) offset += std::pow(place.location.input.dot(dynamics.rest), 2);
    for (std::size_t k = 0; k < line_count_; ++k) {
      const auto column = static_cast<Index>(k);
      if (!is_force) {
        const MatrixXcd& signal = place.location.kind == LocationKind::kActuator
                                      ? record.without.input
                                      : record.without.output;
        force += std::norm(signal(place.location.channel, column));
        continue;
      }
      const double w = frequency(first_line_ + k);
      const auto factors = stiffness_at(dynamics, w).partialPivLu();
      const Eigen::VectorXcd motion = factors.solve(
          Eigen::VectorXcd(dynamics.input.cast<Complex>() * record.without.input.col(column)));
      const Eigen::VectorXcd answer =
          factors.solve(Eigen::VectorXcd(place.location.output.cast<Complex>()));
      const double z = std::norm((place.location.input.cast<Complex>().transpose() * motion)(0));
      const double own = std::norm((place.location.output.cast<Complex>().transpose() * motion)(0));
      deflection += z;
      rate += w * w * z;
      acceleration += w * w * w * w * z;
      force += own / std::norm((place.location.output.cast<Complex>().transpose() * answer)(0));
    }
  }
  // Parseval: the mean square of a signal is 2/N times the sum over its lines.
  const double records = static_cast<double>(records_.size());
  const auto rms = [&](double sum) {
    return std::sqrt(2.0 * sum / (static_cast<double>(system_->plan().period) * records));
  };
  scale.force = rms(force);
  if (is_force) {
    scale.deflection = rms(deflection);
    scale.rate = rms(rate);
    scale.acceleration = rms(acceleration);
    scale.offset = std::sqrt(offset / records);
  }
  return scale;
}

}  // namespace graybox::bench
