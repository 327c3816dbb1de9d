// What `graybox model` doubts in a log: drives that are none or lost their sign, units with factors
// or of other quantities, values that are held, logs that are short or uneven. All logs are
// simulated here.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/log_columns/column_rates.hpp"
#include "diagnosis/log_columns/column_words.hpp"
#include "diagnosis/log_columns/log_time.hpp"
#include "diagnosis/proposal/proposal.hpp"
#include "diagnosis/runs/proposed_files.hpp"
#include "tests/support/proposal_words.hpp"
#include "tests/support/refusal.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using Q = LogQuantity;

// J v' = u - b v - c sign(v), at even times.
struct Axis {
  double step;
  std::vector<double> time, position, velocity, force;
};

Axis axis(int samples, double step, double weight = 0.0) {
  constexpr double kInertia = 0.02, kDamping = 0.05, kDry = 0.1;
  constexpr int kSteps = 50;
  Axis result{step, {}, {}, {}, {}};
  double q = 0.0, v = 0.0;
  for (int k = 0; k < samples; ++k) {
    const double t = step * k;
    const double u = weight + 0.6 * std::sin(2.0 * t) + 0.3 * std::sin(5.1 * t + 1.0);
    result.time.push_back(t);
    result.position.push_back(q);
    result.velocity.push_back(v);
    result.force.push_back(u);
    for (int s = 0; s < kSteps; ++s) {
      const double rest = u - weight - kDamping * v - kDry * std::tanh(v / 0.01);
      v += rest / kInertia * step / kSteps;
      q += v * step / kSteps;
    }
  }
  return result;
}

using Column = std::pair<std::string, std::vector<double>>;

class LogDoubts : public ::testing::Test, protected testing::ProposalWords {
 protected:
  std::string write(const std::string& name, const std::vector<Column>& columns) {
    std::string text;
    for (const Column& column : columns) text += (text.empty() ? "" : ",") + column.first;
    text += "\n";
    for (std::size_t k = 0; k < columns.front().second.size(); ++k) {
      for (std::size_t c = 0; c < columns.size(); ++c) {
        text += fmt::format("{}{:.9g}", c == 0 ? "" : ",", columns[c].second[k]);
      }
      text += "\n";
    }
    testing::write_text(folder_.file(name), text);
    return folder_.file(name);
  }

  // What is proposed, without writing.
  ModelProposal proposed(const std::vector<Column>& columns,
                         const std::vector<std::string>& answers = {},
                         ProposalRequest request = {}) {
    request.machine = ProposedMachine::kOneMass;
    request.logs = {write("log.csv", columns)};
    request.folder = folder_.file("axis");
    for (const std::string& each : answers) request.columns.push_back(column_answer(each));
    return propose_model(request);
  }

  // The same with the files, as the command writes them.
  ModelProposal written(const std::vector<std::string>& files) {
    ProposalRequest request;
    request.machine = ProposedMachine::kOneMass;
    for (const std::string& file : files) request.logs.emplace_back(file);
    request.folder = folder_.file("axis");
    ModelProposal proposal = propose_model(request);
    findings_ = write_proposal(request, proposal);
    return proposal;
  }

  testing::TemporaryFolder folder_;
  std::vector<std::string> findings_;
};

std::vector<double> mapped(const std::vector<double>& values,
                           const std::function<double(double)>& change) {
  std::vector<double> result;
  for (const double value : values) result.push_back(change(value));
  return result;
}

// 12 V with noise, and sags under the force.
std::vector<double> supply(const Axis& machine) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0.0, 0.1);
  return mapped(machine.force, [&](double u) { return 12.0 - 0.4 * std::abs(u) + noise(random); });
}

TEST_F(LogDoubts, AColumnThatCountsRowsIsNotOffered) {
  const Axis m = axis(500, 0.01);
  std::vector<double> rows;
  for (std::size_t k = 0; k < m.time.size(); ++k) rows.push_back(static_cast<double>(k));
  const ModelProposal proposal =
      proposed({{"time", m.time}, {"n", rows}, {"position [rad]", m.position}, {"abc", m.force}});
  EXPECT_NE(value_of(proposal, "drive").find("'abc'"), std::string::npos) << questions_of(proposal);
  EXPECT_NE(value_of(proposal, "not used").find("n: numbers the rows"), std::string::npos);
}

// ---- drives -------------------------------------------------------------------------------------

TEST_F(LogDoubts, ASupplyIsNoDriveWithoutAQuestion) {
  const Axis m = axis(1000, 0.01);
  const std::vector<Column> columns{
      {"time", m.time}, {"position", m.position}, {"input_volts", supply(m)}};
  const ModelProposal alone = proposed(columns);
  ASSERT_EQ(alone.questions.size(), 1U) << questions_of(alone);
  EXPECT_NE(questions_of(alone).find("Is 'input_volts' the drive?"), std::string::npos);
  EXPECT_NE(questions_of(alone).find("--column 'input_volts="), std::string::npos);
  EXPECT_TRUE(proposed(columns, {"input_volts=voltage"}).questions.empty());
  // Beside another column it gives way, and 'load' is a servo's word.
  std::vector<Column> more = columns;
  more.emplace_back("load", mapped(m.force, [](double u) { return std::round(100.0 * u); }));
  const ModelProposal both = proposed(more);
  EXPECT_TRUE(both.questions.empty()) << questions_of(both);
  EXPECT_NE(value_of(both, "drive").find("'load'"), std::string::npos);
}

TEST_F(LogDoubts, ADriveThatBearsAWeightIsTakenWithTheDoubt) {
  const Axis m = axis(1000, 0.01, 1.5);
  const ModelProposal proposal =
      proposed({{"time", m.time}, {"position", m.position}, {"current", m.force}});
  EXPECT_TRUE(proposal.questions.empty()) << questions_of(proposal);
  EXPECT_NE(notes_of(proposal).find("never changes its sign"), std::string::npos);
  const Axis free = axis(1000, 0.01);
  const ModelProposal sound =
      proposed({{"time", free.time}, {"position", free.position}, {"current", free.force}});
  EXPECT_EQ(notes_of(sound).find("sign"), std::string::npos) << notes_of(sound);
}

