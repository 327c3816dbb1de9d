// What `graybox model` says of a position beside its velocity, and of a drive that changes between
// the rows: signs in a bit of their own, offsets, coarse positions. All logs are simulated here.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/log_columns/encoder_steps.hpp"
#include "diagnosis/log_columns/position_jitter.hpp"
#include "diagnosis/log_columns/sign_bit.hpp"
#include "diagnosis/proposal/proposal.hpp"
#include "tests/support/proposal_words.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using Values = std::vector<double>;
using Column = std::pair<std::string, Values>;

struct Rows {
  Values time, position, velocity, force;
};

// J v' = u - b v - c sign(v), with u(t) held for a fine step; every `thin` of these is a row.
Rows rows_of(const std::function<double(double)>& force, int rows, double step, int thin = 1) {
  constexpr double kInertia = 0.02, kDamping = 0.05, kDry = 0.05;
  constexpr int kSteps = 20;
  Rows result;
  double q = 0.0, v = 0.0;
  for (int k = 0; k < rows * thin; ++k) {
    const double t = step * k / thin, u = force(t);
    if (k % thin == 0) {
      result.time.push_back(t);
      result.position.push_back(q);
      result.velocity.push_back(v);
      result.force.push_back(u);
    }
    for (int s = 0; s < kSteps; ++s) {
      v += (u - kDamping * v - kDry * std::tanh(v / 0.01)) / kInertia * step / thin / kSteps;
      q += v * step / thin / kSteps;
    }
  }
  return result;
}

double two_sines(double t) { return 0.6 * std::sin(2.0 * t) + 0.3 * std::sin(5.1 * t + 1.0); }

Values mapped(const Values& values, const std::function<double(double)>& change) {
  Values result;
  for (const double value : values) result.push_back(change(value));
  return result;
}

class LogMotions : public ::testing::Test, protected testing::ProposalWords {
 protected:
  ModelProposal proposed(const std::vector<Column>& columns,
                         const std::vector<std::string>& answers = {},
                         ProposalRequest request = {}) {
    std::string text;
    for (const Column& column : columns) text += (text.empty() ? "" : ",") + column.first;
    text += "\n";
    for (std::size_t k = 0; k < columns.front().second.size(); ++k) {
      for (std::size_t c = 0; c < columns.size(); ++c) {
        text += fmt::format("{}{:.9g}", c == 0 ? "" : ",", columns[c].second[k]);
      }
      text += "\n";
    }
    testing::write_text(folder_.file("log.csv"), text);
    request.machine = ProposedMachine::kOneMass;
    request.logs = {folder_.file("log.csv")};
    request.folder = folder_.file("axis");
    for (const std::string& each : answers) request.columns.push_back(column_answer(each));
    return propose_model(request);
  }

  testing::TemporaryFolder folder_;
};

// ---- drives that change between the rows --------------------------------------------------------

// Noise that changes eight times a row, and the same held for its row, which the motion follows.
TEST_F(LogMotions, ADriveFasterThanItsRowsIsTold) {
  const auto proposal_of = [&](int thin, const std::string& title) {
    std::mt19937_64 random(7);
    std::normal_distribution<double> noise(0.0, 1.0);
    const Rows rows = rows_of([&](double) { return noise(random); }, 600, 0.01, thin);
    return proposed({{"time [s]", rows.time}, {"angle [rad]", rows.position}, {title, rows.force}});
  };
  const std::string words = "changes by its own size from row to row (1.";
  const ModelProposal fast = proposal_of(8, "voltage [V]");
  EXPECT_TRUE(says(fast, "'voltage [V]' " + words) || says(fast, "'voltage' " + words))
      << all_of(fast);
  EXPECT_TRUE(says(fast, "log it faster"));
  const ModelProposal held = proposal_of(1, "voltage [V]");
  EXPECT_FALSE(says(held, "changes by its own size")) << all_of(held);
  EXPECT_TRUE(says(proposal_of(1, "current [A]"), words));
}

