// What columns of logs are taken for: titles, units from data, times.
#include "diagnosis/proposal/proposal.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include "diagnosis/first_masses/one_mass_start.hpp"
#include "diagnosis/log_columns/column_rates.hpp"
#include "diagnosis/log_columns/column_words.hpp"
#include "diagnosis/log_columns/log_time.hpp"
#include "diagnosis/proposal/start_values.hpp"
#include "diagnosis/recording_files/recording_file.hpp"
#include "diagnosis/recording_files/written_unit.hpp"
#include "tests/support/refusal.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using Q = LogQuantity;

struct Title {
  const char* title;
  Q quantity;
  const char* unit;
};

void expect_read(const std::vector<Title>& titles) {
  for (const Title& each : titles) {
    const ColumnWords words = read_column_words(each.title, "");
    EXPECT_EQ(words.quantity, each.quantity) << each.title << ": " << name_of(words.quantity);
    EXPECT_EQ(words.unit, each.unit) << each.title;
  }
}

TEST(ColumnWords, TitlesAsPeopleWriteThem) {
  const std::vector<Title> titles{
      {"time", Q::kTime, ""},
      {"t [s]", Q::kTime, "s"},
      {"t_ms", Q::kTime, "ms"},
      {"timestamp_ns", Q::kTime, "ns"},
      {"Time (s)", Q::kTime, "s"},
      {"Zeit_ms", Q::kTime, "ms"},
      {"q1", Q::kPosition, ""},
      {"joint_1_pos", Q::kPosition, ""},
      {"position", Q::kPosition, ""},
      {"pos_deg", Q::kPosition, "deg"},
      {"Winkel [°]", Q::kPosition, "deg"},
      {"theta", Q::kPosition, ""},
      {"x_mm", Q::kPosition, "mm"},
      {"pos_m", Q::kPosition, "m"},
      {"theta_m", Q::kPosition, ""},
      {"encoder_counts", Q::kPosition, "counts"},
      {"- arm_1_joint_position", Q::kPosition, ""},
      {"rec.act_pos_mot_deg[3]", Q::kPosition, "deg"},
      {"dq", Q::kVelocity, ""},
      {"velocity", Q::kVelocity, ""},
      {"rpm", Q::kVelocity, "rpm"},
      {"n [1/min]", Q::kVelocity, "rpm"},
      {"motor_speed_rad_s", Q::kVelocity, "rad/s"},
      {"Motor Velocity (deg/s)", Q::kVelocity, "deg/s"},
      {"theta_dot", Q::kVelocity, ""},
      {"act_vel_deg_per_s", Q::kVelocity, "deg/s"},
      {"tau", Q::kForce, ""},
      {"tau_1_Nm", Q::kForce, "N m"},
      {"effort", Q::kForce, ""},
      {"torque [Nm]", Q::kForce, "N m"},
      {"force_N", Q::kForce, "N"},
      {"current", Q::kCurrent, ""},
      {"i_A", Q::kCurrent, "A"},
      {"Motor Current (mA)", Q::kCurrent, "mA"},
      {"iq_adx", Q::kCurrent, ""},
      {"voltage", Q::kVoltage, ""},
      {"u", Q::kCommand, ""},
      {"u_V", Q::kVoltage, "V"},
      {"acceleration", Q::kAcceleration, ""},
      {"temperature", Q::kOther, ""},
      {"vdc_adx", Q::kOther, ""},
      {"actual_current_position", Q::kPosition, ""},
      {"error_pos_deg", Q::kOther, "deg"},
      {"vir", Q::kUnknown, ""},
      {"torque [% rated]", Q::kForce, "%"},
      {"torque (% of rated torque)", Q::kForce, "%"},
      {"speed [in/s]", Q::kVelocity, "in/s"},
      {"V1", Q::kVelocity, ""},
  };
  expect_read(titles);
}

