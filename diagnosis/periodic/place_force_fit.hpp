// A law from the force and the motion at its place alone.
//
// With a model whose other parameters are right (freed_fit of gradual_fit.hpp), recordings say at
// each line which force F acts at a place beyond the model, and which motion z there goes with it.
// What remains is a regression of one on the other,
//
//   F(k) = f(z; p)(k) + sum_i a_i D_i(k) z(k),
//
// p the law's parameters and a_i the changes of those parameters of the model that act as forces at
// the place (D_i = b^T dD/dtheta_i b / (b^T b)^2: the spring beside the law). No steady state is
// solved, so that the fit has none of the valleys of one that simulates the motion. No sensor sees
// where z stands on average: it follows from what the law holds there, z_0 = z_rest - r_0 mean(F),
// r_0 the static compliance.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "diagnosis/periodic/periodic_fit.hpp"

namespace graybox {

struct PlaceForceFit {
  bool usable = false;
  Eigen::VectorXd parameters;  // of the model
  ActingLaw law;
  double left =
      1.0;  // share of the force's power, each line by its noise, that the law does not explain
};

// The law is at an element whose force acts where its motion is seen (b_in = b_out = b), its
// parameters are where the fit starts; `freed` (gradual_fit.hpp) holds the model's parameters and
// the other laws. Not usable where the model has no rest, or no fit is found. SI units. Cost: some
// hundred forces of the law over a period for each recording.
[[nodiscard]] PlaceForceFit fit_place_force(const PlantFamily& family, const PeriodicData& data,
                                            const PeriodicFit& freed, const ActingLaw& law);

}  // namespace graybox
