// What the outputs of a steady state do when something is added to it: a force, an input, a change
// of the plant or of a parameter.
#include <algorithm>
#include <cmath>
#include <complex>

#include "diagnosis/harmonic_balance/steady_state.hpp"
#include "problems/base/array_index.hpp"
#include "problems/mechanisms/frequency_response.hpp"

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

}  // namespace

void SteadyStateSolver::answer(const ModelState&, const MeasuredRecord& record, const VectorXd& b,
                               MatrixXcd& whitened) const {
  const LinearPlant& plant = position_->plant;
  whitened.setZero(plant.velocity_output.rows(), lines_ + 1);
  if (state_.changed.empty()) {
    for (Index i = 0; i < b.size(); ++i) {
      if (b(i) == 0.0) continue;
      for (Index k = data_.first_line; k <= lines_; ++k) {
        whitened.col(k) += b(i) * sight_[at(k)].col(i);
      }
    }
    return;
  }
  const auto& receptances = state_.changed;
  VectorXcd moved(b.size());
  for (Index k = data_.first_line; k <= lines_; ++k) {
    moved.setZero();
    for (Index i = 0; i < b.size(); ++i) {
      if (b(i) != 0.0) moved += b(i) * receptances[at(k)].col(i);
    }
    const Complex rate(0.0, data_.frequencies[at(k)]);
    whitened.col(k).noalias() =
        data_.whitening[record.group][at(k)] *
        (plant.position_output * moved + rate * (plant.velocity_output * moved));
  }
}

void SteadyStateSolver::answer_of_input(const ModelState& model, const MeasuredRecord& record,
                                        Index channel, MatrixXcd& whitened) const {
  answer(model, record, position_->plant.input.col(channel), whitened);
  for (Index k = data_.first_line; k <= lines_; ++k) {
    whitened.col(k) *= hold_factor(data_.frequencies[at(k)], data_.sample_time);
    whitened.col(k) += data_.whitening[record.group][at(k)] * position_->images[at(k)].col(channel);
  }
}

void SteadyStateSolver::answer_of_output(const MeasuredRecord& record, Index channel,
                                         MatrixXcd& whitened) const {
  whitened.setZero(position_->plant.velocity_output.rows(), lines_ + 1);
  for (Index k = data_.first_line; k <= lines_; ++k) {
    whitened.col(k) = data_.whitening[record.group][at(k)].col(channel);
  }
}

void SteadyStateSolver::respond(const std::vector<PointForce>& forces, const VectorXd& rest,
                                bool exact, Eigen::Ref<MatrixXcd> whitened) {
  whitened.setZero();
  for (const PointForce& force : forces) {
    for (Index k = data_.first_line; k <= lines_; ++k) {
      whitened.col(k) += force.lines(k) * sight_[at(k)].col(force.coordinate);
    }
  }
  const auto laws = static_cast<Index>(force_laws_.size());
  if (laws == 0) return;
  MatrixXcd deflections = MatrixXcd::Zero(lines_ + 1, laws), answer;
  for (Index l = 0; l < laws; ++l) {
    for (const PointForce& force : forces) {
      deflections.col(l) +=
          force.lines.cwiseProduct(heard_[at(l)].row(force.coordinate).transpose());
    }
  }
  if (exact) {
    apply_slopes(deflections, answer);
  } else {
    answer = state_.slopes.cwiseProduct(deflections);
  }
  if (rest.size() > 0) add_answer_to_rest(rest, answer);
  solve_equation(answer, exact);
  for (Index l = 0; l < laws; ++l) whitened -= seen_[at(l)] * answer.col(l).asDiagonal();
}

// With the slopes themselves: what a shift does at other lines than the mean is not in their mean.
void SteadyStateSolver::add_answer_to_rest(const VectorXd& rest, MatrixXcd& answer) {
  MatrixXcd shifts = MatrixXcd::Zero(answer.rows(), answer.cols()), forces;
  for (Index l = 0; l < shifts.cols(); ++l) {
    shifts(0, l) = static_scale_ * force_laws_[at(l)].place->input.dot(rest);
  }
  if (shifts.isZero(0.0)) return;
  apply_slopes(shifts, forces);
  answer += forces;
}

void SteadyStateSolver::answer_of_plant(const PlantChange& change, const MatrixXcd& coordinates,
                                        bool exact, Eigen::Ref<MatrixXcd> whitened) {
  std::vector<PointForce> forces;
  for (const PlantChange::Entry& entry : change.entries) {
    if (forces.empty() || forces.back().coordinate != entry.row) {
      forces.push_back({entry.row, VectorXcd::Zero(lines_ + 1)});
    }
    VectorXcd& lines = forces.back().lines;
    for (Index k = 0; k <= lines_; ++k) {
      const double w = data_.frequencies[at(k)];
      lines(k) -= Complex(entry.stiffness - w * w * entry.mass, w * entry.damping) *
                  coordinates(entry.column, k);
    }
  }
  respond(forces, change.rest, exact, whitened);
}

void SteadyStateSolver::answer_of_parameter(const MeasuredRecord& record, std::size_t parameter,
                                            const MatrixXcd& coordinates, bool exact,
                                            Eigen::Ref<MatrixXcd> whitened) {
  answer_of_plant(position_->changes[parameter], coordinates, exact, whitened);
  if (position_->image_changes.empty()) return;
  for (Index k = data_.first_line; k <= lines_; ++k) {
    whitened.col(k) += data_.whitening[record.group][at(k)] *
                       (position_->image_changes[at(k)][parameter] * input_.col(k));
  }
}

