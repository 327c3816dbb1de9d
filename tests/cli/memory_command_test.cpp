// Sets larger than the memory that is there are refused in one line with the file, the need and the
// remedy. Never killed, nothing written.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

using testing::Outcome;

// Kilobytes: less than the set below has, more than the program takes.
const std::string kAddresses = "ulimit -v 350000 &&";

class Memory : public testing::CommandRunner {
 protected:
  void SetUp() override {
#ifdef GRAYBOX_SANITIZED
    GTEST_SKIP() << "the address sanitizer takes all addresses for itself";
#endif
    const std::string random = "problem random --family r1g --candidates 3000000 --dimension 12 ";
    ASSERT_EQ(graybox(random + "--factors -o set.h5").exit_code, 0);  // 288 MB
  }
  void expect_line(const Outcome& outcome, int exit_code, const std::string& text) {
    EXPECT_EQ(outcome.exit_code, exit_code) << outcome.err;
    EXPECT_NE(outcome.err.find(text), std::string::npos) << outcome.err;
    EXPECT_NE(outcome.err.find("with more"), std::string::npos) << outcome.err;
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    EXPECT_EQ(outcome.out, "");
  }
};

TEST_F(Memory, ALimitOfAddressesRefusesWithTheFileAndTheNeed) {
  for (const char* command : {"solve set.h5 -o x.json", "exact set.h5 --experiments 20",
                              "problem convert set.h5 -o x.npy", "study --quick --sets set.h5"}) {
    expect_line(graybox(command, kAddresses), 2, "set.h5: needs 2.9e+08 bytes of memory");
  }
}

}  // namespace
}  // namespace graybox
