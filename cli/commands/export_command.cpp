// `graybox export`: a model for other programs, as C, tables or URDF.
#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "cli/commands/commands.hpp"
#include "diagnosis/export/c_function.hpp"
#include "diagnosis/export/law_tables.hpp"
#include "diagnosis/export/urdf_file.hpp"
#include "problems/base/error.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/files_together.hpp"

namespace graybox::cli {
namespace {

struct Arguments {
  std::string model, kind, output, name, load;
  std::vector<std::string> physics, without;
  double velocity = 0.0, deflection = 0.0;  // 0: not stated
  int points = 201;
};

// CLI::PositiveNumber would name the largest number there is, in all its digits.
std::string not_positive(std::string& text) {
  const double value = std::strtod(text.c_str(), nullptr);
  if (value > 0.0 && std::isfinite(value)) return {};
  return text + " must be a positive number";
}

// To the file, or to the standard output where none is named.
void hand_over(const std::string& output, const std::string& text) {
  if (output.empty()) {
    fmt::print("{}", text);
    return;
  }
  write_text_file(output, text);
  fmt::print("wrote {}\n", output);
}

std::vector<ModelTable> tables_of(const ExportedModel& model, const Arguments& arguments) {
  TableRange range;
  range.points = arguments.points;
  if (arguments.velocity > 0.0) range.velocity = arguments.velocity;
  if (arguments.deflection > 0.0) range.deflection = arguments.deflection;
  return model_tables(model, range);
}

void write_tables(const std::string& folder, const std::vector<ModelTable>& tables) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) {
    throw InputError(fmt::format("{}: can't be made as a folder: {}; name another with -o", folder,
                                 failed.message()));
  }
  const auto file = [&](const ModelTable& table) {
    return (std::filesystem::path(folder) / table.file).string();
  };
  FilesTogether files;
  for (const ModelTable& table : tables) write_text_file(file(table), table.text);
  files.commit();
  for (const ModelTable& table : tables) fmt::print("wrote {}\n", file(table));
}

void write_urdf(const ExportedModel& model, const std::string& output) {
  const UrdfExport urdf = urdf_with_findings(model);
  hand_over(output, urdf.text);
  for (const std::string& note : urdf.notes) fmt::print(stderr, "note: {}\n", note);
}

int execute(const Arguments& arguments) {
  const ExportedModel model = read_exported_model(
      arguments.model, {.physics = {arguments.physics.begin(), arguments.physics.end()},
                        .without = arguments.without,
                        .load = arguments.load});
  if (arguments.kind == "urdf") {
    write_urdf(model, arguments.output);
  } else if (arguments.kind == "c") {
    const std::string name = arguments.name.empty() ? c_name_of(arguments.model) : arguments.name;
    hand_over(arguments.output, c_function(model, name));
  } else if (arguments.output.empty()) {
    fmt::print("{}", tables_of(model, arguments).front().text);
  } else {
    write_tables(arguments.output, tables_of(model, arguments));
  }
  return kDone;
}

}  // namespace

void add_export_command(CLI::App& app, Invocation& invocation) {
  auto* command =
      app.add_subcommand("export", "A model for other programs: a C function, tables or URDF");
  auto arguments = std::make_shared<Arguments>();
  command
      ->add_option("model", arguments->model,
                   "graybox-lumped/1 or graybox-rigid-robot/1, such as model_extended.yaml")
      ->required();
  command->add_option("--to", arguments->kind, "what to write: c, csv or urdf")
      ->check(CLI::IsMember({"c", "csv", "urdf"}))
      ->required();
  command->add_option("-o,--output", arguments->output,
                      "file (c, urdf) or folder (csv); unless stated, text is printed");
  command->add_option("--without", arguments->without, "names of elements that are left out");
  command->add_option("--physics", arguments->physics,
                      "graybox-physics/1 files with further elements");
  command->add_option("--load", arguments->load, "robots: with the payload of this load");
  command->add_option("--name", arguments->name,
                      "c: beginning of the functions' names (default: the model's file)");
  command->add_option("--velocity", arguments->velocity, "csv: the largest velocity in a table")
      ->check(CLI::Validator(&not_positive, ""));
  command->add_option("--deflection", arguments->deflection, "csv: the largest deflection")
      ->check(CLI::Validator(&not_positive, ""));
  command->add_option("--points", arguments->points, "csv: rows of a table")
      ->check(CLI::Range(3, 100001))
      ->capture_default_str();
  command->footer(
      "Exit codes: 0 written; 2 bad input, or a law that has no place in such a file.\n"
      "Example:\n"
      "  graybox export report/model_extended.yaml --to c -o feed_forward.c");
  command->callback([arguments, &invocation] { invocation.exit_code = execute(*arguments); });
}

}  // namespace graybox::cli
