// Ceres without its log: graybox says itself what came out of a fit.
#pragma once

namespace graybox {

// Below fatal errors nothing is logged from now on. Called before each fit. A program that has
// initialised glog keeps its own settings.
void silence_ceres();

}  // namespace graybox
