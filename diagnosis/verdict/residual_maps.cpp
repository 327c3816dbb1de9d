#include "diagnosis/verdict/residual_maps.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "diagnosis/verdict/curve_traces.hpp"
#include "diagnosis/verdict/verdict_file.hpp"

namespace graybox {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kTimeColumns = 12;

struct MapPlace {
  std::string position;
  double level = 0.0;
  bool operator==(const MapPlace&) const = default;
};

template <typename Value>
std::size_t index_in(std::vector<Value>& list, const Value& value) {
  const auto found = std::find(list.begin(), list.end(), value);
  if (found != list.end()) return static_cast<std::size_t>(found - list.begin());
  list.push_back(value);
  return list.size() - 1;
}

std::string map_name(const MapPlace& place) {
  std::string name = place.position;
  if (place.level > 0.0) name += fmt::format("{}level {:g}", name.empty() ? "" : ", ", place.level);
  return name;
}

double size_of(const MismatchCell& cell) {
  return std::sqrt(cell.statistic / cell.degrees_of_freedom);
}

HeatMap band_map(const std::vector<MismatchCell>& cells, const std::vector<bool>& rejected,
                 const MapPlace& place) {
  HeatMap map;
  std::vector<double> starts;
  for (const MismatchCell& cell : cells) {
    if (place == MapPlace{cell.position, cell.level}) starts.push_back(cell.from);
  }
  std::sort(starts.begin(), starts.end());
  starts.erase(std::unique(starts.begin(), starts.end()), starts.end());
  for (const double start : starts) map.columns.push_back(fmt::format("{:.3g}", start));
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const MismatchCell& cell = cells[i];
    if (!(place == MapPlace{cell.position, cell.level})) continue;
    const std::size_t row = index_in(map.rows, cell.channel);
    if (map.values.size() < map.rows.size()) {
      map.values.emplace_back(starts.size(), kNaN);
      map.marked.emplace_back(starts.size(), false);
    }
    const auto column = static_cast<std::size_t>(
        std::lower_bound(starts.begin(), starts.end(), cell.from) - starts.begin());
    map.values[row][column] = size_of(cell);
    map.marked[row][column] = rejected[i];
  }
  map.column_label = "frequency from, Hz";
  map.value_label = "rms residual over noise; framed: more than noise";
  map.has_numbers = true;
  return map;
}

// The columns of a map of one recording: equal times.
HeatMap empty_time_map(const std::vector<double>& time) {
  HeatMap map;
  const double from = time.front(), to = time.back();
  for (std::size_t c = 0; c <= kTimeColumns; ++c) {
    map.edges.push_back(from + (to - from) * static_cast<double>(c) / kTimeColumns);
    if (c < kTimeColumns) map.columns.push_back(fmt::format("{:.3g}", map.edges.back()));
  }
  map.column_label = "time from, s";
  map.value_label = "rms of what is left, % of the channel's signal";
  map.has_numbers = true;
  return map;
}

double deviation_of(const std::vector<double>& values) {
  double count = 0.0, mean = 0.0, spread = 0.0;
  for (const double value : values) {
    if (std::isfinite(value)) count += 1.0, mean += value;
  }
  mean /= count;
  for (const double value : values) {
    if (std::isfinite(value)) spread += (value - mean) * (value - mean);
  }
  return std::sqrt(spread / count);
}

std::vector<double> errors_along(const ResidualCurve& curve, const std::vector<double>& edges) {
  std::vector<double> squares(kTimeColumns, 0.0), counts(kTimeColumns, 0.0);
  for (std::size_t i = 0; i < curve.axis.size(); ++i) {
    if (!std::isfinite(curve.residual[i])) continue;
    const auto above = std::upper_bound(edges.begin(), edges.end(), curve.axis[i]);
    const auto column = std::min<std::size_t>(
        kTimeColumns - 1,
        static_cast<std::size_t>(std::max<std::ptrdiff_t>(1, above - edges.begin())) - 1);
    squares[column] += curve.residual[i] * curve.residual[i];
    counts[column] += 1.0;
  }
  const double signal = deviation_of(curve.measured);
  for (std::size_t c = 0; c < kTimeColumns; ++c) {
    squares[c] = counts[c] > 0.0 ? 100.0 * std::sqrt(squares[c] / counts[c]) / signal : kNaN;
  }
  return squares;
}

// Of all channels of the recording of `first`.
HeatMap time_map(const std::vector<ResidualCurve>& curves, const ResidualCurve& first,
                 const char* when) {
  HeatMap map = empty_time_map(first.axis);
  for (const ResidualCurve& curve : curves) {
    const bool is_of_it =
        curve.over_time && curve.experiment == first.experiment && curve.held_out == first.held_out;
    if (!is_of_it) continue;
    map.rows.push_back(curve.channel);
    map.values.push_back(errors_along(curve, map.edges));
  }
  map.title = fmt::format("{}: {}{}", when, first.experiment, first.held_out ? ", kept out" : "");
  map.recording = (first.held_out ? "k" : "f") + first.experiment;
  return map;
}

double largest(const HeatMap& map) {
  double most = 1e-9;
  for (const auto& row : map.values) {
    for (const double value : row) {
      if (std::isfinite(value)) most = std::max(most, value);
    }
  }
  return most;
}

const ResidualCurve* first_of_role(const std::vector<ResidualCurve>& curves, bool held_out) {
  for (const ResidualCurve& curve : curves) {
    if (curve.over_time && curve.held_out == held_out && curve.axis.size() > kTimeColumns) {
      return &curve;
    }
  }
  return nullptr;
}

}  // namespace

double highest_of(const std::vector<MismatchCell>& cells) {
  double highest = 2.0;
  for (const MismatchCell& cell : cells) highest = std::max(highest, size_of(cell));
  return highest;
}

std::vector<ReportFigure> band_maps(const std::vector<MismatchCell>& cells, const std::string& when,
                                    double highest) {
  const std::vector<bool> rejected = rejected_cells(cells, kFramedRate);
  std::vector<MapPlace> places;
  for (const MismatchCell& cell : cells) (void)index_in(places, {cell.position, cell.level});
  std::vector<ReportFigure> figures;
  for (std::size_t i = 0; i < places.size(); ++i) {
    HeatMap map = band_map(cells, rejected, places[i]);
    const std::string name = map_name(places[i]);
    map.title = "Residuals " + when + (name.empty() ? "" : ": " + name);
    map.lowest = 1.0;
    map.highest = highest;
    map.is_logarithmic = true;
    figures.push_back({fmt::format("residuals_{}_{}", when, i + 1), svg_heat_map(map)});
  }
  return figures;
}

std::vector<ReportFigure> time_maps(const Diagnosis& diagnosis) {
  std::vector<ReportFigure> figures;
  for (const bool held_out : {true, false}) {
    const ResidualCurve* first = first_of_role(diagnosis.curves_before, held_out);
    if (first == nullptr) continue;
    const char* const role = held_out ? "kept_out" : "fit";
    HeatMap before = time_map(diagnosis.curves_before, *first,
                              diagnosis.effects.empty() ? "What is left" : "Left before");
    before.highest = largest(before);
    figures.push_back({fmt::format("errors_before_{}", role), svg_heat_map(before)});
    if (diagnosis.effects.empty()) continue;
    HeatMap after = time_map(diagnosis.curves_after, *first, "Left after");
    after.highest = before.highest;
    if (!after.rows.empty()) {
      figures.push_back({fmt::format("errors_after_{}", role), svg_heat_map(after)});
    }
  }
  return figures;
}

}  // namespace graybox
