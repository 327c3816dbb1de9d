// `graybox model`: from logs to files that `graybox diagnose` takes, or to open questions.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

using testing::Outcome;
using testing::read_text;
using testing::replaced;
using testing::write_text;
using Json = nlohmann::json;

class Model : public testing::CommandRunner {
 protected:
  static std::string example(const std::string& name) {
    return read_text(std::string(GRAYBOX_SOURCE_DIR) + "/docs/examples/fit/drive/" + name);
  }

  // A motor's runs with another first line; an empty one: without header.
  void write_runs(const std::string& header) {
    for (const char* run : {"run_1.csv", "run_2.csv"}) {
      std::string text = example(run);
      text.erase(0, text.find('\n') + 1);
      write_text(folder_.file(run), header.empty() ? text : header + "\n" + text);
    }
  }

  Json diagnosis(const std::string& folder) {
    const Outcome outcome =
        graybox("diagnose " + folder + "/model.yaml " + folder + "/campaign.yaml --json");
    EXPECT_NE(outcome.exit_code, 2) << outcome.err;
    return Json::parse(outcome.out, nullptr, false);
  }

  // The level of the dry friction that the motor was simulated with.
  static void expect_dry_friction(const Json& verdict, double level) {
    for (const Json& law : verdict["physics"]) {
      if (law["law"] != "coulomb") continue;
      const double found = law["parameters"]["level"]["value"].get<double>();
      EXPECT_NEAR(found, level, 0.1 * level);
      return;
    }
    ADD_FAILURE() << verdict.dump(1).substr(0, 2000);
  }

  // The line of model.yaml with the masses that a fit begins with.
  std::string start_masses(const std::string& folder) {
    const std::string text = read_text(folder_.file(folder + "/model.yaml"));
    const std::size_t at = text.find("masses:");
    return at == std::string::npos ? "" : text.substr(at, text.find('\n', at) - at);
  }

  bool is_there(const std::string& file) { return std::filesystem::exists(folder_.file(file)); }
};

// Steps from rest: in each log the voltage is one value.
TEST_F(Model, ADriveThatIsConstantInEachLogIsADrive) {
  for (const double voltage : {6.0, 9.0, -6.0}) {
    std::string text = "time [s],voltage [V],speed [rad/s]\n";
    for (int k = 0; k < 200; ++k) {
      const double t = 0.01 * k;
      text += fmt::format("{:.2f},{},{:.6g}\n", t, voltage,
                          10.0 * voltage * (1.0 - std::exp(-t / 0.2)));
    }
    write_text(folder_.file(fmt::format("step_{}.csv", voltage)), text);
  }
  const Outcome outcome = graybox("model step_6.csv step_9.csv step_-6.csv -o axis --gain 1");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err << outcome.out;
  EXPECT_EQ(outcome.out.find("never changes"), std::string::npos) << outcome.out;
  const std::string campaign = read_text(folder_.file("axis/campaign.yaml"));
  EXPECT_NE(campaign.find("column: \"voltage"), std::string::npos) << campaign;
}

TEST_F(Model, AMotorsLogGoesStraightToTheSameLaws) {
  write_runs("time,current,speed");
  const Outcome outcome = graybox("model run_1.csv run_2.csv -o axis --gain 0.12");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err << outcome.out;
  EXPECT_NE(outcome.out.find("Next: graybox diagnose axis/model.yaml axis/campaign.yaml"),
            std::string::npos);
  const Json verdict = diagnosis("axis");
  expect_dry_friction(verdict, 0.05);
  EXPECT_EQ(verdict["verdict"], "explained");
}

