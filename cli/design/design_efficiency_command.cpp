#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "bench/pin_threads.hpp"
#include "cli/arguments/robot_arguments.hpp"
#include "cli/arguments/stiffness_arguments.hpp"
#include "cli/arguments/threads_argument.hpp"
#include "cli/commands/commands.hpp"
#include "cli/output/console.hpp"
#include "cli/process/interrupt.hpp"
#include "problems/base/error.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/robot_information/robot_information.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/core/inverse_cholesky.hpp"
#include "solvers/core/sensitivity.hpp"
#include "solvers/report/design_file.hpp"

namespace graybox::cli {
namespace {

using Json = nlohmann::ordered_json;

struct EfficiencyArguments {
  std::vector<std::string> designs;
  RobotArguments robot;
  StiffnessArguments stiffness{.options = {.uncertainty = 0.5, .seed = 2}, .samples = 1000};
  int threads = 1;
  bool best_single = false;
  bool fresh = false;
  std::string output;
  bool json = false;
};

struct NamedDesign {
  std::string name;
  Design design;
};

// All weight on the position with the largest log det H_i.
NamedDesign best_single_position(const InformationSet& set) {
  InverseCholesky inverse(set.dimension());
  std::size_t best = 0;
  double largest = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    const double value = inverse.log_det_of(set.information(i));
    if (value > largest) {
      largest = value;
      best = i;
    }
  }
  NamedDesign single{"best_single_position", {std::vector<double>(set.candidate_count(), 0.0)}};
  single.design.weights[best] = 1.0;
  return single;
}

std::vector<NamedDesign> read_designs(const EfficiencyArguments& arguments,
                                      const InformationSet& nominal) {
  std::vector<NamedDesign> designs;
  std::set<std::string> names;
  if (arguments.best_single) designs.push_back(best_single_position(nominal));
  for (const std::string& file : arguments.designs) {
    designs.push_back(
        {std::filesystem::path(file).stem().string(), read_design(file, nominal).design});
  }
  if (designs.empty()) throw InputError("no design given; name files, or use --best-single");
  for (const NamedDesign& design : designs) {
    if (!names.insert(design.name).second) {
      throw InputError(fmt::format("two designs are called '{}'; rename a file", design.name));
    }
  }
  return designs;
}

// The table as it is kept in the file: one row of numbers a sample, the first its index, then
// theta, the log det of the sample's optimum and the D-efficiency of each design.
class EfficiencyTable {
 public:
  EfficiencyTable(std::string path, const RobotModel& robot,
                  const std::vector<NamedDesign>& designs)
      : path_(std::move(path)) {
    header_ = "sample";
    for (const std::string& name : robot.parameter_names()) header_ += "," + name;
    header_ += ",log_det_optimum";
    for (const NamedDesign& design : designs) header_ += "," + design.name;
    first_efficiency_ = robot.parameters.size() + 2;
    width_ = first_efficiency_ + designs.size();
  }

  // Takes over the rows of an earlier run of the same samples and designs, up to the first that is
  // not. Throws InputError where the file is something else.
  void resume(const std::vector<Eigen::VectorXd>& thetas) {
    std::ifstream stream(path_);
    if (!stream) return;
    std::string line;
    std::getline(stream, line);
    if (line != header_) {
      throw InputError(path_ + ": is there already, with other columns; remove it or use --fresh");
    }
    while (rows_.size() < thetas.size() && std::getline(stream, line)) {
      const std::vector<double> row = numbers(line);
      const Eigen::VectorXd& theta = thetas[rows_.size()];
      const bool fits =
          row.size() == width_ && std::equal(theta.begin(), theta.end(), row.begin() + 1);
      if (!fits) {
        throw InputError(fmt::format(
            "{}: row {} is of other samples; remove the file or use --fresh", path_, rows_.size()));
      }
      rows_.push_back(row);
    }
  }

  // Throws InputError where row k is not what the present designs and grid give.
  void require_row(std::size_t k, const std::vector<double>& row) const {
    for (std::size_t j = 0; j < row.size(); ++j) {
      if (std::abs(rows_[k][j] - row[j]) <= 1e-6 * (1.0 + std::abs(row[j]))) continue;
      throw InputError(fmt::format(
          "{}: row {} is of other designs or positions; remove the file or use --fresh", path_, k));
    }
  }

  void add(std::vector<double> row) { rows_.push_back(std::move(row)); }

  void write() const {
    if (path_.empty()) return;
    std::string text = header_ + "\n";
    for (const auto& row : rows_) text += fmt::format("{}\n", fmt::join(row, ","));
    write_text_file(path_, text);
  }

  [[nodiscard]] std::size_t size() const { return rows_.size(); }

  [[nodiscard]] std::vector<double> efficiencies(std::size_t design) const {
    std::vector<double> values;
    for (const auto& row : rows_) values.push_back(row[first_efficiency_ + design]);
    std::ranges::sort(values);
    return values;
  }

 private:
  static std::vector<double> numbers(const std::string& line) {
    std::vector<double> values;
    std::istringstream stream(line);
    for (std::string field; std::getline(stream, field, ',');) {
      double value = 0.0;
      const char* end = field.data() + field.size();
      if (std::from_chars(field.data(), end, value).ptr != end) return {};
      values.push_back(value);
    }
    return values;
  }

