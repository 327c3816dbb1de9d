// What was measured beside what a model predicts, along time, as data for a page.
//
// Long traces are thinned: the samples are cut into buckets of equally many, and of each bucket the
// samples stay where a series is smallest or largest. So peaks survive, and what stays was
// measured.
#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "diagnosis/report/svg_chart.hpp"

namespace graybox {

struct TraceSeries {
  std::string name;            // "measured", "predicted before"
  std::vector<double> values;  // NaN: not there
};

struct Trace {
  std::string recording, channel, unit;
  bool is_kept_out = false;
  std::string words = {};  // below the title: errors
  std::vector<double> time = {};
  // The first is what was measured, the others are predictions of it.
  std::vector<TraceSeries> series = {};
};

// Indices of the samples that stay, rising; all where there are at most `most`. Never more.
[[nodiscard]] std::vector<std::size_t> thinned_samples(const Trace& trace, std::size_t most);

// {"traces": [{"recording", "channel", "unit", "kept_out", "words", "names": [...],
//              "samples": n, "rows": [[time, measured, ...], ...]}]}, six digits. At most
// `most_points` samples in all traces together.
[[nodiscard]] nlohmann::ordered_json traces_json(const std::vector<Trace>& traces,
                                                 std::size_t most_points);

// For paper, and where no script runs.
[[nodiscard]] Chart trace_chart(const Trace& trace);

}  // namespace graybox
