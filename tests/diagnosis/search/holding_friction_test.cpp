// Friction that was found, beside what the machine stood still under.
#include "diagnosis/evidence/holding_friction.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace graybox {
namespace {

// A motor that stood under 0 to 180 N m and ran at 700 rad/s.
class HoldingFriction : public ::testing::Test {
 protected:
  HoldingFriction() {
    diagnosis_.checked.recorded = {{"velocity of motor", "rad/s", -10.0, 700.0}};
    diagnosis_.checked.standing = CheckedRange::Standing{"motor", "N m", {0.0, 180.0}};
  }
  void find(const std::string& place, const std::string& law,
            std::vector<LawParameterEstimate> parameters) {
    FoundEffect effect;
    effect.law.hypothesis = hypotheses_.size();
    effect.law.parameters = std::move(parameters);
    hypotheses_.push_back({place, "", law, {}});
    diagnosis_.effects.push_back(std::move(effect));
  }
  [[nodiscard]] VerdictReason reason() {
    add_holding_friction(hypotheses_, diagnosis_);
    return holding_reason(diagnosis_.checked).value();
  }

  Diagnosis diagnosis_;
  std::vector<Hypothesis> hypotheses_;
};

TEST_F(HoldingFriction, PassesWhereItHolds) {
  find("motor", "coulomb", {{"level", "N m", 110.0, 3.0}, {"transition_velocity", "rad/s", 0.3}});
  const VerdictReason holds = reason();
  EXPECT_TRUE(holds.passed);
  EXPECT_NEAR(*holds.value, 110.0, 1e-9);
  EXPECT_EQ(holds.limit, 45.0);  // half of what friction held for sure
  EXPECT_NE(holds.test.find("motor stood under 0 to 180 N m"), std::string::npos) << holds.test;
}

// A damper by another name: 137 N m at full speed, and 3.7 where it crept.
TEST_F(HoldingFriction, FailsWhereFrictionSlidesOverGradually) {
  find("motor", "coulomb",
       {{"level", "N m", 137.0, 42.0}, {"transition_velocity", "rad/s", 260.0}});
  const VerdictReason holds = reason();
  EXPECT_FALSE(holds.passed);
  EXPECT_NEAR(*holds.value, 3.7, 0.1);
  EXPECT_FALSE(holds.next.empty());
}

TEST_F(HoldingFriction, CountsWhatElseHolds) {
  find("motor", "viscous", {{"damping", "N m s/rad", 0.2}});
  EXPECT_FALSE(reason().passed);
  find("actuator torque", "dead_zone", {{"half_width", "N m", 100.0}});
  EXPECT_TRUE(reason().passed) << "a drive that does nothing so small";
  diagnosis_.effects.pop_back();
  EXPECT_FALSE(reason().passed);
  find("motor", "dahl", {{"stiffness", "N m/rad", 9.0}, {"level", "N m", 90.0}});
  EXPECT_TRUE(reason().passed);
}

TEST_F(HoldingFriction, IsNotAskedWithoutAStandstill) {
  diagnosis_.checked.standing.reset();
  add_holding_friction(hypotheses_, diagnosis_);
  EXPECT_FALSE(holding_reason(diagnosis_.checked).has_value());
  diagnosis_.checked.standing = CheckedRange::Standing{"motor", "N m", {0.0, 180.0}};
  EXPECT_FALSE(holding_reason(diagnosis_.checked).has_value()) << "not asked yet";
}

}  // namespace
}  // namespace graybox
