// What `graybox model` asks, notes and says of logs as they come: units of something else, a drive
// without its sign, two wheels, rows that were resampled; and what `graybox predict` measures.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

using testing::Outcome;
using testing::read_text;
using testing::write_text;

class LogAnswers : public testing::CommandRunner {
 protected:
  static bool says(const Outcome& outcome, const std::string& text) {
    return (outcome.out + outcome.err).find(text) != std::string::npos;
  }

  // Rows of a step each, with the values of each title.
  void write_log(const std::string& name, const std::string& titles, double step, int count,
                 const std::function<std::vector<double>(int)>& values) {
    std::string text = titles + "\n";
    for (int k = 0; k < count; ++k) {
      text += fmt::format("{:.6g}", step * k);
      for (const double each : values(k)) text += fmt::format(",{:.7g}", each);
      text += "\n";
    }
    write_text(folder_.file(name), text);
  }

  // A servo that goes there, or back; `drive` makes its current of the torque.
  void write_stroke(const std::string& name, double way, const std::function<double(double)>& drive,
                    bool has_pulse = false) {
    constexpr int kRows = 300;
    write_log(name, "time [s],position [deg],current [A]", 0.002, kRows, [&](int k) {
      const double t = static_cast<double>(k) / kRows;
      const double smooth = t * t * (3.0 - 2.0 * t), rate = 6.0 * t * (1.0 - t);
      const double torque = way * (0.5 + 0.4 * rate) + 0.2 * way * (1.0 - 2.0 * t);
      const double current = has_pulse && k == 150 ? -0.1 : drive(torque);
      return std::vector<double>{(way > 0.0 ? 0.0 : 150.0) + way * 150.0 * smooth, current};
    });
  }
};

// Degrees titled as radians, of the second joint of an arm: the question stands on its own line.
TEST_F(LogAnswers, AQuestionAboutAJointStandsOnItsLine) {
  std::string urdf = "<robot name=\"arm\"><link name=\"base\"/>";
  for (const char* joint : {"1", "2"}) {
    urdf += fmt::format(
        "<link name=\"link{0}\"><inertial><origin xyz=\"0.2 0 0\"/><mass value=\"2\"/>"
        "<inertia ixx=\"0.01\" iyy=\"0.02\" izz=\"0.02\" ixy=\"0\" ixz=\"0\" "
        "iyz=\"0\"/></inertial></link>"
        "<joint name=\"joint{0}\" type=\"revolute\"><parent link=\"{1}\"/><child link=\"link{0}\"/>"
        "<origin xyz=\"0.4 0 0\"/><axis xyz=\"0 1 0\"/>"
        "<limit lower=\"-99\" upper=\"99\" effort=\"99\" velocity=\"9\"/></joint>",
        joint, std::string(joint) == "1" ? "base" : "link1");
  }
  write_text(folder_.file("arm.urdf"), urdf + "</robot>");
  const std::string each =
      ",joint{0}_position [rad],joint{0}_velocity [rad/s],joint{0}_current [A]";
  write_log("log.csv",
            "time [s]" + fmt::format(fmt::runtime(each), 1) + fmt::format(fmt::runtime(each), 2),
            0.01, 800, [](int k) {
              std::vector<double> row;
              for (const double w : {2.0, 3.1}) {
                const double t = 0.01 * k, unit = w > 3.0 ? 57.29578 : 1.0;
                row.push_back(unit * std::sin(w * t));
                row.push_back(w * std::cos(w * t));
                row.push_back(3.0 * std::cos(std::sin(w * t)) + 0.5 * std::cos(w * t));
              }
              return row;
            });
  const Outcome asked = graybox("model arm.urdf log.csv -o arm");
  EXPECT_EQ(asked.exit_code, 2) << asked.out << asked.err;
  EXPECT_TRUE(says(asked, "don't agree")) << asked.out << asked.err;
  const std::string campaign = read_text(folder_.file("arm/campaign.yaml"));
  const std::size_t answer = campaign.find("# ANSWER: ");
  ASSERT_NE(answer, std::string::npos) << campaign;
  const std::string line = campaign.substr(campaign.rfind('\n', answer) + 1, 60);
  EXPECT_NE(line.find("position_joint2"), std::string::npos) << line;
}

