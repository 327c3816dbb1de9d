#include "diagnosis/recordings/sample_mending.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <utility>
#include <vector>

#include "diagnosis/signal_faults/counter_wrap.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

bool is_valid(const SignalPiece& piece, const std::vector<Index>& channels, Index row,
              const ValidSamples& step) {
  for (const Index channel : channels) {
    const double value = piece.values(row, channel);
    if (!(value >= step.lowest && value <= step.highest)) return false;  // NaN is neither
  }
  return true;
}

// Adds the stretches of valid samples; the number of all that are kept.
Index add_stretches(const SignalPiece& piece, const std::vector<Index>& channels,
                    const ValidSamples& step, std::vector<SignalPiece>& kept) {
  Index count = 0;
  for (Index first = 0, end = 0; first < piece.time.size(); first = end + 1) {
    end = first;
    while (end < piece.time.size() && is_valid(piece, channels, end, step)) ++end;
    const Index size = end - first;
    if (size < kShortestPiece) continue;
    kept.push_back({piece.first_sample + static_cast<std::size_t>(first),
                    piece.time.segment(first, size), piece.values.middleRows(first, size)});
    count += size;
  }
  return count;
}

}  // namespace

void keep_valid_samples(const PreprocessData& context, const ValidSamples& step) {
  Signals& data = context.data();
  const std::vector<Index> channels = context.indices(step.channels);
  std::vector<SignalPiece> kept;
  Index before = 0, after = 0;
  for (const SignalPiece& piece : data.pieces) {
    before += piece.time.size();
    after += add_stretches(piece, channels, step, kept);
  }
  if (kept.empty() && !std::isfinite(step.lowest * step.highest)) {
    context.fail(
        fmt::format("no {} samples in a row have a value of {}: too many are missing; log "
                    "it in every row, or thin the log to the rows that have it",
                    kShortestPiece, fmt::join(step.channels, ", ")));
  }
  if (kept.empty()) {
    context.fail(
        fmt::format("no {} samples in a row have {} within [{:g}, {:g}]; correct the range",
                    kShortestPiece, fmt::join(step.channels, ", "), step.lowest, step.highest));
  }
  if (after < before) {
    data.remarks.push_back(fmt::format(
        "{} of {} samples are missing: {} must be within [{:g}, {:g}]; {} pieces are left",
        before - after, before, fmt::join(step.channels, ", "), step.lowest, step.highest,
        kept.size()));
  }
  data.pieces = std::move(kept);
}

void unwrap_channels(const PreprocessData& context, const Unwrap& step) {
  for (const std::string& name : step.channels) {
    const auto channel = static_cast<Index>(context.index_of(name));
    Index count = 0;
    for (SignalPiece& piece : context.data().pieces) {
      const Eigen::VectorXd before = piece.values.col(channel);
      piece.values.col(channel) = unwrapped(before, step.period);
      for (Index k = 1; k < before.size(); ++k) {
        const double mended = piece.values(k, channel) - piece.values(k - 1, channel);
        const double recorded = before(k) - before(k - 1);
        if (std::abs(mended - recorded) > 0.5 * step.period) ++count;
      }
    }
    if (count == 0) continue;
    context.data().remarks.push_back(
        fmt::format("{}: {} jumps of {:g} or more were unwrapped", name, count, step.period));
  }
}

}  // namespace graybox
