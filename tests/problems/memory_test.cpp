// What memory is there, and numbers that stay in their file.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <limits>
#include <string>

#include "problems/base/aligned_array.hpp"
#include "problems/base/available_memory.hpp"
#include "problems/base/control_group.hpp"
#include "problems/base/mapped_numbers.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using testing::TemporaryFolder;
using testing::write_text;

class ControlGroups : public ::testing::Test {
 protected:
  void group(const std::string& path, const std::string& limit, const std::string& used,
             const std::string& cached) {
    const std::string at = folder_.file(path);
    std::filesystem::create_directories(at);
    const bool first = path.starts_with("memory");
    write_text(at + (first ? "/memory.limit_in_bytes" : "/memory.max"), limit + "\n");
    write_text(at + (first ? "/memory.usage_in_bytes" : "/memory.current"), used + "\n");
    write_text(at + "/memory.stat", first ? "inactive_file 1\ntotal_inactive_file " + cached + "\n"
                                          : "anon 5\ninactive_file " + cached + "\nfile 7\n");
  }
  std::size_t room(const std::string& membership) {
    write_text(folder_.file("groups"), membership);
    return control_group_room(folder_.file(""), folder_.file("groups"));
  }

  TemporaryFolder folder_;
};

TEST_F(ControlGroups, TheLeastOfAllLevelsCounts) {
  EXPECT_EQ(room("0::/\n"), std::numeric_limits<std::size_t>::max());
  group("batch/job", "max", "900", "0");
  EXPECT_EQ(room("0::/batch/job\n"), std::numeric_limits<std::size_t>::max());
  group("batch", "5000", "1000", "0");
  EXPECT_EQ(room("0::/batch/job\n"), 4000U);
  group("batch/job", "3000", "900", "0");
  EXPECT_EQ(room("0::/batch/job\n"), 2100U);
  EXPECT_EQ(room("0::/elsewhere\n"), std::numeric_limits<std::size_t>::max());
}

TEST_F(ControlGroups, FilesThatCanBeDroppedAreRoom) {
  group("job", "5000", "4500", "3000");
  EXPECT_EQ(room("0::/job\n"), 3500U);
}

TEST_F(ControlGroups, OfTheFirstVersionAndInContainers) {
  group("memory/job", "5000", "4500", "300");
  EXPECT_EQ(room("9:name=systemd:/\n4:memory:/job\n3:cpuset:/\n"), 800U);
  EXPECT_EQ(room("4:memorial:/job\n"), std::numeric_limits<std::size_t>::max());
  group("memory", "1000", "900", "0");  // the path is that of the host
  EXPECT_EQ(room("4:memory:/docker/0123\n"), 100U);
  group("memory", "1000", "1100", "0");
  EXPECT_EQ(room("4:memory:/docker/0123\n"), 0U);
}

TEST(Memory, AnArrayBeyondWhatIsThereSaysWhatItNeeds) {
  std::string line;
  try {
    const AlignedArray array(std::size_t{1} << 45);
  } catch (const std::bad_alloc& error) {
    line = describe_shortage(error);
  }
  EXPECT_NE(line.find("2.8e+05 GB of memory are needed in one piece"), std::string::npos) << line;
}

TEST(Memory, NumbersStayInTheirFile) {
  const TemporaryFolder folder;
  const std::string path = folder.file("numbers");
  std::string bytes(192 + 3 * sizeof(double), '\0');
  const double values[3] = {1.5, -2.0, 7.0};
  bytes.replace(192, sizeof values, reinterpret_cast<const char*>(values), sizeof values);
  write_text(path, bytes);
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  ASSERT_GE(file, 0);
  EXPECT_FALSE(map_numbers(file, 8, 3).has_value());  // not on a cache line
  auto mapped = map_numbers(file, 192, 3);
  close(file);
  ASSERT_TRUE(mapped.has_value());
  const double* where = mapped->data();
  AlignedArray copy = *mapped;
  const AlignedArray moved = *std::move(mapped);
  mapped.reset();
  EXPECT_EQ(moved.data(), where);
  EXPECT_EQ(moved[0], 1.5);
  EXPECT_EQ(moved[2], 7.0);
  copy[1] = 4.0;  // memory of its own
  EXPECT_EQ(moved[1], -2.0);
}

}  // namespace
}  // namespace graybox
