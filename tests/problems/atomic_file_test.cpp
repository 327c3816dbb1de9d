// Files appear complete or not at all, under the name that was meant, and stay.
#include "problems/files/atomic_file.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/families/families.hpp"
#include "problems/files/files_together.hpp"
#include "problems/files/folder_lock.hpp"
#include "problems/files/temporary_name.hpp"
#include "problems/formats/information_set_file.hpp"
#include "tests/support/refusal.hpp"
#include "tests/support/temporary_folder.hpp"

namespace {

// What the code under test asks of the system, in its order: these stand before the C library's.
std::vector<std::string>& calls() {
  static std::vector<std::string> list;
  return list;
}

}  // namespace

extern "C" int fsync(int descriptor) {
  struct stat status {};
  fstat(descriptor, &status);
  calls().emplace_back(S_ISDIR(status.st_mode) ? "sync folder" : "sync file");
  return static_cast<int>(syscall(SYS_fsync, descriptor));
}

extern "C" int rename(const char* from, const char* to) {
  calls().emplace_back("rename");
  return static_cast<int>(syscall(SYS_renameat2, AT_FDCWD, from, AT_FDCWD, to, 0));
}

namespace graybox {
namespace {

namespace fs = std::filesystem;
using testing::expect_refused;
using testing::read_text;
using testing::write_text;

class AtomicFileTest : public ::testing::Test {
 protected:
  [[nodiscard]] std::string file(const std::string& name) const { return folder_.file(name); }
  testing::TemporaryFolder folder_;
};

pid_t process_that_is_gone() {
  const pid_t child = fork();
  if (child == 0) _exit(0);
  waitpid(child, nullptr, 0);
  return child;
}

std::string temporary_of(pid_t process, const std::string& name) {
  return "." + name + ".graybox-" + std::to_string(process) + "-Ab12Cd.tmp";
}

// Finding A2.
TEST_F(AtomicFileTest, WritesWhatALinkNamesAndKeepsTheLink) {
  fs::create_directory(file("elsewhere"));
  write_text(file("elsewhere/target"), "old");
  fs::create_symlink("elsewhere/target", file("link"));
  fs::create_symlink("link", file("link_to_link"));
  write_text_file(file("link_to_link"), "new");
  EXPECT_TRUE(fs::is_symlink(file("link")));
  EXPECT_TRUE(fs::is_symlink(file("link_to_link")));
  EXPECT_EQ(read_text(file("elsewhere/target")), "new");
  EXPECT_EQ(folder_.file_count(), 3U);
}

// Finding A2.
TEST_F(AtomicFileTest, MakesTheFileThatADanglingLinkNames) {
  fs::create_symlink("not_yet", file("link"));
  write_text_file(file("link"), "new");
  EXPECT_TRUE(fs::is_symlink(file("link")));
  EXPECT_EQ(read_text(file("not_yet")), "new");
}

// Finding A2: what is no regular file stays what it is and gets the bytes.
TEST_F(AtomicFileTest, WritesThroughAPipe) {
  ASSERT_EQ(mkfifo(file("pipe").c_str(), 0600), 0);
  std::string read;
  std::thread reader([&] { read = read_text(file("pipe")); });
  const std::string text(100000, 'x');
  write_text_file(file("pipe"), text);
  reader.join();
  EXPECT_EQ(read, text);
  EXPECT_TRUE(fs::is_fifo(file("pipe")));
}

// Finding A2.
TEST_F(AtomicFileTest, RefusesADeviceThatIsFull) {
  expect_refused([] { write_text_file("/dev/full", "text"); }, "/dev/full: can't be written");
  EXPECT_TRUE(fs::is_character_file("/dev/full"));
}

TEST_F(AtomicFileTest, KeepsThePermissionsOfAFileThatItReplaces) {
  write_text(file("private"), "old");
  fs::permissions(file("private"), fs::perms::owner_read | fs::perms::owner_write);
  write_text_file(file("private"), "new");
  EXPECT_EQ(fs::status(file("private")).permissions(),
            fs::perms::owner_read | fs::perms::owner_write);
}

TEST_F(AtomicFileTest, LeavesTheOldFileWhereWritingIsGivenUp) {
  write_text(file("result"), "old");
  {
    const AtomicFile given_up(file("result"));
    write_text(given_up.temporary(), "half");
  }
  EXPECT_EQ(read_text(file("result")), "old");
  EXPECT_EQ(folder_.file_count(), 1U);
}

// Files that belong together: all or none, and what goes to a device goes at once.
TEST_F(AtomicFileTest, FilesTogetherAppearTogetherOrNotAtAll) {
  write_text(file("first"), "old");
  {
    FilesTogether files;
    write_text_file(file("first"), "new");
    write_text_file(file("second"), "new");
    EXPECT_EQ(read_text(file("first")), "old");
    EXPECT_FALSE(fs::exists(file("second")));
    EXPECT_THROW(write_text_file("/dev/full", "new"), InputError);
  }
  EXPECT_EQ(read_text(file("first")), "old");
  EXPECT_EQ(folder_.file_count(), 1U);
  {
    FilesTogether files;
    write_text_file(file("first"), "new");
    write_text_file(file("second"), "newer");
    files.commit();
    EXPECT_EQ(read_text(file("first")), "new");
    EXPECT_EQ(read_text(file("second")), "newer");
  }
  EXPECT_EQ(folder_.file_count(), 2U);
  write_text_file(file("third"), "alone");  // as ever
  EXPECT_EQ(read_text(file("third")), "alone");
}

// Finding D3: a power cut finds the old file or the new one, and the folder knows of it.
TEST_F(AtomicFileTest, SyncsTheFileThenRenamesThenSyncsTheFolder) {
  calls().clear();
  write_text_file(file("result"), "text");
  EXPECT_EQ(calls(), (std::vector<std::string>{"sync file", "rename", "sync folder"}));
}

// Finding D2.
TEST_F(AtomicFileTest, RemovesWhatKilledRunsLeft) {
  const std::string left = temporary_of(process_that_is_gone(), "set.h5");
  const std::string of_a_running_one = temporary_of(getppid(), "set.h5");
  // In a container the next run often has the number of the killed one.
  const std::string of_our_number = temporary_of(getpid(), "other.json");
  for (const std::string& name : {left, of_a_running_one, of_our_number}) {
    write_text(file(name), "half");
  }
  const auto before_we_started = fs::file_time_type::clock::now() - std::chrono::hours(1);
  fs::last_write_time(file(of_our_number), before_we_started);
  const AtomicFile our_own(file("own"));
  write_text(file(".mine.tmp"), "the user's");
  write_text_file(file("result"), "text");
  EXPECT_FALSE(fs::exists(file(left)));
  EXPECT_FALSE(fs::exists(file(of_our_number)));
  EXPECT_TRUE(fs::exists(file(of_a_running_one)));
  EXPECT_TRUE(fs::exists(our_own.temporary()));
  EXPECT_TRUE(fs::exists(file(".mine.tmp")));
}

// Finding D2: temporary files don't look like results.
TEST_F(AtomicFileTest, HidesFilesInTheMaking) {
  const AtomicFile making(file("set.h5"));
  const std::string name = fs::path(making.temporary()).filename().string();
  EXPECT_TRUE(is_temporary_name(name)) << name;
  EXPECT_TRUE(name.starts_with(".set.h5.")) << name;
  for (const char* other : {"set.h5", ".set.h5", "set.h5.Ab12Cd", ".a.graybox-1-Ab12C.tmp",
                            ".a.graybox-x-Ab12Cd.tmp", "a.graybox-1-Ab12Cd.tmp"}) {
    EXPECT_FALSE(is_temporary_name(other)) << other;
  }
}

TEST_F(AtomicFileTest, WritesNamesAsLongAsTheSystemTakes) {
  const std::string name(250, 'n');
  write_text_file(file(name), "text");
  EXPECT_EQ(read_text(file(name)), "text");
}

// Finding D6.
TEST_F(AtomicFileTest, LetsOneRunAtATimeIntoAFolder) {
  {
    const FolderLock first(file("results"));
    expect_refused([&] { const FolderLock second(file("results")); },
                   "another graybox command is writing into this folder");
  }
  const FolderLock next(file("results"));
}

herr_t require_no_time(hid_t root, const char* name, const H5O_info_t* object, void* count) {
  EXPECT_EQ(object->mtime, 0) << name;
  EXPECT_EQ(object->ctime, 0) << name;
  ++*static_cast<int*>(count);
  return root < 0 ? -1 : 0;
}

// Finding D5.
TEST_F(AtomicFileTest, WritesEqualSetsAsEqualBytes) {
  const InformationSet set = make_family("rob", 20, 4, 1);
  for (const std::string ending : {"h5", "mat", "npy", "csv"}) {
    write_information_set(file("first." + ending), set);
    write_information_set(file("second." + ending), set);
    EXPECT_EQ(read_text(file("first." + ending)), read_text(file("second." + ending))) << ending;
  }
  // Also a second later: no object has a time.
  const hid_t opened = H5Fopen(file("first.h5").c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  int objects = 0;
  H5Ovisit(opened, H5_INDEX_NAME, H5_ITER_NATIVE, require_no_time, &objects);
  H5Fclose(opened);
  EXPECT_GE(objects, 2);
  // The text of a MAT file's header, 116 bytes, has none either.
  EXPECT_EQ(read_text(file("first.mat")).substr(0, 116).find(':'), std::string::npos);
}

}  // namespace
}  // namespace graybox
