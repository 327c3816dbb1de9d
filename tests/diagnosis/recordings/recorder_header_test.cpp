// Headers of oscilloscopes and data loggers: names and units in lines of their own, the time in the
// header, and settings beside the samples.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <string>

#include "diagnosis/proposal/proposal.hpp"
#include "diagnosis/recording_files/recording_file.hpp"
#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/recordings/experiment_recording.hpp"
#include "tests/support/refusal.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

class RecorderHeaders : public ::testing::Test {
 protected:
  RecordingFile read(const std::string& text, const std::string& name = "read.csv") {
    testing::write_text(folder_.file(name), text);
    return read_recording_file(folder_.file(name));
  }
  static void expect_column(const RecordingFile& file, const std::string& name,
                            const std::string& unit, const Eigen::Vector3d& values) {
    const RecordedColumn* column = file.find(name);
    ASSERT_NE(column, nullptr) << name;
    EXPECT_EQ(column->unit, unit) << name;
    EXPECT_TRUE(column->values.isApprox(values, 1e-9)) << name << ": " << column->values;
  }

  testing::TemporaryFolder folder_;
};

TEST_F(RecorderHeaders, NumbersOfChannelsStandAboveTheirUnits) {
  const RecordingFile two = read("x-axis,1,2\nsecond,Volt,Volt\n-.1,2,5\n0,3,6\n.1,4,7\n");
  expect_column(two, "x-axis", "second", {-0.1, 0.0, 0.1});
  expect_column(two, "1", "Volt", {2, 3, 4});
  expect_column(two, "2", "Volt", {5, 6, 7});
  EXPECT_TRUE(two.remarks.empty());
  // What a line names that has units is no header where the numbers are no channels.
  EXPECT_EQ(read("1,2,3\n4,5,6\n").columns[0].name, "1");
  EXPECT_EQ(read("time,speed\ns,rad/s\n0,1\n1,2\n").at("speed").unit, "rad/s");
  EXPECT_EQ(read("Time,Channel A\n(ms),(V)\n\n0,1\n1,2\n").at("Channel A").unit, "V");
}

TEST_F(RecorderHeaders, SamplesBeforeTheFirstOneMayBeEmpty) {
  const RecordingFile file = read("x-axis,1\nsecond,Volt\n-.1,\n0,\n.1,4\n");
  ASSERT_EQ(file.columns.size(), 2U);
  EXPECT_TRUE(std::isnan(file.at("1").values(1)));
  EXPECT_EQ(file.at("1").values(2), 4.0);
  // A row of nothing below the titles is one without numbers, and no header.
  const RecordingFile gap = read("t,u\n,\n1,2\n2,3\n");
  EXPECT_TRUE(std::isnan(gap.at("u").values(0)));
}

TEST_F(RecorderHeaders, TheHeaderBeginsAndStepsTheTime) {
  const RecordingFile file =
      read("X,CH1,CH2,Start,Increment,\nSequence,Volt,A,-5e-2,1e-2\n0,1,4,\n1,2,5,\n2,3,6,\n");
  ASSERT_EQ(file.columns.size(), 3U);
  expect_column(file, "Time", "s", {-0.05, -0.04, -0.03});
  expect_column(file, "CH1", "Volt", {1, 2, 3});
  expect_column(file, "CH2", "A", {4, 5, 6});
  // Rows that don't count are left as they are.
  EXPECT_EQ(read("X,CH1,Start,Increment\nSequence,Volt,0,1e-2\n0,1\n2,2\n4,3\n").columns[0].name,
            "X");
}

TEST_F(RecorderHeaders, SettingsStandAboveOrBesideTheSamples) {
  const RecordingFile above = read(
      "Model,MDO3\nHorizontal Units,s,,\nVertical Units,V,A\nRecord Length,3,,\n,,\nLabels,,\n"
      "TIME,CH1,CH2\n0,1,4\n1,2,5\n2,3,6\n");
  expect_column(above, "TIME", "s", {0, 1, 2});
  expect_column(above, "CH1", "V", {1, 2, 3});
  expect_column(above, "CH2", "A", {4, 5, 6});
  const RecordingFile prefixed = read(
      "Record Length,Analog:3\nVertical Units,CH1:V,CH2:A\nSource,CH1,CH2\nSecond,Volt,Amp\n"
      "0,1,4\n1,2,5\n2,3,6\n");
  expect_column(prefixed, "Source", "Second", {0, 1, 2});
  expect_column(prefixed, "CH2", "Amp", {4, 5, 6});
  const RecordingFile beside =
      read("Record Length,3e3,,-1,4,\nSource,CH2,,0,5,\nVertical Units,V,,1,6,\n");
  expect_column(beside, "Time", "s", {-1, 0, 1});
  expect_column(beside, "CH2", "V", {4, 5, 6});
  testing::expect_refused([&] { (void)read("Record Length,3e3,,-1,4,\nSource,CH2,,0,5,6\n"); },
                          "line 2");
}

TEST_F(RecorderHeaders, MeasurementFilesOfLabVIEWAreTables) {
  const RecordingFile file = read(
      "LabVIEW Measurement\t\nSeparator\tTab\nX_Columns\tOne\n***End_of_Header***\t\t\n"
      "Channels\t2\t\t\nDelta_X\t0.1\t0.1\t\n***End_of_Header***\t\t\n"
      "X_Value\tVoltage\tCurrent\tComment\n0.0\t1\t4\t\n0.1\t2\t5\t\n0.2\t3\t6\t\n",
      "run.lvm");
  expect_column(file, "X_Value", "", {0.0, 0.1, 0.2});
  expect_column(file, "Current", "", {4, 5, 6});
}

// A run-down behind a header of two lines, whose first samples are empty: named by its unit.
TEST_F(RecorderHeaders, AModelIsProposedFromAnOscilloscopesTable) {
  std::string text = "x-axis,1\nsecond,Volt\n";
  for (int k = 0; k < 400; ++k) {
    text += fmt::format("{:.3E},", 0.004 * k);
    text += k < 3 ? "\n" : fmt::format("{:.6E}\n", 5.0 * std::exp(-0.004 * k));
  }
  testing::write_text(folder_.file("log.csv"), text);
  ProposalRequest request;
  request.machine = ProposedMachine::kOneMass;
  request.no_drive = true;
  request.logs = {folder_.file("log.csv")};
  request.folder = folder_.file("axis");
  request.columns = {column_answer("Volt=velocity:rad/s")};
  const ModelProposal proposal = propose_model(request);
  EXPECT_TRUE(proposal.questions.empty());
  std::filesystem::create_directories(folder_.file("axis"));
  testing::write_text(folder_.file("axis/campaign.yaml"), proposal.campaign_text);
  const ExperimentRecording loaded =
      load_experiment(read_campaign(folder_.file("axis/campaign.yaml")), 0);
  EXPECT_NEAR(loaded.data.pieces.front().values(0, loaded.index_of("speed")),
              5.0 * std::exp(-0.012), 1e-3);
}

}  // namespace
}  // namespace graybox
