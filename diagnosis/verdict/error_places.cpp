#include "diagnosis/verdict/error_places.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "diagnosis/verdict/curve_traces.hpp"

namespace graybox {
namespace {

constexpr std::size_t kParts = 50;
constexpr std::size_t kSamplesAPart = 6;
constexpr double kHalf = 0.5;        // of the squared error
constexpr double kSpell = 0.08;      // of the recording
constexpr double kOnset = 9.0;       // of mean squares
constexpr std::size_t kSide = 10;    // parts
constexpr std::size_t kSeam = 3;     // parts
constexpr double kFaster = 1.7;      // of the way that the signal goes
constexpr double kLeastError = 3.0;  // % of the signal
constexpr std::size_t kTold = 3;

// Of a recording's parts: the mean square of the residual, and the way that the signal goes, both
// for each sample.
struct RecordingParts {
  std::vector<double> error, motion;
  std::vector<std::size_t> edges;  // samples
};

double mean_of(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

// Samples that are predicted; a filter sees those before without saying anything.
std::optional<RecordingParts> parts_of(const ResidualCurve& curve) {
  const auto is_told = [](double value) { return std::isfinite(value); };
  const auto first = std::ranges::find_if(curve.residual, is_told);
  const auto last = std::find_if(curve.residual.rbegin(), curve.residual.rend(), is_told);
  const auto from = static_cast<std::size_t>(first - curve.residual.begin());
  const auto to = curve.residual.size() - static_cast<std::size_t>(last - curve.residual.rbegin());
  if (to < from + kParts * kSamplesAPart) return {};
  RecordingParts parts;
  for (std::size_t b = 0; b <= kParts; ++b) parts.edges.push_back(from + (to - from) * b / kParts);
  for (std::size_t b = 0; b < kParts; ++b) {
    double error = 0.0, motion = 0.0;
    for (std::size_t i = parts.edges[b]; i < parts.edges[b + 1]; ++i) {
      if (is_told(curve.residual[i])) error += std::pow(curve.residual[i], 2);
      const double step = i > from ? curve.measured[i] - curve.measured[i - 1] : 0.0;
      if (is_told(step)) motion += std::abs(step);
    }
    const auto samples = static_cast<double>(parts.edges[b + 1] - parts.edges[b]);
    parts.error.push_back(error / samples);
    parts.motion.push_back(motion / samples);
  }
  return parts;
}

// The shortest run of parts that holds half of the error.
ErrorPlace spell_of(const RecordingParts& parts, const ResidualCurve& curve, bool& is_told) {
  const double all = std::accumulate(parts.error.begin(), parts.error.end(), 0.0);
  std::size_t best = kParts + 1, at = 0;
  double held = 0.0;
  for (std::size_t from = 0; from < kParts; ++from) {
    double sum = 0.0;
    for (std::size_t to = from; to < kParts; ++to) {
      sum += parts.error[to];
      const std::size_t length = to + 1 - from;
      if (sum < kHalf * all) continue;
      if (length < best || (length == best && sum > held)) {
        best = length;
        at = from;
        held = sum;
      }
      break;
    }
  }
  const std::span<const double> moved(parts.motion);
  const double motion = std::accumulate(moved.begin(), moved.end(), 0.0);
  const auto inside = moved.subspan(at, std::min(best, kParts - at));
  const bool moves_there =
      std::accumulate(inside.begin(), inside.end(), 0.0) > 0.5 * kHalf * motion;
  is_told = all > 0.0 && !moves_there &&
            static_cast<double>(best) <= kSpell * static_cast<double>(kParts);
  ErrorPlace place;
  if (!is_told) return place;
  place.kind = ErrorPlace::Kind::kSpell;
  place.from = curve.axis[parts.edges[at]];
  place.to = curve.axis[std::min(parts.edges[at + best], curve.axis.size() - 1)];
  place.share = held / all;
  return place;
}

// The seam that parts the recording best into two levels of error.
ErrorPlace onset_of(const RecordingParts& parts, const ResidualCurve& curve, bool& is_told) {
  constexpr double kNone = 1e-300;
  const std::span<const double> error(parts.error), motion(parts.motion);
  double best = std::numeric_limits<double>::infinity();
  std::size_t seam = 0;
  for (std::size_t b = kSide; b + kSide <= kParts; ++b) {
    const double before = mean_of(error.first(b)), after = mean_of(error.subspan(b));
    if (!(after > before)) continue;
    const double cost = static_cast<double>(b) * std::log(before + kNone) +
                        static_cast<double>(kParts - b) * std::log(after + kNone);
    if (cost >= best) continue;
    best = cost;
    seam = b;
  }
  ErrorPlace place;
  is_told = false;
  if (seam == 0) return place;
  const double ratio = mean_of(error.subspan(seam)) / (mean_of(error.first(seam)) + kNone);
  const double across =
      mean_of(error.subspan(seam, kSeam)) / (mean_of(error.subspan(seam - kSeam, kSeam)) + kNone);
  const double faster = mean_of(motion.subspan(seam)) / (mean_of(motion.first(seam)) + kNone);
  is_told = ratio >= kOnset && across >= kOnset && faster < kFaster;
  place.kind = ErrorPlace::Kind::kOnset;
  place.from = curve.axis[parts.edges[seam]];
  place.to = curve.axis.back();
  place.ratio = std::sqrt(ratio);
  return place;
}

struct Range {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  void add(double value) {
    if (!std::isfinite(value)) return;
    low = std::min(low, value);
    high = std::max(high, value);
  }
};

// Where the channel goes in the place, and whether it goes there elsewhere.
void add_range(std::span<const ResidualCurve> curves, const ResidualCurve& own, ErrorPlace& place) {
  Range inside, outside;
  for (const ResidualCurve& curve : curves) {
    const bool is_own = &curve == &own;
    const bool counts = curve.over_time && curve.channel == own.channel;
    if (!counts || (!is_own && curve.held_out)) continue;
    for (std::size_t i = 0; i < curve.measured.size(); ++i) {
      const bool is_there = is_own && curve.axis[i] >= place.from && curve.axis[i] <= place.to;
      (is_there ? inside : outside).add(curve.measured[i]);
    }
  }
  place.low = inside.low;
  place.high = inside.high;
  const double margin = 0.02 * (outside.high - outside.low);
  place.is_new = inside.low < outside.low - margin || inside.high > outside.high + margin;
}

std::optional<ErrorPlace> place_in(std::span<const ResidualCurve> curves,
                                   const ResidualCurve& curve) {
  const std::optional<RecordingParts> parts = parts_of(curve);
  if (!parts) return {};
  bool is_told = false;
  ErrorPlace place = spell_of(*parts, curve, is_told);
  if (!is_told) place = onset_of(*parts, curve, is_told);
  if (!is_told) return {};
  place.recording = curve.experiment;
  place.channel = curve.channel;
  place.unit = curve.unit;
  place.held_out = curve.held_out;
  add_range(curves, curve, place);
  return place;
}

std::string words_of(const ErrorPlace& place) {
  const std::string whose =
      fmt::format("{}{}", place.recording, place.held_out ? " (kept out of the fit)" : "");
  if (place.kind == ErrorPlace::Kind::kOnset) {
    return fmt::format(
        "When: from {:.4g} s on the error of {} in {} is {:.2g} times as large as before. "
        "Something "
        "changed there, as a load that was picked up: find out what, and diagnose both parts by "
        "themselves.",
        place.from, place.channel, whose, place.ratio);
  }
  return fmt::format(
      "When: {:.0f} % of the squared error of {} in {} lies between {:.4g} and {:.4g} s, where it "
      "goes from {:.3g} to {:.3g} {}{}. Look there for what happens only then, as a stop that is "
      "hit "
      "or a hand at the machine.",
      100.0 * place.share, place.channel, whose, place.from, place.to, place.low, place.high,
      place.unit, place.is_new ? ", and nowhere else" : "");
}

}  // namespace

std::vector<ErrorPlace> error_places(std::span<const ResidualCurve> curves) {
  std::vector<ErrorPlace> places;
  for (const bool held_out : {true, false}) {
    for (std::size_t i = 0; i < curves.size(); ++i) {
      const ResidualCurve& curve = curves[i];
      if (!curve.over_time || curve.held_out != held_out || curve.axis.empty()) continue;
      if (!(curve_nrmse(curve) >= kLeastError)) continue;
      const auto is_worse = [&](const ResidualCurve& other) {
        return other.over_time && other.experiment == curve.experiment &&
               other.held_out == held_out && curve_nrmse(other) > curve_nrmse(curve);
      };
      if (std::ranges::any_of(curves, is_worse)) continue;
      if (auto place = place_in(curves, curve)) places.push_back(*std::move(place));
    }
  }
  return places;
}

std::vector<ErrorPlace> error_places_of(const Diagnosis& diagnosis) {
  return error_places(diagnosis.curves_after.empty() ? diagnosis.curves_before
                                                     : diagnosis.curves_after);
}

std::vector<std::string> error_place_lines(const Diagnosis& diagnosis) {
  std::vector<std::string> lines;
  for (const ErrorPlace& place : error_places_of(diagnosis)) {
    if (lines.size() == kTold) break;
    lines.push_back(words_of(place));
  }
  return lines;
}

}  // namespace graybox