// The mass is negative, whatever stands beside it: no question is left but what to turn.
TEST_F(LogDoubts, ADriveOfTheWrongSignIsTold) {
  const Axis m = axis(2000, 0.01);
  const std::vector<double> turned = mapped(m.force, [](double u) { return -u; });
  const ModelProposal proposal =
      proposed({{"time", m.time}, {"position [rad]", m.position}, {"torque [N m]", turned}});
  const std::string notes = notes_of(proposal);
  EXPECT_NE(notes.find("the drive acts reversed: beside an offset"), std::string::npos) << notes;
  EXPECT_NE(notes.find("the mass stays negative, -0.0"), std::string::npos) << notes;
  EXPECT_NE(notes.find("--gain=-1"), std::string::npos) << notes;
  EXPECT_EQ(notes.find("Either a spring or a weight"), std::string::npos) << notes;
  EXPECT_NE(value_of(proposal, "mass").find("that of the turned drive"), std::string::npos)
      << value_of(proposal, "mass");
  const ModelProposal right =
      proposed({{"time", m.time}, {"position [rad]", m.position}, {"torque [N m]", m.force}});
  EXPECT_EQ(notes_of(right).find("sign"), std::string::npos);
}

// An axis that yields like a spring goes with its drive, and speeds up against it: no mass shows,
// and no sign.
TEST_F(LogDoubts, AnAxisThatOnlyYieldsTellsNoSign) {
  const Axis m = axis(2000, 0.01);
  std::vector<double> force, place;
  for (std::size_t k = 0; k < m.time.size(); ++k) {
    const double n = static_cast<double>(k), t = 0.01 * n;
    force.push_back(6.0 * std::sin(2.0 * t) + 2.0 * std::sin(5.3 * t));
    place.push_back(force.back() / 400.0 + 1e-6 * std::sin(37.0 * n * n));
  }
  const ModelProposal proposal =
      proposed({{"time", m.time}, {"position [rad]", place}, {"torque [N m]", force}});
  EXPECT_EQ(notes_of(proposal).find("are the signs right?"), std::string::npos)
      << notes_of(proposal);
  EXPECT_NE(value_of(proposal, "mass").find("hardly shows an inertia"), std::string::npos)
      << value_of(proposal, "mass");
}

// Of a drive, an encoder and perhaps a tachometer one is reversed: what is named as reversed is
// that or, where nothing tells, one of several; what is said to turn it turns it.
TEST_F(LogDoubts, WhatIsReversedIsNamedWhereTheLogTellsIt) {
  const Axis m = axis(2000, 0.01);
  const auto turned = [](const std::vector<double>& values) {
    return mapped(values, [](double value) { return -value; });
  };
  const Column time{"time", m.time}, drive{"torque [N m]", m.force},
      encoder{"position [rad]", m.position}, tachometer{"velocity [rad/s]", m.velocity};
  const Column turned_drive{drive.first, turned(m.force)},
      turned_encoder{encoder.first, turned(m.position)},
      turned_tachometer{tachometer.first, turned(m.velocity)};
  const std::string either = "'torque' (drive) or 'position' (encoder) is reversed",
                    the_encoder = "'position' (encoder) is reversed: 'velocity' agrees",
                    the_drive = "'torque' (drive) is reversed, or both 'position' and 'velocity'",
                    answer = "--column 'position=position:-rad'";
  // The same numbers but for a common sign: no one can tell.
  for (const std::vector<Column>& columns :
       {std::vector{time, encoder, turned_drive}, std::vector{time, turned_encoder, drive}}) {
    const std::string notes = notes_of(proposed(columns));
    EXPECT_NE(notes.find(either), std::string::npos) << notes;
    EXPECT_NE(notes.find(answer), std::string::npos) << notes;
    EXPECT_NE(notes.find("--gain=-1"), std::string::npos) << notes;
  }
  const std::vector<Column> wrong_encoder{time, turned_encoder, tachometer, drive};
  const std::string encoders = notes_of(proposed(wrong_encoder));
  EXPECT_NE(encoders.find(the_encoder), std::string::npos) << encoders;
  EXPECT_NE(encoders.find(answer), std::string::npos) << encoders;
  EXPECT_EQ(encoders.find("--gain"), std::string::npos) << encoders;
  const std::string drives = notes_of(proposed({time, encoder, tachometer, turned_drive}));
  EXPECT_NE(drives.find(the_drive), std::string::npos) << drives;
  const std::string tachometers = notes_of(proposed({time, encoder, turned_tachometer, drive}));
  EXPECT_EQ(tachometers.find("are the signs right?"), std::string::npos) << tachometers;
  EXPECT_NE(tachometers.find("'velocity' has the opposite sign"), std::string::npos);
  const ModelProposal right = proposed({time, encoder, tachometer, drive}),
                      mended = proposed(wrong_encoder, {"position=position:-rad"});
  EXPECT_EQ(notes_of(mended).find("sign"), std::string::npos) << notes_of(mended);
  EXPECT_EQ(value_of(mended, "mass"), value_of(right, "mass"));
  EXPECT_NE(mended.campaign_text.find("gain: {value: -1, unit: rad/rad}"), std::string::npos)
      << mended.campaign_text;
}

// An arm that is pushed up and falls back: a weight stands in the model.
TEST_F(LogDoubts, ADriveThatOnlyPushesBearsAWeight) {
  constexpr double kInertia = 0.4, kDamping = 4.0, kWeight = 60.0, kStep = 0.002;
  std::vector<double> time, position, force;
  double q = 0.0, v = 0.0;
  for (int k = 0; k < 3000; ++k) {
    const double u = k % 700 > 150 && k % 700 < 250 + k / 20 ? 90.0 : 0.0;
    time.push_back(kStep * k);
    position.push_back(q);
    force.push_back(u);
    for (int s = 0; s < 20; ++s) {
      v += (u - kDamping * v - kWeight * std::sin(q)) / kInertia * kStep / 20.0;
      q += v * kStep / 20.0;
    }
  }
  const ModelProposal proposal =
      proposed({{"time", time}, {"position [rad]", position}, {"torque [N m]", force}});
  EXPECT_NE(proposal.model_text.find("law: gravity"), std::string::npos) << proposal.model_text;
  EXPECT_NE(value_of(proposal, "weight").find("N m at most"), std::string::npos);
}

TEST_F(LogDoubts, ATorqueOfNoiseDoesNotBeatTheCurrent) {
  const Axis m = axis(1000, 0.01);
  std::mt19937_64 random(9);
  std::normal_distribution<double> noise(0.0, 0.02);
  const std::vector<double> junk =
      mapped(m.force, [&](double u) { return u < 0.0 ? 1.75 + noise(random) : 0.0; });
  const ModelProposal asked = proposed(
      {{"time", m.time}, {"position", m.position}, {"torque", junk}, {"current", m.force}});
  ASSERT_EQ(asked.questions.size(), 1U);
  EXPECT_NE(questions_of(asked).find("--column 'torque=force' or --column 'current=current'"),
            std::string::npos)
      << questions_of(asked);
  // A torque that is the current's is no rival.
  const ModelProposal told =
      proposed({{"time", m.time},
                {"position", m.position},
                {"torque", mapped(m.force, [&](double u) { return 2.0 * u + noise(random); })},
                {"current", m.force}});
  EXPECT_TRUE(told.questions.empty()) << questions_of(told);
  EXPECT_NE(value_of(told, "drive").find("'torque'"), std::string::npos);
}