// Columns as other loggers write them lead to the same masses.
TEST_F(Model, StampsUnitsAndRunsOfOtherLoggersAreRead) {
  const auto mass = [&](const std::string& options) {
    const Outcome outcome = graybox("model --one-mass " + options + " -o axis --overwrite");
    EXPECT_EQ(outcome.exit_code, 0) << options << outcome.err << outcome.out;
    return start_masses("axis");
  };
  // Rows of the drive's first run, with the time written otherwise.
  const auto write_as = [&](const std::string& head, const auto& stamp) {
    std::istringstream rows(example("run_1.csv"));
    std::string text = head, row;
    std::getline(rows, row);
    for (; std::getline(rows, row);) {
      const std::size_t comma = row.find(',');
      text += stamp(static_cast<long>(std::lround(1e3 * std::stod(row.substr(0, comma))))) +
              row.substr(comma) + "\n";
    }
    write_text(folder_.file("log.csv"), text);
  };
  const auto plain = [](long ms) { return fmt::format("{:.3f}", 1e-3 * double(ms)); };
  const std::string gain = " --gain 0.12", speed = " --column speed=velocity:rpm ";
  write_as("time,current,speed\n", plain);
  const std::string expected = mass(speed + "log.csv" + gain);
  ASSERT_FALSE(expected.empty());
  write_as("time,current,speed\ns,A,1/min\n", plain);
  EXPECT_EQ(mass("log.csv" + gain), expected);
  write_as("Timestamp,Motorstrom [A],Drehzahl [U/min]\n", [](long ms) {
    return fmt::format("2024-05-01T12:{:02}:{:02}.{:03}Z", ms / 60000, ms / 1000 % 60, ms % 1000);
  });
  EXPECT_EQ(mass("log.csv" + gain), expected);
  EXPECT_NE(read_text(folder_.file("axis/campaign.yaml")).find("to 1 ms"), std::string::npos);
  write_as("header.stamp.sec,header.stamp.nanosec,current,speed [rpm]\n", [](long ms) {
    return fmt::format("{},{}", 1714564800 + ms / 1000, 1000000 * (ms % 1000));
  });
  EXPECT_EQ(mass("log.csv" + gain), expected);
  EXPECT_EQ(graybox("recordings axis/campaign.yaml").exit_code, 0);
}

// Two runs in one file are two recordings, as they are in two files.
TEST_F(Model, AClockThatBeginsAnewIsTwoRecordings) {
  const std::string second = example("run_2.csv");
  write_text(folder_.file("log.csv"), example("run_1.csv") + second.substr(second.find('\n') + 1));
  for (const char* run : {"run_1.csv", "run_2.csv"}) write_text(folder_.file(run), example(run));
  const std::string options = " --column speed=velocity:rpm --gain 0.12 -o ";
  const Outcome one = graybox("model --one-mass log.csv" + options + "one"),
                two = graybox("model --one-mass run_1.csv run_2.csv" + options + "two");
  ASSERT_EQ(one.exit_code, 0) << one.err << one.out;
  EXPECT_NE(one.out.find("'time' begins anew within the file: 2 recordings"), std::string::npos)
      << one.out;
  EXPECT_EQ(start_masses("one"), start_masses("two"));
  const Json together = diagnosis("one"), apart = diagnosis("two");
  EXPECT_EQ(together["verdict"], apart["verdict"]);
  expect_dry_friction(together, 0.05);
}

TEST_F(Model, OtherTitlesGiveTheSameLaws) {
  write_runs("t [s];i_A;omega [rad/s]");
  for (const char* run : {"run_1.csv", "run_2.csv"}) {
    std::string text = read_text(folder_.file(run));
    for (char& each : text) each = each == ',' ? ';' : each;
    write_text(folder_.file(run), text);
  }
  ASSERT_EQ(graybox("model --one-mass run_1.csv run_2.csv -o axis --gain 0.12").exit_code, 0);
  expect_dry_friction(diagnosis("axis"), 0.05);
}

