#include "diagnosis/harmonic_balance/place_observer.hpp"

#include "problems/base/array_index.hpp"
#include "problems/mechanisms/frequency_response.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

constexpr double kSignificant = 12.0;  // power over noise

// b_in^T X b_out
Complex between(const MatrixXcd& receptance, const Location& place) {
  Complex sum = 0.0;
  for (Index i = 0; i < place.input.size(); ++i) {
    if (place.input(i) == 0.0) continue;
    for (Index j = 0; j < place.output.size(); ++j) {
      if (place.output(j) != 0.0) sum += place.input(i) * receptance(i, j) * place.output(j);
    }
  }
  return sum;
}

}  // namespace

void answer_at(SteadyStateSolver& solver, const ModelState& model, const MeasuredRecord& record,
               const Location& place, MatrixXcd& answer) {
  if (place.kind == LocationKind::kElement) {
    solver.answer(model, record, place.output, answer);
  } else if (place.kind == LocationKind::kActuator) {
    solver.answer_of_input(model, record, place.channel, answer);
  } else {
    solver.answer_of_output(record, place.channel, answer);
  }
}

SteadyPlaceMotion PlaceObserver::observe(const MeasuredRecord& record, const Location& place,
                                         const MatrixXcd& answer) const {
  SteadyPlaceMotion motion;
  const Index lines = data_.last_line;
  const SteadyState& state = solver_.state();
  const LinearPlant& plant = model_.positions[record.position].plant;
  motion.coordinates = state.coordinates;
  if (place.kind == LocationKind::kActuator) {
    motion.deflection = record.input.row(place.channel).transpose();
    const VectorXcd held = virtual_force(state.residual, answer).cwiseProduct(holds());
    move(plant.input.col(place.channel), held, motion);
    return motion;
  }
  if (place.kind == LocationKind::kSensor) {
    motion.deflection = measured(record, place.channel);
    return motion;
  }
  motion.force = virtual_force(state.residual, answer);
  move(place.output, motion.force, motion);
  motion.deflection = state.coordinates.transpose() * place.input.cast<Complex>();
  const auto& receptances =
      state.changed.empty() ? model_.positions[record.position].receptance : state.changed;
  for (Index k = data_.first_line; k <= lines; ++k) {
    motion.deflection(k) -= motion.force(k) * between(receptances[at(k)], place);
  }
  take_measured(record, plant, place, motion.force, motion.deflection);
  motion.deflection(0) += solver_.static_scale() * place.input.dot(plant.rest);
  return motion;
}

void PlaceObserver::move(const VectorXd& b, const VectorXcd& force,
                         SteadyPlaceMotion& motion) const {
  motion.is_moved = !force.isZero(0.0);
  if (motion.is_moved) motion.coordinates = solver_.moved_coordinates(b, force);
}

VectorXcd PlaceObserver::holds() const {
  VectorXcd factors = VectorXcd::Ones(data_.last_line + 1);
  for (Index k = 1; k <= data_.last_line; ++k) {
    factors(k) = hold_factor(data_.frequencies[at(k)], data_.sample_time);
  }
  return factors;
}

// None where it is no larger than its noise is once in e^12 lines: a deflection with the noise of
// the residuals in it would be correlated with them, and any law would seem to explain them.
VectorXcd PlaceObserver::virtual_force(const MatrixXcd& residual, const MatrixXcd& answer) const {
  VectorXcd force = VectorXcd::Zero(data_.last_line + 1);
  if (!follows_data_) return force;
  for (Index k = data_.first_line; k <= data_.last_line; ++k) {
    const double gain = answer.col(k).squaredNorm();
    if (!(gain > 0.0)) continue;
    const Complex estimate = -answer.col(k).dot(residual.col(k)) / gain;
    const double power = std::norm(estimate), noise = 2.0 / gain;
    if (power > kSignificant * noise) force(k) = estimate;
  }
  return force;
}

// A channel as recorded where it differs from the model by more than noise, else as the model has
// it, for the same reason.
VectorXcd PlaceObserver::measured(const MeasuredRecord& record, Index channel) const {
  const SteadyState& state = solver_.state();
  VectorXcd signal = state.output.row(channel).transpose();
  if (!follows_data_) return signal;
  for (Index k = data_.first_line; k <= data_.last_line; ++k) {
    if (state.residual.col(k).squaredNorm() >
        2.0 * (kSignificant + static_cast<double>(state.residual.rows()))) {
      signal(k) = record.output(channel, k);
    }
  }
  return signal;
}

// z from a sensor's own signal, where one measures this deflection or its rate.
void PlaceObserver::take_measured(const MeasuredRecord& record, const LinearPlant& plant,
                                  const Location& place, const VectorXcd& force,
                                  VectorXcd& deflection) const {
  for (Index c = 0; c < plant.velocity_output.rows(); ++c) {
    for (const bool is_rate : {true, false}) {
      const VectorXd row =
          (is_rate ? plant.velocity_output : plant.position_output).row(c).transpose();
      const VectorXd other =
          (is_rate ? plant.position_output : plant.velocity_output).row(c).transpose();
      const double ratio = row.dot(place.input) / place.input.squaredNorm();
      if (ratio == 0.0 || !other.isZero(0.0) || !row.isApprox(ratio * place.input, 1e-12)) {
        continue;
      }
      const VectorXcd signal = measured(record, c);
      for (Index k = data_.first_line; k <= data_.last_line; ++k) {
        // With the rest of the motion, or a law would seem to act where the model's own like it
        // does not.
        if (force(k) == 0.0) continue;
        const Complex rate = is_rate ? Complex(0.0, data_.frequencies[at(k)]) : Complex(1.0);
        deflection(k) = signal(k) / (ratio * rate);
      }
      return;
    }
  }
}

}  // namespace graybox