TEST(ColumnWords, TitlesInOtherLanguages) {
  const std::vector<Title> titles{
      {"Position in Grad", Q::kPosition, "deg"},
      {"Winkel [Grad]", Q::kPosition, "deg"},
      {"Zeit in s", Q::kTime, "s"},
      {"Uhrzeit", Q::kTime, ""},
      {"Geschwindigkeit in mm/s", Q::kVelocity, "mm/s"},
      {"Drehzahl [U/min]", Q::kVelocity, "rpm"},
      {"Winkelgeschwindigkeit (Grad/s)", Q::kVelocity, "deg/s"},
      {"Weg in mm", Q::kPosition, "mm"},
      {"Motorstrom [A]", Q::kCurrent, "A"},
      {"Istposition", Q::kPosition, ""},
      {"Moment in Nm", Q::kForce, "N m"},
      {"Kraft in N", Q::kForce, "N"},
      {"temps (s)", Q::kTime, "s"},
      {"vitesse [tr/min]", Q::kVelocity, "rpm"},
      {"déplacement (mm)", Q::kPosition, "mm"},
      {"couple [N.m]", Q::kForce, "N m"},
      {"courant [A]", Q::kCurrent, "A"},
      {"tiempo [s]", Q::kTime, "s"},
      {"posición [°]", Q::kPosition, "deg"},
      {"velocidad [rad/s]", Q::kVelocity, "rad/s"},
      {"par [Nm]", Q::kForce, "N m"},
      {"corriente", Q::kCurrent, ""},
      {"tempo", Q::kTime, ""},
      {"posizione [º]", Q::kPosition, "deg"},
      {"velocità", Q::kVelocity, ""},
      {"coppia", Q::kForce, ""},
      {"corrente (mA)", Q::kCurrent, "mA"},
  };
  expect_read(titles);
}

// Units are the same by what they mean.
TEST(WrittenUnits, AreComparedByTheirMeaning) {
  for (const auto& [one, other] : {std::pair{"Nm", "N m"},
                                   {"N*m", "N m"},
                                   {"N·m", "N m"},
                                   {"°", "deg"},
                                   {"Grad", "deg"},
                                   {"°/s", "deg/s"},
                                   {"deg/sec", "deg/s"},
                                   {"rad/sec", "rad/s"},
                                   {"1/min", "rpm"},
                                   {"U/min", "rpm"},
                                   {"min⁻¹", "rpm"},
                                   {"µs", "us"},
                                   {"1000 mN m", "N m"},
                                   {"‰", "0.1 %"},
                                   {"furlong / s", "furlong/s"}}) {
    EXPECT_TRUE(is_same_unit(one, other)) << one << ", " << other;
  }
  for (const auto& [one, other] : {std::pair{"Nm", "mN m"},
                                   {"N", "N m"},
                                   {"deg", "rad"},
                                   {"0.1 deg", "deg"},
                                   {"rpm", "turn/s"},
                                   {"furlong", "m"},
                                   {"", "m"}}) {
    EXPECT_FALSE(is_same_unit(one, other)) << one << ", " << other;
  }
}

TEST(ColumnWords, MannersSidesAndNumbers) {
  EXPECT_TRUE(read_column_words("Desired Position (deg)", "").is_reference);
  EXPECT_TRUE(read_column_words("x_soll", "").is_reference);
  EXPECT_TRUE(read_column_words("i_meas", "").is_measured);
  EXPECT_TRUE(read_column_words("Sollposition [mm]", "").is_reference);
  EXPECT_TRUE(read_column_words("Istdrehzahl", "").is_measured);
  EXPECT_EQ(read_column_words("Motorstrom [A]", "").side, DriveSide::kMotor);
  EXPECT_EQ(read_column_words("motor_angle", "").side, DriveSide::kMotor);
  EXPECT_EQ(read_column_words("load_angle", "").side, DriveSide::kLoad);
  EXPECT_EQ(read_column_words("q_12", "").index, 12);
  EXPECT_EQ(read_column_words("rec.pos[3]", "").index, 3);
  EXPECT_FALSE(read_column_words("q_1", "").sure);
  EXPECT_TRUE(read_column_words("pos_1", "").sure);
  EXPECT_EQ(read_column_words("speed", "rpm").motion, MotionKind::kRotary);
}

Eigen::VectorXd wave(int samples, double step, double size, double phase = 0.0) {
  Eigen::VectorXd values(samples);
  for (int k = 0; k < samples; ++k) {
    const double t = step * k;
    values(k) = size * (std::sin(3.0 * t + phase) / 3.0 + 0.4 * std::sin(7.3 * t + phase) / 7.3);
  }
  return values;
}

