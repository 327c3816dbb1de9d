// Data files of every format hold the same columns; damaged ones are refused; real recordings load
// through the committed campaign files.
#include <gtest/gtest.h>
#include <matio.h>

#include <Eigen/Core>
#include <Eigen/QR>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>

#include "diagnosis/recording_files/recording_file.hpp"
#include "diagnosis/recordings/experiment_recording.hpp"
#include "diagnosis/simulation/recording_writer.hpp"
#include "problems/base/error.hpp"
#include "tests/support/refusal.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using testing::write_text;

constexpr Eigen::Index kSamples = 40;

// Two channels of 40 samples.
Eigen::MatrixXd channels() {
  const Eigen::ArrayXd t = Eigen::ArrayXd::LinSpaced(kSamples, 0.0, 3.9);
  Eigen::MatrixXd values(kSamples, 2);
  values.col(0) = t.sin();
  values.col(1) = t * t - 1.0;
  return values;
}

class RecordingFormats : public ::testing::Test {
 protected:
  std::string file(const std::string& name) const { return folder_.file(name); }

  void expect_columns(const std::string& name, const std::string& first,
                      const std::string& second) {
    const RecordingFile read = read_recording_file(file(name));
    EXPECT_EQ(read.at(first).values, channels().col(0)) << name;
    EXPECT_EQ(read.at(second).values, channels().col(1)) << name;
  }
  void expect_refused(const std::string& name, const std::string& message) {
    const auto read = [&] { (void)read_recording_file(file(name)).at("x"); };
    testing::expect_refused(read, message);
    testing::expect_refused(read, name);
  }
  // As numpy.save writes it.
  void write_npy(const std::string& name, const std::string& shape, bool fortran,
                 const Eigen::Ref<const Eigen::MatrixXd>& in_file_order) {
    std::string header =
        "{'descr': '<f8', 'fortran_order': " + std::string(fortran ? "True" : "False") +
        ", 'shape': " + shape + ", }";
    header.append((64 - (10 + header.size() + 1) % 64) % 64, ' ');
    header += '\n';
    const Eigen::MatrixXd values = in_file_order;
    std::string bytes = "\x93NUMPY\x01";
    bytes += '\0';
    bytes += static_cast<char>(header.size());
    bytes += '\0';
    bytes += header;
    bytes.append(reinterpret_cast<const char*>(values.data()),
                 static_cast<std::size_t>(values.size()) * sizeof(double));
    write_text(file(name), bytes);
  }
  // values [samples x 2], a structure rec with the transpose as single, and a 3 x 3 matrix.
  void write_mat(const std::string& name, mat_ft version) {
    const std::unique_ptr<mat_t, int (*)(mat_t*)> mat(
        Mat_CreateVer(file(name).c_str(), nullptr, version), Mat_Close);
    ASSERT_NE(mat, nullptr);
    Eigen::MatrixXd values = channels();
    std::array<std::size_t, 2> size{static_cast<std::size_t>(kSamples), 2};
    matvar_t* matrix =
        Mat_VarCreate("values", MAT_C_DOUBLE, MAT_T_DOUBLE, 2, size.data(), values.data(), 0);
    Mat_VarWrite(mat.get(), matrix, MAT_COMPRESSION_NONE);
    Mat_VarFree(matrix);
    Eigen::MatrixXf transposed = values.transpose().cast<float>();
    std::array<std::size_t, 2> wide{2, static_cast<std::size_t>(kSamples)};
    std::array<std::size_t, 2> one{1, 1};
    std::array<const char*, 1> fields{"speed"};
    matvar_t* structure = Mat_VarCreateStruct("rec", 2, one.data(), fields.data(), 1);
    Mat_VarSetStructFieldByName(
        structure, "speed", 0,
        Mat_VarCreate(nullptr, MAT_C_SINGLE, MAT_T_SINGLE, 2, wide.data(), transposed.data(), 0));
    Mat_VarWrite(mat.get(), structure, MAT_COMPRESSION_NONE);
    Mat_VarFree(structure);
    Eigen::Matrix3d square = Eigen::Matrix3d::Identity();
    std::array<std::size_t, 2> three{3, 3};
    matvar_t* gains =
        Mat_VarCreate("gains", MAT_C_DOUBLE, MAT_T_DOUBLE, 2, three.data(), square.data(), 0);
    Mat_VarWrite(mat.get(), gains, MAT_COMPRESSION_NONE);
    Mat_VarFree(gains);
  }

  testing::TemporaryFolder folder_;
};

TEST_F(RecordingFormats, NumpyArraysOfAnyOrderAndOrientation) {
  write_npy("wide.npy", "(2, 40)", false, channels());
  expect_columns("wide.npy", "1", "2");
  write_npy("tall.npy", "(40, 2)", false, channels().transpose());
  expect_columns("tall.npy", "1", "2");
  write_npy("fortran.npy", "(40, 2)", true, channels());
  expect_columns("fortran.npy", "1", "2");
  write_npy("square.npy", "(3, 3)", false, Eigen::Matrix3d::Identity());
  expect_refused("square.npy", "along which axis does time run?");
  write_npy("deep.npy", "(2, 2, 10)", false, channels());
  expect_refused("deep.npy", "one or two axes");
  write_npy("short.npy", "(2, 41)", false, channels());
  expect_refused("short.npy", "truncated");
}

