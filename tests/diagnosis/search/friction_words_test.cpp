#include "diagnosis/verdict/friction_words.hpp"
#include "diagnosis/evidence/drive_units.hpp"

#include <gtest/gtest.h>

#include "diagnosis/evidence/number_words.hpp"

namespace graybox {
namespace {

LawParameterEstimate of(const std::string& name, double value) { return {name, "", value, 0.01}; }

// An elbow whose velocity and torque were recorded up to 2 rad/s.
class FrictionWords : public ::testing::Test {
 protected:
  FrictionWords() {
    diagnosis_.checked.spans = {{"velocity of elbow", "rad/s", -2.0, 1.5},
                                {"torque of elbow", "N m", -9.0, 9.0}};
  }
  void find(const std::string& law, std::vector<LawParameterEstimate> parameters) {
    FoundEffect effect;
    effect.law.hypothesis = hypotheses_.size();
    effect.law.parameters = std::move(parameters);
    hypotheses_.push_back({"elbow.arm", "", law, {}});
    diagnosis_.effects.push_back(std::move(effect));
  }
  [[nodiscard]] std::vector<std::string> lines() const {
    return friction_lines(diagnosis_, hypotheses_);
  }

  Diagnosis diagnosis_;
  std::vector<Hypothesis> hypotheses_;
};

TEST_F(FrictionWords, AddTheLawsOfAPlace) {
  find("coulomb", {of("level", 5.0), of("transition_velocity", 1e-4)});
  find("viscous", {of("damping", 2.0)});
  const std::vector<std::string> expected{
      "Friction of the arm axis of elbow: 5 N m at 0.02 rad/s, 5.4 at 0.2, 9 at 2."};
  EXPECT_EQ(lines(), expected);
}

// A diagnosis by prediction error checks positions, and knows how fast its model moved.
TEST_F(FrictionWords, TakeTheSpeedsOfTheModel) {
  find("coulomb", {{"level", "N m", 5.0, 0.1}, of("transition_velocity", 1e-4)});
  find("viscous", {of("damping", 2.0)});
  diagnosis_.checked.spans = {{"angle", "rad", -3.0, 3.0}};
  EXPECT_TRUE(lines().empty());
  diagnosis_.checked.recorded = {{"velocity of elbow", "rad/s", -2.0, 1.5}};
  const std::vector<std::string> expected{
      "Friction of the arm axis of elbow: 5 N m at 0.02 rad/s, 5.4 at 0.2, 9 at 2."};
  EXPECT_EQ(lines(), expected);
}

// A curve is told where the machine slid, and what it stood under beside it.
TEST_F(FrictionWords, SayNothingOfSpeedsThatDidNotLast) {
  find("coulomb", {of("level", 5.0), of("transition_velocity", 1e-4)});
  find("viscous", {of("damping", 2.0)});
  diagnosis_.checked.spans[0].slowest = 0.5;
  diagnosis_.checked.standing = CheckedRange::Standing{"elbow", "N m", {-1.0, 4.0}};
  const std::vector<std::string> expected{
      "Friction of the arm axis of elbow: 6 N m at 0.5 rad/s, 9 at 2. It stood still under -1 to 4 "
      "N m at one place."};
  EXPECT_EQ(lines(), expected);
}

// Whole units alone are renamed, the longest name first.
TEST(DriveUnits, TakeThePlaceOfNewtonMetres) {
  const auto in = [](const char* text) { return in_drive_unit(std::string(text), "mA"); };
  EXPECT_EQ(in("3 N m, 2 N m/rad, 1 N m s/rad, (0.1 kg m^2)"),
            "3 mA, 2 mA/rad, 1 mA s/rad, (0.1 mA s^2/rad)");
  EXPECT_EQ(in("3 N, 2 N/m, 1 N s/m and 0.5 kg."), "3 mA, 2 mA/m, 1 mA s/m and 0.5 mA s^2/m.");
  EXPECT_EQ(in("Nothing of 'N m' in NAME, in log_N or in kgf"),
            "Nothing of 'N m' in NAME, in log_N or in kgf");
  EXPECT_EQ(in_drive_unit(std::string("3 N m"), ""), "3 N m");
}

TEST(NumberWords, HaveNoPowersOfTenBelowAMillion) {
  EXPECT_EQ(three_digits(1212.3), "1210");
  EXPECT_EQ(three_digits(-99960.0), "-100000");
  EXPECT_EQ(three_digits(999.7), "1000");
  EXPECT_EQ(three_digits(0.01234), "0.0123");
  EXPECT_EQ(three_digits(2.5e7), "2.5e+07");
}

TEST_F(FrictionWords, HaveNoPowersOfTen) {
  find("coulomb", {of("level", 1234.0), of("transition_velocity", 1e-4)});
  const std::vector<std::string> expected{
      "Friction of the arm axis of elbow: 1200 N m at 0.02 rad/s, 1200 at 0.2, 1200 at 2."};
  EXPECT_EQ(lines(), expected);
}

TEST_F(FrictionWords, TellDirectionsApart) {
  find("asymmetric_coulomb",
       {of("forward_level", 3.0), of("backward_level", 6.0), of("transition_velocity", 1e-4)});
  const std::vector<std::string> expected{
      "Friction of the arm axis of elbow: 3 N m forward and 6 backward at 0.02 rad/s, 3 forward "
      "and 6 backward at 0.2, 3 forward and 6 backward at 2."};
  EXPECT_EQ(lines(), expected);
}

TEST_F(FrictionWords, LeaveOutWhatTheyCannotSay) {
  find("viscous", {of("damping", 2.0)});
  EXPECT_TRUE(lines().empty()) << "viscous friction says it all";
  find("bouc_wen", {});
  EXPECT_TRUE(lines().empty()) << "it has a memory";
  find("coulomb", {of("level", 5.0), of("transition_velocity", 1e-4)});
  EXPECT_TRUE(lines().empty()) << "beside one with memory";
  diagnosis_.effects.erase(diagnosis_.effects.begin(), diagnosis_.effects.begin() + 2);
  EXPECT_EQ(lines().size(), 1U);
  diagnosis_.checked.spans.clear();
  EXPECT_TRUE(lines().empty()) << "speeds are not known";
}

// Nothing is said of speeds that were never recorded.
TEST_F(FrictionWords, BeginAtTheSlowestSpeedOfMotionOneWay) {
  find("coulomb", {of("level", 5.0), of("transition_velocity", 1e-4)});
  find("viscous", {of("damping", 2.0)});
  diagnosis_.checked.spans[0] = {"velocity of elbow", "rad/s", -2.0, -0.1};
  EXPECT_EQ(lines().at(0),
            "Friction of the arm axis of elbow: 5.2 N m at 0.1 rad/s, 5.4 at 0.2, 9 at 2.");
  diagnosis_.checked.spans[0] = {"velocity of elbow", "rad/s", 0.5, 2.0};
  EXPECT_EQ(lines().at(0), "Friction of the arm axis of elbow: 6 N m at 0.5 rad/s, 9 at 2.");
}

// 30 - 10 * 2 = 10 at the highest speed.
TEST_F(FrictionWords, AddTheModelsOwnDamping) {
  find("coulomb", {of("level", 30.0), of("transition_velocity", 1e-4)});
  hypotheses_[0].place = "elbow";
  diagnosis_.after.model_parameters = {{"elbow.inertia", "kg m^2", 4.0, 0.1},
                                       {"bearing.damping", "N m s/rad", -10.0, 1.0}};
  EXPECT_EQ(lines().at(0), "Friction of elbow: 30 N m at 0.02 rad/s, 28 at 0.2, 10 at 2.");
  // Beside a second mass nothing tells whose damping it is.
  diagnosis_.after.model_parameters.push_back({"wrist.inertia", "kg m^2", 4.0, 0.1});
  EXPECT_EQ(lines().at(0), "Friction of elbow: 30 N m at 0.02 rad/s, 30 at 0.2, 30 at 2.");
}

}  // namespace
}  // namespace graybox
