// Fits that begin far from the optimum, where resonances make chi-square rugged and it has minima
// in which two of them are swapped. Data whose noise is raised to a share of the outputs' level are
// smooth, for everywhere the model is allowed to be wrong by that share. Fits go on from large
// shares to small ones, on the recordings that tell most (telling_recordings.hpp). They end with
// all recordings and the noise as it is. Until there what only refines a law (parameters that may
// be left out, as the corner of a saturation) stays where it is.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "diagnosis/periodic/periodic_fit.hpp"

namespace graybox {

// With all that refines a law (LawParameter::if_absent: the corner of a limit) held where it is:
// where the data are far, it makes of one law another that is none.
[[nodiscard]] std::vector<ActingLaw> with_refinements_held(std::vector<ActingLaw> laws);
[[nodiscard]] bool has_refinements(const LawEntry& law);

// From each start through 0.3 of the level to 0.03 and 0.003, until one comes near the data; from
// the best of them to the end.
[[nodiscard]] PeriodicFit fit_periodic_gradually(const PlantFamily& family,
                                                 const PeriodicData& data,
                                                 const std::vector<Eigen::VectorXd>& starts,
                                                 const std::vector<ActingLaw>& laws,
                                                 const PeriodicFitOptions& options);

// The same where a start comes near; else it has not converged. A start that ends far off the data
// at one of those shares is given up there.
[[nodiscard]] PeriodicFit fit_periodic_if_near(const PlantFamily& family, const PeriodicData& data,
                                               const std::vector<Eigen::VectorXd>& starts,
                                               const std::vector<ActingLaw>& laws,
                                               const PeriodicFitOptions& options);

// A strong law leaves a model without it far off, its parameters with it. Three steps lead to both:
//   1. any force may act at the law's place (PeriodicFitOptions::freed), so that nothing is left
//      for the other parameters to take, and no law needs to be known: where this does not come
//      near, no law at that place alone explains the data;
//   2. the law, and the parameters that such a force imitates, from that force and the motion there
//      (place_force_fit.hpp; of signals the law as it is given);
//   3. all together, through the shares above.
// `freed_fit`: step 1 beside the other laws, which it fits, too. Needs more outputs than one, and a
// law that is no part of the plant and whose force acts where its motion is seen (can_free); cost:
// as that of a model without the law.
[[nodiscard]] bool can_free(const PeriodicData& data, const ActingLaw& law);
[[nodiscard]] PeriodicFit freed_fit(const PlantFamily& family, const PeriodicData& data,
                                    const std::vector<Eigen::VectorXd>& starts,
                                    const std::vector<ActingLaw>& others, const Location& place,
                                    const PeriodicFitOptions& options);

// Steps 2 and 3, for one law beside those of `freed`. Not converged where a step leads nowhere near
// the data.
[[nodiscard]] PeriodicFit fit_periodic_after_freed(const PlantFamily& family,
                                                   const PeriodicData& data,
                                                   const PeriodicFit& freed, const ActingLaw& law,
                                                   const PeriodicFitOptions& options);

}  // namespace graybox
