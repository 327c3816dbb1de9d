#include "cli/arguments/machine_files.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "problems/base/error.hpp"
#include "problems/files/yaml_field.hpp"

namespace graybox::cli {

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
  std::error_code trouble;
  if (std::filesystem::is_directory(model, trouble)) {
    const std::filesystem::path folder = model;
    model = (folder / "model.yaml").string();
    if (campaign.empty()) campaign = (folder / "campaign.yaml").string();
  }
  if (!campaign.empty()) return;
  // A log or a URDF is told what makes a model of it.
  const YamlField file = YamlField::load(model);
  if (file.has("format") && file.at("format").text().starts_with("graybox-campaign/")) {
    throw InputError(
        fmt::format("{}: is a campaign: say the model before it: `graybox {} MODEL {}`", model,
                    command, model));
  }
  throw InputError(fmt::format(
      "campaign: missing: say `graybox {} {} CAMPAIGN`, a graybox-campaign/1 file or its folder",
      command, model));
}

}  // namespace graybox::cli
