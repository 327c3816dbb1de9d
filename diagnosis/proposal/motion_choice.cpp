#include "diagnosis/proposal/motion_choice.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "diagnosis/log_columns/encoder_steps.hpp"
#include "diagnosis/log_columns/position_jitter.hpp"
#include "diagnosis/log_columns/sign_bit.hpp"
#include "diagnosis/proposal/start_values.hpp"
#include "diagnosis/signal_faults/counter_wrap.hpp"
#include "diagnosis/signal_faults/quantisation.hpp"
#include "diagnosis/signal_faults/sample_statistics.hpp"
#include "problems/base/units.hpp"

namespace graybox {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr double kRadiansOpen = 4.0 * std::numbers::pi;  // spans beyond may be degrees
constexpr double kSpeedOpen = 300.0;                     // beyond it rpm are as likely as rad/s
constexpr Eigen::Index kFewestCompared = 50;
constexpr double kLate = 0.005;    // s; worth a note
constexpr double kOfTime = 0.3;    // of the misfit, of a ratio of 1000
constexpr double kNearTime = 1.2;  // a factor
constexpr const char* kUserSaid = "you said so";
constexpr double kOneRatio = 0.06;  // of the misfit: a gear has one ratio at every speed

double span_of(const LogColumn& column) {
  const Eigen::VectorXd values = without_gaps(column.values);
  return values.maxCoeff() - values.minCoeff();
}

// An angle by its title that is beyond radians of few turns all the time: 76 to 91 of a tilt. In
// degrees it would be within a turn or so; only a machine of many turns has such radians.
bool lies_beyond_radians(const LogColumn& column) {
  const Eigen::VectorXd values = without_gaps(column.values);
  return column.words.motion == MotionKind::kRotary &&
         values.array().abs().minCoeff() > kRadiansOpen;
}

bool holds_counts(const LogColumn& column) {
  if (!column.words.unit.empty() || column.has_gaps() || span_of(column) < 100.0) return false;
  return (column.values.array() == column.values.array().round()).all();
}

bool is_counted(const LogColumn& column) {
  return column.words.unit == "counts" || holds_counts(column);
}

// In steps of a quarter or more, as an encoder's; no angle is read so coarsely over so many turns.
bool looks_counted(const LogColumn& column) {
  constexpr double kFar = 1000.0, kQuarters = 4.0;
  if (column.words.unit_factor != 1.0 || span_of(column) < kFar) return false;
  const Eigen::ArrayXd quarters = kQuarters * without_gaps(column.values).array();
  return (quarters == quarters.round()).all();
}

// Between neighbours of all values that differ.
double smallest_step(Eigen::VectorXd values) {
  constexpr double kSame = 1e-9;  // of the span
  std::ranges::sort(values);
  const Eigen::Index n = values.size();
  const double span = values(n - 1) - values(0);
  double smallest = span;
  for (Eigen::Index k = 1; k < n; ++k) {
    const double step = values(k) - values(k - 1);
    if (step > kSame * span) smallest = std::min(smallest, step);
  }
  return smallest;
}

// The rms of second differences over the deviation: 2.4 of white noise, 0 of a straight line.
double roughness(const Eigen::VectorXd& values) {
  const Eigen::Index n = values.size();
  const Eigen::ArrayXd bends = values.head(n - 2).array() - 2.0 * values.segment(1, n - 2).array() +
                               values.tail(n - 2).array();
  const double deviation = std::sqrt((values.array() - values.mean()).square().mean());
  return deviation > 0.0 ? std::sqrt(bends.square().mean()) / deviation : 0.0;
}

std::string si_unit(bool is_velocity, MotionKind motion) {
  if (motion == MotionKind::kLinear) return is_velocity ? "m/s" : "m";
  return is_velocity ? "rad/s" : "rad";
}

double turn_in(const std::string& unit) {
  const Unit* known = find_unit(unit);
  return known == nullptr || known->base != "rad" ? 0.0 : kTurn / known->factor;
}

MotionKind motion_of(const LogColumn* position, const LogColumn* velocity,
                     const MotionContext& context) {
  if (context.motion != MotionKind::kOpen) return context.motion;
  for (const LogColumn* each : {position, velocity}) {
    if (each != nullptr && each->words.motion != MotionKind::kOpen) return each->words.motion;
  }
  return MotionKind::kRotary;
}

// In the velocity's unit. None where it is small.
std::optional<PositionJitter> large_jitter(const LogColumn& position, const LogColumn& velocity,
                                           const MotionUnits& units, const MotionContext& context) {
  const double factor = find_unit(units.position)->factor / find_unit(units.velocity)->factor;
  const Eigen::VectorXd place = without_wraps(position.values, turn_in(position.words.unit)).first;
  const auto jitter = position_jitter(factor * context.even.of(place),
                                      context.even.of(velocity.values), context.step);
  return jitter && jitter->is_large() ? jitter : std::nullopt;
}

// A low pass that goes a of the way in a row is late by (1 - a)/a rows.
std::string jitter_words(const LogColumn& position, const LogColumn& velocity,
                         const PositionJitter& jitter, double step) {
  if (jitter.is_speed_computed()) {
    return fmt::format(
        "'{}' was computed from '{}', by a low pass that makes it late by about {:.2g} s",
        velocity.name, position.name, step * (1.0 - jitter.low_pass) / jitter.low_pass);
  }
  return fmt::format(
      "'{}' jitters from row to row, its rate by {:.2g} times the deviation of '{}', which does "
      "not "
      "follow it",
      position.name, jitter.rate / jitter.speed_deviation, velocity.name);
}

// The position beside the velocity: whether the one is the rate of the other, and the units in
// which it is.
class RateComparison {
 public:
  RateComparison(const LogColumn* position, const LogColumn* velocity, const MotionContext& context)
      : position_(position), velocity_(velocity), context_(context) {
    compare();
  }