TEST_F(LogDoubts, ASignThatWasLostIsTold) {
  const Axis m = axis(1000, 0.01);
  const ModelProposal lost =
      proposed({{"time", m.time}, {"position", m.position}, {"pwm", mapped(m.force, [](double u) {
                                                               return std::abs(u);
                                                             })}});
  EXPECT_NE(notes_of(lost).find("its sign seems lost"), std::string::npos) << notes_of(lost);
  EXPECT_NE(notes_of(lost).find("kind: product"), std::string::npos);
}

TEST_F(LogDoubts, ADriveWithoutItsSignBitIsUnwrapped) {
  const Axis m = axis(1000, 0.01);
  const ModelProposal proposal = proposed(
      {{"time", m.time}, {"position", m.position}, {"pwm", mapped(m.force, [](double u) {
                                                      const double whole = std::round(300.0 * u);
                                                      return whole < 0.0 ? whole + 65536.0 : whole;
                                                    })}});
  EXPECT_NE(proposal.campaign_text.find("{kind: unwrap, of: [torque], bits: 16}"),
            std::string::npos)
      << proposal.campaign_text;
  EXPECT_NE(value_of(proposal, "mass").find("least squares"), std::string::npos);
}

// ---- units --------------------------------------------------------------------------------------

TEST(UnitFactors, AreReadInTitles) {
  struct Case {
    const char* title;
    const char* unit;
    double factor;
  };
  for (const Case& each :
       {Case{"pos [0.1 deg]", "deg", 0.1}, Case{"current (x10 mA)", "mA", 10.0},
        Case{"torque [1e-3 N m]", "N m", 1e-3}, Case{"angle [deg/10]", "deg", 0.1},
        Case{"angle [deg * 0.01]", "deg", 0.01}, Case{"torque [10^-2 Nm]", "N m", 0.01},
        Case{"force [mN]", "N", 1e-3}, Case{"torque [Ncm]", "N m", 0.01}, Case{"pos_cm", "m", 0.01},
        Case{"current_mA", "mA", 1.0}, Case{"n [1/min]", "rpm", 1.0},
        Case{"speed [rad/s]", "rad/s", 1.0}}) {
    const ColumnWords words = read_column_words(each.title, "");
    EXPECT_EQ(words.unit, each.unit) << each.title;
    EXPECT_NEAR(words.unit_factor, each.factor, 1e-12) << each.title;
    EXPECT_EQ(words.odd_unit, "") << each.title;
  }
}

TEST(UnitFactors, UnitsOfOtherQuantitiesAreOdd) {
  for (const auto& [title, odd] :
       {std::pair{"torque [mN]", "N"}, std::pair{"force [Nm]", "N m"},
        std::pair{"position [V]", "V"}, std::pair{"angle [mm]", "mm"}, std::pair{"speed [A]", "A"},
        std::pair{"position [10 LSB]", "10 LSB"}}) {
    const ColumnWords words = read_column_words(title, "");
    EXPECT_EQ(words.unit, "") << title;
    EXPECT_EQ(words.odd_unit, odd) << title;
  }
  // What stands in brackets, or in a file's attribute, and is no unit that is known.
  for (const auto& [title, odd] :
       {std::pair{"torque [furlong]", "furlong"}, std::pair{"torque (furlong)", "furlong"},
        std::pair{"speed [furlong/s]", "furlong/s"}, std::pair{"position [px]", "px"},
        std::pair{"current [LSB]", "LSB"}, std::pair{"time [fortnight]", "fortnight"},
        std::pair{"torque [raw]", "raw"}}) {
    const ColumnWords words = read_column_words(title, "");
    EXPECT_EQ(words.unit, "") << title;
    EXPECT_EQ(words.odd_unit, odd) << title;
  }
  EXPECT_EQ(read_column_words("torque", "furlong").odd_unit, "furlong");
  EXPECT_EQ(read_column_words("torque [Nm]", "furlong").odd_unit, "");
  // Which of several signals it is, or a remark.
  for (const char* title :
       {"position (motor)", "position [filtered]", "q [joint 1]", "torque (measured)", "x [load]",
        "position [2nd axis]", "torque [-]", "torque []", "torque (tau)", "current (raw)",
        "torque (from the drive's own log)", "position [left]", "torque [Nm]", "angle [0.1 deg]"}) {
    EXPECT_EQ(read_column_words(title, "").odd_unit, "") << title;
  }
  for (const char* unit : {"", "-", "none", "1"}) {
    EXPECT_EQ(read_column_words("torque", unit).odd_unit, "") << unit;
  }
  // These are what their units say, or arrays.
  EXPECT_EQ(read_column_words("encoder [rpm]", "").quantity, Q::kVelocity);
  EXPECT_EQ(read_column_words("torque current [A]", "").quantity, Q::kCurrent);
  EXPECT_EQ(read_column_words("position [2nd axis]", "").odd_unit, "");
  EXPECT_EQ(read_column_words("rec.pos[3]", "").odd_unit, "");
}

TEST_F(LogDoubts, AFactorInAUnitScalesTheChannel) {
  const Axis m = axis(1000, 0.01);
  constexpr double kTenths = 1800.0 / 3.14159265358979;
  const ModelProposal plain =
      proposed({{"time", m.time}, {"angle", m.position}, {"torque [Nm]", m.force}});
  const ModelProposal scaled =
      proposed({{"time", m.time},
                {"angle [0.1 deg]", mapped(m.position, [](double q) { return kTenths * q; })},
                {"torque [1e-3 Nm]", mapped(m.force, [](double u) { return 1e3 * u; })}});
  EXPECT_NE(scaled.campaign_text.find("unit: deg, gain: {value: 0.0017453293, unit: rad/deg}"),
            std::string::npos)
      << scaled.campaign_text;
  EXPECT_NE(scaled.campaign_text.find("gain: {value: 0.001, unit: N m/N m}"), std::string::npos);
  EXPECT_EQ(value_of(plain, "mass"), value_of(scaled, "mass"));
  // A unit that was said takes the place of the title's.
  const ModelProposal said =
      proposed({{"time", m.time}, {"angle [0.1 deg]", m.position}, {"torque [Nm]", m.force}},
               {"angle [0.1 deg]=position:rad"});
  EXPECT_EQ(value_of(plain, "mass"), value_of(said, "mass"));
}

