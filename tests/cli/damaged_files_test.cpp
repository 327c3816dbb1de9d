// Files that are damaged, absurd or half understood: every reader refuses them in one line with
// exit code 2, soon, without a crash and without the memory that they claim; and `graybox` as users
// get it.
#include <hdf5.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numeric>
#include <string>
#include <vector>

#include "diagnosis/recording_files/recording_file.hpp"
#include "diagnosis/recordings/signal_checks.hpp"
#include "problems/base/available_memory.hpp"
#include "problems/base/error.hpp"
#include "problems/files/reading_process.hpp"
#include "problems/formats/hdf5_file.hpp"
#include "problems/formats/information_set_file.hpp"
#include "tests/support/command_runner.hpp"
#include "tests/support/refusal.hpp"

namespace graybox {
namespace {

using testing::CommandRunner;
using testing::expect_refused;
using testing::Outcome;
using testing::read_text;
using testing::TemporaryFolder;
using testing::write_text;

const std::string kCorpus = std::string(GRAYBOX_SOURCE_DIR) + "/tests/fuzz/corpus/";

// Q = 3, d = 3, of full rank.
InformationSet small_set() {
  AlignedArray information(18);
  std::iota(information.begin(), information.end(), 1.0);
  for (std::size_t i = 0; i < 3; ++i) {
    for (const std::size_t diagonal : {0UL, 2UL, 5UL}) information[6 * i + diagonal] += 100.0;
  }
  return InformationSet(3, std::move(information));
}

class DamagedFiles : public CommandRunner {
 protected:
  // With a limit: what hangs fails.
  void expect_refused_soon(const std::string& arguments, const std::string& text) {
    const Outcome outcome = graybox(arguments, "timeout 60");
    EXPECT_EQ(outcome.exit_code, 2) << arguments << ": " << outcome.err;
    EXPECT_EQ(outcome.out, "") << arguments;
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << arguments << ": " << outcome.err;
    EXPECT_NE(outcome.err.find(text), std::string::npos) << arguments << ": " << outcome.err;
  }

  // The two sets of a drive's recordings, and the campaign.
  void copy_drive() {
    for (const char* name : {"campaign.yaml", "run_1.csv", "run_2.csv", "motor.yaml"}) {
      std::filesystem::copy(std::string(GRAYBOX_SOURCE_DIR) + "/docs/examples/fit/drive/" + name,
                            folder_.file(name));
    }
  }