TEST_F(RecordingFormats, MatlabFilesOfBothVersions) {
  for (const auto& [name, version] :
       {std::pair{"five.mat", MAT_FT_MAT5}, std::pair{"seven_three.mat", MAT_FT_MAT73}}) {
    write_mat(name, version);
    expect_columns(name, "values[1]", "values[2]");
    const RecordingFile read = read_recording_file(file(name));
    const Eigen::VectorXd single = channels().col(1).cast<float>().cast<double>();
    EXPECT_EQ(read.at("rec.speed[2]").values, single) << name;
    EXPECT_THROW((void)read.at("gains[1]"), InputError) << name;
    expect_refused(name, "there is no column 'x'; there are:");
    const auto half = std::filesystem::file_size(file(name)) / 2;
    std::filesystem::resize_file(file(name), half);
    expect_refused(name, "truncated");
  }
  write_text(file("no.mat"), "this is no MATLAB file, whatever its name says");
  expect_refused("no.mat", "no MATLAB file");
}

TEST_F(RecordingFormats, Hdf5WithUnitsAndSampleTime) {
  write_recording(file("run.h5"), 0.1,
                  {{"u", "N m", channels().col(0)}, {"y", "rad/s", channels().col(1)}});
  expect_columns("run.h5", "u", "y");
  const RecordingFile read = read_recording_file(file("run.h5"));
  EXPECT_EQ(read.at("y").unit, "rad/s");
  EXPECT_EQ(read.sample_time, 0.1);
  std::filesystem::resize_file(file("run.h5"), 600);
  expect_refused("run.h5", "truncated");
}

TEST_F(RecordingFormats, JsonTablesAndKeys) {
  write_text(file("rows.json"), R"({"data": [[0, 1, 2], [0.1, 3, null], [0.2, 5, 6],
    [0.3, 7, 8], [0.4, 9, 10], [0.5, 11, 12]], "run": {"speed": [1, 2.5, 3]}, "note": "text"})");
  const RecordingFile read = read_recording_file(file("rows.json"));
  EXPECT_EQ(read.at("data[2]").values(5), 11.0);
  EXPECT_TRUE(std::isnan(read.at("data[3]").values(1)));
  EXPECT_EQ(read.at("run.speed").values(1), 2.5);
  write_text(file("bad.json"), R"({"x": [[1, 2], [3]]})");
  expect_refused("bad.json", "unequal length");
  write_text(file("bad.json"), R"({"x": [1, "two"]})");
  expect_refused("bad.json", "expected numbers");
  write_text(file("bad.json"), R"({"x": [1, 2)");
  expect_refused("bad.json", "not valid JSON");
  write_text(file("bad.json"), R"({"x": "text"})");
  expect_refused("bad.json", "no columns of numbers");
}

TEST_F(RecordingFormats, UnknownEndingsAreRefused) {
  write_text(file("run.xlsx"), "1");
  expect_refused("run.xlsx", "unknown ending '.xlsx'; known: .csv");
}

// Texts as other programs write them.
TEST_F(RecordingFormats, TextsOfOtherProgramsAreRead) {
  write_text(file("run.dat"), "% Bench 3\n% t, u\n0 1\n1 5\n2 4\n");
  const RecordingFile matlab = read_recording_file(file("run.dat"));
  EXPECT_EQ(matlab.at("u").values, Eigen::Vector3d(1, 5, 4));
  EXPECT_EQ(&matlab.at("2"), &matlab.at("u"));  // campaigns may say its number
  write_text(file("run.txt"), "#open loop test\n#t\tn\tx [mm]\n0\t7\t2\n1\t8\t3\n");
  const RecordingFile commented = read_recording_file(file("run.txt"));
  EXPECT_EQ(commented.at("x").unit, "mm");
  write_text(file("run.txt"), "# three words here\n0 7\n1 8\n");
  EXPECT_EQ(read_recording_file(file("run.txt")).columns[1].name, "2");
}

TEST_F(RecordingFormats, HeadersThatNameSomeColumnsOnly) {
  write_text(file("export.csv"), "\"Time\",\"data\"\n0,7,1,2\n1,8,3,4\n");
  const RecordingFile series = read_recording_file(file("export.csv"));
  ASSERT_EQ(series.columns.size(), 4U);
  EXPECT_EQ(series.columns[1].name, "data");
  EXPECT_EQ(series.at("4").values, Eigen::Vector2d(2, 4));
  ASSERT_EQ(series.remarks.size(), 1U);
  EXPECT_NE(series.remarks[0].find("names 2 of 4 columns"), std::string::npos);

  write_text(file("excel.csv"), "t, ,u,,\n0,5,#VALUE!,,J\n1,6,2,,0.1\n2,7,3,,\n");
  const RecordingFile excel = read_recording_file(file("excel.csv"));
  ASSERT_EQ(excel.columns.size(), 3U);
  EXPECT_EQ(excel.at("2").values, Eigen::Vector3d(5, 6, 7));
  EXPECT_TRUE(std::isnan(excel.at("u").values(0)));
  ASSERT_EQ(excel.remarks.size(), 1U);
  EXPECT_NE(excel.remarks[0].find("column 5"), std::string::npos);
  write_text(file("bad.csv"), "x,y\n1,two\n2,3\n");
  expect_refused("bad.csv", "'two' is no number");
}

