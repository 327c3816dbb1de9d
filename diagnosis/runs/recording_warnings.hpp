// What a reader should know of the recordings, beside what was found in them.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/report/html_page.hpp"

namespace graybox {

struct ExaminedRecordings {
  std::vector<std::string> warnings;  // a dozen at most, and how many more there are
  std::vector<PageFile> files;        // with the samples of those that were read
  std::vector<std::string> clipped;   // inputs with flat tops, no goals, and without a range
};

// Clipped, constant or jittering channels, and one recording under two names: a saturated sensor
// looks like missing physics, too. Recordings that there is no time to read (stop.hpp) are counted
// in a warning.
[[nodiscard]] ExaminedRecordings examine_recordings(const Campaign& campaign);

// For a model of masses, which knows no loads: empty where no recording has one.
[[nodiscard]] std::vector<std::string> warnings_of_loads(const Campaign& campaign);

}  // namespace graybox