// Ordinary drives: sines, steps of any size that are held for five rows, and two levels.
TEST_F(LogMotions, ADriveThatKeepsUpWithItsRowsIsNotDoubted) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0.0, 1.0);
  double value = 0.0;
  int row = 0;
  const auto held = [&](double) {
    if (row++ % 5 == 0) value = noise(random);
    return value;
  };
  const auto levels = [&](double) { return noise(random) > 0.0 ? 1.0 : -1.0; };
  const std::vector<std::function<double(double)>> forces{two_sines, held, levels};
  for (const std::function<double(double)>& force : forces) {
    const Rows rows = rows_of(force, 600, 0.01);
    const ModelProposal proposal = proposed(
        {{"time [s]", rows.time}, {"angle [rad]", rows.position}, {"current [A]", rows.force}});
    EXPECT_FALSE(says(proposal, "changes by its own size")) << all_of(proposal);
  }
}

// What a segment leaves out of a log is said, and nothing where it leaves nothing out.
TEST_F(LogMotions, WhatSegmentsLeaveOutIsSaid) {
  const auto campaign_of = [&](double begin, double end) {
    const Rows rows =
        rows_of([&](double t) { return t < begin || t > end ? 0.0 : two_sines(t); }, 1500, 0.01);
    return proposed({{"time [s]", rows.time}, {"angle [rad]", rows.position}, {"tau", rows.force}})
        .campaign_text;
  };
  const std::string cut = campaign_of(2.0, 12.0), whole = campaign_of(0.0, 20.0);
  EXPECT_NE(cut.find("# samples, from 0; standstill at the ends is left out"), std::string::npos)
      << cut;
  EXPECT_NE(whole.find("# samples, from 0\n"), std::string::npos) << whole;
  EXPECT_EQ(whole.find("standstill"), std::string::npos) << whole;
}

// A word is a title that says what a column is; a letter usually means it.
TEST_F(LogMotions, WordsAreNoLetters) {
  const Rows rows = rows_of(two_sines, 600, 0.01);
  const auto drive_of = [&](const std::string& title) {
    return value_of(
        proposed({{"time [s]", rows.time}, {"angle [rad]", rows.position}, {title, rows.force}}),
        "drive");
  };
  EXPECT_EQ(drive_of("command"), "'command'; its title");
  EXPECT_EQ(drive_of("u"), "'u'; a letter that usually means that");
}

// 76 to 91 of a tilt are hardly radians: twelve turns from zero, and never back.
TEST_F(LogMotions, AnAngleFarFromZeroIsAskedForItsUnit) {
  const Rows rows = rows_of(two_sines, 600, 0.01);
  const auto asks = [&](const std::string& title, double size, double offset) {
    const Values place = mapped(
        rows.position, [=](double q) { return std::round(100.0 * (offset + size * q)) / 100.0; });
    const ModelProposal proposal =
        proposed({{"time [s]", rows.time}, {"torque [N m]", rows.force}, {title, place}});
    const bool any = !proposal.questions.empty();
    EXPECT_EQ(any, says(proposal, "and has no unit: which is it?")) << all_of(proposal);
    if (any) {
      EXPECT_TRUE(says(proposal, "lies between ")) << all_of(proposal);
      EXPECT_TRUE(says(proposal, fmt::format("--column '{}=position:deg'", title)));
    }
    return any;
  };
  EXPECT_TRUE(asks("tilt", 0.2, 84.0));
  EXPECT_TRUE(asks("angle", 0.2, -84.0));
  EXPECT_FALSE(asks("tilt", 0.2, 1.5));
  EXPECT_FALSE(asks("tilt [rad]", 0.2, 84.0));
  EXPECT_FALSE(asks("position", 0.2, 84.0));  // of a motor, after many turns
}

// What its title calls a position or a velocity does not drive, though it stands still.
TEST_F(LogMotions, StillMotionsAreNoDrives) {
  const Rows rows = rows_of(two_sines, 600, 0.01);
  const auto still = [&](double value) { return Values(rows.time.size(), value); };
  const ModelProposal proposal = proposed({{"time [s]", rows.time},
                                           {"insertion/position", still(60004.0)},
                                           {"pitch/velocity", still(1.0)},
                                           {"roll_effort", still(0.0)},
                                           {"roll_position [deg]", rows.position}});
  EXPECT_TRUE(says(proposal, "(constant here: 'roll_effort')")) << all_of(proposal);
}

// ---- a sign in a bit of its own -----------------------------------------------------------------

double in_magnitude(double value, int bit) {
  const double whole = std::round(value);
  return whole < 0.0 ? std::ldexp(1.0, bit) - whole : whole;
}

