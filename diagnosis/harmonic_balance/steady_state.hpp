// The steady state of a model with laws under the recorded inputs, line by line: what the recording
// would be if the model were true.
//
//   q(k) = D^-1 [h B u + f_own - sum_l b_out,l F_l],
//   F_l = law(z_l),  z_l = b_in,l^T (q_rest + q),
//   y(k) = (S_0 + j w S_1) q + A u + laws of the sensors,   u with the laws of the actuators.
//
// Inputs are taken as recorded, whatever feedback made of them, so that Y - y is the plant's own
// output noise where the model is true.
//
// The forces F solve a fixed-point equation. Newton's method,
//
//   (I + S r) dF = law(z(F)) - F,   r_lm = b_in,l^T D^-1 b_out,m,
//
// S the laws linearised about the present motion, solves each step by GMRES in the norm of the
// outputs' noise. (The laws multiply by f_z(t) and f_z'(t) in time, and laws with a state remember,
// so that S couples lines.) The preconditioner has the mean slopes s in place of S, which couple
// nothing. The iteration starts at the virtual force: what F must be to explain the recorded
// outputs, by weighted least squares at each line, shrunk where it is not larger than its noise.
// Where the equation has several solutions that start selects the recorded one, and where the
// iteration does not settle the best F found is kept and `unsettled` says by how much, in noise
// units. Where it does, the step that is less than the tolerance is taken, too, if less is left
// then: from a start at the motion of nearly the same parameters it is all that they change.
//
// Derivatives (steady_state_answers.cpp) solve with the same matrix, or, faster and not exact, with
// s in place of S. With s the system answers forces with
//
//   X = D^-1 - D^-1 b_out (I + s r)^-1 s b_in^T D^-1.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "diagnosis/harmonic_balance/model_state.hpp"
#include "diagnosis/harmonic_balance/period_transform.hpp"
#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/periodic_law.hpp"
#include "diagnosis/signals/real_transform.hpp"

namespace graybox {

struct SteadyState {
  Eigen::MatrixXcd coordinates;           // q, n x (K + 1)
  Eigen::MatrixXcd forces;                // F of each force law, a column of K + 1 lines
  Eigen::MatrixXcd slopes;                // s of each force law, likewise
  Eigen::MatrixXcd output;                // y, n_y x (K + 1)
  Eigen::MatrixXcd residual;              // whitened Y - y, zero at lines that do not count
  std::vector<Eigen::MatrixXcd> changed;  // X of each line; empty without force laws: D^-1
  double unsettled = 0.0;
  double chi_square = 0.0;  // of the decorrelated residuals
};

// Whether a motion is one that the laws allow, with `unsettled` and the chi-square of so many
// numbers. It is not where the steady state is found to no better than a tenth of the rms of the
// residuals, noise or more. Such a motion is half what the recordings say (it was sought from
// there), and fits them better than any motion under the laws.
[[nodiscard]] bool is_settled(double unsettled, double chi_square, double numbers);

struct SteadyStateOptions {
  int iteration_limit = 25;
  double tolerance = 0.02;      // whitened rms that a last step may change
  double oversampling = 4.0;    // grid points for each line and period, at least, and up to four
  double grid_points = 6000.0;  // times as many while they are fewer than this: for laws that jump
  Eigen::Index subspace = 40;   // of GMRES, in one Newton step
  // The same with laws that remember: their products are dear, and more of them save no Newton
  // step.
  Eigen::Index subspace_with_memory = 16;
};

// Works on one record after the other; one object for each thread.
class SteadyStateSolver {
 public:
  SteadyStateSolver(const PlantFamily& family, const PeriodicData& data,
                    const SteadyStateOptions& options);

  // `start`: forces to begin with, or null for the virtual forces. Keeps a reference to the model
  // until the next call.
  const SteadyState& solve(const ModelState& model, const MeasuredRecord& record,
                           const Eigen::MatrixXcd* start);