// d/dt of wave() is wave of the cosines.
Eigen::VectorXd rate_of_wave(int samples, double step, double size) {
  Eigen::VectorXd values(samples);
  for (int k = 0; k < samples; ++k) {
    const double t = step * k;
    values(k) = size * (std::cos(3.0 * t) + 0.4 * std::cos(7.3 * t));
  }
  return values;
}

TEST(ColumnRates, UnitsFollowFromPositionAndVelocity) {
  constexpr double kDegree = 180.0 / std::numbers::pi, kRpm = 30.0 / std::numbers::pi;
  struct Case {
    double position, velocity;
    const char *position_unit, *velocity_unit;
  };
  for (const Case& each : {Case{1.0, 1.0, "rad", "rad/s"}, Case{kDegree, 1.0, "deg", "rad/s"},
                           Case{kDegree, kRpm, "deg", "rpm"}, Case{1.0, kRpm, "rad", "rpm"},
                           Case{1.0, kDegree, "rad", "deg/s"}}) {
    const auto fit =
        fit_rate(wave(3000, 0.005, each.position), rate_of_wave(3000, 0.005, each.velocity), 0.005);
    ASSERT_TRUE(fit);
    const MotionUnits units = units_by_rate(fit->factor, "", "", MotionKind::kRotary);
    EXPECT_TRUE(units.is_found);
    EXPECT_EQ(units.position, each.position_unit);
    EXPECT_EQ(units.velocity, each.velocity_unit);
  }
}

TEST(ColumnRates, StatedUnitsThatContradictAreNotBent) {
  const auto fit = fit_rate(wave(3000, 0.005, 1.0), rate_of_wave(3000, 0.005, 1.0), 0.005);
  ASSERT_TRUE(fit);
  EXPECT_TRUE(units_by_rate(fit->factor, "deg", "rad/s", MotionKind::kRotary).contradicts);
  EXPECT_TRUE(units_by_rate(fit->factor, "deg", "deg/s", MotionKind::kRotary).is_found);
  EXPECT_TRUE(units_by_rate(17.0, "", "", MotionKind::kRotary).contradicts);
  EXPECT_FALSE(fit_rate(wave(3000, 0.005, 1.0), wave(3000, 0.031, 1.0), 0.005));
}

LogRecording log_of(const std::string& title, double first, double step) {
  LogRecording log;
  log.files = {"log.csv"};
  log.keys = {""};
  Eigen::VectorXd times(1000);
  for (int k = 0; k < 1000; ++k) times(k) = first + step * k;
  log.columns.push_back({0, title, "", read_column_words(title, ""), times, false, ""});
  return log;
}

TEST(LogTimes, UnitsOfTime) {
  EXPECT_DOUBLE_EQ(find_time(log_of("t", 0.0, 0.002), {}).sample_time, 0.002);
  EXPECT_DOUBLE_EQ(find_time(log_of("t_ms", 0.0, 2.0), {}).sample_time, 0.002);
  EXPECT_EQ(find_time(log_of("time", 0.0, 10.0), {}).unit, "ms");
  EXPECT_EQ(find_time(log_of("time", 0.0, 400.0), {}).unit, "us");
  EXPECT_EQ(find_time(log_of("time", 0.0, 1e6), {}).unit, "ns");
  EXPECT_EQ(find_time(log_of("stamp", 1.7e9, 0.01), {}).unit, "s");
  EXPECT_EQ(find_time(log_of("stamp", 1.7e12, 10.0), {}).unit, "ms");
  EXPECT_EQ(find_time(log_of("stamp", 1.7e18, 1e6), {}).unit, "ns");
  EXPECT_DOUBLE_EQ(find_time(log_of("number", 0.0, 10.0), 0.5).sample_time, 0.5);
  // A sample time that is stated picks the unit, and contradicts none.
  EXPECT_EQ(find_time(log_of("time", 0.0, 10.0), 1e-5).unit, "us");
  testing::expect_refused([] { return find_time(log_of("time", 0.0, 10.0), 0.5); }, "0.5 s");
}