  [[nodiscard]] const std::optional<RateFit>& fit() const { return fit_; }
  [[nodiscard]] const MotionUnits& units() const { return units_; }
  [[nodiscard]] bool has_offset() const { return has_offset_; }
  // How position and velocity agree.
  [[nodiscard]] const std::vector<std::string>& remarks() const { return remarks_; }
  [[nodiscard]] const std::vector<std::string>& notes() const { return notes_; }
  [[nodiscard]] const std::vector<OpenQuestion>& questions() const { return questions_; }

  // A position without a unit that its velocity does not tell, because its rate is rough: the
  // velocity is used where it is much smoother.
  [[nodiscard]] bool prefers_velocity() {
    constexpr double kMuchSmoother = 0.5, kNoRatio = 0.15;
    if (position_ == nullptr || velocity_ == nullptr || !(context_.step > 0.0)) return false;
    if (is_velocity_finer() || is_velocity_calmer()) return true;
    const bool is_told = !position_->words.unit.empty() || position_->answered || units_.is_found ||
                         holds_counts(*position_) || context_.counts_per_turn.has_value();
    if (is_told || (fit_ && fit_->misfit < kNoRatio)) return false;
    const Eigen::VectorXd place = context_.even.of(position_->values),
                          speed = context_.even.of(velocity_->values);
    if (place.size() < kFewestCompared || !place.allFinite() || !speed.allFinite()) return false;
    const Eigen::VectorXd rate = place.tail(place.size() - 2) - place.head(place.size() - 2);
    if (!(roughness(speed) < kMuchSmoother * roughness(rate))) return false;
    remarks_.push_back(fmt::format("'{}' is much smoother than the rate of '{}'", velocity_->name,
                                   position_->name));
    return true;
  }

  // A velocity that is not the rate of the position, and rougher than that: the position is right.
  [[nodiscard]] bool doubts_velocity() const {
    if (!is_no_rate_ || has_sign_bit_) return has_sign_bit_;
    const Eigen::VectorXd place = context_.even.of(position_->values),
                          speed = context_.even.of(velocity_->values);
    if (!place.allFinite() || !speed.allFinite()) return false;
    return roughness(speed) >
           roughness(place.tail(place.size() - 2) - place.head(place.size() - 2));
  }

 private:
  [[nodiscard]] MotionKind motion() const { return motion_of(position_, velocity_, context_); }

  // A coarse position beside a velocity in much finer steps, which is its rate within its rounding.
  // One that is late was filtered, and one with an offset is worse than coarse.
  [[nodiscard]] bool is_velocity_finer() {
    constexpr double kMuchFiner = 20.0, kMostSaid = 1000.0, kOfDifference = 0.41;  // sqrt(2/12)
    const bool has_unit = !velocity_->words.unit.empty() || units_.is_found;
    if (context_.drive == nullptr || !fit_ || !(fit_->factor > 0.0) || !has_unit) return false;
    if (has_offset_ || units_.contradicts || position_->answered) return false;
    if (std::abs(fit_->late) > context_.step) return false;
    const Eigen::VectorXd speed = context_.even.of(velocity_->values);
    const std::optional<Quantisation> coarse =
        find_coarse_quantisation(without_gaps(position_->values));
    if (!coarse || !speed.allFinite()) return false;
    const double deviation = std::sqrt((speed.array() - speed.mean()).square().mean());
    const double rate_step = coarse->step / (context_.step * fit_->factor);
    const double finer = rate_step / smallest_step(without_gaps(velocity_->values));
    const double rounding = kOfDifference * 0.5 * rate_step / deviation;
    if (!(finer >= kMuchFiner) || !(fit_->misfit < rounding)) return false;
    remarks_.push_back(fmt::format(
        "'{}' goes in steps of {:.3g}, and its rate so in steps at least {:.0f} times "
        "those of '{}', which agrees",
        position_->name, coarse->step, std::floor(std::min(finer, kMostSaid)), velocity_->name));
    return true;
  }

