#include "diagnosis/runs/report_folder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <string_view>

#include "problems/base/error.hpp"
#include "problems/base/program_version.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/files_together.hpp"

namespace graybox {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kVerdict = "verdict.json";
constexpr const char* kList = ".graybox-report.json";  // there while a report is being written

// A damaged list could lead out of the folder.
bool stays_inside(const fs::path& name) {
  if (name.empty() || name.is_absolute()) return false;
  for (const fs::path& part : name) {
    if (part == "..") return false;
  }
  return true;
}

void add_listed(const fs::path& file, std::string_view format, std::set<std::string>& names) {
  std::ifstream stream(file);
  const Json json = Json::parse(stream, nullptr, false);
  if (!json.is_object() || json.value("format", "") != format) return;
  const auto list = json.find("files");
  if (list == json.end() || !list->is_array()) return;
  for (const Json& name : *list) {
    if (name.is_string() && stays_inside(name.get<std::string>())) names.insert(name);
  }
}

// The folders that are missing on the way to `folder`, the innermost first.
std::vector<fs::path> missing_folders(const fs::path& folder) {
  std::vector<fs::path> missing;
  std::error_code error;
  for (auto made = folder; !made.empty() && !fs::exists(made, error); made = made.parent_path()) {
    if (made.has_filename()) missing.push_back(made);
  }
  return missing;
}

}  // namespace

ReportFolder::ReportFolder(const fs::path& folder, const std::vector<std::string>& names)
    : folder_(folder), made_(missing_folders(folder / "figures")) {
  try {
    lock_.emplace(folder);
    add_listed(folder / kVerdict, "graybox-verdict/1", ours_);
    add_listed(folder / kList, "graybox-report/1", ours_);
    refuse_foreign(names);
    std::error_code error;
    fs::create_directories(folder / "figures", error);
    if (error) {
      throw InputError(fmt::format("{}: can't be made: {}", file("figures"), error.message()));
    }
  } catch (...) {
    std::error_code ignored;
    for (const fs::path& made : made_) fs::remove(made, ignored);
    throw;
  }
}

ReportFolder::~ReportFolder() {
  std::error_code ignored;  // not empty: it stays
  for (const fs::path& made : made_) fs::remove(made, ignored);
}

void ReportFolder::refuse_foreign(const std::vector<std::string>& names) const {
  std::error_code ignored;
  for (const std::string& name : names) {
    if (ours_.contains(name) || !fs::exists(fs::symlink_status(folder_ / name, ignored))) continue;
    throw InputError(fmt::format(
        "{}: holds {}, which no earlier report here lists; choose another folder, or move it away",
        folder_.string(), name));
  }
}

void ReportFolder::write(const std::map<std::string, std::string>& texts, Json& verdict) {
  std::vector<std::string> names;
  for (const auto& [name, text] : texts) names.push_back(name);
  names.emplace_back(kVerdict);
  refuse_foreign(names);
  ours_.insert(names.begin(), names.end());
  const Json list{{"format", "graybox-report/1"}, {"written_by", written_by()}, {"files", ours_}};
  verdict["files"] = names;
  FilesTogether files;  // in this order: the list is there before the first file, the verdict last
  write_text_file(file(kList), list.dump(2) + "\n");
  for (const auto& [name, text] : texts) write_text_file(file(name), text);
  write_text_file(file(kVerdict), verdict.dump(2) + "\n");
  files.commit();
  std::error_code ignored;
  for (const std::string& name : ours_) {
    if (std::ranges::find(names, name) == names.end()) fs::remove(folder_ / name, ignored);
  }
  fs::remove(folder_ / kList);
}

}  // namespace graybox
