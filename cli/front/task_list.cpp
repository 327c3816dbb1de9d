#include "cli/front/task_list.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>
#include <string_view>

#include "cli/front/diagnosis_commands.hpp"

namespace graybox::cli {
namespace {

struct Task {
  const char* words;
  const char* example;
  std::array<std::string_view, 3> commands;  // those of the task; fewer are followed by empty ones
};

constexpr Task kTasks[] = {
    {.words = "Choose the experiments that teach most",
     .example = "graybox solve set.npy -o design.json",
     .commands = {"solve", "design"}},
    {.words = "Round them to whole numbers",
     .example = "graybox exact set.npy --experiments 12",
     .commands = {"exact"}},
    {.words = "Prove a design, whoever made it",
     .example = "graybox check set.npy design.json",
     .commands = {"check", "plot"}},
    {.words = "Make information matrices of your own model",
     .example = "graybox problem from-jacobians jacobians.csv --noise 0.1 -o set.h5",
     .commands = {"problem"}},
    {.words = "Begin with a log of your machine",
     .example = "graybox model --one-mass log.csv -o axis",
     .commands = {"model", "recordings"}},
    {.words = "Find the physics that a model lacks",
     .example = "graybox diagnose axis/model.yaml axis/campaign.yaml -o report",
     .commands = {"diagnose", "responses", "simulate"}},
    {.words = "Estimate a model's parameters",
     .example = "graybox fit axis/model.yaml axis/campaign.yaml",
     .commands = {"fit", "predict"}},
    {.words = "Put what was found into a controller",
     .example = "graybox export report/model_extended.yaml --to c -o feed_forward.c",
     .commands = {"export"}},
};

bool is_there(const Task& task) {
  return reason_for_absence(std::string(task.commands.front())).empty();
}

std::string footer() {
  std::string text =
      "Exit codes: 0 done, 1 a numerical outcome short of what was asked, 2 bad input.\n"
      "Examples:\n"
      "  graybox problem robot -o set.h5\n"
      "  graybox solve set.h5 --gap 1e-9 -o design.json\n"
      "  graybox check set.h5 design.json";
  if (reason_for_absence("diagnose").empty()) {
    text += "\n  graybox diagnose axis/model.yaml axis/campaign.yaml -o report";
  }
  return text;
}

}  // namespace

void group_by_task(CLI::App& app) {
  for (CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (command->get_group().empty()) continue;  // not for users
    const auto* const task = std::ranges::find_if(kTasks, [&](const Task& each) {
      return std::ranges::find(each.commands, command->get_name()) != each.commands.end();
    });
    command->group(task == std::end(kTasks) ? "Beside these" : task->words);
  }
  app.footer(footer());
}

std::string task_list() {
  std::string text =
      "graybox tells which experiments to run, and which physics a model leaves out.\n\n";
  for (const Task& task : kTasks) {
    if (is_there(task)) text += fmt::format("{}:\n  {}\n", task.words, task.example);
  }
  return text +
         "\nAll commands: graybox --help. One command: graybox COMMAND --help. "
         "Which files: docs/README.md.\n";
}

}  // namespace graybox::cli