TEST_F(LogDoubts, AUnitThatDoesNotFitIsAsked) {
  const Axis m = axis(1000, 0.01);
  const std::vector<Column> columns{
      {"time", m.time}, {"angle", m.position}, {"torque [mN]", m.force}};
  const ModelProposal asked = proposed(columns);
  ASSERT_EQ(asked.questions.size(), 1U);
  EXPECT_NE(questions_of(asked).find("is no unit of a torque"), std::string::npos);
  EXPECT_TRUE(proposed(columns, {"torque [mN]=torque:mN m"}).questions.empty());
  // What it is says nothing of its unit.
  EXPECT_EQ(proposed(columns, {"torque [mN]=torque"}).questions.size(), 1U);
}

// Whatever column it is: the question names file, column and the units that are known.
TEST_F(LogDoubts, AUnitThatIsNotKnownIsAsked) {
  const Axis m = axis(1000, 0.01);
  const std::vector<Column> plain{{"time", m.time}, {"position", m.position}, {"torque", m.force}};
  const std::vector<std::string> known{"(s, ms, us, ns, min)", "rad, mrad, deg", "N m, mN m, kN m"};
  for (std::size_t k = 0; k < plain.size(); ++k) {
    std::vector<Column> columns = plain;
    columns[k].first += " [furlong]";
    const ModelProposal asked = proposed(columns);
    ASSERT_EQ(asked.questions.size(), 1U) << columns[k].first << questions_of(asked);
    const std::string text = questions_of(asked);
    EXPECT_NE(text.find("log.csv: column '" + columns[k].first + "': 'furlong' is no unit"),
              std::string::npos)
        << text;
    EXPECT_NE(text.find(known[k]), std::string::npos) << text;
    EXPECT_NE((asked.campaign_text + asked.model_text).find("# ANSWER:"), std::string::npos);
    const std::string unit = std::vector{"time:s", "position:rad", "torque:N m"}[k];
    const ModelProposal told = proposed(columns, {columns[k].first + "=" + unit});
    EXPECT_TRUE(told.questions.empty()) << questions_of(told);
  }
}

// A title's unit is no unit of its quantity, or simply wrong: the user's takes its place, and what
// is written is read as a diagnosis reads it.
TEST_F(LogDoubts, AUnitThatTheUserSaysReplacesTheTitles) {
  const Axis machine = axis(1500, 0.01);
  for (const std::string title : {"Force [V]", "Force (A)", "Force [N]"}) {
    const std::string log = write(
        "log.csv",
        {{"Time [s]", machine.time}, {title, machine.force}, {"Position [V]", machine.position}});
    ProposalRequest request;
    request.machine = ProposedMachine::kOneMass;
    request.logs = {log};
    request.folder = folder_.file("axis");
    request.columns = {column_answer(title + "=force:N"), column_answer("Position=position:mm")};
    ModelProposal proposal = propose_model(request);
    EXPECT_EQ(value_of(proposal, "motion"), "linear; you said so");
    EXPECT_NO_THROW(findings_ = write_proposal(request, proposal)) << title;
    EXPECT_NE(proposal.campaign_text.find("column: \"Position [V]\", unit: mm"), std::string::npos)
        << proposal.campaign_text;
  }
}

// `model` refuses what a diagnosis would, and writes nothing.
TEST_F(LogDoubts, WhatADiagnosisWouldRefuseIsRefused) {
  const Axis machine = axis(1500, 0.01);
  const std::vector<Column> columns{
      {"time [s]", machine.time}, {"force", machine.force}, {"position [m]", machine.position}};
  std::vector<Column> other = columns;
  other[1].first = "force [kN]";
  const std::vector<std::string> logs{write("one.csv", other), write("two.csv", columns)};
  EXPECT_NO_THROW(written(logs));
  std::filesystem::remove_all(folder_.file("axis"));
  // The second log's title has another unit than the campaign, which is the first's.
  other[1].first = "force [N]";
  for (double& value : other[1].second) value *= 1.01;
  testing::expect_refused(
      [&] {
        written({logs[0], write("three.csv", other)});
      },
      "force is in N, but the campaign says kN");
  EXPECT_FALSE(std::filesystem::exists(folder_.file("axis")));
  ProposalRequest rotary;
  rotary.motion = MotionKind::kRotary;
  testing::expect_refused([&] { (void)proposed(columns, {}, rotary); }, "say --linear");
}

TEST_F(LogDoubts, ProposalsFollowTheMotionThatWasAskedFor) {
  const Axis machine = axis(400, 0.01);
  ProposalRequest linear;
  linear.motion = MotionKind::kLinear;
  const std::string units = questions_of(proposed({{"time [s]", machine.time},
                                                   {"Force [V]", machine.force},
                                                   {"Position [V]", machine.position}},
                                                  {}, linear));
  EXPECT_NE(units.find("Force=force:N'"), std::string::npos) << units;
  EXPECT_NE(units.find("Position=position:m'"), std::string::npos) << units;
  EXPECT_EQ(units.find("=position:rad"), std::string::npos) << units;
  const std::vector<double> counts =
      mapped(machine.position, [](double q) { return std::round(1e5 * q); });
  const std::string steps = questions_of(proposed(
      {{"time [s]", machine.time}, {"force [N]", machine.force}, {"encoder", counts}}, {}, linear));
  EXPECT_NE(steps.find("How long is one count"), std::string::npos) << steps;
}

// Axes' letters before the words of a quantity.
TEST_F(LogDoubts, AxesLettersDoNotHideAQuantity) {
  for (const auto& [title, quantity] : {std::pair{"XPOS", Q::kPosition},
                                        {"YVOLT", Q::kVoltage},
                                        {"zTacho", Q::kVelocity},
                                        {"tacho", Q::kVelocity},
                                        {"xforce", Q::kForce},
                                        {"exit", Q::kUnknown}}) {
    EXPECT_EQ(read_column_words(title, "").quantity, quantity) << title;
  }
}

