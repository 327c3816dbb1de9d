// Logs as other programs and people write them: what each is read as.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/log_columns/column_words.hpp"
#include "diagnosis/log_columns/log_recordings.hpp"
#include "diagnosis/log_columns/log_time.hpp"
#include "diagnosis/proposal/proposal.hpp"
#include "diagnosis/recording_files/recording_file.hpp"
#include "diagnosis/recording_files/time_stamp.hpp"
#include "diagnosis/recording_files/written_unit.hpp"
#include "tests/support/proposal_words.hpp"
#include "tests/support/refusal.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using Q = LogQuantity;

struct ReadTitle {
  const char* title;
  Q quantity;
  const char* unit;
};

void expect_titles(const std::vector<ReadTitle>& titles) {
  for (const ReadTitle& each : titles) {
    const ColumnWords words = read_column_words(each.title, "");
    EXPECT_EQ(words.quantity, each.quantity) << each.title << ": " << name_of(words.quantity);
    EXPECT_EQ(words.unit, each.unit) << each.title;
  }
}

// ---- titles -------------------------------------------------------------------------------------

TEST(LogTitles, AUnitStandsAnywhereInATitle) {
  expect_titles({
      {"rpm_actual", Q::kVelocity, "rpm"},
      {"actual_rpm", Q::kVelocity, "rpm"},
      {"rpm_measured", Q::kVelocity, "rpm"},
      {"RPM (measured)", Q::kVelocity, "rpm"},
      {"rpmL", Q::kVelocity, "rpm"},
      {"rpm_1", Q::kVelocity, "rpm"},
      {"current_rpm", Q::kVelocity, "rpm"},
      {"rpm_speed", Q::kVelocity, "rpm"},
      {"motor speed rpm actual", Q::kVelocity, "rpm"},
      {"measured rpm of the motor", Q::kVelocity, "rpm"},
      {"/joint/rpm/data", Q::kVelocity, "rpm"},
      {"rpm_encoder", Q::kVelocity, "rpm"},
      {"U/min ist", Q::kVelocity, "rpm"},
      {"rev/min", Q::kVelocity, "rpm"},
      {"revs_per_min", Q::kVelocity, "rpm"},
      {"deg_s_meas", Q::kVelocity, "deg/s"},
      {"rad_per_s_actual", Q::kVelocity, "rad/s"},
      {"vel_rad_s_2", Q::kVelocity, "rad/s"},
      {"vel_rads_filt", Q::kVelocity, "rad/s"},
      {"mm_s_actual", Q::kVelocity, "mm/s"},
      {"turns/s", Q::kVelocity, "turn/s"},
      {"speed_hz", Q::kVelocity, "turn/s"},
      {"speed_kmh", Q::kVelocity, "m/s"},
      {"angle_deg_raw", Q::kPosition, "deg"},
      {"deg_actual", Q::kPosition, "deg"},
      {"pos_mm_act", Q::kPosition, "mm"},
      {"ticks_left", Q::kPosition, "counts"},
      {"torque_Nm_filtered", Q::kForce, "N m"},
      {"amps_actual", Q::kCurrent, "A"},
      {"time_ms_since_start", Q::kTime, "ms"},
  });
  EXPECT_TRUE(read_column_words("rpm_actual", "").is_measured);
  EXPECT_TRUE(read_column_words("rpm_cmd", "").is_reference);
  EXPECT_EQ(read_column_words("rpm_1", "").index, 1);
  EXPECT_NEAR(read_column_words("v_kmh", "").unit_factor, 1.0 / 3.6, 1e-12);
}

// Words of units that mean something else where they stand.
TEST(LogTitles, WordsOfOtherMeaningsAreNoUnits) {
  expect_titles({
      {"turn_rate", Q::kVelocity, ""},
      {"us_1", Q::kUnknown, ""},
      {"ma_5", Q::kUnknown, ""},
      {"u_min_limit", Q::kCommand, ""},
      {"m_s_torque", Q::kForce, ""},
      {"loop_rate_hz", Q::kVelocity, ""},
      {"zeit_in_s", Q::kTime, "s"},
      {"n", Q::kUnknown, ""},
      {"n_ist", Q::kVelocity, ""},
      {"i_q", Q::kCurrent, ""},
  });
  for (const char* title : {"vel_ticks_s", "counts_per_s", "enc_cps", "counts/s"}) {
    const ColumnWords words = read_column_words(title, "");
    EXPECT_EQ(words.quantity, Q::kVelocity) << title;
    EXPECT_EQ(words.odd_unit, "counts/s") << title;  // asked, not taken for rad/s
  }
}

