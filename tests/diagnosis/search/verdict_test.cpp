// What a diagnosis looks like in words, JSON, models and pages.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <yaml-cpp/yaml.h>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <tuple>

#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/report/axis_scale.hpp"
#include "diagnosis/report/svg_chart.hpp"
#include "diagnosis/runs/answer_advice.hpp"
#include "diagnosis/second_looks/answer_worth.hpp"
#include "diagnosis/second_looks/unseen_rotors.hpp"
#include "diagnosis/verdict/doubtful_effects.hpp"
#include "diagnosis/verdict/extended_model.hpp"
#include "diagnosis/verdict/law_words.hpp"
#include "diagnosis/verdict/next_plan.hpp"
#include "diagnosis/verdict/report_page.hpp"
#include "diagnosis/verdict/verdict_file.hpp"
#include "diagnosis/verdict/verdict_words.hpp"
#include "problems/base/error.hpp"
#include "problems/laws/law_catalogue.hpp"
#include "problems/mechanisms/lumped_model.hpp"
#include "problems/mechanisms/robot_elements.hpp"

namespace graybox {
namespace {

const std::vector<Hypothesis> kHypotheses = {
    {"joint_3.gearbox", "{kind: element, joint: joint_3, axis: gearbox}", "cubic_spring", {}},
    {"joint_2.motor", "{kind: element, joint: joint_2, axis: motor}", "coulomb", {}},
    {"joint_3.gearbox", "{kind: element, joint: joint_3, axis: gearbox}", "backlash", {}},
};

FittedLaw cubic_spring() { return {0, {{"stiffness", "N m/rad^3", 1.9e9, 0.13e9}}}; }

Diagnosis explained() {
  Diagnosis diagnosis;
  diagnosis.verdict = Verdict::kExplained;
  diagnosis.noise_is_known = true;
  diagnosis.verified = true;
  diagnosis.rest_test.p_value = 0.6;
  diagnosis.detection = {true, 1e-30, 1e-40, 2e-4};
  diagnosis.before.usable = diagnosis.after.usable = true;
  diagnosis.before.estimation = {9000.0, 1000.0, 12.0, 98.0};
  diagnosis.after.estimation = {1010.0, 999.0, 1.5, 99.98};
  diagnosis.validation_before = Assessment{9100.0, 1000.0, 12.5, 97.9};
  diagnosis.validation_after = Assessment{995.0, 1000.0, 1.6, 99.97};
  diagnosis.before.model_parameters = {{"joint_1.gearbox", "1", 0.97, 0.02}};
  diagnosis.after.model_parameters = {{"joint_1.gearbox", "1", 1.5, 0.001}};
  diagnosis.after.laws = {cubic_spring()};
  diagnosis.effects = {{cubic_spring(), 0.998, 7980.0, {}, {}, {{{2, {}}, 54.0}}}};
  diagnosis.detectable = {{0, 2e8, "N m/rad^3"},
                          {1, std::numeric_limits<double>::infinity(), "N m"}};
  diagnosis.mismatch_before = {{"y_3", 5.0, 8.0, "(0, 30, 0)", 3.0, 900.0, 40.0},
                               {"y_3", 8.0, 12.0, "(0, 30, 0)", 3.0, 700.0, 40.0},
                               {"y_1", 5.0, 8.0, "(0, 30, 0)", 3.0, 41.0, 40.0},
                               {"y_1", 30.0, 40.0, "(0, 30, 0)", 1.0, 38.0, 40.0}};
  diagnosis.mismatch_after = diagnosis.mismatch_before;
  diagnosis.pictures = {
      {0, "rad", "rad/s", "N m", {-1e-3, 0, 1e-3}, {0.1, 0.2, 0.3}, {-2, 0, 2}, {-1.9, 0, 1.9}}};
  return diagnosis;
}

TEST(VerdictWords, RoundTheValueToTheErrorsTwoDigits) {
  EXPECT_EQ(estimate_words({"k", "N m/rad^3", 1.93456e9, 0.1312e9}),
            "1.93e+09 ± 0.13e+09 N m/rad^3");
  EXPECT_EQ(estimate_words({"d", "N m", 11.96341, 0.0312}), "11.963 ± 0.031 N m");
  EXPECT_EQ(estimate_words({"x", "1", 0.5, 12.3}), "0 ± 12");
  // newcomer.md, section 5, 5: not as if it were known.
  EXPECT_EQ(estimate_words({"d", "1", 0.5, 12.3}), "not determined (0 ± 12)");
  EXPECT_EQ(estimate_words({"phase", "rad", 0.1, 0.2}), "0.10 ± 0.20 rad");
  EXPECT_EQ(estimate_words({"phase", "rad", 0.1, 2.0}), "not determined (0.1 ± 2.0 rad)");
  EXPECT_EQ(estimate_words({"v_t", "rad/s", 0.0018, 9.9e5}),
            "not determined (fitted at 0.0018 rad/s)");
  EXPECT_EQ(estimate_words({"x", "rad", 0.0, 0.0}), "0 rad (held)");
  EXPECT_EQ(estimate_words({"x", "rad", 3.0, std::nan("")}), "3 rad (no standard error)");
  EXPECT_EQ(estimate_words({"lever", "m", 0.81863, std::nan(""), 0.0123}), "0.819 ± 0.012 m");
  EXPECT_EQ(estimate_words({"anchor", "m", 1.0, std::nan(""), std::nan(""), true}),
            "1 m (stated: with another the other sizes scale)");
}

std::string all_words(const Diagnosis& diagnosis) {
  std::string all;
  for (const std::string& line : verdict_words(diagnosis, kHypotheses)) all += line + "\n";
  return all;
}

TEST(VerdictWords, SayWhatWasFoundAndWhatIsExcluded) {
  const std::string all = all_words(explained());
  EXPECT_NE(all.find("cubic spring at joint_3.gearbox"), std::string::npos) << all;
  EXPECT_NE(all.find("1.90e+09 ± 0.13e+09 N m/rad^3"), std::string::npos) << all;
  EXPECT_NE(all.find("Excluded in its place: backlash at joint_3.gearbox (BIC +54)"),
            std::string::npos)
      << all;
  EXPECT_NE(all.find("no more than noise"), std::string::npos) << all;
}

TEST(VerdictWords, SayWhatCouldNotBeFittedAndWhatOnlyStandsIn) {
  Diagnosis diagnosis = explained();
  diagnosis.verified = false;
  diagnosis.rest_test.p_value = 0.4;
  diagnosis.rest_test.fit_p_value = 1e-9;
  diagnosis.rivals_weighed = false;
  diagnosis.effects[0].bic_difference = std::nan("");
  const std::string all = all_words(diagnosis);
  EXPECT_NE(all.find("Without it the model could not be fitted."), std::string::npos) << all;
  EXPECT_EQ(all.find("nan"), std::string::npos) << all;
  EXPECT_NE(all.find("only stand in"), std::string::npos) << all;
  EXPECT_NE(all.find("On the fit's own recordings"), std::string::npos) << all;
}

Diagnosis changing() {
  Diagnosis diagnosis = explained();
  diagnosis.verdict = Verdict::kUnknown;
  TimeVariation& change = diagnosis.time_variation.emplace();
  change.place = "joint_3.motor";
  change.coefficient = "damping";
  change.unit = "N m s/rad";
  change.p_value = 1e-9;
  change.deviation = 0.021;
  change.frequency = 0.5;
  change.duration = 2.0;
  change.course = {0.03, 0.0, -0.03};
  change.alternatives = {"gain at actuator joint_3"};
  return diagnosis;
}

TEST(VerdictWords, SayWhatChangesWithTime) {
  const std::string all = all_words(changing());
  EXPECT_EQ(all.find("Something changes while it is recorded"), 0U) << all;
  EXPECT_NE(all.find("The damping at joint_3.motor changes with time, by 0.021 N m s/rad (rms) or "
                     "more, once in the 2 s of a recording or slower (p = 1e-09"),
            std::string::npos)
      << all;
  EXPECT_NE(all.find("Not told apart from it: gain at actuator joint_3."), std::string::npos)
      << all;
  Diagnosis fast = changing();
  fast.verified = false;
  fast.time_variation->frequency = 1.5;
  const std::vector<std::string> lines = verdict_words(fast, kHypotheses);
  EXPECT_NE(lines[0].find("more is missing than what was found"), std::string::npos) << lines[0];
  EXPECT_NE(lines[1].find("mainly near 1.5 Hz"), std::string::npos) << lines[1];
  const auto json = verdict_json(changing(), kHypotheses, {"model.yaml", "campaign", {}});
  EXPECT_EQ(json.at("time_variation").at("coefficient"), "damping");
  EXPECT_TRUE(verdict_json(explained(), kHypotheses, {"model.yaml", "campaign", {}})
                  .at("time_variation")
                  .is_null());
  const std::string page = report_page(changing(), kHypotheses, {"model.yaml", "campaign", {}});
  EXPECT_NE(page.find("change of damping, N m s/rad"), std::string::npos);
}

TEST(VerdictWords, SayWhereALawOnlyResemblesWhatIsThere) {
  Diagnosis diagnosis = explained();
  diagnosis.verdict = Verdict::kUnknown;
  diagnosis.shapes_compared = true;
  diagnosis.departures = {{{2, {}}, 151.0, 1.0, 1e-34, 0.022}};
  std::string all = all_words(diagnosis);
  EXPECT_EQ(all.find("Physics is missing; what was found comes close"), 0U) << all;
  EXPECT_NE(
      all.find("What was found is not quite the force at joint_3.gearbox: backlash would lower "
               "chi-square by 151 more, 2.2 % of what the laws explain (p = 1e-34)"),
      std::string::npos)
      << all;
  EXPECT_NE(all.find("By its chi-square what is left is no more than noise"), std::string::npos);
  auto json = verdict_json(diagnosis, kHypotheses, {"model.yaml", "campaign", {}});
  EXPECT_TRUE(json.at("shapes_compared").get<bool>());
  EXPECT_EQ(json.at("departures").at(0).at("law"), "backlash");
  EXPECT_EQ(json.at("departures").at(0).at("place"), "joint_3.gearbox");

  diagnosis.departures.clear();
  diagnosis.shared_characteristics = {{"joint_3.gearbox", Characteristic::kSpring, {0, 2}}};
  all = all_words(diagnosis);
  EXPECT_EQ(all.find("Physics is missing; several laws at one place"), 0U) << all;
  EXPECT_NE(all.find("At joint_3.gearbox the curve of a spring is described by cubic spring and "
                     "backlash together"),
            std::string::npos)
      << all;
  json = verdict_json(diagnosis, kHypotheses, {"model.yaml", "campaign", {}});
  EXPECT_EQ(json.at("shared_characteristics").at(0).at("laws").size(), 2U);
  const std::string page = report_page(diagnosis, kHypotheses, {"model.yaml", "campaign", {}});
  EXPECT_NE(page.find("is described by cubic spring and backlash together"), std::string::npos);
}

TEST(VerdictWords, SpeakOfPredictionWhereTheNoiseIsNotKnown) {
  Diagnosis diagnosis = explained();
  diagnosis.noise_is_known = false;
  diagnosis.effects[0].excluded[0].bic_difference = 25.0;
  const std::string all = all_words(diagnosis);
  EXPECT_EQ(all.find("BIC"), std::string::npos) << all;
  EXPECT_NE(all.find("backlash at joint_3.gearbox (prediction worse by 5 standard errors)"),
            std::string::npos)
      << all;
}

// 400 % of a signal that become 105 % are no prediction; noise that is known may be that large.
TEST(VerdictWords, FindNothingThatPredictsNothing) {
  Diagnosis diagnosis = explained();
  diagnosis.effects[0].held_out = HeldOutEffect{409.0, 104.9, 0.93};
  for (const bool is_known : {false, true}) {
    diagnosis.noise_is_known = is_known;
    const std::string lines =
        fmt::format("{}", fmt::join(verdict_words(diagnosis, kHypotheses), "\n"));
    EXPECT_EQ(lines.find("Not confirmed: ") != std::string::npos, !is_known) << lines;
    EXPECT_EQ(lines.find("Found: ") != std::string::npos, is_known) << lines;
    diagnosis.verdict = Verdict::kUnknown;
    const std::string page = verdict_in_short(diagnosis, kHypotheses).front();
    EXPECT_EQ(page.find("; not confirmed: ") != std::string::npos, !is_known) << page;
  }
}

// 28 ± 185 N/m may be any spring, or none.
TEST(VerdictWords, FindNoLawOfWhichNoSizeIsTold) {
  Diagnosis diagnosis = explained();
  const auto words_with = [&](double error) {
    diagnosis.effects[0].law.parameters = {{"stiffness", "N m/rad^3", 28.0, error}};
    return fmt::format("{}", fmt::join(verdict_words(diagnosis, kHypotheses), "\n"));
  };
  EXPECT_NE(words_with(185.0).find("Not confirmed: "), std::string::npos);
  EXPECT_NE(words_with(2.0).find("Found: "), std::string::npos);
  // Alone it has no error; beside the others it has.
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  diagnosis.effects[0].law.parameters = {{"stiffness", "N/m", 1.6, kNone}};
  diagnosis.effects[0].law.parameters[0].conditional_error = 2.0;
  EXPECT_TRUE(is_doubtful(diagnosis.effects[0], diagnosis));
  diagnosis.effects[0].law.parameters[0].conditional_error = 0.2;
  EXPECT_FALSE(is_doubtful(diagnosis.effects[0], diagnosis));
}

// Whole recordings kept out that are foretold badly, and worse than with nothing.
TEST(VerdictWords, ConfirmNoLawWithWhichAllIsForetoldWorse) {
  Diagnosis diagnosis = explained();
  diagnosis.noise_is_known = false;
  diagnosis.validation_before = diagnosis.validation_after = diagnosis.after.estimation;
  for (const auto& [before, after] : {std::pair{62.7, 70.3}, {62.7, 40.0}, {2.0, 3.0}}) {
    diagnosis.validation_before->nrmse = before;
    diagnosis.validation_after->nrmse = after;
    EXPECT_EQ(is_doubtful(diagnosis.effects[0], diagnosis), after > 60.0) << after;
  }
}

TEST(VerdictWords, ConfirmNoLawThatTheFitHardlyAsksFor) {
  Diagnosis diagnosis = explained();
  diagnosis.noise_is_known = false;
  diagnosis.validation_before.reset();
  diagnosis.validation_after.reset();
  diagnosis.effects[0].held_out.reset();
  for (const double z : {1.0, 3.0}) {
    diagnosis.effects[0].bic_difference = z * z;
    EXPECT_EQ(is_doubtful(diagnosis.effects[0], diagnosis), z < 2.0);
  }
}

TEST(VerdictWords, ConfirmNoRippleOfUnknownPhaseBesideARival) {
  Diagnosis diagnosis = explained();
  diagnosis.effects[0].law.parameters.push_back({"phase", "rad", 1.4, 2.2});
  for (const bool has_rival : {false, true}) {
    diagnosis.effects[0].rivals.assign(has_rival ? 1 : 0, Rival{});
    EXPECT_EQ(is_doubtful(diagnosis.effects[0], diagnosis), has_rival);
  }
  diagnosis.effects[0].law.parameters.back().standard_error = 0.2;
  EXPECT_FALSE(is_doubtful(diagnosis.effects[0], diagnosis));
}

// Beside a force that nobody knows, larger than all that acts, no law's size is told.
TEST(VerdictWords, ConfirmNoLawBesideALargerForce) {
  Diagnosis diagnosis = explained();
  VerdictReason reason;
  reason.test = std::string(kForceTest) + " axis, % of the forces that act";
  reason.passed = false;
  diagnosis.reasons = {reason};
  for (const double share : {40.0, 122.0}) {
    diagnosis.reasons[0].value = share;
    EXPECT_EQ(is_doubtful(diagnosis.effects[0], diagnosis), share > 100.0);
  }
}

// What failed stands in the first line.
TEST(VerdictWords, SayWhyAnExplanationIsAmbiguous) {
  Diagnosis diagnosis = explained();
  diagnosis.verdict = Verdict::kAmbiguous;
  diagnosis.predicts = true;
  for (FoundEffect& effect : diagnosis.effects) effect.rivals.clear();
  diagnosis.reasons = {{.test = kSizesTest,
                        .value = 1.0,
                        .limit = 0.0,
                        .is_lower_limit = false,
                        .passed = false,
                        .not_tested = {},
                        .otherwise = Verdict::kAmbiguous,
                        .next = {}}};
  EXPECT_NE(headline(diagnosis).find("its sizes are not the same"), std::string::npos)
      << headline(diagnosis);
  diagnosis.reasons[0].test = "masses and springs that are not determined";
  EXPECT_NE(headline(diagnosis).find("do not determine every parameter"), std::string::npos);
}

// One way both are one; both ways, or beside dry friction, they are not.
TEST(AnswerAdvice, CallsAConstantForceDryFrictionWhereTheMotionGoesOneWay) {
  const std::vector<Hypothesis> hypotheses{{"axis", "", "offset", {}}, {"axis", "", "coulomb", {}}};
  const auto said = [&](double from, double to, bool beside_friction) {
    Diagnosis diagnosis;
    diagnosis.checked.spans = {{"velocity of axis", "rad/s", 0.0, 20.0}};  // kept out
    diagnosis.checked.recorded = {{"velocity of axis", "rad/s", from, to}};
    diagnosis.effects.push_back({{0, {}}, 0.9, 10.0, {}, {}, {}});
    if (beside_friction) diagnosis.effects.push_back({{1, {}}, 0.9, 10.0, {}, {}, {}});
    tell_one_way_forces(hypotheses, diagnosis);
    return diagnosis.assumptions.size();
  };
  EXPECT_EQ(said(-0.2, 20.0, false), 1U);
  EXPECT_EQ(said(-20.0, 0.0, false), 1U);
  EXPECT_EQ(said(-18.0, 20.0, false), 0U);
  EXPECT_EQ(said(0.0, 20.0, true), 0U);
}

// In one sweep at one speed a place is a moment; there and back, or from rest, it is not.
TEST(AnswerAdvice, SaysThatALawOfTheWayMayBeAChangeWithTime) {
  const std::vector<Hypothesis> hypotheses{{"axis", "", "cubic_spring", {}},
                                           {"axis", "", "coulomb", {}}};
  const auto said = [&](double from, double to, std::size_t law) {
    Diagnosis diagnosis;
    diagnosis.checked.recorded = {{"velocity of axis", "rad/s", from, to}};
    diagnosis.effects.push_back({{law, {}}, 0.9, 10.0, {}, {}, {}});
    tell_one_way_forces(hypotheses, diagnosis);
    return diagnosis.assumptions.size();
  };
  EXPECT_EQ(said(7.1e-4, 9.9e-4, 0), 1U);
  EXPECT_EQ(said(-2.0, -1.1, 0), 1U);
  EXPECT_EQ(said(0.2, 2.0, 0), 0U);
  EXPECT_EQ(said(-2.0, 2.0, 0), 0U);
  EXPECT_EQ(said(1.0, 1.1, 1), 0U);
}

// A recorded force that ends in flat tops may be larger; of what is explained without laws nothing
// is said.
TEST(AnswerAdvice, DoubtsLawsOfAClippedDrive) {
  Diagnosis diagnosis = explained();
  const std::vector<std::string> inputs{"torque"};
  tell_clipped_inputs(inputs, diagnosis);
  ASSERT_EQ(diagnosis.assumptions.size(), 1U);
  EXPECT_NE(diagnosis.assumptions[0].find("The recorded torque has flat tops"), std::string::npos);
  diagnosis.effects.clear();
  diagnosis.assumptions.clear();
  tell_clipped_inputs(inputs, diagnosis);
  EXPECT_TRUE(diagnosis.assumptions.empty());
}

// A law that is told and not confirmed explains nothing; one beside it that is confirmed does.
TEST(AnswerAdvice, ExplainsNothingByLawsThatAreNotConfirmed) {
  for (const bool is_one_confirmed : {false, true}) {
    Diagnosis diagnosis = explained();
    diagnosis.noise_is_known = false;
    diagnosis.validation_before = diagnosis.validation_after = Assessment{};
    diagnosis.validation_before->nrmse = diagnosis.validation_after->nrmse = 1.5;
    diagnosis.effects.resize(1);
    diagnosis.effects[0].held_out = HeldOutEffect{1.492, 1.503, -0.01};
    if (is_one_confirmed) {
      diagnosis.effects.push_back(diagnosis.effects[0]);
      diagnosis.effects[1].held_out = HeldOutEffect{20.0, 1.503, 0.99};
    }
    diagnosis.reasons = {{.test = "laws found",
                          .value = 1.0,
                          .limit = 1.0,
                          .is_lower_limit = true,
                          .passed = true,
                          .not_tested = {},
                          .otherwise = Verdict::kUnknown,
                          .next = {}}};
    require_confirmed_laws(diagnosis);
    EXPECT_EQ(diagnosis.verdict, is_one_confirmed ? Verdict::kExplained : Verdict::kUnknown);
    EXPECT_EQ(headline(diagnosis).find("nothing is shown to be missing") != std::string::npos,
              !is_one_confirmed)
        << headline(diagnosis);
  }
}

// What is determined to 1 in 10 at least is no place at ten thousand kilometres.
TEST(VerdictWords, WriteNoNumbersWithoutDigits) {
  EXPECT_EQ(estimate_words({"y", "m", 3e8, 4.7e10}), "not determined (fitted at 3e+08 m)");
  EXPECT_EQ(estimate_words({"x", "m", 0.001, 0.02}), "0.001 ± 0.020 m");
}

TEST(VerdictWords, SayItAsAnEngineerWould) {
  const auto sentence = [](const char* place, const char* law, double value) {
    const Hypothesis hypothesis{place, "", law, {}};
    return law_sentence(hypothesis, {0, {{"p", "1", value, 0.1}}});
  };
  EXPECT_EQ(sentence("joint_3.gearbox", "cubic_spring", 1.0), "the gearbox of joint_3 hardens");
  EXPECT_EQ(sentence("joint_3.gearbox", "cubic_spring", -1.0), "the gearbox of joint_3 softens");
  EXPECT_EQ(sentence("joint_1.arm", "inertia", -1.0),
            "the arm axis of joint_1 has less inertia than modelled");
  EXPECT_EQ(sentence("sensor joint_2", "dead_zone", 1.0),
            "the sensor joint_2 does not answer to small values (dead zone)");
  EXPECT_EQ(sentence("motor-load", "backlash", 1.0), "motor-load has play");
  EXPECT_EQ(sentence("carriage", "magnet", 1.0), "carriage follows the law magnet");
  // No law of the catalogue is without words.
  for (const LawEntry& entry : law_catalogue()) {
    const bool at_signal = entry.use == LawUse::kSignal || entry.use == LawUse::kDelay;
    const std::string place = at_signal ? "sensor x" : "x";
    EXPECT_EQ(sentence(place.c_str(), entry.name.c_str(), 1.0).find("follows the law"),
              std::string::npos)
        << entry.name;
  }
}

// A clearance is never negative; what follows after it tells a stop from a spring that gives way.
TEST(VerdictWords, CallNoStopWhatGivesWay) {
  const auto sentence = [](double stiffness) {
    return law_sentence(
        {"axis", "", "dead_zone", {}},
        {0, {{"clearance", "rad", 0.4, 0.03}, {"stiffness", "N m/rad", stiffness, 0.5}}});
  };
  EXPECT_EQ(sentence(-7.4), "axis loses stiffness beyond a clearance");
  EXPECT_NE(sentence(7.4).find("a stop"), std::string::npos);
}

// newcomer.md 2.1, mend 4: words follow the numbers.
TEST(VerdictWords, SayThatFrictionFallsWithSpeedOnlyWhereItDoes) {
  const auto sentence = [](const char* law, std::vector<LawParameterEstimate> parameters) {
    return law_sentence({"load", "", law, {}}, {0, std::move(parameters)});
  };
  const auto friction = [&](const char* law, double sliding, double still) {
    return sentence(law, {{"level", "N m", sliding, 0.01}, {"static_level", "N m", still, 0.01}});
  };
  for (const char* law : {"stribeck", "lugre"}) {
    EXPECT_NE(friction(law, 1.0, 1.5).find("falls with speed"), std::string::npos) << law;
    EXPECT_NE(friction(law, 1.5, 1.0).find("rises with speed"), std::string::npos) << law;
    EXPECT_NE(friction(law, 1.0, 1.01).find("hardly depends on speed"), std::string::npos) << law;
    // The difference is not sure, and yet the curve falls by more than 15 %.
    const std::vector<LawParameterEstimate> unsure{{"level", "N m", 3.0, 0.1},
                                                   {"static_level", "N m", 4.1, 2.0}};
    EXPECT_EQ(sentence(law, unsure).find("speed"), std::string::npos) << law;
  }
  EXPECT_EQ(
      sentence("sublinear_friction", {{"level", "N", 5.0, 0.1}, {"exponent", "1", 0.99, 0.02}}),
      "load has viscous friction");
  EXPECT_NE(sentence("sublinear_friction", {{"level", "N", 5.0, 0.1}, {"exponent", "1", 0.5, 0.02}})
                .find("grows less than speed"),
            std::string::npos);
  const auto by_direction = [&](double backward) {
    return sentence("asymmetric_coulomb",
                    {{"forward_level", "N", 5.0, 0.2}, {"backward_level", "N", backward, 0.2}});
  };
  EXPECT_NE(by_direction(8.0).find("differs between the directions"), std::string::npos);
  EXPECT_NE(by_direction(5.1).find("the same in both directions"), std::string::npos);
  // Far apart, and their errors are large: not told apart is not the same.
  const std::string unsure = sentence("asymmetric_coulomb", {{"forward_level", "N", 83.0, 29.0},
                                                             {"backward_level", "N", 24.9, 6.0}});
  EXPECT_EQ(unsure.find("the same"), std::string::npos) << unsure;
  EXPECT_NE(unsure.find("not told apart"), std::string::npos) << unsure;
}

TEST(VerdictWords, NeverSayInfStandardErrors) {
  Diagnosis diagnosis = explained();
  diagnosis.noise_is_known = false;
  for (const double difference : {std::numeric_limits<double>::infinity(), 1e300, 1e7}) {
    diagnosis.effects[0].bic_difference = difference;
    diagnosis.effects[0].excluded[0].bic_difference = difference;
    const std::string all = all_words(diagnosis);
    EXPECT_EQ(all.find("inf"), std::string::npos) << all;
    EXPECT_NE(all.find("prediction far worse"), std::string::npos) << all;
  }
}

// A static level that the motion did not reach is no number.
TEST(VerdictWords, DoNotPrintAStaticLevelThatWasNotSeen) {
  const std::vector<Hypothesis> hypotheses{{"axis", "", "stribeck", {}}};
  for (const auto& [still, error, is_seen] :
       {std::tuple{12.0, 11.0, false}, {12.0, 13.0, false}, {4.0, 0.3, true}, {3.1, 0.4, true}}) {
    Diagnosis diagnosis = explained();
    const FittedLaw law{0, {{"level", "N m", 3.0, 0.1}, {"static_level", "N m", still, error}}};
    diagnosis.effects = {{law, 0.9, 100.0, {}, {}, {}}};
    diagnosis.detectable.clear();
    diagnosis.pictures.clear();
    std::string all;
    for (const std::string& line : verdict_words(diagnosis, hypotheses)) all += line + "\n";
    EXPECT_EQ(all.find("static level not determined.") == std::string::npos, is_seen) << all;
    EXPECT_EQ(all.find(fmt::format("static level {:.0f}", still)) == std::string::npos, !is_seen)
        << all;
  }
}

// A negative spring where the model has none softens nothing.
TEST(VerdictWords, SoftenNoSpringThatIsNotThere) {
  const Hypothesis hypothesis{"axis", "", "stiffness", {}};
  FoundEffect effect{.law = {0, {{"stiffness", "N/m", -0.14, 0.01}}},
                     .rivals = {},
                     .generalisations = {},
                     .excluded = {}};
  EXPECT_EQ(effect_sentence(hypothesis, effect), "axis is softer than modelled");
  effect.is_first_of_its_kind = true;
  EXPECT_EQ(effect_sentence(hypothesis, effect).find("softer"), std::string::npos);
  EXPECT_NE(effect_sentence(hypothesis, effect).find("pushes axis away"), std::string::npos);
}

// What predicts better than what was found comes first, with what to record.
TEST(VerdictWords, NameABetterRivalFirst) {
  const std::vector<Hypothesis> hypotheses{{"axis", "", "coulomb", {}},
                                           {"axis", "", "stribeck", {}}};
  for (const double errors : {4.7, 1.0}) {
    Diagnosis diagnosis = explained();
    diagnosis.noise_is_known = false;
    diagnosis.detectable.clear();
    diagnosis.pictures.clear();
    diagnosis.effects = {{{0, {{"level", "N m", 4.0, 0.1}}}, 0.9, 100.0, {}, {}, {}}};
    diagnosis.effects[0].rivals = {{{1, {{"level", "N m", 4.0, 0.1}}}, -errors * errors}};
    std::string all;
    for (const std::string& line : verdict_words(diagnosis, hypotheses)) all += line + "\n";
    const std::size_t better = all.find("More likely than coulomb at axis: stribeck at axis"),
                      found = all.find("Found:");
    ASSERT_NE(found, std::string::npos) << all;
    EXPECT_EQ(better<found, errors> 2.0) << all;
    EXPECT_EQ(all.find("Record slow motion") != std::string::npos, errors > 2.0) << all;
  }
}

// A balance of differentiated positions whose mass vanished says nothing.
TEST(AnswerWorth, AMachineHasAMassAndNoNegativeSpring) {
  Diagnosis diagnosis = explained();
  EXPECT_TRUE(is_of_a_machine(diagnosis));
  Implausibility flaw{PlausibilityRule::kZero, "bearing.damping", 1e-4, 0.1, "w", "r", false};
  diagnosis.implausible = {flaw};
  EXPECT_TRUE(is_of_a_machine(diagnosis));
  flaw.quantity = "axis.mass";
  diagnosis.implausible = {flaw};
  EXPECT_FALSE(is_of_a_machine(diagnosis));
  diagnosis.implausible = {{PlausibilityRule::kSign, "stiffness", -0.1, 12.0, "w", "r", true}};
  EXPECT_FALSE(is_of_a_machine(diagnosis));
}

// Only where the rotor alone keeps the answer from being sure.
TEST(UnseenRotors, ARotorThatIsNotSeenIsLeftOut) {
  Diagnosis diagnosis = explained();
  diagnosis.verdict = Verdict::kAmbiguous;
  const auto failed = [](const char* test) {
    VerdictReason reason;
    reason.test = test;
    reason.passed = false;
    return reason;
  };
  diagnosis.reasons = {failed("parameters that are not determined")};
  Implausibility flaw{
      PlausibilityRule::kZero, "rotor_inertia_2/gain_2", 0.01, 0.2, "w", "r", false};
  diagnosis.implausible = {flaw};
  EXPECT_EQ(rotors_to_leave_out(diagnosis), std::vector<std::size_t>{1});
  Diagnosis other = diagnosis;
  other.reasons.push_back(failed("other explanations that are not excluded"));
  EXPECT_TRUE(rotors_to_leave_out(other).empty());
  other = diagnosis;
  other.implausible[0].quantity = "bearing.damping";
  EXPECT_TRUE(rotors_to_leave_out(other).empty());
  other = diagnosis;
  other.verdict = Verdict::kUnknown;
  EXPECT_TRUE(rotors_to_leave_out(other).empty());
}

// A rotor of less than no inertia is left out with those that are not told, unless something else
// is impossible, too.
TEST(UnseenRotors, ARotorOfNegativeInertiaIsLeftOut) {
  Diagnosis diagnosis = explained();
  diagnosis.verdict = Verdict::kUnknown;
  const Implausibility negative{
      PlausibilityRule::kSign, "rotor_inertia_4/gain_4", -0.02, 3.6, "w", "r", true};
  const Implausibility unseen{
      PlausibilityRule::kZero, "rotor_inertia_2/gain_2", 0.01, 0.2, "w", "r", false};
  diagnosis.implausible = {negative, unseen};
  EXPECT_EQ(rotors_to_leave_out(diagnosis), (std::vector<std::size_t>{3, 1}));
  diagnosis.implausible.push_back({PlausibilityRule::kSign, "gain_1", -2.0, 5.0, "w", "r", true});
  EXPECT_TRUE(rotors_to_leave_out(diagnosis).empty());
}

// What to record follows from the rivals' laws.
TEST(AnswerAdvice, StribeckAsksForSlowMotion) {
  const std::vector<Hypothesis> hypotheses{{"axis", "", "coulomb", {}},
                                           {"axis", "", "stribeck", {}}};
  Diagnosis diagnosis = explained();
  diagnosis.effects = {{{0, {{"level", "N m", 4.0, 0.1}}}, 0.9, 100.0, {}, {}, {}}};
  diagnosis.effects[0].rivals = {{{1, {{"level", "N m", 4.0, 0.1}}}, -4.0}};
  VerdictReason reason;
  reason.test = "other explanations that are not excluded";
  reason.passed = false;
  reason.next = "record larger and faster motion";
  diagnosis.reasons = {reason};
  advise_on_rivals(hypotheses, diagnosis);
  EXPECT_TRUE(diagnosis.reasons[0].next.starts_with("Record slow motion"))
      << diagnosis.reasons[0].next;
}

TEST(VerdictWords, SayFirstWhatNoMachineHas) {
  Diagnosis diagnosis = explained();
  diagnosis.verdict = Verdict::kUnknown;
  diagnosis.implausible = {{PlausibilityRule::kSign, "load.inertia", -1.3, 9.0,
                            "load.inertia is negative by 9 standard errors: -1.3", "Usually ..."}};
  const std::vector<std::string> lines = verdict_words(diagnosis, kHypotheses);
  EXPECT_NE(lines[0].find("not one that a machine can have"), std::string::npos) << lines[0];
  EXPECT_EQ(lines[1],
            "Implausible: load.inertia is negative by 9 standard errors: -1.3. Usually ...");
  const auto json = verdict_json(diagnosis, kHypotheses, {"m", "c"});
  EXPECT_EQ(json.at("plausibility").at(0).at("quantity"), "load.inertia");
  // What is in such a fit is not found, and no experiment is asked for it.
  for (const std::string& line : lines) EXPECT_FALSE(line.starts_with("Found")) << line;
  EXPECT_TRUE(std::ranges::any_of(
      lines, [](const std::string& line) { return line.starts_with("In that fit: "); }));
}

TEST(VerdictFile, ListsWhatWasTriedAndRejected) {
  Diagnosis diagnosis = explained();
  diagnosis.rejected = {
      {{1, {}}, "it raises the error of recordings kept out", HeldOutEffect{6.1, 8.3, -0.8, true}}};
  diagnosis.effects[0].held_out = HeldOutEffect{12.5, 1.6, 0.98};
  const auto json = verdict_json(diagnosis, kHypotheses, {"m", "c"});
  EXPECT_EQ(json.at("rejected").at(0).at("law"), "coulomb");
  EXPECT_EQ(json.at("physics").at(0).at("held_out_gain").get<double>(), 0.98);
  EXPECT_EQ(json.at("physics").at(0).at("held_out_error_without").get<double>(), 12.5);
  const std::string all = all_words(diagnosis);
  EXPECT_NE(all.find("Tried and rejected: coulomb at joint_2.motor: it raises the error"),
            std::string::npos)
      << all;
  EXPECT_NE(all.find("from 12.5 % to 1.6 %"), std::string::npos) << all;
}

// Where the noise is not known, what recordings kept out do not ask for is not found.
TEST(VerdictWords, ConfirmWhatRecordingsKeptOutAskFor) {
  Diagnosis diagnosis = explained();
  diagnosis.effects[0].held_out = HeldOutEffect{36.9, 38.7, -0.1};
  for (const bool is_known : {true, false}) {
    diagnosis.noise_is_known = is_known;
    const std::string all = all_words(diagnosis);
    EXPECT_EQ(all.find("Not confirmed: ") != std::string::npos, !is_known) << all;
  }
  diagnosis.effects[0].held_out = HeldOutEffect{36.9, 30.0, 0.3};
  EXPECT_EQ(all_words(diagnosis).find("Not confirmed: "), std::string::npos);
}

TEST(VerdictWords, DoNotCallPhysicsMissingWhereNothingWasSeen) {
  Diagnosis diagnosis;
  diagnosis.detection.detected = false;
  diagnosis.verdict = Verdict::kUnknown;
  EXPECT_EQ(headline(diagnosis),
            "Nothing was seen to be missing, but not every test of that was passed.");
  // A third of the signal is no noise that anybody knows of.
  diagnosis.validation_after = Assessment{};
  diagnosis.validation_after->nrmse = 31.0;
  EXPECT_EQ(headline(diagnosis),
            "The model misses 31 % of the signal in recordings kept out, and these recordings do "
            "not tell whether that is noise, a disturbance or missing physics.");
  diagnosis.validation_after->nrmse = 1600.0;
  EXPECT_TRUE(headline(diagnosis).starts_with(
      "The model foretells nothing of the recordings kept out: its error is 16 times the signal."));
  diagnosis.noise_is_known = true;
  EXPECT_TRUE(headline(diagnosis).starts_with("Nothing was seen to be missing"));
}

// A column that is another one times -1.
TEST(VerdictWords, SayThatNoSensorsFitToRounding) {
  Diagnosis diagnosis = explained();
  diagnosis.after.usable = true;
  diagnosis.before.estimation.nrmse = 38.9;
  diagnosis.after.estimation.nrmse = 3.1;
  EXPECT_EQ(all_words(diagnosis).find("to rounding"), std::string::npos);
  diagnosis.after.estimation.nrmse = 8.8e-14;
  EXPECT_NE(all_words(diagnosis).find("one of them was computed"), std::string::npos);
  EXPECT_EQ(estimate_words({"stiffness", "N m/rad", -57.29577951, 1e-14}),
            "-57.2958 N m/rad (to rounding)");
}

TEST(VerdictWords, SayHowMuchAModelWithoutLawsForetells) {
  Diagnosis diagnosis;
  diagnosis.detection.detected = true;
  diagnosis.verdict = Verdict::kUnknown;
  diagnosis.validation_after = Assessment{};
  diagnosis.validation_after->nrmse = 3.06;
  EXPECT_EQ(headline(diagnosis),
            "The model as it is foretells recordings kept out to 3.1 % of the signal. That is more "
            "than noise, and no law of the catalogue takes it.");
  diagnosis.validation_after->nrmse = 12.0;
  EXPECT_EQ(headline(diagnosis), "Physics is missing, and no law of the catalogue explains it.");
}

// Where the noise is not known, what is foretold badly is not called predicted.
TEST(VerdictFile, PredictsWhatIsKeptOutOnlyIfItsTestsPassed) {
  Diagnosis diagnosis = explained();
  diagnosis.noise_is_known = false;
  const auto predicts = [&] {
    return verdict_json(diagnosis, kHypotheses, {"m", "c"}).at("predicts_kept_out").get<bool>();
  };
  diagnosis.validation_after.reset();
  EXPECT_FALSE(predicts());  // nothing was kept out
  diagnosis.validation_after = Assessment{};
  EXPECT_TRUE(predicts());
  diagnosis.reasons = {{"error kept out over that of the fit", 3.0, 1.5, false, false}};
  EXPECT_FALSE(predicts());
  diagnosis.reasons = {{"other explanations that are not excluded", 1.0, 0.0, false, false}};
  EXPECT_TRUE(predicts());
}

// A delay of the only actuator or of the only sensor: one system, two places.
TEST(VerdictWords, NameAllPlacesThatMakeOneSystem) {
  Diagnosis diagnosis = explained();
  diagnosis.verdict = Verdict::kAmbiguous;
  diagnosis.effects[0].same_at = {{2, {{"half_gap", "rad", 1e-3, 1e-4}}}};
  diagnosis.effects[0].rivals = {{{1, {{"level", "N m", 0.5, 0.1}}}, 1.5}};
  diagnosis.effects[0].rivals[0].same_at = {{2, {{"half_gap", "rad", 2e-3, 1e-4}}}};
  const std::string all = all_words(diagnosis);
  for (const char* words : {"The same, or at joint_3.gearbox: half gap 0.00100",
                            "The same, or at joint_3.gearbox: half gap 0.00200"}) {
    EXPECT_NE(all.find(words), std::string::npos) << all;
  }
  const auto effect = verdict_json(diagnosis, kHypotheses, {"m", "c"})["physics"][0];
  EXPECT_EQ(effect["same_at"][0]["place"], "joint_3.gearbox");
  EXPECT_EQ(effect["same_at"][0]["parameters"]["half_gap"]["value"], 1e-3);
  EXPECT_EQ(effect["alternatives"][0]["same_at"][0]["parameters"]["half_gap"]["value"], 2e-3);
}

TEST(VerdictWords, SayWhichExperimentTellsRivalsApart) {
  Diagnosis diagnosis = explained();
  diagnosis.verdict = Verdict::kAmbiguous;
  NextExperiment next;
  next.shares = {{{"[0, 30, 0]", {0, 30, 0}, 6.0, 1.0, 10.0}, 0.75},
                 {{"[0, 0, 0]", {0, 0, 0}, 3.0, 1.0, 60.0}, 0.25}};
  next.duality_gap = 1e-8;
  next.distance_now = 2.0;
  next.distance_then = 19.0;
  next.recordings = 12.0;
  next.recordings_needed = 7.0;
  diagnosis.effects[0].rivals = {{{2, {{"half_gap", "rad", 1e-3, 1e-4}}}, 1.5, next}};
  const std::string all = all_words(diagnosis);
  EXPECT_NE(all.find("7 more recordings, 75 % in position [0, 30, 0] at level 6 from 1 to 10 Hz"),
            std::string::npos)
      << all;
  // Nobody makes so many.
  diagnosis.effects[0].rivals[0].next->recordings_needed = 154.0;
  const std::string many = all_words(diagnosis);
  EXPECT_NE(many.find("such recordings will not"), std::string::npos) << many;
  EXPECT_EQ(many.find("more recordings"), std::string::npos) << many;
  diagnosis.effects[0].rivals[0].next->recordings_needed = 7.0;
  const auto json = verdict_json(diagnosis, kHypotheses, {"m", "c"})["next_experiment"];
  EXPECT_EQ(json["between"][1], "backlash at joint_3.gearbox");
  EXPECT_EQ(json["shares"][0]["band_hz"][1], 10.0);
  EXPECT_EQ(json["recordings_needed"], 7.0);
  Campaign campaign;
  campaign.sample_time = 0.001;
  campaign.experiments.resize(2);
  campaign.experiments[0].excitation = {1000, 2, {1, 3, 5, 9, 15, 35}};
  const std::vector<std::string> plans = next_plans(next, campaign, true);
  ASSERT_EQ(plans.size(), 2U);
  const YAML::Node second = YAML::Load(plans[1]);
  EXPECT_EQ(second["levels"][0].as<double>(), 6.0);
  EXPECT_EQ(second["positions"][0][1].as<double>(), 30.0);
  EXPECT_EQ(second["frequencies"]["count"].as<int>(), 4);  // lines 1, 3, 5, 9
}

TEST(VerdictFile, HasTheFieldsOfTheFormat) {
  const auto json = verdict_json(explained(), kHypotheses, {"robot.yaml", "campaign.yaml"});
  EXPECT_EQ(json["format"], "graybox-verdict/1");
  EXPECT_EQ(json["verdict"], "explained");
  EXPECT_EQ(json["physics"][0]["location"]["joint"], "joint_3");
  EXPECT_EQ(json["physics"][0]["parameters"]["stiffness"]["value"], 1.9e9);
  EXPECT_EQ(json["mismatch"]["nonlinear"], true);
  EXPECT_TRUE(json["mismatch"]["smallest_detectable"][1]["amplitude"].is_null());
  EXPECT_NEAR(json["fit"]["after"]["validation"]["chi_square_per_dof"].get<double>(), 0.995, 1e-12);
  EXPECT_FALSE(json.dump().empty());
}

TEST(VerdictFile, NamesTheCellsThatAreMoreThanNoise) {
  const MismatchSummary summary = summarise_mismatch(explained().mismatch_before);
  EXPECT_EQ(summary.channels, std::vector<std::string>{"y_3"});
  EXPECT_EQ(summary.levels, std::vector<double>{3.0});
  ASSERT_EQ(summary.bands.size(), 1U);  // two that touch
  EXPECT_EQ(summary.bands[0], (std::pair<double, double>(5.0, 12.0)));
}

TEST(VerdictFile, WithoutAFitThereIsNoAfter) {
  Diagnosis diagnosis;
  diagnosis.trouble = "the model as it is can't be fitted: no equilibrium";
  const auto json = verdict_json(diagnosis, kHypotheses, {"m", "c"});
  EXPECT_TRUE(json["fit"]["before"].is_null());
  EXPECT_EQ(json["verdict"], "unknown");
  EXPECT_NE(report_page(diagnosis, kHypotheses, {"m", "c"}).find("no equilibrium"),
            std::string::npos);
}

TEST(ReportPage, SaysTheVerdictInThreeSentencesAtMost) {
  Diagnosis diagnosis = explained();
  const std::vector<std::string> sentences = verdict_in_short(diagnosis, kHypotheses);
  ASSERT_GE(sentences.size(), 2U);
  EXPECT_LE(sentences.size(), 3U);
  EXPECT_EQ(sentences[0],
            "Physics is missing, and it is explained: cubic spring at joint_3.gearbox.");
  EXPECT_NE(sentences[1].find("the error falls from"), std::string::npos);
  diagnosis.verdict = Verdict::kUnknown;
  diagnosis.reasons = {{.test = "a test", .value = 5.0, .limit = 2.0, .passed = false}};
  EXPECT_EQ(verdict_in_short(diagnosis, kHypotheses).back(),
            "It fails 1 of 1 tests, first: a test, 5 where at most 2 is allowed.");
  // Nothing missing: the test that something is has failed, which is no failure of the model.
  diagnosis.verdict = Verdict::kNone;
  EXPECT_EQ(verdict_in_short(diagnosis, kHypotheses).size(), 2U);
  EXPECT_EQ(report_page(diagnosis, kHypotheses, {"m", "c"}).find("id=\"reasons\""),
            std::string::npos);
}

TEST(ReportPage, IsOneFileWithItsFigures) {
  const std::string page = report_page(explained(), kHypotheses, {"<robot>.yaml", "campaign.yaml"});
  EXPECT_EQ(page.rfind("<!doctype html>", 0), 0U);
  EXPECT_NE(page.find("&lt;robot&gt;.yaml"), std::string::npos);
  EXPECT_EQ(page.find("src="), std::string::npos);
  EXPECT_EQ(page.find("href=\"http"), std::string::npos);
  // Two maps before, two after, and the law.
  const std::vector<ReportFigure> figures = report_figures(explained(), kHypotheses);
  EXPECT_GE(figures.size(), 5U);
  for (const ReportFigure& figure : figures) {
    EXPECT_NE(page.find(figure.svg), std::string::npos) << figure.name;
  }
  if (const char* target = std::getenv("GRAYBOX_KEEP_PAGE")) std::ofstream(target) << page;
}

TEST(SvgChart, TicksAreRoundAndInside) {
  EXPECT_EQ(round_ticks(0.0, 10.0, 5), (std::vector<double>{0, 2, 4, 6, 8, 10}));
  for (const double tick : round_ticks(-3.1e-5, 7.7e-5, 6)) {
    EXPECT_GE(tick, -3.1e-5);
    EXPECT_LE(tick, 7.7e-5);
  }
  EXPECT_TRUE(round_ticks(1.0, 1.0, 5).empty());
}

TEST(SvgChart, LeavesOutWhatCanNotBeShown) {
  Chart chart;
  chart.x.logarithmic = chart.y.logarithmic = true;
  chart.series = {{"a & b", {1.0, -2.0, 10.0}, {std::nan(""), 1.0, 3.0}, "#000000", false}};
  const std::string svg = svg_chart(chart);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  EXPECT_EQ(svg.find("inf"), std::string::npos);
  EXPECT_NE(svg.find("a &amp; b"), std::string::npos);
  const std::string empty = svg_chart({"nothing", {"x", false}, {"y", false}, {}});
  EXPECT_EQ(empty.find("inf"), std::string::npos);
}

class ExtendedModel : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(::testing::TempDir()) /
              ::testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::filesystem::path write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  std::filesystem::path folder_;
};

TEST_F(ExtendedModel, OfARobotIsReadAgainWithEstimatesAndElements) {
  const std::filesystem::path model = default_robot_file();
  const ExtendedFit fit = explained().after;
  const std::filesystem::path target = folder_ / "model_extended.yaml";
  write("model_extended.yaml", extended_model_text(model, target, fit, kHypotheses));
  const ExtendedRobot before = load_extended_robot(model);
  const ExtendedRobot after = load_extended_robot(target);
  ASSERT_EQ(after.elements.size(), before.elements.size() + 1);
  EXPECT_EQ(after.elements.back().law_name, "cubic_spring");
  EXPECT_EQ(after.elements.back().parameters, std::vector<double>{1.9e9});
  EXPECT_EQ(after.elements.back().location.name, "joint_3.gearbox");
  for (std::size_t i = 0; i < before.robot.springs.size(); ++i) {
    const double factor = before.robot.springs[i].name == "joint_1.gearbox" ? 1.5 : 1.0;
    EXPECT_DOUBLE_EQ(after.robot.springs[i].stiffness, factor * before.robot.springs[i].stiffness);
  }
}

TEST_F(ExtendedModel, OfALumpedModelIsReadAgain) {
  const std::filesystem::path model = write("drive.yaml", R"(
format: graybox-lumped/1
sample_time: 0.001
motion: rotation
masses: {motor: 0.0021, load: 0.035}
elements:
  - name: shaft
    location: {kind: element, between: [motor, load]}
    law: stiffness
    parameters: {stiffness: {value: 45, unit: N m/rad}}
  - name: load                                  # as a mass is called
    location: {kind: element, mass: load}
    law: viscous
    parameters: {damping: {value: 0.1, unit: N m s/rad}}
inputs: [{name: torque, mass: motor}]
outputs: [{name: speed, mass: motor, quantity: velocity}]
)");
  const std::vector<Hypothesis> hypotheses = {
      {"load", "{kind: element, mass: load}", "coulomb", {}}};
  ExtendedFit fit;
  fit.model_parameters = {{"shaft.stiffness", "N m/rad", 51.25, 0.1},
                          {"load.inertia", "kg m^2", 0.0375, 1e-4}};
  fit.laws = {{0, {{"level", "N m", 0.2, 0.01}, {"transition_velocity", "rad/s", 0.01, 0.001}}}};
  const std::filesystem::path target = folder_ / "extended.yaml";
  const std::string text = extended_model_text(model, target, fit, hypotheses);
  write("extended.yaml", text);
  LumpedModel extended;
  ASSERT_NO_THROW(extended = load_lumped_model(target)) << text;
  EXPECT_DOUBLE_EQ(extended.stiffness(0, 0), 51.25);
  EXPECT_DOUBLE_EQ(extended.mass(1, 1), 0.0375);
  ASSERT_EQ(extended.elements.size(), 1U);
  EXPECT_EQ(extended.elements[0].parameters, (std::vector<double>{0.2, 0.01}));
  // The found elements alone do the same to the model that they were missing in.
  const LumpedModel added =
      load_lumped_model(model, write("physics.yaml", physics_text(fit, hypotheses)));
  EXPECT_EQ(added.elements[0].parameters, extended.elements[0].parameters);
}

// Laws that a model has already, of robots, too: estimates without a unit are no factors, and a
// parameter may have been left out.
TEST_F(ExtendedModel, TakesTheEstimatesOfItsOwnLaws) {
  const std::string elements = R"(
elements:
  - {name: error, location: {kind: sensor, joint: joint_2}, law: gain,
     parameters: {error: {value: 0.02, unit: 1}}}
  - {name: limit, location: {kind: actuator, joint: joint_1}, law: saturation,
     parameters: {limit: {value: 3, unit: N m}}}
)";
  const std::filesystem::path robot = default_robot_file();
  std::ifstream stream(robot);
  const std::string text(std::istreambuf_iterator<char>(stream), {});
  for (const auto& entry : std::filesystem::directory_iterator(robot.parent_path())) {
    if (entry.path().extension() == ".urdf") {
      std::filesystem::copy(entry.path(), folder_ / entry.path().filename());
    }
  }
  const std::filesystem::path model = write("robot.yaml", text + elements);
  ExtendedFit fit;
  fit.model_parameters = {{"joint_1.gearbox", "1", 1.5, 0.1},
                          {"error.error", "1", 0.03, 1e-3},
                          {"limit.limit", "N m", 2.5, 0.1},
                          {"limit.corner", "N m", 0.25, 0.1}};
  const std::filesystem::path target = folder_ / "extended.yaml";
  write("extended.yaml", extended_model_text(model, target, fit, {}));
  const ExtendedRobot before = load_extended_robot(model), after = load_extended_robot(target);
  ASSERT_EQ(after.elements.size(), 2U);
  EXPECT_DOUBLE_EQ(after.elements[0].parameters[0], 0.03);
  EXPECT_EQ(after.elements[1].parameters, (std::vector<double>{2.5, 0.25}));
  for (std::size_t i = 0; i < before.robot.springs.size(); ++i) {
    const double factor = before.robot.springs[i].name == "joint_1.gearbox" ? 1.5 : 1.0;
    EXPECT_DOUBLE_EQ(after.robot.springs[i].stiffness, factor * before.robot.springs[i].stiffness);
  }
}

TEST_F(ExtendedModel, RefusesAnEstimateThatHasNoPlace) {
  ExtendedFit fit;
  fit.model_parameters = {{"joint_9.gearbox", "1", 1.0, 0.1}};
  EXPECT_THROW((void)extended_model_text(default_robot_file(), folder_ / "x.yaml", fit, {}),
               InputError);
}

}  // namespace
}  // namespace graybox