  // A position that jitters beside a velocity of its own, which was not computed from it.
  [[nodiscard]] bool is_velocity_calmer() {
    const bool may_be = context_.drive != nullptr && units_.is_found && !has_offset_ &&
                        !(position_->answered && !velocity_->answered) && !is_counted(*position_);
    if (!may_be || (fit_ && !(fit_->factor > 0.0))) return false;
    const auto jitter = large_jitter(*position_, *velocity_, units_, context_);
    if (!jitter || (fit_ && std::abs(fit_->late) > context_.step)) return false;
    const bool is_own = !jitter->is_speed_computed();
    if (is_own || (jitter->low_pass > 0.0 && remarks_.empty()))
      remarks_.push_back(jitter_words(*position_, *velocity_, *jitter, context_.step));
    return is_own;
  }

  // A velocity that is the rate but for its sign, which is a bit of its own.
  [[nodiscard]] bool has_sign_bit(const Eigen::VectorXd& place) {
    constexpr double kSurely = 0.3, kClearly = 0.5;  // of the misfit
    const double unit = velocity_->words.unit_factor;
    const std::optional<SignBit> sign = find_sign_bit(without_gaps(velocity_->values) / unit);
    if (!sign) return false;
    const Eigen::VectorXd speed = sign->signed_of(context_.even.of(velocity_->values) / unit);
    const std::optional<RateFit> fit = fit_rate(place, speed, context_.step);
    if (!fit || !(fit->misfit < kSurely)) return false;
    if (fit_ && !(fit->misfit < kClearly * fit_->misfit)) return false;
    notes_.push_back(
        fmt::format("'{}' would be the rate of '{}' with {}: write {} (no preprocess does it)",
                    velocity_->name, position_->name, sign->words(), sign->mend()));
    return true;
  }

  // Is the velocity the rate of the position, and in which units?
  void compare() {
    if (position_ == nullptr || velocity_ == nullptr || !(context_.step > 0.0)) return;
    const auto [smooth, wrapped] = without_wraps(position_->values, turn_in(position_->words.unit));
    fit_ = fit_rate(context_.even.of(smooth), context_.even.of(velocity_->values), context_.step);
    if (has_sign_bit(context_.even.of(smooth))) {
      fit_.reset();
      is_no_rate_ = has_sign_bit_ = true;
      remarks_.push_back(
          fmt::format("'{}' is not the rate of '{}'", velocity_->name, position_->name));
      return;
    }
    if (!fit_) return compare_means(context_.even.of(smooth));
    if (std::abs(fit_->late) > std::max(kLate, 2.0 * context_.step)) {
      remarks_.push_back(fmt::format("'{}' is {} than the rate of '{}' by {:.3g} s",
                                     velocity_->name, fit_->late > 0.0 ? "later" : "earlier",
                                     position_->name, std::abs(fit_->late)));
    }
    if (fit_->factor < 0.0) {
      notes_.push_back(fmt::format("'{}' has the opposite sign of the rate of '{}'",
                                   velocity_->name, position_->name));
    }
    find_offset(context_.even.of(smooth));
    if (is_counted(*position_)) return;
    units_ = units_by_rate(fit_->factor, position_->words.unit, velocity_->words.unit, motion());
    note_factor();
    if (!units_.contradicts) return;
    const bool both_stated = !position_->words.unit.empty() && !velocity_->words.unit.empty();
    if (both_stated && is_other_time()) return;
    if (both_stated && is_gear()) {
      const double ratio = fit_->factor * find_unit(position_->words.unit)->factor /
                           find_unit(velocity_->words.unit)->factor;
      remarks_.push_back(fmt::format(
          "{}'{}' is the rate of '{}' times {:.4g}, as behind a gear (misfit {:.2g} %)",
          by_sample_time(), velocity_->name, position_->name, 1.0 / ratio, 100.0 * fit_->misfit));
      return;
    }
    if (both_stated && fit_->misfit > kOneRatio && is_near_one()) {
      remarks_.push_back(
          fmt::format("'{}' is the rate of '{}' only within {:.2g} %: a coarse speed",
                      velocity_->name, position_->name, 100.0 * fit_->misfit));
      return;
    }
    if (both_stated) return ask_units();
    remarks_.push_back(fmt::format("{}the rate of '{}' is {:.4g} times '{}', which fits no units",
                                   by_sample_time(), position_->name, fit_->factor,
                                   velocity_->name));
  }

