// What moves at a place of a model in one recording, and the force there that the recording asks
// for.
//
// Where a fit is clearly wrong the motion follows the data: a force at the place, by least squares
// at each line, takes what the model leaves, and channels that measure the deflection are taken as
// recorded. Else it is the model's, for a deflection with the noise of the residuals in it is
// correlated with them.
#pragma once

#include <Eigen/Core>
#include <complex>

#include "diagnosis/harmonic_balance/periodic_data.hpp"
#include "diagnosis/harmonic_balance/steady_state.hpp"

namespace graybox {

// The whitened answer of the outputs to a force or signal at a place, n_y x (K + 1).
void answer_at(SteadyStateSolver& solver, const ModelState& model, const MeasuredRecord& record,
               const Location& place, Eigen::MatrixXcd& answer);

// The virtual force and the motion at a place, in one recording.
struct SteadyPlaceMotion {
  Eigen::VectorXcd deflection;   // or the signal
  Eigen::VectorXcd force;        // virtual; empty at signals
  Eigen::MatrixXcd coordinates;  // with it
  bool is_moved = false;         // coordinates are not those of the model
};

class PlaceObserver {
 public:
  // Of the solver's last solution. `follows_data`: else the motion is the model's throughout.
  PlaceObserver(SteadyStateSolver& solver, const ModelState& model, const PeriodicData& data,
                bool follows_data)
      : solver_(solver), model_(model), data_(data), follows_data_(follows_data) {}

  // `answer`: whitened, of a force at the place (not used at sensors).
  [[nodiscard]] SteadyPlaceMotion observe(const MeasuredRecord& record, const Location& place,
                                          const Eigen::MatrixXcd& answer) const;

 private:
  void move(const Eigen::VectorXd& b, const Eigen::VectorXcd& force,
            SteadyPlaceMotion& motion) const;
  [[nodiscard]] Eigen::VectorXcd holds() const;
  [[nodiscard]] Eigen::VectorXcd virtual_force(const Eigen::MatrixXcd& residual,
                                               const Eigen::MatrixXcd& answer) const;
  [[nodiscard]] Eigen::VectorXcd measured(const MeasuredRecord& record, Eigen::Index channel) const;
  void take_measured(const MeasuredRecord& record, const LinearPlant& plant, const Location& place,
                     const Eigen::VectorXcd& force, Eigen::VectorXcd& deflection) const;

  SteadyStateSolver& solver_;
  const ModelState& model_;
  const PeriodicData& data_;
  bool follows_data_;
};

}  // namespace graybox
