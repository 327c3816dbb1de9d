// `graybox design continuous`: robot positions off the grid
// (solvers/column_generation/continuous_design.hpp).
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "bench/pin_threads.hpp"
#include "cli/arguments/robot_arguments.hpp"
#include "cli/arguments/threads_argument.hpp"
#include "cli/commands/commands.hpp"
#include "cli/output/console.hpp"
#include "cli/process/interrupt.hpp"
#include "problems/base/error.hpp"
#include "problems/base/stop.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/files_together.hpp"
#include "problems/formats/information_set_file.hpp"
#include "problems/robot_information/robot_information.hpp"
#include "problems/robot_information/robot_space.hpp"
#include "problems/robot_information/stiffness_samples.hpp"
#include "solvers/certificates/certificate.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/column_generation/continuous_design.hpp"
#include "solvers/core/sensitivity.hpp"
#include "solvers/report/design_file.hpp"
#include "solvers/report/solve_report.hpp"

namespace graybox::cli {
namespace {

constexpr std::size_t kBoundSearches = 200;
constexpr double kThetaErrors[] = {0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4};
constexpr double kRefinementGap = 1e-6;  // of the designs on other grids

struct ContinuousArguments {
  RobotArguments robot;
  ContinuousOptions options{.duality_gap = 1e-3};
  std::string limits = "paper";
  std::vector<std::string> joint_limits;  // "q2=-60:90"
  std::vector<std::size_t> refined{200000};
  std::vector<std::size_t> refinement;
  std::size_t samples = 200;
  std::string output;
  std::string set;
  std::string tables;
  bool json = false;
};

// "q2=-60:90" into the second range.
void apply_limit(const std::string& text, std::vector<JointRange>& ranges) {
  const auto fail = [&] {
    throw InputError(
        fmt::format("--joint-limit: '{}' is not of the form q2=-60:90 (degrees) for q1 to q{}",
                    text, ranges.size()));
  };
  std::istringstream stream(text);
  char letter = 0, equals = 0, colon = 0;
  std::size_t joint = 0;
  JointRange range;
  if (!(stream >> letter >> joint >> equals >> range.from >> colon >> range.to) || letter != 'q' ||
      equals != '=' || colon != ':' || !(stream >> std::ws).eof() || joint < 1 ||
      joint > ranges.size()) {
    fail();
  }
  ranges[joint - 1] = range;
}

std::vector<JointRange> joint_ranges(const ContinuousArguments& arguments,
                                     const RobotModel& robot) {
  std::vector<JointRange> ranges = arguments.limits == "urdf" ? urdf_ranges(robot) : paper_ranges();
  if (ranges.size() != robot.joint_names.size()) {
    throw InputError(fmt::format("--limits paper: describes 6 joints, {} has {}; use --limits urdf",
                                 robot.name, robot.joint_names.size()));
  }
  for (const std::string& text : arguments.joint_limits) apply_limit(text, ranges);
  return ranges;
}

// What other grids reach: covariance of their optimum.
struct GridOptimum {
  std::size_t candidates = 0;
  std::size_t support = 0;
  double log_det = 0.0;
};

GridOptimum optimum_on(const InformationSet& set, int threads) {
  const Solution solution =
      ColumnGeneration().solve(set, {.duality_gap = kRefinementGap, .threads = threads});
  stop_if_requested();  // which would have cut it short
  const Certificate certificate = certify(set, solution.design);
  return {set.candidate_count(), certificate.support_size, certificate.log_det};
}

// The covariance of a design of positions for another theta.
double covariance_at(const RobotModel& robot, std::size_t joints, const std::vector<double>& points,
                     const std::vector<double>& weights) {
  const InformationSet set = robot_information_set(robot, {joints, points});
  return std::exp(-log_det_information(set, weights) / static_cast<double>(set.dimension()));
}

// How both designs fare where every stiffness is off by up to `error`: medians over samples.
struct Sensitivity {
  double error = 0.0;
  double grid_covariance = 0.0;
  double continuous_covariance = 0.0;
  double median_ratio = 0.0;  // of the two, sample by sample; below 1: the continuous one is better
  double share_better = 0.0;  // of the samples
};

Sensitivity sensitivity_to(double error, std::size_t samples, const RobotModel& robot,
                           const ContinuousResult& result) {
  std::vector<double> grid, continuous, ratio;
  const auto median = [](std::vector<double> values) {
    std::ranges::nth_element(values,
                             values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2));
    return values[values.size() / 2];
  };
  double better = 0.0;
  for (const Eigen::VectorXd& theta :
       random_stiffness({.uncertainty = error}, samples, robot.parameters.size())) {
    const RobotModel other = with_stiffness_factors(robot, theta);
    const std::size_t joints = robot.joint_names.size();
    grid.push_back(covariance_at(other, joints, result.grid_points, result.grid_weights));
    continuous.push_back(covariance_at(other, joints, result.points, result.weights));
    ratio.push_back(continuous.back() / grid.back());
    if (ratio.back() < 1.0) better += 1.0 / static_cast<double>(samples);
  }
  return {error, median(grid), median(continuous), median(ratio), better};
}

struct Outcome {
  ContinuousResult result;
  SolveReport report;  // of the design on the grid with its support behind it
  std::vector<RefinedBound> bounds;
  std::vector<GridOptimum> grids;
  std::vector<Sensitivity> sensitivities;
  double dimension = 0.0;
  bool interrupted = false;  // before all that was asked for was there

