#include "diagnosis/prediction_verdict/prediction_reasons.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "diagnosis/evidence/holding_friction.hpp"
#include "diagnosis/evidence/trend_reason.hpp"
#include "diagnosis/evidence/verdict_reasons.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr const char* kAbsurdTest = "parameters and laws that no machine has";
constexpr const char* kLawsTest = "laws found";
constexpr const char* kFittedTest = "error on the recordings of the fit";
constexpr const char* kHeldOutTest = "error kept out";
constexpr double kHeldOutLimit = 15.0;                     // % of the signal
constexpr double kNoiseLimit = 1.5;                        // times the noise
constexpr double kRoundedLimit = 2.0 * kHeldOutLimit;      // where the sensor counts
constexpr double kForeseen = 0.5 * kHeldOutLimit;          // of that, by what is left alone
constexpr double kGrowthLimit = 1.5, kGrowthErrors = 2.0;  // and its standard errors
constexpr double kNotSmall = 1.0;                          // % of the signal
constexpr double kSmallError = 3.0;        // % of the signal, which may grow from less
constexpr double kMostGrowthOfNone = 5.0;  // of such an error, where nothing is missing
constexpr double kWholeLimit = 50.0;       // % of the signal
constexpr double kSmallForce = 5.0;        // % of the forces that act: as good as nothing
constexpr double kAsGivenLimit = 2.0;
constexpr double kStructureLimit = 3.0;  // % of the forces that act
constexpr double kRestLimit = 15.0;      // % of them

bool is_stiffness(const std::string& unit) { return unit == "N/m" || unit == "N m/rad"; }

VerdictReason test(std::string name, std::optional<double> value, double limit, bool passed,
                   std::string next, Verdict otherwise = Verdict::kUnknown) {
  VerdictReason reason;
  reason.test = std::move(name);
  reason.value = value;
  reason.limit = limit;
  reason.passed = passed;
  reason.otherwise = otherwise;
  if (!passed) reason.next = std::move(next);
  if (reason.next.ends_with('.')) reason.next.pop_back();
  return reason;
}

std::string advice_on(const LatentStructure& structure) {
  if (structure.on == kOfRecording) {
    return "look for what differs between the recordings, as a load, a zero or a temperature, "
           "and diagnose those that are alike by themselves";
  }
  return fmt::format("look for a law that depends on {}, and try laws of your own there (--laws)",
                     structure.words);
}

std::string advice_on_force(double share, const Diagnosis& diagnosis, bool has_drive) {
  constexpr double kAll = 100.0;  // % of the forces that act
  if (share > kAll && !has_drive) {
    return "look first whether nothing drives: a motor that holds, a hand, a controller that is "
           "still on; and whether the sensor's unit and zero are right";
  }
  if (share > kAll) {
    return "look first whether the drive's channel is the force that acts on the machine: its "
           "unit, gain and sign, and what else pushes";
  }
  if (diagnosis.effects.empty()) {
    return "look at when this force is largest: at a position, a speed, a turn of the command; "
           "then try masses, springs and laws of your own there (--laws)";
  }
  return "record what may disturb the machine (temperature, supply, floor, hoses)";
}

void add_plausibility(const Diagnosis& diagnosis, std::vector<VerdictReason>& list) {
  const std::size_t absurd = excluding(diagnosis.implausible);
  list.push_back(test(kAbsurdTest, static_cast<double>(absurd), 0.0, absurd == 0,
                      absurd > 0 ? diagnosis.implausible.front().remedy : ""));
}

// This asks for what a machine must have: damping and friction may vanish.
void add_determination(const Diagnosis& diagnosis, Verdict otherwise,
                       std::vector<VerdictReason>& list) {
  const auto must_be_there = [&](const Implausibility& flaw) {
    if (flaw.rule != PlausibilityRule::kZero) return true;
    return std::ranges::any_of(
        diagnosis.after.model_parameters, [&](const LawParameterEstimate& parameter) {
          return parameter.name == flaw.quantity &&
                 (parameter.unit.starts_with("kg") || is_stiffness(parameter.unit));
        });
  };
  std::size_t count = 0;
  std::string remedy;
  for (const Implausibility& flaw : diagnosis.implausible) {
    if (flaw.excludes || !must_be_there(flaw)) continue;
    ++count;
    remedy = flaw.remedy;
    // A force several times what ever acted is no explanation, however large its error.
    if (flaw.rule == PlausibilityRule::kSize) otherwise = Verdict::kUnknown;
  }
  list.push_back(test("masses and springs that are not determined", static_cast<double>(count), 0.0,
                      count == 0, remedy, otherwise));
}

}  // namespace