// A servo's telemetry: counts, their rate with its sign in bit 15, the effort with that in bit 10.
TEST_F(LogMotions, ASignBitIsNoticed) {
  constexpr double kCount = 650.0;  // a radian
  const Rows rows = rows_of(two_sines, 600, 0.05);
  const ModelProposal proposal = proposed(
      {{"time [s]", rows.time},
       {"pos", mapped(rows.position, [](double q) { return std::round(kCount * q); })},
       {"speed", mapped(rows.velocity, [](double v) { return in_magnitude(kCount * v, 15); })},
       {"load", mapped(rows.force, [](double u) { return in_magnitude(400.0 * u, 10); })}});
  EXPECT_TRUE(says(proposal, "'speed' would be the rate of 'pos' with bit 15 as its sign"))
      << all_of(proposal);
  EXPECT_TRUE(says(proposal, "write 32768 - x for each x from 32768 on"));
  EXPECT_TRUE(says(proposal, "How many counts of 'pos' are a turn?")) << all_of(proposal);
  EXPECT_TRUE(says(proposal, "'speed' is not the rate of 'pos': it is not used"));
  EXPECT_TRUE(says(proposal, "'load' jumps as a number does that has bit 10 as its sign"));
  EXPECT_FALSE(says(proposal, "its sign while the axis moves both ways")) << all_of(proposal);
}

// A speed tells the counts of a turn within a thousandth, and encoders have some numbers only.
TEST_F(LogMotions, CountsATurnAreThoseOfEncoders) {
  const Rows rows = rows_of(two_sines, 2000, 0.01);
  const auto counted = [&](double counts) {
    const double turn = 2.0 * std::numbers::pi;
    return proposed(
        {{"time [s]", rows.time},
         {"enc [counts]",
          mapped(rows.position, [&](double q) { return std::round(counts * q / turn); })},
         {"speed [rpm]", mapped(rows.velocity, [&](double v) { return v * 60.0 / turn; })},
         {"current [A]", rows.force}});
  };
  const ModelProposal near = counted(2401.0);
  EXPECT_TRUE(says(near, "2400 counts a turn, as encoders have: from 'speed' it is 2"))
      << all_of(near);
  EXPECT_NE(near.campaign_text.find("value: 0.0026179939, unit: rad/counts"), std::string::npos)
      << near.campaign_text;
  const ModelProposal other = counted(2417.0);  // a gear that is no whole number
  EXPECT_TRUE(says(other, " counts a turn, from 'speed'")) << all_of(other);
  for (const double counts : {1200.0, 1320.0, 2048.0, 2400.0, 4096.0, 8192.0, 10000.0, 1048576.0}) {
    EXPECT_EQ(counts_of_encoders(1.0004 * counts).value_or(0.0), counts);
    EXPECT_FALSE(counts_of_encoders(1.004 * counts)) << counts;
  }
  EXPECT_FALSE(counts_of_encoders(12.0));
}

// Magnitudes with a sign, numbers above 2^10 without jumps, and a two's complement.
TEST_F(LogMotions, OtherNumbersHaveNoSignBit) {
  constexpr int kSamples = 400;
  Eigen::VectorXd bit(kSamples), smooth(kSamples), complement(kSamples);
  for (int k = 0; k < kSamples; ++k) {
    const double value = 300.0 * std::sin(0.1 * k);
    bit(k) = in_magnitude(value, 10);
    smooth(k) = std::round(1000.0 + value);
    complement(k) = std::round(value) + (std::round(value) < 0.0 ? 65536.0 : 0.0);
  }
  const auto found = find_sign_bit(bit);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->bit, 10);
  EXPECT_DOUBLE_EQ(found->signed_of(1100.0), -76.0);
  EXPECT_DOUBLE_EQ(found->signed_of(76.0), 76.0);
  EXPECT_FALSE(find_sign_bit(smooth));
  EXPECT_FALSE(find_sign_bit(complement));
  EXPECT_FALSE(find_sign_bit(-bit));
}

// ---- offsets ------------------------------------------------------------------------------------

