// Spikes: one or two samples that stand away from their neighbours.
//
// Rule 1: |x - median of five| above the larger of
//   12 robust standard deviations of that distance (1.4826 times its median),
//   8 times the step that 99.9 % of all steps of the running median keep below.
// Rule 2, for a single sample in a fast but smooth signal, as a sine whose steps are large:
//   |x - cubic through two samples on each side of it| above 16 times what 99 % of all samples do,
//   and six times what its neighbours leave of their cubics once it is put on its own.
// Where noise and steps are too small to tell, above 1e-6 of the largest value.
// The running median has no spikes, so that many of them don't hide each other.
// Measured on the recordings named in docs/how_to/recordings.md; the rates are in faulty_data.md.
// No answer for signals of at most 16 levels (they switch) and below 100 samples. Cost: O(n).
#pragma once

#include <Eigen/Core>
#include <vector>

namespace graybox {

struct Spike {
  Eigen::Index sample;
  double strength;  // distance over its threshold, above 1
};

[[nodiscard]] std::vector<Spike> find_spikes(const Eigen::Ref<const Eigen::VectorXd>& values);

}  // namespace graybox
