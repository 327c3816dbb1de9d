// The experiment that tells two explanations apart.
//
// Explanation A, fitted, has the free parameters theta; B predicts other outputs. Between the two
// lies
//   y(theta, s) = y_A + J (theta - theta_A) + s (y_B - y_A),
// s = 0 if A is right and 1 if B is. After recordings with information matrix M of (theta, s), in
// units of the noise, s has the variance [M^-1]_ss, and
//   distance = 1 / [M^-1]_ss
// is the non-centrality of the test of A against B: the misfit of A's outputs to B's that no change
// of A's parameters takes away, A linearised. To find the design weights that make it largest is
// Atkinson's and Fedorov's T-optimality (Biometrika 62, 1975) for a linearised A. It is also
// D_s-optimality for the one parameter s (facts: the sensitivities of D_s at the optimum are at
// most 1). This is a convex problem, which column_generation solves and the checker certifies.
//
// What is known already counts: each option's matrix is M_0 + n M_i, M_0 of the recordings at hand,
// n M_i of as many recordings again, all of option i. Weights are shares of those n recordings.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "problems/information/information_set.hpp"

namespace graybox {

// A motion to be made: where each channel should be at each time.
struct PlannedMotion {
  std::vector<std::string> channels, units;
  Eigen::VectorXd time;      // s
  Eigen::MatrixXd position;  // samples x channels
};

// A periodic excitation, or a recorded motion that is changed and made again.
struct ExperimentOption {
  std::string position;                  // in words
  std::vector<double> position_degrees;  // empty for models without positions
  double level = 0.0;                    // in the unit of the campaign's levels
  double from = 0.0, to = 0.0;           // Hz, excited band

  std::string recording = {};  // whose motion is made again; empty: periodic excitation
  double amplitude = 1.0;      // times that of the recording
  double speed = 1.0;          // times as fast, beside what the amplitude does
  std::string alone = {};      // the only joint that moves; empty: all as recorded
  std::shared_ptr<const PlannedMotion> motion = {};
};

struct RivalExperiments {
  std::vector<ExperimentOption> options;  // one a candidate of the set
  InformationSet information;             // M_0 + n M_i; the last parameter is s
  double distance_now = 0.0;              // 1 / [M_0^-1]_ss
  double recordings = 0.0;                // n
  double distance_at_best = 0.0;          // of the best option alone, 1 / [(M_0 + n M_i)^-1]_ss
};

struct NextExperiment {
  struct Share {
    ExperimentOption option;
    double weight = 0.0;
  };
  std::vector<Share> shares;   // those of 1 % and more, by weight
  double duality_gap = 0.0;    // of the certificate
  double distance_now = 0.0;   // of the recordings at hand
  double distance_then = 0.0;  // with n recordings of this design besides
  double recordings = 0.0;     // n
  double distance_needed = 0.0;
  // Recordings of this design that lead there, from what n of them bring; infinite where they bring
  // nothing.
  double recordings_needed = 0.0;
};

// M_0 and n M_i of each option, in any units, as such a set; parameters that the recordings do not
// see are left out. None where they determine no parameter, or an option is no number.
[[nodiscard]] std::optional<RivalExperiments> rival_experiment_set(
    const Eigen::MatrixXd& now, const std::vector<Eigen::MatrixXd>& further,
    std::vector<ExperimentOption> options, double recordings);

// The distance D at which the wrong explanation is excluded with a probability of 90 %. Of two
// explanations with as many parameters the difference in BIC is about normal with mean D and
// variance 4 D, and exclusion asks for `margin` of it: D = (z + (z^2 + margin)^(1/2))^2, z = 1.28.
[[nodiscard]] double distance_that_excludes(double margin);

// `exclusion_margin`: of SearchOptions. `told_now`: the distance that the recordings at hand were
// found to have, where that is less than what M_0 says: noise is then taken to be larger by as
// much. None where the problem can't be solved.
[[nodiscard]] std::optional<NextExperiment> next_experiment(
    const RivalExperiments& rivals, double exclusion_margin = 10.0,
    double told_now = std::numeric_limits<double>::infinity());

}  // namespace graybox