  // A velocity that is not zero where the position stands: by the way over the time, which noise
  // does not reach, and by the median of what is left, which jumps of the position do not.
  void find_offset(const Eigen::VectorXd& place) {
    constexpr double kWorth = 0.1, kAlike = 2.0;
    const Eigen::Index n = place.size() - 2;
    const Eigen::ArrayXd speed = context_.even.of(velocity_->values).segment(1, n).array();
    const Eigen::ArrayXd rate =
        (place.tail(n) - place.head(n)).array() / (2.0 * context_.step * fit_->factor);
    const Eigen::ArrayXd left = speed - rate;
    const double mean = left.mean(), median = quantile(left.matrix(), 0.5);
    const double deviation = std::sqrt((speed - speed.mean()).square().mean());
    // A factor that is not quite right leaves its share of the mean rate.
    const double by_factor = std::max(kWorth, fit_->misfit * fit_->misfit) * std::abs(rate.mean());
    if (!(std::abs(mean) > kWorth * deviation + by_factor)) return;
    if (!(median * mean > 0.0) || std::abs(median) > kAlike * std::abs(mean) ||
        std::abs(mean) > kAlike * std::abs(median)) {
      return;
    }
    has_offset_ = true;
    const std::string& unit = velocity_->words.unit;
    notes_.push_back(fmt::format(
        "'{}' has an offset: where '{}' stands still it is about {:.2g}{}, {:.2g} of its deviation",
        velocity_->name, position_->name, median, unit.empty() ? "" : " " + unit,
        std::abs(median) / deviation));
  }

  // Noise, jitter of the stamps and a small lateness leave only the mean of a speed that hardly
  // changes. Where the way over the time is the mean velocity, nothing contradicts.
  void compare_means(const Eigen::VectorXd& place) {
    constexpr double kNearlyConstant = 0.3;  // deviation over the mean
    const Eigen::Index n = place.size();
    if (n < kFewestCompared) return;
    const Eigen::VectorXd speed = context_.even.of(velocity_->values);
    const double mean = speed.mean();
    const double deviation = std::sqrt((speed.array() - mean).square().mean());
    if (std::isfinite(mean) && deviation < kNearlyConstant * std::abs(mean)) {
      const double way = place(n - 1) - place(0);
      const double factor = way / (static_cast<double>(n - 1) * context_.step * mean);
      units_ = units_by_rate(factor, position_->words.unit, velocity_->words.unit, motion());
      if (units_.is_found && factor > 0.0) return;
      units_ = {};
    }
    is_no_rate_ = true;
    remarks_.push_back(
        fmt::format("'{}' is not the rate of '{}'", velocity_->name, position_->name));
  }

  // The sample time with which both agree, where the user stated one: a wrong guess of his comes
  // before all else that a ratio may mean.
  [[nodiscard]] std::string by_sample_time() const {
    if (!context_.step_is_stated || !fit_ || !(fit_->factor > 0.0)) return "";
    const Unit *place = find_unit(position_->words.unit), *speed = find_unit(velocity_->words.unit);
    const double ratio = fit_->factor * (place == nullptr ? 1.0 : place->factor) /
                         (speed == nullptr ? 1.0 : speed->factor);
    return fmt::format("with {:.4g} x {:g} s = {:.3g} ms for --sample-time both would agree; else ",
                       ratio, context_.step, 1e3 * ratio * context_.step);
  }

  // Times in ms under a title that says s: the rate is 1000 times the velocity. Asks about it.
  [[nodiscard]] bool is_other_time() {
    const LogTime* const time = context_.time;
    if (time == nullptr || time->column.empty() || time->why == kUserSaid) return false;
    const double rate = std::abs(fit_->factor) * find_unit(position_->words.unit)->factor /
                        find_unit(velocity_->words.unit)->factor;
    const Unit* const stated = find_unit(time->unit);
    if (stated == nullptr || fit_->misfit > kOfTime) return false;
    for (const char* unit : {"s", "ms", "us", "ns"}) {
      const double ratio = rate * stated->factor / find_unit(unit)->factor;
      if (unit == time->unit || std::max(ratio, 1.0 / ratio) > kNearTime) continue;
      ask_time(*time, unit);
      return true;
    }
    return false;
  }

  void ask_time(const LogTime& time, const std::string& unit) {
    OpenQuestion question;
    question.text = fmt::format(
        "'{}' is taken as {}, and the rate of '{}' is then {:.4g} times '{}'. Is the time in {}?",
        time.column, time.unit, position_->name, std::abs(fit_->factor), velocity_->name, unit);
    question.option = fmt::format("--column '{}=time:{}'", time.column, unit);
    for (const std::string& each : {unit, time.unit}) {
      question.choices.push_back({each, {fmt::format("{}=time:{}", time.column, each)}});
    }
    questions_.push_back(question);
  }