// A header of "second,Volt": the motion is in volts, and no file of the user is at fault.
TEST_F(LogAnswers, AMotionInAUnitOfSomethingElseIsAskedAbout) {
  write_log("log.csv", "second,Volt", 0.004, 300,
            [](int k) { return std::vector<double>{5.0 * std::exp(-0.01 * k)}; });
  const Outcome asked =
      graybox("model log.csv --one-mass --no-drive -o axis --column Volt=velocity");
  EXPECT_TRUE(says(asked, "column 'Volt': 'V' is no unit of a velocity")) << asked.out << asked.err;
  EXPECT_TRUE(says(asked, "--column 'Volt=velocity:rad/s'")) << asked.out << asked.err;
  EXPECT_FALSE(says(asked, "state its gain")) << asked.err;
  const Outcome answered = graybox(
      "model log.csv --one-mass --no-drive -o axis --overwrite --column Volt=velocity:rad/s");
  EXPECT_EQ(answered.exit_code, 0) << answered.out << answered.err;
  // A drive may be in any unit.
  write_log("drive.csv", "t [s],u [V],speed [rad/s]", 0.01, 300, [](int k) {
    const double t = 0.01 * k;
    return std::vector<double>{std::sin(3.0 * t), std::sin(3.0 * t - 0.8) + 0.3 * std::sin(t)};
  });
  const Outcome drive = graybox("model drive.csv --one-mass -o other --column u=command");
  EXPECT_FALSE(says(drive, "is no unit of")) << drive.out << drive.err;
}

// There in one log and back in the next; but for one sample the current is positive.
TEST_F(LogAnswers, ADriveThatLostItsSignBetweenLogsIsNoted) {
  const auto size = [](double torque) { return std::abs(torque); };
  write_stroke("up.csv", 1.0, size);
  write_stroke("down.csv", -1.0, size, true);
  write_stroke("again.csv", 1.0, [&](double torque) { return 1.1 * size(torque); });
  const Outcome lost = graybox("model up.csv down.csv again.csv --one-mass -o axis");
  EXPECT_TRUE(says(lost, "sign while the axis moves both ways")) << lost.out << lost.err;
  EXPECT_TRUE(says(lost, "hardly ever")) << lost.out << lost.err;
  const auto whole = [](double torque) { return torque; };
  write_stroke("up.csv", 1.0, whole);
  write_stroke("down.csv", -1.0, whole);
  write_stroke("again.csv", 1.0, [](double torque) { return 1.1 * torque; });
  const Outcome kept = graybox("model up.csv down.csv again.csv --one-mass -o kept");
  EXPECT_FALSE(says(kept, "sign while the axis moves both ways")) << kept.out << kept.err;
  EXPECT_FALSE(says(kept, "its sign was lost")) << kept.out << kept.err;
}

// A wheel's speed and that of the other one a little later, with the noise of each.
TEST_F(LogAnswers, TwoWheelsAreNoReferenceAndItsFollower) {
  const auto write = [&](const std::string& one, const std::string& other, double noise_of_one) {
    std::mt19937 engine(3);
    std::normal_distribution<double> noise(0.0, 0.02);
    write_log("log.csv", fmt::format("t [s],u [V],{},{}", one, other), 0.01, 800, [&](int k) {
      const auto speed = [](double t) { return std::sin(2.0 * t) + 0.6 * std::sin(3.7 * t); };
      const double t = 0.01 * k, here = noise(engine);
      return std::vector<double>{std::cos(2.0 * t) + std::cos(3.7 * t),
                                 speed(t) + noise_of_one * here, speed(t - 0.03) + noise(engine)};
    });
    return graybox("model log.csv --one-mass -o axis --overwrite");
  };
  const std::string question = "Which is the measured velocity";
  const Outcome sides = write("velocity left [m/s]", "velocity right [m/s]", 0.0);
  EXPECT_TRUE(says(sides, question)) << sides.out << sides.err;
  EXPECT_FALSE(says(sides, "a reference")) << sides.out << sides.err;
  const Outcome noisy = write("velocity inboard [m/s]", "velocity main [m/s]", 1.0);
  EXPECT_TRUE(says(noisy, question)) << noisy.out << noisy.err;
  const Outcome smooth = write("velocity inboard [m/s]", "velocity main [m/s]", 0.0);
  EXPECT_TRUE(says(smooth, "it follows 'velocity inboard', a reference"))
      << smooth.out << smooth.err;
}