TEST_F(LogMotions, AnOffsetOfTheVelocityIsTold) {
  const Rows rows = rows_of(two_sines, 1000, 0.02);
  const auto proposal_of = [&](double offset) {
    return proposed(
        {{"time [s]", rows.time},
         {"angle", mapped(rows.position, [](double q) { return std::round(100 * q) / 100; })},
         {"speed", mapped(rows.velocity, [&](double v) { return v + offset; })},
         {"torque [N m]", rows.force}},
        {"angle=position:rad", "speed=velocity:rad/s"});
  };
  const ModelProposal shifted = proposal_of(3.0);
  EXPECT_TRUE(
      says(shifted, "'speed' has an offset: where 'angle' stands still it is about 3 rad/s"))
      << all_of(shifted);
  EXPECT_EQ(value_of(shifted, "position"),
            "'angle' in rad; you said so, and the velocity agrees but for its offset");
  const ModelProposal sound = proposal_of(0.0);
  EXPECT_FALSE(says(sound, "offset")) << all_of(sound);
  EXPECT_EQ(value_of(sound, "position"), "'angle' in rad; you said so, and the velocity agrees");
}

// A position of some thirty levels beside a fine velocity; filtered or answered, it is kept.
TEST_F(LogMotions, ACoarsePositionGivesWayToAFineVelocity) {
  const Rows rows = rows_of(two_sines, 1000, 0.02);
  const Values coarse = mapped(rows.position, [](double q) { return std::round(q / 0.4) * 0.4; });
  Values late = rows.velocity;
  for (std::size_t k = late.size() - 1; k >= 8; --k) late[k] = late[k - 8];
  const auto proposal_of = [&](const Values& position, const Values& velocity,
                               const std::vector<std::string>& answers) {
    return proposed({{"time [s]", rows.time},
                     {"angle [rad]", position},
                     {"speed [rad/s]", velocity},
                     {"torque [N m]", rows.force}},
                    answers);
  };
  const ModelProposal fine = proposal_of(coarse, rows.velocity, {});
  EXPECT_NE(value_of(fine, "velocity"), "") << all_of(fine);
  EXPECT_TRUE(says(fine, "goes in steps of 0.4, and its rate so in steps at least"));
  EXPECT_TRUE(says(fine, "is not used"));
  EXPECT_NE(value_of(proposal_of(coarse, late, {}), "position"), "");
  EXPECT_NE(value_of(proposal_of(rows.position, rows.velocity, {}), "position"), "");
  EXPECT_NE(value_of(proposal_of(coarse, rows.velocity, {"angle=position:rad"}), "position"), "");
}

// Means over so many samples, half of them behind.
Eigen::VectorXd mean_over(const Eigen::VectorXd& values, Eigen::Index over) {
  Eigen::VectorXd means(values.size());
  for (Eigen::Index k = 0; k < values.size(); ++k) {
    const Eigen::Index first = std::max<Eigen::Index>(0, k - over / 2),
                       last = std::min(values.size() - 1, k + over / 2);
    means(k) = values.segment(first, last - first + 1).mean();
  }
  return means;
}

// A speed of its own is told from one that was computed, also from far smoother ones.
TEST(PositionJitter, ASpeedComputedFromThePositionIsTold) {
  constexpr Eigen::Index kRows = 800;
  constexpr double kStep = 0.01, kLowPass = 0.15;
  std::mt19937_64 random(2);
  std::normal_distribution<double> noise(0.0, 1.0);
  Eigen::VectorXd place(kRows), own(kRows), differences(kRows), low_pass(kRows);
  double q = 0.0;
  for (Eigen::Index k = 0; k < kRows; ++k) {
    const double t = kStep * static_cast<double>(k);
    const double speed = 12.0 + std::sin(5.0 * t) + 0.5 * std::sin(17.0 * t);
    place(k) = q + 0.05 * noise(random);
    own(k) = speed + 0.3 * noise(random);
    q += kStep * speed;
    differences(k) = k > 0 ? (place(k) - place(k - 1)) / kStep : 12.0;
    low_pass(k) = k > 0 ? low_pass(k - 1) + kLowPass * (differences(k) - low_pass(k - 1)) : 12.0;
  }
  const auto of_own = position_jitter(place, own, kStep);
  ASSERT_TRUE(of_own.has_value());
  EXPECT_TRUE(of_own->is_large());
  EXPECT_FALSE(of_own->is_speed_computed()) << of_own->computed;
  EXPECT_EQ(of_own->low_pass, 0.0);
  const auto of_low_pass = position_jitter(place, low_pass, kStep);
  ASSERT_TRUE(of_low_pass.has_value());
  EXPECT_TRUE(of_low_pass->is_large());
  EXPECT_TRUE(of_low_pass->is_speed_computed()) << of_low_pass->computed;
  EXPECT_NEAR(of_low_pass->low_pass, kLowPass, 0.02);
  for (const Eigen::Index over : {5, 21, 41}) {
    const auto smoothed = position_jitter(place, mean_over(differences, over), kStep);
    ASSERT_TRUE(smoothed.has_value());
    EXPECT_TRUE(smoothed->is_speed_computed()) << over << ": " << smoothed->computed;
  }
  const auto plain = position_jitter(place, differences, kStep);
  ASSERT_TRUE(plain.has_value());
  EXPECT_FALSE(plain->is_large());
  EXPECT_FALSE(position_jitter(place.head(50), own.head(50), kStep).has_value());
}