TEST(LogTimes, WhatCouldBeTwoUnitsIsLeftOpen) {
  EXPECT_EQ(find_time(log_of("t", 0.0, 1.0), {}).sample_time, 0.0);
  EXPECT_EQ(find_time(log_of("t", 0.0, 0.2), {}).sample_time, 0.0);
  EXPECT_EQ(find_time(log_of("t", 0.0, 100.0), {}).sample_time, 0.0);  // ms or us
  // With a position and its rate in SI there is one unit.
  LogRecording log = log_of("t", 0.0, 1.0);
  const auto add = [&](const char* title, const Eigen::VectorXd& values) {
    log.columns.push_back({0, title, "", read_column_words(title, ""), values, false, ""});
  };
  add("theta", wave(1000, 0.001, 1.0));
  add("omega", rate_of_wave(1000, 0.001, 1.0));
  EXPECT_EQ(find_time(log, {}).unit, "ms");
}

TEST(LogTimes, TimesThatFallAreRefused) {
  LogRecording log = log_of("time", 0.0, 0.01);
  log.columns[0].values(500) = 0.0;
  testing::expect_refused([&] { return find_time(log, {}); }, "times must rise");
}

// Two runs in one file: the clock begins anew.
TEST(LogTimes, AClockThatBeginsAnewMakesTwoRecordings) {
  const testing::TemporaryFolder folder;
  const auto read = [&](const std::vector<int>& lengths, std::vector<std::string>& remarks) {
    std::string text = "time [s],angle [rad],current [A]\n";
    int row = 0;
    for (const int length : lengths) {
      for (int k = 0; k < length; ++k, ++row) text += fmt::format("{:.2f},{},0.2\n", 0.01 * k, row);
    }
    testing::write_text(folder.file("log.csv"), text);
    return read_logs({folder.file("log.csv")}, {}, &remarks);
  };
  std::vector<std::string> remarks;
  const std::vector<LogRecording> two = read({300, 200}, remarks);
  ASSERT_EQ(two.size(), 2U);
  EXPECT_EQ(two[1].first_row, 300);
  EXPECT_EQ(two[1].samples(), 200);
  EXPECT_EQ(two[1].columns[1].values(7), 307.0);
  EXPECT_EQ(two[1].label(), "log.csv, rows 301 to 500");
  EXPECT_DOUBLE_EQ(find_time(two[0], {}).sample_time, 0.01);
  ASSERT_EQ(remarks.size(), 1U);
  EXPECT_NE(remarks[0].find("begins anew"), std::string::npos) << remarks[0];
  // Runs that are too short leave, and one run alone stays a whole.
  EXPECT_EQ(read({300, 40, 200}, remarks).size(), 2U);
  EXPECT_EQ(read({300, 40, 200}, remarks)[1].first_row, 340);
  EXPECT_EQ(read({300}, remarks).size(), 1U);
  // Of thousands the longest hundred stay, in their order: the work would grow with the square.
  std::vector<int> many(2000, 60);
  for (std::size_t k = 0; k < 99; ++k) many[20 * k + 5] = 61;
  remarks.clear();
  const std::vector<LogRecording> longest = read(many, remarks);
  ASSERT_EQ(longest.size(), 100U);
  EXPECT_EQ(longest[0].first_row, 0);
  EXPECT_EQ(longest[1].first_row, 300);
  EXPECT_EQ(longest[1].samples(), 61);
  EXPECT_TRUE(std::ranges::is_sorted(longest, {}, &LogRecording::first_row));
  ASSERT_EQ(remarks.size(), 1U);
  EXPECT_NE(remarks[0].find("100 recordings, the longest of 2000"), std::string::npos);
  const std::vector<LogRecording> falls = read({300, 40}, remarks);
  ASSERT_EQ(falls.size(), 1U);
  testing::expect_refused([&] { return find_time(falls[0], {}); }, "times must rise");
  // Stamps out of order are no new run, nor are stamps that stand still.
  LogRecording log = log_of("time", 0.0, 0.01);
  log.columns[0].values(500) = log.columns[0].values(499);
  testing::expect_refused([&] { return find_time(log, {}); }, "stamps are too coarse");
}

