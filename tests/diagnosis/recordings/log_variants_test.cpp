// Logs as other programs and people write them: what each is read as.
#include <fmt/format.h>
#include <gtest/gtest.h>

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
}

}  // namespace
}  // namespace graybox
