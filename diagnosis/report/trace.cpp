#include "diagnosis/report/trace.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <numeric>

namespace graybox {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kStillPoints = 500;
constexpr std::size_t kFewestPoints = 200;  // of a trace, however many there are

// Adds where a series is smallest and largest between two samples.
void add_extremes(const std::vector<double>& values, std::size_t first, std::size_t end,
                  std::vector<std::size_t>& kept) {
  std::size_t low = end, high = end;
  for (std::size_t i = first; i < end; ++i) {
    if (!std::isfinite(values[i])) continue;
    if (low == end || values[i] < values[low]) low = i;
    if (high == end || values[i] > values[high]) high = i;
  }
  if (low != end) kept.push_back(low);
  if (high != end) kept.push_back(high);
}

// Six digits, so that a page stays small.
Json rounded(double value) {
  if (!std::isfinite(value)) return nullptr;
  return std::strtod(fmt::format("{:.6g}", value).c_str(), nullptr);
}

Json rows_of(const Trace& trace, std::size_t most) {
  Json rows = Json::array();
  for (const std::size_t i : thinned_samples(trace, most)) {
    Json& row = rows.emplace_back(Json::array({rounded(trace.time[i])}));
    for (const TraceSeries& series : trace.series) row.push_back(rounded(series.values[i]));
  }
  return rows;
}

constexpr const char* kColours[] = {"#777777", "#d55e00", "#0072b2", "#009e73"};
constexpr const char* kDashes[] = {"", "5 3", "", "2 2"};

}  // namespace

std::vector<std::size_t> thinned_samples(const Trace& trace, std::size_t most) {
  const std::size_t samples = trace.time.size();
  std::vector<std::size_t> kept;
  if (samples <= most) {
    kept.resize(samples);
    std::iota(kept.begin(), kept.end(), std::size_t{0});
    return kept;
  }
  const std::size_t of_bucket = 2 * std::max<std::size_t>(1, trace.series.size());
  const std::size_t buckets = std::max<std::size_t>(1, most / of_bucket);
  for (std::size_t b = 0; b < buckets; ++b) {
    const std::size_t first = b * samples / buckets, end = (b + 1) * samples / buckets;
    for (const TraceSeries& series : trace.series) add_extremes(series.values, first, end, kept);
  }
  std::ranges::sort(kept);
  kept.erase(std::unique(kept.begin(), kept.end()), kept.end());
  return kept;
}

Json traces_json(const std::vector<Trace>& traces, std::size_t most_points) {
  Json list = Json::array();
  const std::size_t most =
      std::max(kFewestPoints, most_points / std::max<std::size_t>(1, traces.size()));
  for (const Trace& trace : traces) {
    Json names = Json::array();
    for (const TraceSeries& series : trace.series) names.push_back(series.name);
    list.push_back({{"recording", trace.recording},
                    {"channel", trace.channel},
                    {"unit", trace.unit},
                    {"kept_out", trace.is_kept_out},
                    {"words", trace.words},
                    {"names", std::move(names)},
                    {"samples", trace.time.size()},
                    {"rows", rows_of(trace, most)}});
  }
  return {{"traces", std::move(list)}};
}

Chart trace_chart(const Trace& trace) {
  Chart chart;
  chart.title = trace.channel + (trace.recording.empty() ? "" : ", " + trace.recording) +
                (trace.is_kept_out ? ", kept out" : "");
  chart.x.label = "time, s";
  chart.y.label = trace.channel + (trace.unit.empty() ? "" : ", " + trace.unit);
  const std::vector<std::size_t> kept = thinned_samples(trace, kStillPoints);
  for (std::size_t s = 0; s < trace.series.size(); ++s) {
    ChartSeries line;
    line.name = trace.series[s].name;
    line.colour = kColours[s % std::size(kColours)];
    line.dash = kDashes[s % std::size(kDashes)];
    for (const std::size_t i : kept) {
      line.x.push_back(trace.time[i]);
      line.y.push_back(trace.series[s].values[i]);
    }
    chart.series.push_back(std::move(line));
  }
  return chart;
}

}  // namespace graybox
