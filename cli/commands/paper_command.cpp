// `graybox paper ...`: the numbers behind the paper's Table I and Figures 2, 4 and 5, for any robot
// and set. scripts/figures draws them.
#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "bench/paper/covariance_table.hpp"
#include "bench/paper/experiment_curve.hpp"
#include "bench/paper/response_curve.hpp"
#include "bench/paper/robot_poses.hpp"
#include "cli/arguments/robot_arguments.hpp"
#include "cli/commands/commands.hpp"
#include "problems/base/error.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/formats/information_set_file.hpp"
#include "solvers/report/design_file.hpp"

namespace graybox::cli {
namespace {

struct SetAndDesign {
  std::string set;
  std::string design;
  std::string output;
};

void add_set_and_design(CLI::App& command, SetAndDesign& arguments) {
  command.add_option("set", arguments.set, "information set: .h5, .npy, .csv or .mat")->required();
  command.add_option("design", arguments.design, "relaxed design: graybox-design/1 JSON")
      ->required();
  command.add_option("-o,--output", arguments.output, "CSV file to write")->required();
}

void write(const std::string& path, const std::string& text) {
  write_text_file(path, text);
  fmt::print("wrote {}\n", path);
}

void add_table_1(CLI::App& paper) {
  auto arguments = std::make_shared<SetAndDesign>();
  auto* command = paper.add_subcommand(
      "table_1", "Table I: support, single covariances, weights; min, median and max");
  add_set_and_design(*command, *arguments);
  command->footer("Example:\n  graybox paper table_1 set.h5 design.json -o table_1.csv");
  command->callback([arguments] {
    const InformationSet set = read_information_set(arguments->set);
    const DesignFile file = read_design(arguments->design, set);
    const bench::CovarianceTable table = bench::covariance_table(set, file.design);
    write(arguments->output, bench::to_csv(set, table));
    fmt::print("covariance of the design in the set's own units: {:.6g}\n",
               table.design_covariance);
  });
}

struct ResponseArguments {
  RobotArguments robot;
  std::vector<double> position;
  double from = 1.0;
  double to = 60.0;
  std::size_t count = 600;
  std::string output;
};

std::vector<double> logarithmic_frequencies(const ResponseArguments& arguments) {
  if (!(arguments.from > 0.0 && arguments.to > arguments.from && arguments.count >= 2)) {
    throw InputError("frequencies: need 0 < --from < --to and --count of at least 2");
  }
  std::vector<double> frequencies(arguments.count);
  const double ratio = std::log(arguments.to / arguments.from);
  for (std::size_t k = 0; k < arguments.count; ++k) {
    const double share = static_cast<double>(k) / static_cast<double>(arguments.count - 1);
    frequencies[k] = arguments.from * std::exp(ratio * share);
  }
  return frequencies;
}

void add_figure_2(CLI::App& paper) {
  auto arguments = std::make_shared<ResponseArguments>();
  auto* command = paper.add_subcommand(
      "figure_2", "Figure 2: singular values of the frequency response and inverse controller");
  add_model_option(*command, arguments->robot);
  command
      ->add_option("--position", arguments->position,
                   "commanded joint angles, degrees, separated by commas (default: zeros)")
      ->delimiter(',');
  command->add_option("--from", arguments->from, "lowest frequency, Hz")->capture_default_str();
  command->add_option("--to", arguments->to, "highest frequency, Hz")->capture_default_str();
  command->add_option("--count", arguments->count, "frequencies, spaced logarithmically")
      ->capture_default_str();
  command->add_option("-o,--output", arguments->output, "CSV file to write")->required();
  command->footer("Example:\n  graybox paper figure_2 --position 0,30,-60,0,45,0 -o figure_2.csv");
  command->callback([arguments] {
    const RobotModel robot = load_robot(arguments->robot);
    std::vector<double>& degrees = arguments->position;
    if (degrees.empty()) degrees.assign(robot.joint_names.size(), 0.0);
    const Eigen::VectorXd angles = Eigen::Map<const Eigen::VectorXd>(
                                       degrees.data(), static_cast<Eigen::Index>(degrees.size())) *
                                   (std::numbers::pi / 180.0);
    write(arguments->output,
          bench::to_csv(bench::response_curve(robot, angles, logarithmic_frequencies(*arguments))));
  });
}

void add_figure_4(CLI::App& paper) {
  struct Arguments {
    SetAndDesign files;
    bench::CurveOptions options;
  };
  auto arguments = std::make_shared<Arguments>();
  auto* command = paper.add_subcommand(
      "figure_4", "Figure 4: covariance against the number of experiments, however spent");
  add_set_and_design(*command, arguments->files);
  command->add_option("--experiments", arguments->options.experiments, "largest M")
      ->capture_default_str();
  command->add_option("--repetitions", arguments->options.repetitions, "of the random choices")
      ->capture_default_str();
  command->add_option("--seed", arguments->options.seed, "of the random choices")
      ->capture_default_str();
  command->footer(
      "Covariances are in units of the relaxed optimum's with one experiment.\n"
      "Example:\n  graybox paper figure_4 set.h5 design.json --experiments 100 -o figure_4.csv");
  command->callback([arguments] {
    const InformationSet set = read_information_set(arguments->files.set);
    const DesignFile file = read_design(arguments->files.design, set);
    write(arguments->files.output,
          bench::to_csv(bench::experiment_curve(set, file.design, arguments->options)));
  });
}

void add_figure_5(CLI::App& paper) {
  struct Arguments {
    SetAndDesign files;
    RobotArguments robot;
  };
  auto arguments = std::make_shared<Arguments>();
  auto* command =
      paper.add_subcommand("figure_5", "Figure 5: joints and payload in each position of a design");
  add_set_and_design(*command, arguments->files);
  add_model_option(*command, arguments->robot);
  command->footer("Example:\n  graybox paper figure_5 set.h5 design.json -o figure_5.csv");
  command->callback([arguments] {
    const RobotModel robot = load_robot(arguments->robot);
    const InformationSet set = read_information_set(arguments->files.set);
    const DesignFile file = read_design(arguments->files.design, set);
    write(arguments->files.output, bench::to_csv(bench::robot_poses(robot, set, file.design)));
  });
}

}  // namespace

void add_paper_command(CLI::App& app, Invocation& /*invocation*/) {
  auto* paper = app.add_subcommand("paper", "Numbers behind the paper's Table I and figures");
  paper->require_subcommand(1);
  add_table_1(*paper);
  add_figure_2(*paper);
  add_figure_4(*paper);
  add_figure_5(*paper);
  paper->footer("Example:\n  graybox paper table_1 set.h5 design.json -o table_1.csv");
}

}  // namespace graybox::cli