TEST(LogTitles, SignsAndOtherWordsOfMotionAndTime) {
  expect_titles({
      {"\xCF\x89", Q::kVelocity, ""},
      {"\xCE\xB8", Q::kPosition, ""},
      {"\xCE\xB8\xCC\x87", Q::kVelocity, ""},
      {"\xCF\x84 [Nm]", Q::kForce, "N m"},
      {"gyro_z", Q::kVelocity, ""},
      {"twist.angular.z", Q::kVelocity, ""},
      {"Spd_act", Q::kVelocity, ""},
      {"yaw", Q::kPosition, ""},
      {"pitch_torque", Q::kForce, ""},
      {"timestamps", Q::kTime, ""},
      {"stamps", Q::kTime, ""},
      {"times", Q::kTime, ""},
      {"ts", Q::kTime, ""},
      {"datetime", Q::kTime, ""},
      {"uptime", Q::kTime, ""},
  });
  EXPECT_EQ(read_column_words("gyro_z", "").motion, MotionKind::kRotary);
  for (const char* title :
       {"pan", "tilt", "yaw", "pitch", "roll", "azimuth", "elevation", "heading"}) {
    const ColumnWords words = read_column_words(title, "");
    EXPECT_EQ(words.quantity, Q::kPosition) << title;
    EXPECT_EQ(words.motion, MotionKind::kRotary) << title;
  }
  EXPECT_TRUE(read_column_words("pan_target", "").is_reference);
  EXPECT_EQ(read_column_words("pan_current", "").quantity, Q::kCurrent);
}

// ---- files --------------------------------------------------------------------------------------

class LogVariants : public ::testing::Test, protected testing::ProposalWords {
 protected:
  RecordingFile read(const std::string& text, const std::string& name = "read.csv") {
    testing::write_text(folder_.file(name), text);
    return read_recording_file(folder_.file(name));
  }
  // What --one-mass proposes for a log, whose drive and motion are not as they would be measured.
  ModelProposal proposed(const std::string& text, const std::string& name = "log.csv",
                         const std::vector<std::string>& answers = {}) {
    testing::write_text(folder_.file(name), text);
    ProposalRequest request;
    request.machine = ProposedMachine::kOneMass;
    request.logs = {folder_.file(name)};
    request.folder = folder_.file("axis");
    for (const std::string& each : answers) request.columns.push_back(column_answer(each));
    return propose_model(request);
  }

  testing::TemporaryFolder folder_;
};

using Row = std::function<std::string(int, double, double)>;

// Rows of a drive u and the speed y that it causes, each as `row` writes it.
std::string rows_of(int count, const Row& row) {
  std::string text;
  double y = 0.0;
  for (int k = 0; k < count; ++k) {
    const double u = std::sin(0.05 * k) + 0.6 * std::sin(0.171 * k + 1.0);
    text += row(k, u, y);
    y += 0.01 * (8.0 * u - 4.0 * y);
  }
  return text;
}

