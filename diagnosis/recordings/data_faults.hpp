// Faults of the data that show in the samples by themselves, before any physics. What each detector
// found is said in words (spike.hpp, stuck_sensor.hpp, counter_wrap.hpp, lost_samples.hpp,
// quantisation.hpp, speed_impact.hpp, held_values.hpp, lost_sign.hpp, recording_copies.hpp). Each
// comes with its place, how sure it is, what else it could be and the line of campaign.yaml that
// mends it. Nothing is mended here, but it is told which samples can't be data, for
// fault_mending.hpp.
//
// How often each rule is wrong and right was measured on real recordings:
// docs/how_to/faulty_data.md.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <set>
#include <string>
#include <utility>
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
  bool is_even = true;       // the campaign states a sample time
  std::size_t thinned = 1;   // the campaign takes one of so many samples
  // Lowest and highest of the file's samples outside of these, which steps of the campaign meet,
  // too. None where these are all.
  std::optional<std::pair<double, double>> elsewhere = {};
};

// Samples of one channel that can't be what the machine did. Rows of the piece.
struct FaultySamples {
  std::set<Eigen::Index> spikes;
  // A measured position held its value and then jumped.
  std::optional<std::pair<Eigen::Index, Eigen::Index>> held;  // first and last row
  std::vector<Eigen::Index> jumps;                            // the sample after each
};

struct DataFaults {
  std::vector<FaultySamples> channels;
  bool times_jitter = false;  // and the samples don't (arrival_times.hpp)
};

// Adds warnings about the channels of one piece of an experiment.
// Cost: O(samples) a channel, some sorting.
DataFaults find_data_faults(const std::vector<ChannelSamples>& piece,
                            std::vector<Finding>& findings);

}  // namespace graybox
