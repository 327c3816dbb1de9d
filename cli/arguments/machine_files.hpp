// The two files that commands on a machine read: its model, and the campaign of its recordings.
//
//   add_machine_files(*command, request.model, request.campaign);
//   ...
//   find_machine_files("diagnose", request.model, request.campaign);
//
// A folder that `graybox model` wrote stands for both.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace graybox::cli {

void add_machine_files(CLI::App& command, std::string& model, std::string& campaign,
                       const std::string& model_words = "model file (YAML)");

// `command`: the name of the command that asks. Throws InputError where the campaign is missing;
// for a log or a URDF alone the line names the command that makes a model of it.
void find_machine_files(const std::string& command, std::string& model, std::string& campaign);

}  // namespace graybox::cli