  // Lets any force act at an element besides: the last solution becomes the one under the forces
  // -b_out F(k) at the lines that count with which the outputs are nearest to the recorded ones. By
  // substitution, a few times, for what laws and the model's own forces make of the motion. Returns
  // F.
  Eigen::VectorXcd let_act(const ModelState& model, const MeasuredRecord& record,
                           const Location& place);

  // Whitened derivatives of the last solution's outputs by the model's parameters, then by those of
  // each law in order: [n_y (K+1)] x P, line by line. `exact`: with S, else with the mean slopes.
  void differentiate(const ModelState& model, const MeasuredRecord& record, bool exact,
                     Eigen::MatrixXcd& jacobian);

  // Whitened (S_0 + j w S_1) X b of the last solution, n_y x (K + 1): what a force -b F adds is
  // minus this times F.
  void answer(const ModelState& model, const MeasuredRecord& record, const Eigen::VectorXd& b,
              Eigen::MatrixXcd& whitened) const;
  // The same for an input of channel c, and an output.
  void answer_of_input(const ModelState& model, const MeasuredRecord& record, Eigen::Index channel,
                       Eigen::MatrixXcd& whitened) const;
  void answer_of_output(const MeasuredRecord& record, Eigen::Index channel,
                        Eigen::MatrixXcd& whitened) const;
  // Whitened change of the output with a change of M, C and K under the motion q.
  void answer_of_plant(const PlantChange& change, const Eigen::MatrixXcd& coordinates, bool exact,
                       Eigen::Ref<Eigen::MatrixXcd> whitened);
  // The same with one parameter of the model's own.
  void answer_of_parameter(const MeasuredRecord& record, std::size_t parameter,
                           const Eigen::MatrixXcd& coordinates, bool exact,
                           Eigen::Ref<Eigen::MatrixXcd> whitened);
  // q of the last solution with -b F added to the forces, F given line by line.
  [[nodiscard]] Eigen::MatrixXcd moved_coordinates(const Eigen::VectorXd& b,
                                                   const Eigen::VectorXcd& force) const;

  // The lines of a motion over the grid, its rate with it.
  void motion_of(const Eigen::VectorXcd& deflection, PeriodicMotion& motion);
  // The lines of a law's force under a motion; `deflection` for linear laws.
  void force_lines(const PeriodicLaw& law, const Eigen::VectorXcd& deflection,
                   const PeriodicMotion& motion, Eigen::VectorXcd& force);
  // The lines of an actuator law's f(u) for the recorded command.
  void signal_lines(const PeriodicLaw& law, const MeasuredRecord& record, const LinearPlant& plant,
                    Eigen::Index channel, Eigen::VectorXcd& added);

  [[nodiscard]] const SteadyState& state() const { return state_; }
  [[nodiscard]] double static_scale() const { return static_scale_; }  // of line 0: N^(1/2)

 private:
  struct ForceLaw {
    std::size_t law = 0;  // of the model
    const Location* place = nullptr;
    PeriodicLaw periodic;
    LawTangent tangent{};  // of laws that are not linear
  };

