// LumpedSystem: the equations of a lumped model at one value of its parameters, with their
// derivatives by the free ones, in the form of the integrator (exponential_operators.hpp):
//
//   y = (q, q', x),   y' = A y + N(y, u),   A = [0 I 0; -M^-1 K  -M^-1 C  0; 0 0 0],
//
// q the free coordinates, x the states of laws; N holds inputs, imposed motions and the laws of
// elements. All quantities are rows [value, tangents]: a state is the matrix Y = [y, S] with
// S = dy/d(free parameters, initial state), and N maps it to [N, dN/dy S + dN/dtheta]. Laws bring
// their own exact derivatives (law.hpp).
//
// One system serves one thread at a time. After construction nothing is allocated.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <span>
#include <vector>

#include "diagnosis/output_error/exponential_operators.hpp"
#include "problems/mechanisms/lumped_model.hpp"

namespace graybox {

using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

class LumpedSystem {
 public:
  // `free`: indices of parameters that get tangents, columns 1, 2, ...; behind them come
  // `initial_columns` columns that the equations do not touch.
  LumpedSystem(const LumpedModel& model, std::span<const std::size_t> free,
               Eigen::Index initial_columns);

  [[nodiscard]] Eigen::Index coordinate_count() const { return n_; }  // free ones
  [[nodiscard]] Eigen::Index state_count() const { return 2 * n_ + law_states_; }
  [[nodiscard]] Eigen::Index column_count() const { return columns_; }
  [[nodiscard]] Eigen::Index output_count() const {
    return static_cast<Eigen::Index>(outputs_.size());
  }
  // N does not depend on y: nothing but springs, dampers and masses.
  [[nodiscard]] bool is_linear() const { return is_linear_; }
  // Delays of the inputs, s, and the column of their tangents (0: none).
  [[nodiscard]] const Eigen::VectorXd& input_delays() const { return delays_; }
  [[nodiscard]] bool has_free_delay() const;
  // The same of the outputs, which the caller delays (output_delay.hpp).
  [[nodiscard]] const Eigen::VectorXd& output_delays() const { return output_delays_; }
  [[nodiscard]] const std::vector<Eigen::Index>& output_delay_columns() const {
    return output_delay_columns_;
  }
  // Every mass whose position is an input brings its velocity and acceleration as channels behind
  // the inputs: those that the model has no input for are filled in by the caller, as the rates of
  // the channel `of`.
  struct DerivedChannel {
    Eigen::Index of;
  };
  [[nodiscard]] const std::vector<DerivedChannel>& derived_channels() const { return derived_; }

  [[nodiscard]] const Eigen::MatrixXd& linear_part() const { return a_; }
  [[nodiscard]] const std::vector<Eigen::MatrixXd>& linear_part_derivatives() const {
    return a_slopes_;
  }
  // The column of each of them.
  [[nodiscard]] const std::vector<Eigen::Index>& linear_part_columns() const { return a_columns_; }

  // `inputs`: the channels' values; `slopes`: their derivatives by the delay, or null.
  // N, or, `whole`, A Y + N.
  void rates(const Rows& state, const double* inputs, const double* slopes, bool whole,
             Rows& rates);
  void outputs(const Rows& state, const double* inputs, const double* slopes, Rows& outputs);

  // The law states at rest for the coordinates in `state`, values and tangents.
  void rest_laws(const double* inputs, Rows& state);

 private:
  using Row = Eigen::RowVectorXd;
  struct PlacedLaw {
    std::shared_ptr<const Law> law;
    Eigen::VectorXd input_free, output_free, input_imposed, output_imposed;
    Eigen::Index channel = 0;
    Eigen::Index driver = -1;      // input that a signal law is driven by; -1: its own signal
    Eigen::Index first_state = 0;  // row of the state matrix
    Eigen::Index states = 0;
    std::vector<Eigen::Index> columns;  // of each parameter; 0: known
  };
  // What a known linear element or mass adds to M, C, K when its parameter changes by one.
  struct LinearParameter {
    Eigen::Index column = 0;
    Eigen::MatrixXd mass, damping, stiffness;  // all coordinates
  };

  void split_coordinates(const LumpedModel& model);
  void place_laws(const LumpedModel& model, std::span<const Eigen::Index> part_columns);
  void add_linear(const LumpedModel& model, std::span<const Eigen::Index> columns);
  void build_linear_part();
  PlacedLaw placed(const Element& element, std::span<const Eigen::Index> columns);
  void deflect(const PlacedLaw& law, const Rows& state, const double* inputs);
  void apply(const PlacedLaw& law, const Rows& state, bool with_rates, Rows* rates, Row& force);
  void pass_signal(const PlacedLaw& law, const Rows& state, Row& signal, Rows* rates);
  void compute_inputs(const Rows& state, const double* inputs, const double* slopes, Rows* rates);
  void divide_by_mass();  // the balance, into acceleration_rows_
  void compute_acceleration(const Rows& state, const double* inputs, bool whole, Rows& rates);
  void measure(std::size_t output, const Rows& state, const double* inputs, Row& row);
  void imposed_force(Eigen::Index mass, const Rows& state, const double* inputs, Row& row);

  Eigen::Index n_ = 0, law_states_ = 0, columns_ = 1, parameter_columns_ = 0;
  bool is_linear_ = true;
  std::vector<Eigen::Index> free_, imposed_;  // coordinates
  std::vector<Eigen::Index> slot_;            // of each coordinate in free_ or imposed_
  std::vector<bool> is_imposed_;
  std::vector<Eigen::Index> position_, velocity_, acceleration_;  // channels of imposed_
  std::vector<DerivedChannel> derived_;
  Eigen::MatrixXd mass_, damping_, stiffness_;  // all coordinates
  Eigen::MatrixXd free_mass_;
  Eigen::MatrixXd inverse_mass_;
  std::vector<LinearParameter> linear_;
  Eigen::MatrixXd a_;
  std::vector<Eigen::MatrixXd> a_slopes_;
  std::vector<Eigen::Index> a_columns_;
  std::vector<LumpedInput> inputs_;
  std::vector<LumpedOutput> outputs_;
  std::vector<PlacedLaw> forces_, actuators_, sensors_;
  std::vector<PlacedLaw> measured_parts_;  // of outputs that are an element's force
  Eigen::VectorXd delays_, output_delays_;
  std::vector<Eigen::Index> delay_columns_, output_delay_columns_;

  // Workspace.
  LawDerivatives law_;
  Row deflection_, rate_, force_, signal_;
  Rows input_rows_, balance_, acceleration_rows_, imposed_force_;
  Rows scratch_rates_, output_rows_;
};

}  // namespace graybox