TEST(ColumnAnswers, WhatIsNoAnswerIsRefused) {
  EXPECT_EQ(column_answer("enc=position:deg").unit, "deg");
  EXPECT_EQ(column_answer("u1=torque@joint_1").joint, "joint_1");
  // The words that make a title a drive.
  for (const auto& [word, quantity] : {std::pair{"pwm", LogQuantity::kCommand},
                                       {"duty", LogQuantity::kCommand},
                                       {"throttle", LogQuantity::kCommand},
                                       {"command", LogQuantity::kCommand},
                                       {"voltage", LogQuantity::kVoltage},
                                       {"current", LogQuantity::kCurrent},
                                       {"force", LogQuantity::kForce},
                                       {"torque", LogQuantity::kForce},
                                       {"effort", LogQuantity::kForce}}) {
    EXPECT_EQ(column_answer(std::string("4=") + word).quantity, quantity) << word;
  }
  EXPECT_EQ(column_answer("4=pwm:%").unit, "%");
  testing::expect_refused([] { return column_answer("4="); }, "unknown quantity");
  testing::expect_refused([] { return column_answer("enc"); }, "write NAME=QUANTITY");
  testing::expect_refused([] { return column_answer("enc=place"); }, "unknown quantity 'place'");
  testing::expect_refused([] { return column_answer("enc=position:parsec"); }, "unknown unit");
  testing::expect_refused([] { return column_answer("enc=position:A"); }, "no unit of a position");
  testing::expect_refused([] { return column_answer("2=velocity:counts"); },
                          "'2=velocity:0.0005 turn/s'");
}

// Files with the same columns are recordings; files that complement each other are one.
TEST(LogRecordings, FilesAreJoinedByTheirColumns) {
  const testing::TemporaryFolder folder;
  const auto write = [&](const std::string& name, const std::string& header, int first = 0) {
    std::string text = header + "\n";
    for (int k = 0; k < 60; ++k) {
      text += std::to_string(0.01 * k) + "," + std::to_string(first + k * k) + "\n";
    }
    testing::write_text(folder.file(name), text);
    return std::filesystem::path(folder.file(name));
  };
  const auto position = write("arm_position.csv", "t,joint_1"),
             effort = write("arm_effort.csv", "t,joint_1"), again = write("b.csv", "t,q"),
             more = write("c.csv", "t,q", 1);
  const std::vector<LogRecording> one = read_logs({position, effort}, {});
  ASSERT_EQ(one.size(), 1U);
  EXPECT_EQ(one[0].columns[1].words.quantity, Q::kPosition);
  EXPECT_EQ(one[0].columns[3].words.quantity, Q::kForce);
  EXPECT_EQ(one[0].keys, (std::vector<std::string>{"position", "force"}));
  EXPECT_EQ(read_logs({again, more}, {}).size(), 2U);
}

TEST(LogRecordings, ALineOfUnitsBelowTheHeader) {
  const testing::TemporaryFolder folder;
  std::string text = "time,angle,current\nms,deg,A\n";
  for (int k = 0; k < 60; ++k) text += std::to_string(2 * k) + ",1.5,0.2\n";
  testing::write_text(folder.file("log.csv"), text);
  const std::vector<LogRecording> logs = read_logs({folder.file("log.csv")}, {});
  EXPECT_EQ(logs[0].samples(), 60);
  EXPECT_EQ(logs[0].columns[1].words.unit, "deg");
  EXPECT_DOUBLE_EQ(find_time(logs[0], {}).sample_time, 0.002);
}

// A console's name above rows without titles is no header; what may be titles is asked for.
TEST(LogRecordings, ABannerAboveTheNumbersIsPassedOver) {
  const testing::TemporaryFolder folder;
  std::string rows;
  for (int k = 0; k < 60; ++k) rows += fmt::format(".{:03d}, 1.5, {}\n", 10 * k, k);
  const auto read = [&](const std::string& text) {
    testing::write_text(folder.file("log.csv"), text);
    return read_recording_file(folder.file("log.csv"));
  };
  for (const std::string banner :
       {"SWV ITM Data Console - ITM Port: 0\n", "SWV ITM\n", "Log\nof my motor today\n"}) {
    const RecordingFile file = read(banner + rows);
    ASSERT_EQ(file.columns.size(), 3U) << banner;
    EXPECT_EQ(file.columns[2].name, "3") << banner;
    EXPECT_EQ(file.columns[0].values.size(), 60) << banner;
    ASSERT_EQ(file.remarks.size(), 1U) << banner;
    EXPECT_NE(file.remarks[0].find("above the numbers in line"), std::string::npos);
    EXPECT_EQ(read(banner + "t,x,motor\n" + rows).columns[2].name, "motor") << banner;
  }
  const auto refused = [&](const std::string& text, const std::string& message) {
    testing::expect_refused([&] { (void)read(text); }, message);
  };
  refused("SWV ITM motor\n" + rows, "line 1: 'SWV ITM motor' has no separator");
  refused("SWV ITM motor\n" + rows, "or delete line 1");
  refused("speed of motor\n1,25\n2,5\n", "delete line 1");  // decimal commas
  refused("SWV Console Port: 0\n0.1 2 3\n0.2 3 4\n", "nor a row: delete line 1");
  refused("t\n0,1\n1,2\n", "write a decimal point");
  // Titles that blanks separate, above tabs, and above blanks with a sign behind the last field.
  EXPECT_EQ(read("t u v\n0 1 2;\n1 2 3;\n").columns[2].name, "v");
  EXPECT_EQ(read("t u v\n0\t1\t2\n1\t2\t3\n").columns[2].name, "v");
}

