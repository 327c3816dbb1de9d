// The folder of a report, in which a command touches only what it has written itself: files that an
// earlier verdict.json lists under `files`. While a report is being written, the list stands in
// .graybox-report.json as well. A run that is killed can therefore be made again.
#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "problems/files/folder_lock.hpp"

namespace graybox {

class ReportFolder {
 public:
  // Made before the work, which may take minutes; where that ends without a report, folders that
  // are new go again. Throws InputError where another run is at work in the folder, or files of
  // these names are there that no earlier run lists.
  ReportFolder(const std::filesystem::path& folder, const std::vector<std::string>& names);
  ReportFolder(const ReportFolder&) = delete;
  ReportFolder& operator=(const ReportFolder&) = delete;
  ~ReportFolder();

  [[nodiscard]] std::string file(const std::string& name) const {
    return (folder_ / name).string();
  }

  // Puts these files (name: text) and verdict.json in the place of the earlier report, together or
  // not at all (files_together.hpp). The verdict lists all, and gets the list as `files`. Throws
  // InputError where one of them would replace a file that is not ours.
  void write(const std::map<std::string, std::string>& texts, nlohmann::ordered_json& verdict);

 private:
  void refuse_foreign(const std::vector<std::string>& names) const;

  std::filesystem::path folder_;
  std::vector<std::filesystem::path> made_;  // the innermost first
  std::optional<FolderLock> lock_;
  std::set<std::string> ours_;  // what earlier runs list
};

}  // namespace graybox