// The whole of each recording is foretold within half a step of each sensor, kept-out ones
// included: rounding is no white noise (at rest it stays), and is all that is left.
bool PredictionReasons::is_within_a_step() const {
  const JudgedModel& found = from_.final->found();
  if (found.horizon != 0 || !found.fit.usable) return false;
  for (Index j = 0; j < from_.data->output_count(); ++j) {
    const double most = 0.5 * from_.data->rounding_step(j);
    if (!(found.error(j) <= most)) return false;
    if (found.held_out_error && !((*found.held_out_error)(j) <= most)) return false;
  }
  return true;
}

// What moves an encoder by about a step, or by next to nothing, is a small force, or none: rounded
// positions, differentiated twice, look like a large one.
bool PredictionReasons::is_hidden_by_rounding() const {
  constexpr double kSteps = 1.5;
  const JudgedModel& found = from_.final->found();
  if (found.horizon != 0 || !found.fit.usable) return false;
  for (Index j = 0; j < from_.data->output_count(); ++j) {
    const double step = from_.data->rounding_step(j);
    const double most = std::max(kSteps * step, 0.01 * kSmallError * from_.data->output_scale()(j));
    if (!(step > 0.0) || !(found.error(j) <= most)) return false;
    if (found.held_out_error && !((*found.held_out_error)(j) <= most)) return false;
  }
  return true;
}

// The whole of each recording is foretold but for next to nothing: what force that takes does not
// matter, since rounded or noisy positions, differentiated twice, look like a large one.
bool PredictionReasons::is_next_to_nothing() const {
  const JudgedModel& found = from_.final->found();
  if (found.horizon != 0 || !found.fit.usable) return false;
  for (Index j = 0; j < from_.data->output_count(); ++j) {
    if (!(100.0 * found.error(j) <= kNotSmall * from_.data->output_scale()(j))) return false;
    if (!found.held_out_error) continue;
    if (!(100.0 * (*found.held_out_error)(j) <= kNotSmall * found.held_out_scale(j))) return false;
  }
  return true;
}

bool PredictionReasons::leaves_force() const {
  const UnmodelledForce& rest = from_.final->rest();
  return rest.force() != nullptr && 100.0 * rest.share() > kSmallForce;
}

bool PredictionReasons::is_without_structure() const {
  return 100.0 * from_.final->rest().structured_share() <= kStructureLimit;
}

bool PredictionReasons::is_disturbance() const {
  const UnmodelledForce& rest = from_.final->rest();
  if (rest.multiple_of_noise() <= kNoiseMultiple || is_within_a_step()) return true;
  return rest.multiple_of_rest() <= kNoiseMultiple &&
         100.0 * rest.structured_share() <= kStructureLimit && 100.0 * rest.share() <= kSmallForce;
}

// Noise that is read from differences may be motion, and excuses nothing; steps of an encoder do so
// much and no more.
double PredictionReasons::limit_of_error(Index output, double scale) const {
  const double step = from_.data->rounding_step(output);
  double deviation = from_.data->noise()(output);
  if (!from_.data->states_noise(output) && step > 0.0) deviation = std::min(deviation, step);
  const double noise = 100.0 * kNoiseLimit * deviation / scale;
  if (from_.data->states_noise(output)) return std::max(kHeldOutLimit, noise);
  const double most = from_.data->is_rounded(output) ? kRoundedLimit : kHeldOutLimit;
  return std::max(kHeldOutLimit, std::min(noise, most));
}

