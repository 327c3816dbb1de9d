// Runs the real binary in a folder of the test's own, for tests of what users see.
#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <string>

#include "tests/support/built_executable.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox::testing {

struct Outcome {
  int exit_code = -1;
  std::string out;
  std::string err;
};

// The test's CMake target must depend on the command: graybox_command_test() does.
class CommandRunner : public ::testing::Test {
 protected:
  // Runs `graybox arguments` in the test's folder; `before` may hold a wrapping command.
  Outcome graybox(const std::string& arguments, const std::string& before = {}) {
    const std::string command = "cd '" + folder_.file("") + "' && " + before + " '" +
                                built_executable("bin/graybox") + "' " + arguments + " >'" +
                                logs_.file("out") + "' 2>'" + logs_.file("err") + "'";
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_text(logs_.file("out")),
            read_text(logs_.file("err"))};
  }

  // Exit code 2, nothing on stdout, one line on stderr that contains the text, no new file.
  void expect_refused(const std::string& arguments, const std::string& text) {
    const std::size_t files = folder_.file_count();
    const Outcome outcome = graybox(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << arguments;
    EXPECT_EQ(outcome.out, "") << arguments;
    EXPECT_EQ(outcome.err.find("graybox: "), 0U) << arguments << ": " << outcome.err;
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << arguments << ": " << outcome.err;
    EXPECT_NE(outcome.err.find(text), std::string::npos) << arguments << ": " << outcome.err;
    EXPECT_EQ(folder_.file_count(), files) << arguments;
  }

  TemporaryFolder folder_;  // where commands run
  TemporaryFolder logs_;
};

}  // namespace graybox::testing