// A wheel at about one speed. A speed that was measured by itself is used where the position
// jitters; one that was computed from that position is none the better for it.
TEST_F(LogMotions, AJitteringPositionGivesWayToAVelocityOfItsOwn) {
  constexpr int kRows = 600;
  constexpr double kStep = 0.01;
  const Rows rows =
      rows_of([](double t) { return 0.65 + 0.1 * std::sin(5.0 * t) + 0.1 * std::sin(17.0 * t); },
              kRows, kStep);
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0.0, 1.0);
  const Values jittering = mapped(rows.position, [&](double q) { return q + 0.2 * noise(random); });
  const Values own = mapped(rows.velocity, [&](double v) { return v + 0.1 * noise(random); });
  Values differences(kRows), smoothed(kRows);
  differences[0] = smoothed[0] = rows.velocity[0];
  for (std::size_t k = 1; k < differences.size(); ++k) {
    differences[k] = (jittering[k] - jittering[k - 1]) / kStep;
    smoothed[k] = smoothed[k - 1] + 0.15 * (differences[k] - smoothed[k - 1]);
  }
  const auto proposal_of = [&](const Values& position, const Values& velocity) {
    return proposed({{"time [s]", rows.time},
                     {"angle [rad]", position},
                     {"speed [rad/s]", velocity},
                     {"torque [N m]", rows.force}},
                    {"torque=torque:N m"});
  };
  const ModelProposal calm = proposal_of(jittering, own);
  EXPECT_NE(value_of(calm, "velocity"), "") << all_of(calm);
  EXPECT_TRUE(says(calm, "'angle' jitters from row to row")) << all_of(calm);
  EXPECT_TRUE(says(calm, "'angle' is not used")) << all_of(calm);
  EXPECT_NE(value_of(proposal_of(jittering, differences), "position"), "");
  const ModelProposal low_pass = proposal_of(jittering, smoothed);
  EXPECT_NE(value_of(low_pass, "position"), "") << all_of(low_pass);
  EXPECT_NE(value_of(proposal_of(rows.position, own), "position"), "");
}

// A machine that turns one way: a velocity that is scaled has no offset.
TEST_F(LogMotions, AScaledVelocityHasNoOffset) {
  const Rows rows = rows_of([](double t) { return 0.5 + 0.1 * std::sin(2.0 * t); }, 1000, 0.02);
  const ModelProposal proposal =
      proposed({{"time [s]", rows.time},
                {"angle [rad]", rows.position},
                {"speed [rad/s]", mapped(rows.velocity, [](double v) { return 1.1 * v; })},
                {"torque [N m]", rows.force}});
  EXPECT_FALSE(says(proposal, "offset")) << all_of(proposal);
}

// ---- logs without a time ------------------------------------------------------------------------

TEST_F(LogMotions, TheQuestionForASampleTimeNamesTheLikelyOne) {
  const Rows rows = rows_of(two_sines, 1000, 0.02);
  const auto proposal_of = [&](const std::string& position, const std::string& velocity,
                               const Values& speed) {
    return proposed({{position, rows.position}, {velocity, speed}, {"torque [N m]", rows.force}});
  };
  const ModelProposal stated = proposal_of("angle [rad]", "speed [rad/s]", rows.velocity);
  EXPECT_TRUE(says(stated, "With 0.02 s 'speed")) << all_of(stated);
  const Values in_degrees = mapped(rows.velocity, [](double v) { return 57.29577951 * v; });
  EXPECT_TRUE(says(proposal_of("angle [rad]", "speed [deg/s]", in_degrees), "With 0.02 s 'speed"));
  EXPECT_TRUE(says(proposal_of("angle", "speed", rows.velocity), "', in like units."));
  const Values other = mapped(rows.time, [](double t) { return std::sin(11.0 * t); });
  EXPECT_FALSE(says(proposal_of("angle [rad]", "speed [rad/s]", other), "would be the rate"));
}