  // Sets the last field of a line of run_1.csv (line 1 is the header).
  void set_last_field(std::size_t line, const std::string& field) {
    const std::string text = read_text(folder_.file("run_1.csv"));
    std::size_t begin = 0;
    for (std::size_t i = 1; i < line; ++i) begin = text.find('\n', begin) + 1;
    const std::size_t end = text.find('\n', begin);
    const std::size_t comma = text.rfind(',', end);
    ASSERT_GT(comma, begin);
    write_text(folder_.file("run_1.csv"), text.substr(0, comma + 1) + field + text.substr(end));
  }
};

// ---- HDF5 and MAT -------------------------------------------------------------------------------

// Finding C1. Two of these crash libhdf5 1.10, two send it into an endless loop, and one lets it
// print a page on its way out.
TEST_F(DamagedFiles, ThatCrashOrHangTheHdf5LibraryAreRefusedInOneLine) {
  for (const char* name : {"0213_s.h5", "0289_s.h5", "0385_s.h5", "0723_s.h5", "1301_s.h5"}) {
    expect_refused_soon("solve " + kCorpus + "set_hdf5/" + name, name);
  }
  write_text(folder_.file("campaign.yaml"),
             "format: graybox-campaign/1\nsample_time: 0.001\n"
             "channels: [{name: u, unit: A, is: input}]\nexperiments: [{file: " +
                 kCorpus + "recording_hdf5/0019_run_1.h5}]\n");
  expect_refused_soon("recordings .", "0019_run_1.h5");
}

// Finding C1. Where the reading program can't be started, a fork reads, and as much is refused.
void read_then_stop(const std::vector<std::string>&, MessageWriter& answer) {
  answer.whole(static_cast<std::uint64_t>(ReadingStatus::kRead));
  answer.text("half of it");
  std::abort();
}

TEST(ReadingProcess, ThatDiesHalfwayIsNoHalfAnswer) {
  const TemporaryFolder folder;
  write_text(folder.file("x"), "x");
  ReadingProcess child({.name = "unknown to the program", .run = &read_then_stop},
                       {folder.file("x")});
  EXPECT_EQ(child.text(), "half of it");
  expect_refused([&] { (void)child.whole(); }, folder.file("x") + ": damaged");
}

void refuse(const std::vector<std::string>& arguments, MessageWriter&) {
  throw InputError(arguments[0] + ": not this one");
}

TEST(ReadingProcess, HandsRefusalsOn) {
  const TemporaryFolder folder;
  write_text(folder.file("x"), "x");
  expect_refused(
      [&] {
        const ReadingProcess child({.name = "unknown to the program", .run = &refuse},
                                   {folder.file("x")});
      },
      folder.file("x") + ": not this one");
}

// The answer is the same whether the numbers are sent or left in the file.
TEST(ReadingProcess, ChunkedAndContiguousSetsAreTheSame) {
  const TemporaryFolder folder;
  const std::string plain = folder.file("plain.h5");
  const std::string chunked = folder.file("chunked.h5");
  write_information_set(plain, small_set());
  write_information_set(chunked, small_set());
  const hid_t file = H5Fopen(chunked.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  H5Ldelete(file, "information", H5P_DEFAULT);
  const std::array<hsize_t, 2> shape{3, 6};
  const std::array<hsize_t, 2> chunk{2, 6};
  const hid_t space = H5Screate_simple(2, shape.data(), nullptr);
  const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
  H5Pset_chunk(creation, 2, chunk.data());
  const hid_t dataset =
      H5Dcreate2(file, "information", H5T_IEEE_F64BE, space, H5P_DEFAULT, creation, H5P_DEFAULT);
  const InformationSet set = small_set();
  H5Dwrite(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, set.data());
  H5Dclose(dataset);
  H5Pclose(creation);
  H5Sclose(space);
  H5Fclose(file);
  EXPECT_EQ(read_information_set(chunked).content_hash(), set.content_hash());
  EXPECT_EQ(read_information_set(plain).content_hash(), set.content_hash());
  const InformationSlice slice = read_hdf5_slice(chunked, 1, 3);
  EXPECT_EQ(slice.first, 1U);
  EXPECT_EQ(slice.total, 3U);
  EXPECT_EQ(slice.set.information(0)[0], set.information(1)[0]);
}

// Finding C4.
TEST_F(DamagedFiles, OfMatlabWithAbsurdSizesAreBadInput) {
  std::filesystem::copy(kCorpus + "recording_mat/0161_run_73.mat", folder_.file("r.mat"));
  write_text(folder_.file("campaign.yaml"),
             "format: graybox-campaign/1\nsample_time: 0.001\n"
             "channels: [{name: u, unit: A, is: input}]\nexperiments: [{file: r.mat}]\n");
  expect_refused_soon("recordings .", "r.mat");
}

// Finding C5. No limit on memory is needed for it: nothing is taken.
TEST_F(DamagedFiles, ThatClaimMoreThanTheyStoreAreRefusedBeforeMemoryIsTaken) {
  const hid_t file =
      H5Fcreate(folder_.file("v.h5").c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  const std::array<hsize_t, 2> shape{hsize_t{1} << 34, 6};
  const std::array<hsize_t, 2> chunk{64, 6};
  const hid_t space = H5Screate_simple(2, shape.data(), nullptr);
  const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
  H5Pset_chunk(creation, 2, chunk.data());
  H5Dclose(
      H5Dcreate2(file, "information", H5T_IEEE_F64LE, space, H5P_DEFAULT, creation, H5P_DEFAULT));
  const hid_t text = H5Tcopy(H5T_C_S1);
  H5Tset_size(text, 25);
  const hid_t one = H5Screate(H5S_SCALAR);
  const hid_t format = H5Acreate2(file, "format", text, one, H5P_DEFAULT, H5P_DEFAULT);
  H5Awrite(format, text, "graybox-information-set/1");
  H5Aclose(format);
  H5Sclose(one);
  H5Tclose(text);
  H5Pclose(creation);
  H5Sclose(space);
  H5Fclose(file);
  expect_refused_soon("solve v.h5",
                      "v.h5: dataset information: truncated: shape [17179869184 x 6]");
}

TEST(Memory, ThatIsNotThereIsNamedWithWhatIsNeeded) {
  expect_refused([] { require_memory_for_numbers(2e11L, "set.h5: dataset information"); },
                 "set.h5: dataset information: needs 1.6e+12 bytes of memory, ");
  require_memory_for_numbers(1000.0L, "nothing of note");
}

// Found by the fuzzer: urdfdom takes joints that form a loop beside the root.
TEST_F(DamagedFiles, RobotsWhoseJointsFormALoopAreRefused) {
  const std::string robot = std::string(GRAYBOX_SOURCE_DIR) + "/problems/robot/three_axis";
  std::string model = read_text(robot + ".yaml");
  const std::string tip = "tip: flange";
  model.replace(model.find(tip), tip.size(), "tip: ring_b");
  write_text(folder_.file("robot.yaml"), model);
  std::string urdf = read_text(robot + ".urdf");
  const std::string ring =
      "<link name=\"ring_a\"/><link name=\"ring_b\"/>"
      "<joint name=\"a\" type=\"fixed\"><parent link=\"ring_a\"/><child link=\"ring_b\"/></joint>"
      "<joint name=\"b\" type=\"fixed\"><parent link=\"ring_b\"/><child link=\"ring_a\"/></joint>";
  urdf.insert(urdf.rfind("</robot>"), ring);
  write_text(folder_.file("three_axis.urdf"), urdf);
  expect_refused_soon("problem robot --model robot.yaml -o s.h5", "the joints form a loop");
}

// ---- links that lead nowhere --------------------------------------------------------------------

// Finding C3.
TEST_F(DamagedFiles, LoopsOfLinksAreBadInputForEveryReader) {
  const auto loop = [&](const char* name) {
    std::filesystem::create_symlink(name, folder_.file(name));
  };
  for (const char* name : {"l.yaml", "l.h5", "l.mat", "l.csv", "l.npy", "l.json"}) loop(name);
  const std::string examples = std::string(GRAYBOX_SOURCE_DIR) + "/docs/examples/";
  const std::string drive = examples + "simulate/drive.yaml";
  const std::string campaign = examples + "fit/drive/campaign.yaml";
  for (const std::string& arguments :
       {std::string("solve l.h5"), std::string("solve l.mat"), std::string("solve l.csv"),
        std::string("solve l.npy"), std::string("recordings l.yaml"), "fit l.yaml " + campaign,
        "fit " + drive + " l.yaml", "diagnose l.yaml " + campaign, std::string("responses l.yaml"),
        "simulate l.yaml " + examples + "simulate/drive_plan.yaml -o s",
        "simulate " + drive + " l.yaml -o s",
        std::string("problem robot --model l.yaml -o s.h5")}) {
    expect_refused_soon(arguments, "l.");
  }
  write_text(folder_.file("campaign.yaml"),
             "format: graybox-campaign/1\nsample_time: 0.001\n"
             "channels: [{name: u, unit: A, is: input}]\nexperiments: [{file: l.csv}]\n");
  expect_refused_soon("recordings .", "l.csv");
}

// ---- CSV ----------------------------------------------------------------------------------------

InformationSet read_table(const TemporaryFolder& folder, const std::string& text) {
  write_text(folder.file("set.csv"), text);
  return read_information_set(folder.file("set.csv"));
}

// Finding A5.
TEST(CsvHeader, WithANumberIsDataAndItsTypoAnError) {
  const TemporaryFolder folder;
  expect_refused([&] { (void)read_table(folder, "O.5,0,1\n1,0,1\n"); },
                 "set.csv: line 1, column 1: 'O.5' is no number");
  write_text(folder.file("run.csv"), "0,1,Z\n0.1,2,3\n");
  expect_refused([&] { (void)read_recording_file(folder.file("run.csv")); },
                 "run.csv: line 1, column '3': 'Z' is no number");
}

// Finding A5. Whatever the order of the columns, names H_i_j put each number where it belongs.
TEST(CsvHeader, OfEntriesDecidesTheirOrder) {
  const TemporaryFolder folder;
  const InformationSet set = small_set();
  const std::array<std::array<std::size_t, 2>, 6> entries{
      {{1, 1}, {2, 1}, {2, 2}, {3, 1}, {3, 2}, {3, 3}}};
  std::array<std::size_t, 6> order{0, 1, 2, 3, 4, 5};
  do {
    for (const bool upper : {false, true}) {
      std::string text;
      for (std::size_t k = 0; k < 6; ++k) {
        const auto& [row, column] = entries[order[k]];
        text += (k > 0 ? ",H_" : "H_") + std::to_string(upper ? column : row) + "_" +
                std::to_string(upper ? row : column);
      }
      for (std::size_t i = 0; i < set.candidate_count(); ++i) {
        for (std::size_t k = 0; k < 6; ++k) {
          text += (k > 0 ? "," : "\n") + std::to_string(set.information(i)[order[k]]);
        }
      }
      ASSERT_EQ(read_table(folder, text).content_hash(), set.content_hash()) << text;
    }
  } while (std::ranges::next_permutation(order).found && order[0] < 2);
}

// Finding A5.
TEST(CsvHeader, ThatContradictsItselfIsRefused) {
  const TemporaryFolder folder;
  const auto refused = [&](const std::string& header, const std::string& message) {
    expect_refused([&] { (void)read_table(folder, header + "\n2,1,2\n"); }, message);
  };
  refused("H_1_1,H_1_1,H_2_2", "H_1_1 is there twice");
  refused("H_1_1,H_2_1,H_1_2", "H_2_1 and H_1_2 are the same entry");
  refused("H_1_1,H_2_1,H_3_3", "H_3_3 is outside a matrix of 2 parameters");
  refused("H_0_0,H_1_0,H_1_1", "H_0_0 is outside");
  refused("H_1_1,weight,H_2_2", "'weight' is no entry H_i_j");
  refused("H_1_1,H_2_1,H_1_2,H_2_2", "4 columns are no packed size");
  refused("H_1_1", "1 columns are named, but a line has 3 numbers");
}

// ---- recordings ---------------------------------------------------------------------------------

// Finding C7.
TEST_F(DamagedFiles, OneWildSampleIsNamedWithFileChannelRowAndTime) {
  copy_drive();
  const Outcome before = graybox("recordings campaign.yaml");
  EXPECT_NE(before.out.find("0 warnings"), std::string::npos) << before.out;
  set_last_field(301, "30000");
  const Outcome outcome = graybox("recordings campaign.yaml");
  EXPECT_EQ(outcome.exit_code, 0);
  const std::size_t at = outcome.out.find("run_1.csv: speed: row 300 (");
  ASSERT_NE(at, std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("is 30000, alone between", at), std::string::npos) << outcome.out;
}

// Finding C7: the inertia was a thousandth of the true one, and nothing said so.
TEST_F(DamagedFiles, AFitIsNotSpoiltByOneWildSampleAndSaysWhatBecameOfIt) {
  copy_drive();
  const auto inertia = [](const Outcome& fit) {
    return nlohmann::json::parse(fit.out).at("parameters").at(0).at("value").get<double>();
  };
  const Outcome clean = graybox("fit motor.yaml campaign.yaml --json");
  EXPECT_EQ(clean.out.find("replaced"), std::string::npos) << clean.out;
  set_last_field(301, "30000");
  const Outcome wild = graybox("fit motor.yaml campaign.yaml --json");
  EXPECT_NEAR(inertia(wild), inertia(clean), 1e-3 * inertia(clean));
  const std::string said = "run_1.csv: speed: 1 spike was replaced by the line";
  EXPECT_NE(wild.out.find(said), std::string::npos) << wild.out;
  const Outcome predicted = graybox("predict motor.yaml campaign.yaml");
  EXPECT_NE(predicted.out.find("note: " + said), std::string::npos) << predicted.out;
}

// Finding C7.
TEST_F(DamagedFiles, ValuesWhoseSquaresOverflowAreErrorsWithFileAndChannel) {
  copy_drive();
  set_last_field(301, "1e308");
  for (const char* arguments : {"recordings campaign.yaml", "fit motor.yaml campaign.yaml"}) {
    const Outcome outcome = graybox(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << arguments;
    EXPECT_NE((outcome.out + outcome.err).find("run_1.csv: speed: sample 299 is 1e+308"),
              std::string::npos)
        << outcome.out << outcome.err;
  }
}

// Finding C7. A scale, an offset or the sign of a signal makes no difference.
TEST(WildSamples, AreFoundWhateverTheUnitAndOnlyThey) {
  Eigen::VectorXd signal(2000);
  for (Eigen::Index k = 0; k < signal.size(); ++k) {
    signal(k) =
        std::sin(0.05 * static_cast<double>(k)) + 0.1 * std::sin(2.1 * static_cast<double>(k));
  }
  for (const double scale : {1.0, -1.0, 1e-9, 1e9}) {
    for (const double offset : {0.0, 3.0}) {
      Eigen::VectorXd values = (scale * (signal.array() + offset)).matrix();
      EXPECT_TRUE(wild_samples(values).empty()) << scale;
      values(700) += 1000.0 * scale;
      values(1500) -= 50.0 * scale;
      EXPECT_EQ(wild_samples(values), (std::vector<Eigen::Index>{700, 1500})) << scale;
    }
  }
}

// A pulse of two samples is a pulse; so is a signal that is mostly at rest and then moves.
TEST(WildSamples, PulsesAndRestsAreNone) {
  Eigen::VectorXd pulse = Eigen::VectorXd::LinSpaced(500, 0.0, 1.0);
  pulse.segment(200, 2).array() += 1000.0;
  EXPECT_TRUE(wild_samples(pulse).empty());
  Eigen::VectorXd rest = Eigen::VectorXd::Zero(1000);
  for (Eigen::Index k = 800; k < 1000; ++k) rest(k) = std::sin(0.1 * static_cast<double>(k - 800));
  EXPECT_TRUE(wild_samples(rest).empty());
}

// Finding E8.
TEST(FileFormats, TheDocumentedScriptWritesASetThatIsRead) {
  if (std::system("/usr/bin/python3 -c 'import numpy, h5py' 2>/dev/null") != 0) {
    GTEST_SKIP() << "/usr/bin/python3 lacks numpy or h5py";
  }
  const std::string page =
      read_text(std::string(GRAYBOX_SOURCE_DIR) + "/docs/reference/formats.md");
  const std::size_t begin = page.find("```python\n") + 10;
  const std::size_t end = page.find("```", begin);
  ASSERT_LT(end, page.size());
  const TemporaryFolder folder;
  write_text(folder.file("write.py"), page.substr(begin, end - begin));
  ASSERT_EQ(std::system(("cd '" + folder.file("") + "' && /usr/bin/python3 write.py").c_str()), 0);
  const InformationSet set = read_information_set(folder.file("set.h5"));
  EXPECT_EQ(set.parameters().size(), set.dimension());
  EXPECT_EQ(set.candidates().units.size(), set.candidates().names.size());
  EXPECT_FALSE(set.candidates().names.empty());
  set.validate();
}

}  // namespace
}  // namespace graybox