TEST_F(LogDoubts, ASampleTimeThatTheStampsContradictIsRefused) {
  const Axis m = axis(1000, 0.01);
  const auto with = [&](const char* title, double unit, double stated) {
    ProposalRequest request;
    request.sample_time = stated;
    return proposed({{title, mapped(m.time, [&](double t) { return unit * t; })},
                     {"position [rad]", m.position},
                     {"torque [N m]", m.force}},
                    {}, request);
  };
  for (const auto& [title, unit] : {std::pair{"time [ms]", 1e3}, std::pair{"time", 1.0}}) {
    testing::expect_refused([&] { with(title, unit, 0.002); },
                            "log.csv: column 'time': steps of 0.01");
    testing::expect_refused([&] { with(title, unit, 0.002); }, "--sample-time says 0.002 s");
    EXPECT_TRUE(with(title, unit, 0.01).questions.empty());
  }
  // Where no title states the unit, it follows.
  const ModelProposal open = with("time", 100.0, 0.001);  // steps of 1: s or ms
  EXPECT_EQ(open.questions.size(), 0U);
  testing::expect_refused([&] { with("time", 50.0, 0.01); }, "its unit is not stated");
}

TEST_F(LogDoubts, CountsOfATurnNeedCounts) {
  const Axis m = axis(1000, 0.01);
  ProposalRequest request;
  request.counts_per_turn = 4096;
  const std::vector<double> counts =
      mapped(m.position, [](double q) { return std::round(4096.0 * q / 6.283185307179586); });
  const Column time{"time", m.time}, drive{"torque [N m]", m.force};
  testing::expect_refused(
      [&] {
        proposed({time, {"position [rad]", m.position}, drive}, {}, request);
      },
      "--counts-per-turn: 'position' is in rad, not in counts");
  const ModelProposal counted = proposed({time, {"enc [counts]", counts}, drive}, {}, request);
  EXPECT_TRUE(counted.questions.empty());
  EXPECT_NE(counted.campaign_text.find("value: 0.0015339808"), std::string::npos);
  // Beside another sensor it is asked which of both, and neither is called rad.
  std::vector<double> other = counts;
  for (std::size_t k = 0; k < other.size(); ++k) {
    other[k] = std::round(0.25 * counts[k] + 300.0 * m.velocity[k]);
  }
  const Column first{"Encoder 1 Pos", counts}, second{"Encoder 2 Pos", other};
  const ModelProposal open = proposed({time, first, second, drive}, {}, request);
  EXPECT_NE(questions_of(open).find("Which is the measured position"), std::string::npos);
  EXPECT_NE(open.campaign_text.find("rad/counts"), std::string::npos) << open.campaign_text;
  EXPECT_TRUE(
      proposed({time, first, second, drive}, {"Encoder 2 Pos=ignore"}, request).questions.empty());
  // A factor in the unit, a reversed one among them, is in the gain.
  const ModelProposal turned =
      proposed({time, {"enc [counts]", counts}, drive}, {"enc=position:-counts"}, request);
  EXPECT_NE(turned.campaign_text.find("value: -0.0015339808"), std::string::npos)
      << turned.campaign_text;
}

// The unit is that of the steps; what is printed in decimals alone tells none.
TEST_F(LogDoubts, StepsOfAnEncoderTellTheUnitOfAnAngle) {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  const Axis m = axis(1000, 0.01);
  const auto in_steps = [&](double step, double scale, double printed) {
    return mapped(m.position, [=](double q) {
      const double counted = step * std::round(scale * q / step);
      return printed > 0.0 ? printed * std::round(counted / printed) : counted;
    });
  };
  const auto unit_of = [&](const std::vector<double>& position) {
    const ModelProposal proposal =
        proposed({{"time [s]", m.time}, {"angle", position}, {"torque [N m]", m.force}});
    return value_of(proposal, "position") + questions_of(proposal);
  };
  const std::string degrees = unit_of(in_steps(360.0 / 2048.0, 3.0, 1e-5));
  EXPECT_EQ(degrees, "'angle' in deg; its title; steps of 360/2048");
  EXPECT_EQ(unit_of(in_steps(kTurn / 4096.0, 1.0, 1e-6)),
            "'angle' in rad; its title; steps of 2 pi/4096");
  // In two decimals its steps are 0.08 and 0.09.
  EXPECT_EQ(unit_of(in_steps(360.0 / 4096.0, 3.0, 0.01)),
            "'angle' in deg; its title; steps of 360/4096");
  EXPECT_EQ(unit_of(mapped(m.position, [](double q) { return 0.01 * std::round(300.0 * q); }))
                .find("steps of"),
            std::string::npos);
  // Also over many turns, where it would be asked else.
  EXPECT_NE(unit_of(in_steps(360.0 / 1024.0, 57.3, 0.0)).find("steps of 360/1024"),
            std::string::npos);
  for (const double printed : {0.1, 0.01, 0.25}) {
    EXPECT_EQ(unit_of(in_steps(printed, 3.0, 0.0)).find("steps of"), std::string::npos) << printed;
  }
  EXPECT_EQ(unit_of(in_steps(360.0 / 2048.0, 3.0, 0.1)).find("steps of"), std::string::npos);
  EXPECT_EQ(unit_of(m.position).find("steps of"), std::string::npos);
}

// ---- values that are held -----------------------------------------------------------------------

TEST_F(LogDoubts, AHeldMotionIsTakenAtItsOwnRate) {
  const Axis m = axis(6000, 0.001);
  std::vector<double> held;
  for (std::size_t k = 0; k < m.velocity.size(); ++k) {
    held.push_back(std::round(50.0 * m.velocity[k - (k + 3) % 5 * (k > 5 ? 1 : 0)]) / 50.0);
  }
  const std::string file =
      write("held.csv", {{"time [s]", m.time}, {"speed [rad/s]", held}, {"torque [Nm]", m.force}});
  const ModelProposal proposal = written({file});
  EXPECT_NE(value_of(proposal, "held").find("each value for 5 samples"), std::string::npos);
  EXPECT_NE(proposal.campaign_text.find("every: {samples: 5, from: 2}"), std::string::npos)
      << proposal.campaign_text;
  EXPECT_NE(proposal.model_text.find("sample_time: 0.005"), std::string::npos);
  EXPECT_NE(value_of(proposal, "mass").find("least squares"), std::string::npos)
      << value_of(proposal, "mass");
  for (const std::string& finding : findings_)
    EXPECT_FALSE(finding.starts_with("error")) << finding;
  // Without times it is filtered and decimated.
  ProposalRequest request;
  request.logs = {write("bare.csv", {{"speed [rad/s]", held}, {"torque [Nm]", m.force}})};
  request.sample_time = 0.001;
  EXPECT_NE(propose_model(request).campaign_text.find("{kind: decimate, factor: 5}"),
            std::string::npos);
}

