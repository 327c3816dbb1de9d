// What the process that reads an HDF5 or MAT file (reading_process.hpp) hands over of an
// information set. Numbers that lie in the file in one piece, as float64, are left there: the
// parent reads them straight into the set's own array, so that a large set costs no copy.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "problems/base/aligned_array.hpp"
#include "problems/files/reading_process.hpp"
#include "problems/information/information_set.hpp"

namespace graybox {

struct StoredNumbers {
  std::size_t count = 0;
  std::uint64_t offset = 0;  // in the file, if they are left there; 0: `values` holds them
  AlignedArray values;
};

struct StoredSet {
  std::size_t dimension = 0;
  std::size_t rank = 0;  // of factors; 0: `information` holds matrices
  StoredNumbers information;
  std::vector<std::string> names, units;  // of the candidates' coordinates
  StoredNumbers coordinates;
  std::vector<std::string> parameters;
  std::string sha256;  // as the file states it; empty if it doesn't
  std::string source;  // "file: field" of the information matrices, for messages
  std::size_t first = 0,
              total = 0;  // the candidates' place in the whole, where a part was asked for
};

// The child's end.
void send(StoredSet set, MessageWriter& answer);

// The parent's: starts the child and takes its answer, with all numbers in memory. Throws
// InputError, also for entries that are not finite.
[[nodiscard]] StoredSet receive_stored_set(const ReadingTask& task,
                                           const std::vector<std::string>& arguments);

[[nodiscard]] InformationSet information_set(const std::string& path, StoredSet stored);

}  // namespace graybox