  // Nearly the rate, but for what a speed of few counts a sample is wrong by.
  [[nodiscard]] bool is_near_one() const {
    constexpr double kNear = 1.5;
    const double ratio = std::abs(fit_->factor) * find_unit(position_->words.unit)->factor /
                         find_unit(velocity_->words.unit)->factor;
    return ratio < kNear && ratio > 1.0 / kNear;
  }

  // A constant ratio that no other units of the two explain.
  [[nodiscard]] bool is_gear() const {
    constexpr double kSurely = 0.25;  // of the misfit, of ratios that no coarse speed makes
    if (fit_->misfit > (is_near_one() ? kOneRatio : kSurely)) return false;
    return !units_by_rate(fit_->factor, "", velocity_->words.unit, motion()).is_found &&
           !units_by_rate(fit_->factor, position_->words.unit, "", motion()).is_found;
  }

  // Units that fit, and yet not quite. A velocity's noise makes the factor of least squares less by
  // its share of the squares, which is about what they leave.
  void note_factor() {
    constexpr double kQuite = 0.03, kOfNoise = 1.5;
    if (!units_.is_found) return;
    const double quite = std::max(kQuite, kOfNoise * fit_->misfit * fit_->misfit);
    const double ratio = std::abs(fit_->factor) * find_unit(units_.position)->factor /
                         find_unit(units_.velocity)->factor;
    if (std::abs(ratio - 1.0) < quite) return;
    notes_.push_back(
        fmt::format("{}the rate of '{}' is {:.3g} times '{}': a velocity that is scaled, or time "
                    "stamps that are",
                    by_sample_time(), position_->name, ratio, velocity_->name));
  }

  void ask_units() {
    const std::string& unit = position_->words.unit;
    OpenQuestion question;
    question.text = fmt::format(
        "{}'{}' in {} and '{}' in {} don't agree: the rate of the one is {:.4g} times the "
        "other. Which unit is right?",
        by_sample_time(), position_->name, unit, velocity_->name, velocity_->words.unit,
        fit_->factor);
    question.option = fmt::format("--column '{}=position:UNIT' --column '{}=ignore'",
                                  position_->name, velocity_->name);
    for (const MotionUnits& each :
         {units_by_rate(fit_->factor, "", velocity_->words.unit, motion()),
          units_by_rate(fit_->factor, unit, "", motion())}) {
      if (!each.is_found) continue;
      question.choices.push_back({fmt::format("{} and {}", each.position, each.velocity),
                                  {fmt::format("{}=position:{}", position_->name, each.position),
                                   fmt::format("{}=velocity:{}", velocity_->name, each.velocity)}});
    }
    question.choices.push_back(
        {fmt::format("{}, and '{}' is something else", unit, velocity_->name),
         {fmt::format("{}=ignore", velocity_->name)}});
    questions_.push_back(question);
  }

  const LogColumn* position_;
  const LogColumn* velocity_;
  const MotionContext& context_;
  std::optional<RateFit> fit_;
  MotionUnits units_;
  bool is_no_rate_ = false, has_sign_bit_ = false, has_offset_ = false;
  std::vector<std::string> remarks_, notes_;
  std::vector<OpenQuestion> questions_;
};

// Takes the position or the velocity, in its unit.
class MotionUnitChoice {
 public:
  MotionUnitChoice(const LogColumn* position, const LogColumn* velocity,
                   const MotionContext& context, MotionChoice& choice)
      : position_(position),
        velocity_(velocity),
        context_(context),
        choice_(choice),
        rates_(position, velocity, context) {}

  void run() {
    const bool prefers_velocity = rates_.prefers_velocity();
    choice_.notes = rates_.notes();
    choice_.questions = rates_.questions();
    if (position_ == nullptr || prefers_velocity) {
      take_velocity();
    } else if (is_counted(*position_)) {
      take_counts();
    } else {
      take_position();
    }
    note_remarks();
    ask_odd_unit();
  }

 private:
  [[nodiscard]] MotionKind motion() const { return motion_of(position_, velocity_, context_); }

  // What was seen of the two, and once which of them is not used: a velocity by the first of it, a
  // position by the last, which prefers the velocity.
  void note_remarks() {
    std::vector<std::string> remarks = rates_.remarks();
    if (remarks.empty()) return;
    if (choice_.is_velocity) {
      remarks.back() += fmt::format("; '{}' is not used", position_->name);
    } else {
      remarks.front() += ": it is not used";
    }
    choice_.notes.insert(choice_.notes.end(), remarks.begin(), remarks.end());
  }

  void take(const LogColumn* column, bool is_velocity, const std::string& unit,
            const std::string& why) {
    choice_.column = column;
    choice_.is_velocity = is_velocity;
    choice_.unit = unit;
    choice_.unit_reason = why;
    const Unit* known = find_unit(unit);
    choice_.factor = known == nullptr ? 1.0 : known->factor;
    choice_.other = is_velocity ? nullptr : velocity_;
    choice_.rate = is_velocity || !rates_.fit() ? 0.0 : rates_.fit()->factor;
    if (!is_velocity) find_wraps(column, turn_in(unit));
  }

