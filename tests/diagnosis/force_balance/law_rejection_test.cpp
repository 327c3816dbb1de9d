// What recordings kept out say of laws that were found in a balance of forces.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "diagnosis/evidence/verdict_reasons.hpp"
#include "diagnosis/hypotheses/law_shapes.hpp"
#include "diagnosis/plausibility/plausibility.hpp"
#include "tests/support/recorded_carriage.hpp"

namespace graybox {
namespace {

using testing::named;

class LawRejection : public testing::RecordedCarriage {};

bool fails(const Diagnosis& diagnosis, const std::string& test) {
  return std::ranges::any_of(diagnosis.reasons, [&](const VerdictReason& reason) {
    return has_failed(reason) && reason.test.find(test) != std::string::npos;
  });
}

TEST_F(LawRejection, SaysWhatALawGainsOnRecordingsKeptOutAndWhereItWasChecked) {
  record([](double, double v) { return 8.0 * std::tanh(v / 0.01); }, 1.0, 3);
  const auto data = problem();
  const Diagnosis diagnosis = diagnose(*data);
  ASSERT_EQ(diagnosis.effects.size(), 1U);
  const std::optional<HeldOutEffect>& held_out = diagnosis.effects[0].held_out;
  ASSERT_TRUE(held_out);
  EXPECT_NEAR(held_out->error_without, diagnosis.validation_before->nrmse, 1e-9);
  EXPECT_NEAR(held_out->error_with, diagnosis.validation_after->nrmse, 1e-9);
  EXPECT_GT(held_out->gain, 0.8);
  EXPECT_TRUE(diagnosis.rejected.empty());
  EXPECT_EQ(excluding(diagnosis.implausible), 0U);
  EXPECT_TRUE(diagnosis.checked.kept_out);
  EXPECT_EQ(diagnosis.checked.files, std::vector<std::string>{"run_2.csv"});
  const auto velocity = std::ranges::find(diagnosis.checked.spans, "velocity of carriage",
                                          &CheckedRange::Span::quantity);
  ASSERT_NE(velocity, diagnosis.checked.spans.end());
  // No more than all sines together, and most of that.
  EXPECT_LT(velocity->to, 0.3 * 1.1 + 0.1 * 2.9 + 0.03 * 6.1 + 1e-9);
  EXPECT_GT(velocity->to, 0.4);
  EXPECT_LT(velocity->from, -0.4);
}

// A spring that was there while the fit's recording was made, and no longer.
TEST_F(LawRejection, RejectsALawThatRaisesTheErrorOfRecordingsKeptOut) {
  int samples = 0;
  record([&samples](double x, double) { return ++samples <= 1500 ? 300.0 * x * x * x : 0.0; }, 0.5,
         4);
  const Diagnosis diagnosis = diagnose(*problem());
  EXPECT_TRUE(diagnosis.effects.empty());
  ASSERT_FALSE(diagnosis.rejected.empty());
  ASSERT_TRUE(diagnosis.rejected[0].held_out);
  EXPECT_LT(diagnosis.rejected[0].held_out->gain, 0.0);
  EXPECT_GT(diagnosis.rejected[0].held_out->error_with,
            diagnosis.rejected[0].held_out->error_without);
  EXPECT_EQ(diagnosis.verdict, Verdict::kUnknown);
  EXPECT_TRUE(fails(diagnosis, "laws found"));
}

// An exponent that predicts the fit's own blocks better and is next to nothing where the noise is
// larger: what was kept out does not ask for it.
TEST_F(LawRejection, NamesTheSpecialCaseWhereTheRicherLawGainsNextToNothing) {
  Random random(11);
  int samples = 0;
  record(
      [&](double, double v) {
        const bool is_kept_out = samples++ >= 1500;
        return 5.0 * std::copysign(std::pow(std::abs(v) / 0.3, 0.1), v) + 8.0 * v +
               (is_kept_out ? 2.0 * random.normal() : 0.0);
      },
      0.3, 3);
  const auto data = problem();
  const Diagnosis diagnosis = diagnose(*data);
  std::vector<std::string> found;
  for (const FoundEffect& effect : diagnosis.effects) found.push_back(named(*data, effect).law);
  std::ranges::sort(found);
  EXPECT_EQ(found, (std::vector<std::string>{"coulomb", "viscous"}));
  const auto gave_way = [&](const RejectedLaw& rejected) {
    return data->hypotheses()[rejected.law.hypothesis].law == "sublinear_friction" &&
           rejected.reason.starts_with("with coulomb in its place");
  };
  EXPECT_TRUE(std::ranges::any_of(diagnosis.rejected, gave_way));
}

// newcomer.md, section 5, 5: damping of -0.003, "explained".
TEST_F(LawRejection, NeverExplainsAnythingByNegativeDamping) {
  record([](double, double v) { return -4.0 * v; }, 0.2, 5);
  SearchOptions options;
  options.ignore_channel_faults = true;
  const Diagnosis diagnosis = diagnose(*problem(), options);
  EXPECT_NE(diagnosis.verdict, Verdict::kExplained);
  const auto is_named = std::ranges::any_of(diagnosis.rejected, [](const RejectedLaw& law) {
    return law.reason.starts_with("friction would be negative");
  });
  EXPECT_TRUE(is_named);
  for (const FoundEffect& effect : diagnosis.effects) {
    for (const LawParameterEstimate& each : effect.law.parameters) {
      const bool is_damping = each.name.find("damping") != std::string::npos;
      EXPECT_FALSE(is_damping && each.value < -3.0 * each.standard_error) << each.name;
    }
  }
}

// Part of a turn tells no period of a turn from one that is a little shorter; a weight has none.
TEST(Ripples, OfAboutATurnAreWeights) {
  const double turn = 2.0 * std::numbers::pi;
  EXPECT_TRUE(is_about_a_turn(turn));
  EXPECT_TRUE(is_about_a_turn(6.08));
  EXPECT_FALSE(is_about_a_turn(0.5 * turn));
  EXPECT_FALSE(is_about_a_turn(2.0 * turn));
}

}  // namespace
}  // namespace graybox
