#include "diagnosis/proposal/mass_times.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "diagnosis/log_columns/column_rates.hpp"
#include "diagnosis/proposal/column_choice.hpp"
#include "diagnosis/proposal/drive_manner.hpp"
#include "diagnosis/proposal/start_values.hpp"
#include "diagnosis/signal_faults/arrival_times.hpp"
#include "diagnosis/signal_faults/held_values.hpp"
#include "diagnosis/signal_faults/sample_statistics.hpp"
#include "problems/base/units.hpp"

namespace graybox {
namespace {

constexpr double kBelow = 0.4;  // of a slower rate

// Before samples are left out.
void pass_below(double sample_time, CampaignDraft& draft) {
  draft.low_pass = std::stod(fmt::format("{:.3g}", kBelow / sample_time));
  draft.low_pass_reason = "before samples are left out";
}

// The sample time with which the velocity would be the rate of the position, where one is asked
// for. Without units both are taken for like ones; counts tell nothing.
void offer_sample_time(const MassMachine& machine, OpenQuestion& question) {
  constexpr double kSurely = 0.3;  // of the misfit
  const LogColumn* const place = choose_measured(machine.columns, LogQuantity::kPosition).column;
  const LogColumn* const speed = choose_measured(machine.columns, LogQuantity::kVelocity).column;
  if (place == nullptr || speed == nullptr) return;
  const Unit *const of_place = find_unit(place->words.unit), *const of_speed =
                                                                 find_unit(speed->words.unit);
  const Eigen::VectorXd values = without_gaps(place->values);
  const bool are_stated = of_place != nullptr && of_speed != nullptr &&
                          place->words.unit != "counts" && speed->words.unit != "1";
  const bool are_bare = place->words.unit.empty() && speed->words.unit.empty() &&
                        place->words.odd_unit.empty() && speed->words.odd_unit.empty() &&
                        (values.array() != values.array().round()).any();
  if (!are_stated && !are_bare) return;
  const auto fit = fit_rate(values, without_gaps(speed->values), 1.0);
  if (!fit || !(fit->factor > 0.0) || !(fit->misfit < kSurely)) return;
  const double step = are_bare ? fit->factor : fit->factor * of_place->factor / of_speed->factor;
  question.text += fmt::format(" With {:.3g} s '{}' would be the rate of '{}'{}.", step,
                               speed->name, place->name, are_bare ? ", in like units" : "");
}

// Ticks of a clock that were not taken for the time.
void doubt_even_rows(const LogRecording& log, double sample_time, ModelProposal& proposal) {
  const LogColumn* ticks = ticking_column(log);
  if (ticks == nullptr) return;
  const auto [fewest, most] = steps_between_rows(*ticks);
  const std::string option =
      fmt::format("--column '{}=time:{}', with a factor as in 'time:0.125 ms'", ticks->name,
                  likely_unit_of_step(0.5 * (fewest + most)));
  if (!(sample_time > 0.0)) {
    constexpr double kWritten = 1.0001;
    proposal.questions.back().text +=
        most <= kWritten * fewest
            ? fmt::format(" '{}' rises by {:g} a row.", ticks->name, fewest)
            : fmt::format(" '{}' rises by {:g} to {:g} a row.", ticks->name, fewest, most);
    proposal.questions.back().option += ", or if that is the time " + option;
    return;
  }
  constexpr double kEven = 1.1;
  if (most <= kEven * fewest) return;
  proposal.notes.push_back(
      fmt::format("'{}' rises by {:g} to {:g} a row: if it is the time, the rows are not even, and "
                  "--sample-time is wrong; say {} in its place",
                  ticks->name, fewest, most, option));
}

// A command is held between samples; what was measured goes on between them.
void hold_as_measured(const MassMachine& machine, CampaignDraft& draft) {
  const bool is_measured = machine.drive != nullptr && machine.drive->words.is_measured &&
                           !machine.drive->words.is_reference &&
                           machine.drive->words.quantity != LogQuantity::kCommand;
  if (!is_measured || machine.has_goal()) return;
  draft.hold = "first";
  draft.hold_reason = "the drive was measured";
}

// What drives between samples, where something does. A force without a word of how it came to be
// may be either: a command, or what a sensor read.
void guess_hold(const MassMachine& machine, CampaignDraft& draft, ModelProposal& proposal) {
  if (machine.drive == nullptr) return;
  const ColumnWords& words = machine.drive->words;
  const bool is_command = machine.has_goal() || words.is_reference;
  if (draft.hold == "zero" && words.quantity == LogQuantity::kForce && !is_command) {
    draft.hold_reason = "guessed: a command is held; 'first' where it was measured";
  }
  const std::string reason =
      draft.hold == "zero"
          ? draft.hold_reason.empty()
                ? "between samples, as a controller holds its output; guessed"
                : "between samples, as a command is held; guessed: where the drive was measured, "
                  "write hold: first in campaign.yaml"
          : fmt::format("evenly from sample to sample: {}",
                        draft.hold_reason.empty() ? "uneven times" : draft.hold_reason);
  add_guess(proposal, "hold", draft.hold, reason);
}

// A motion that was measured at a slower rate than logged: one of so many samples is taken.
void take_held_motion(MassMachine& machine, CampaignDraft& draft, ModelProposal& proposal) {
  if (!(draft.time.sample_time > 0.0) || draft.decimation > 1) return;
  for (const MotionChoice& motion : machine.motions) {
    if (motion.column == nullptr) continue;
    const std::optional<HeldValues> held = find_held_values(without_gaps(motion.column->values));
    if (!held) continue;
    machine.raw_step = draft.time.sample_time;
    draft.time.every = held->samples;
    draft.time.from = held->first % held->samples;
    draft.time.sample_time =
        rounded_step(static_cast<double>(held->samples) * draft.time.sample_time);
    if (draft.time.column.empty()) {
      draft.decimation = held->samples;
      pass_below(draft.time.sample_time, draft);
    } else {
      draft.time.is_even = false;
      draft.time.of_step = "one of so many samples";
    }
    add_guess(proposal, "held", fmt::format("'{}'", motion.column->name),
              fmt::format("each value for {} samples: one of {} is taken, every {:g} s",
                          held->samples, held->samples, draft.time.sample_time));
    return;
  }
}

// A drive that was read more rarely than the motion: between its readings nobody knows what acts.
void note_held_drive(const MassMachine& machine, const LogTime& time, ModelProposal& proposal) {
  if (machine.drive == nullptr || !(time.sample_time > 0.0) || time.every > 1) return;
  const std::optional<HeldValues> held = find_held_values(without_gaps(machine.drive->values));
  if (!held) return;
  proposal.notes.push_back(fmt::format(
      "'{}' has a new value every {} rows: it is read every {:g} s, the motion every "
      "{:g} s. Unless the command itself is held so, what drives between is not "
      "known, and the mass may come out wrong",
      machine.drive->name, held->samples,
      rounded_step(static_cast<double>(held->samples) * time.sample_time), time.sample_time));
}

double rms(const Eigen::VectorXd& values) {
  return std::sqrt(values.squaredNorm() /
                   static_cast<double>(std::max<Eigen::Index>(1, values.size())));
}

// Whether a motion follows the drive, so that its rows tell what acts between them.
bool is_followed(const MassMachine& machine, const Eigen::VectorXd& drive) {
  constexpr double kFollows = 0.5;  // correlation
  if (manner_of_drive(*machine.drive, machine.recordings).follows > kFollows) return true;
  return std::ranges::any_of(machine.motions, [&](const MotionChoice& motion) {
    if (motion.column == nullptr || motion.column->values.size() != drive.size()) return false;
    const Eigen::VectorXd moved = without_gaps(motion.column->values);
    return std::abs(follows_at_once(drive, moved, motion.is_velocity)) > kFollows;
  });
}

// A drive as white as noise, which changes between its rows, too. Held for several rows, or in few
// levels, it is a command; a command that the motion follows was held for its row.
void note_fast_drive(const MassMachine& machine, const LogTime& time, ModelProposal& proposal) {
  constexpr double kOwnSize = 1.0;  // white noise: 1.41, held for n rows 1.41/sqrt(n)
  constexpr Eigen::Index kFewest = 50;
  if (machine.drive == nullptr || machine.has_goal() || time.every > 1) return;
  const Eigen::VectorXd drive = without_gaps(machine.drive->values);
  if (drive.size() < kFewest || !drive.allFinite() || has_few_levels(drive)) return;
  const double change = rms(steps_of(drive)), size = rms(drive);
  if (!(change >= kOwnSize * size) || find_held_values(drive)) return;
  const ColumnWords& words = machine.drive->words;
  const bool is_measured = words.quantity == LogQuantity::kCurrent || words.is_measured;
  if (!is_measured && is_followed(machine, drive)) return;
  proposal.notes.push_back(fmt::format(
      "'{}' changes by its own size from row to row ({:.2g} times its rms): it may change faster "
      "than it was logged. Unless each of its values was held for a whole row, what drives between "
      "them is not known, and this recording can't tell the machine: log it faster",
      machine.drive->name, change / size));
}

// The mean step of a log by the clock of the first one, s; 0: it has no such clock.
double step_by_clock(const LogRecording& log, const LogTime& time, bool& is_even) {
  const auto clock = std::ranges::find_if(log.columns, [&](const LogColumn& column) {
    return column.file == time.file && column.name == time.column;
  });
  if (clock == log.columns.end() || clock->values.size() < 2) return 0.0;
  const LogTime own = find_time(log, {});
  if (own.column != time.column) return 0.0;
  is_even = own.is_even;
  const auto steps = static_cast<double>(clock->values.size() - 1);
  const double span = clock->values(clock->values.size() - 1) - clock->values(0);
  return time.seconds() * (own.is_even ? span / steps : own.median_step);
}

// Logs of several rates: all are resampled to that of the fastest, which folds nothing. Of these
// samples one of so many is taken, as the slowest has.
void take_one_rate(const MassMachine& machine, CampaignDraft& draft, ModelProposal& proposal) {
  LogTime& time = draft.time;
  const bool is_known = !time.column.empty() && time.seconds() > 0.0 && time.sample_time > 0.0;
  if (!is_known || machine.request.sample_time) return;
  double slowest = time.sample_time, fastest = time.sample_time;
  bool are_even = time.is_even;
  for (const LogRecording& log : machine.recordings) {
    bool is_even = true;
    const double step = step_by_clock(log, time, is_even);
    if (!(step > 0.0)) continue;
    slowest = std::max(slowest, step);
    fastest = std::min(fastest, step);
    are_even = are_even && is_even;
  }
  // Uneven logs come to the sample time of the first already, unless that folds another one.
  constexpr double kOneEven = 1.001, kOneUneven = 1.5;
  const bool is_one =
      time.is_even ? slowest < kOneEven * fastest : time.sample_time < kOneUneven * fastest;
  if (is_one && are_even == time.is_even) return;
  time.is_even = false;
  if (is_one) return;
  time.sample_time = rounded_step(fastest);
  time.of_step = "the fastest of the logs";
  draft.decimation = static_cast<Eigen::Index>(std::floor(kOneEven * slowest / fastest));
  const double taken = rounded_step(static_cast<double>(draft.decimation) * time.sample_time);
  draft.decimation_reason = "the slowest of the logs";
  if (draft.decimation > 1) pass_below(taken, draft);
  proposal.notes.push_back(fmt::format(
      "the logs have samples every {:g} to {:g} s: all are resampled to {:g} s (say --column "
      "'{}=ignore' --sample-time S if a clock is wrong)",
      rounded_step(fastest), rounded_step(slowest), taken, time.column));
}

}  // namespace

void find_times(MassMachine& machine, CampaignDraft& draft, ModelProposal& proposal) {
  LogTime& time = draft.time;
  time = find_time(machine.log, machine.request.sample_time);
  if (machine.recordings.size() > 1) take_one_rate(machine, draft, proposal);
  for (const LogColumn& column : machine.log.columns) {
    const bool is_time = column.name == time.column && column.file == time.file;
    if (!is_time && column.words.quantity != LogQuantity::kTime) machine.columns.push_back(&column);
  }
  const AnswerChoice counts{"it numbers samples", {fmt::format("{}=ignore", time.column)}};
  propose_time(time, {counts}, proposal);
  if (time.column.empty() && !(time.sample_time > 0.0)) {
    offer_sample_time(machine, proposal.questions.back());
  }
  if (time.column.empty()) doubt_even_rows(machine.log, time.sample_time, proposal);
}

void take_held_values(MassMachine& machine, CampaignDraft& draft, ModelProposal& proposal) {
  if (!draft.time.is_even) draft.hold = "first";
  hold_as_measured(machine, draft);
  guess_hold(machine, draft, proposal);
  take_held_motion(machine, draft, proposal);
  note_held_drive(machine, draft.time, proposal);
  note_fast_drive(machine, draft.time, proposal);
}

Eigen::Index first_of_held(const MassMachine& machine, const LogTime& time,
                           const DraftExperiment& experiment) {
  const LogColumn* column = machine.motions.front().column;
  const LogColumn& here = machine.recordings[experiment.recording].at(column->file, column->name);
  const Eigen::Index count = experiment.last - experiment.first + 1;
  const std::optional<HeldValues> held =
      find_held_values(without_gaps(here.values.segment(experiment.first, count)));
  if (held) return held->first % time.every;
  const Eigen::Index behind = (time.from - experiment.first) % time.every;
  return behind < 0 ? behind + time.every : behind;
}

void note_arrival_times(const MassMachine& machine, const LogTime& time,
                        std::vector<std::string>& notes) {
  if (time.is_even || time.column.empty() || machine.motions.empty()) return;
  const MotionChoice& choice = machine.motions.front();
  if (choice.column == nullptr || choice.is_velocity) return;
  const Eigen::VectorXd& stamps = machine.log.at(time.file, time.column).values;
  const Eigen::VectorXd place = choice.values(machine.log);
  if (stamps.size() != place.size()) return;
  const std::optional<ArrivalTimes> arrival = find_arrival_times(stamps, place);
  if (!arrival) return;
  notes.push_back(fmt::format(
      "'{}' moves as if sampled evenly, while '{}' jitters: are these the times when samples "
      "arrived? Then say --column '{}=ignore' --sample-time {:.5g}",
      choice.column->name, time.column, time.column, arrival->step * time.seconds()));
}

void note_sparse_rows(const CampaignDraft& draft, const LogRecording& log,
                      std::vector<std::string>& notes) {
  const LogTime& time = draft.time;
  if (time.is_even || time.column.empty() || !(time.sample_time > 0.0)) return;
  constexpr double kMeasured = 0.5;  // of the samples
  const Eigen::VectorXd stamps = time.seconds() * log.at(time.file, time.column).values;
  for (const DraftExperiment& each : draft.experiments) {
    if (each.recording != 0 || each.last <= each.first) continue;
    const auto rows = static_cast<double>((each.last - each.first) / time.every + 1);
    const double samples = 1.0 + (stamps(each.last) - stamps(each.first)) / time.sample_time;
    if (rows >= kMeasured * samples) continue;
    notes.push_back(fmt::format(
        "{} has {:.0f} rows for {:.0f} samples of {:g} s: {:.0f} % of them would be interpolated "
        "between rows, and prove nothing; record at even times, or cut such rows out in "
        "campaign.yaml (segments)",
        each.is_validation ? "what is kept out" : "what is fitted", rows, samples, time.sample_time,
        100.0 * (1.0 - rows / samples)));
  }
}

}  // namespace graybox