// ---- units --------------------------------------------------------------------------------------

TEST_F(LogMotions, ADriveOfUnknownGainSaysWhatItsUnitsMean) {
  const Rows rows = rows_of(two_sines, 600, 0.02);
  const auto notes_with = [&](const std::string& position, const std::string& drive) {
    return notes_of(
        proposed({{"time [s]", rows.time}, {position, rows.position}, {drive, rows.force}}));
  };
  EXPECT_NE(notes_with("position [m]", "current [mA]").find("and 1 kg is one mA per m/s^2"),
            std::string::npos);
  EXPECT_NE(notes_with("angle [rad]", "current").find("and 1 kg m^2 is one of it per rad/s^2"),
            std::string::npos);
}

// ---- speeds without sign -----------------------------------------------------------------------

// A Hall sensor reads the size of the speed: the start is that of the drive's size.
TEST_F(LogMotions, ASpeedWithoutSignIsTold) {
  const auto slow = [](double t) { return 0.6 * std::sin(t) + 0.2 * std::sin(0.37 * t); };
  const Rows rows = rows_of(slow, 2000, 0.01);
  const auto proposal_of = [&](const Values& speed) {
    return proposed({{"time [s]", rows.time}, {"pwm", rows.force}, {"speed [rad/s]", speed}});
  };
  const std::string words = "'speed' never changes its sign while 'pwm' does";
  for (const double way : {1.0, -1.0}) {
    const ModelProposal proposal =
        proposal_of(mapped(rows.velocity, [&](double v) { return way * std::abs(v); }));
    EXPECT_TRUE(says(proposal, words)) << all_of(proposal);
    EXPECT_FALSE(says(proposal, "revers")) << all_of(proposal);
    EXPECT_NEAR(std::stod(value_of(proposal, "mass")), 0.02, 0.01) << all_of(proposal);
  }
  EXPECT_FALSE(says(proposal_of(rows.velocity), words));
}

// A spindle that a drive of either sign speeds up and brakes turns one way.
TEST_F(LogMotions, ASpeedOfOneWayKeepsItsSign) {
  Values time, drive, speed;
  for (int k = 0; k < 2000; ++k) {
    time.push_back(0.01 * k);
    speed.push_back(1.0 - std::cos(time.back()));
    drive.push_back(std::sin(time.back()) + 0.1 * speed.back());
  }
  const ModelProposal proposal =
      proposed({{"time [s]", time}, {"pwm", drive}, {"speed [rad/s]", speed}});
  EXPECT_FALSE(says(proposal, "never changes its sign while 'pwm'")) << all_of(proposal);
}

// ---- drives of a controller ----------------------------------------------------------------

// The speed follows its target through a controller that was not logged.
TEST_F(LogMotions, ATargetOfTheSpeedIsNoDrive) {
  const auto proposal_of = [&](double gain, const std::string& title) {
    Values time, target, speed;
    double v = 0.0;
    for (int k = 0; k < 400; ++k) {
      time.push_back(0.01 * k);
      target.push_back(k < 100 ? -60.0 : k < 250 ? 50.0 : 20.0);
      speed.push_back(v);
      v += 0.1 * (gain * target.back() - v);
    }
    return proposed({{"time [s]", time}, {title, target}, {"speed [rad/s]", speed}});
  };
  const std::string words = "settle at the same numbers";
  EXPECT_TRUE(says(proposal_of(1.0, "command"), "'command' and 'speed' " + words + " (-60, 50)"))
      << all_of(proposal_of(1.0, "command"));
  EXPECT_FALSE(says(proposal_of(0.95, "command"), words));
  EXPECT_FALSE(says(proposal_of(1.0, "voltage [V]"), words));
}

// A machine at one speed, which a load disturbs and a controller holds, but for noise.
struct HeldSpeed {
  Values time, drive, speed;
};

