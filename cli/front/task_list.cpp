#include "cli/front/task_list.hpp"

#include <fmt/format.h>

#include <string_view>

#include "cli/front/diagnosis_commands.hpp"

namespace graybox::cli {
namespace {

struct Task {
  const char* words;
  const char* command;
};

constexpr Task kTasks[] = {
    {.words = "Choose the experiments that teach most",
     .command = "graybox solve set.npy -o design.json"},
    {.words = "Round them to whole numbers", .command = "graybox exact set.npy --experiments 12"},
    {.words = "Prove a design, whoever made it", .command = "graybox check set.npy design.json"},
    {.words = "Make information matrices of your own model",
     .command = "graybox problem from-jacobians jacobians.csv --noise 0.1 -o set.h5"},
    {.words = "Begin with a log of your machine",
     .command = "graybox model --one-mass log.csv -o axis"},
    {.words = "Find the physics that a model lacks",
     .command = "graybox diagnose axis/model.yaml axis/campaign.yaml -o report"},
    {.words = "Estimate a model's parameters",
     .command = "graybox fit axis/model.yaml axis/campaign.yaml"},
    {.words = "Put what was found into a controller",
     .command = "graybox export report/model_extended.yaml --to c -o feed_forward.c"},
};

// "solve" of "graybox solve set.npy".
std::string name_of(std::string_view command) {
  command.remove_prefix(std::string_view("graybox ").size());
  return std::string(command.substr(0, command.find(' ')));
}

}  // namespace

std::string task_list() {
  std::string text =
      "graybox tells which experiments to run, and which physics a model leaves out.\n\n";
  for (const Task& task : kTasks) {
    if (!reason_for_absence(name_of(task.command)).empty()) continue;
    text += fmt::format("{}:\n  {}\n", task.words, task.command);
  }
  return text +
         "\nAll commands: graybox --help. One command: graybox COMMAND --help. "
         "Which files: docs/README.md.\n";
}

}  // namespace graybox::cli