  // Jumps by a turn, or by the range of a counter.
  void find_wraps(const LogColumn* column, double turn) {
    const std::optional<CounterWrap> wrap = find_wrap(column->values, turn);
    choice_.is_wrapped = wrap.has_value();
    if (!wrap || (wrap->period == turn && column->words.unit_factor == 1.0)) return;
    choice_.wrap_period =
        fmt::format(", period: {:.10g}", wrap->period / std::abs(column->words.unit_factor));
  }

  void take_position() {
    const std::string& stated = position_->words.unit;
    if (!stated.empty()) {
      take(position_, false, stated, position_->answered ? "you said so" : "stated");
      doubt_angle();
      if (rates_.units().is_found) {
        choice_.unit_reason += rates_.has_offset() ? ", and the velocity agrees but for its offset"
                                                   : ", and the velocity agrees";
      }
    } else if (rates_.units().is_found) {
      take(position_, false, rates_.units().position, rates_.units().why);
    } else if (const std::optional<EncoderSteps> steps = encoder_steps(); steps) {
      take(position_, false, steps->unit, fmt::format("steps of {}", steps->step));
    } else if (motion() == MotionKind::kRotary && span_of(*position_) > kRadiansOpen) {
      ask_unit(position_, "position", {"rad", "deg"});
      take(position_, false, "rad", "open");
    } else if (motion() == MotionKind::kRotary && lies_beyond_radians(*position_)) {
      ask_unit(position_, "position", {"deg", "rad"});
      take(position_, false, "rad", "open");
    } else {
      take(position_, false, si_unit(false, motion()), "guessed: no unit is stated");
    }
  }

  // What the steps of an angle tell, where its title has no unit.
  [[nodiscard]] std::optional<EncoderSteps> encoder_steps() const {
    const ColumnWords& words = position_->words;
    if (motion() != MotionKind::kRotary || !words.odd_unit.empty()) return {};
    return find_encoder_steps(without_gaps(position_->values));
  }

  // Whole or quarter numbers over thousands of radians: counts of an encoder that are called rad.
  void doubt_angle() {
    if (position_->words.unit != "rad" || !looks_counted(*position_)) return;
    const std::string what = fmt::format(
        "'{}' goes in whole steps through {:.3g} rad, {:.3g} turns: are these counts of an encoder",
        position_->name, span_of(*position_), span_of(*position_) / kTurn);
    const std::string counts =
        fmt::format("--column '{}=position:counts' --counts-per-turn N", position_->name);
    if (position_->answered) {
      choice_.notes.push_back(fmt::format("{}? Then say {}", what, counts));
      return;
    }
    OpenQuestion question;
    question.text = what + ", or radians?";
    question.option = fmt::format("{}, or --column '{}=position:rad'", counts, position_->name);
    question.choices = {{"counts", {position_->name + "=position:counts"}},
                        {"rad", {position_->name + "=position:rad"}}};
    choice_.questions.push_back(question);
  }

  void take_velocity() {
    const std::string& stated = velocity_->words.unit;
    if (!stated.empty()) {
      take(velocity_, true, stated, velocity_->answered ? "you said so" : "stated");
    } else if (rates_.units().is_found) {
      take(velocity_, true, rates_.units().velocity, rates_.units().why);
    } else if (motion() == MotionKind::kRotary && span_of(*velocity_) > kSpeedOpen) {
      ask_unit(velocity_, "velocity", {"rad/s", "rpm", "deg/s"});
      take(velocity_, true, "rad/s", "open");
    } else {
      take(velocity_, true, si_unit(true, motion()), "guessed: no unit is stated");
    }
  }

  // A title with a unit that the motion can't have.
  void ask_odd_unit() {
    const LogColumn* column = choice_.column;
    if (column == nullptr || column->words.odd_unit.empty()) return;
    std::vector<std::string> units = choice_.is_velocity
                                         ? std::vector<std::string>{"rad/s", "rpm", "deg/s"}
                                         : std::vector<std::string>{"rad", "deg"},
                             linear = choice_.is_velocity ? std::vector<std::string>{"m/s", "mm/s"}
                                                          : std::vector<std::string>{"m", "mm"};
    if (motion() == MotionKind::kLinear) std::swap(units, linear);
    units.insert(units.end(), linear.begin(), linear.end());
    choice_.questions.push_back(
        question_of_unit(*column, choice_.is_velocity ? "velocity" : "position", units));
  }