MatrixXcd SteadyStateSolver::moved_coordinates(const VectorXd& b, const VectorXcd& force) const {
  const auto& receptances = state_.changed.empty() ? position_->receptance : state_.changed;
  MatrixXcd moved = state_.coordinates;
  for (Index k = 0; k <= lines_; ++k) {
    if (force(k) == 0.0) continue;
    for (Index i = 0; i < b.size(); ++i) {
      if (b(i) != 0.0) moved.col(k) -= force(k) * b(i) * receptances[at(k)].col(i);
    }
  }
  return moved;
}

void SteadyStateSolver::differentiate(const ModelState& model, const MeasuredRecord& record,
                                      bool exact, MatrixXcd& jacobian) {
  const LinearPlant& plant = position_->plant;
  const Index outputs = plant.velocity_output.rows();
  auto count = static_cast<Index>(position_->changes.size());
  for (const ActingLaw& law : model.laws) count += static_cast<Index>(law.parameters.size());
  jacobian.resize(outputs * (lines_ + 1), count);
  const auto column_of = [&](Index p) {
    return Eigen::Map<MatrixXcd>(jacobian.col(p).data(), outputs, lines_ + 1);
  };
  Index p = 0, force_law = 0;
  std::size_t body = 0;
  for (std::size_t own = 0; own < position_->changes.size(); ++own) {
    answer_of_parameter(record, own, state_.coordinates, exact, column_of(p++));
  }
  for (const ActingLaw& law : model.laws) {
    if (is_body(*law.place, *law.entry)) {
      for (std::size_t i = 0; i < law.parameters.size(); ++i, ++body, ++p) {
        if (is_fixed(law, i)) {
          column_of(p).setZero();
        } else {
          answer_of_plant(position_->body_changes[body], state_.coordinates, exact, column_of(p));
        }
      }
      continue;
    }
    for (std::size_t i = 0; i < law.parameters.size(); ++i) {
      if (is_fixed(law, i)) {
        column_of(p++).setZero();
        continue;
      }
      const VectorXcd change = law_derivative(law, record, i);
      differentiate_law(law, record, change, force_law, exact, column_of(p++));
    }
    force_law += law.place->location.kind == LocationKind::kElement ? 1 : 0;
  }
}

// The lines of d law / d parameter i at the present motion, by central differences.
VectorXcd SteadyStateSolver::law_derivative(const ActingLaw& law, const MeasuredRecord& record,
                                            std::size_t i) {
  const Location& place = law.place->location;
  const double step = 1e-4 * std::max(std::abs(law.parameters[i]), 1e-9);
  VectorXcd signal;
  if (place.kind == LocationKind::kElement) signal = deflection_of(place);
  if (place.kind == LocationKind::kSensor) signal = state_.output.row(place.channel).transpose();
  if (signal.size() > 0) motion_of(signal, motion_);
  VectorXcd sides[2];
  for (const int side : {0, 1}) {
    std::vector<double> shifted = law.parameters;
    shifted[i] += side == 0 ? step : -step;
    const PeriodicLaw periodic(*law.entry, shifted);
    if (place.kind == LocationKind::kActuator) {
      signal_lines(periodic, record, position_->plant, place.channel, sides[side]);
    } else {
      force_lines(periodic, signal, motion_, sides[side]);
    }
  }
  return (sides[0] - sides[1]) / (2.0 * step);
}

// The whitened output of a change of one law's force or signal.
void SteadyStateSolver::differentiate_law(const ActingLaw& law, const MeasuredRecord& record,
                                          const VectorXcd& change, Index force_law, bool exact,
                                          Eigen::Ref<MatrixXcd> whitened) {
  const LinearPlant& plant = position_->plant;
  const Location& place = law.place->location;
  const auto& whitening = data_.whitening[record.group];
  whitened.setZero();
  if (place.kind == LocationKind::kElement) {
    MatrixXcd forces = MatrixXcd::Zero(lines_ + 1, static_cast<Index>(force_laws_.size()));
    forces.col(force_law) = change;
    solve_equation(forces, exact);
    for (std::size_t l = 0; l < force_laws_.size(); ++l) {
      whitened -= seen_[l] * forces.col(static_cast<Index>(l)).asDiagonal();
    }
  } else if (place.kind == LocationKind::kActuator) {
    std::vector<PointForce> forces;
    for (Index i = 0; i < plant.input.rows(); ++i) {
      if (plant.input(i, place.channel) == 0.0) continue;
      PointForce& force = forces.emplace_back(PointForce{i, change});
      for (Index k = 0; k <= lines_; ++k) {
        const Complex hold =
            k == 0 ? 1.0 : hold_factor(data_.frequencies[at(k)], data_.sample_time);
        force.lines(k) *= plant.input(i, place.channel) * hold;
      }
    }
    respond(forces, {}, exact, whitened);
    for (Index k = data_.first_line; k <= lines_; ++k) {
      whitened.col(k) += whitening[at(k)] * position_->images[at(k)].col(place.channel) * change(k);
    }
  } else {
    for (Index k = data_.first_line; k <= lines_; ++k) {
      whitened.col(k) = whitening[at(k)].col(place.channel) * change(k);
    }
  }
}

}  // namespace graybox