TEST_F(LogVariants, NamesBehindTheLastFieldHaveNoNumbers) {
  for (const auto& [header, separator] : {std::pair{"t,u,q,extra", ","},
                                          {"t;u;q;extra", ";"},
                                          {"t u q extra", " "},
                                          {"t,u,q,", ","},
                                          {"t,u,q,extra,more", ","}}) {
    const RecordingFile file = read(fmt::format("{0}\n0{1}2{1}4\n1{1}3{1}5\n", header, separator));
    ASSERT_EQ(file.columns.size(), 3U) << header;
    EXPECT_EQ(file.at("q").values, Eigen::Vector2d(4, 5)) << header;
    const bool is_named = std::string(header).find("extra") != std::string::npos;
    ASSERT_EQ(file.remarks.size(), is_named ? 1U : 0U) << header;
    if (!is_named) continue;
    EXPECT_NE(file.remarks[0].find("the rows have 3 fields"), std::string::npos) << header;
    EXPECT_NE(file.remarks[0].find("'extra'"), std::string::npos) << header;
  }
  const RecordingFile with_units = read("t,u,q,extra\ns,V,rad\n0,2,4\n1,3,5\n");
  EXPECT_EQ(with_units.at("u").unit, "V");
  EXPECT_EQ(with_units.at("q").values, Eigen::Vector2d(4, 5));
  // A title and its unit in two fields.
  const RecordingFile in_fields = read("time, s, u, speed, rpm\n0,2,4\n1,3,5\n");
  ASSERT_EQ(in_fields.columns.size(), 3U);
  EXPECT_EQ(in_fields.at("speed").unit, "rpm");
  EXPECT_EQ(in_fields.at("u").values, Eigen::Vector2d(2, 3));
  ASSERT_EQ(in_fields.remarks.size(), 1U);
  EXPECT_NE(in_fields.remarks[0].find("'rpm' of 'speed'"), std::string::npos);
  // A title that is a unit by itself.
  const RecordingFile of_rpm = read("t,u,rpm,extra\n0,2,4\n1,3,5\n");
  EXPECT_EQ(of_rpm.at("rpm").values, Eigen::Vector2d(4, 5));
  // Rows that differ are still refused.
  testing::expect_refused([&] { (void)read("t,u,q,x\n0,1,2\n1,2,3,4\n"); }, "4 fields");
  testing::expect_refused([&] { (void)read("t,u,q,x\n0,1,2\n1,2\n"); }, "2 fields");
  testing::expect_refused([&] { (void)read("t,u,q,x\n0,1,2,3\n1,2,3\n"); }, "3 fields");
}

TEST_F(LogVariants, QuotesHoldSeparators) {
  const RecordingFile titles = read("\"Time, s\",\"Speed, rpm\"\n0,1.5\n1,2.5\n");
  ASSERT_EQ(titles.columns.size(), 2U);
  EXPECT_EQ(titles.columns[1].name, "Speed, rpm");
  EXPECT_EQ(titles.columns[1].values, Eigen::Vector2d(1.5, 2.5));
  const RecordingFile commas = read("\"t\",\"u\"\n\"0\",\"1,5\"\n\"1\",\"2,5\"\n");
  EXPECT_EQ(commas.at("u").values, Eigen::Vector2d(1.5, 2.5));
  const RecordingFile blanks = read("\"motor speed\" t\n1 2\n3 4\n");
  EXPECT_EQ(blanks.at("motor speed").values, Eigen::Vector2d(1, 3));
  const RecordingFile of_r = read("\"t\" \"u\"\n\"1\" 0 5\n\"2\" 1 6\n");
  EXPECT_EQ(of_r.at("u").values, Eigen::Vector2d(5, 6));
}

TEST_F(LogVariants, WordsForAMissingNumberAreNone) {
  for (const char* word : {"NA", "null", "None", "-", "1.#QNAN", "-1.#IND", "#N/A"}) {
    const RecordingFile file = read(fmt::format("t,u\n0,1\n1,{}\n2,3\n", word));
    EXPECT_TRUE(std::isnan(file.at("u").values(1))) << word;
    EXPECT_EQ(file.at("u").values(2), 3.0) << word;
  }
  testing::expect_refused([&] { (void)read("t,u\n0,1\n1,zero\n2,3\n"); }, "'zero' is no number");
}

TEST_F(LogVariants, AHeaderAmongTheRowsIsPassedOver) {
  const RecordingFile file = read("t,u\n0,1\n1,2\nt,u\n2,3\n");
  EXPECT_EQ(file.at("u").values, Eigen::Vector3d(1, 2, 3));
  ASSERT_EQ(file.remarks.size(), 1U);
  EXPECT_NE(file.remarks[0].find("the header stands among the rows again"), std::string::npos);
  testing::expect_refused([&] { (void)read("t,u\n0,1\n1,2\nt,v\n2,3\n"); }, "'t' is no number");
}

