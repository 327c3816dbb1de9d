#include "cli/arguments/machine_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <string_view>

#include "problems/base/error.hpp"

namespace graybox::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 9> kLogs{".csv",   ".tsv", ".txt", ".log", ".json",
                                                ".jsonl", ".mat", ".npy", ".gz"};

// Files of graybox name their format at their head, whatever they are called.
bool names_format(const std::string& file) {
  constexpr std::size_t kHead = 2000;
  std::ifstream stream(file, std::ios::binary);
  std::string head(kHead, '\0');
  stream.read(head.data(), static_cast<std::streamsize>(kHead));
  return head.find("graybox-") != std::string::npos;
}

bool is_log(const std::string& file) {
  const bool is_called_log =
      std::ranges::find(kLogs, fs::path(file).extension().string()) != kLogs.end();
  return is_called_log && !names_format(file);
}

[[noreturn]] void refuse_log(const std::string& command, const std::string& file,
                             const char* wanted) {
  throw InputError(
      fmt::format("{} is a log, not a {}: `graybox model --one-mass {} -o machine` (or "
                  "--two-masses, or a URDF) proposes a model and a campaign; then "
                  "`graybox {} machine`",
                  file, wanted, file, command));
}

[[noreturn]] void refuse_urdf(const std::string& command, const std::string& file,
                              const std::string& log) {
  throw InputError(
      fmt::format("{} is a URDF, not a model: `graybox model {} {} -o machine` proposes a model "
                  "and a campaign; then `graybox {} machine`",
                  file, file, is_log(log) ? log : "LOG.csv", command));
}

}  // namespace

void add_machine_files(CLI::App& command, std::string& model, std::string& campaign,
                       const std::string& model_words) {
  command
      .add_option("model", model,
                  model_words + ", or the folder that `graybox model` wrote, for both")
      ->required();
  command.add_option("campaign", campaign,
                     "graybox-campaign/1 file (YAML), or the folder of a campaign.yaml");
}

void find_machine_files(const std::string& command, std::string& model, std::string& campaign) {
  if (is_log(model)) refuse_log(command, model, "model");
  if (fs::path(model).extension() == ".urdf") refuse_urdf(command, model, campaign);
  if (is_log(campaign)) refuse_log(command, campaign, "campaign");
  std::error_code trouble;
  if (fs::is_directory(model, trouble)) {
    const fs::path folder = model;
    model = (folder / "model.yaml").string();
    if (campaign.empty()) campaign = (folder / "campaign.yaml").string();
  }
  if (campaign.empty()) {
    throw InputError(fmt::format(
        "campaign: missing: say `graybox {} {} CAMPAIGN`, a graybox-campaign/1 file or its folder",
        command, model));
  }
}

}  // namespace graybox::cli