TEST_F(Model, WithoutAHeaderItAsksAndAnswersGoStraightThrough) {
  write_runs("");
  const Outcome asked = graybox("model run_1.csv run_2.csv -o axis </dev/null");
  EXPECT_EQ(asked.exit_code, 2);
  EXPECT_NE(asked.err.find("open question"), std::string::npos) << asked.err;
  const std::string marked = read_text(folder_.file("axis/campaign.yaml"));
  EXPECT_NE(marked.find("which column drives the machine? --column '2=torque'"), std::string::npos)
      << marked;
  EXPECT_NE(marked.find("which column is the motion? --column '2=position:rad'"), std::string::npos)
      << marked;
  // No command swallows an open question.
  const Outcome refused = graybox("diagnose axis/model.yaml axis/campaign.yaml");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_NE(refused.err.find("an open question"), std::string::npos) << refused.err;
  const Outcome answered = graybox(
      "model run_1.csv run_2.csv -o axis --overwrite --gain 0.12 --column 2=current:A "
      "--column 3=velocity:rad/s");
  ASSERT_EQ(answered.exit_code, 0) << answered.out << answered.err;
  expect_dry_friction(diagnosis("axis"), 0.05);
}

// A log with one column doubtful.
std::string table(const std::string& header, double position_factor = 1.0) {
  std::ostringstream text;
  text.precision(12);
  text << header << '\n';
  for (int k = 0; k < 1000; ++k) {
    const double t = 0.005 * k;
    const double q = std::sin(3.0 * t), v = 3.0 * std::cos(3.0 * t);
    text << t << ',' << position_factor * q << ',' << v << ',' << -9.0 * q + 0.3 * v << ','
         << -8.0 * q + 0.1 * v << '\n';
  }
  return text.str();
}

TEST_F(Model, AmbiguousColumnsAreAskedNotGuessed) {
  write_text(folder_.file("log.csv"), table("t,angle,speed,current_1,current_2"));
  const Outcome drives = graybox("model log.csv -o a </dev/null");
  EXPECT_EQ(drives.exit_code, 2);
  EXPECT_NE(drives.out.find("'current_1' or 'current_2'"), std::string::npos) << drives.out;
  EXPECT_EQ(graybox("model log.csv -o a --overwrite --column current_2=ignore").exit_code, 0);
  EXPECT_NE(read_text(folder_.file("a/campaign.yaml")).find("\"current_1\""), std::string::npos);
  // Titles that the data contradict.
  write_text(folder_.file("units.csv"), table("t,angle_deg,speed_rad_s,tau_Nm,spare"));
  const Outcome units = graybox("model units.csv -o b </dev/null");
  EXPECT_EQ(units.exit_code, 2);
  EXPECT_NE(units.out.find("don't agree"), std::string::npos) << units.out;
}

// A current in a unit of its own is a drive of unknown gain, as one without a unit is.
TEST_F(Model, ACurrentInAnyUnitIsTakenAsRecorded) {
  write_text(folder_.file("log.csv"),
             table("time [s],angle [rad],speed [rad/s],current (units),spare"));
  const Outcome taken = graybox("model log.csv -o a --overwrite </dev/null");
  EXPECT_EQ(taken.exit_code, 0) << taken.err;
  EXPECT_NE(taken.out.find("'units' is no unit that graybox knows"), std::string::npos)
      << taken.out;
  const Outcome diagnosed = graybox("diagnose a/model.yaml a/campaign.yaml");
  EXPECT_NE(diagnosed.out.find("Sizes are in units of the drive: of '"), std::string::npos)
      << diagnosed.out;
}

// Sizes are then in the drive's unit, not in N m that nobody measured; with a gain they are in N m.
TEST_F(Model, SizesOfADriveWithoutAGainAreInItsUnit) {
  write_text(folder_.file("log.csv"),
             table("time [s],angle [rad],speed [rad/s],current [mA],spare"));
  ASSERT_EQ(graybox("model log.csv -o a --overwrite </dev/null").exit_code, 0);
  const Outcome own = graybox("diagnose a/model.yaml a/campaign.yaml -o report");
  EXPECT_NE(own.out.find(" mA"), std::string::npos) << own.out;
  for (const char* unit : {"N m", "kg"}) {
    EXPECT_EQ(own.out.find(unit), std::string::npos) << own.out;
  }
  EXPECT_EQ(Json::parse(read_text(folder_.file("report/verdict.json"))).at("drive_unit"), "mA");
  ASSERT_EQ(graybox("model log.csv -o a --overwrite --gain 0.02 </dev/null").exit_code, 0);
  const Outcome known = graybox("diagnose a/model.yaml a/campaign.yaml");
  EXPECT_EQ(known.out.find(" mA"), std::string::npos) << known.out;
  EXPECT_NE(known.out.find("N m"), std::string::npos) << known.out;
}

