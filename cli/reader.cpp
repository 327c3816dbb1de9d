// graybox_reader TASK FILE ...: reads one HDF5 or MAT file for the process that started it and
// sends what it holds to standard output (problems/files/reading_process.hpp). Not for
// users.
#include <unistd.h>

#include <array>
#include <cstdio>
#include <string>
#include <vector>

#include "diagnosis/recording_files/recording_formats.hpp"
#include "problems/formats/hdf5_file.hpp"
#include "problems/formats/mat_file.hpp"

int main(int argc, char** argv) {
  using graybox::ReadingTask;
  const std::array<const ReadingTask*, 4> tasks{&graybox::kReadHdf5, &graybox::kReadMat,
                                                &graybox::formats::kReadHdf5Recording,
                                                &graybox::formats::kReadMatRecording};
  const std::vector<std::string> words(argv + 1, argv + argc);
  for (const ReadingTask* task : tasks) {
    if (words.size() < 2 || words[0] != task->name || isatty(STDOUT_FILENO) != 0) continue;
    // libhdf5 can hang or crash on its way out of a damaged file; nothing is left to be done there.
    _exit(graybox::answer_reading(*task, {words.begin() + 1, words.end()}, STDOUT_FILENO));
  }
  std::fputs("graybox_reader reads files for graybox; it is not started by hand\n", stderr);
  return 2;
}