  // Steps along a line: how long one is the velocity says, or the user.
  void take_linear_counts() {
    const bool has_speed = velocity_ != nullptr && !velocity_->words.unit.empty() && rates_.fit();
    if (velocity_ != nullptr && !has_speed && !rates_.doubts_velocity()) return take_velocity();
    if (has_speed) {
      choice_.factor = find_unit(velocity_->words.unit)->factor / std::abs(rates_.fit()->factor);
      const double length = choice_.factor;
      take(position_, false, "counts",
           fmt::format("{:.4g} m a count, from '{}'", length, velocity_->name));
      choice_.gain =
          fmt::format("{{value: {:.8g}, unit: m/counts}}", length * position_->words.unit_factor);
      choice_.factor = length;
    } else {
      take(position_, false, "counts", "# ANSWER: m for one count?");
      OpenQuestion question;
      question.kind = OpenQuestion::Kind::kInFile;
      question.text = fmt::format("How long is one count of '{}'?", position_->name);
      question.option = fmt::format("--column '{}=position:1e-6 m', say", position_->name);
      choice_.questions.push_back(question);
      choice_.gain = "{value: ANSWER, unit: m/counts}";
    }
    find_wraps(position_, 0.0);
  }

  // What a velocity tells, and the number that encoders have where it is as near as that tells.
  [[nodiscard]] static std::string words_of_counts(double told, const std::string& velocity) {
    const std::optional<double> usual = counts_of_encoders(told);
    if (!usual) return fmt::format("{:.4g} counts a turn, from '{}'", told, velocity);
    return fmt::format("{:.0f} counts a turn, as encoders have: from '{}' it is {:.5g}", *usual,
                       velocity, told);
  }

  void take_counts() {
    if (motion() == MotionKind::kLinear && !context_.counts_per_turn) return take_linear_counts();
    double count = context_.counts_per_turn ? kTurn / *context_.counts_per_turn : 0.0;
    std::string why = fmt::format("{:g} counts a turn, as you said", kTurn / count);
    const bool has_speed = velocity_ != nullptr && !velocity_->words.unit.empty() && rates_.fit();
    if (count == 0.0 && has_speed) {
      count = find_unit(velocity_->words.unit)->factor / std::abs(rates_.fit()->factor);
      why = words_of_counts(kTurn / count, velocity_->name);
      if (const auto usual = counts_of_encoders(kTurn / count)) count = kTurn / *usual;
    }
    if (count == 0.0 && velocity_ != nullptr && !rates_.doubts_velocity()) {
      choice_.notes.push_back(
          fmt::format("'{}' counts steps of unknown size: '{}' is used (or say --counts-per-turn)",
                      position_->name, velocity_->name));
      return take_velocity();
    }
    take(position_, false, "counts", why);
    if (count == 0.0) {
      choice_.questions.push_back(
          {OpenQuestion::Kind::kCountsPerTurn,
           fmt::format("How many counts of '{}' are a turn?", position_->name),
           "--counts-per-turn N",
           {}});
      choice_.unit_reason = "# ANSWER: rad for one count?";
    }
    choice_.gain = count == 0.0 ? "{value: ANSWER, unit: rad/counts}"
                                : fmt::format("{{value: {:.8g}, unit: rad/counts}}",
                                              count * position_->words.unit_factor);
    choice_.factor = count == 0.0 ? 1.0 : count;
    find_wraps(position_, 0.0);
  }

  void ask_unit(const LogColumn* column, const char* quantity,
                std::initializer_list<const char*> units) {
    if (!column->words.odd_unit.empty()) return;  // it is asked below
    OpenQuestion question;
    const Eigen::VectorXd values = without_gaps(column->values);
    const std::string size =
        span_of(*column) > kRadiansOpen
            ? fmt::format("spans {:.3g}", span_of(*column))
            : fmt::format("lies between {:.3g} and {:.3g}", values.minCoeff(), values.maxCoeff());
    question.text = fmt::format("'{}' {} and has no unit: which is it?", column->name, size);
    question.option = fmt::format("--column '{}={}:{}'", column->name, quantity, *units.begin());
    for (const char* unit : units) {
      question.choices.push_back({unit, {fmt::format("{}={}:{}", column->name, quantity, unit)}});
    }
    choice_.questions.push_back(question);
  }