TEST_F(LogVariants, TextsInOtherLettersAreRead) {
  const RecordingFile latin = read("Zeit;Winkel [\xB0]\n0;1\n1;2\n");
  EXPECT_EQ(latin.columns[1].name, "Winkel [\xC2\xB0]");
  EXPECT_EQ(read_column_words(latin.columns[1].name, "").unit, "deg");
  for (const bool is_little : {true, false}) {
    std::string wide = is_little ? "\xFF\xFE" : "\xFE\xFF";
    for (const char c : std::string("t\tu\n0\t1.5\n1\t2.5\n")) {
      wide += is_little ? std::string{c, '\0'} : std::string{'\0', c};
    }
    EXPECT_EQ(read(wide).at("u").values, Eigen::Vector2d(1.5, 2.5)) << is_little;
  }
  for (const char* name : {"log.tsv", "log.log", "LOG.CSV"}) {
    EXPECT_EQ(read("t\tu\n0\t1.5\n1\t2.5\n", name).columns.size(), 2U) << name;
  }
}

TEST(LogStamps, ShortAndAmericanOnesAreRead) {
  const auto seconds = [](const char* text) {
    const std::optional<TimeStamp> stamp = parse_time_stamp(text);
    return stamp ? stamp->seconds : -1.0;
  };
  EXPECT_EQ(seconds("01:02.5"), 62.5);
  EXPECT_EQ(seconds("3/14/2024 01:02:03.500 PM"), 3600.0 * 13 + 123.5);
  EXPECT_EQ(seconds("14/3/2024 01:02:03"), 3723.0);
  EXPECT_EQ(seconds("14-03-2024 01:02:03"), 3723.0);
  EXPECT_EQ(parse_time_stamp("3/14/2024")->day, parse_time_stamp("2024-03-14")->day);
  EXPECT_EQ(parse_time_stamp("14/3/2024")->day, parse_time_stamp("2024-03-14")->day);
  for (const char* text : {"01:02", "14/14/2024", "01:62.5", "3/14-2024", "2024.03.14"}) {
    EXPECT_FALSE(parse_time_stamp(text)) << text;
  }
}

// ---- JSON ---------------------------------------------------------------------------------------

TEST_F(LogVariants, JsonTablesOfManyShapes) {
  for (const char* text :
       {R"([{"t": 0, "u": 5}, {"t": 1, "u": 6}, {"t": 2, "u": 7}])",
        R"({"mass": 1.1, "motor": "x", "entries": [{"t": 0, "u": 5}, {"t": 1, "u": 6},
            {"t": 2, "u": 7}], "events": [{"what": "start"}]})",
        R"({"data": {"samples": [{"t": 0, "u": 5}, {"t": 1, "u": 6}, {"t": 2, "u": 7}]}})",
        R"({"t": {"0": 0, "1": 1, "10": 2}, "u": {"0": 5, "1": 6, "10": 7}})",
        R"({"columns": ["t", "u"], "index": [0, 1, 2], "data": [[0, 5], [1, 6], [2, 7]]})",
        R"({"header": ["t", "u"], "rows": [[0, 5], [1, 6], [2, 7]]})",
        "{\"t\": 0, \"u\": 5}\n{\"t\": 1, \"u\": 6}\n{\"t\": 2, \"u\": 7}\n"}) {
    const RecordingFile file = read(text, "log.json");
    EXPECT_EQ(file.columns.size(), 2U) << text;
    EXPECT_EQ(file.at("u").values, Eigen::Vector3d(5, 6, 7)) << text;
  }
  // Numbers in their order: as text "10" comes before "9".
  const RecordingFile many =
      read(R"({"u": {"0":0,"1":1,"2":2,"3":3,"4":4,"5":5,"6":6,"7":7,"8":8,"9":9,"10":10}})",
           "log.json");
  EXPECT_EQ(many.at("u").values(9), 9.0);
  testing::expect_refused([&] { (void)read(R"({"a": [{"t": 0}, {"t": "x"}]})", "bad.json"); },
                          "record 2");
}

// ---- proposals ----------------------------------------------------------------------------------

TEST_F(LogVariants, ASpeedInRpmIsTaken) {
  const ModelProposal proposal =
      proposed("t_ms,pwm_cmd,rpm_actual,pwm_output\n" + rows_of(400, [](int k, double u, double y) {
                 return fmt::format("{},{:.5g},{:.5g}\n", 650000 + 10 * k, 50 * u, 9.55 * y);
               }));
  EXPECT_TRUE(proposal.questions.empty()) << all_of(proposal);
  EXPECT_TRUE(says(proposal, "velocity: 'rpm_actual' in rpm")) << all_of(proposal);
  EXPECT_TRUE(says(proposal, "left out: 'pwm_output'")) << all_of(proposal);
}

