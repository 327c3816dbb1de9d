// What is done to the signals of an experiment after they are read and before anything is computed
// from them, in the order of the campaign's list. Every piece of consecutive samples is treated by
// itself: nothing is filtered or differentiated across a gap.
//
// low_pass      Butterworth low-pass of order n at f_c, forward and then backward: zero phase,
//               |H|^2 = 1/(1 + (tan(pi f T_s)/tan(pi f_c T_s))^(2n)), so -6 dB at f_c. The ends are
//               extended by odd reflection. Filter inputs and outputs alike: the relation between
//               them then stays the same.
// decimate      every k-th sample. Refused unless each channel was low-passed below the new Nyquist
//               frequency (what lies above would fold), and for a periodic excitation unless k
//               divides the period and all lines are below it.
// derivative    parabola: that through three neighbours, second order, also for uneven times;
//               band_limited: of all samples of a piece, for signals without anything above half
//               the sample rate (band_limited_derivative.hpp). Even samples only.
// trim          the first and last seconds of each piece go: there a zero-phase filter knew but
//               half of what it averages. Refused for a periodic excitation, whose periods would be
//               cut.
// transmission  motor angles q_m = N q_a and torques t_a = N' t_m (Transmission in campaign.hpp).
//
// Numbers as recorded are mended first (mends_recorded()); each leaves a remark:
// valid, rows   samples outside are missing, not data: the piece is cut there. Pieces below
//               kShortestPiece samples go.
// unwrap        whole periods of a counter (2^bits) or an angle (a turn) are added.
//
// resample      irregular times to even ones by the cubic through the four nearest samples; a step
//               longer than longest_step() (sample_interpolation.hpp) cuts the piece. What the
//               interpolation is wrong by is a remark.
// sign, scale   the channel times -1, or a factor, in its place.
// advance       a late channel is read that much later, by the same cubic; pieces end that much
//               earlier.
// integral      trapezoidal, zero where each piece begins.
// product, sum  of channels; a sum has weights.
// constant      a channel of one value, as a force of zero.
// motor_torque  k_t (V - k_e w) / R.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/recordings/campaign.hpp"

namespace graybox {

// One low-pass that a signal went through.
struct FilterPass {
  double frequency = 0.0;  // Hz
  int order = 0;
};

struct Signal {
  std::string name;
  std::string unit;  // base unit (units.hpp)
  ChannelRole role;
  double low_pass = 0.0;  // Hz, lowest filter it went through; 0: none
  std::vector<FilterPass> filters =
      {};  // all of them; of a combination those of its least filtered
};

// Consecutive samples.
struct SignalPiece {
  std::size_t first_sample;  // in the file
  Eigen::VectorXd time;      // s
  Eigen::MatrixXd values;    // [samples x signals]
};

struct Signals {
  std::vector<Signal> signals;
  std::optional<double> sample_time;  // s; none: irregular
  std::optional<PeriodicExcitation> excitation;
  std::vector<SignalPiece> pieces;
  std::vector<std::string> remarks = {};  // of steps that lose accuracy: how much
};

constexpr Eigen::Index kShortestPiece = 20;  // samples, of what missing samples leave

// Throws InputError (`source` begins its line) if a step can't be done. Reasons are a filter above
// the Nyquist frequency or of irregular samples, pieces too short and decimation that would fold.
// Others are a period that the factor doesn't divide or a trim would cut, and channels of a
// transmission in different or unfit units.
void preprocess(const std::string& source, const std::vector<PreprocessStep>& steps,
                Signals& signals);

// The filter of low_pass. `frequency` as a share of the sample rate, below 1/2; at least two
// values.
[[nodiscard]] Eigen::VectorXd zero_phase_low_pass(const Eigen::Ref<const Eigen::VectorXd>& values,
                                                  double frequency, int order);

// d values / d time at each time. At least three rising times.
[[nodiscard]] Eigen::VectorXd time_derivative(const Eigen::Ref<const Eigen::VectorXd>& time,
                                              const Eigen::Ref<const Eigen::VectorXd>& values);

}  // namespace graybox
