// A verdict is computed from its reasons, and from nothing else.
#include "diagnosis/evidence/verdict_reasons.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "diagnosis/prediction_verdict/prediction_reasons.hpp"
#include "diagnosis/verdict/reason_words.hpp"
#include "diagnosis/verdict/report_tables.hpp"
#include "diagnosis/verdict/verdict_words.hpp"

namespace graybox {
namespace {

const std::vector<Hypothesis> kHypotheses = {
    {"carriage.arm", "{kind: element, joint: carriage, axis: arm}", "coulomb", {}}};

// Explained, where the noise is not known.
Diagnosis friction() {
  Diagnosis diagnosis;
  diagnosis.detection.detected = true;
  diagnosis.detection.smallest_p_value = 1e-9;
  diagnosis.before.usable = diagnosis.after.usable = true;
  diagnosis.after.estimation = {1000.0, 1000.0, 3.0, 99.9};
  diagnosis.validation_before = Assessment{9000.0, 1000.0, 60.0, 64.0};
  diagnosis.validation_after = Assessment{1200.0, 1000.0, 3.3, 99.8};
  diagnosis.remaining_structure = 0.02;
  diagnosis.autocorrelated_error = 1.0;
  FoundEffect effect;
  effect.law = {0, {{"level", "N", 8.0, 0.1}}};
  effect.held_out = HeldOutEffect{60.0, 3.3, 0.9};
  diagnosis.effects = {effect};
  diagnosis.after.laws = {effect.law};
  diagnosis.channels_after = {{"torque of arm", 3.0, 0.02, 1.0, 3.3},
                              {"torque of wrist", 8.0, 0.02, 1.0, 9.0}};
  return diagnosis;
}

Diagnosis friction_in_known_noise() {
  Diagnosis diagnosis = friction();
  diagnosis.noise_is_known = true;
  diagnosis.remaining_structure.reset();
  diagnosis.autocorrelated_error.reset();
  diagnosis.validation_within_errors = Assessment{1000.0, 1000.0, 3.3, 99.8};
  diagnosis.rest_test.p_value = diagnosis.rest_test.fit_p_value = 0.5;
  diagnosis.shapes_compared = diagnosis.time_variation_was_tested = true;
  return diagnosis;
}

struct Change {
  std::string what;
  void (*make)(Diagnosis&);
  Verdict verdict;
};

const Change kOfBoth[] = {
    {"interrupted", [](Diagnosis& d) { d.interrupted = true; }, Verdict::kUnknown},
    {"implausible",
     [](Diagnosis& d) {
       d.implausible = {{PlausibilityRule::kSign, "mass", -1.0, 9.0, "mass is negative", "why"}};
     },
     Verdict::kUnknown},
    {"nothing", [](Diagnosis& d) { d.detection.detected = false; }, Verdict::kNone},
    {"no law", [](Diagnosis& d) { d.effects.clear(); }, Verdict::kUnknown},
    {"misleading law", [](Diagnosis& d) { d.effects[0].held_out->misleads = true; },
     Verdict::kUnknown},
    {"error above the signal", [](Diagnosis& d) { d.validation_after->nrmse = 120.0; },
     Verdict::kUnknown},
    {"change", [](Diagnosis& d) { d.time_variation.emplace().p_value = 1e-9; }, Verdict::kUnknown},
    {"a rival",
     [](Diagnosis& d) {
       d.effects[0].rivals = {{d.effects[0].law, 1.0}};
     },
     Verdict::kAmbiguous},
    {"another place", [](Diagnosis& d) { d.effects[0].same_at = {d.effects[0].law}; },
     Verdict::kAmbiguous},
    {"wires", [](Diagnosis& d) { d.channel_faults.emplace_back(); }, Verdict::kUnknown},
    {"no fit", [](Diagnosis& d) { d.trouble = "it diverged"; }, Verdict::kUnknown},
};
const Change kOfUnknownNoise[] = {
    {"kept out", [](Diagnosis& d) { d.validation_after->chi_square = 4000.0; }, Verdict::kUnknown},
    {"structure",
     [](Diagnosis& d) {
       d.remaining_structure = 0.4;
       d.after.estimation.nrmse = 8.0;
     },
     Verdict::kUnknown},
    {"structure not told", [](Diagnosis& d) { d.remaining_structure.reset(); }, Verdict::kUnknown},
    {"a channel",
     [](Diagnosis& d) {
       d.channels_after[1].nrmse = d.channels_after[1].held_out_nrmse.emplace(16.0);
     },
     Verdict::kUnknown},
    {"a channel that was not seen", [](Diagnosis& d) { d.channels_after[0].held_out_nrmse = 6.0; },
     Verdict::kUnknown},
    {"own past", [](Diagnosis& d) { d.autocorrelated_error = 30.0; }, Verdict::kUnknown},
    {"late",
     [](Diagnosis& d) {
       d.channels_after[0].late_by = -0.0011;
       d.channels_after[0].held_out_nrmse = 4.0;
       d.channels_after[0].held_out_nrmse_in_time = 2.0;
     },
     Verdict::kAmbiguous},
    {"nothing kept out",
     [](Diagnosis& d) {
       d.validation_after.reset();
       for (ChannelRest& rest : d.channels_after) rest.held_out_nrmse.reset();
     },
     Verdict::kAmbiguous},
    {"other sizes kept out, and nothing found",
     [](Diagnosis& d) {
       d.detection.detected = false;
       d.kept_out_change = KeptOutChange{10.0, 0.7, {ChangedSize{}}};
     },
     Verdict::kUnknown},
    {"much left that has memory, and nothing found",
     [](Diagnosis& d) {
       d.detection.detected = false;
       d.after.estimation.nrmse = 40.0;
       d.autocorrelated_error = 30.0;
     },
     Verdict::kUnknown},
    {"nothing seen in the fit that recordings kept out show",
     [](Diagnosis& d) {
       d.detection.detected = false;
       d.validation_after->nrmse = 39.0;
       d.validation_after->chi_square = 9000.0;
     },
     Verdict::kUnknown},
};
const Change kOfKnownNoise[] = {
    {"rest", [](Diagnosis& d) { d.rest_test.p_value = 1e-5; }, Verdict::kUnknown},
    {"rest of the fit", [](Diagnosis& d) { d.rest_test.fit_p_value = 1e-5; }, Verdict::kUnknown},
    {"departure", [](Diagnosis& d) { d.departures.emplace_back(); }, Verdict::kUnknown},
    {"shared",
     [](Diagnosis& d) {
       d.shared_characteristics = {{"load", Characteristic::kFriction, {0, 0}}};
     },
     Verdict::kUnknown},
    {"not to the noise",
     [](Diagnosis& d) {
       d.predicts = false;
       d.validation_after->chi_square = 1500.0;
     },
     Verdict::kAmbiguous},
};

// A law that raises a small error a little may be right; one that raises much of it is not.
TEST(VerdictReasons, ALawThatRaisesTheErrorKeptOutIsNotConfirmed) {
  FoundEffect effect;
  const auto is_doubted = [&](double without, double with) {
    effect.held_out = HeldOutEffect{without, with, 0.0};
    effect.held_out->misleads = with > without;
    return is_not_confirmed(effect);
  };
  EXPECT_FALSE(is_not_confirmed(FoundEffect{}));
  EXPECT_FALSE(is_doubted(60.0, 3.3));
  EXPECT_FALSE(is_doubted(3.9, 4.2));
  EXPECT_FALSE(is_doubted(1.0, 4.2));
  EXPECT_TRUE(is_doubted(3.4, 6.4));
  EXPECT_TRUE(is_doubted(18.0, 19.0));
}

// A rest that nearly all depends on the motion is no matter where it is small.
TEST(VerdictReasons, ASmallRestMayDependOnTheMotion) {
  Diagnosis diagnosis = friction();
  diagnosis.remaining_structure = 0.9;
  EXPECT_EQ(verdict_of(verdict_reasons(diagnosis, {})), Verdict::kExplained);
  diagnosis.after.estimation.nrmse = 3.2;  // 3.04 % of the signal depend on the motion
  EXPECT_EQ(verdict_of(verdict_reasons(diagnosis, {})), Verdict::kUnknown);
  diagnosis.remaining_structure = 0.09;
  diagnosis.after.estimation.nrmse = 14.0;  // a share that a regression finds in noise, too
  EXPECT_EQ(verdict_of(verdict_reasons(diagnosis, {})), Verdict::kExplained);
}

void expect_one_failure(Diagnosis diagnosis, const Change& change) {
  change.make(diagnosis);
  diagnosis.reasons = verdict_reasons(diagnosis, {});
  diagnosis.verdict = verdict_of(diagnosis.reasons);
  EXPECT_EQ(diagnosis.verdict, change.verdict) << change.what;
  EXPECT_EQ(std::ranges::count_if(diagnosis.reasons, has_failed), 1) << change.what;
  for (const VerdictReason& reason : diagnosis.reasons) {
    EXPECT_EQ(reason.next.empty(), !has_failed(reason)) << change.what << ": " << reason.test;
  }
  if (diagnosis.verdict == Verdict::kNone) return;
  // The text names it, with what to do.
  std::string failed;
  for (const std::string& line : reason_lines(diagnosis)) {
    if (line.find(": failed.") != std::string::npos) failed += line;
  }
  EXPECT_NE(failed.find("Next: "), std::string::npos) << change.what;
  // The page has a cross there, and ticks elsewhere.
  const PageTable table = reasons_table(diagnosis);
  ASSERT_EQ(table.rows.size(), diagnosis.reasons.size());
  EXPECT_EQ(std::ranges::count_if(table.rows,
                                  [](const auto& row) { return row[1].mark == PageMark::kFailed; }),
            1)
      << change.what;
}

// Where nothing was kept out the fit's own error must pass.
TEST(VerdictReasons, APoorFitIsUnknownWhereNothingWasKeptOut) {
  Diagnosis diagnosis = friction();
  diagnosis.validation_after.reset();
  for (ChannelRest& rest : diagnosis.channels_after) rest.held_out_nrmse.reset();
  EXPECT_EQ(verdict_of(verdict_reasons(diagnosis, {})), Verdict::kAmbiguous);
  diagnosis.channels_after[1].nrmse = 24.0;
  EXPECT_EQ(verdict_of(verdict_reasons(diagnosis, {})), Verdict::kUnknown);
}

// newcomer.md 2.3: a verdict that is not `explained` names the test that failed.
TEST(VerdictReasons, EachFailureMakesItsVerdictByItself) {
  for (const Diagnosis& base : {friction(), friction_in_known_noise()}) {
    const auto reasons = verdict_reasons(base, {});
    EXPECT_EQ(verdict_of(reasons), Verdict::kExplained);
    EXPECT_TRUE(std::ranges::none_of(reasons, has_failed));
    for (const Change& change : kOfBoth) expect_one_failure(base, change);
  }
  for (const Change& change : kOfUnknownNoise) expect_one_failure(friction(), change);
  for (const Change& change : kOfKnownNoise) {
    expect_one_failure(friction_in_known_noise(), change);
  }
}

TEST(VerdictReasons, TheFirstFailureDecides) {
  Diagnosis diagnosis = friction();
  kOfBoth[7].make(diagnosis);
  EXPECT_EQ(verdict_of(verdict_reasons(diagnosis, {})), Verdict::kAmbiguous);
  kOfUnknownNoise[1].make(diagnosis);
  EXPECT_EQ(verdict_of(verdict_reasons(diagnosis, {})), Verdict::kUnknown);
}

// Stopped with a law in the fit, before anything was compared or tested: no test passes or fails
// but that the search came to its end.
TEST(VerdictReasons, ASearchThatWasStoppedHasTestedNothing) {
  Diagnosis diagnosis = friction_in_known_noise();
  diagnosis.interrupted = true;
  diagnosis.rest_test.was_made = diagnosis.shapes_compared = false;
  diagnosis.time_variation_was_tested = diagnosis.plausibility_judged = false;
  diagnosis.effects.clear();
  diagnosis.validation_before = Assessment{1e6, 1000.0, 50.0, 0.0};
  diagnosis.validation_after.reset();
  diagnosis.validation_within_errors.reset();
  diagnosis.rest_test.p_value = diagnosis.rest_test.fit_p_value = 1.0;
  diagnosis.reasons = verdict_reasons(diagnosis, {});
  EXPECT_EQ(verdict_of(diagnosis.reasons), Verdict::kUnknown);
  for (const VerdictReason& reason : diagnosis.reasons) {
    EXPECT_TRUE(!reason.not_tested.empty() || reason.test == "the search came to its end")
        << reason.test;
    EXPECT_EQ(reason.not_tested.find("no recordings were kept out"), std::string::npos);
  }
  std::string all;
  for (const std::string& line : verdict_words(diagnosis, kHypotheses)) all += line + "\n";
  EXPECT_NE(all.find("was not tested: there was no time"), std::string::npos) << all;
  EXPECT_NE(all.find("In the fit when it was stopped"), std::string::npos) << all;
  EXPECT_EQ(all.find("no recordings were kept out"), std::string::npos) << all;
  EXPECT_EQ(all.find("(p = 1"), std::string::npos) << all;
}

// Not even whether anything is missing, which "none" would claim.
TEST(VerdictReasons, ASearchThatWasStoppedEarlyDoesNotAdviseToBeContent) {
  Diagnosis diagnosis = friction();
  diagnosis.interrupted = true;
  diagnosis.detection.detected = false;
  const auto reasons = verdict_reasons(diagnosis, {});
  EXPECT_EQ(verdict_of(reasons), Verdict::kUnknown);
  EXPECT_EQ(reasons.back().test, "something is missing");
  EXPECT_FALSE(reasons.back().not_tested.empty());
}

TEST(VerdictReasons, SayWhichTestsCouldNotBeAsked) {
  Diagnosis diagnosis = friction_in_known_noise();
  diagnosis.interrupted = true;
  diagnosis.time_variation_was_tested = diagnosis.shapes_compared = false;
  diagnosis.plausibility_judged = diagnosis.channels_checked = false;
  diagnosis.reasons = verdict_reasons(diagnosis, {});
  std::string all;
  for (const std::string& line : reason_lines(diagnosis)) all += line;
  EXPECT_NE(all.find("changes with time: not tested: there was no time"), std::string::npos) << all;
  const auto json = reasons_json(diagnosis);
  const auto untested =
      std::ranges::count_if(json, [](const auto& each) { return each.at("passed").is_null(); });
  EXPECT_EQ(untested, 5);
  Diagnosis alone = friction();
  alone.validation_before.reset();
  alone.validation_after.reset();
  alone.effects[0].held_out.reset();
  alone.reasons = verdict_reasons(alone, {});
  EXPECT_EQ(verdict_of(alone.reasons), Verdict::kAmbiguous);
  all.clear();
  for (const std::string& line : verdict_words(alone, kHypotheses)) all += line + "\n";
  EXPECT_NE(all.find("Nothing was kept out of the fit, so what it predicts was not tested."),
            std::string::npos)
      << all;
}

TEST(VerdictReasons, TheRangeNamesFilesAndSpansAndNothingBeyond) {
  CheckedRange range;
  range.kept_out = true;
  range.files = {"run_2.csv"};
  range.spans = {{"velocity of carriage", "m/s", -0.2, 0.25}, {"level", "", 1.0, 3.0}};
  const std::string words = range_words(range);
  EXPECT_NE(words.find("run_2.csv"), std::string::npos);
  EXPECT_NE(words.find("velocity of carriage -0.2 to 0.25 m/s, level 1 to 3"), std::string::npos)
      << words;
  EXPECT_TRUE(range_words({}).empty());
  CheckedRange robot = range;
  robot.spans.assign(18, range.spans.front());
  EXPECT_NE(range_words(robot).find(", and 12 more (checked_range in verdict.json)"),
            std::string::npos)
      << range_words(robot);
  EXPECT_TRUE(range_json({}).is_null());
  EXPECT_EQ(range_json(range).at("spans").size(), 2U);
}

// 2.2 standard errors are no law, unless it takes most of the error kept out.
TEST(VerdictReasons, ALawIsToldByItsErrorOrByWhatItForetells) {
  Diagnosis diagnosis = friction();
  FoundEffect& effect = diagnosis.effects[0];
  effect.law.parameters = {{"curvature", "1", -0.44, 0.20}, {"reference", "N m", 0.467, 0.0}};
  effect.law.parameters[1].sets_scale = true;
  effect.held_out = HeldOutEffect{10.0, 8.2, 0.35};
  const VerdictReason loose = told_reason(diagnosis);
  EXPECT_FALSE(loose.passed);
  EXPECT_NEAR(*loose.value, 2.2, 1e-9);
  EXPECT_EQ(loose.otherwise, Verdict::kAmbiguous);
  effect.held_out->gain = 0.9;
  EXPECT_TRUE(told_reason(diagnosis).passed);
  effect.held_out->gain = 0.35;
  effect.law.parameters[0].standard_error = 0.1;
  EXPECT_TRUE(told_reason(diagnosis).passed);
  effect.held_out.reset();
  EXPECT_FALSE(told_reason(diagnosis).value.has_value());
}

}  // namespace
}  // namespace graybox