TEST_F(LogVariants, StampsAreTheTime) {
  std::string stamps, positions, drives;
  (void)rows_of(400, [&](int k, double u, double y) {
    const char* comma = k == 0 ? "" : ", ";
    stamps += fmt::format("{}{:.6f}", comma, 0.0136 + 0.016 * k + 2e-5 * std::sin(9.0 * k));
    positions += fmt::format("{}{:.5g}", comma, y);
    drives += fmt::format("{}{:.5g}", comma, u);
    return "";
  });
  const ModelProposal proposal =
      proposed(fmt::format(R"({{"m": 0.3, "positions": [{}], "u": [{}], "timestamps": [{}]}})",
                           positions, drives, stamps),
               "log.json");
  EXPECT_TRUE(says(proposal, "time: 'timestamps' in s; guessed from steps of 0.016"))
      << all_of(proposal);
}

TEST_F(LogVariants, ATimeThatNobodyNamesIsAskedWithItsUnit) {
  const ModelProposal asked =
      proposed("u,speed_rpm,foo\n" + rows_of(400, [](int k, double u, double y) {
                 return fmt::format("{:.5g},{:.5g},{:.5g}\n", u, y, 3.0 + 0.01 * k);
               }));
  EXPECT_TRUE(says(asked, "'foo' rises by 0.01 a row")) << all_of(asked);
  EXPECT_TRUE(says(asked, "--column 'foo=time:s'")) << all_of(asked);
  EXPECT_TRUE(says(asked, "foo: rises evenly, as a time does")) << all_of(asked);
  // A logger's pauses: steps of 15 and 60 ms are not even.
  const ModelProposal uneven = proposed("0,0,2.9\n" + rows_of(400, [](int k, double u, double y) {
                                          return fmt::format("{:.5g},{:.5g},{:.5g}\n", u, y,
                                                             3.0 + 0.015 * k + 0.045 * (k / 25));
                                        }));
  EXPECT_TRUE(says(uneven, "--column '3=time:s'")) << all_of(uneven);
  EXPECT_TRUE(says(uneven, "3: rises throughout, as a time does")) << all_of(uneven);
  EXPECT_FALSE(says(uneven, "rises evenly")) << all_of(uneven);
  // Ten samples a second are likelier than ten thousand.
  const ModelProposal tenth =
      proposed("time,u,speed_rpm\n" + rows_of(400, [](int k, double u, double y) {
                 return fmt::format("{:.7g},{:.5g},{:.5g}\n", 0.100073 * k, u, y);
               }));
  EXPECT_TRUE(says(tenth, "Which unit has 'time'")) << all_of(tenth);
  EXPECT_TRUE(says(tenth, "--column 'time=time:s', say")) << all_of(tenth);
  const ModelProposal of_labview =
      proposed("X_Value,u,speed_rpm\n" + rows_of(400, [](int k, double u, double y) {
                 return fmt::format("{:.5g},{:.5g},{:.5g}\n", 0.01 * k, u, y);
               }));
  EXPECT_TRUE(says(of_labview, "time: 'X_Value' in s")) << all_of(of_labview);
  // A motion called x is none.
  const ModelProposal of_motion =
      proposed("x,u,time\n" + rows_of(400, [](int k, double u, double y) {
                 return fmt::format("{:.5g},{:.5g},{:.5g}\n", y, u, 0.01 * k);
               }));
  EXPECT_TRUE(says(of_motion, "position: 'x' in")) << all_of(of_motion);
}

TEST_F(LogVariants, WordsForPartsOfASecondAreUnits) {
  const auto with = [&](const std::string& unit) {
    return proposed(fmt::format("time ({}),u,speed_rpm\n", unit) +
                    rows_of(400, [](int k, double u, double y) {
                      return fmt::format("{},{:.5g},{:.5g}\n", 301 + k, u, y);
                    }));
  };
  for (const char* word : {"millisec", "msecs", "millisecond"}) {
    EXPECT_TRUE(says(with(word), "samples every 0.001 s")) << all_of(with(word));
  }
  for (const char* word : {"microsec", "usecs"}) {
    EXPECT_TRUE(says(with(word), "samples every 1e-06 s")) << all_of(with(word));
  }
  // Words that are not known, but for how they begin.
  EXPECT_TRUE(says(with("milliseg"), "=time:ms', say")) << all_of(with("milliseg"));
  EXPECT_TRUE(says(with("mikrosek"), "=time:us', say")) << all_of(with("mikrosek"));
}