// Rows of two motors, by a column that names them, are no silent mix; states are no machines.
TEST(LogRecordings, RowsOfSeveralMachinesAreTold) {
  const testing::TemporaryFolder folder;
  const auto remark = [&](const std::string& title, const std::string& second) {
    std::string text = "time," + title + ",pwm,speed\n";
    for (int k = 0; k < 120; ++k) {
      text += fmt::format("{:.2f},{},10,{}\n", 0.1 * (k % 60), k < 60 ? "M1" : second, k);
    }
    testing::write_text(folder.file("log.csv"), text);
    const RecordingFile file = read_recording_file(folder.file("log.csv"));
    return file.remarks.empty() ? "" : file.remarks.front();
  };
  const std::string two = remark("motor", "M2");
  EXPECT_NE(two.find("it names 2 machines, 'M1' in lines 2 to 61, 'M2' in lines 62 to 121"),
            std::string::npos)
      << two;
  EXPECT_NE(two.find("all rows are taken as one machine's"), std::string::npos) << two;
  EXPECT_EQ(remark("motor", "M1").find("machines"), std::string::npos);
  EXPECT_EQ(remark("motor", "OFF").find("machines"), std::string::npos);
  EXPECT_EQ(remark("motor_state", "M2").find("machines"), std::string::npos);
}

// Lines above the header, and units that graybox does not know below it.
TEST(LogRecordings, WordsWithoutASeparatorAreNoTitlesOfThreeColumns) {
  const testing::TemporaryFolder folder;
  std::string text = "Recorder v3\ntime\n";
  for (int k = 0; k < 60; ++k) text += std::to_string(2 * k) + ",1.5,0.2\n";
  testing::write_text(folder.file("log.csv"), text);
  const RecordingFile file = read_recording_file(folder.file("log.csv"));
  EXPECT_EQ(file.columns[0].name, "1");
  ASSERT_EQ(file.remarks.size(), 1U);
  EXPECT_NE(file.remarks[0].find("is left out"), std::string::npos) << file.remarks[0];
}