  std::string path_;
  std::string header_;
  std::size_t first_efficiency_ = 0;
  std::size_t width_ = 0;
  std::vector<std::vector<double>> rows_;
};

// One row: the sample's own optimum on all positions, and what each design reaches of it.
std::vector<double> evaluate(const InformationSet& set, std::size_t index,
                             const Eigen::VectorXd& theta,
                             const std::vector<NamedDesign>& designs) {
  const Solution optimum = ColumnGeneration().solve(set, {.duality_gap = 1e-8});
  if (optimum.status != SolveStatus::kSolved) {
    throw InputError(fmt::format("sample {}: its own optimum was not found ({})", index,
                                 to_string(optimum.status)));
  }
  const double best = log_det_information(set, optimum.design.weights);
  std::vector<double> row{static_cast<double>(index)};
  row.insert(row.end(), theta.begin(), theta.end());
  row.push_back(best);
  for (const NamedDesign& design : designs) {
    const double difference = log_det_information(set, design.design.weights) - best;
    row.push_back(std::exp(difference / static_cast<double>(set.dimension())));
  }
  return row;
}

double quantile(const std::vector<double>& sorted, double share) {
  return sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1) + 0.5)];
}

Json summary(const std::string& name, const std::vector<double>& sorted) {
  double mean = 0.0;
  for (const double value : sorted) mean += value / static_cast<double>(sorted.size());
  return {{"design", name},
          {"smallest", sorted.front()},
          {"percentile_5", quantile(sorted, 0.05)},
          {"median", quantile(sorted, 0.5)},
          {"mean", mean},
          {"percentile_95", quantile(sorted, 0.95)},
          {"largest", sorted.back()}};
}

void print(const EfficiencyArguments& arguments, const EfficiencyTable& table,
           const std::vector<NamedDesign>& designs, std::size_t wanted) {
  Json list = Json::array();
  for (std::size_t k = 0; k < designs.size() && table.size() > 0; ++k) {
    list.push_back(summary(designs[k].name, table.efficiencies(k)));
  }
  if (arguments.json) {
    const Json line{{"status", table.size() == wanted ? "done" : "interrupted"},
                    {"samples", table.size()},
                    {"designs", list}};
    fmt::print("{}\n", line.dump());
    return;
  }
  fmt::print("D-efficiency under {} samples of the stiffness, each against its own optimum\n",
             table.size());
  fmt::print("  {:<24} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}\n", "design", "smallest", "5 %",
             "median", "mean", "95 %", "largest");
  for (const Json& entry : list) {
    fmt::print("  {:<24}", entry["design"].get<std::string>());
    for (const char* key :
         {"smallest", "percentile_5", "median", "mean", "percentile_95", "largest"}) {
      fmt::print(" {:>9.4f}", entry[key].get<double>());
    }
    fmt::print("\n");
  }
  if (!arguments.output.empty()) fmt::print("wrote {}\n", arguments.output);
}

int efficiency(const EfficiencyArguments& arguments) {
  const RobotModel robot = load_robot(arguments.robot);
  const PositionTable positions = load_positions(arguments.robot, robot);
  const StiffnessArguments& stiffness = arguments.stiffness;
  const auto thetas =
      random_stiffness(stiffness.options, stiffness.samples, robot.parameters.size());
  const RobotInformationOptions options{.threads = arguments.threads};
  const std::vector<NamedDesign> designs =
      read_designs(arguments, robot_information_set(robot, positions, options));

  const auto row_of = [&](std::size_t k) {
    const InformationSet set =
        robot_information_set(with_stiffness_factors(robot, thetas[k]), positions, options);
    return evaluate(set, k, thetas[k], designs);
  };
  EfficiencyTable table(arguments.output, robot, designs);
  if (!arguments.fresh && !arguments.output.empty()) {
    table.resume(thetas);
    if (table.size() > 0) table.require_row(0, row_of(0));
  }
  {
    constexpr std::size_t kWriteEvery = 20;
    CountProgress progress("sample", thetas.size());
    while (table.size() < thetas.size() && progress.update(table.size())) {
      table.add(row_of(table.size()));
      if (table.size() % kWriteEvery == 0) table.write();
    }
  }
  table.write();
  print(arguments, table, designs, thetas.size());
  return table.size() == thetas.size() ? kDone : kShort;
}

}  // namespace

void add_design_efficiency_command(CLI::App& design, Invocation& invocation) {
  auto* command = design.add_subcommand(
      "efficiency", "How efficient designs stay where the robot's stiffness is another");
  auto arguments = std::make_shared<EfficiencyArguments>();
  command->add_option("designs", arguments->designs, "designs: graybox-design/1 JSON");
  add_robot_options(*command, arguments->robot);
  add_stiffness_options(*command, arguments->stiffness);
  command->add_flag("--best-single", arguments->best_single,
                    "also all experiments in the nominal robot's best position");
  add_threads(*command, arguments->threads);
  command->add_option("-o,--output", arguments->output,
                      "write one line a sample as CSV; a file of an earlier, unfinished run is "
                      "continued");
  command->add_flag("--fresh", arguments->fresh, "do not continue an earlier file");
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "Independent stiffness factors, uniform on 1 - uncertainty to 1 + uncertainty. Ctrl-C keeps\n"
      "the samples so far (exit code 1); the same command goes on from there.\n"
      "Examples:\n"
      "  graybox design efficiency nominal.json worst_case.json --samples 1000 -o efficiency.csv\n"
      "  graybox design efficiency design.json --best-single --uncertainty 0.2 --json");
  command->callback([arguments, &invocation] {
    bench::pin_threads(arguments->threads, invocation.arguments);
    catch_interrupts(OnStop::kLosesNothing);
    invocation.exit_code = efficiency(*arguments);
  });
}

}  // namespace graybox::cli