// In a pipe nothing is asked: the line of the drive is marked, and no command reads it.
TEST_F(Model, TheUnitOfADriveIsMarkedInAPipe) {
  for (const char* title : {"torque [furlong]", "torque [mN]", "current [Nm]"}) {
    write_text(folder_.file("log.csv"),
               table(std::string("time [s],angle [rad],speed [rad/s],") + title + ",spare"));
    const Outcome asked = graybox("model log.csv -o a --overwrite </dev/null");
    EXPECT_NE(asked.err.find("1 open question"), std::string::npos) << title << asked.err;
    const std::string campaign = read_text(folder_.file("a/campaign.yaml"));
    std::istringstream lines(campaign);
    std::size_t marked = 0;
    for (std::string line; std::getline(lines, line);) {
      if (line.find("is: input") == std::string::npos) continue;
      marked += line.find("# ANSWER:") == std::string::npos ? 0U : 1U;
      EXPECT_NE(line.find("is no unit of a"), std::string::npos) << line;
    }
    EXPECT_EQ(marked, 1U) << campaign;
    for (const char* command : {"diagnose", "fit", "predict"}) {
      expect_refused(std::string(command) + " a/model.yaml a/campaign.yaml", "an open question");
    }
  }
}

TEST_F(Model, OptionsThatContradictOrChangeNothingAreRefused) {
  write_text(folder_.file("log.csv"),
             table("time [s],angle [rad],speed [rad/s],torque [Nm],spare"));
  const std::string urdf = "arm.urdf ";  // refused before it is read
  for (const auto& [options, text] : std::vector<std::pair<std::string, std::string>>{
           {"--one-mass --two-masses", "--one-mass"},
           {"--sample-time 0.01", "--sample-time says 0.01 s"},
           {"--counts-per-turn 4096", "--counts-per-turn: 'angle' is in rad"},
           {"--tip link_6", "--tip: names a link of a URDF"},
           {"--base link_0", "--base: names a link of a URDF"},
           {urdf + "--linear", "--linear and --rotary: not beside a URDF"},
           {urdf + "--two-masses", "--one-mass and --two-masses: not beside a URDF"},
           {urdf + "--gain 2", "--gain: not beside a URDF"}}) {
    expect_refused("model log.csv -o refused " + options, text);
    EXPECT_FALSE(is_there("refused")) << options;
  }
  EXPECT_EQ(graybox("model log.csv -o a --sample-time 0.005").exit_code, 0);
}

// A column of words needs no answer, and may have one.
TEST_F(Model, ColumnsOfWordsMayBeIgnored) {
  std::string text = "time [s],torque [Nm],speed [rad/s],state\n";
  double speed = 0.0;
  for (int k = 0; k < 400; ++k) {
    const double torque = (k / 50) % 2 == 0 ? 1.0 : -0.6;
    text += fmt::format("{:.2f},{},{:.6g},RUNNING\n", 0.01 * k, torque, speed);
    speed += 0.01 * (torque - 0.05 * speed) / 0.02;
  }
  write_text(folder_.file("log.csv"), text);
  for (const char* answer : {"", " --column state=ignore"}) {
    const Outcome model = graybox(fmt::format("model log.csv -o out --overwrite{}", answer));
    EXPECT_EQ(model.exit_code, 0) << model.err;
    EXPECT_NE((model.out + model.err).find("'state' holds words"), std::string::npos) << model.err;
  }
  expect_refused("model log.csv -o out --overwrite --column stat=ignore", "no such column");
}

