// ElementDynamics: the elements of one model as they act while it moves.
//
//   ElementDynamics dynamics(elements, inputs, outputs);
//   Eigen::VectorXd states(dynamics.state_count());
//   dynamics.rest(q, input, output, states);
//   // within q'' = a(q, q', u + ..., f):
//   dynamics.add_force(q, velocity, states, f, state_rates);   // f -= sum b_out f(z, z', x)
//   dynamics.act(u, states, state_rates);                      // through the actuators' laws
//   dynamics.sense(y, states, state_rates);                    // through the sensors' laws
//
// The laws' states lie behind each other in one vector. Inertia and payload belong to the model
// (robot_elements.hpp, lumped_model.hpp) and are passed over; delays are the plant's business and
// only collected. Every call costs O(elements x coordinates) and allocates nothing.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "problems/elements/element.hpp"

namespace graybox {

class ElementDynamics {
 public:
  ElementDynamics() = default;
  ElementDynamics(std::vector<Element> elements, Eigen::Index inputs, Eigen::Index outputs);

  [[nodiscard]] Eigen::Index state_count() const { return state_count_; }
  // No laws with force, signal or delay.
  [[nodiscard]] bool empty() const;
  // Whether states depend on what sensors measure.
  [[nodiscard]] bool senses() const { return !sensors_.empty(); }
  // Time by which each actuator or sensor is late, s.
  [[nodiscard]] const Eigen::VectorXd& input_delays() const { return input_delays_; }
  [[nodiscard]] const Eigen::VectorXd& output_delays() const { return output_delays_; }

  // States at rest at q with constant commands and measurements (before their laws).
  void rest(const Eigen::VectorXd& q, const Eigen::VectorXd& input, const Eigen::VectorXd& output,
            Eigen::VectorXd& states) const;

  void add_force(const Eigen::VectorXd& q, const Eigen::VectorXd& velocity,
                 const Eigen::VectorXd& states, Eigen::VectorXd& force,
                 Eigen::VectorXd& state_rates) const;
  void act(Eigen::VectorXd& input, const Eigen::VectorXd& states,
           Eigen::VectorXd& state_rates) const;
  void sense(Eigen::VectorXd& output, const Eigen::VectorXd& states,
             Eigen::VectorXd& state_rates) const;

  // Force at rest at q, added to `force`, and its slope -sum b_out f'(z) b_in^T to `slope`.
  void add_static_force(const Eigen::VectorXd& q, Eigen::VectorXd& force,
                        Eigen::MatrixXd& slope) const;
  // The commands that the actuators' laws turn into `input` at rest. Throws InputError where there
  // are none, as beyond a saturation.
  [[nodiscard]] Eigen::VectorXd command_for(const Eigen::VectorXd& input) const;

 private:
  struct Placed {
    Element element;
    Eigen::Index first_state = 0;
    std::size_t states = 0;
  };

  void pass(const std::vector<Placed>& laws, Eigen::VectorXd& signal, const Eigen::VectorXd& states,
            Eigen::VectorXd& state_rates) const;
  void rest_signal(const std::vector<Placed>& laws, Eigen::VectorXd signal,
                   Eigen::VectorXd& states) const;

  std::vector<Placed> forces_, actuators_, sensors_;
  Eigen::VectorXd input_delays_, output_delays_;
  Eigen::Index state_count_ = 0;
};

}  // namespace graybox