  // The largest sensitivity that anything found, over d, minus 1.
  [[nodiscard]] double bound() const {
    double largest = std::max(result.gap, largest_gap(report.certificate));
    for (const RefinedBound& bound : bounds) largest = std::max(largest, bound.largest_searched);
    return std::max(0.0, largest);
  }
  [[nodiscard]] double covariance(double log_det) const { return std::exp(-log_det / dimension); }
  // (det M_grid / det M)^(1/d).
  [[nodiscard]] double grid_efficiency() const {
    return std::exp((result.grid_log_det - result.log_det) / dimension);
  }
};

std::string support_table(const Outcome& outcome, const InformationSet& grid) {
  const std::size_t n = grid.candidates().names.size();
  std::string text = "weight";
  for (const std::string& name : grid.candidates().names) text += "," + name;
  for (const std::string& name : grid.candidates().names) text += ",nearest_" + name;
  text += '\n';
  const ContinuousResult& result = outcome.result;
  for (std::size_t j = 0; j < result.support_size(); ++j) {
    text += fmt::format("{:.8g}", result.weights[j]);
    const double* point = result.points.data() + n * j;
    double least = std::numeric_limits<double>::infinity();
    std::size_t nearest = 0;
    for (std::size_t i = 0; i < grid.candidate_count(); ++i) {
      double away = 0.0;
      for (std::size_t k = 0; k < n; ++k) {
        away += (point[k] - grid.coordinates(i)[k]) * (point[k] - grid.coordinates(i)[k]);
      }
      if (away < least) {
        least = away;
        nearest = i;
      }
    }
    for (std::size_t k = 0; k < n; ++k) text += fmt::format(",{:.6g}", point[k]);
    for (const double value : grid.coordinates(nearest)) text += fmt::format(",{:.6g}", value);
    text += '\n';
  }
  return text;
}

std::string round_table(const Outcome& outcome) {
  std::string text = "round,columns,support,covariance,found_gap,farthest_from_grid\n";
  for (const ContinuousRound& round : outcome.result.rounds) {
    text +=
        fmt::format("{},{},{},{:.10g},{:.4e},{:.4g}\n", round.round, round.columns, round.support,
                    outcome.covariance(round.log_det), round.found_gap, round.farthest_from_grid);
  }
  return text;
}

std::string bound_table(const Outcome& outcome) {
  std::string text =
      "points,largest_priced_gap,largest_searched_gap,searches,maxima,maxima_seen_once\n";
  for (const RefinedBound& bound : outcome.bounds) {
    text += fmt::format("{},{:.6e},{:.6e},{},{},{}\n", bound.count, bound.largest_priced,
                        bound.largest_searched, bound.searches, bound.maxima, bound.seen_once);
  }
  return text;
}

std::string refinement_table(const Outcome& outcome) {
  std::string text = "candidates,support,covariance,efficiency\n";
  for (const GridOptimum& grid : outcome.grids) {
    text += fmt::format("{},{},{:.10g},{:.8g}\n", grid.candidates, grid.support,
                        outcome.covariance(grid.log_det),
                        std::exp((grid.log_det - outcome.result.log_det) / outcome.dimension));
  }
  text += fmt::format("continuous,{},{:.10g},1\n", outcome.result.support_size(),
                      outcome.covariance(outcome.result.log_det));
  return text;
}

std::string sensitivity_table(const Outcome& outcome) {
  std::string text =
      "stiffness_error,grid_covariance,continuous_covariance,median_ratio,share_better\n";
  for (const Sensitivity& row : outcome.sensitivities) {
    text += fmt::format("{},{:.8g},{:.8g},{:.8g},{:.4g}\n", row.error, row.grid_covariance,
                        row.continuous_covariance, row.median_ratio, row.share_better);
  }
  return text;
}

void print(const ContinuousArguments& arguments, const InformationSet& grid,
           const Outcome& outcome) {
  const ContinuousResult& result = outcome.result;
  const auto percent = [](double share) { return 100.0 * share; };
  fmt::print("continuous design: {}\n",
             outcome.interrupted ? "interrupted" : to_string(outcome.report.status));
  fmt::print("  gap           {:.3e} found by local search (asked {:.3g}), {} rounds\n", result.gap,
             arguments.options.duality_gap, result.rounds.size());
  fmt::print("  certificate   {:.3e} over the {} grid points and the support (proven)\n",
             largest_gap(outcome.report.certificate), grid.candidate_count());
  for (const RefinedBound& bound : outcome.bounds) {
    fmt::print(
        "  refined       {:.3e} over {} more points, {:.3e} after {} searches from the best of "
        "them\n                ({} maxima, {} seen once; evidence for the box, not a proof)\n",
        bound.largest_priced, bound.count, bound.largest_searched, bound.searches, bound.maxima,
        bound.seen_once);
  }
  if (!outcome.report.message.empty()) fmt::print("  note          {}\n", outcome.report.message);
  fmt::print("  covariance    {:.6f}, on the grid {:.6f}\n", outcome.covariance(result.log_det),
             outcome.covariance(result.grid_log_det));
  fmt::print(
      "  the grid      has D-efficiency {:.3f} % of this design, so it loses {:.3f} %; it can't "
      "have\n                lost less; if the found gaps hold for the box, at most {:.3f} %\n",
      percent(outcome.grid_efficiency()), percent(1.0 - outcome.grid_efficiency()),
      percent(1.0 - outcome.grid_efficiency() / (1.0 + outcome.bound())));
  fmt::print("  support       {} positions ({} before merging)\n  {:>10}", result.support_size(),
             result.unmerged_support, "weight");
  for (const std::string& name : grid.candidates().names) fmt::print(" {:>9}", name + " [deg]");
  fmt::print("\n");
  const std::size_t n = grid.candidates().names.size();
  for (std::size_t j = 0; j < result.support_size(); ++j) {
    fmt::print("  {:>10.6f}", result.weights[j]);
    for (std::size_t k = 0; k < n; ++k) fmt::print(" {:>9.3f}", result.points[n * j + k]);
    fmt::print("\n");
  }
  for (const GridOptimum& other : outcome.grids) {
    fmt::print("  grid of {:>8}: covariance {:.6f}, {} positions\n", other.candidates,
               outcome.covariance(other.log_det), other.support);
  }
}

nlohmann::ordered_json to_json(const Outcome& outcome) {
  nlohmann::ordered_json json = graybox::to_json(outcome.report);
  const ContinuousResult& result = outcome.result;
  json["found_gap"] = result.gap;
  json["rounds"] = result.rounds.size();
  json["covariance"] = outcome.covariance(result.log_det);
  json["grid_covariance"] = outcome.covariance(result.grid_log_det);
  json["grid_efficiency"] = outcome.grid_efficiency();
  json["refined"] = nlohmann::ordered_json::array();
  for (const RefinedBound& bound : outcome.bounds) {
    json["refined"].push_back({{"points", bound.count},
                               {"largest_priced_gap", bound.largest_priced},
                               {"largest_searched_gap", bound.largest_searched},
                               {"searches", bound.searches},
                               {"maxima", bound.maxima},
                               {"maxima_seen_once", bound.seen_once}});
  }
  return json;
}

// The points of a refined grid that lie in the box.
RefinedBound bound_by(std::size_t count, const RobotSpace& space, const ContinuousResult& result,
                      int threads, CountProgress& progress) {
  progress.begin(fmt::format("refined grid of {} points", count));
  const PositionTable table = space.inside(robot_grid(count));
  return refined_bound(
      space, result, table.count(),
      [&](std::size_t i, std::span<double> out) {
        std::ranges::copy(table.position(i), out.begin());
      },
      kBoundSearches, threads,
      [&](std::string_view piece, std::size_t done, std::size_t total) {
        if (done == 0) progress.begin(fmt::format("refined grid: {}", piece), total);
        static_cast<void>(progress.update(done));
      });
}

// The design, judged over grid and support.
void judge_continuous(const ContinuousArguments& arguments, const DesignedSet& designed,
                      double seconds, Outcome& outcome) {
  Solution solution{designed.design, outcome.result.status, {}, {}, {}};
  solution.counters.iterations = static_cast<std::int64_t>(outcome.result.rounds.size());
  solution.counters.seconds = seconds;
  outcome.report = judge(designed.set, "continuous",
                         {.duality_gap = arguments.options.duality_gap,
                          .seed = arguments.options.seed,
                          .threads = arguments.options.threads},
                         solution);
  // The certificate over grid and support can't see what the searches found.
  if (outcome.result.status != SolveStatus::kSolved) {
    outcome.report.status = outcome.result.status == SolveStatus::kTimeLimit
                                ? ReportStatus::kTimeLimit
                                : ReportStatus::kIterationLimit;
    outcome.interrupted = interrupted() && outcome.result.status == SolveStatus::kTimeLimit;
    outcome.report.message =
        outcome.interrupted
            ? "interrupted; this is the best design so far"
            : "the searches still find larger sensitivities; this is the best so far";
  }
  outcome.report.problem_hash = designed.set.content_hash();
}

// Bounds by refined grids, optima on other grids, and robots with other stiffness.
void compare_continuous(const ContinuousArguments& arguments, const RobotModel& robot,
                        const RobotSpace& space, CountProgress& progress, Outcome& outcome) {
  const int threads = arguments.options.threads;
  bool complete = true;
  try {
    for (const std::size_t count : arguments.refined) {
      outcome.bounds.push_back(bound_by(count, space, outcome.result, threads, progress));
    }
  } catch (const Stopped&) {  // the bounds so far
    complete = false;
  }
  if (outcome.report.status == ReportStatus::kSolved &&
      outcome.bound() > arguments.options.duality_gap) {
    outcome.report.message =
        "the refined grids find more than the gap asked: good, but not the best; try another "
        "--seed or more --random-points";
  }
  try {
    for (const std::size_t count : arguments.refinement) {
      progress.begin(fmt::format("optimum on a grid of {} points", count));
      outcome.grids.push_back(optimum_on(
          robot_information_set(robot, space.inside(robot_grid(count)), {.threads = threads}),
          threads));
    }
    if (!arguments.tables.empty()) progress.begin("stiffness error", std::size(kThetaErrors));
    for (const double error : kThetaErrors) {
      if (arguments.tables.empty()) break;
      outcome.sensitivities.push_back(
          sensitivity_to(error, arguments.samples, robot, outcome.result));
      static_cast<void>(progress.update(outcome.sensitivities.size()));
    }
  } catch (const Stopped&) {  // the grids and samples so far
    complete = false;
  }
  if (complete || !interrupted() || outcome.interrupted) return;
  outcome.interrupted = true;
  outcome.report.message = "interrupted; bounds and comparisons are those made until then";
}

void write_continuous(const ContinuousArguments& arguments, const InformationSet& grid,
                      const DesignedSet& designed, const Outcome& outcome) {
  FilesTogether files;
  if (!arguments.set.empty()) write_information_set(arguments.set, designed.set);
  if (!arguments.output.empty()) {
    write_design(arguments.output, designed.set, designed.design, outcome.report);
  }
  if (!arguments.tables.empty()) {
    write_text_file(arguments.tables + "_support.csv", support_table(outcome, grid));
    write_text_file(arguments.tables + "_rounds.csv", round_table(outcome));
    write_text_file(arguments.tables + "_bound.csv", bound_table(outcome));
    write_text_file(arguments.tables + "_refinement.csv", refinement_table(outcome));
    write_text_file(arguments.tables + "_sensitivity.csv", sensitivity_table(outcome));
  }
  files.commit();
}

int design_continuous(const ContinuousArguments& arguments, Invocation& invocation) {
  const int threads = arguments.options.threads;
  bench::pin_threads(threads, invocation.arguments);
  const RobotModel robot = load_robot(arguments.robot);
  const RobotSpace space(robot, joint_ranges(arguments, robot));
  CountProgress progress("information matrices of the grid");
  const InformationSet grid = robot_information_set(
      robot, space.inside(load_positions(arguments.robot, robot)), {.threads = threads});
  grid.validate();

  catch_interrupts();
  progress.begin("round", static_cast<std::size_t>(std::max(0, arguments.options.round_limit)),
                 CountProgress::Total::kAtMost);
  const auto start = std::chrono::steady_clock::now();
  Outcome outcome;
  outcome.dimension = static_cast<double>(grid.dimension());
  outcome.result =
      solve_continuous(space, grid, arguments.options, [&](const ContinuousRound& round) {
        return progress.update(static_cast<std::size_t>(round.round));
      });
  if (outcome.result.weights.empty()) {
    stop_if_requested();
    throw InputError("the grid has no regular design: give more positions");
  }
  const DesignedSet designed = grid_and_support(space, grid, outcome.result);
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  judge_continuous(arguments, designed, seconds.count(), outcome);
  compare_continuous(arguments, robot, space, progress, outcome);
  progress.clear();
  write_continuous(arguments, grid, designed, outcome);
  if (arguments.json) {
    fmt::print("{}\n", to_json(outcome).dump());
  } else {
    print(arguments, grid, outcome);
  }
  return outcome.report.status == ReportStatus::kSolved && !outcome.interrupted ? kDone : kShort;
}

constexpr const char* kContinuousFooter =
    "Status solved (exit code 0): three rounds of searches found no sensitivity above d (1 + "
    "gap),\n"
    "and the checker certified the design over grid and support. Ctrl-C keeps the best design so "
    "far\n"
    "(exit code 1).\n"
    "Examples:\n"
    "  graybox design continuous -o design.json --set set.h5 && graybox check set.h5 "
    "design.json\n"
    "  graybox design continuous --limits urdf --joint-limit q4=0:0 --joint-limit q6=0:0\n"
    "  graybox design continuous --refined 10000,1000000 --refinement 1000,7920,146475 "
    "--tables continuous";

void add_continuous_options(CLI::App* command, ContinuousArguments* arguments) {
  ContinuousOptions& options = arguments->options;
  add_robot_options(*command, arguments->robot);
  command->add_option("--gap", options.duality_gap, "largest sensitivity to reach, over d, minus 1")
      ->capture_default_str();
  command
      ->add_option("--limits", arguments->limits,
                   "paper: the ranges of the paper's grid; urdf: those of the robot's joints")
      ->check(CLI::IsMember({"paper", "urdf"}))
      ->capture_default_str();
  command->add_option("--joint-limit", arguments->joint_limits,
                      "limits of one joint, degrees, such as q2=-60:90; may be repeated");
  command->add_option("--starts", options.grid_starts, "searches from the grid in each round")
      ->capture_default_str();
  command
      ->add_option("--random-points", options.random_points,
                   "fresh random points priced in each round, for starts beside the grid's")
      ->capture_default_str();
  command->add_option("--rounds", options.round_limit, "rounds at most")->capture_default_str();
  command
      ->add_option("--refined", arguments->refined,
                   "price so many more points with the final design, for a bound on the box; "
                   "several counts separated by commas")
      ->delimiter(',')
      ->capture_default_str();
  command
      ->add_option("--refinement", arguments->refinement,
                   "also the optimum on grids of so many points, separated by commas")
      ->delimiter(',');
  command
      ->add_option("--samples", arguments->samples,
                   "robots with other stiffness, for each row of X_sensitivity.csv")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--seed", options.seed, "of the random starts")->capture_default_str();
  add_threads(*command, options.threads);
  command->add_option("-o,--output", arguments->output,
                      "write the design as JSON, for the set that --set writes");
  command->add_option("--set", arguments->set,
                      "write the information set of the grid and the support behind it");
  command->add_option("--tables", arguments->tables,
                      "write X_support.csv, X_rounds.csv, X_bound.csv, X_refinement.csv, and\n"
                      "X_sensitivity.csv: both designs where the stiffness is off");
  command->add_flag("--json", arguments->json, "print one machine-readable line");
}

}  // namespace

void add_design_continuous_command(CLI::App& design, Invocation& invocation) {
  auto* command = design.add_subcommand(
      "continuous", "Positions off the grid: joint angles by local search under joint limits");
  auto arguments = std::make_shared<ContinuousArguments>();
  add_continuous_options(command, arguments.get());
  command->footer(kContinuousFooter);
  command->callback([arguments, &invocation] {
    invocation.exit_code = design_continuous(*arguments, invocation);
  });
}

}  // namespace graybox::cli
