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

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "problems/information/information_set.hpp"

namespace graybox {

struct ExperimentOption {
  std::string position;                  // in words
  std::vector<double> position_degrees;  // empty for models without positions
  double level = 0.0;                    // in the unit of the campaign's levels
  double from = 0.0, to = 0.0;           // Hz, excited band
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

// The distance D at which the wrong explanation is excluded with a probability of 90 %. Of two
// explanations with as many parameters the difference in BIC is about normal with mean D and
// variance 4 D, and exclusion asks for `margin` of it: D = (z + (z^2 + margin)^(1/2))^2, z = 1.28.
[[nodiscard]] double distance_that_excludes(double margin);

// `exclusion_margin`: of SearchOptions. None where the problem can't be solved.
[[nodiscard]] std::optional<NextExperiment> next_experiment(const RivalExperiments& rivals,
                                                            double exclusion_margin = 10.0);

}  // namespace graybox