bool PredictionReasons::has_stated_noise() const {
  for (Index j = 0; j < from_.data->output_count(); ++j) {
    if (!from_.data->states_noise(j)) return false;
  }
  return true;
}

void PredictionReasons::add_held_out(std::vector<VerdictReason>& list) const {
  const JudgedModel& found = from_.final->found();
  const std::string whole = fmt::format("{}, % of the signal", kHeldOutTest);
  if (!found.held_out_error && !found.held_out_trouble.empty()) {
    list.push_back(test(fmt::format("{} ({})", whole, found.held_out_trouble), {}, kHeldOutLimit,
                        false, "put recordings like those kept out into the fit"));
    return;
  }
  if (!found.held_out_error) {
    VerdictReason reason = test(whole, {}, kHeldOutLimit, true, "");
    reason.not_tested = "no recordings were kept out of the fit";
    list.push_back(std::move(reason));
    return;
  }
  const auto limits = [&](Index j) { return limit_of_error(j, found.held_out_scale(j)); };
  const auto percent = [&](const VectorXd& error, Index j) {
    return 100.0 * error(j) / found.held_out_scale(j);
  };
  HeldOutError judged{found.horizon, *found.held_out_error};
  for (Index j = 0; j < from_.data->output_count(); ++j) {
    if (percent(judged.error, j) <= limits(j)) continue;
    // Nobody foresees a disturbance: as far ahead as it matters little.
    const auto ahead = from_.final->held_out_ahead(found, kForeseen / 100.0);
    if (ahead) judged = *ahead;
    break;
  }
  const std::string ahead =
      judged.horizon == 0 ? "in free run"
                          : fmt::format("{:.3g} s ahead", static_cast<double>(judged.horizon) *
                                                              from_.data->sample_time());
  for (Index j = 0; j < from_.data->output_count(); ++j) {
    const double error = percent(judged.error, j), limit = limits(j);
    list.push_back(
        test(fmt::format("{} of {} {}, % of its signal{}", kHeldOutTest,
                         from_.stated->output_names[static_cast<std::size_t>(j)], ahead,
                         found.stands_held_out[static_cast<std::size_t>(j)]
                             ? " in the fit (kept out it stands still within its noise)"
                             : ""),
             error, limit, error <= limit,
             "put recordings like those kept out into the fit, and look at when the error is "
             "largest"));
  }
}

// A model that leaves much of the motion of the fit is no good one, whatever laws were tried.
void PredictionReasons::add_fitted(std::vector<VerdictReason>& list) const {
  constexpr double kTimes = 3.0;
  const JudgedModel& found = from_.final->found();
  if (found.horizon != 0) return;
  for (Index j = 0; j < from_.data->output_count(); ++j) {
    const double scale = from_.data->output_scale()(j);
    const double error = 100.0 * found.error(j) / scale;
    const double limit = limit_of_error(j, scale);
    list.push_back(
        test(fmt::format("{} of {} in free run, % of its signal", kFittedTest,
                         from_.stated->output_names[static_cast<std::size_t>(j)]),
             error, limit, error <= limit,
             "look at when this error is largest; try laws of your own (--laws), and record more"));
    if (!found.held_out_error) continue;
    const double kept_out = 100.0 * (*found.held_out_error)(j) / found.held_out_scale(j);
    const double most = std::max(kTimes * error, kNotSmall);
    list.push_back(test(
        fmt::format("{} of {} in free run, where the fit leaves {:.3g} %, % of its signal",
                    kHeldOutTest, from_.stated->output_names[static_cast<std::size_t>(j)], error),
        kept_out, most, kept_out <= most,
        "put recordings like those kept out into the fit, and look at when the error is largest"));
  }
}

// A law that raises an error which is small all the same may be right.
void PredictionReasons::add_misleading(const Diagnosis& diagnosis,
                                       std::vector<VerdictReason>& list) const {
  if (!from_.final->found().held_out_error) return;
  const auto misleading = std::ranges::count_if(diagnosis.effects, is_not_confirmed);
  list.push_back(test("laws found that raise the error kept out", static_cast<double>(misleading),
                      0.0, misleading == 0,
                      "leave them out (--without), or put recordings like those kept out into "
                      "the fit"));
}

