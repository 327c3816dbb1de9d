#include <fmt/format.h>

#include <cstdint>
#include <memory>
#include <string>

#include "commands.hpp"
#include "console.hpp"
#include "graybox/problems/formats/information_set_file.hpp"

namespace graybox::cli {
namespace {

// Every problem command ends here: the set is validated before anything is written.
void write(const std::string& path, const InformationSet& set) {
  set.validate();
  write_information_set(path, set);
  fmt::print("wrote {}: {}\n", path, describe(set));
}

void add_output(CLI::App& command, std::string& output) {
  command.add_option("-o,--output", output, "file to write: .h5, .npy, .csv or .mat")->required();
}

void add_subset(CLI::App& problem) {
  struct Arguments {
    std::string set;
    std::size_t candidates = 0;
    std::uint64_t seed = 1;
    std::string output;
  };
  auto arguments = std::make_shared<Arguments>();
  auto* command =
      problem.add_subcommand("subset", "Random subset of a set; equal seeds give nested subsets");
  command->add_option("set", arguments->set, "information set")->required();
  command->add_option("--candidates", arguments->candidates, "how many to keep")->required();
  command->add_option("--seed", arguments->seed, "of the permutation")->capture_default_str();
  add_output(*command, arguments->output);
  command->footer("Example:\n  graybox problem subset set.h5 --candidates 500 --seed 1 -o sub.h5");
  command->callback([arguments] {
    const InformationSet set = read_information_set(arguments->set);
    const auto kept = nested_subset(set.candidate_count(), arguments->candidates, arguments->seed);
    write(arguments->output, set.subset(kept));
  });
}

void add_convert(CLI::App& problem) {
  struct Arguments {
    std::string set;
    std::string variable;
    std::string output;
  };
  auto arguments = std::make_shared<Arguments>();
  auto* command = problem.add_subcommand("convert", "Rewrite a set in another format");
  command->add_option("set", arguments->set, "information set: .h5, .npy, .csv or .mat")
      ->required();
  command->add_option("--variable", arguments->variable, "variable of a .mat file with several");
  add_output(*command, arguments->output);
  command->footer("Example:\n  graybox problem convert covdata.mat -o covdata.h5");
  command->callback([arguments] {
    write(arguments->output,
          read_information_set(arguments->set, {.variable = arguments->variable}));
  });
}

}  // namespace

void add_problem_command(CLI::App& app, Invocation& /*invocation*/) {
  auto* problem = app.add_subcommand("problem", "Make, thin out or convert information sets");
  problem->require_subcommand(1);
  add_subset(*problem);
  add_convert(*problem);
}

}  // namespace graybox::cli