  void list_laws(const ModelState& model);
  void carry_laws(const LinearPlant& plant);
  void drive(const ModelState& model, const MeasuredRecord& record);
  void find_own_forces(const ModelState& model, std::size_t position);
  double renew_own_force(const MeasuredRecord& record);
  void settle_own_force(const MeasuredRecord& record);
  [[nodiscard]] Eigen::VectorXcd seen_motion(const MeasuredRecord& record,
                                             const Eigen::MatrixXcd& coordinates) const;
  [[nodiscard]] double size_of_motion(const MeasuredRecord& record,
                                      const Eigen::MatrixXcd& coordinates) const;
  void virtual_forces();
  void settle_means(const MeasuredRecord& record);
  void couple_laws();
  void assemble();
  void renew_forces(Eigen::MatrixXcd& renewed);
  void factor_mean_slopes();
  void precondition(Eigen::MatrixXcd& change) const;
  void multiply_lines(const std::vector<Eigen::MatrixXcd>& matrices,
                      Eigen::MatrixXcd& values) const;
  // S dz, and (I + S r) dF.
  void apply_slopes(const Eigen::MatrixXcd& deflections, Eigen::MatrixXcd& forces);
  void apply_equation(const Eigen::MatrixXcd& forces, Eigen::MatrixXcd& result);
  // (I + S r)^-1 in place, or with s for S.
  void solve_equation(Eigen::MatrixXcd& forces, bool exact);
  [[nodiscard]] double product(const Eigen::MatrixXcd& a, const Eigen::MatrixXcd& b) const;
  // The lines of a force on one coordinate.
  struct PointForce {
    Eigen::Index coordinate = 0;
    Eigen::VectorXcd lines;
  };
  // Whitened outputs of such forces and of a shift of the rest (or none: empty), with the laws'
  // answer.
  void respond(const std::vector<PointForce>& forces, const Eigen::VectorXd& rest, bool exact,
               Eigen::Ref<Eigen::MatrixXcd> whitened);
  void add_answer_to_rest(const Eigen::VectorXd& rest, Eigen::MatrixXcd& answer);
  [[nodiscard]] double size_in_noise(const Eigen::MatrixXcd& change) const;
  void iterate(const MeasuredRecord& record);
  bool take_last_step(const Eigen::MatrixXcd& step, double size);
  void measure(const MeasuredRecord& record);
  void filter_images(const PeriodicLaw& law, Eigen::Index channel);
  void change_receptance();
  [[nodiscard]] Eigen::VectorXcd law_derivative(const ActingLaw& law, const MeasuredRecord& record,
                                                std::size_t i);
  void differentiate_law(const ActingLaw& law, const MeasuredRecord& record,
                         const Eigen::VectorXcd& change, Eigen::Index force_law, bool exact,
                         Eigen::Ref<Eigen::MatrixXcd> whitened);
  [[nodiscard]] Eigen::VectorXcd deflection_of(const Location& place) const;

  const PlantFamily& family_;
  const PeriodicData& data_;
  SteadyStateOptions options_;
  Eigen::Index lines_;  // K
  double static_scale_;
  PeriodTransform transform_;
  RealTransform samples_;
  SteadyState state_;
  const ModelState* model_ = nullptr;
  const PositionResponse* position_ = nullptr;
  std::vector<ForceLaw> force_laws_;
  Eigen::MatrixXcd input_;                       // with the actuators' laws
  Eigen::MatrixXcd imaged_;                      // the images' part of the output
  Eigen::MatrixXcd driven_;                      // D^-1 h B u, less D^-1 b F of let_act()
  Eigen::MatrixXcd own_;                         // D^-1 f_own
  std::vector<Eigen::MatrixXcd> carried_;        // D^-1 b_out of each force law, n x (K + 1)
  std::vector<Eigen::MatrixXcd> sight_;          // whitened (S_0 + j w S_1) D^-1 of each line
  std::vector<Eigen::MatrixXcd> seen_;           // the same times b_out of each force law
  std::vector<Eigen::MatrixXcd> heard_;          // D^-T b_in of each force law, n x (K + 1)
  std::vector<Eigen::MatrixXcd> between_;        // r of each line
  std::vector<Eigen::MatrixXcd> mean_solution_;  // (I + s r)^-1 of each line
  Eigen::MatrixXd weight_;                       // of forces in noise units, (K + 1) x laws
  std::map<std::size_t, std::unique_ptr<OwnForce>> own_forces_;  // of each position
  std::uint64_t own_forces_of_ = 0;                              // version of the model
  OwnForce* own_force_ = nullptr;                                // at the present position
  PeriodTransform own_transform_;  // of a coarser grid: what the model adds is smooth
  PeriodicMotion motion_;
  Eigen::VectorXd times_;
  Eigen::MatrixXcd deflections_;  // of apply_equation()
};

}  // namespace graybox