// Errors add up in a position that nothing holds, and a force that nobody foresees carries it away.
// Where that is most of the motion, though, nothing is explained.
void PredictionReasons::add_whole_held_out(const Diagnosis& diagnosis,
                                           std::vector<VerdictReason>& list) const {
  if (!diagnosis.validation_after) return;
  const double error = diagnosis.validation_after->nrmse;
  double limit = kWholeLimit;
  for (Index j = 0; j < from_.data->output_count(); ++j) {
    limit = std::max(limit, limit_of_error(j, from_.final->found().held_out_scale(j)));
  }
  const Index horizon = from_.final->found().horizon;
  const std::string over =
      horizon == 0 ? "over a whole recording"
                   : fmt::format("{:.3g} s ahead, where the fit was judged",
                                 static_cast<double>(horizon) * from_.data->sample_time());
  list.push_back(test(fmt::format("{} {}, % of the signal", kHeldOutTest, over), error, limit,
                      error <= limit,
                      "something pushes for long that no law found describes: look at when the "
                      "error begins to grow"));
}

// Over so short windows anything is foretold.
void PredictionReasons::add_whole_run(std::vector<VerdictReason>& list) const {
  const double left = 100.0 * from_.final->rest().unexpected_in_the_end();
  list.push_back(test("error over a whole recording, beyond what noise leaves, % of the signal",
                      left, kWholeLimit, left <= kWholeLimit,
                      "record longer: what is missing shows only in time"));
}

void PredictionReasons::add_growth(double most_of_small, std::vector<VerdictReason>& list) const {
  const std::string name =
      "growth of the error from the recordings of the fit to those kept out, beyond that of the "
      "signals";
  const std::optional<HeldOutGrowth> growth = from_.final->growth();
  if (!growth) {
    VerdictReason reason = test(name, {}, kGrowthLimit, true, "");
    const JudgedModel& found = from_.final->found();
    reason.not_tested = found.held_out_error ? "the force left hides it at every horizon"
                        : !found.held_out_trouble.empty()
                            ? found.held_out_trouble
                            : "no recordings were kept out of the fit";
    list.push_back(std::move(reason));
    return;
  }
  Index worst = 0;
  const double most = growth->ratio.maxCoeff(&worst);
  const bool is_chance = std::log(most) < kGrowthErrors * growth->deviation(worst);
  const std::string& channel = from_.stated->output_names[static_cast<std::size_t>(worst)];
  const JudgedModel& found = from_.final->found();
  const double kept_out = (*found.held_out_error)(worst) / found.held_out_scale(worst);
  const bool is_small = 100.0 * kept_out <= kSmallError && most <= most_of_small;
  const char* excuse = "";
  if (most > kGrowthLimit && is_chance) excuse = "; chance explains it";
  if (most > kGrowthLimit && is_small) excuse = "; it is small all the same";
  list.push_back(test(
      fmt::format("{} ({}{})", name, channel, excuse), most, kGrowthLimit,
      most <= kGrowthLimit || is_chance || is_small,
      "put recordings like those kept out into the fit: the laws found do not hold there as they "
      "hold in it"));
}

void PredictionReasons::add_against_as_given(const Diagnosis& diagnosis,
                                             std::vector<VerdictReason>& list) const {
  const bool has_laws = !diagnosis.effects.empty() || !diagnosis.late_channels.empty();
  if (!has_laws || !diagnosis.validation_before || !diagnosis.validation_after) return;
  const double ratio = diagnosis.validation_after->nrmse / diagnosis.validation_before->nrmse;
  // Where errors add up, a disturbance may make a poor model the better one by chance.
  const double limit = from_.findings->has_free_run ? 1.0 : kAsGivenLimit;
  list.push_back(test("error kept out over that of the model as given", ratio, limit,
                      ratio <= limit,
                      "the laws found do not help where they were not fitted: put recordings "
                      "like those kept out into the fit"));
}

