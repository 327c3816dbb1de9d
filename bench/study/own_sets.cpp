#include "bench/study/own_sets.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <system_error>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/formats/information_set_file.hpp"
#include "problems/information/semidefinite_projection.hpp"

namespace graybox::bench {
namespace {

namespace fs = std::filesystem;

// .txt stays out: a folder of problems is likely to hold a readme.txt.
constexpr std::array kEndings{".h5", ".hdf5", ".npy", ".csv", ".mat"};

bool is_instance(const fs::directory_entry& entry) {
  const std::string ending = entry.path().extension().string();
  return entry.is_regular_file() && std::ranges::find(kEndings, ending) != kEndings.end();
}

}  // namespace

std::vector<std::string> instances_in(const fs::path& folder) {
  std::error_code error;
  fs::directory_iterator entries(folder, error);
  if (error) {
    throw InputError(
        fmt::format("{}: can't be read as a folder of sets: {}", folder.string(), error.message()));
  }
  std::vector<std::string> files;
  for (const fs::directory_entry& entry : entries) {
    if (is_instance(entry)) files.push_back(entry.path().string());
  }
  if (files.empty()) {
    throw InputError(
        fmt::format("{}: holds no information set; expected files .h5, .npy, .csv or "
                    ".mat",
                    folder.string()));
  }
  std::ranges::sort(files);
  return files;
}

OwnSet read_own_set(const std::string& path) {
  InformationSet set = project_semidefinite(read_information_set(path)).set;
  std::string hash = set.content_hash();
  return {path, fs::absolute(path).lexically_normal().string(), std::move(set), std::move(hash)};
}

std::vector<OwnSet> read_own_sets(const std::vector<std::string>& paths) {
  std::vector<OwnSet> sets;
  std::map<std::string, std::string> owners;  // of a hash
  for (const std::string& path : paths) {
    OwnSet own = read_own_set(path);
    const auto [owner, is_new] = owners.try_emplace(own.hash, path);
    if (!is_new) {
      throw InputError(owner->second == path
                           ? fmt::format("{}: is given twice; leave one out", path)
                           : fmt::format("{}: holds the same set as {}; leave one of them out",
                                         path, owner->second));
    }
    sets.push_back(std::move(own));
  }
  return sets;
}

}  // namespace graybox::bench