TEST(LogRecordings, ATitleAboveTheHeaderIsPassedOver) {
  const testing::TemporaryFolder folder;
  std::string rows;
  for (int k = 0; k < 60; ++k) rows += std::to_string(2 * k) + ",1.5,0.2\n";
  const auto read = [&](const std::string& head) {
    testing::write_text(folder.file("log.csv"), head + rows);
    return read_recording_file(folder.file("log.csv"));
  };
  for (const std::string title :
       {"Recorder v3\n", "Recorder v3\nDate: 1.1.2026\n\n", "Rate,1000\nAxis,2\n",
        "Machine,Axis,Date\n", "Measured by me, at noon\n", "Measured; by me\n"}) {
    for (const std::string units : {"", "ms,deg,A\n", "ms,Nm,furlong\n", "[ms],[-],[A]\n"}) {
      const RecordingFile file = read(title + "time,angle,current\n" + units);
      ASSERT_EQ(file.columns.size(), 3U) << title << units;
      EXPECT_EQ(file.columns[0].name, "time") << title << units;
      EXPECT_EQ(file.columns[2].name, "current") << title << units;
      EXPECT_EQ(file.columns[0].values.size(), 60) << title << units;
      EXPECT_EQ(file.columns[0].unit, units.empty() ? "" : "ms") << title << units;
      ASSERT_EQ(file.remarks.size(), 1U) << title << units;
      EXPECT_NE(file.remarks[0].find("above the header in line"), std::string::npos);
    }
  }
  // National Instruments: each channel with a time of its own, equal or not.
  const std::string pairs =
      "Timestamp,1.1.2026,Timestamp,1.1.2026\nInterval,0.002,Interval,0.002\n"
      "Channel name,\"Force\",Channel name,\"Input 1\"\nUnit,\"N\",Unit,\"V\"\n";
  std::string equal, other;
  for (int k = 0; k < 60; ++k) {
    equal += fmt::format("{0:.3f},1.5,{0:.3f},0.2\n", 0.002 * k);
    other += fmt::format("{0:.3f},1.5,{1:.3f},0.2\n", 0.002 * k, 0.002 * k + 0.001);
  }
  for (const auto& [body, count] : {std::pair{equal, 3U}, {other, 4U}}) {
    testing::write_text(folder.file("ni.csv"), pairs + body);
    const RecordingFile file = read_recording_file(folder.file("ni.csv"));
    ASSERT_EQ(file.columns.size(), count);
    EXPECT_EQ(file.columns.front().name, "Time");
    EXPECT_EQ(file.columns.back().name, "Input 1");
    EXPECT_EQ(file.columns.back().unit, "V");
    EXPECT_EQ(file.at("Force [N]").values(3), 1.5) << "its whole title";
  }
  // Two names that are one: the lines that are no header are named.
  testing::expect_refused([&] { read("rate,2\nangle,angle,current\nms,ms,A\n"); },
                          "lines 1 to 3 look like metadata, and the numbers begin in line 4");
  // A comma behind each line names no column.
  std::string commas = "time,angle\n";
  for (int k = 0; k < 60; ++k) commas += fmt::format("{},0.2,\n", 2 * k);
  testing::write_text(folder.file("commas.csv"), commas);
  const RecordingFile trailing = read_recording_file(folder.file("commas.csv"));
  EXPECT_EQ(trailing.columns.size(), 2U);
  EXPECT_TRUE(trailing.remarks.empty());
  testing::write_text(folder.file("more.csv"), "time,angle\n0,1,2\n1,1,3\n");
  EXPECT_NE(read_recording_file(folder.file("more.csv")).remarks.at(0).find("by its number, 3"),
            std::string::npos);
  // None of these is a title.
  EXPECT_TRUE(read("time,angle,current\n").remarks.empty());
  EXPECT_TRUE(read("time,angle,current\nms,deg,A\n").remarks.empty());
  EXPECT_EQ(read("time,angle,current\nms,Nm,furlong\n").columns[2].unit, "furlong");
  EXPECT_EQ(read("time,angle,current\n0,#N/A,\n").columns[0].values.size(), 61);
  EXPECT_EQ(read("").columns[0].name, "1");
  testing::write_text(folder.file("log.csv"), "time;angle\n0,1;0.2\n0,2;0.3\n");
  testing::expect_refused([&] { (void)read_recording_file(folder.file("log.csv")); },
                          "write a decimal point");
}

// An inertia with dry and viscous friction: start values lie within a few per cent.
TEST(StartValues, AnInertiaBesideFriction) {
  constexpr double kInertia = 0.0021, kStep = 0.002;
  constexpr int kSamples = 4000;
  Eigen::VectorXd force(kSamples), velocity(kSamples), position(kSamples);
  double v = 0.0, q = 0.0;
  for (int k = 0; k < kSamples; ++k) {
    const double t = kStep * k;
    force(k) = 0.2 * std::sin(4.0 * t) + 0.15 * std::sin(11.0 * t + 1.0);
    position(k) = q;
    velocity(k) = v;
    for (int s = 0; s < 20; ++s) {
      const double a = (force(k) - 0.05 * std::tanh(v / 0.05) - 0.004 * v) / kInertia;
      q += v * kStep / 20.0;
      v += a * kStep / 20.0;
    }
  }
  const OneMassStart by_velocity = start_one_mass({force, velocity, true, true, kStep});
  const OneMassStart by_position = start_one_mass({force, position, false, true, kStep});
  EXPECT_EQ(by_velocity.told, OneMassTold::kInertia);
  EXPECT_EQ(by_position.told, OneMassTold::kInertia);
  EXPECT_NEAR(by_velocity.inertia, kInertia, 0.1 * kInertia);
  EXPECT_NEAR(by_position.inertia, kInertia, 0.1 * kInertia);
  EXPECT_GT(follows_at_once(force, position, false), 0.5);
}

