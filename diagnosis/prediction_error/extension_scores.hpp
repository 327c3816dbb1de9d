// All laws that may be missing, ranked in the light of one fit, each by a pass or two of the
// predictor at a small amplitude a:
//
//   d = (r(a) - r(0)) / a,   A = d - Q Q'd,   r_0 = r - Q Q'r,   Q an orthonormal basis of J,
//   share = (A'r_0)^2 / (A'A r_0'r_0),   amplitude = -A'r_0 / A'A:
//
// the part of what is left that the law would take, the model's own parameters refitted (a score
// test: Rao, Proceedings of the Cambridge Philosophical Society 44, 1948). Where A'A < 1e-6 d'd the
// model's parameters imitate the law. Laws with no useful slope at zero (saturation) are scored by
// the step.
//
// The share is no test: what is left has memory. It makes a shortlist, once as it is and once with
// r, d and J freed of their memory by an autoregression of order 10 of each output.
#pragma once

#include <vector>

#include "diagnosis/predictor/prediction_fit.hpp"

namespace graybox {

struct ExtensionScore {
  std::size_t extension = 0;  // index into the list that was scored
  double share = 0.0;         // 0: imitated, or of a sign that the law can't have
  double whitened_share = 0.0;
  double amplitude = 0.0;
  double deviation = 0.0;  // of the amplitude, taking the rest for white; 0: imitated
};

// One for each extension that moves the errors at all, best share first.
[[nodiscard]] std::vector<ExtensionScore> extension_scores(
    const PredictionFitter& fitter, const PredictionFit& fit, const Eigen::VectorXd& weights,
    const std::vector<LawExtension>& extensions);

// The first of both rankings, one start a hypothesis each.
[[nodiscard]] std::vector<ExtensionScore> shortlist(const std::vector<ExtensionScore>& scores,
                                                    const std::vector<LawExtension>& extensions,
                                                    std::size_t plain, std::size_t whitened);

}  // namespace graybox