// The unit is that of the title, and the campaign says what one recorded number is.
TEST_F(LogAnswers, AUnitWithAFactorIsCalledAsItIsWritten) {
  write_log("log.csv", "t [s],drum speed [km/h]", 0.1, 300,
            [](int k) { return std::vector<double>{30.0 * std::exp(-0.005 * k)}; });
  const Outcome outcome = graybox("model log.csv --one-mass --no-drive -o axis");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out << outcome.err;
  EXPECT_TRUE(says(outcome, "in km/h")) << outcome.out;
  EXPECT_FALSE(says(outcome, "0.277778")) << outcome.out;
  const std::string campaign = read_text(folder_.file("axis/campaign.yaml"));
  EXPECT_NE(campaign.find("unit: (m/s)/(m/s)"), std::string::npos) << campaign;
  EXPECT_EQ(graybox("recordings axis/campaign.yaml").exit_code, 0);
}

// Resampled, there are more samples than rows.
TEST_F(LogAnswers, ResampledRowsAreCountedAsRows) {
  std::string text = "t [s],u [V],speed [rad/s]\n";
  double t = 0.0;
  for (int k = 0; k < 400; ++k) {
    text += fmt::format("{:.6g},{:.6g},{:.6g}\n", t, std::sin(9.0 * t), std::sin(9.0 * t - 0.5));
    t += k % 3 == 0 ? 0.004 : 0.002;
  }
  write_text(folder_.file("log.csv"), text);
  ASSERT_EQ(graybox("model log.csv --one-mass -o axis --gain 1").exit_code, 0);
  const Outcome outcome = graybox("recordings axis/campaign.yaml");
  EXPECT_TRUE(says(outcome, "samples, resampled from a file of 400 rows, in")) << outcome.out;
  EXPECT_FALSE(says(outcome, " of 400 samples")) << outcome.out;
}

// A motion that does not follow its drive: the two together tell nothing, whatever each shows.
TEST_F(LogAnswers, AStartThatIsNotToldIsNotTheLogsFault) {
  std::mt19937 engine(5);
  std::normal_distribution<double> noise(0.0, 1.0);
  write_log("log.csv", "t [s],u [V],speed [rad/s]", 0.01, 400, [&](int) {
    const double u = noise(engine);
    return std::vector<double>{u, noise(engine)};
  });
  const Outcome outcome = graybox("model log.csv --one-mass -o axis");
  EXPECT_FALSE(says(outcome, "the log shows no inertia")) << outcome.out;
  EXPECT_TRUE(says(outcome, "drive and motion together tell no inertia")) << outcome.out;
}

TEST_F(LogAnswers, APredictionSaysWhatIsCounted) {
  const std::string drive = std::string(GRAYBOX_SOURCE_DIR) + "/docs/examples/fit/drive";
  const Outcome outcome = graybox("predict " + drive + "/motor.yaml " + drive);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_TRUE(says(outcome, "over the standard deviation of the recording")) << outcome.out;
  EXPECT_TRUE(says(outcome, "are not counted (in free run 200, at most half")) << outcome.out;
}

}  // namespace
}  // namespace graybox
