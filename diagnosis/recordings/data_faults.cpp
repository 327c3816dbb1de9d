#include "diagnosis/recordings/data_faults.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "diagnosis/recordings/signal_checks.hpp"
#include "diagnosis/signal_faults/arrival_times.hpp"
#include "diagnosis/signal_faults/counter_wrap.hpp"
#include "diagnosis/signal_faults/held_values.hpp"
#include "diagnosis/signal_faults/lost_samples.hpp"
#include "diagnosis/signal_faults/lost_sign.hpp"
#include "diagnosis/signal_faults/quantisation.hpp"
#include "diagnosis/signal_faults/sample_statistics.hpp"
#include "diagnosis/signal_faults/speed_impact.hpp"
#include "diagnosis/signal_faults/spike.hpp"
#include "diagnosis/signal_faults/stuck_sensor.hpp"

namespace graybox {
namespace {

using Index = Eigen::Index;

constexpr double kStuckTime = 0.05;  // s

// One line: where, what, how sure, what else, what to write.
Finding finding_of(const ChannelSamples& samples, Index row, const char* check, double strength,
                   const std::string& what, std::string otherwise, std::string mend) {
  const std::string& name = samples.channel->name;
  const double time = samples.time(row);
  Finding finding =
      data_fault(check, name,
                 fmt::format("{}: {}: row {} ({:g} s) {};", samples.file, name,
                             samples.first_sample + static_cast<std::size_t>(row) + 1, time, what),
                 strength, std::move(otherwise), std::move(mend));
  finding.time = time;
  return finding;
}

// Which a machine can't change at a stroke, as it can a force or the speed of what was held.
bool is_measured_position(const Channel& channel) {
  return channel.role == ChannelRole::kOutput && (channel.unit == "rad" || channel.unit == "m");
}

bool is_measured_velocity(const Channel& channel) {
  return channel.role == ChannelRole::kOutput && (channel.unit == "rad/s" || channel.unit == "m/s");
}

// Segments of the piece without rows first to last.
std::string segments_without(const ChannelSamples& samples, Index first, Index last) {
  const auto number = [&](Index row) {
    return samples.first_sample + static_cast<std::size_t>(row);
  };
  const Index end = samples.values.size() - 1;
  std::string text = "segments: [";
  if (first > 1) text += fmt::format("[{}, {}]", number(0), number(first - 1));
  if (first > 1 && last + 1 < end) text += ", ";
  if (last + 1 < end) text += fmt::format("[{}, {}]", number(last + 1), number(end));
  return text + "]";
}

// ---- spikes -------------------------------------------------------------------------------------

// A range that all other samples of the file keep and these do not. Where good samples reach as far
// a range would cut those, too: bridging the spikes is all that is done.
std::string spike_mend(const ChannelSamples& samples, const std::set<Index>& spikes, bool is_kept) {
  double lowest = HUGE_VAL, highest = -HUGE_VAL;
  for (Index k = 0; k < samples.values.size(); ++k) {
    if (spikes.contains(k)) continue;
    lowest = std::min(lowest, samples.values(k));
    highest = std::max(highest, samples.values(k));
  }
  if (samples.elsewhere) {
    lowest = std::min(lowest, samples.elsewhere->first);
    highest = std::max(highest, samples.elsewhere->second);
  }
  const bool all_outside = std::ranges::all_of(
      spikes, [&](Index k) { return samples.values(k) < lowest || samples.values(k) > highest; });
  if (!all_outside && is_kept) {
    return segments_without(samples, *spikes.begin(), *spikes.begin());
  }
  if (!all_outside) {
    return "good samples reach as far, so no range can cut it: it is bridged by a line (unless the "
           "campaign says faulty_samples: keep)";
  }
  const double margin = 1e-3 * (highest - lowest);
  return fmt::format("preprocess: [{{kind: valid, of: [{}], range: [{:.4g}, {:.4g}]}}]",
                     samples.channel->name, lowest - margin, highest + margin);
}

// A controller's derivative kicks its drive at every step of its command: spikes that the machine
// felt. A drive that has more than a few keeps them.
bool are_kicks(const ChannelSamples& samples, std::size_t spikes) {
  constexpr std::size_t kFew = 3;
  return samples.channel->role == ChannelRole::kInput && spikes > kFew;
}

void add_spikes(const ChannelSamples& samples, std::vector<Finding>& findings,
                std::set<Index>& rows) {
  double strength = 1.0;
  std::set<Index> spikes;
  for (const Spike& spike : find_spikes(samples.values)) {
    spikes.insert(spike.sample);
    strength = std::max(strength, spike.strength);
  }
  const bool is_kept = are_kicks(samples, spikes.size());
  if (!is_kept) rows = spikes;
  const auto wild = wild_samples(samples.values);
  if (!are_kicks(samples, wild.size())) rows.insert(wild.begin(), wild.end());
  spikes.insert(wild.begin(), wild.end());
  if (spikes.empty()) return;
  const Index row = *spikes.begin();
  const double before = samples.values(std::max<Index>(row - 1, 0));
  const double after = samples.values(std::min(row + 1, samples.values.size() - 1));
  const std::string more =
      spikes.size() > 1 ? fmt::format(" (and {} more)", spikes.size() - 1) : std::string();
  findings.push_back(
      finding_of(samples, row, "spike", strength,
                 fmt::format("is {:g}, alone between {:g} and {:g}{}", samples.values(row), before,
                             after, more),
                 is_kept ? "kicks of a controller, so these are kept" : "a knock or an impact",
                 spike_mend(samples, spikes, is_kept)));
}

// ---- stuck sensors ------------------------------------------------------------------------------

std::string others_meanwhile(const std::vector<ChannelSamples>& piece,
                             const ChannelSamples& samples, const StuckRun& run) {
  std::size_t others = 0, moving = 0;
  for (const ChannelSamples& other : piece) {
    if (&other == &samples) continue;
    const auto part = other.values.segment(run.first, run.last - run.first + 1);
    ++others;
    if (part.minCoeff() != part.maxCoeff()) ++moving;
  }
  if (others == 0) return "";
  if (moving == 0) return " while every other channel stands still too (was the recording frozen?)";
  return fmt::format(" while {} of {} other channels go on", moving, others);
}

void add_stuck_run(const std::vector<ChannelSamples>& piece, const ChannelSamples& samples,
                   std::vector<Finding>& findings, FaultySamples& faulty) {
  const Index last = samples.time.size() - 1;
  const bool is_command = samples.channel->role == ChannelRole::kReference;  // may be held
  if (last < 1 || is_command) return;
  const double step = (samples.time(last) - samples.time(0)) / static_cast<double>(last);
  if (!(step > 0.0)) return;
  const auto shortest =
      static_cast<Index>(std::min(std::ceil(kStuckTime / step), static_cast<double>(last)));
  const std::optional<StuckRun> run = find_stuck_run(samples.values, shortest);
  if (!run) return;
  if (is_measured_position(*samples.channel) && run->ends_in_jump) {
    faulty.held = {run->first, run->last};
  }
  findings.push_back(
      finding_of(samples, run->first, "stuck sensor", run->strength,
                 fmt::format("holds {:g} for {:.3g} s{}", samples.values(run->first),
                             samples.time(run->last) - samples.time(run->first),
                             others_meanwhile(piece, samples, *run)),
                 "a standstill that begins or ends abruptly, or a drive that was disabled",
                 segments_without(samples, run->first, run->last)));
}

// ---- wraps, lost samples, resolution ------------------------------------------------------------

void add_wrap(const ChannelSamples& samples, const CounterWrap& wrap,
              std::vector<Finding>& findings) {
  const bool is_turn = wrap.period == samples.channel->turn();
  const std::string period =
      is_turn ? std::string() : fmt::format(", bits: {}", std::log2(wrap.period));
  findings.push_back(finding_of(
      samples, wrap.first, "wrap", wrap.strength,
      fmt::format("is the first of {} of {}",
                  wrap.count == 1 ? std::string("one jump") : fmt::format("{} jumps", wrap.count),
                  is_turn          ? std::string("a whole turn")
                  : wrap.is_signed ? fmt::format("2^{} (a signed number that was read as unsigned)",
                                                 std::log2(wrap.period))
                                   : fmt::format("2^{}", std::log2(wrap.period))),
      wrap.is_signed ? "a switch, or a number that marks missing data" : "a counter that is reset",
      fmt::format("preprocess: [{{kind: unwrap, of: [{}]{}}}]", samples.channel->name, period)));
}

// For positions that do not wrap.
void add_lost_samples(const ChannelSamples& samples, std::vector<Finding>& findings,
                      std::vector<Index>& jumps) {
  if (!is_measured_position(*samples.channel)) return;
  const std::optional<LostSamples> lost = find_lost_samples(samples.time, samples.values);
  if (!lost) return;
  jumps = lost->after;
  const Index first = jumps.front(), last = samples.values.size() - 1;
  const std::string places =
      jumps.size() > 1 ? fmt::format(" (and at {} more places)", jumps.size() - 1) : std::string();
  findings.push_back(
      finding_of(samples, first, "lost samples", lost->strength,
                 fmt::format("jumps by {:g}{}: were samples cut out?", lost->jump, places),
                 "a slip, an impact or a position that was set anew",
                 fmt::format("segments: [[{}, {}], [{}, {}]]", samples.first_sample,
                             samples.first_sample + static_cast<std::size_t>(first) - 1,
                             samples.first_sample + static_cast<std::size_t>(first),
                             samples.first_sample + static_cast<std::size_t>(last))));
}

// The rows before it belong to no motion that was recorded: the recording begins behind them.
void add_stale_start(const ChannelSamples& samples, std::vector<Finding>& findings,
                     std::vector<Index>& jumps) {
  const Channel& channel = *samples.channel;
  const bool is_velocity = channel.unit == "rad/s" || channel.unit == "m/s";
  if (!is_measured_position(channel) && !(channel.role == ChannelRole::kOutput && is_velocity)) {
    return;
  }
  const std::optional<StaleStart> start = find_stale_start(samples.values);
  if (!start || (is_velocity && may_have_set_off(samples.values, *start))) return;
  jumps.insert(jumps.begin(), start->samples);
  findings.push_back(finding_of(
      samples, 0, "stale start", start->strength,
      fmt::format("is {:g} and then {:g} at once, by far the largest step: {} from before the "
                  "recording?",
                  samples.values(start->samples - 1), samples.values(start->samples),
                  start->samples > 1 ? "old values" : "an old value"),
      "a position that was set anew", segments_without(samples, 0, start->samples - 1)));
}

bool has_arrival_times(const ChannelSamples& samples, const std::optional<CounterWrap>& wrap,
                       std::vector<Finding>& findings) {
  if (!is_measured_position(*samples.channel)) return false;
  const Eigen::VectorXd path = wrap ? unwrapped(samples.values, wrap->period) : samples.values;
  const std::optional<ArrivalTimes> arrival = find_arrival_times(samples.time, path);
  if (!arrival) return false;
  findings.push_back(finding_of(
      samples, 0, "arrival times", arrival->strength,
      "and on moves as if sampled evenly, while the times jitter: are they when samples arrived?",
      "a motion that follows the jitter",
      fmt::format("sample_time: {:.6g} with time: ignore", arrival->step)));
  return true;
}

// " mm", or nothing where no unit is known.
std::string spaced(const std::string& unit) {
  return unit.empty() || unit == "1" ? "" : " " + unit;
}

void add_quantisation(const ChannelSamples& samples, std::vector<Finding>& findings) {
  const Channel& channel = *samples.channel;
  const bool is_motion = is_measured_position(channel) || is_measured_velocity(channel);
  const std::optional<Quantisation> coarse = find_coarse_quantisation(
      samples.values, is_motion ? SignalKind::kMeasuredMotion : SignalKind::kAny);
  if (!coarse) return;
  findings.push_back(finding_of(
      samples, 0, "quantisation", coarse->strength,
      fmt::format("and on has steps of {:g}{}: rounding alone is {:.2g} % of its deviation",
                  coarse->step, spaced(samples.channel->recorded_unit), 100.0 * coarse->error),
      is_motion ? "a motion in even steps" : "a command that is given in steps",
      "nothing mends that: record more motion or a finer sensor, or state noise"));
}

// ---- impacts ------------------------------------------------------------------------------------

// Nothing is wrong with such a channel: the machine hit something, and no model here has that.
void add_impacts(const ChannelSamples& samples, std::vector<Finding>& findings) {
  const Channel& channel = *samples.channel;
  if (!is_measured_velocity(channel)) return;
  const std::optional<SpeedImpacts> impacts = find_speed_impacts(samples.values);
  if (!impacts) return;
  const std::string more = impacts->count > 1
                               ? fmt::format(" ({} more of that kind)", impacts->count - 1)
                               : std::string();
  findings.push_back(finding_of(
      samples, impacts->first, "impact", impacts->strength,
      fmt::format("turns round between two samples, by up to {:.3g} {}{}: an impact, as on an end "
                  "stop?",
                  impacts->largest, channel.recorded_unit, more),
      "samples that were lost",
      "nothing is wrong with the channel; segments without impacts fit a model without stops"));
}

// ---- values that are held, signs that were lost -------------------------------------------------

// What takes one of every n samples.
std::string mend_of_held(const ChannelSamples& samples, const HeldValues& held, double step) {
  const auto count = static_cast<double>(held.samples);
  if (samples.is_even) {
    constexpr double kBelow = 0.4;  // of the slower rate
    return fmt::format(
        "preprocess: [{{kind: low_pass, frequency: {:.3g}}}, {{kind: decimate, factor: {}}}]",
        kBelow / (count * step), held.samples);
  }
  return fmt::format(
      "every: {{samples: {}, from: {}}}, and {{kind: resample, sample_time: {:.4g}}}", held.samples,
      held.first % held.samples, count * step);
}

// A drive may be held, by a controller that is slower than the log.
void add_held_values(const ChannelSamples& samples, std::vector<Finding>& findings) {
  if (samples.channel->role != ChannelRole::kOutput || samples.time.size() < 2) return;
  const std::optional<HeldValues> held = find_held_values(samples.values);
  if (!held || samples.thinned >= static_cast<std::size_t>(held->samples)) return;
  const double step = quantile(steps_of(samples.time), 0.5);
  const std::string resolution = held->step > 0.0
                                     ? fmt::format(", in steps of {:.4g}{}", held->step,
                                                   spaced(samples.channel->recorded_unit))
                                     : std::string();
  findings.push_back(finding_of(
      samples, held->first, "held values", held->strength,
      fmt::format("and on holds each value for {} samples{}: its own sample time is {:.4g} s",
                  held->samples, resolution, static_cast<double>(held->samples) * step),
      "a motion in even steps", mend_of_held(samples, *held, step)));
}

// The one drive beside the first motion that was measured.
void add_lost_sign(const std::vector<ChannelSamples>& piece, std::vector<Finding>& findings) {
  const ChannelSamples* drive = nullptr;
  const ChannelSamples* motion = nullptr;
  for (const ChannelSamples& samples : piece) {
    const Channel& channel = *samples.channel;
    const bool is_velocity = channel.unit == "rad/s" || channel.unit == "m/s";
    if (channel.role == ChannelRole::kInput) {
      if (drive != nullptr) return;
      drive = &samples;
    } else if (channel.role == ChannelRole::kOutput && motion == nullptr &&
               (is_velocity || is_measured_position(channel))) {
      motion = &samples;
    }
  }
  if (drive == nullptr || motion == nullptr || find_wrap(drive->values, 0.0)) return;
  if (find_wrap(motion->values, motion->channel->turn())) return;
  const bool is_position = is_measured_position(*motion->channel);
  const std::optional<LostSign> lost =
      find_lost_sign(drive->values, is_position ? central_steps(motion->values) : motion->values);
  if (!lost) return;
  findings.push_back(finding_of(
      *drive, 0, "lost sign", lost->strength,
      fmt::format("and on is never {} while {} goes both ways, and its size fits that motion "
                  "with a sign ({:.0f} % of the misfit without one): was it lost?",
                  lost->is_negative ? "positive" : "negative", motion->channel->name,
                  100.0 * lost->left),
      "a brake, or a valve that is opened either way",
      fmt::format("log its direction, too, as 1 and -1, and multiply: "
                  "{{kind: product, of: [{}, direction], ...}}",
                  drive->channel->name)));
}

}  // namespace

DataFaults find_data_faults(const std::vector<ChannelSamples>& piece,
                            std::vector<Finding>& findings) {
  DataFaults result;
  for (const ChannelSamples& samples : piece) {
    FaultySamples& faulty = result.channels.emplace_back();
    if (samples.values.size() < 3) continue;
    const std::optional<CounterWrap> wrap = find_wrap(samples.values, samples.channel->turn());
    if (wrap) add_wrap(samples, *wrap, findings);
    add_spikes(samples, findings, faulty.spikes);
    add_stuck_run(piece, samples, findings, faulty);
    if (!wrap) {
      add_lost_samples(samples, findings, faulty.jumps);
      add_stale_start(samples, findings, faulty.jumps);
    }
    add_quantisation(samples, findings);
    add_impacts(samples, findings);
    add_held_values(samples, findings);
    if (!result.times_jitter) result.times_jitter = has_arrival_times(samples, wrap, findings);
  }
  add_lost_sign(piece, findings);
  return result;
}

}  // namespace graybox
