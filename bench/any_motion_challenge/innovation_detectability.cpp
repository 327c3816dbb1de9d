#include "bench/any_motion_challenge/innovation_detectability.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <unsupported/Eigen/MatrixFunctions>

#include "bench/challenge/detectability.hpp"

namespace graybox::bench {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kStep = 1e-4;  // of a parameter, relative

// x' = A x + B u with the torque as last state: its exponential is that of the held torque (Van
// Loan 1978).
MatrixXd held_drive(const DriveDynamics& dynamics) {
  const Index n = dynamics.masses.size(), states = 2 * n + 1;
  MatrixXd joint = MatrixXd::Zero(states + 1, states + 1);
  for (Index i = 0; i < n; ++i) {
    const double mass = dynamics.masses(i);
    joint(i, n + i) = 1.0;
    for (Index j = 0; j < n; ++j) {
      joint(n + i, j) = -dynamics.stiffness(i, j) / mass;
      joint(n + i, n + j) = -dynamics.damping(i, j) / mass;
    }
  }
  joint(2 * n - 1, 2 * n) = 1.0 / dynamics.masses(n - 1);
  joint(n, states) = 1.0 / dynamics.masses(0);
  return joint;
}

}  // namespace

SampledDrive sampled_drive(const AnyMotionSystem& system, const VectorXd& values) {
  const Index n = system.mass_count(), states = 2 * n + 1;
  const MatrixXd joint = held_drive(system.dynamics(values));
  const MatrixXd power = MatrixXd(joint * kAnyMotionSampleTime).exp();
  SampledDrive drive{power.topLeftCorner(states, states), power.topRightCorner(states, 1), {}};
  // The noise is held between samples and forgets from one to the next.
  drive.transition(2 * n, 2 * n) = std::exp(-kAnyMotionSampleTime / system.force_noise_memory());
  drive.output = MatrixXd::Zero(static_cast<Index>(system.outputs().size()), states);
  for (Index i = 0; i < drive.output.rows(); ++i) {
    const DriveOutput& output = system.outputs()[static_cast<std::size_t>(i)];
    drive.output(i, output.mass + (output.is_velocity ? n : 0)) = 1.0;
  }
  return drive;
}

StationaryFilter stationary_filter(const SampledDrive& drive, double force_noise,
                                   const MatrixXd& sensor_noise) {
  constexpr int kMostSteps = 20000;
  const MatrixXd &a = drive.transition, &c = drive.output;
  const Index states = a.rows(), outputs = c.rows();
  const double keep = a(states - 1, states - 1);
  MatrixXd covariance = MatrixXd::Zero(states, states);
  covariance(states - 1, states - 1) = force_noise * force_noise;
  StationaryFilter filter{MatrixXd::Zero(states, outputs), {}};
  for (int step = 0; step < kMostSteps; ++step) {
    const MatrixXd innovation = c * covariance * c.transpose() + sensor_noise;
    const Eigen::LLT<MatrixXd> factor(innovation);
    const MatrixXd gain = a * factor.solve(c * covariance).transpose();
    const bool settled = (gain - filter.gain).norm() < 1e-10 * gain.norm();
    filter.gain = gain;
    if (settled || step + 1 == kMostSteps) {
      filter.whitener = factor.matrixL().solve(MatrixXd::Identity(outputs, outputs));
      break;
    }
    covariance = a * covariance * a.transpose() - gain * innovation * gain.transpose();
    covariance(states - 1, states - 1) += force_noise * force_noise * (1.0 - keep * keep);
    covariance = (0.5 * (covariance + covariance.transpose())).eval();
  }
  return filter;
}

StationaryFilter filter_for(const AnyMotionSystem& system, const SampledDrive& drive,
                            const DriveRecording& quiet) {
  const Index outputs = quiet.output.cols(), steps = quiet.output.rows() - 1;
  // Jitter times the rate: a share of what changes in a step.
  const MatrixXd change = quiet.output.bottomRows(steps) - quiet.output.topRows(steps);
  MatrixXd noise = system.jitter() * system.jitter() / static_cast<double>(steps) *
                   (change.transpose() * change);
  for (Index i = 0; i < outputs; ++i) {
    noise(i, i) += std::pow(system.outputs()[static_cast<std::size_t>(i)].deviation(), 2);
  }
  return stationary_filter(drive, system.force_noise_share() * root_mean_square(quiet.input),
                           noise);
}

