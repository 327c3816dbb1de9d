#include <fmt/format.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "cli/arguments/robot_arguments.hpp"
#include "cli/arguments/set_arguments.hpp"
#include "cli/arguments/threads_argument.hpp"
#include "cli/commands/commands.hpp"
#include "cli/output/console.hpp"
#include "cli/problem/jacobian_problem.hpp"
#include "problems/base/available_memory.hpp"
#include "problems/families/families.hpp"
#include "problems/families/regression.hpp"
#include "problems/formats/information_set_file.hpp"
#include "problems/robot_information/robot_information.hpp"
#include "problems/robot_information/robot_spectrum_information.hpp"
#include "solvers/external/cbf_file.hpp"

namespace graybox::cli {
namespace {

// Every problem command ends here: the set is validated before anything is written.
void report_written(const std::string& path, const InformationSet& set) {
  const std::string extension = std::filesystem::path(path).extension().string();
  const bool made = set.has_factors() && extension != ".h5" && extension != ".hdf5";
  fmt::print("wrote {}: {}{}\n", path, describe(set), made ? ", written as matrices" : "");
}

void write(const std::string& path, const InformationSet& set) {
  set.validate();
  write_information_set(path, set);
  report_written(path, set);
}

void add_output(CLI::App& command, std::string& output) {
  command.add_option("-o,--output", output, "file to write: .h5, .npy, .csv or .mat")->required();
}

void add_robot(CLI::App& problem) {
  struct Arguments {
    RobotArguments robot;
    RobotInformationOptions options;
    std::string output;
  };
  auto arguments = std::make_shared<Arguments>();
  auto* command = problem.add_subcommand("robot", "Information matrices of a flexible robot");
  add_robot_options(*command, arguments->robot);
  add_threads(*command, arguments->options.threads);
  add_output(*command, arguments->output);
  command->footer(
      "Examples:\n"
      "  graybox problem robot -o set.h5\n"
      "  graybox problem robot --grid 500 -o small.h5\n"
      "  graybox problem robot --model my_robot.yaml --grid positions.csv -o set.h5");
  command->callback([arguments] {
    const RobotModel robot = load_robot(arguments->robot);
    const PositionTable positions = load_positions(arguments->robot, robot);
    write(arguments->output, robot_information_set(robot, positions, arguments->options));
  });
}

void add_spectrum(CLI::App& problem) {
  struct Arguments {
    RobotArguments robot;
    RobotSpectrumOptions options;
    std::string output;
  };
  auto arguments = std::make_shared<Arguments>();
  auto* command = problem.add_subcommand(
      "spectrum", "Information matrices of a robot by position, frequency and input axis");
  add_robot_options(*command, arguments->robot);
  add_threads(*command, arguments->options.threads);
  add_output(*command, arguments->output);
  command->footer(
      "The file takes 0.2 MB a position of the robot of graybox, 1.6 GB for the paper's 7920;\n"
      "'graybox design spectrum' makes the set in memory and needs no file.\n"
      "Example:\n"
      "  graybox problem spectrum --grid 100 -o set.h5");
  command->callback([arguments] {
    const RobotModel robot = load_robot(arguments->robot);
    const PositionTable positions = load_positions(arguments->robot, robot);
    require_memory(robot_spectrum_bytes(robot, positions.count()),
                   fmt::format("the set of {} positions with {} lines each", positions.count(),
                               line_count(robot)),
                   "choose a smaller --grid");
    write(arguments->output, robot_spectrum_set(robot, positions, arguments->options));
  });
}

// "  rob     log-normal ..." for the help text.
std::string family_list() {
  std::string text = "Families:\n";
  for (const Family& family : families()) {
    text += fmt::format("  {:<12} {}\n", family.name, family.description);
  }
  return text;
}

void add_random(CLI::App& problem) {
  struct Arguments {
    std::string family;
    std::size_t candidates = 0;
    std::size_t dimension = 0;
    std::uint64_t seed = 1;
    bool factors = false;
    std::string output;
  };
  auto arguments = std::make_shared<Arguments>();
  auto* command =
      problem.add_subcommand("random", "Set of a named family, reproducible by its seed");
  command->add_option("--family", arguments->family, "name of the family, see below")->required();
  command->add_option("--candidates", arguments->candidates, "Q (default: the family's own)")
      ->check(CLI::PositiveNumber);
  command->add_option("--dimension", arguments->dimension, "d (default: the family's own, 12)")
      ->check(CLI::PositiveNumber);
  command->add_option("--seed", arguments->seed, "of the random numbers")->capture_default_str();
  command->add_flag("--factors", arguments->factors, "r1g, r1l: write vectors f, H = f f', to .h5");
  add_output(*command, arguments->output);
  command->footer(
      family_list() +
      "Example:\n  graybox problem random --family wis --candidates 7920 --dimension 12 "
      "--seed 1 -o set.h5");
  command->callback([arguments] {
    require_place_for_factors(arguments->factors, arguments->output);
    write(
        arguments->output,
        make_family(arguments->family, arguments->candidates, arguments->dimension, arguments->seed,
                    arguments->factors ? SetForm::kFactors : SetForm::kMatrices));
  });
}

struct RegressionArguments {
  std::string model = "polynomial";
  std::size_t degree = 3;
  std::size_t points = 1001;
  std::string basis = "monomial";
  std::size_t parameters = 8;
  std::size_t factors = 4;
  std::size_t interactions = 1;
  std::size_t levels = 3;
  std::string output;
};

InformationSet make_regression(const RegressionArguments& arguments) {
  if (arguments.model == "polynomial") {
    const auto basis = arguments.basis == "legendre"    ? PolynomialBasis::kLegendre
                       : arguments.basis == "chebyshev" ? PolynomialBasis::kChebyshev
                                                        : PolynomialBasis::kMonomial;
    return polynomial_regression(arguments.degree, even_points(arguments.points), basis);
  }
  if (arguments.model == "splines") {
    return spline_regression(arguments.parameters, even_points(arguments.points));
  }
  if (arguments.model == "exponentials") {
    return exponential_regression(arguments.parameters, even_points(arguments.points));
  }
  if (arguments.model == "factorial") {
    return two_level_factorial(arguments.factors, arguments.interactions);
  }
  return cube_regression(arguments.levels);
}

void add_regression(CLI::App& problem) {
  auto arguments = std::make_shared<RegressionArguments>();
  auto* command = problem.add_subcommand("regression", "Linear regression: one candidate a point");
  command
      ->add_option("--model", arguments->model,
                   "polynomial, splines, exponentials, factorial or cube")
      ->check(CLI::IsMember({"polynomial", "splines", "exponentials", "factorial", "cube"}))
      ->capture_default_str();
  command->add_option("--degree", arguments->degree, "polynomial: degree")->capture_default_str();
  command
      ->add_option("--points", arguments->points,
                   "polynomial, splines, exponentials: even points on [-1, 1]")
      ->capture_default_str();
  command->add_option("--basis", arguments->basis, "polynomial: monomial, legendre or chebyshev")
      ->check(CLI::IsMember({"monomial", "legendre", "chebyshev"}))
      ->capture_default_str();
  command
      ->add_option("--parameters", arguments->parameters, "splines, exponentials: how many of them")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--factors", arguments->factors, "factorial: factors at two levels")
      ->capture_default_str();
  command
      ->add_option("--interactions", arguments->interactions,
                   "factorial: 1 main effects, 2 also products of two factors")
      ->capture_default_str();
  command->add_option("--levels", arguments->levels, "cube: odd number of levels of 7 factors")
      ->capture_default_str();
  add_output(*command, arguments->output);
  command->footer(
      "Examples:\n"
      "  graybox problem regression --model polynomial --degree 5 --points 1001 -o polynomial.h5\n"
      "  graybox problem regression --degree 19 --basis legendre --points 10000 -o legendre.h5\n"
      "  graybox problem regression --model splines --parameters 12 --points 1001 -o splines.h5\n"
      "  graybox problem regression --model factorial --factors 7 --interactions 2 -o "
      "factorial.h5\n"
      "  graybox problem regression --model cube --levels 3 -o cube.h5");
  command->callback([arguments] { write(arguments->output, make_regression(*arguments)); });
}

void add_subset(CLI::App& problem) {
  struct Arguments {
    SetArguments set;
    std::size_t candidates = 0;
    std::uint64_t seed = 1;
    std::string output;
  };
  auto arguments = std::make_shared<Arguments>();
  auto* command =
      problem.add_subcommand("subset", "Random subset of a set; equal seeds give nested subsets");
  add_set_options(*command, arguments->set);
  add_factors_option(*command, arguments->set);
  command->add_option("--candidates", arguments->candidates, "how many to keep")->required();
  command->add_option("--seed", arguments->seed, "of the permutation")->capture_default_str();
  add_output(*command, arguments->output);
  command->footer("Example:\n  graybox problem subset set.h5 --candidates 500 --seed 1 -o sub.h5");
  command->callback([arguments] {
    const ProjectedSet read = read_set(arguments->set, SingularSum::kRefused, FactorForm::kKept);
    fmt::print("{}", change_note(read.changed));
    const InformationSet& set = read.set;
    const auto kept = nested_subset(set.candidate_count(), arguments->candidates, arguments->seed);
    write(arguments->output, set.subset(kept));
  });
}

void add_convert(CLI::App& problem) {
  struct Arguments {
    SetArguments set;
    std::string output;
  };
  auto arguments = std::make_shared<Arguments>();
  auto* command = problem.add_subcommand("convert", "Rewrite a set in another format");
  add_set_options(*command, arguments->set);
  add_factors_option(*command, arguments->set);
  add_output(*command, arguments->output);
  command->footer(
      "To .cbf it writes the design problem itself, as conic solvers read it. Factors stay "
      "factors\n"
      "in .h5, and become matrices in the other formats.\n"
      "Examples:\n"
      "  graybox problem convert covdata.mat -o covdata.h5\n"
      "  graybox problem convert vectors.npy --factors -o set.h5\n"
      "  graybox problem convert set.h5 -o problem.cbf");
  command->callback([arguments] {
    const ProjectedSet read = read_set(arguments->set, SingularSum::kRefused, FactorForm::kKept);
    fmt::print("{}", change_note(read.changed));
    if (std::filesystem::path(arguments->output).extension() == ".cbf") {
      write_cbf(arguments->output, read.set);
    } else {
      write_information_set(arguments->output, read.set);
    }
    report_written(arguments->output, read.set);
  });
}

}  // namespace

void add_problem_command(CLI::App& app, Invocation& /*invocation*/) {
  auto* problem = app.add_subcommand("problem", "Make, thin out and convert information sets");
  problem->require_subcommand(1);
  add_robot(*problem);
  add_spectrum(*problem);
  add_random(*problem);
  add_regression(*problem);
  add_jacobian_problem(*problem, write);
  add_subset(*problem);
  add_convert(*problem);
  problem->footer(
      "Examples:\n"
      "  graybox problem robot -o set.h5\n"
      "  graybox problem from-jacobians jacobians.csv --noise 0.1 -o set.h5");
}

}  // namespace graybox::cli