// ---- real recordings ----------------------------------------------------------------------------

Campaign real_campaign(const std::string& name) {
  return read_campaign(GRAYBOX_SOURCE_DIR "/diagnosis/campaigns/" + name + ".yaml");
}

class RealCampaigns : public ::testing::TestWithParam<const char*> {};

// Every experiment loads without an error, all of its samples finite.
TEST_P(RealCampaigns, LoadThroughTheirCampaignFiles) {
  if (std::getenv("GRAYBOX_RECORDINGS") == nullptr) {
    GTEST_SKIP()
        << "set GRAYBOX_RECORDINGS to the folder of the recordings (docs/how_to/recordings.md)";
  }
  const Campaign campaign = real_campaign(GetParam());
  for (std::size_t k = 0; k < campaign.experiments.size(); ++k) {
    const ExperimentRecording run = load_experiment(campaign, k);
    ASSERT_FALSE(run.data.pieces.empty());
    for (const SignalPiece& piece : run.data.pieces) {
      EXPECT_GT(piece.values.rows(), 50);
      EXPECT_EQ(piece.values.cols(), static_cast<Eigen::Index>(run.data.signals.size()));
      EXPECT_TRUE(piece.values.allFinite());
    }
  }
}
INSTANTIATE_TEST_SUITE_P(Sets, RealCampaigns,
                         ::testing::Values("emps", "tx40", "kr300", "kr300_axis_1", "kr300_axis_3",
                                           "friction_damper", "friction_damper_set_3",
                                           "cogging_motor", "silverbox", "tiago", "two_masses",
                                           "ur10e"),
                         [](const auto& test) { return std::string(test.param); });

struct DriveMotion {
  Eigen::MatrixXd regressors;  // acceleration, velocity, its sign, one
  Eigen::VectorXd force;
};

DriveMotion emps_motion(std::size_t experiment) {
  const ExperimentRecording run = load_experiment(real_campaign("emps"), experiment);
  const Eigen::MatrixXd& values = run.data.pieces.at(0).values;
  const Eigen::VectorXd velocity = values.col(run.index_of("velocity"));
  DriveMotion motion{Eigen::MatrixXd(values.rows(), 4), values.col(run.index_of("force"))};
  motion.regressors << values.col(run.index_of("acceleration")), velocity,
      velocity.array().sign().matrix(), Eigen::VectorXd::Ones(values.rows());
  return motion;
}

// Mass, viscous and Coulomb friction and offset of EMPS by least squares, as its authors publish
// them, hold on the second file too: wrong units, gains, time or filters would show.
TEST(RealRecordings, EmpsHasThePublishedMassAndFriction) {
  if (std::getenv("GRAYBOX_RECORDINGS") == nullptr) GTEST_SKIP() << "set GRAYBOX_RECORDINGS";
  const DriveMotion fit = emps_motion(0);
  const Eigen::Vector4d found = fit.regressors.householderQr().solve(fit.force);
  EXPECT_NEAR(found(0), 95.1089, 0.01 * 95.1089);    // kg
  EXPECT_NEAR(found(1), 203.5034, 0.02 * 203.5034);  // N s/m
  EXPECT_NEAR(found(2), 20.3935, 0.05 * 20.3935);    // N
  EXPECT_NEAR(found(3), -3.1648, 0.1 * 3.1648);      // N
  EXPECT_LT((fit.force - fit.regressors * found).norm() / fit.force.norm(), 0.05);
  const DriveMotion check = emps_motion(1);
  EXPECT_LT((check.force - check.regressors * found).norm() / check.force.norm(), 0.067);
}

// Motor and output encoders of the KR300 tell the same angle but for offset, play and compliance.
TEST(RealRecordings, Kr300EncodersAgree) {
  if (std::getenv("GRAYBOX_RECORDINGS") == nullptr) GTEST_SKIP() << "set GRAYBOX_RECORDINGS";
  const ExperimentRecording run = load_experiment(real_campaign("kr300"), 0);
  const Eigen::MatrixXd& values = run.data.pieces.at(0).values;
  for (const char* axis : {"1", "2", "3"}) {
    Eigen::VectorXd motor = values.col(run.index_of(std::string("q_") + axis));
    Eigen::VectorXd arm = values.col(run.index_of(std::string("secondary_") + axis));
    motor.array() -= motor.mean();
    arm.array() -= arm.mean();
    EXPECT_NEAR(motor.dot(arm) / motor.squaredNorm(), 1.0, 0.01) << axis;
    EXPECT_LT((arm - motor).norm() / motor.norm(), 0.02) << axis;
  }
}

}  // namespace
}  // namespace graybox