HeldSpeed held_speed(const std::function<double(double speed, double noise)>& drive) {
  HeldSpeed rows;
  std::mt19937_64 random(11);
  std::normal_distribution<double> noise(0.0, 1.0);
  double v = 12.0;
  for (int k = 0; k < 400; ++k) {
    rows.time.push_back(0.01 * k);
    rows.drive.push_back(drive(v, noise(random)));
    rows.speed.push_back(v);
    v = 12.0 + 0.6 * (v - 12.0) + 0.9 * noise(random);
  }
  return rows;
}

TEST_F(LogMotions, ADriveMadeFromTheSpeedIsToldWithItsLine) {
  const auto proposal_of = [&](const HeldSpeed& rows, const std::string& title) {
    return proposed({{"time [s]", rows.time}, {title, rows.drive}, {"speed [rad/s]", rows.speed}});
  };
  const std::string words = "is made from 'speed'";
  const auto of_controller = [](double v, double e) { return 0.13 * (12.0 - v) + 0.29 + 0.03 * e; };
  const ModelProposal held = proposal_of(held_speed(of_controller), "u");
  EXPECT_TRUE(says(held, "'u' " + words + " ('u' = 1.")) << all_of(held);
  EXPECT_TRUE(says(held, "record several targets")) << all_of(held);
  // Measured at a constant voltage the current falls with the speed. And without a controller the
  // drive rises with the speed, or stands against it where it is counted the other way.
  EXPECT_FALSE(says(proposal_of(held_speed(of_controller), "current [A]"), words));
  const auto viscous = [](double v, double e) { return 0.1 * v + 0.03 * e; };
  const auto reversed = [](double v, double e) { return -0.1 * v + 0.03 * e; };
  EXPECT_FALSE(says(proposal_of(held_speed(viscous), "u"), words));
  EXPECT_FALSE(says(proposal_of(held_speed(reversed), "u"), words));
}

// A mass whose encoder has 4096 counts a turn, at rows of 10 ms.
Rows counted_rows(const std::function<double(double time, double place, double moved)>& drive) {
  constexpr double kInertia = 0.02, kDamping = 0.05, kDry = 0.02, kStep = 0.01;
  constexpr double kCount = 2.0 * std::numbers::pi / 4096.0;
  constexpr int kSteps = 20;
  Rows rows;
  double q = 0.0, v = 0.0;
  for (int k = 0; k < 800; ++k) {
    const double counted = kCount * std::round(q / kCount);
    const double moved = k == 0 ? 0.0 : counted - rows.position.back();
    const double u = drive(kStep * k, counted, moved);
    rows.time.push_back(kStep * k);
    rows.position.push_back(counted);
    rows.force.push_back(u);
    for (int s = 0; s < kSteps; ++s) {
      v += (u - kDamping * v - kDry * std::tanh(v / 0.01)) / kInertia * kStep / kSteps;
      q += v * kStep / kSteps;
    }
  }
  return rows;
}

// u = P e - D de, beside a slow offset, and with a step at its sign that skips a dead band.
TEST_F(LogMotions, ADriveMadeFromThePositionAndItsRateIsTold) {
  const auto proposal_of = [&](const Rows& rows) {
    return proposed({{"time [s]", rows.time}, {"angle [rad]", rows.position}, {"pwm", rows.force}});
  };
  const std::string words = "'pwm' (drive) follows from 'angle' and its rate, to ";
  const ModelProposal held = proposal_of(counted_rows([](double t, double place, double moved) {
    const double u = 3.0 * (0.5 - place) - 20.0 * moved + 0.004 * std::sin(t);
    return u + (u > 0.0 ? 0.1 : u < 0.0 ? -0.1 : 0.0);
  }));
  EXPECT_TRUE(says(held, words)) << all_of(held);
  EXPECT_TRUE(says(held, "a controller computed it")) << all_of(held);
  // What drives by itself: steps of two levels, and tones.
  const auto two_levels = [](double t, double, double) {
    return std::sin(3.0 * t) > 0.3 ? 0.5 : -0.3;
  };
  const auto tones = [](double t, double, double) { return two_sines(t); };
  for (const Rows& rows : {counted_rows(two_levels), counted_rows(tones)}) {
    EXPECT_FALSE(says(proposal_of(rows), "a controller computed it")) << all_of(proposal_of(rows));
  }
}

}  // namespace
}  // namespace graybox
