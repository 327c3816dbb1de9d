#include "diagnosis/free_motion/free_forces.hpp"

#include <cmath>
#include <complex>
#include <memory>

#include "problems/base/array_index.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

// The force of a law without that of its mean slopes.
void add_curvature(const FreeForceLaw& law, const MeanSlope& slope, const VectorXd& rest,
                   const MatrixXd& q, const MatrixXd& velocity, MatrixXd& force) {
  const Location& place = *law.place;
  PeriodicMotion motion;
  motion.deflection = q.transpose() * place.input;
  motion.rate = velocity.transpose() * place.input;
  const VectorXd straight = slope.stiffness * motion.deflection + slope.damping * motion.rate;
  motion.deflection.array() += place.input.dot(rest);
  VectorXd of_law;
  law.law.force(motion, of_law);
  force.noalias() -= place.output * (of_law - straight).transpose();
}

}  // namespace

void FreeMotionForces::add_forces(FreeRecord& free) const {
  const FreePlant& plant = plants_[free.plant];
  const auto own =
      frame_.family.own_force(frame_.model.positions[plant.position].plant, frame_.model.bodies);
  const bool with_laws = frame_.has_curved_laws && !free.without_laws;
  if (own == nullptr && !with_laws) return;
  const std::size_t samples = frame_.data.period * static_cast<std::size_t>(plant.periods);
  // Own forces are of second order; laws may have corners.
  const std::size_t points = with_laws ? 8 : 3;
  PeriodTransform transform(samples, plant.bins, fast_grid(points * at(plant.bins)));
  const MatrixXcd periodic = coordinates_at_bins(free);
  MatrixXcd both = periodic;
  if (free.own.size() > 0) both += free.own;
  const VectorXcd departure = plant.sampled.vectors.adjoint() * free.departure;
  for (Index bin = 1; bin <= plant.bins; ++bin) {
    const Complex z = std::polar(1.0, frame_.angle(plant, bin));
    VectorXcd cause = z * departure;
    if (!plant.is_line(bin)) cause += plant.sampled.input * free.record->input_bins.col(bin);
    both.col(bin) += plant.sampled.state(z, cause).head(both.rows());
  }
  if (free.periodic_force.size() == 0) {
    free.periodic_force = force_of(own.get(), with_laws, plant, periodic, transform);
  }
  const MatrixXcd force =
      force_of(own.get(), with_laws, plant, both, transform) - free.periodic_force;
  free.own = MatrixXcd::Zero(both.rows(), plant.bins + 1);
  for (Index bin = 1; bin <= plant.bins; ++bin) {
    const double w = frame_.frequency(plant, bin);
    free.own.col(bin) = receptance(plant.plant, w) * force.col(bin);
  }
  if (!free.own.allFinite()) free.own.setZero();  // a motion far beyond the model
  see_own_motion(free);
}

void FreeMotionForces::see_own_motion(FreeRecord& free) const {
  const FreePlant& plant = plants_[free.plant];
  for (Index bin = 1; bin <= plant.bins; ++bin) {
    const Complex rate(0.0, frame_.frequency(plant, bin));
    free.own_seen.col(bin) = plant.plant.position_output * free.own.col(bin) +
                             rate * (plant.plant.velocity_output * free.own.col(bin));
  }
}

MatrixXcd FreeMotionForces::coordinates_at_bins(const FreeRecord& free) const {
  const FreePlant& plant = plants_[free.plant];
  MatrixXcd result = MatrixXcd::Zero(free.periodic.rows(), plant.bins + 1);
  for (Index k = 0; k < free.periodic.cols(); ++k) {
    result.col(k * plant.periods) = free.periodic.col(k);
  }
  return result;
}

// Bins of the own force, if there is one, and the curved laws' under a motion of these bins; none
// on masses that laws let swing.
MatrixXcd FreeMotionForces::force_of(OwnForce* own, bool with_laws, const FreePlant& plant,
                                     const MatrixXcd& coordinates,
                                     PeriodTransform& transform) const {
  // Bins are scaled as lines of one period, the transform is of all.
  const double scale = std::sqrt(static_cast<double>(plant.periods));
  const Index n = frame_.model.positions[plant.position].plant.mass.rows();
  MatrixXd q(n, transform.grid()), velocity = q, acceleration = q,
                                   force = MatrixXd::Zero(n, transform.grid());
  VectorXd times(transform.grid());
  for (Index i = 0; i < n; ++i) {
    VectorXcd spectrum = scale * coordinates.row(i).transpose();
    for (MatrixXd* target : {&q, &velocity, &acceleration}) {
      transform.to_times(spectrum, times);
      target->row(i) = times.transpose();
      for (Index bin = 0; bin <= plant.bins; ++bin) {
        spectrum(bin) *= Complex(0.0, frame_.frequency(plant, bin));
      }
    }
  }
  if (own != nullptr) own->evaluate(q, velocity, acceleration, force);
  if (with_laws) {
    for (std::size_t l = 0; l < frame_.laws.size(); ++l) {
      if (frame_.laws[l].is_curved()) {
        add_curvature(frame_.laws[l], plant.slopes[l], plant.plant.rest, q, velocity, force);
      }
    }
  }
  MatrixXcd result = MatrixXcd::Zero(coordinates.rows(), plant.bins + 1);
  VectorXcd spectrum(plant.bins + 1);
  for (Index i = 0; i < n; ++i) {
    times = force.row(i).transpose();
    transform.to_lines(times, spectrum);
    result.row(i) = spectrum.transpose() / scale;
  }
  return result;
}

}  // namespace graybox