// ---- splits -------------------------------------------------------------------------------------

// A current that was read every eighth row, beside a motion that was read in each.
TEST_F(LogDoubts, ADriveThatIsReadMoreRarelyIsTold) {
  Axis m = axis(1200, 0.01);
  const auto notes = [&] {
    return notes_of(
        proposed({{"time", m.time}, {"position [rad]", m.position}, {"torque [N m]", m.force}}));
  };
  EXPECT_EQ(notes().find("has a new value every"), std::string::npos);
  for (std::size_t k = 0; k < m.force.size(); ++k) m.force[k] = m.force[k - k % 8];
  EXPECT_NE(notes().find("has a new value every 8 rows: it is read every 0.08 s, the motion every "
                         "0.01 s"),
            std::string::npos)
      << notes();
}

TEST_F(LogDoubts, ALogThatStandsStillMayBeNamedFirst) {
  Axis m = axis(300, 0.02);
  const auto written_as = [&](const std::string& name) {
    return write(name,
                 {{"time [s]", m.time}, {"angle [rad]", m.position}, {"torque [Nm]", m.force}});
  };
  const std::string moves = written_as("moves.csv");
  std::ranges::fill(m.position, 0.25);
  std::ranges::fill(m.force, 0.01);
  const std::string stands = written_as("stands.csv");
  for (const auto& files : {std::vector{stands, moves}, std::vector{moves, stands}}) {
    const ModelProposal proposal = written(files);
    EXPECT_EQ(value_of(proposal, "kept out").substr(0, 10), "stands.csv");
    EXPECT_TRUE(proposal.questions.empty());
  }
}

TEST_F(LogDoubts, AShortLogIsNotCutUntilNothingCanUseIt) {
  const Axis m = axis(52, 0.04);
  const std::string file = write(
      "short.csv", {{"time [s]", m.time}, {"angle [rad]", m.position}, {"torque [Nm]", m.force}});
  const ModelProposal proposal = written({file});
  EXPECT_NE(value_of(proposal, "kept out").find("too few samples"), std::string::npos)
      << value_of(proposal, "kept out");
  const Axis longer = axis(1000, 0.04);
  const ModelProposal halves = written({write("long.csv", {{"time [s]", longer.time},
                                                           {"angle [rad]", longer.position},
                                                           {"torque [Nm]", longer.force}})});
  EXPECT_EQ(value_of(halves, "kept out"), "the second half; checks the fit");
}

// A push in the first half, and then the axis coasts.
TEST_F(LogDoubts, WhatIsKeptOutHasADriveToo) {
  Axis m = axis(1200, 0.01);
  const ModelProposal halves =
      proposed({{"time", m.time}, {"position [rad]", m.position}, {"torque [N m]", m.force}});
  EXPECT_EQ(value_of(halves, "kept out"), "the second half; checks the fit");
  for (std::size_t k = 560; k < m.force.size(); ++k) m.force[k] = 0.0;
  const ModelProposal blocks =
      proposed({{"time", m.time}, {"position [rad]", m.position}, {"torque [N m]", m.force}});
  EXPECT_EQ(value_of(blocks, "kept out"),
            "every second of 4 parts; the drive is zero in the second half, so halves would not be "
            "alike");
  std::size_t kept = 0;
  for (std::size_t at = 0;
       (at = blocks.campaign_text.find("role: validation", at)) != std::string::npos; ++at) {
    ++kept;
  }
  EXPECT_EQ(kept, 2U) << blocks.campaign_text;
}

// Frequencies that rise: each part has low and high ones.
TEST_F(LogDoubts, AChirpIsSplitInManyParts) {
  std::vector<double> time, force, position;
  double q = 0.0, v = 0.0;
  for (int k = 0; k < 4000; ++k) {
    const double t = 0.005 * k, u = std::sin(2.0 * t * t);
    time.push_back(t);
    position.push_back(q);
    force.push_back(u);
    for (int s = 0; s < 10; ++s) {
      v += (u - 0.1 * v) / 0.02 * 0.0005;
      q += v * 0.0005;
    }
  }
  const ModelProposal proposal =
      proposed({{"time", time}, {"position [rad]", position}, {"torque [N m]", force}});
  EXPECT_NE(value_of(proposal, "kept out").find("frequency changes along the log"),
            std::string::npos)
      << value_of(proposal, "kept out");
}

// Rows every 0.02 s at first, and then every half second.
TEST_F(LogDoubts, RowsThatWouldBeInventedAreTold) {
  const Axis m = axis(3000, 0.02);
  std::vector<double> time, position, force;
  for (std::size_t k = 0; k < 3000; k += k < 150 ? 1 : 25) {
    time.push_back(m.time[k] + 0.001 * static_cast<double>(k % 3));
    position.push_back(m.position[k]);
    force.push_back(m.force[k]);
  }
  const ModelProposal proposal =
      proposed({{"time", time}, {"position [rad]", position}, {"torque [N m]", force}});
  EXPECT_NE(notes_of(proposal).find("what is kept out has"), std::string::npos)
      << notes_of(proposal);
  EXPECT_NE(notes_of(proposal).find("interpolated"), std::string::npos);
}

// A hub that sends eight rows at once, and then pauses: at the step within a burst most samples
// would be invented.
TEST_F(LogDoubts, RowsInBurstsAreResampledAtTheirMean) {
  const Axis m = axis(9000, 0.0015);
  std::vector<double> time, position, force;
  for (std::size_t k = 0; k < 9000; k += time.size() % 8 == 0 ? 34U : 1U) {
    time.push_back(m.time[k]);
    position.push_back(m.position[k]);
    force.push_back(m.force[k]);
  }
  const ModelProposal proposal =
      proposed({{"time", time}, {"position [rad]", position}, {"torque [N m]", force}});
  EXPECT_NE(proposal.campaign_text.find("# the mean step, of rows in bursts"), std::string::npos)
      << proposal.campaign_text;
  EXPECT_NE(proposal.campaign_text.find("sample_time: 0.0077}"), std::string::npos);
}