VectorXd innovations(const SampledDrive& drive, const StationaryFilter& filter,
                     const DriveRecording& recording) {
  const Index samples = recording.input.size(), outputs = drive.output.rows();
  VectorXd whitened(samples * outputs), state = VectorXd::Zero(drive.transition.rows());
  for (Index k = 0; k < samples; ++k) {
    const VectorXd error = recording.output.row(k).transpose() - drive.output * state;
    whitened.segment(k * outputs, outputs) = filter.whitener * error;
    state =
        (drive.transition * state + drive.input * recording.input(k) + filter.gain * error).eval();
  }
  return whitened;
}

InnovationDetectability::InnovationDetectability(const AnyMotionSystem& system, std::uint64_t seed)
    : system_(&system), seed_(seed) {
  const VectorXd values = system.true_values();
  nominal_ = sampled_drive(system, values);
  for (Index p = 0; p < values.size(); ++p) {
    VectorXd below = values, above = values;
    below(p) *= 1.0 - kStep;
    above(p) *= 1.0 + kStep;
    beside_.emplace_back(sampled_drive(system, below), sampled_drive(system, above));
  }
  for (std::size_t index = 0; index < system.plan().size(); ++index) {
    if (system.plan()[index].validation) continue;
    Record record{index, simulate_drive(system, {}, index, seed, nullptr), {}};
    record.filter = filter_for(system, nominal_, record.without);
    records_.push_back(std::move(record));
  }
}

double InnovationDetectability::degrees_of_freedom() const {
  double numbers = 0.0;
  for (const Record& record : records_)
    numbers += static_cast<double>(record.without.output.size());
  return numbers - static_cast<double>(beside_.size());
}

double InnovationDetectability::noncentrality(const std::vector<Element>& elements) const {
  const auto parameters = static_cast<Index>(beside_.size());
  const auto rows = static_cast<Index>(degrees_of_freedom()) + parameters;
  VectorXd residual(rows);
  MatrixXd jacobian(rows, parameters);
  Index row = 0;
  for (const Record& record : records_) {
    const DriveRecording with = simulate_drive(*system_, elements, record.index, seed_, nullptr);
    const Index count = with.output.size();
    residual.segment(row, count) = innovations(nominal_, record.filter, with);
    for (Index p = 0; p < parameters; ++p) {
      const auto& [below, above] = beside_[static_cast<std::size_t>(p)];
      jacobian.col(p).segment(row, count) =
          (innovations(above, record.filter, with) - innovations(below, record.filter, with)) /
          (2.0 * kStep);
    }
    row += count;
  }
  return left_over(residual, jacobian);
}

PlaceScale InnovationDetectability::scale_at(const ChallengePlace& place) const {
  double deflection = 0.0, rate = 0.0, acceleration = 0.0, force = 0.0, samples = 0.0;
  for (const Record& record : records_) {
    const DriveRecording& run = record.without;
    samples += static_cast<double>(run.input.size());
    if (place.location.kind == LocationKind::kSensor) {
      force += run.output.col(place.location.channel).squaredNorm();
      continue;
    }
    force += run.input.squaredNorm();
    if (place.location.kind == LocationKind::kActuator) continue;
    const VectorXd z = run.position * place.location.input;
    const VectorXd v = run.velocity * place.location.input;
    deflection += z.squaredNorm();
    rate += v.squaredNorm();
    acceleration += (v.tail(v.size() - 1) - v.head(v.size() - 1)).squaredNorm() /
                    (kAnyMotionSampleTime * kAnyMotionSampleTime);
  }
  const auto rms = [samples](double sum) { return std::sqrt(sum / samples); };
  PlaceScale scale;
  scale.turns = place.turns;
  scale.force = rms(force);
  if (place.location.kind != LocationKind::kElement) return scale;
  scale.deflection = rms(deflection);
  scale.rate = rms(rate);
  scale.acceleration = rms(acceleration);
  if (place.spring > 0.0) scale.force = place.spring * scale.deflection;
  scale.stiffness = scale.force / scale.deflection;
  return scale;
}

}  // namespace graybox::bench
