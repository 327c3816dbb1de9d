#include "cli/problem/jacobian_problem.hpp"

#include <filesystem>
#include <memory>
#include <utility>

#include "cli/problem/jacobian_file.hpp"
#include "problems/base/error.hpp"
#include "problems/information/block_effects.hpp"

namespace graybox::cli {
namespace {

struct JacobianArguments {
  std::string jacobians;
  std::size_t outputs = 0;
  std::string model = "linear";
  std::string noise;
  std::string nominal;
  std::string coordinates;
  bool factors = false;
  std::size_t blocks = 0;
  std::string block_effects;
  std::string output;
};

// Every candidate in every block, where blocks are asked for. A generalised linear model has its
// offset in the linear predictor.
Jacobians in_blocks(Jacobians jacobians, const JacobianArguments& arguments, bool linear) {
  if (arguments.blocks == 0) {
    if (arguments.block_effects.empty()) return jacobians;
    throw InputError("--block-effects goes with --blocks");
  }
  const std::size_t blocks = arguments.blocks;
  BlockEffects effects = !arguments.block_effects.empty()
                             ? read_block_effects(arguments.block_effects, jacobians, blocks)
                         : linear ? offsets_of_outputs(jacobians, blocks)
                                  : common_offset(jacobians, blocks);
  return with_block_effects(std::move(jacobians), effects);
}

InformationSet make_set(const JacobianArguments& arguments) {
  require_place_for_factors(arguments.factors, arguments.output);
  const SetForm form = arguments.factors ? SetForm::kFactors : SetForm::kMatrices;
  const bool linear = arguments.model == "linear";
  if (linear && !arguments.nominal.empty()) {
    throw InputError("--at is for --model logistic and poisson; Jacobians are taken as they are");
  }
  if (!linear && !arguments.noise.empty()) {
    throw InputError("--noise is for --model linear; " + arguments.model + " states its own");
  }
  if (!linear && arguments.nominal.empty()) {
    throw InputError("--model " + arguments.model +
                     " needs nominal parameters: --at name=value,...");
  }
  Jacobians jacobians = read_jacobians(arguments.jacobians, arguments.outputs);
  if (!arguments.coordinates.empty()) {
    jacobians.table = read_coordinates(arguments.coordinates, jacobians.candidates);
  }
  if (linear) {
    const JacobianNoise noise =
        read_noise(arguments.noise.empty() ? "1" : arguments.noise, jacobians.outputs);
    return information_set_from_jacobians(in_blocks(std::move(jacobians), arguments, linear), noise,
                                          form);
  }
  std::vector<double> nominal = read_nominal(arguments.nominal, jacobians);
  const std::size_t of_model = jacobians.parameters;
  jacobians = in_blocks(std::move(jacobians), arguments, linear);
  nominal.resize(nominal.size() + jacobians.parameters - of_model, 0.0);  // those of the blocks
  const auto model = arguments.model == "logistic" ? GeneralisedLinearModel::kLogistic
                                                   : GeneralisedLinearModel::kPoisson;
  return generalised_linear_set(std::move(jacobians), model, nominal, form);
}

}  // namespace

void require_place_for_factors(bool factors, const std::string& output) {
  const std::string extension = std::filesystem::path(output).extension().string();
  if (!factors || extension == ".h5" || extension == ".hdf5") return;
  throw InputError(output +
                   ": --factors writes .h5, which says that it holds factors; name such a "
                   "file or leave it out");
}

void add_jacobian_problem(
    CLI::App& problem,
    std::function<void(const std::string& path, const InformationSet& set)> write) {
  auto arguments = std::make_shared<JacobianArguments>();
  auto* command = problem.add_subcommand(
      "from-jacobians", "Information matrices of your own model, from its Jacobians");
  command
      ->add_option("jacobians", arguments->jacobians,
                   "CSV: one row a candidate and output, one column a parameter; or .npy "
                   "[Q x r x d], [Q x d]")
      ->required();
  command
      ->add_option("--outputs", arguments->outputs,
                   "rows a candidate, r (default: by a column 'candidate', else 1)")
      ->check(CLI::PositiveNumber);
  command->add_option(
      "--noise", arguments->noise,
      "standard deviation, one for each output (0.1,0.2), or the file of a covariance "
      "(default: 1)");
  command->add_option("--model", arguments->model, "linear, logistic or poisson")
      ->check(CLI::IsMember({"linear", "logistic", "poisson"}))
      ->capture_default_str();
  command->add_option("--at", arguments->nominal,
                      "logistic, poisson: nominal parameters, name=value,..., or a file");
  command->add_option("--candidates", arguments->coordinates,
                      "CSV: coordinates, one row a candidate");
  command
      ->add_option("--blocks", arguments->blocks,
                   "blocks (days, batches) with effects of their own; each candidate in each")
      ->check(CLI::PositiveNumber);
  command->add_option("--block-effects", arguments->block_effects,
                      "CSV as the Jacobians: derivatives by the effects of a block (default: an "
                      "offset of each output)");
  command->add_flag("--factors", arguments->factors,
                    "write the factors F of H = F'F, r d numbers a candidate, to .h5");
  command->add_option("-o,--output", arguments->output, "file to write: .h5, .npy, .csv or .mat")
      ->required();
  command->footer(
      "linear    H = J' R^-1 J, J the derivatives of the outputs by the parameters\n"
      "logistic  rows are regressors x, y is 1 with probability 1 / (1 + exp(-x'theta))\n"
      "poisson   likewise, y a count of mean exp(x'theta)\n"
      "Examples:\n"
      "  graybox problem from-jacobians jacobians.csv --noise 0.1 -o set.h5\n"
      "  graybox problem from-jacobians jacobians.npy --noise covariance.csv --candidates "
      "places.csv -o set.h5\n"
      "  graybox problem from-jacobians jacobians.csv --blocks 3 -o set.h5\n"
      "  graybox problem from-jacobians doses.csv --model logistic --at constant=-2,dose=0.5 "
      "-o set.h5");
  command->callback(
      [arguments, write = std::move(write)] { write(arguments->output, make_set(*arguments)); });
}

}  // namespace graybox::cli
