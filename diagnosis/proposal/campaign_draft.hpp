// campaign.yaml of a proposal, as text with a reason behind each line.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/proposal/log_recordings.hpp"
#include "diagnosis/proposal/log_time.hpp"

namespace graybox {

struct DraftChannel {
  std::string name;
  std::size_t file = 0;  // of LogRecording::files
  std::string column;
  std::string unit;     // as recorded
  std::string gain;     // "{value: 1, unit: N m/A}", or empty
  std::string is;       // input, output, reference, other
  std::string comment;  // "# ANSWER: ..." makes it an open question
};

struct DraftExperiment {
  std::size_t recording = 0;
  Eigen::Index first = 0, last = 0;  // samples, both included
  bool is_whole = true;
  bool is_validation = false;
};

struct CampaignDraft {
  std::string heading;  // comment lines without their sign
  LogTime time;
  std::vector<DraftChannel> channels;
  std::vector<std::string> wrapped;  // channels that are kept within a turn
  std::vector<std::string> gapped;   // channels with values that are no numbers
  std::optional<double> low_pass;    // Hz
  std::string low_pass_reason;
  std::string hold = "zero";
  std::vector<DraftExperiment> experiments;
  std::vector<std::string> unused;  // "column: why not", for the comment at the end
};

// Names of data files are relative to `folder`.
[[nodiscard]] std::string campaign_text(const CampaignDraft& draft,
                                        const std::vector<LogRecording>& recordings,
                                        const std::filesystem::path& folder);

// What moves of each recording: with several, the last checks the fit; one is cut in two
// halves. `columns` are the motions that decide, of the first recording.
[[nodiscard]] std::vector<DraftExperiment> draft_experiments(
    const std::vector<LogRecording>& recordings, const std::vector<const LogColumn*>& columns,
    bool are_velocities, double sample_time);

// A name in double quotes, as YAML reads it.
[[nodiscard]] std::string in_quotes(const std::string& text);

}  // namespace graybox
