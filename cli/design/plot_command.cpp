// `graybox plot`: a design as pictures, one SVG file each.
#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "cli/arguments/option_groups.hpp"
#include "cli/arguments/set_arguments.hpp"
#include "cli/arguments/time_limit_argument.hpp"
#include "cli/commands/commands.hpp"
#include "diagnosis/design_page/design_charts.hpp"
#include "diagnosis/design_page/stored_design_story.hpp"
#include "problems/base/error.hpp"
#include "problems/base/program_version.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/json_fields.hpp"
#include "problems/files/json_file.hpp"

namespace graybox::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMark = "<!-- written by graybox ";

struct PlotArguments {
  SetArguments set;  // its path is empty where the design names it
  std::string design;
  std::string folder;
};

// The set that the design names: as it is written there, or beside the design.
std::string set_of_design(const std::string& design) {
  const JsonFields fields(design);
  const auto root = read_json_file<nlohmann::ordered_json>(design);
  const std::string named = root.is_object() ? fields.text(root, "problem") : std::string();
  if (named.empty()) fields.fail("does not name its set; add --set FILE");
  const fs::path beside = fs::path(design).parent_path() / fs::path(named).filename();
  for (const fs::path& path : {fs::path(named), beside}) {
    std::error_code error;
    if (fs::exists(path, error)) return path.string();
  }
  fields.fail(
      fmt::format("its set {} is neither there nor beside the design; add --set FILE", named));
}

// "few/design.json" -> "design_plots".
std::string default_folder(const std::string& design) {
  return fs::path(design).stem().string() + "_plots";
}

// A picture of an earlier run may be replaced; a user's own file may not.
void require_own(const fs::path& path) {
  std::ifstream stream(path, std::ios::binary);
  if (!stream) return;
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  if (text.find(kMark) == std::string::npos) {
    throw InputError(fmt::format(
        "{}: is not a picture that graybox wrote, and stays; choose another folder (-o)",
        path.string()));
  }
}

std::string marked(std::string svg) {
  return svg.insert(svg.find('\n') + 1, fmt::format("<!-- written by {} -->\n", written_by()));
}

std::vector<fs::path> paths_of(const fs::path& folder, const std::vector<DesignPicture>& pictures) {
  std::vector<fs::path> paths;
  for (const DesignPicture& picture : pictures) {
    paths.push_back(folder / (picture.name + ".svg"));
    require_own(paths.back());
  }
  return paths;
}

void make_folder(const std::string& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error || !fs::is_directory(folder)) {
    throw InputError(fmt::format("{}: can't make this folder ({}); choose another one (-o)", folder,
                                 error ? error.message() : "a file has this name"));
  }
}

int plot(const PlotArguments& given) {
  PlotArguments arguments = given;
  if (arguments.set.path.empty()) arguments.set.path = set_of_design(arguments.design);
  if (arguments.folder.empty()) arguments.folder = default_folder(arguments.design);
  const ProjectedSet read = read_set(arguments.set, SingularSum::kAllowed, FactorForm::kKept);
  const DesignStory story = stored_design_story(read.set, arguments.design);
  const std::vector<DesignPicture> pictures = design_pictures(story);
  make_folder(arguments.folder);
  const std::vector<fs::path> paths = paths_of(arguments.folder, pictures);
  for (std::size_t k = 0; k < pictures.size(); ++k) {
    write_text_file(paths[k].string(), marked(pictures[k].svg));
    fmt::print("wrote {}\n", paths[k].string());
  }
  fmt::print("{}", change_note(read.changed));
  if (story.sensitivities.empty()) {
    fmt::print("note: no sensitivities are drawn: {}\n", story.sensitivity_words);
  }
  return kDone;
}

}  // namespace

void add_plot_command(CLI::App& app, Invocation& invocation) {
  auto* command = app.add_subcommand("plot", "Draw a design: weights, and proof, over each factor");
  auto arguments = std::make_shared<PlotArguments>();
  command->add_option("design", arguments->design, "design: graybox-design/1 JSON")->required();
  command->add_option("--set", arguments->set.path,
                      "its information set (default: the one that the design names)");
  command->add_option("--variable", arguments->set.variable, "variable of a .mat file with several")
      ->group(kReadingOptions);
  add_psd_tolerance(*command, arguments->set.psd_tolerance);
  add_factors_option(*command, arguments->set);
  command->add_option("-o,--output", arguments->folder,
                      "folder of the pictures (default: the design's name and _plots)");
  add_time_limit(*command, OnStop::kLosesNothing);
  command->footer(
      "Writes SVG files: weights (or counts) over the candidates and over each coordinate that\n"
      "varies; sensitivities against the bound of an optimal design, likewise; a map of them\n"
      "where just two coordinates vary. For D a sensitivity is the variance of a candidate's\n"
      "predictions, over the least possible maximum. It judges nothing: 'graybox check' does,\n"
      "and its --report is one page with the proof.\n"
      "Examples:\n"
      "  graybox plot design.json\n"
      "  graybox plot design.json --set set.h5 -o pictures");
  command->callback([arguments, &invocation] { invocation.exit_code = plot(*arguments); });
}

}  // namespace graybox::cli
