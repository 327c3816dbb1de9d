// campaign.yaml of a proposal, as text with a reason behind each line.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/log_columns/log_recordings.hpp"
#include "diagnosis/log_columns/log_time.hpp"

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
  Eigen::Index from = 0;  // of LogTime::every samples of the segment
};

// What of the logs goes where, each leaving more samples to the fit than the one before it.
enum class SplitPlan {
  kMovingHalves,  // what moves; of one log half is kept out, of several the last
  kWholeHalves,   // standstill, too
  kMostInFit,     // of one log the last quarter is kept out
  kNoValidation   // nothing is
};

struct DraftWrap {
  std::string channel;
  std::string period;  // ", bits: 16", ", period: 3600", or empty for a whole turn
};

struct CampaignDraft {
  std::string heading;  // comment lines without their sign
  LogTime time;
  std::vector<DraftChannel> channels;
  std::vector<std::string> computed;  // last steps of `preprocess`, a line each
  std::vector<DraftWrap> wrapped;     // channels that jump by whole periods
  std::vector<std::string> gapped;    // channels with values that are no numbers
  std::optional<double> low_pass;     // Hz
  std::string low_pass_reason;
  Eigen::Index decimation = 1;  // behind the low-pass
  std::string decimation_reason = "each value is held so long";
  std::string hold = "zero", hold_reason = {};
  std::vector<DraftExperiment> experiments;
  std::vector<std::string> unused;  // "column: why not", for the comment at the end
};

// Why recordings were cut into parts.
inline constexpr const char* kOppositeWays =
    "each recording goes one way, and they go opposite ways: both ways are in the fit and in what "
    "is kept out";

// Names of data files are relative to `folder`.
[[nodiscard]] std::string campaign_text(const CampaignDraft& draft,
                                        const std::vector<LogRecording>& recordings,
                                        const std::filesystem::path& folder);

// What each recording gives to the fit and to its check, by the plan. `columns` are the motions
// that decide what moves, of the first recording. Of three or more recordings the last one is kept
// out whose loss leaves both ways to the fit, where they go both. Where all of two go one way in
// the fit and the other way in the recording kept out, both are cut into parts, and each role has
// parts of both; there are more experiments than recordings then.
[[nodiscard]] std::vector<DraftExperiment> draft_experiments(
    const std::vector<LogRecording>& recordings, const std::vector<const LogColumn*>& columns,
    bool are_velocities, double sample_time, SplitPlan plan = SplitPlan::kMovingHalves);

// A name in double quotes, as YAML reads it.
[[nodiscard]] std::string in_quotes(const std::string& text);

}  // namespace graybox