  const LogColumn* position_;
  const LogColumn* velocity_;
  const MotionContext& context_;
  MotionChoice& choice_;
  RateComparison rates_;
};

// One of several positions stands for all until it is answered which: of stated counts a turn the
// first that counts.
MotionChoice open_position(const std::vector<const LogColumn*>& rivals,
                           const MotionContext& context) {
  MotionChoice choice;
  choice.column = rivals.front();
  choice.unit = si_unit(false, context.motion);
  const auto counted =
      std::ranges::find_if(rivals, [](const LogColumn* each) { return is_counted(*each); });
  if (context.counts_per_turn && counted != rivals.end()) {
    MotionUnitChoice(*counted, nullptr, context, choice).run();
  }
  choice.questions.insert(choice.questions.begin(), which_of(rivals, "measured position"));
  return choice;
}

// A position along a line beside an angle that does not move in step with it: a cart and its
// pendulum. Or the other way round.
bool are_two_axes(const LogColumn& chosen, const LogColumn& other) {
  constexpr double kInStep = 0.99;  // correlation
  const MotionKind one = chosen.words.motion, another = other.words.motion;
  return one != MotionKind::kOpen && another != MotionKind::kOpen && one != another &&
         !other.words.is_filtered && !is_wanted(other) && !is_guessed_switch(other) &&
         std::abs(correlation(chosen.values, other.values)) < kInStep;
}

// The question whether another axis is meant, which the drive moves more than the chosen one.
std::optional<MotionChoice> open_axis(const std::vector<const LogColumn*>& columns,
                                      const LogColumn& chosen, const MotionContext& context) {
  if (context.drive == nullptr || chosen.answered) return {};
  const auto follows = [&](const LogColumn& column) {
    return std::abs(
        follows_at_once(without_gaps(context.drive->values), without_gaps(column.values), false));
  };
  const double of_chosen = follows(chosen);
  for (const LogColumn* other : moving_columns(columns, LogQuantity::kPosition)) {
    if (!are_two_axes(chosen, *other)) continue;
    const double of_other = follows(*other);
    if (!(of_other > of_chosen)) continue;
    MotionChoice choice = open_position({other, &chosen}, context);
    choice.questions.front().text += fmt::format(
        " The drive moves '{}' more: the correlation with its acceleration is {:.2f}, with that of "
        "'{}' {:.2f}",
        other->name, of_other, chosen.name, of_chosen);
    return choice;
  }
  return {};
}

}  // namespace

Eigen::VectorXd MotionChoice::values(const LogRecording& recording) const {
  const Eigen::VectorXd recorded = without_gaps(recording.at(column->file, column->name).values);
  // In the column's unit, as LogColumn::values: a factor of it is in them already.
  if (!is_wrapped) return factor * recorded;
  return factor * without_wraps(recorded, unit == "counts" ? 0.0 : turn_in(unit)).first;
}

OpenQuestion which_of(const std::vector<const LogColumn*>& columns, const std::string& what) {
  OpenQuestion question;
  question.text = fmt::format("Which is the {}: {}?", what, names_of(columns));
  for (const LogColumn* chosen : columns) {
    AnswerChoice choice{chosen->name, {}};
    for (const LogColumn* other : columns) {
      if (other != chosen) choice.columns.push_back(other->name + "=ignore");
    }
    question.choices.push_back(std::move(choice));
  }
  question.option = fmt::format("--column '{}=ignore', say", columns.back()->name);
  return question;
}

OpenQuestion question_of_unit(const LogColumn& column, const std::string& quantity,
                              const std::vector<std::string>& units) {
  OpenQuestion question;
  question.text =
      fmt::format("{}: column '{}': '{}' is no unit of a {} that is known ({}): which unit has it?",
                  column.file_name, column.name, column.words.odd_unit, quantity,
                  known_units_of(column.words.quantity));
  question.about = column.name;
  question.option = fmt::format("--column '{}={}:{}', say; a factor before it: '{}:0.1 {}'",
                                column.name, quantity, units.front(), quantity, units.front());
  if (drives(column.words.quantity)) {
    question.option += fmt::format(
        "; any unit will do for a drive, also a share of what it is rated for: '{}:%'", quantity);
  }
  for (const std::string& unit : units) {
    question.choices.push_back({unit, {fmt::format("{}={}:{}", column.name, quantity, unit)}});
  }
  return question;
}

MotionChoice choose_motion(const std::vector<const LogColumn*>& columns,
                           const MotionContext& context) {
  MotionChoice choice;
  const ColumnChoice position = choose_measured(columns, LogQuantity::kPosition);
  const ColumnChoice velocity = choose_measured(columns, LogQuantity::kVelocity);
  if (!position.rivals.empty()) return open_position(position.rivals, context);
  if (position.column == nullptr && !velocity.rivals.empty()) {
    choice.questions.push_back(which_of(velocity.rivals, "measured velocity"));
    choice.column = velocity.rivals.front();
    choice.is_velocity = true;
    choice.unit = si_unit(true, context.motion);
    return choice;
  }
  if (position.column == nullptr && velocity.column == nullptr) return choice;
  if (position.column != nullptr) {
    if (const auto open = open_axis(columns, *position.column, context); open) return *open;
  }
  MotionUnitChoice(position.column, velocity.column, context, choice).run();
  choice.reason = choice.is_velocity ? velocity.reason : position.reason;
  return choice;
}

}  // namespace graybox