TEST_F(LogVariants, AUnitInEachFieldIsTheColumns) {
  const RecordingFile file =
      read("t,f,v,state\n0,54.7 Hz,1 rpm,1 A\n1,100.9 Hz,,2 B\n2,104 Hz,3.5 rpm,3 C\n");
  ASSERT_EQ(file.columns.size(), 3U);
  EXPECT_EQ(file.at("f").values, Eigen::Vector3d(54.7, 100.9, 104.0));
  EXPECT_EQ(file.at("f").unit, "Hz");
  EXPECT_EQ(file.at("v").unit, "rpm");
  EXPECT_DOUBLE_EQ(file.at("v").values(2), 3.5);
  EXPECT_EQ(file.left_out, std::vector<std::string>{"state"});
  testing::expect_refused([&] { (void)read("t,v\n0,1 rpm\n1,2\n2,3\n"); }, "'1 rpm' is no number");
}

// A log of one column holds the drive or the motion: one question, which says what is missing.
TEST_F(LogVariants, OneColumnIsNotAskedTwice) {
  const std::string log = "time [s],Output\n" + rows_of(400, [](int k, double u, double) {
                            return fmt::format("{:.5g},{:.5g}\n", 0.01 * k, u);
                          });
  const ModelProposal proposal = proposed(log);
  ASSERT_EQ(proposal.questions.size(), 1U) << all_of(proposal);
  EXPECT_TRUE(says(proposal, "Is 'Output' what drives, or what was measured?"));
  EXPECT_TRUE(says(proposal, "mass: 1 kg m^2; guessed: open until the questions are answered\n"))
      << all_of(proposal);
}

TEST_F(LogVariants, WhatNobodyKnowsMayBeASpeed) {
  const ModelProposal asked =
      proposed("time,pwm,foo\n" + rows_of(400, [](int k, double u, double y) {
                 return fmt::format("{:.5g},{:.5g},{:.5g}\n", 0.01 * k, u, y);
               }));
  EXPECT_TRUE(says(asked, "--column 'foo=position:rad'")) << all_of(asked);
  EXPECT_TRUE(says(asked, "--column 'foo=velocity:rad/s'")) << all_of(asked);
  // A speed that is wanted says nothing of a position's unit.
  const ModelProposal wanted =
      proposed("time,pwm,target_rpm,angle_deg\n" + rows_of(400, [](int k, double u, double y) {
                 return fmt::format("{:.5g},{:.5g},{:.5g},{:.5g}\n", 0.01 * k, u, 90 * y, 5 * y);
               }));
  EXPECT_TRUE(wanted.questions.empty()) << all_of(wanted);
  EXPECT_TRUE(says(wanted, "position: 'angle_deg' in deg")) << all_of(wanted);
}

// A drive whose title says something else.
TEST_F(LogVariants, WhatMayDriveIsOffered) {
  for (const auto& [title, answer] : {std::pair{"V_m", "V_m=voltage"},
                                      {"speed_cmd", "speed_cmd=command"},
                                      {"motorPower", "motorPower=command"}}) {
    const std::string log =
        fmt::format("time,{},pos_rad\n", title) + rows_of(400, [](int k, double u, double y) {
          return fmt::format("{:.5g},{:.5g},{:.5g}\n", 0.01 * k, u, y);
        });
    const ModelProposal asked = proposed(log);
    ASSERT_EQ(asked.questions.size(), 1U) << all_of(asked);
    EXPECT_TRUE(says(asked, fmt::format("or --column '{}' if that is", answer))) << all_of(asked);
    const bool is_offered = std::ranges::any_of(
        asked.questions.front().choices,
        [&](const AnswerChoice& each) { return each.columns == std::vector<std::string>{answer}; });
    EXPECT_TRUE(is_offered) << title;
    const ModelProposal answered = proposed(log, "log.csv", {answer});
    EXPECT_TRUE(answered.questions.empty()) << all_of(answered);
    EXPECT_TRUE(says(answered, fmt::format("drive: '{}'", title))) << all_of(answered);
  }
}

}  // namespace
}  // namespace graybox