TEST_F(LogDoubts, AShortRunIsLeftOutBesideLongerOnes) {
  const Axis m = axis(400, 0.02), few = axis(39, 0.02);
  const auto file = [&](const std::string& name, const Axis& each) {
    return write(
        name,
        {{"time [s]", each.time}, {"angle [rad]", each.position}, {"torque [Nm]", each.force}});
  };
  const ModelProposal proposal = written({file("a.csv", m), file("b.csv", few)});
  EXPECT_NE(notes_of(proposal).find("b.csv is left out: 39 rows, and a recording needs 50"),
            std::string::npos)
      << notes_of(proposal);
  ProposalRequest alone;
  alone.logs = {folder_.file("b.csv")};
  testing::expect_refused([&] { return propose_model(alone); },
                          "b.csv: 39 rows, and a recording needs 50 samples");
  testing::expect_refused([&] { return propose_model(alone); },
                          "A table of steady states, a row for each, is no recording over time");
}

// ---- uneven times, short logs, gears ------------------------------------------------------------

// Steps of 120 ms, and later of 60 and 120 ms: the median is none that the second half allows.
// One log twice checks nothing: not under another name, with other stamps, in another order of
// columns, or where it is a part of the other.
TEST_F(LogDoubts, ALogGivenTwiceIsLeftOut) {
  const Axis m = axis(2000, 0.01), other = axis(2000, 0.01, 0.05);
  const auto part = [](const std::vector<double>& values, long from, long count) {
    return std::vector<double>(values.begin() + from, values.begin() + from + count);
  };
  const Column time{"time", m.time}, position{"position [rad]", m.position},
      drive{"torque [N m]", m.force};
  const std::vector<double> later = mapped(m.time, [](double t) { return t + 100.0; });
  const std::string first = write("first.csv", {time, position, drive}),
                    second = write("second.csv", {{"time", later}, drive, position}),
                    third = write("third.csv", {{"time", part(m.time, 0, 500)},
                                                {"position [rad]", part(m.position, 700, 500)},
                                                {"torque [N m]", part(m.force, 700, 500)}}),
                    fourth = write("fourth.csv", {{"time", other.time},
                                                  {"position [rad]", other.position},
                                                  {"torque [N m]", other.force}});
  const std::string one = value_of(written({first}), "kept out");
  for (const std::string& copy : {first, second, third}) {
    for (const std::vector<std::string>& files : {std::vector{first, copy}, {copy, first}}) {
      const ModelProposal proposal = written(files);
      EXPECT_NE(notes_of(proposal).find("is left out: it holds the same values as"),
                std::string::npos)
          << copy << notes_of(proposal);
      EXPECT_EQ(value_of(proposal, "kept out"), one) << copy;
    }
  }
  const ModelProposal two = written({first, fourth});
  EXPECT_EQ(notes_of(two).find("left out"), std::string::npos) << notes_of(two);
  EXPECT_NE(value_of(two, "kept out").find("fourth.csv"), std::string::npos);
}

TEST_F(LogDoubts, StepsOfTwoSizesMakeACampaignThatCanBeRead) {
  constexpr int kLong = 400, kAll = 780;
  const Axis m = axis(8200, 0.01);
  std::vector<Column> columns{{"time [s]", {}}, {"angle [rad]", {}}, {"torque [Nm]", {}}};
  std::size_t k = 0;
  for (int n = 0; n < kAll; ++n) {
    columns[0].second.push_back(m.time[k]);
    columns[1].second.push_back(m.position[k]);
    columns[2].second.push_back(m.force[k]);
    k += n < kLong || n % 5 > 2 ? 12 : 6;
  }
  const ModelProposal proposal = written({write("uneven.csv", columns)});
  EXPECT_NE(value_of(proposal, "time").find("every 0.06 s"), std::string::npos)
      << value_of(proposal, "time");
  EXPECT_TRUE(std::filesystem::exists(folder_.file("axis/campaign.yaml")));
}

TEST_F(LogDoubts, AGearIsCalledOne) {
  const Axis m = axis(1000, 0.01);
  const ModelProposal proposal =
      proposed({{"time [s]", m.time},
                {"angle [rad]", m.position},
                {"speed [rad/s]", mapped(m.velocity, [](double v) { return 33.5 * v; })},
                {"torque [Nm]", m.force}});
  EXPECT_NE(notes_of(proposal).find("times 33.5, as behind a gear"), std::string::npos)
      << notes_of(proposal);
  EXPECT_TRUE(proposal.questions.empty()) << questions_of(proposal);
}

TEST_F(LogDoubts, AShortLogsRateIsItsRateAndMayBeLate) {
  const Axis m = axis(100, 0.02);
  const Eigen::Map<const Eigen::VectorXd> q(m.position.data(), 100), v(m.velocity.data(), 100);
  const auto fit = fit_rate(q, v, 0.02);
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit->factor, 1.0, 0.05);
  Eigen::VectorXd late(100);
  for (int k = 0; k < 100; ++k) late(k) = m.velocity[static_cast<std::size_t>(std::max(0, k - 4))];
  const auto shifted = fit_rate(q, late, 0.02);
  ASSERT_TRUE(shifted);
  EXPECT_NEAR(shifted->late, 0.08, 0.021);
}

// What is said to be unused is what is unused.
TEST_F(LogDoubts, WordsAboutARateNameWhatIsNotUsed) {
  const Axis m = axis(1000, 0.01);
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  const ModelProposal proposal = proposed(
      {{"time [s]", m.time},
       {"position [inc]", mapped(m.time, [&](double) { return std::round(5e3 * any(random)); })},
       {"speed [rad/s]", m.velocity},
       {"torque [Nm]", m.force}});
  EXPECT_NE(value_of(proposal, "velocity").find("'speed'"), std::string::npos);
  EXPECT_NE(notes_of(proposal).find("'position [inc]' is not used"), std::string::npos)
      << notes_of(proposal);
  EXPECT_EQ(notes_of(proposal).find("it is not used"), std::string::npos);
}

// However much was seen of the two.
TEST_F(LogDoubts, WhatIsNotUsedIsSaidOnce) {
  const Axis m = axis(1000, 0.01);
  std::mt19937_64 random(11);
  std::normal_distribution<double> noise(0.0, 0.05);
  std::vector<double> late = m.velocity;
  for (std::size_t k = late.size() - 1; k >= 10; --k) late[k] = 3.7 * late[k - 10];
  for (const double rough : {0.0, 1.0}) {
    const std::vector<double> angle =
        mapped(m.position, [&](double q) { return q + rough * noise(random); });
    const std::string notes = notes_of(
        proposed({{"time [s]", m.time}, {"angle", angle}, {"speed", late}, {"torque", m.force}}));
    const std::size_t first = notes.find(" is not used");
    EXPECT_NE(first, std::string::npos) << notes;
    EXPECT_EQ(notes.find(" is not used", first + 1), std::string::npos) << notes;
  }
}

