// Users read graybox's own words: nothing that the libraries say reaches standard error.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

namespace fs = std::filesystem;

class ChatterCommand : public testing::CommandRunner {
 protected:
  void copy_example(const std::string& name) {
    fs::copy(fs::path(GRAYBOX_SOURCE_DIR) / "docs" / "examples" / name, folder_.file(""));
  }

  // One line, and that is graybox's.
  static void expect_own_line(const testing::Outcome& outcome, const std::string& text) {
    EXPECT_EQ(outcome.err.find("graybox: "), 0U) << outcome.err;
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    EXPECT_NE(outcome.err.find(text), std::string::npos) << outcome.err;
  }
};

// Ceres tells glog of every step when it is asked to; a user's environment may ask.
TEST_F(ChatterCommand, CeresAndGlogAreSilent) {
  copy_example("fit/drive");
  for (const char* command : {"fit motor.yaml campaign.yaml", "fit none.yaml campaign.yaml"}) {
    const testing::Outcome outcome =
        graybox(command, "GLOG_v=9 GLOG_logtostderr=1 GLOG_minloglevel=0");
    if (outcome.exit_code == 2) {
      expect_own_line(outcome, "none.yaml");
    } else {
      EXPECT_EQ(outcome.exit_code, 0);
      EXPECT_EQ(outcome.err, "");
    }
  }
}

// Its error stack has forty lines where a write fails.
TEST_F(ChatterCommand, Hdf5IsSilent) {
  const std::string make = "problem random --family wis --candidates 3000 --dimension 12 -o ";
  ASSERT_EQ(graybox(make + "set.h5").exit_code, 0);
  const auto size = fs::file_size(folder_.file("set.h5"));
  fs::copy_file(folder_.file("set.h5"), folder_.file("cut.h5"));
  fs::resize_file(folder_.file("cut.h5"), size / 2);
  expect_own_line(graybox("solve cut.h5"), "cut.h5");
  testing::write_text(folder_.file("text.h5"), "no HDF5 at all\n");
  expect_own_line(graybox("solve text.h5"), "text.h5");
  fs::create_symlink("/dev/full", folder_.file("full.h5"));
  expect_own_line(graybox(make + "full.h5"), "full.h5");
  expect_own_line(graybox(make + "large.h5", "ulimit -f 100 &&"), "large.h5");
}

}  // namespace
}  // namespace graybox