// A delay of less than a row may be how rows were written: drive and motion are read one after the
// other, and a drive between two rows is a guess. Beside a small error it is told all the same.
void PredictionReasons::add_short_delay(const Diagnosis& diagnosis,
                                        std::vector<VerdictReason>& list) const {
  double longest = 0.0;
  for (const FoundEffect& effect : diagnosis.effects) {
    if (from_.hypotheses->hypotheses()[effect.law.hypothesis].law != "delay") return;
    longest = std::max(longest, effect.law.parameters.front().value);
  }
  const double row = from_.data->recorded_sample_time();
  const double left = 100.0 * relative_size(from_.final->found().error, from_.data->output_scale());
  if (diagnosis.effects.empty() || longest >= row || left <= kSmallError) return;
  VerdictReason reason =
      test("longest delay found, where that is all, over the time from row to row", longest / row,
           1.0, false,
           "record faster, or with the time at which each channel was read: a row whose channels "
           "are read one after the other shows such a delay, too",
           Verdict::kAmbiguous);
  reason.is_lower_limit = true;
  list.push_back(std::move(reason));
}

// Where the noise of the sensors alone accounts for the errors, nothing else is asked.
void PredictionReasons::add_rest(const Diagnosis& diagnosis,
                                 std::vector<VerdictReason>& list) const {
  const UnmodelledForce& rest = from_.final->rest();
  const double of_noise = rest.multiple_of_noise();
  if (of_noise <= kNoiseMultiple || rest.force() == nullptr) {
    list.push_back(test("rest over what the noise of the sensors leaves, most of all horizons",
                        of_noise, kNoiseMultiple, of_noise <= kNoiseMultiple,
                        "a disturbance, or physics that none of these laws describes: look at "
                        "which channel and when it is largest"));
    return;
  }
  const double structured = 100.0 * rest.structured_share(), share = 100.0 * rest.share();
  const LatentStructure* const structure = rest.structure();
  list.push_back(
      test(structure == nullptr
               ? std::string("force left that depends on the motion, % of the forces that act")
               : fmt::format("force left that depends on {}, % of the forces that act",
                             structure->words),
           structured, kStructureLimit, structured <= kStructureLimit,
           structure == nullptr ? std::string() : advice_on(*structure)));
  const std::string place =
      from_.stated->mass_names[static_cast<std::size_t>(rest.force()->disturbance.coordinate)];
  const char* excuse = "";
  if (share > kRestLimit && is_next_to_nothing()) excuse = "; the motion that it makes is small";
  if (share > kRestLimit && is_hidden_by_rounding()) excuse = "; the encoder's steps hide it";
  const bool is_excused = *excuse != '\0';
  list.push_back(test(fmt::format("{} {}, % of the forces that act{}", kForceTest, place, excuse),
                      share, kRestLimit, share <= kRestLimit || is_excused,
                      advice_on_force(share, diagnosis, !from_.data->moves_freely())));
  const double multiple = rest.multiple_of_rest();
  list.push_back(
      test("rest over what the sensors' noise and that force leave, most of all horizons", multiple,
           kNoiseMultiple, multiple <= kNoiseMultiple,
           "more than one disturbance, or physics that none of these laws describes: look at which "
           "channel and when it is largest"));
}

std::vector<VerdictReason> PredictionReasons::of_nothing_missing(
    const Diagnosis& diagnosis, std::vector<VerdictReason> list) const {
  add_held_out(list);
  add_growth(kMostGrowthOfNone, list);
  add_fitted(list);
  list.push_back(sizes_hold_reason(diagnosis));
  // Who can't tell masses and springs can't miss anything.
  add_determination(diagnosis, Verdict::kUnknown, list);
  if (!from_.data->has_validation() && !has_stated_noise()) {
    list.push_back(nothing_kept_out(Verdict::kUnknown));
  }
  add_whole_run(list);
  if (std::ranges::any_of(list, has_failed)) return list;
  list.push_back(test("something is missing", {}, 0.0, false,
                      "nothing: the model as it is will do for motion like the recorded one",
                      Verdict::kNone));
  return list;
}