// Two shafts that follow the drive alike: nobody knows which it drives.
TEST_F(Model, TheDrivenOfTwoMassesIsAskedWhereBothFollowTheDrive) {
  const auto written = [&](double of_second) {
    std::string text = "time [s],torque [Nm],q1 [rad],q2 [rad]\n";
    double q[2] = {0.0, 0.0}, v[2] = {0.0, 0.0};
    std::uint64_t state = 1;
    for (int k = 0; k < 600; ++k) {
      state = 6364136223846793005ULL * state + 1442695040888963407ULL;
      const double torque = static_cast<double>(state >> 40) / 8388608.0 - 1.0;
      text += fmt::format("{:.2f},{:.6g},{:.9g},{:.9g}\n", 0.01 * k, torque, q[0], q[1]);
      for (const int side : {0, 1}) {
        v[side] += 0.01 * ((side == 0 ? 1.0 : of_second) * torque +
                           (side == 0 ? 0.0 : 5.0) * (q[0] - q[1]) - 0.2 * v[side]);
        q[side] += 0.01 * v[side];
      }
    }
    write_text(folder_.file("log.csv"), text);
  };
  written(0.9);
  const Outcome asked = graybox("model --two-masses log.csv -o out");
  EXPECT_EQ(asked.exit_code, 2) << asked.out;
  EXPECT_NE((asked.out + asked.err).find("Which mass does the drive act on"), std::string::npos)
      << asked.out << asked.err;
  const Outcome answered = graybox(
      "model --two-masses log.csv -o out --overwrite --column 'q1=position@motor' "
      "--column 'q2=position@load'");
  EXPECT_EQ(answered.exit_code, 0) << answered.out << answered.err;
  written(0.0);
  const Outcome told = graybox("model --two-masses log.csv -o out --overwrite");
  EXPECT_EQ(told.exit_code, 0) << told.out << told.err;
}

TEST_F(Model, DegreesAreToldFromTheVelocity) {
  write_text(folder_.file("log.csv"), table("t,q,dq,tau,spare", 180.0 / 3.14159265358979));
  const Outcome outcome = graybox("model log.csv -o a");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(read_text(folder_.file("a/campaign.yaml")).find("column: \"q\", unit: deg"),
            std::string::npos)
      << read_text(folder_.file("a/campaign.yaml"));
}

TEST_F(Model, DamagedLogsAreRefusedAndNothingIsWritten) {
  write_text(folder_.file("empty.csv"), "");
  write_text(folder_.file("short.csv"), "t,q,u\n0,1,2\n1,2,3\n");
  write_text(folder_.file("text.csv"), "t,q,u\n0,1,2\n1,two,3\n");
  std::string falls = table("t,q,dq,tau,spare");
  write_text(folder_.file("falls.csv"), falls + "0,0,0,0,0\n");
  expect_refused("model empty.csv -o out", "empty.csv");
  expect_refused("model short.csv -o out", "50 samples");
  expect_refused("model text.csv -o out", "'two' is no number");
  expect_refused("model falls.csv -o out", "times must rise");
  expect_refused("model missing.csv -o out", "missing.csv");
  write_text(
      folder_.file("still.csv"), "t,temperature\n" + [] {
        std::string rows;
        for (int k = 0; k < 100; ++k)
          rows += std::to_string(0.01 * k) + "," + std::to_string(k) + "\n";
        return rows;
      }());
  expect_refused("model still.csv -o out", "no column is a force");
  write_text(
      folder_.file("step.csv"), "t,q,u\n" + [] {
        std::string rows;
        for (int k = 0; k < 100; ++k)
          rows += std::to_string(0.01 * k) + "," + std::to_string(k * k) + ",0.7\n";
        return rows;
      }());
  const auto undriven = graybox("model step.csv -o undriven");
  EXPECT_EQ(undriven.exit_code, 2);
  EXPECT_NE(undriven.out.find("constant here: 'u'"), std::string::npos) << undriven.out;
  EXPECT_NE(undriven.out.find("--no-drive"), std::string::npos) << undriven.out;
  write_text(
      folder_.file("steps.csv"), "Timestamp,q,tau\n" + [] {
        std::string rows;
        for (int k = 0; k < 100; ++k)
          rows += std::to_string(100 * k) + "," + std::to_string(k) + "," + std::to_string(k % 7) +
                  "\n";
        return rows;
      }());
  EXPECT_EQ(graybox("model steps.csv -o asked").exit_code, 2) << "10 Hz or 10 kHz";
  write_text(folder_.file("log.csv"), table("t,q,dq,tau,spare"));
  expect_refused("model log.csv --column z=position -o out", "no such column");
  expect_refused("model log.csv --column q=place -o out", "unknown quantity");
  EXPECT_FALSE(is_there("out"));
}

