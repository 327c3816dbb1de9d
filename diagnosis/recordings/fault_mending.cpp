#include "diagnosis/recordings/fault_mending.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <set>
#include <utility>

namespace graybox {
namespace {

using Index = Eigen::Index;

// Rows first to last, both included.
struct RowRange {
  Index first, last;
  [[nodiscard]] Index size() const { return last - first + 1; }
};

// Neighbouring rows as one stretch.
std::vector<RowRange> stretches_of(const std::set<Index>& rows) {
  std::vector<RowRange> stretches;
  for (const Index row : rows) {
    if (!stretches.empty() && stretches.back().last + 1 == row) {
      stretches.back().last = row;
    } else {
      stretches.push_back({row, row});
    }
  }
  return stretches;
}

void draw_line(const RowRange& stretch, const Eigen::VectorXd& time,
               Eigen::Ref<Eigen::VectorXd> values) {
  const Index before = stretch.first - 1, after = stretch.last + 1;
  const bool has_before = before >= 0, has_after = after < values.size();
  for (Index k = stretch.first; k <= stretch.last; ++k) {
    if (!has_before || !has_after) {
      values(k) = has_before ? values(before) : values(after);
      continue;
    }
    const double share = (time(k) - time(before)) / (time(after) - time(before));
    values(k) = values(before) + share * (values(after) - values(before));
  }
}

// What is to be cut out of a piece, and the rows before which it is cut.
struct Cuts {
  std::set<Index> rows, before;
};

// Replaces short spikes; their number.
std::size_t replace_spikes(const FaultySamples& faulty, Index channel, SignalPiece& piece,
                           Cuts& cuts) {
  std::size_t count = 0;
  for (const RowRange& stretch : stretches_of(faulty.spikes)) {
    if (stretch.size() == piece.time.size()) continue;
    if (stretch.size() <= kLongestSpike) {
      draw_line(stretch, piece.time, piece.values.col(channel));
      count += static_cast<std::size_t>(stretch.size());
      continue;
    }
    for (Index k = stretch.first; k <= stretch.last; ++k) cuts.rows.insert(k);
  }
  return count;
}

// The stretches that are left; short ones go.
std::vector<SignalPiece> parts_of(const SignalPiece& piece, const Cuts& cuts) {
  std::vector<SignalPiece> parts;
  const auto add = [&](Index first, Index end) {
    const Index size = end - first;
    if (size < kShortestPiece) return;
    parts.push_back({piece.first_sample + static_cast<std::size_t>(first),
                     piece.time.segment(first, size), piece.values.middleRows(first, size)});
  };
  Index first = 0;
  for (Index k = 0; k < piece.time.size(); ++k) {
    const bool is_out = cuts.rows.contains(k);
    if (!is_out && !cuts.before.contains(k)) continue;
    add(first, k);
    first = is_out ? k + 1 : k;
  }
  add(first, piece.time.size());
  return parts;
}

Index samples_of(const std::vector<SignalPiece>& pieces) {
  Index count = 0;
  for (const SignalPiece& piece : pieces) count += piece.time.size();
  return count;
}

void cut(const std::vector<Cuts>& cuts, Signals& data) {
  std::vector<SignalPiece> kept;
  for (std::size_t p = 0; p < data.pieces.size(); ++p) {
    std::ranges::move(parts_of(data.pieces[p], cuts[p]), std::back_inserter(kept));
  }
  const Index before = samples_of(data.pieces), after = samples_of(kept);
  if (static_cast<double>(after) < kLeastKept * static_cast<double>(before)) return;
  if (kept.size() == data.pieces.size() && after == before) return;
  data.remarks.push_back(
      after < before
          ? fmt::format("{} of {} samples can't be data and are left out; {} pieces are left "
                        "(faulty_samples: keep takes them all)",
                        before - after, before, kept.size())
          : fmt::format("cut where a position jumps, into {} pieces (faulty_samples: keep leaves "
                        "it whole)",
                        kept.size()));
  data.pieces = std::move(kept);
}

void make_times_even(const std::vector<DataFaults>& faults, Signals& data) {
  bool any = false;
  for (std::size_t p = 0; p < data.pieces.size(); ++p) {
    if (!faults[p].times_jitter) continue;
    Eigen::VectorXd& time = data.pieces[p].time;
    time = Eigen::VectorXd::LinSpaced(time.size(), time(0), time(time.size() - 1)).eval();
    any = true;
  }
  if (!any) return;
  data.remarks.push_back(
      "samples were taken as even, for the recorded times jitter and the motion does not "
      "(faulty_samples: keep takes the times as they are)");
}

}  // namespace

void mend_faulty_samples(const std::vector<DataFaults>& faults, Signals& data) {
  make_times_even(faults, data);
  const std::size_t channels = faults.empty() ? 0 : faults.front().channels.size();
  std::vector<Cuts> cuts(data.pieces.size());
  for (std::size_t c = 0; c < channels; ++c) {
    std::size_t replaced = 0;
    for (std::size_t p = 0; p < data.pieces.size(); ++p) {
      const FaultySamples& of_channel = faults[p].channels[c];
      replaced += replace_spikes(of_channel, static_cast<Index>(c), data.pieces[p], cuts[p]);
      if (of_channel.held) {
        for (Index k = of_channel.held->first; k <= of_channel.held->second; ++k) {
          cuts[p].rows.insert(k);
        }
      }
      cuts[p].before.insert(of_channel.jumps.begin(), of_channel.jumps.end());
    }
    if (replaced == 0) continue;
    data.remarks.push_back(
        fmt::format("{}: {} spike{} replaced by the line between the samples "
                    "beside (faulty_samples: keep takes them as they are)",
                    data.signals[c].name, replaced, replaced == 1 ? " was" : "s were"));
  }
  if (!data.excitation) cut(cuts, data);
}

}  // namespace graybox
