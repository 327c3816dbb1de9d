#include "problems/elements/element_dynamics.hpp"

#include <fmt/format.h>

#include <cmath>
#include <span>

#include "problems/base/error.hpp"

namespace graybox {
namespace {

std::span<const double> part(const Eigen::VectorXd& states, Eigen::Index first, std::size_t size) {
  return {states.data() + first, size};
}
std::span<double> part(Eigen::VectorXd& states, Eigen::Index first, std::size_t size) {
  return {states.data() + first, size};
}

// s + f(s) with the law at rest at s.
double passed_at_rest(const Law& law, double signal) {
  std::vector<double> states(law.state_count());
  law.rest(signal, states);
  return signal + law.force(signal, 0.0, states);
}

// The signal that a law turns into `target` at rest, by bisection: s + f(s) does not fall.
double undo(const Element& element, double target) {
  constexpr int kDoublings = 20;  // much further, s + f(s) is lost in rounding
  const Law& law = *element.law;
  if (passed_at_rest(law, target) == target) return target;
  double width = 1.0 + std::abs(target), low = target - width, high = target + width;
  for (int k = 0; k < kDoublings && passed_at_rest(law, low) > target; ++k) {
    low = target - (width *= 2.0);
  }
  for (int k = 0; k < kDoublings && passed_at_rest(law, high) < target; ++k) {
    high = target + (width *= 2.0);
  }
  if (passed_at_rest(law, low) > target || passed_at_rest(law, high) < target) {
    throw InputError(fmt::format(
        "element '{}': the actuator can't give the {:.4g} {} that hold the robot at this position",
        element.name, target, element.location.units.force));
  }
  for (int k = 0; k < 200 && low < high; ++k) {
    const double middle = low + 0.5 * (high - low);
    if (middle == low || middle == high) break;
    (passed_at_rest(law, middle) < target ? low : high) = middle;
  }
  return high;
}

}  // namespace

ElementDynamics::ElementDynamics(std::vector<Element> elements, Eigen::Index inputs,
                                 Eigen::Index outputs)
    : input_delays_(Eigen::VectorXd::Zero(inputs)), output_delays_(Eigen::VectorXd::Zero(outputs)) {
  for (Element& element : elements) {
    const LocationKind kind = element.location.kind;
    if (element.use == LawUse::kDelay) {
      (kind == LocationKind::kActuator ? input_delays_ : output_delays_)(
          element.location.channel) += element.parameters[0];
    }
    if (element.law == nullptr) continue;
    const std::size_t states = element.law->state_count();
    auto& list = kind == LocationKind::kElement    ? forces_
                 : kind == LocationKind::kActuator ? actuators_
                                                   : sensors_;
    list.push_back({std::move(element), state_count_, states});
    state_count_ += static_cast<Eigen::Index>(states);
  }
}

bool ElementDynamics::empty() const {
  return forces_.empty() && actuators_.empty() && sensors_.empty() && input_delays_.isZero(0.0) &&
         output_delays_.isZero(0.0);
}

void ElementDynamics::rest_signal(const std::vector<Placed>& laws, Eigen::VectorXd signal,
                                  Eigen::VectorXd& states) const {
  for (const Placed& placed : laws) {
    double& value = signal(placed.element.location.channel);
    placed.element.law->rest(value, part(states, placed.first_state, placed.states));
    value = passed_at_rest(*placed.element.law, value);
  }
}

void ElementDynamics::rest(const Eigen::VectorXd& q, const Eigen::VectorXd& input,
                           const Eigen::VectorXd& output, Eigen::VectorXd& states) const {
  states.setZero();
  for (const Placed& placed : forces_) {
    placed.element.law->rest(placed.element.location.input.dot(q),
                             part(states, placed.first_state, placed.states));
  }
  rest_signal(actuators_, input, states);
  rest_signal(sensors_, output, states);
}

void ElementDynamics::add_force(const Eigen::VectorXd& q, const Eigen::VectorXd& velocity,
                                const Eigen::VectorXd& states, Eigen::VectorXd& force,
                                Eigen::VectorXd& state_rates) const {
  for (const Placed& placed : forces_) {
    const Location& place = placed.element.location;
    const Law& law = *placed.element.law;
    const double z = place.input.dot(q), rate = place.input.dot(velocity);
    const auto x = part(states, placed.first_state, placed.states);
    force -= law.force(z, rate, x) * place.output;
    law.state_rate(z, rate, x, part(state_rates, placed.first_state, placed.states));
  }
}

void ElementDynamics::pass(const std::vector<Placed>& laws, Eigen::VectorXd& signal,
                           const Eigen::VectorXd& states, Eigen::VectorXd& state_rates) const {
  for (const Placed& placed : laws) {
    const Law& law = *placed.element.law;
    double& value = signal(placed.element.location.channel);
    const auto x = part(states, placed.first_state, placed.states);
    law.state_rate(value, 0.0, x, part(state_rates, placed.first_state, placed.states));
    value += law.force(value, 0.0, x);
  }
}

void ElementDynamics::act(Eigen::VectorXd& input, const Eigen::VectorXd& states,
                          Eigen::VectorXd& state_rates) const {
  pass(actuators_, input, states, state_rates);
}

void ElementDynamics::sense(Eigen::VectorXd& output, const Eigen::VectorXd& states,
                            Eigen::VectorXd& state_rates) const {
  pass(sensors_, output, states, state_rates);
}

void ElementDynamics::add_static_force(const Eigen::VectorXd& q, Eigen::VectorXd& force,
                                       Eigen::MatrixXd& slope) const {
  constexpr double kStep = 1e-7;  // of the difference that gives f'(z)
  std::vector<double> states;
  for (const Placed& placed : forces_) {
    const Location& place = placed.element.location;
    const Law& law = *placed.element.law;
    const auto at_rest = [&](double z) {
      states.assign(placed.states, 0.0);
      law.rest(z, states);
      return law.force(z, 0.0, states);
    };
    const double z = place.input.dot(q);
    force -= at_rest(z) * place.output;
    slope -= (at_rest(z + kStep) - at_rest(z - kStep)) / (2.0 * kStep) * place.output *
             place.input.transpose();
  }
}

Eigen::VectorXd ElementDynamics::command_for(const Eigen::VectorXd& input) const {
  Eigen::VectorXd command = input;
  for (auto placed = actuators_.rbegin(); placed != actuators_.rend(); ++placed) {
    double& value = command(placed->element.location.channel);
    value = undo(placed->element, value);
  }
  return command;
}

}  // namespace graybox
