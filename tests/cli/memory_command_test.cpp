// Sets larger than the memory that is there stay in their file, or are refused in one line with the
// file, the need and the remedy. Never killed, never waiting, nothing written.
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/support/command_runner.hpp"

namespace graybox {
namespace {

using testing::Outcome;

// Kilobytes: less than the set below has, more than the program takes.
const std::string kAddresses = "ulimit -v 350000 &&";

class MemoryLimits : public testing::CommandRunner {
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

TEST_F(MemoryLimits, ALimitOfAddressesRefusesWithTheFileAndTheNeed) {
  for (const char* command : {"solve set.h5 -o x.json", "exact set.h5 --experiments 20",
                              "problem convert set.h5 -o x.npy", "study --quick --sets set.h5"}) {
    expect_line(graybox(command, kAddresses), 2, "set.h5: needs 2.9e+08 bytes of memory");
  }
}

// Under a limit of data that the set's numbers don't fit in, they stay in their file. OpenBLAS asks
// without end for buffers that such a limit refuses: `timeout` ends a command that waits for it.
std::string under_data_limit(int kilobytes) {
  return "ulimit -d " + std::to_string(kilobytes) + " && timeout -k 1 100";
}

TEST_F(MemoryLimits, ALimitOfDataLeavesTheNumbersInTheirFile) {
  ASSERT_EQ(graybox("solve set.h5 --gap 1e-6 -o plenty.json").exit_code, 0);
  const Outcome plenty = graybox("check set.h5 plenty.json --json");
  ASSERT_EQ(plenty.exit_code, 0) << plenty.err;
  const Outcome limited = graybox("check set.h5 plenty.json --json", under_data_limit(120000));
  EXPECT_EQ(limited.exit_code, 0) << limited.err;
  const auto number = [](const Outcome& outcome, const char* key) {
    return nlohmann::json::parse(outcome.out).at(key).get<double>();
  };
  EXPECT_EQ(number(limited, "duality_gap"), number(plenty, "duality_gap"));
  EXPECT_EQ(number(limited, "log_det"), number(plenty, "log_det"));
  const Outcome solved = graybox("solve set.h5 --gap 1e-6 -o x.json", under_data_limit(200000));
  EXPECT_EQ(solved.exit_code, 0) << solved.err;
}

TEST_F(MemoryLimits, NoLimitOfDataLeavesACommandWaiting) {
  ASSERT_EQ(graybox("solve set.h5 --gap 1e-6 -o x.json").exit_code, 0);
  for (const int kilobytes : {20000, 80000, 120000, 250000}) {
    const std::string before = under_data_limit(kilobytes);
    EXPECT_EQ(graybox("--version", before).exit_code, 0) << kilobytes;
    for (const char* command : {"check set.h5 x.json", "solve set.h5 --gap 1e-6"}) {
      const Outcome outcome = graybox(command, before);
      if (outcome.exit_code == 0) continue;
      EXPECT_TRUE(outcome.exit_code == 1 || outcome.exit_code == 2)
          << command << ", " << kilobytes << ": " << outcome.exit_code << ' ' << outcome.err;
      EXPECT_NE(outcome.err.find("memory"), std::string::npos) << outcome.err;
      EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
      EXPECT_EQ(outcome.out, "") << command << ", " << kilobytes;
    }
  }
}

TEST_F(MemoryLimits, ASolverThatCallsBlasIsRefusedWhereItsBufferFindsNoRoom) {
  const std::string random = "problem random --family r1g --candidates 40 --dimension 3 ";
  ASSERT_EQ(graybox(random + "-o small.h5").exit_code, 0);
  for (const std::string solver : {"dual_interior_point", "primal_interior_point"}) {
    const std::string solve = "solve small.h5 --solver " + solver;
    expect_line(graybox(solve, under_data_limit(100000)), 2, "BLAS");
    const Outcome roomy = graybox(solve, under_data_limit(300000));
    EXPECT_EQ(roomy.exit_code, 0) << roomy.err;
  }
  EXPECT_EQ(graybox("solve small.h5", under_data_limit(100000)).exit_code, 0);
}

}  // namespace
}  // namespace graybox
