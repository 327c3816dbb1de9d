// Faults of the data that show in the samples by themselves, before any physics. What each detector
// found is said in words (spike.hpp, stuck_sensor.hpp, counter_wrap.hpp, lost_samples.hpp,
// quantisation.hpp, recording_copies.hpp). Each comes with its place, how sure it is, what else it
// could be and the line of campaign.yaml that mends it. Nothing is mended here.
//
// How often each rule is wrong and right was measured on real recordings: docs/recordings.md.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/signal_faults/finding.hpp"

namespace graybox {

// Consecutive samples of one channel as recorded.
struct ChannelSamples {
  std::string file;  // its name, for messages
  const Channel* channel;
  Eigen::VectorXd values;    // recorded unit
  Eigen::VectorXd time;      // s
  std::size_t first_sample;  // in the file
};

// Adds warnings about the channels of one piece of an experiment.
// Cost: O(samples) a channel, some sorting.
void find_data_faults(const std::vector<ChannelSamples>& piece, std::vector<Finding>& findings);

}  // namespace graybox
