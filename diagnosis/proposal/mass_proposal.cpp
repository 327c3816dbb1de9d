#include "diagnosis/proposal/mass_proposal.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <string>

#include "diagnosis/first_masses/kept_out_blocks.hpp"
#include "diagnosis/first_masses/one_mass_start.hpp"
#include "diagnosis/log_columns/even_samples.hpp"
#include "diagnosis/proposal/campaign_draft.hpp"
#include "diagnosis/proposal/drive_manner.hpp"
#include "diagnosis/proposal/motion_choice.hpp"
#include "diagnosis/proposal/start_values.hpp"
#include "diagnosis/recording_files/written_unit.hpp"
#include "diagnosis/signal_faults/counter_wrap.hpp"
#include "diagnosis/signal_faults/held_values.hpp"
#include "problems/base/error.hpp"
#include "problems/base/units.hpp"

namespace graybox {
namespace {

using Columns = std::vector<const LogColumn*>;

struct SpringStart {
  TwoMassStart values;
  std::string reason;
};

// Ticks of a clock that were not taken for the time.
void doubt_even_rows(const LogRecording& log, double sample_time, ModelProposal& proposal) {
  const LogColumn* ticks = ticking_column(log);
  if (ticks == nullptr) return;
  const auto [fewest, most] = steps_between_rows(*ticks);
  const std::string option =
      fmt::format("--column '{}=time:UNIT', with a factor as in 'time:0.125 ms'", ticks->name);
  if (!(sample_time > 0.0)) {
    proposal.questions.back().text +=
        fmt::format(" '{}' rises by {:g} to {:g} a row.", ticks->name, fewest, most);
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

// Rows so rare that most samples would be interpolated between them.
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

class MassProposal {
 public:
  MassProposal(const ProposalRequest& request, const std::vector<LogRecording>& recordings)
      : request_(request), recordings_(recordings), log_(recordings.front()) {
    has_two_ = request.machine == ProposedMachine::kTwoMasses;
  }

  ModelProposal run() {
    guess("model", has_two_ ? "two masses and a spring" : "one mass", request_.machine_reason);
    find_times();
    collect_open_columns();
    choose_the_drive();
    choose_motions();
    if (!draft_.time.is_even) draft_.hold = "first";
    hold_as_measured();
    take_held_values();
    note_held_drive();
    even_ = EvenSamples(log_, draft_.time);
    draft_campaign();
    if (proposal_.questions.empty()) relate_encoders();
    proposal_.model_text = model();
    proposal_.campaign_text = campaign_text(draft_, recordings_, request_.folder);
    return std::move(proposal_);
  }

 private:
  void guess(const std::string& subject, const std::string& value, const std::string& reason) {
    proposal_.guesses.push_back({subject, value, reason});
  }

  // Once: both sides of a drive may have the same column.
  void ask(const OpenQuestion& question) {
    const bool is_asked = std::ranges::any_of(
        proposal_.questions, [&](const OpenQuestion& each) { return each.text == question.text; });
    if (!is_asked) proposal_.questions.push_back(question);
  }

  // ---- columns ---------------------------------------------------------------------------------

  void find_times() {
    draft_.time = find_time(log_, request_.sample_time);
    for (const LogColumn& column : log_.columns) {
      const bool is_time = column.name == draft_.time.column && column.file == draft_.time.file;
      if (!is_time && column.words.quantity != LogQuantity::kTime) columns_.push_back(&column);
    }
    const AnswerChoice counts{"it numbers samples", {fmt::format("{}=ignore", draft_.time.column)}};
    propose_time(draft_.time, {counts}, proposal_);
    if (draft_.time.column.empty()) doubt_even_rows(log_, draft_.time.sample_time, proposal_);
  }

  // Columns that move and of which no one knows what they are.
  void collect_open_columns() {
    for (const LogColumn* column : columns_) {
      if (column->words.quantity == LogQuantity::kUnknown && column->moves() &&
          !column->counts_rows()) {
        open_.push_back(column);
      }
    }
  }

  [[nodiscard]] bool is_used(const LogColumn* column) const {
    return std::ranges::any_of(draft_.channels, [&](const DraftChannel& channel) {
      return channel.column == column->name && channel.file == column->file;
    });
  }

  void choose_the_drive() {
    drive_ = likely_drive_ = goal_among(columns_);
    if (drive_ != nullptr) return take_goal();
    if (request_.no_drive) {
      guess("drive", "nothing", "you said so: no force acts in these logs");
      return;
    }
    ColumnChoice choice = choose_drive(columns_, recordings_);
    const bool has_motion = !moving_columns(columns_, LogQuantity::kPosition).empty() ||
                            !moving_columns(columns_, LogQuantity::kVelocity).empty();
    if (choice.column == nullptr && choice.rivals.empty()) {
      if (open_.empty() && !has_motion) {
        throw InputError(
            fmt::format("{}: no column is a force, torque, current, voltage or command that moves; "
                        "say which by --column NAME=torque{}",
                        log_.files.front().string(), still_columns(columns_)));
      }
      if (open_.size() == 1 && has_motion) {
        choice = {open_.front(), "guessed: the only column left", {}};
        open_.clear();
      } else {
        choice.rivals = open_;
      }
    }
    if (choice.column == nullptr) {
      proposal_.questions.push_back(choice.rivals.empty() ? question_of_no_drive(columns_)
                                    : choice.doubt.empty()
                                        ? question_of_drives(choice.rivals, motion_of_drive())
                                        : question_of_doubt(choice, open_));
      if (has_motion && !choice.rivals.empty()) offer_goals(columns_, proposal_.questions.back());
      likely_drive_ = choice.rivals.empty() ? nullptr : choice.rivals.front();
      return;
    }
    drive_ = likely_drive_ = choice.column;
    guess("drive", fmt::format("'{}'", drive_->name), choice.reason);
    if (!choice.doubt.empty()) proposal_.notes.push_back(choice.doubt);
    note_reference(*drive_, proposal_.notes);
    if (!drive_->words.odd_unit.empty()) ask_unit_of_drive();
    find_wrap_of_drive();
  }

  [[nodiscard]] bool has_goal() const { return drive_ != nullptr && drive_->is_goal; }

  // The drive of a position servo: the difference of its goal and the position.
  void take_goal() {
    motion_ = motion_of_drive();  // for the words of the note
    guess("drive", fmt::format("'{}' - position", drive_->name),
          "you said so: the goal of a servo");
    proposal_.notes.push_back(fmt::format(
        "'{}' is a reference: the servo drives by what is left to it, taken as 1 {} for each {} of "
        "goal - position (--gain states another). All sizes are relative to this gain of the "
        "servo's, and a stiffness that is found is a part of it",
        drive_->name, force_unit(), is_linear() ? "m" : "rad"));
  }

  // A drive but a force or torque may be in a unit of its own: its gain is not known either.
  void ask_unit_of_drive() {
    const LogQuantity quantity = drive_->words.quantity;
    const bool is_own = unit_as_written(drive_->words.odd_unit).empty();
    if (is_own && quantity != LogQuantity::kForce && !request_.gain) {
      proposal_.notes.push_back(
          fmt::format("'{}' is no unit that graybox knows: '{}' is taken as recorded",
                      drive_->words.odd_unit, drive_->name));
      return;
    }
    std::vector<std::string> units{"A", "mA"};
    const bool moves_linearly = motion_of_drive() == MotionKind::kLinear;
    if (quantity == LogQuantity::kForce) units = {"N m", "mN m", "N"};
    if (quantity == LogQuantity::kForce && moves_linearly) units = {"N", "kN", "N m"};
    if (quantity == LogQuantity::kVoltage) units = {"V", "mV"};
    if (quantity == LogQuantity::kCommand) units = {"V", "A", "1"};
    units.emplace_back("%");
    const bool is_torque = quantity == LogQuantity::kForce && !moves_linearly &&
                           drive_->words.motion == MotionKind::kRotary;
    proposal_.questions.push_back(
        question_of_unit(*drive_, is_torque ? "torque" : name_of(quantity), units));
  }

  // A signed number that was read as unsigned, in any of the logs.
  void find_wrap_of_drive() {
    for (const LogRecording& recording : recordings_) {
      const LogColumn& column = recording.at(drive_->file, drive_->name);
      const Eigen::VectorXd recorded = without_gaps(column.values) / column.words.unit_factor;
      const std::optional<CounterWrap> wrap = find_wrap(recorded, 0.0);
      if (!wrap) continue;
      drive_period_ = wrap->period * column.words.unit_factor;
      proposal_.notes.push_back(fmt::format(
          "'{}' jumps by 2^{:g}, as a number with a sign does that was read without: it is "
          "unwrapped",
          drive_->name, std::log2(wrap->period)));
      drive_wrap_ = fmt::format(", bits: {:g}", std::log2(wrap->period));
      return;
    }
  }

  // ---- motions ---------------------------------------------------------------------------------

  [[nodiscard]] MotionKind motion_of_drive() const {
    if (request_.motion != MotionKind::kOpen) return request_.motion;
    for (const bool is_said : {true, false}) {  // the user's word before titles
      for (const LogColumn* column : columns_) {
        const LogQuantity quantity = column->words.quantity;
        const bool is_motion =
            quantity == LogQuantity::kPosition || quantity == LogQuantity::kVelocity;
        if (is_motion && column->answered >= is_said && column->moves() &&
            column->words.motion != MotionKind::kOpen) {
          return column->words.motion;
        }
      }
    }
    return likely_drive_ == nullptr ? MotionKind::kOpen : likely_drive_->words.motion;
  }

  void choose_motions() {
    motion_ = motion_of_drive();
    const bool is_open = motion_ == MotionKind::kOpen;
    if (is_open) motion_ = MotionKind::kRotary;
    const MotionContext context{draft_.time.sample_time, EvenSamples(log_, draft_.time), motion_,
                                request_.counts_per_turn};
    if (has_two_) {
      choose_two(context);
    } else {
      take_motion(choose_motion(columns_, context), "");
    }
    require_counts();
    guess("motion", motion_ == MotionKind::kLinear ? "linear" : "rotary",
          request_.motion != MotionKind::kOpen || is_answered() ? "you said so"
          : is_open ? "guessed: no title says; else say --linear"
                    : "the titles");
  }

  // The unit of the motion is the user's.
  [[nodiscard]] bool is_answered() const {
    return !motions_.empty() && motions_.front().column->answered &&
           motion_of_unit(motions_.front().unit) == motion_;
  }

  // Counts a turn that were stated and that no motion is in would change nothing.
  void require_counts() const {
    if (!request_.counts_per_turn || motions_.empty()) return;
    std::string motions;
    for (const MotionChoice& each : motions_) {
      if (each.unit == "counts") return;
      motions +=
          fmt::format("{}'{}' is in {}", motions.empty() ? "" : ", ", each.column->name, each.unit);
    }
    throw InputError(fmt::format(
        "--counts-per-turn: {}, not in counts; leave it out, or say --column '{}=position:counts'",
        motions, motions_.front().column->name));
  }

  void take_motion(MotionChoice choice, const std::string& side) {
    const std::string what =
        (side.empty() ? "" : side + " ") + (choice.is_velocity ? "velocity" : "position");
    for (const OpenQuestion& question : choice.questions) ask(question);
    for (const std::string& note : choice.notes) proposal_.notes.push_back(note);
    if (choice.column == nullptr) {
      ask_for_motion(what);
      return;
    }
    if (choice.questions.empty()) {
      const double factor = choice.column->words.unit_factor;
      const std::string unit =
          factor == 1.0 ? choice.unit : fmt::format("{:g} {}", factor, choice.unit);
      guess(what, fmt::format("'{}' in {}", choice.column->name, unit),
            choice.reason == choice.unit_reason ? choice.reason
                                                : choice.reason + "; " + choice.unit_reason);
    }
    require_unit_of_the_motion(choice);
    sides_.push_back(side);
    motions_.push_back(std::move(choice));
  }

  // A title's unit decides how it moves; one that contradicts what was asked for is refused.
  void require_unit_of_the_motion(const MotionChoice& choice) {
    const MotionKind by_unit = choice.unit == "counts" || !choice.questions.empty()
                                   ? MotionKind::kOpen
                                   : motion_of_unit(choice.unit);
    if (by_unit == MotionKind::kOpen || by_unit == motion_) return;
    if (request_.motion == MotionKind::kOpen && motions_.empty()) {
      motion_ = by_unit;
      return;
    }
    const std::string quantity = choice.is_velocity ? "velocity" : "position";
    const std::string unit =
        is_linear() ? (choice.is_velocity ? "m/s" : "m") : (choice.is_velocity ? "rad/s" : "rad");
    throw InputError(fmt::format(
        "{}: column '{}' is in {}, but the motion is {}: say {}, or --column '{}={}:{}'",
        choice.column->file_name, choice.column->name, choice.unit,
        is_linear() ? "linear" : "rotary", is_linear() ? "--rotary" : "--linear",
        choice.column->name, quantity, unit));
  }

  void ask_for_motion(const std::string& what) {
    Columns left = open_;
    std::erase(left, drive_);
    if (left.empty()) {
      throw InputError(fmt::format(
          "{}: no column is a {} or velocity that moves; say which by --column NAME=position{}",
          log_.files.front().string(), what, words_of_accelerations(columns_)));
    }
    OpenQuestion question = which_of(left, "measured " + what + " or velocity");
    question.option = fmt::format("--column '{}=position:{}', say", left.front()->name,
                                  is_linear() ? "m" : "rad");
    for (AnswerChoice& each : question.choices) each.columns = {each.label + "=position"};
    ask(question);
  }

  // Both sides of a drive.
  void choose_two(const MotionContext& context) {
    Columns motor, load, open;
    for (const LogColumn* column : columns_) {
      const bool is_load = column->words.side == DriveSide::kLoad || column->joint == "load";
      const bool is_motor = column->words.side == DriveSide::kMotor || column->joint == "motor";
      (is_motor ? motor : is_load ? load : open).push_back(column);
    }
    const auto count = [](const Columns& columns) {
      return moving_columns(columns, LogQuantity::kPosition).size() +
             moving_columns(columns, LogQuantity::kVelocity).size();
    };
    if (count(motor) == 0 && count(load) == 0) split_by_data(open, motor, load);
    if (count(motor) == 0) motor.insert(motor.end(), open.begin(), open.end());
    if (count(motor) > 0 && count(load) == 0 && count(open) > 0 && motor.size() != open.size()) {
      load = open;
    }
    take_motion(choose_motion(motor, context), "motor");
    if (count(load) == 0) return;
    take_motion(choose_motion(load, context), "load");
  }

  // Two positions, or two velocities, without words for their side: the driven one follows the
  // force at once.
  void split_by_data(Columns& open, Columns& motor, Columns& load) {
    Columns measured;
    for (const LogQuantity quantity : {LogQuantity::kPosition, LogQuantity::kVelocity}) {
      measured.clear();
      for (const LogColumn* column : moving_columns(open, quantity)) {
        if (!column->words.is_reference) measured.push_back(column);
      }
      if (!measured.empty()) break;
    }
    if (measured.size() != 2 || drive_ == nullptr) return;
    const bool is_velocity = measured[0]->words.quantity == LogQuantity::kVelocity;
    const auto follows = [&](const LogColumn* column) {
      return std::abs(follows_at_once(drive_->values, column->values, is_velocity));
    };
    const double first = follows(measured[0]), second = follows(measured[1]);
    const std::size_t driven = first >= second ? 0 : 1;
    motor = {measured[driven]};
    load = {measured[1 - driven]};
    guess("driven mass", fmt::format("'{}'", motor.front()->name),
          fmt::format("its acceleration follows the drive: correlation {:.2f}, of the other {:.2f}",
                      std::max(first, second), std::min(first, second)));
  }

  // A command is held between samples; what was measured goes on between them.
  void hold_as_measured() {
    const bool is_measured = drive_ != nullptr && drive_->words.is_measured &&
                             !drive_->words.is_reference &&
                             drive_->words.quantity != LogQuantity::kCommand;
    if (!is_measured && !has_goal()) return;
    draft_.hold = "first";
    draft_.hold_reason =
        has_goal() ? "the difference goes on between samples" : "the drive was measured";
  }

  // ---- values that are held ---------------------------------------------------------------------

  // A motion that was measured at a slower rate than logged: one of so many samples is taken.
  void take_held_values() {
    if (!(draft_.time.sample_time > 0.0)) return;
    for (const MotionChoice& motion : motions_) {
      if (motion.column == nullptr) continue;
      const std::optional<HeldValues> held = find_held_values(without_gaps(motion.column->values));
      if (!held) continue;
      raw_step_ = draft_.time.sample_time;
      draft_.time.every = held->samples;
      draft_.time.from = held->first % held->samples;
      draft_.time.sample_time =
          rounded_step(static_cast<double>(held->samples) * draft_.time.sample_time);
      if (draft_.time.column.empty()) {
        constexpr double kBelow = 0.4;  // of the slower rate
        draft_.decimation = held->samples;
        draft_.low_pass = std::stod(fmt::format("{:.3g}", kBelow / draft_.time.sample_time));
        draft_.low_pass_reason = "before samples are left out";
      } else {
        draft_.time.is_even = false;
        draft_.time.of_step = "one of so many samples";
      }
      guess("held", fmt::format("'{}'", motion.column->name),
            fmt::format("each value for {} samples: one of {} is taken, every {:g} s",
                        held->samples, held->samples, draft_.time.sample_time));
      return;
    }
  }

  // A drive that was read more rarely than the motion: between its readings nobody knows what acts.
  void note_held_drive() {
    if (drive_ == nullptr || !(draft_.time.sample_time > 0.0) || draft_.time.every > 1) return;
    const std::optional<HeldValues> held = find_held_values(without_gaps(drive_->values));
    if (!held) return;
    proposal_.notes.push_back(
        fmt::format("'{}' has a new value every {} rows: it is read every {:g} s, the motion every "
                    "{:g} s. Unless the command itself is held so, what drives between is not "
                    "known, and the mass may come out wrong",
                    drive_->name, held->samples,
                    rounded_step(static_cast<double>(held->samples) * draft_.time.sample_time),
                    draft_.time.sample_time));
  }

  // Where in a segment of a recording the motion's values begin.
  [[nodiscard]] Eigen::Index first_of_held(const DraftExperiment& experiment) const {
    const LogColumn* column = motions_.front().column;
    const LogColumn& here = recordings_[experiment.recording].at(column->file, column->name);
    const Eigen::Index count = experiment.last - experiment.first + 1;
    const std::optional<HeldValues> held =
        find_held_values(without_gaps(here.values.segment(experiment.first, count)));
    if (held) return held->first % draft_.time.every;
    const Eigen::Index behind = (draft_.time.from - experiment.first) % draft_.time.every;
    return behind < 0 ? behind + draft_.time.every : behind;
  }

  // ---- the campaign ----------------------------------------------------------------------------

  [[nodiscard]] bool is_linear() const { return motion_ == MotionKind::kLinear; }
  [[nodiscard]] std::string force_unit() const { return is_linear() ? "N" : "N m"; }
  [[nodiscard]] std::string force_name() const { return is_linear() ? "force" : "torque"; }
  [[nodiscard]] std::string motion_name(std::size_t k) const {
    const std::string name = is_linear() ? (motions_[k].is_velocity ? "velocity" : "position")
                                         : (motions_[k].is_velocity ? "speed" : "angle");
    return sides_[k].empty() ? name : sides_[k] + "_" + name;
  }

  void add_no_drive() {
    force_factor_ = 0.0;
    draft_.computed.push_back(
        fmt::format("  - {{kind: constant, name: {}, value: 0, unit: {}, is: input}}  # no force "
                    "acts\n",
                    force_name(), force_unit()));
  }

  // Behind the motion, whose unit and gain the goal has where none is stated.
  void add_goal_channel() {
    const MotionChoice& motion = motions_.front();
    const std::string position = motion_name(0);
    if (motion.is_velocity) {
      throw InputError(fmt::format(
          "--column '{}=goal': the drive of a servo is goal - position, and no position is "
          "recorded; say which by --column NAME=position",
          drive_->name));
    }
    const bool is_stated = !drive_->words.unit.empty();
    const Unit* unit = find_unit(is_stated ? drive_->words.unit : motion.unit);
    goal_factor_ = is_stated ? unit->factor : motion.factor;
    draft_.channels.push_back({"goal", drive_->file, drive_->name, std::string(unit->name),
                               is_stated ? "" : motion.gain, "reference",
                               is_stated ? "" : "in the unit of the position"});
    const double gain = request_.gain.value_or(1.0);
    draft_.computed.push_back(fmt::format(
        "  - {{kind: sum, of: [goal, {}], weights: [{:g}, {:g}], unit: {}, name: {}, is: input}}\n",
        position, gain, -gain, force_unit(), force_name()));
    force_factor_ = gain;
  }

  void add_drive_channel() {
    if (request_.no_drive && drive_ == nullptr) return add_no_drive();
    if (has_goal()) return;
    if (drive_ == nullptr) {
      draft_.channels.push_back({force_name(), 0, "ANSWER", "1", "", "input",
                                 "# ANSWER: which column drives the machine? " + option_of_last()});
      return;
    }
    std::string unit = drive_->words.unit.empty() ? "1" : drive_->words.unit;
    if (drive_->words.quantity == LogQuantity::kForce && drive_->words.unit.empty()) {
      unit = force_unit();
    }
    const Unit* known = find_unit(unit);
    const bool is_force = known != nullptr && known->base == force_unit() && !request_.gain;
    const double gain = request_.gain.value_or(1.0);
    const double recorded_gain = gain * drive_->words.unit_factor;
    force_factor_ = is_force ? known->factor : gain;
    std::string comment = drive_->words.unit.empty() && is_force ? "the unit is guessed" : "";
    std::string text;
    if (!is_force) {
      text = fmt::format("{{value: {:g}, unit: {}/{}}}", recorded_gain, force_unit(), unit);
      if (unit == "1") {
        text = fmt::format("{{value: {:g}, unit: \"{}/1\"}}", recorded_gain, force_unit());
      }
      if (!request_.gain) {
        comment =
            fmt::format("1 {} stands for one recorded unit: its gain is not known", force_unit());
        proposal_.notes.push_back(
            fmt::format("'{}' is taken as it is, 1 {} for one {}: masses and laws come out in that "
                        "unit (--gain states another)",
                        drive_->name, force_unit(), unit == "1" ? "of it" : unit));
      }
    }
    // What is asked about it, as its unit: no command reads the file until that is answered.
    for (const OpenQuestion& question : proposal_.questions) {
      if (question.about == drive_->name) {
        comment = "# ANSWER: " + question.text;
      }
    }
    draft_.channels.push_back(
        {force_name(), drive_->file, drive_->name, unit, text, "input", comment});
    if (!drive_wrap_.empty()) draft_.wrapped.push_back({force_name(), drive_wrap_});
  }

  [[nodiscard]] std::string option_of_last() const {
    return proposal_.questions.empty() ? "" : proposal_.questions.back().option;
  }

  void draft_campaign() {
    draft_.heading = fmt::format("# Proposed by `{}`. Change what is wrong.\n", request_.command);
    add_drive_channel();
    Columns decisive;
    for (std::size_t k = 0; k < motions_.size(); ++k) {
      const MotionChoice& each = motions_[k];
      std::string comment = each.unit_reason;
      if (!each.questions.empty() && !comment.starts_with("# ANSWER")) {
        comment = "# ANSWER: " + each.questions.front().text;
      }
      draft_.channels.push_back({motion_name(k), each.column->file, each.column->name, each.unit,
                                 each.gain, "output", comment});
      if (each.is_wrapped) draft_.wrapped.push_back({motion_name(k), each.wrap_period});
      decisive.push_back(each.column);
    }
    if (has_goal() && !motions_.empty()) add_goal_channel();
    if (motions_.empty()) {
      draft_.channels.push_back({is_linear() ? "position" : "angle", 0, "ANSWER",
                                 is_linear() ? "m" : "rad", "", "output",
                                 "# ANSWER: which column is the motion? " + option_of_last()});
    }
    note_gaps();
    note_unused();
    draft_.keeps_standstill = request_.split != SplitPlan::kMovingHalves;
    draft_.experiments =
        draft_experiments(recordings_, decisive, !motions_.empty() && motions_.front().is_velocity,
                          raw_step_ > 0.0 ? raw_step_ : draft_.time.sample_time, request_.split);
    split_in_blocks();
    note_sparse_rows(draft_, recordings_.front(), proposal_.notes);
    if (draft_.time.every > 1) {
      for (DraftExperiment& each : draft_.experiments) each.from = first_of_held(each);
    }
    guess_what_is_kept_out();
  }

  // In each row; the sum of squares is what counts.
  [[nodiscard]] Eigen::VectorXd driving() const {
    if (drive_ == nullptr) return Eigen::VectorXd::Zero(log_.samples());
    const Eigen::VectorXd values = without_gaps(drive_->values);
    return !has_goal() ? values : goal_factor_ * values - motions_[0].values(log_);
  }

  // Halves of which one has no drive or no motion check nothing: then alternating blocks.
  void split_in_blocks() {
    const bool has_halves =
        request_.split == SplitPlan::kMovingHalves || request_.split == SplitPlan::kWholeHalves;
    const bool is_known = (drive_ != nullptr || request_.no_drive) && !motions_.empty() &&
                          motions_[0].column != nullptr;
    if (!has_halves || !is_known || draft_.experiments.size() != 2 || recordings_.size() != 1) {
      return;
    }
    const Eigen::Index first = draft_.experiments.front().first,
                       count = draft_.experiments.back().last - first + 1;
    const Eigen::VectorXd drive = driving(), moves = motions_[0].values(log_);
    blocks_ = kept_out_blocks(drive.segment(first, count), moves.segment(first, count),
                              motions_[0].is_velocity);
    if (!blocks_.is_fair) {
      draft_.experiments = {{0, first, first + count - 1, false, false}};
      return;
    }
    if (blocks_.count < 3) return;
    draft_.experiments.clear();
    for (Eigen::Index k = 0; k < blocks_.count; ++k) {
      draft_.experiments.push_back({0, first + k * count / blocks_.count,
                                    first + (k + 1) * count / blocks_.count - 1, false,
                                    k % 2 == 1});
    }
  }

  void guess_what_is_kept_out() {
    const std::string few = "with less in the fit a diagnosis would have too few samples";
    const bool is_one = recordings_.size() == 1;
    if (request_.split == SplitPlan::kNoValidation) return guess("kept out", "nothing", few);
    if (!is_one) {
      guess("kept out", recordings_.back().label(), "checks the fit");
    } else if (request_.split == SplitPlan::kMostInFit) {
      guess("kept out", "the last quarter", "checks the fit; " + few);
    } else if (blocks_.count > 2) {
      guess("kept out", fmt::format("every second of {} parts", blocks_.count),
            blocks_.reason + ", so halves would not be alike");
    } else if (!blocks_.is_fair) {
      guess("kept out", "nothing", blocks_.reason + ", and no split gives each part its share");
      proposal_.notes.push_back(
          "nothing is kept out, so nothing will test what is found: record "
          "another run and give both logs");
    } else {
      guess("kept out", "the second half", "checks the fit");
    }
    if (request_.split != SplitPlan::kMovingHalves) {
      guess("standstill", "kept",
            is_one && request_.split == SplitPlan::kMostInFit ? "the same" : few);
    }
  }

  void note_gaps() {
    for (const DraftChannel& channel : draft_.channels) {
      for (const LogRecording& recording : recordings_) {
        if (channel.column == "ANSWER") continue;
        if (!recording.at(channel.file, channel.column).has_gaps()) continue;
        draft_.gapped.push_back(channel.name);
        proposal_.notes.push_back(
            fmt::format("'{}' has rows without a number: they are left out", channel.column));
        break;
      }
    }
  }

  void note_unused() {
    for (const LogColumn* column : columns_) {
      if (is_used(column)) continue;
      const bool is_unknown = column->words.quantity == LogQuantity::kUnknown;
      const char* why = !column->moves()                                  ? "never changes"
                        : is_unknown && column->counts_rows()             ? "numbers the rows"
                        : column->words.quantity == LogQuantity::kUnknown ? "not recognised"
                        : column->words.quantity == LogQuantity::kOther   ? "no motion, no drive"
                        : column->words.is_reference                      ? "a reference"
                                                                          : "not needed";
      draft_.unused.push_back(fmt::format("{}: {}", column->name, why));
    }
    if (!draft_.unused.empty()) {
      std::string names;
      constexpr std::size_t kMost = 6;
      for (std::size_t k = 0; k < std::min(kMost, draft_.unused.size()); ++k) {
        names += (k == 0 ? "" : "; ") + draft_.unused[k];
      }
      if (draft_.unused.size() > kMost)
        names += fmt::format("; and {} more", draft_.unused.size() - kMost);
      guess("not used", names, "");
    }
  }

  // ---- two encoders ----------------------------------------------------------------------------

  // Sign and gear of the load's sensor from how both move.
  void relate_encoders() {
    if (motions_.size() != 2 || motions_[0].is_velocity != motions_[1].is_velocity) return;
    const Eigen::VectorXd motor = motions_[0].values(log_), load = motions_[1].values(log_);
    const double alike = correlation(motor, load);
    const double slope = alike * std::sqrt((load.array() - load.mean()).square().sum() /
                                           (motor.array() - motor.mean()).square().sum());
    constexpr double kTogether = 0.5, kRigid = 0.98, kNoGear = 1.2;
    if (std::abs(alike) < kTogether) return;
    const double size = std::abs(slope);
    const bool has_gear = std::abs(alike) > kRigid && (size > kNoGear || size < 1.0 / kNoGear);
    if (slope > 0.0 && !has_gear) return;
    const double factor = (has_gear ? 1.0 / size : 1.0) * (slope < 0.0 ? -1.0 : 1.0);
    motions_[1].factor *= factor;
    DraftChannel& channel = draft_.channels[2];
    if (!channel.gain.empty()) return;
    const Unit* unit = find_unit(channel.unit);
    const std::string base(unit->base);
    channel.gain = fmt::format("{{value: {:.6g}, unit: {}/{}}}",
                               factor * unit->factor * motions_[1].column->words.unit_factor, base,
                               channel.unit);
    channel.comment =
        fmt::format("both move together by {:.4g} (correlation {:.2f})", slope, alike);
    guess("load's sensor", fmt::format("times {:.4g}", factor), channel.comment);
  }

  // ---- the model -------------------------------------------------------------------------------

  [[nodiscard]] std::string inertia_unit() const { return is_linear() ? "kg" : "kg m^2"; }

  [[nodiscard]] bool can_compute() const {
    return proposal_.questions.empty() && drive_ != nullptr && !motions_.empty();
  }

  // At even times.
  [[nodiscard]] Eigen::VectorXd force() const {
    if (has_goal()) return force_factor_ * even_.of(driving());
    Eigen::VectorXd values = without_gaps(drive_->values);
    if (drive_period_ > 0.0) values = unwrapped(values, drive_period_);
    return force_factor_ * even_.of(values);
  }
  [[nodiscard]] Eigen::VectorXd motion(std::size_t k) const {
    return even_.of(motions_[k].values(log_));
  }

  [[nodiscard]] OneMassStart one_mass_start() const {
    return start_one_mass(
        {force(), motion(0), motions_[0].is_velocity, !is_linear(), draft_.time.sample_time});
  }

  // As --column takes it: "-deg", "-0.1 deg".
  static std::string reversed_unit(const MotionChoice& motion) {
    const double factor = -motion.column->words.unit_factor;
    if (factor == -1.0) return "-" + motion.unit;
    return factor == 1.0 ? motion.unit : fmt::format("{:g} {}", factor, motion.unit);
  }

  // A drive or an encoder that counts the other way makes the mass negative. Turning either is the
  // same but for a velocity beside the position, which is a third witness: two that agree are
  // believed. A weight is none, since its direction is not known.
  void doubt_sign(const OneMassStart& start) {
    const MotionChoice& motion = motions_.front();
    const std::string drive = fmt::format("for the drive --gain={:g}", -force_factor_),
                      encoder = fmt::format(
                          "for the encoder --column '{}={}:{}'", motion.column->name,
                          motion.is_velocity ? "velocity" : "position", reversed_unit(motion));
    std::string who = fmt::format(
        "'{}' (drive) or '{}' (encoder) is reversed, and this log can't "
        "tell which: say {}, or {}",
        drive_->name, motion.column->name, drive, encoder);
    if (motion.rate < 0.0) {
      who = fmt::format(
          "'{}' (encoder) is reversed: '{}' agrees with the drive, and the rate of "
          "the encoder with neither: say {}",
          motion.column->name, motion.other->name, encoder);
    } else if (motion.rate > 0.0) {
      who = fmt::format("'{}' (drive) is reversed, or both '{}' and '{}', which agree: say {}",
                        drive_->name, motion.column->name, motion.other->name, drive);
    }
    proposal_.notes.push_back(fmt::format(
        "are the signs right? The mass would be negative, -{:.3g} {} within {:.0f} %: the axis "
        "speeds up against its drive. Either a spring or a weight holds the axis, and the signs "
        "are "
        "right as they are; or {} (start values are those of the turned drive)",
        start.inertia, inertia_unit(), 100.0 * start.spread, who));
  }

  // The weight of a drive that never pushes back: a law of the model, since nothing else turns it.
  std::string weight(const OneMassStart& start) {
    const bool is_needed = start.told == OneMassTold::kInertia &&
                           (start.sine != 0.0 || start.cosine != 0.0) && !has_goal() &&
                           manner_of_drive(*drive_, recordings_).has_one_sign;
    if (!is_needed) return "";
    const char* why = "the drive never changes its sign, and the axis comes back";
    guess("weight",
          fmt::format("{:.3g} {} at most", std::hypot(start.sine, start.cosine), force_unit()),
          fmt::format("{}; it is fitted", why));
    return fmt::format(
        "{:<46} # {}\n    location: {{kind: element, mass: axis}}\n    law: gravity\n"
        "    parameters: {{sine: {{value: {:.4g}, unit: N m}}, cosine: {{value: {:.4g}, unit: N "
        "m}}}}\n",
        "  - name: weight", why, start.sine, start.cosine);
  }

  std::string masses() {
    OneMassStart start;
    std::string why = request_.no_drive ? "no force acts: all else is relative to it"
                                        : "guessed: open until the questions are answered";
    if (can_compute()) {
      start = one_mass_start();
      switch (start.told) {
        case OneMassTold::kInertia:
          why = "a start: least squares of the motion on the drive and friction";
          break;
        case OneMassTold::kReversed:
          why = "guessed: negative; is the drive reversed, or the encoder?";
          doubt_sign(start);
          break;
        case OneMassTold::kNothing:
          why = start.has_value ? "guessed: the log hardly shows an inertia"
                                : "guessed: the log shows no inertia";
      }
    }
    const std::string damping_unit = is_linear() ? "N s/m" : "N m s/rad";
    guess("mass", fmt::format("{:.3g} {}", start.inertia, inertia_unit()),
          why + (request_.no_drive ? "; it is held" : "; it is fitted"));
    guess("damping", fmt::format("{:.3g} {}", start.damping, damping_unit),
          request_.no_drive ? "guessed; it is fitted" : "the same");
    return fmt::format("{:<46} # {}; {}\n", fmt::format("masses: {{axis: {:.4g}}}", start.inertia),
                       inertia_unit(), why) +
           fmt::format(
               "elements:\n  - name: bearing\n    location: {{kind: element, mass: axis}}\n"
               "    law: viscous\n"
               "    parameters: {{damping: {{value: {:.4g}, unit: {}}}}}\n",
               start.damping, damping_unit) +
           weight(start);
  }

  SpringStart spring_start() {
    if (can_compute() && motions_.size() == 2 &&
        motions_[0].is_velocity == motions_[1].is_velocity) {
      const auto found = start_two_masses(force(), motion(0), motion(1), motions_[0].is_velocity,
                                          draft_.time.sample_time);
      if (found) return {*found, "a start: least squares of both equations of motion"};
    }
    double total = 0.01;
    if (can_compute()) {
      const Eigen::VectorXd motor = motion(0);
      const auto found =
          start_one_encoder(force(), motor, motions_[0].is_velocity, draft_.time.sample_time);
      if (found) return {*found, "a start: antiresonance and resonance of the driven mass"};
      const OneMassStart one = one_mass_start();
      if (one.told == OneMassTold::kInertia) total = one.inertia;
    }
    constexpr double kGuess = 2.0 * 3.14159265358979 * 20.0;  // rad/s
    return {{0.5 * total, 0.5 * total, 0.25 * total * kGuess * kGuess, 0.01 * total * kGuess},
            "a start: both alike, a resonance at 20 Hz"};
  }

  std::string two_masses() {
    SpringStart start = spring_start();
    TwoMassStart& values = start.values;
    const double critical = std::sqrt(values.stiffness * std::min(values.motor, values.load));
    if (!(values.damping > 0.0)) values.damping = 0.02 * critical;
    const std::string stiffness = is_linear() ? "N/m" : "N m/rad",
                      damping = is_linear() ? "N s/m" : "N m s/rad";
    guess("masses", fmt::format("{:.3g} and {:.3g} {}", values.motor, values.load, inertia_unit()),
          start.reason + "; they are fitted");
    guess("spring", fmt::format("{:.3g} {}", values.stiffness, stiffness), "the same");
    std::string text = fmt::format(
        "{:<46} # {}; {}\n",
        fmt::format("masses: {{motor: {:.4g}, load: {:.4g}}}", values.motor, values.load),
        inertia_unit(), start.reason);
    text += fmt::format(
        "elements:\n  - name: coupling\n    location: {{kind: element, between: [motor, load]}}\n"
        "    law: stiffness\n    parameters: {{stiffness: {{value: {:.4g}, unit: {}}}}}\n"
        "  - name: coupling_damping\n    location: {{kind: element, between: [motor, load]}}\n"
        "    law: viscous\n    parameters: {{damping: {{value: {:.4g}, unit: {}}}}}\n",
        values.stiffness, stiffness, values.damping, damping);
    if (motions_.size() == 2 && !motions_[1].is_velocity && can_compute()) {
      const double zero = (motion(1) - motion(0)).mean();
      text += fmt::format(
          "  - name: load_zero                            # the sensors' zeros differ\n"
          "    location: {{kind: sensor, output: {}}}\n    law: offset\n"
          "    parameters: {{value: {{value: {:.4g}, unit: {}}}}}\n",
          motion_name(1), zero, is_linear() ? "m" : "rad");
    }
    return text;
  }

  std::string model() {
    std::string text =
        fmt::format("# Proposed by `{}`: {}. Change what is wrong.\n", request_.command,
                    has_two_ ? "two masses and a spring" : "a mass with viscous friction");
    text += "format: graybox-lumped/1\n";
    const double step = draft_.time.sample_time;
    text += step > 0.0 ? fmt::format("{:<46} # s\n", fmt::format("sample_time: {:g}", step))
                       : "sample_time: ANSWER  # ANSWER: s, as in campaign.yaml\n";
    text += fmt::format("motion: {}\n", is_linear() ? "translation" : "rotation");
    text += has_two_ ? two_masses() : masses();
    const std::string driven = has_two_ ? "motor" : "axis";
    text += fmt::format("inputs:\n  - {{name: {}, mass: {}}}\noutputs:\n", force_name(), driven);
    for (std::size_t k = 0; k < motions_.size(); ++k) {
      text += fmt::format("  - {{name: {}, mass: {}, quantity: {}}}\n", motion_name(k),
                          has_two_ ? sides_[k] : driven,
                          motions_[k].is_velocity ? "velocity" : "position");
    }
    if (motions_.empty()) {
      text += fmt::format("  - {{name: {}, mass: {}, quantity: position}}\n",
                          is_linear() ? "position" : "angle", driven);
    }
    return text;
  }

  const ProposalRequest& request_;
  const std::vector<LogRecording>& recordings_;
  const LogRecording& log_;
  bool has_two_ = false;
  MotionKind motion_ = MotionKind::kRotary;
  Columns columns_, open_;  // without times; those of unknown quantity that move
  const LogColumn* drive_ = nullptr;
  double goal_factor_ = 1.0;                 // of a goal that is the drive_, to the model's unit
  const LogColumn* likely_drive_ = nullptr;  // also where a question is open
  double force_factor_ = 1.0;
  std::vector<MotionChoice> motions_;
  std::vector<std::string> sides_;
  EvenSamples even_;
  double drive_period_ = 0.0;  // of its wraps, in its unit; 0: none
  std::string drive_wrap_;     // for the campaign
  double raw_step_ = 0.0;      // s between recorded samples, where values are held
  KeptOutBlocks blocks_;
  CampaignDraft draft_;
  ModelProposal proposal_;
};

}  // namespace

ModelProposal propose_masses(const ProposalRequest& request,
                             const std::vector<LogRecording>& recordings) {
  return MassProposal(request, recordings).run();
}

}  // namespace graybox
