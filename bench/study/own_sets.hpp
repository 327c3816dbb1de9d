// Information sets that the user brings to the study: read, checked and told apart before anything
// runs.
//
//   const auto files = instances_in("my_problems");     // every .h5, .hdf5, .npy, .csv and .mat
//   const std::vector<OwnSet> sets = read_own_sets(files);
//
// A set is the file's after project_semidefinite(), as every command reads it; its hash is that of
// what is solved. In rows and tables it goes by the path as it was given.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "problems/information/information_set.hpp"

namespace graybox::bench {

struct OwnSet {
  std::string path;      // as given: the set's name
  std::string absolute;  // where `graybox study verify` looks for it
  InformationSet set;
  std::string hash;
};

// The files of a folder that an ending marks as information sets, by name. Folders in it and other
// files are passed over. Throws InputError if it is no folder, or holds none.
[[nodiscard]] std::vector<std::string> instances_in(const std::filesystem::path& folder);

// One set as the study takes it. Throws InputError as project_semidefinite() does.
[[nodiscard]] OwnSet read_own_set(const std::string& path);

// All of them. Throws InputError, naming the file, for one that can't be read or is no problem, and
// for two of the same content (another path, another format). Cost: one pass of validation and of
// SHA-256 over each set, all of which stay in memory.
[[nodiscard]] std::vector<OwnSet> read_own_sets(const std::vector<std::string>& paths);

}  // namespace graybox::bench
