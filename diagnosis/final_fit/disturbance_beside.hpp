// A fit whose filter follows a disturbance, beside the fit as it is.
//
// A disturbance adds up, and what adds up hides the size of a law. So fits over windows of 10 and
// 30 samples of the search are tried, whose filters follow the force. The likeliest is taken, by
// the likelihood of latent_force.hpp.
#pragma once

#include "diagnosis/final_fit/last_fit.hpp"

namespace graybox {

// Takes the likeliest of these fits where a force remains (unmodelled_force.hpp) and the rest is
// above twice the sensors' noise. One that leaves much more over longer runs is not taken: there
// more is missing than a disturbance.
void fit_beside_disturbance(LastFit& last);

}  // namespace graybox
