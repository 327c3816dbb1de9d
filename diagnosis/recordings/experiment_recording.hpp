// The signals of one experiment of a campaign, read, checked, converted to base units, cut into its
// segments and preprocessed.
//
//   const ExperimentRecording run = load_experiment(campaign, 0);
//   run.data.pieces[0].values.col(run.index_of("speed"))     // rad/s
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/recordings/preprocess.hpp"
#include "diagnosis/signal_faults/finding.hpp"
#include "diagnosis/signal_faults/recording_copies.hpp"

namespace graybox {

struct ExperimentRecording {
  Signals data;             // empty pieces if there are errors among the findings
  std::size_t samples = 0;  // in the files
  // s, of the pieces: before preprocessing, but of uneven times as they are resampled.
  double duration = 0.0;
  std::vector<Finding> findings;
  std::map<std::string, SampleFingerprint> fingerprints;  // of outputs, by channel

  [[nodiscard]] bool sound() const;  // no finding is an error
  // Column of `values`. Throws InputError if there is no such signal.
  [[nodiscard]] Eigen::Index index_of(const std::string& name) const;
};

// Whether channels of one motion are compared (motion_pairs.hpp). That takes longer.
enum class MotionPairs { kIgnored, kCompared };

// Reads and checks; faults of the data are findings. It checks the time axis of every file
// (time_axis.hpp), every signal (signal_checks.hpp), files of one experiment against each other
// (length, times) and data faults (data_faults.hpp). It also checks units and sample times that
// files state, names and units that contradict each other, and segments and periods against the
// length. Numbers are mended first as the campaign's first steps say (mends_recorded), which is a
// warning, and what is mended is checked. Throws InputError for files that can't be read and for
// columns that are not there.
[[nodiscard]] ExperimentRecording examine_experiment(const Campaign& campaign, std::size_t index,
                                                     MotionPairs pairs = MotionPairs::kIgnored);

// The same; throws InputError with the first error that was found.
[[nodiscard]] ExperimentRecording load_experiment(const Campaign& campaign, std::size_t index);

// Remembers recordings and says which later ones are copies of them (recording_copies.hpp). The
// same file in two experiments is no copy.
class CopyFinder {
 public:
  // Adds warnings to `recording`.
  void examine(const Experiment& experiment, ExperimentRecording& recording);

 private:
  struct Known {
    const Experiment* experiment;
    std::map<std::string, SampleFingerprint> fingerprints;
  };
  std::vector<Known> known_;
};

// What the campaign file itself makes doubtful: channels that read each other's columns, columns
// whose name ends in another unit than the stated one ("position_deg" in rad), and validation on
// samples that are for estimation too.
[[nodiscard]] std::vector<Finding> examine_campaign(const Campaign& campaign);

}  // namespace graybox