// "one mass" in the place of a file is the machine, unless there is such a file.
TEST_F(Model, TheMachineMayBeSaidInWords) {
  write_text(folder_.file("log.csv"), table("t,q,dq,tau,spare"));
  for (const std::string word : {"'one mass'", "one-mass"}) {
    const Outcome outcome = graybox("model " + word + " log.csv -o axis --overwrite");
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_NE(outcome.out.find("one mass"), std::string::npos) << outcome.out;
    EXPECT_NE(outcome.out.find("you said so"), std::string::npos) << outcome.out;
    EXPECT_NE(read_text(folder_.file("axis/model.yaml")).find("graybox model --one-mass log.csv"),
              std::string::npos);
  }
  const Outcome two = graybox("model 'two masses' log.csv -o two");
  EXPECT_NE(two.out.find("two masses and a spring"), std::string::npos) << two.out << two.err;
  expect_refused("model one-mass --two-masses log.csv -o out", "say one of both");
  expect_refused("model 'one mass' -o out", "give a log, too");
  write_text(folder_.file("one mass"), "no table");
  expect_refused("model 'one mass' -o out", "one mass:");
}

TEST_F(Model, NothingIsOverwrittenUnasked) {
  write_text(folder_.file("log.csv"), table("t,q,dq,tau,spare"));
  write_text(folder_.file("model.yaml"), "mine");
  expect_refused("model log.csv", "is there already");
  EXPECT_EQ(read_text(folder_.file("model.yaml")), "mine");
  EXPECT_EQ(graybox("model log.csv --overwrite").exit_code, 0);
  EXPECT_NE(read_text(folder_.file("model.yaml")), "mine");
}

TEST_F(Model, ATemplateIsACampaignThatCanBeRead) {
  write_runs("time,current_A,speed_rpm");
  const Outcome printed = graybox("recordings --template run_1.csv run_2.csv");
  ASSERT_EQ(printed.exit_code, 0) << printed.err;
  EXPECT_NE(printed.out.find("unit: rpm"), std::string::npos) << printed.out;
  ASSERT_EQ(graybox("recordings --template run_1.csv run_2.csv -o c.yaml").exit_code, 0);
  EXPECT_EQ(graybox("recordings c.yaml").exit_code, 0) << graybox("recordings c.yaml").out;
  expect_refused("recordings --template run_1.csv -o c.yaml", "is there already");
}

std::string recordings() {
  const char* folder = std::getenv("GRAYBOX_RECORDINGS");
  return folder == nullptr ? "" : folder;
}