std::vector<VerdictReason> PredictionReasons::of(const Diagnosis& diagnosis) const {
  std::vector<VerdictReason> list;
  if (diagnosis.interrupted) {
    list.push_back(test("the search came to its end", {}, 0.0, false,
                        "give it more time (--time-limit) or more threads"));
  }
  add_plausibility(diagnosis, list);
  if (!diagnosis.detection.detected && diagnosis.interrupted) return list;
  if (!diagnosis.detection.detected) return of_nothing_missing(diagnosis, std::move(list));
  const auto laws = static_cast<double>(diagnosis.effects.size());
  VerdictReason found = test(kLawsTest, laws, 1.0, laws >= 1.0,
                             "check units, signs and the motion that was recorded, and try laws "
                             "of your own (--laws)");
  found.is_lower_limit = true;
  list.push_back(std::move(found));
  add_misleading(diagnosis, list);
  add_held_out(list);
  add_whole_held_out(diagnosis, list);
  if (!diagnosis.validation_after) add_whole_run(list);
  add_growth(std::numeric_limits<double>::infinity(), list);
  add_against_as_given(diagnosis, list);
  add_rest(diagnosis, list);
  if (auto holds = holding_reason(diagnosis.checked)) list.push_back(*std::move(holds));
  VerdictReason sizes = sizes_hold_reason(diagnosis);
  sizes.otherwise = Verdict::kAmbiguous;
  list.push_back(std::move(sizes));
  // The first that fails decides, and this may say `ambiguous`.
  if (laws > 0.0) {
    list.push_back(
        trend_reason(diagnosis.trends, diagnosis.effects, "the recordings are one window each"));
  }
  add_determination(diagnosis, Verdict::kAmbiguous, list);
  if (VerdictReason told = told_reason(diagnosis); told.value) list.push_back(std::move(told));
  add_short_delay(diagnosis, list);
  if (!from_.data->has_validation()) list.push_back(nothing_kept_out());
  std::size_t rivals = 0;
  for (const FoundEffect& effect : diagnosis.effects) rivals += effect.rivals.size();
  list.push_back(test("other explanations that are not excluded", static_cast<double>(rivals), 0.0,
                      rivals == 0, "add a sensor, or record larger and faster motion",
                      Verdict::kAmbiguous));
  return list;
}

VerdictReason told_reason(const Diagnosis& diagnosis) {
  constexpr double kTold = 3.0;   // standard errors
  constexpr double kMuch = 0.75;  // of the squared error kept out
  double least = std::numeric_limits<double>::infinity();
  for (const FoundEffect& effect : diagnosis.effects) {
    if (!effect.held_out || effect.held_out->gain >= kMuch) continue;
    double surest = 0.0;
    for (const LawParameterEstimate& each : effect.law.parameters) {
      if (each.sets_scale || !(each.error() > 0.0) || !std::isfinite(each.error())) continue;
      surest = std::max(surest, std::abs(each.value) / each.error());
    }
    if (surest > 0.0) least = std::min(least, surest);
  }
  VerdictReason reason = test(
      "the law found that is told least, standard errors from none",
      std::isfinite(least) ? std::optional(least) : std::nullopt, kTold, !(least < kTold),
      "record more of the motion in which it shows, and what else may look like it: a channel that "
      "is late, a constant force",
      Verdict::kAmbiguous);
  reason.is_lower_limit = true;
  return reason;
}

std::string doubt_about(const Diagnosis& diagnosis, std::span<const Hypothesis> hypotheses) {
  if (diagnosis.interrupted || diagnosis.verdict != Verdict::kUnknown) return "";
  for (const FoundEffect& effect : diagnosis.effects) {
    if (hypotheses[effect.law.hypothesis].law == "rectifier") return "";
  }
  for (const VerdictReason& reason : diagnosis.reasons) {
    if (!has_failed(reason)) continue;
    const bool is_decisive =
        reason.test.starts_with(kAbsurdTest) || reason.test.starts_with(kLawsTest) ||
        reason.test.starts_with(kForceTest) || reason.test.starts_with(kHeldOutTest);
    if (is_decisive) return reason.test;
  }
  return "";
}

}  // namespace graybox