// A current goes before a command, and times that are not the time are listed, too.
TEST_F(LogDoubts, WhyAColumnIsNotUsedIsSaid) {
  const Axis m = axis(1000, 0.01);
  const ModelProposal proposal =
      proposed({{"Ts_real_s", mapped(m.time, [](double t) { return t > 0.0 ? 0.01 : -0.99; })},
                {"time_s", m.time},
                {"PWM_input", mapped(m.force, [](double u) { return 100.0 * u; })},
                {"omega_rad_s", m.velocity},
                {"current_A", m.force}});
  const std::string unused = value_of(proposal, "not used");
  EXPECT_NE(unused.find("Ts_real_s: another time"), std::string::npos) << unused;
  EXPECT_NE(unused.find("PWM_input: 'current_A', a current, is nearer to the force"),
            std::string::npos)
      << unused;
  EXPECT_EQ(unused.find("time_s: "), std::string::npos) << unused;
}

// A counter rises in steps of about one size: no force does.
TEST_F(LogDoubts, ACounterIsNoDrive) {
  const Axis m = axis(1000, 0.01);
  std::vector<double> counter;
  for (std::size_t k = 0; k < m.time.size(); ++k) {
    counter.push_back(9271.0 + 10.0 * static_cast<double>(k) + static_cast<double>(k % 3));
  }
  const ModelProposal proposal =
      proposed({{"time [s]", m.time}, {"Step", counter}, {"angle [rad]", m.position}});
  EXPECT_EQ(value_of(proposal, "drive"), "");
  EXPECT_NE(value_of(proposal, "not used").find("Step: a counter"), std::string::npos)
      << value_of(proposal, "not used");
  EXPECT_NE(questions_of(proposal).find("--no-drive"), std::string::npos) << questions_of(proposal);
}

TEST_F(LogDoubts, AWordForAnAngleGoesBeforeALetter) {
  const Axis m = axis(1000, 0.01);
  const ModelProposal proposal = proposed(
      {{"time [s]", m.time}, {"X", m.velocity}, {"Theta", m.position}, {"torque", m.force}});
  EXPECT_EQ(value_of(proposal, "motion").substr(0, 6), "rotary") << value_of(proposal, "motion");
}

// A cart and its pendulum: the word for the angle is the better one, and the cart is driven.
TEST_F(LogDoubts, AnAxisThatTheDriveMovesMoreIsAsked) {
  const Axis m = axis(1000, 0.01);
  const std::vector<double> other = mapped(m.time, [](double t) { return std::sin(0.7 * t); });
  const std::vector<Column> cart{
      {"time [s]", m.time}, {"X", m.position}, {"Theta", other}, {"u", m.force}};
  const ModelProposal asked = proposed(cart);
  EXPECT_NE(questions_of(asked).find("Which is the measured position: 'X' or 'Theta'? The drive "
                                     "moves 'X' more"),
            std::string::npos)
      << questions_of(asked);
  EXPECT_NE(value_of(proposed(cart, {"Theta=ignore"}), "position").find("'X'"), std::string::npos);
  EXPECT_NE(value_of(proposed(cart, {"Theta=position:rad"}), "position").find("'Theta'"),
            std::string::npos);
  const ModelProposal driven =
      proposed({{"time [s]", m.time}, {"X", other}, {"Theta", m.position}, {"u", m.force}});
  EXPECT_NE(value_of(driven, "position").find("'Theta'"), std::string::npos)
      << questions_of(driven);
  // In step with the angle, as on a belt, it is no other axis.
  const ModelProposal belt = proposed({{"time [s]", m.time},
                                       {"X", mapped(m.position, [](double q) { return 0.02 * q; })},
                                       {"Theta", m.position},
                                       {"u", m.force}});
  EXPECT_NE(value_of(belt, "position").find("'Theta'"), std::string::npos) << questions_of(belt);
}

// The speed is right and the angle jitters: its rate tells no units.
TEST_F(LogDoubts, ARoughAngleLeavesTheSpeed) {
  const Axis m = axis(1000, 0.02);
  std::mt19937_64 random(11);
  std::normal_distribution<double> noise(0.0, 0.25);
  const ModelProposal proposal =
      proposed({{"time [s]", m.time},
                {"angle", mapped(m.position, [&](double q) { return 1.6 * q + noise(random); })},
                {"speed", m.velocity},
                {"torque", m.force}});
  EXPECT_NE(value_of(proposal, "velocity").find("'speed'"), std::string::npos)
      << value_of(proposal, "position") << questions_of(proposal) << notes_of(proposal);
  EXPECT_NE(notes_of(proposal).find("'speed' is much smoother than the rate of 'angle'; 'angle' is "
                                    "not used"),
            std::string::npos)
      << notes_of(proposal);
}

// A second that one stamp did not carry, and another that was carried too early.
TEST_F(LogDoubts, AWrongStampIsMendedAndTold) {
  const Axis m = axis(1000, 0.01);
  for (const double off : {-1.0, 1.0}) {
    std::vector<double> times = m.time;
    times[300] += off;
    const std::string file = write(
        "stamps.csv", {{"time [s]", times}, {"angle [rad]", m.position}, {"torque [Nm]", m.force}});
    const ModelProposal proposal = written({file});
    EXPECT_NE(notes_of(proposal).find(fmt::format("'time' of row 301: {:.10g} is 1 too {}: read "
                                                  "as 3",
                                                  3.0 + off, off < 0.0 ? "early" : "late")),
              std::string::npos)
        << notes_of(proposal);
    EXPECT_EQ(notes_of(proposal).find("begins anew"), std::string::npos);
    EXPECT_EQ(value_of(proposal, "left out"), "");
    EXPECT_EQ(value_of(proposal, "kept out").substr(0, 15), "the second half");
  }
}

// Rows of runs that are too short are counted.
TEST_F(LogDoubts, RowsThatAreDroppedAreCounted) {
  const Axis m = axis(1000, 0.01);
  std::vector<double> times = m.time;
  for (std::size_t k = 0; k < 1000; ++k) {
    times[k] = k < 27 ? m.time[k] + 50.0 : k < 500 ? m.time[k] : m.time[k] - 5.0;
  }
  const ModelProposal proposal =
      proposed({{"time [s]", times}, {"angle [rad]", m.position}, {"torque [Nm]", m.force}});
  EXPECT_EQ(value_of(proposal, "left out").substr(0, 7), "27 rows") << notes_of(proposal);
  EXPECT_NE(notes_of(proposal).find("27 other rows"), std::string::npos) << notes_of(proposal);
}

}  // namespace
}  // namespace graybox