TEST_F(Model, TiagosJointsAreThoseOfItsUrdf) {
  if (recordings().empty()) GTEST_SKIP() << "GRAYBOX_RECORDINGS is not set: no real recordings";
  const std::string tiago = recordings() + "/TIAGo/tiago";
  const Outcome outcome = graybox("model " + tiago + ".urdf " + tiago + "_position.csv " + tiago +
                                  "_velocity.csv " + tiago + "_effort.csv -o tiago");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err << outcome.out;
  const std::string model = read_text(folder_.file("tiago/model.yaml"));
  EXPECT_NE(model.find("base: \"torso_fixed_link\"\ntip: \"arm_7_link\""), std::string::npos)
      << model;
  EXPECT_NE(model.find("drive_gains: unknown"), std::string::npos);
  EXPECT_EQ(graybox("recordings tiago/campaign.yaml").exit_code, 0);
  // Two efforts count the other way, which the diagnosis would refuse.
  const std::string campaign = read_text(folder_.file("tiago/campaign.yaml"));
  for (const char* joint : {"arm_3_joint", "arm_4_joint"}) {
    const std::size_t at = campaign.find(std::string("- ") + joint + "_effort");
    ASSERT_NE(at, std::string::npos) << campaign;
    EXPECT_NE(campaign.substr(at, 90).find("value: -1"), std::string::npos) << campaign;
  }
}

TEST_F(Model, TheBenchsTimesAreMicroseconds) {
  if (recordings().empty()) GTEST_SKIP() << "GRAYBOX_RECORDINGS is not set: no real recordings";
  const Outcome outcome =
      graybox("model --two-masses " + recordings() + "/two_mass_bench/MultisineTypeA.mat -o b");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err << outcome.out;
  const std::string campaign = read_text(folder_.file("b/campaign.yaml"));
  EXPECT_NE(campaign.find("sample_time: 0.0004"), std::string::npos) << campaign;
  EXPECT_NE(campaign.find("motor_angle, column: \"theta_mx\""), std::string::npos) << campaign;
  EXPECT_NE(campaign.find("gain: {value: -1, unit: rad/rad}"), std::string::npos) << campaign;
}

TEST_F(Model, TheEmpsDriveIsWhatIsLeft) {
  if (recordings().empty()) GTEST_SKIP() << "GRAYBOX_RECORDINGS is not set: no real recordings";
  const std::string emps = recordings() + "/EMPS/DATA_EMPS";
  const Outcome outcome =
      graybox("model --linear " + emps + ".mat " + emps + "_PULSES.mat -o e --gain 35.1507");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err << outcome.out;
  const std::string campaign = read_text(folder_.file("e/campaign.yaml"));
  EXPECT_NE(campaign.find("name: force, column: \"vir\""), std::string::npos) << campaign;
  EXPECT_NE(campaign.find("name: position, column: \"qm\""), std::string::npos) << campaign;
  const std::string model = read_text(folder_.file("e/model.yaml"));
  const double mass = std::stod(model.substr(model.find("axis: ") + 6));
  EXPECT_NEAR(mass, 95.1, 10.0);  // its authors'
}

TEST_F(Model, ItsHelpFitsAScreen) {
  const Outcome help = graybox("model --help");
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_LE(std::ranges::count(help.out, '\n'), 50) << help.out;
}

// Nothing drives: there is no balance of forces, and no channel of a drive to look at.
TEST_F(Model, WithoutADriveNothingIsSaidOfOne) {
  std::string text = "time [s],angle [rad]\n";
  for (int k = 0; k < 800; ++k) {
    const double t = 0.01 * k;
    text +=
        fmt::format("{:.2f},{:.6g}\n", t,
                    std::exp(-0.2 * t) * std::sin(3.0 * t) + 0.3 * t + 0.2 * std::sin(0.7 * t * t));
  }
  write_text(folder_.file("swing.csv"), text);
  const Outcome model = graybox("model swing.csv --no-drive -o swing");
  ASSERT_EQ(model.exit_code, 0) << model.err << model.out;
  expect_refused("diagnose swing/model.yaml swing/campaign.yaml --method force_balance",
                 "records no force");
  const Outcome diagnosed = graybox("diagnose swing/model.yaml swing/campaign.yaml");
  EXPECT_NE(diagnosed.out.find("force left at"), std::string::npos) << diagnosed.out;
  EXPECT_EQ(diagnosed.out.find("the drive's channel"), std::string::npos) << diagnosed.out;
}

}  // namespace
}  // namespace graybox