struct TwoMassRun {
  Eigen::VectorXd force, motor, load;
};

constexpr TwoMassStart kTwoMasses{2e-3, 6e-3, 60.0, 0.05};

// Two masses of which the first has dry friction, with a spring behind a play, in small steps. The
// encoders' zeros differ.
TwoMassRun run_two_masses(double play, double stiffness, double counts_per_turn) {
  constexpr double kStep = 1e-4, kZero = 0.4;
  constexpr int kSamples = 12000, kOver = 10;
  const double count = 2.0 * std::numbers::pi / counts_per_turn;
  TwoMassRun run{Eigen::VectorXd(kSamples), Eigen::VectorXd(kSamples), Eigen::VectorXd(kSamples)};
  double motor = 0.0, motor_speed = 0.0, load = 0.0, load_speed = 0.0;
  for (int k = 0; k < kSamples * kOver; ++k) {
    const double turn = 2.0 * std::numbers::pi * kStep * k, twist = motor - load;
    const double force =
        0.6 * std::sin(0.7 * turn) + 0.4 * std::sin(2.3 * turn + 0.4) + 0.3 * std::sin(5.1 * turn);
    const double stretched = std::copysign(std::max(0.0, std::abs(twist) - 0.5 * play), twist);
    const bool touches = stretched != 0.0 || play == 0.0;
    const double coupling =
        stiffness * stretched + (touches ? kTwoMasses.damping * (motor_speed - load_speed) : 0.0);
    const double friction = 0.004 * motor_speed + 0.05 * std::tanh(motor_speed / 0.05);
    motor_speed += kStep * (force - coupling - friction) / kTwoMasses.motor;
    load_speed += kStep * (coupling - 0.01 * load_speed) / kTwoMasses.load;
    motor += kStep * motor_speed;
    load += kStep * load_speed;
    if (k % kOver != 0) continue;
    run.force(k / kOver) = force;
    run.motor(k / kOver) = count * std::round(motor / count);
    run.load(k / kOver) = count * std::round(load / count) + kZero;
  }
  return run;
}

// `within`: a factor.
void expect_two_masses(const TwoMassRun& run, double stiffness, double within) {
  const auto start = start_two_masses(run.force, run.motor, run.load, false, 1e-3);
  ASSERT_TRUE(start.has_value());
  const double most = std::log(within);
  EXPECT_NEAR(std::log(start->motor / kTwoMasses.motor), 0.0, most) << start->motor;
  EXPECT_NEAR(std::log(start->load / kTwoMasses.load), 0.0, most) << start->load;
  EXPECT_NEAR(std::log(start->stiffness / stiffness), 0.0, most) << start->stiffness;
}

TEST(StartValues, TwoMassesWithoutPlay) {
  expect_two_masses(run_two_masses(0.0, 60.0, 20000.0), 60.0, 1.1);
  expect_two_masses(run_two_masses(0.0, 8.0, 20000.0), 8.0, 1.1);
}

// Half the play is more than a third of the largest twist: spring and load keep their sizes.
TEST(StartValues, TwoMassesWithPlay) {
  expect_two_masses(run_two_masses(0.02, 60.0, 20000.0), 60.0, 1.3);
}

// A count is half the rms twist of the stiff spring: its rounding must not take all of that spring.
TEST(StartValues, TwoMassesByCoarseEncoders) {
  expect_two_masses(run_two_masses(0.0, 8.0, 2000.0), 8.0, 1.1);
  const TwoMassRun run = run_two_masses(0.0, 60.0, 2000.0);
  expect_two_masses(run, 60.0, 1.8);
  const auto start = start_two_masses(run.force, run.motor, run.load, false, 1e-3);
  ASSERT_TRUE(start.has_value());
  EXPECT_GT(start->stiffness, 40.0);
}

}  // namespace
}  // namespace graybox
