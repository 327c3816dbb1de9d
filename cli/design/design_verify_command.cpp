// `graybox design verify`: does a design deliver the covariance that it promises? Simulated
// experiments, fitted, many times (diagnosis/studies/efficiency_study.hpp).
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "bench/pin_threads.hpp"
#include "bench/study/row_file.hpp"
#include "cli/arguments/robot_arguments.hpp"
#include "cli/arguments/threads_argument.hpp"
#include "cli/arguments/time_limit_argument.hpp"
#include "cli/commands/commands.hpp"
#include "cli/output/console.hpp"
#include "cli/process/interrupt.hpp"
#include "diagnosis/studies/efficiency_study.hpp"
#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "problems/base/sha256.hpp"
#include "problems/base/stop.hpp"
#include "problems/files/atomic_file.hpp"
#include "problems/files/files_together.hpp"
#include "problems/robot_information/robot_information.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/core/inverse_cholesky.hpp"
#include "solvers/exact/efficient_rounding.hpp"
#include "solvers/report/design_file.hpp"

namespace graybox::cli {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

struct VerifyArguments {
  RobotArguments robot;
  std::string design;
  std::int64_t experiments = 20;
  int repetitions = 500;
  int recordings = 30;
  double noise = 1e-6;
  std::uint64_t seed = 1;
  int threads = 1;
  std::string output;
  bool json = false;
};

constexpr const char* kSingle = "best_single_position";
constexpr const char* kRandom = "random_positions";

// ---- the designs --------------------------------------------------------------------------------

StudiedDesign design_of(const std::string& name, const PositionTable& positions,
                        const std::vector<std::int64_t>& counts) {
  StudiedDesign design;
  design.name = name;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] == 0) continue;
    const auto degrees = positions.position(i);
    Eigen::VectorXd angles(static_cast<Eigen::Index>(degrees.size()));
    std::ranges::transform(degrees, angles.begin(),
                           [](double angle) { return angle * std::numbers::pi / 180.0; });
    design.positions.push_back(angles);
    design.experiments.push_back(counts[i]);
  }
  return design;
}

Design relaxed_design(const VerifyArguments& arguments, const InformationSet& set) {
  if (!arguments.design.empty()) return read_design(arguments.design, set).design;
  return ColumnGeneration().solve(set, {.duality_gap = 1e-9}).design;
}

std::vector<std::int64_t> best_single(const InformationSet& set, std::int64_t experiments) {
  InverseCholesky inverse(set.dimension());
  std::size_t best = 0;
  for (std::size_t i = 1; i < set.candidate_count(); ++i) {
    const bool better =
        inverse.log_det_of(set.information(i)) > inverse.log_det_of(set.information(best));
    if (better) best = i;
  }
  std::vector<std::int64_t> counts(set.candidate_count(), 0);
  counts[best] = experiments;
  return counts;
}

// As many positions as the design has, all different, with equal experiments.
std::vector<std::int64_t> random_positions(std::size_t candidates, std::size_t count,
                                           const VerifyArguments& arguments) {
  Random random(arguments.seed);
  std::vector<double> weights(candidates, 0.0);
  for (std::size_t chosen = 0; chosen < count;) {
    double& weight = weights[random.below(candidates)];
    if (weight > 0.0) continue;
    weight = 1.0 / static_cast<double>(count);
    ++chosen;
  }
  return round_weights_efficiently(weights, arguments.experiments);
}

// The design, the best single position and random positions.
using StudyDesigns = std::vector<StudiedDesign>;

StudyDesigns make_designs(const VerifyArguments& arguments, const RobotModel& robot) {
  const PositionTable positions = load_positions(arguments.robot, robot);
  const CountProgress progress(
      fmt::format("information matrices of {} positions and their design", positions.count()));
  const InformationSet set =
      robot_information_set(robot, positions, {.threads = arguments.threads});
  const Design relaxed = relaxed_design(arguments, set);
  const auto counts = round_weights_efficiently(relaxed.weights, arguments.experiments);
  StudyDesigns result;
  const std::string name =
      arguments.design.empty() ? "optimal" : fs::path(arguments.design).stem().string();
  result.push_back(design_of(name, positions, counts));
  const std::size_t support = result.front().positions.size();
  result.push_back(design_of(kSingle, positions, best_single(set, arguments.experiments)));
  result.push_back(
      design_of(kRandom, positions, random_positions(set.candidate_count(), support, arguments)));
  return result;
}

// ---- rows ---------------------------------------------------------------------------------------

std::vector<double> packed(const Eigen::MatrixXd& symmetric) {
  const auto dimension = static_cast<std::size_t>(symmetric.rows());
  std::vector<double> values(packed_size(dimension));
  pack(symmetric.data(), dimension, values.data());
  return values;
}

nlohmann::json json_of(const EstimateRow& row) {
  return {{"data", to_string(row.data)},
          {"design", row.design},
          {"repetition", row.repetition},
          {"status", to_string(row.status)},
          {"chi_square", row.chi_square},
          {"degrees_of_freedom", row.degrees_of_freedom},
          {"error_chi_square", row.error_chi_square},
          {"theta", std::vector<double>(row.theta.begin(), row.theta.end())},
          {"covariance", packed(row.covariance)}};
}

Eigen::VectorXd vector_of(const nlohmann::json& json) {
  const auto values = json.get<std::vector<double>>();
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

EstimateRow row_of(const nlohmann::json& json) {
  EstimateRow row;
  row.data = json.at("data") == to_string(StudyData::kResponses) ? StudyData::kResponses
                                                                 : StudyData::kRecordings;
  row.design = json.at("design").get<std::string>();
  row.repetition = json.at("repetition").get<int>();
  for (const FitStatus status : {FitStatus::kConverged, FitStatus::kIterationLimit,
                                 FitStatus::kSingular, FitStatus::kFailed}) {
    if (json.at("status") == to_string(status)) row.status = status;
  }
  row.chi_square = json.at("chi_square").get<double>();
  row.degrees_of_freedom = json.at("degrees_of_freedom").get<std::size_t>();
  row.error_chi_square = json.at("error_chi_square").get<double>();
  row.theta = vector_of(json.at("theta"));
  const auto covariance = json.at("covariance").get<std::vector<double>>();
  if (!covariance.empty()) {
    row.covariance.resize(row.theta.size(), row.theta.size());
    unpack(covariance.data(), static_cast<std::size_t>(row.theta.size()), row.covariance.data());
  }
  return row;
}

// Rows of studies with another model, design, noise or seed do not belong together.
std::string identity_of(const VerifyArguments& arguments, const StudyDesigns& study,
                        const EfficiencyStudy& efficiency) {
  Sha256 hash;
  std::string text = fmt::format("rows/2 {} {}", arguments.seed, arguments.noise);
  for (const StudiedDesign& design : study) {
    text += fmt::format(" {} {}", design.name, fmt::join(design.experiments, ","));
    const Eigen::MatrixXd covariance =
        efficiency.predicted_covariance(design, StudyData::kRecordings);
    text += fmt::format(" {:.6g}", fmt::join(covariance.diagonal(), ","));
  }
  hash.update(text);
  return hash.hexadecimal();
}

class Rows {
 public:
  Rows(const fs::path& file, const std::string& identity) : file_(file) {
    std::ifstream stream(file);
    bool first = true;
    for (std::string line; std::getline(stream, line);) {
      const nlohmann::json json = nlohmann::json::parse(line, nullptr, false);
      if (json.is_discarded()) continue;  // torn by a kill
      if (first && json.value("identity", "") != identity) {
        throw InputError(file.string() +
                         ": holds estimates of another study; remove it or use another folder");
      }
      if (!first) rows_.push_back(row_of(json));
      first = false;
    }
    if (first) file_.append({{"identity", identity}});
  }

  void add(const EstimateRow& row) {
    file_.append(json_of(row));
    rows_.push_back(row);
  }

  [[nodiscard]] const std::vector<EstimateRow>& all() const { return rows_; }

 private:
  bench::RowFile file_;
  std::vector<EstimateRow> rows_;
};

// Recordings take much longer than responses and test the estimator, not the choice of positions;
// the random positions are for comparison alone.
int planned(const VerifyArguments& arguments, const StudiedDesign& design, StudyData data) {
  const bool compared = design.name == kSingle || design.name == kRandom;
  if (data == StudyData::kRecordings) return compared ? 0 : arguments.recordings;
  return design.name == kRandom ? arguments.repetitions / 5 : arguments.repetitions;
}

std::vector<StudyTask> open_tasks(const VerifyArguments& arguments, const StudyDesigns& study,
                                  const std::vector<EstimateRow>& rows) {
  std::set<std::tuple<StudyData, std::string, int>> done;
  for (const EstimateRow& row : rows) done.emplace(row.data, row.design, row.repetition);
  std::vector<StudyTask> tasks;
  for (const StudyData data : {StudyData::kRecordings, StudyData::kResponses}) {
    for (const StudiedDesign& design : study) {
      const int count = planned(arguments, design, data);
      for (int repetition = 0; repetition < count; ++repetition) {
        if (!done.contains({data, design.name, repetition})) {
          tasks.push_back({&design, data, repetition});
        }
      }
    }
  }
  return tasks;
}

// Adds the rows of the tasks as they are finished. Recordings and responses, which take very
// different times, are counted apart. False where the work was stopped.
bool run_tasks(const EfficiencyStudy& efficiency, const std::vector<StudyTask>& tasks, int threads,
               Rows& rows) {
  for (const StudyData data : {StudyData::kRecordings, StudyData::kResponses}) {
    std::vector<StudyTask> part;
    std::ranges::copy_if(tasks, std::back_inserter(part),
                         [&](const StudyTask& task) { return task.data == data; });
    if (part.empty()) continue;
    CountProgress progress(fmt::format("fit of {}", to_string(data)), part.size());
    std::size_t done = 0;
    try {
      run_efficiency_study(efficiency, part, threads, [&](const EstimateRow& row) {
        rows.add(row);
        return progress.update(++done);
      });
    } catch (const Stopped&) {  // in the middle of a fit; the finished ones stand
    }
    if (done < part.size()) return false;
  }
  return true;
}

// ---- tables -------------------------------------------------------------------------------------

std::string cells(const Interval& interval) {
  return fmt::format(",{:.6g},{:.6g},{:.6g}", interval.estimate, interval.lower, interval.upper);
}

double determinant_root(const Eigen::MatrixXd& covariance) {
  const Eigen::MatrixXd factor = covariance.llt().matrixL();
  return std::exp(2.0 * factor.diagonal().array().log().mean());
}

std::string covariance_table(const std::vector<StudySummary>& summaries) {
  std::string text =
      "data,design,estimates,rejected,predicted_covariance,determinant,determinant_lower,"
      "determinant_upper,trace,trace_lower,trace_upper,trace_p_value,bias_p_value,coverage,"
      "coverage_lower,coverage_upper,stated_covariance,against_stated,against_stated_lower,"
      "against_stated_upper,trace_against_stated,trace_against_stated_lower,"
      "trace_against_stated_upper\n";
  for (const StudySummary& each : summaries) {
    text += fmt::format("{},{},{},{},{:.6g}", to_string(each.data), each.design,
                        each.statistics.estimates, each.rejected, determinant_root(each.predicted));
    text += cells(each.statistics.determinant) + cells(each.statistics.trace);
    text +=
        fmt::format(",{:.6g},{:.6g}", each.statistics.trace_p_value, each.statistics.bias_p_value);
    text += cells(each.ellipsoid_coverage);
    text += fmt::format(",{:.6g}", determinant_root(each.stated));
    text += cells(each.against_stated.determinant) + cells(each.against_stated.trace) + "\n";
  }
  return text;
}

std::string parameter_table(const std::vector<StudySummary>& summaries,
                            const std::vector<std::string>& names) {
  std::string text =
      "data,design,parameter,predicted_standard_error,variance_ratio,variance_ratio_lower,"
      "variance_ratio_upper,bias,coverage,coverage_lower,coverage_upper\n";
  for (const StudySummary& each : summaries) {
    for (std::size_t p = 0; p < names.size(); ++p) {
      const auto at = static_cast<Eigen::Index>(p);
      text += fmt::format("{},{},{},{:.6g}", to_string(each.data), each.design, names[p],
                          std::sqrt(each.predicted(at, at)));
      text += cells(each.statistics.variances[p]);
      text += fmt::format(",{:.6g}", each.statistics.bias(at));
      text += cells(each.parameter_coverage[p]) + "\n";
    }
  }
  return text;
}

std::string eigenvalue_table(const std::vector<StudySummary>& summaries) {
  std::string text = "data,design,number,eigenvalue,lower,upper\n";
  for (const StudySummary& each : summaries) {
    const EfficiencyStatistics& found = each.statistics;
    for (Eigen::Index k = 0; k < found.eigenvalues.size(); ++k) {
      text +=
          fmt::format("{},{},{},{:.6g},{:.6g},{:.6g}\n", to_string(each.data), each.design, k + 1,
                      found.eigenvalues(k), found.eigenvalues_lower(k), found.eigenvalues_upper(k));
    }
  }
  return text;
}

struct Comparison {
  StudyData data;
  std::string design;  // whose covariance is over that of the first design
  double predicted = 0.0;
  Eigen::VectorXd predicted_variances;
  CovarianceRatio measured;
};

std::vector<Comparison> compare(const std::vector<StudySummary>& summaries) {
  std::vector<Comparison> comparisons;
  const StudySummary* first = nullptr;
  for (const StudySummary& each : summaries) {
    if (first == nullptr || first->data != each.data) {
      first = &each;
      continue;
    }
    comparisons.push_back({each.data, each.design,
                           determinant_root(each.predicted) / determinant_root(first->predicted),
                           each.predicted.diagonal().cwiseQuotient(first->predicted.diagonal()),
                           compare_covariances(first->estimates, each.estimates)});
  }
  return comparisons;
}

std::string ratio_table(const std::vector<Comparison>& comparisons,
                        const std::vector<std::string>& names) {
  std::string text = "data,design,quantity,predicted,measured,lower,upper\n";
  for (const Comparison& each : comparisons) {
    const std::string head = fmt::format("{},{}", to_string(each.data), each.design);
    text += fmt::format("{},determinant,{:.6g}", head, each.predicted) +
            cells(each.measured.determinant) + "\n";
    for (std::size_t p = 0; p < names.size(); ++p) {
      text += fmt::format("{},{},{:.6g}", head, names[p],
                          each.predicted_variances(static_cast<Eigen::Index>(p))) +
              cells(each.measured.variances[p]) + "\n";
    }
  }
  return text;
}

std::string estimate_table(const std::vector<StudySummary>& summaries,
                           const std::vector<std::string>& names) {
  std::string text = "data,design";
  for (const std::string& name : names) text += "," + name;
  text += "\n";
  for (const StudySummary& each : summaries) {
    for (Eigen::Index k = 0; k < each.estimates.rows(); ++k) {
      text += fmt::format("{},{}", to_string(each.data), each.design);
      for (const double value : each.estimates.row(k)) text += fmt::format(",{:.8g}", value);
      text += "\n";
    }
  }
  return text;
}

std::string design_table(const StudyDesigns& study, std::size_t joints) {
  std::string text = "design,experiments";
  for (std::size_t j = 1; j <= joints; ++j) text += fmt::format(",q{}", j);
  text += "\n";
  for (const StudiedDesign& design : study) {
    for (std::size_t i = 0; i < design.positions.size(); ++i) {
      text += fmt::format("{},{}", design.name, design.experiments[i]);
      for (const double angle : design.positions[i]) {
        text += fmt::format(",{:.6g}", angle * 180.0 / std::numbers::pi);
      }
      text += "\n";
    }
  }
  return text;
}

void write_tables(const fs::path& folder, const StudyDesigns& study,
                  const std::vector<StudySummary>& summaries,
                  const std::vector<Comparison>& comparisons,
                  const std::vector<std::string>& names) {
  FilesTogether files;
  const auto write = [&](const char* name, const std::string& text) {
    write_text_file((folder / name).string(), text);
  };
  write("verify_designs.csv",
        design_table(study, static_cast<std::size_t>(study.front().positions.front().size())));
  write("verify_covariance.csv", covariance_table(summaries));
  write("verify_parameters.csv", parameter_table(summaries, names));
  write("verify_eigenvalues.csv", eigenvalue_table(summaries));
  write("verify_ratios.csv", ratio_table(comparisons, names));
  write("verify_estimates.csv", estimate_table(summaries, names));
  files.commit();
}

std::string range(const Interval& interval) {
  return fmt::format("{:.3f} ({:.3f} to {:.3f})", interval.estimate, interval.lower,
                     interval.upper);
}

std::string text_of(const std::vector<StudySummary>& summaries,
                    const std::vector<Comparison>& comparisons) {
  std::string text = fmt::format(
      "measured covariance over the predicted one (95 % interval): 1 where the estimator is "
      "efficient\n{:<11} {:<21} {:>5}  {:<25} {:<25} {:>7}  {}\n",
      "data", "design", "fits", "determinant^(1/d)", "trace", "bias p", "coverage of 95 % region");
  for (const StudySummary& each : summaries) {
    text += fmt::format("{:<11} {:<21} {:>5}  {:<25} {:<25} {:>7.3f}  {}{}\n", to_string(each.data),
                        each.design, each.statistics.estimates, range(each.statistics.determinant),
                        range(each.statistics.trace), each.statistics.bias_p_value,
                        range(each.ellipsoid_coverage),
                        each.rejected > 0 ? fmt::format("  {} rejected", each.rejected) : "");
  }
  text += "the same over what the fits themselves state, and that over the prediction\n";
  for (const StudySummary& each : summaries) {
    text += fmt::format("{:<11} {:<21} {:>5}  {:<25} {:<25} {:>7.3f}\n", to_string(each.data),
                        each.design, "", range(each.against_stated.determinant),
                        range(each.against_stated.trace),
                        determinant_root(each.stated) / determinant_root(each.predicted));
  }
  text += "covariance^(1/d) over that of the first design, with as many experiments\n";
  for (const Comparison& each : comparisons) {
    text += fmt::format("{:<11} {:<21} predicted {:.3f}, measured {}\n", to_string(each.data),
                        each.design, each.predicted, range(each.measured.determinant));
  }
  return text;
}

Json json_of(const Interval& interval) {
  return {{"estimate", interval.estimate}, {"lower", interval.lower}, {"upper", interval.upper}};
}

Json json_of(const VerifyArguments& arguments, const std::vector<StudySummary>& summaries,
             const std::vector<Comparison>& comparisons, bool complete) {
  Json json{{"command", "design verify"}, {"experiments", arguments.experiments},
            {"noise", arguments.noise},   {"seed", arguments.seed},
            {"complete", complete},       {"summary", Json::array()},
            {"ratios", Json::array()}};
  for (const StudySummary& each : summaries) {
    json["summary"].push_back({{"data", to_string(each.data)},
                               {"design", each.design},
                               {"estimates", each.statistics.estimates},
                               {"rejected", each.rejected},
                               {"determinant", json_of(each.statistics.determinant)},
                               {"trace", json_of(each.statistics.trace)},
                               {"bias_p_value", each.statistics.bias_p_value},
                               {"stated_over_predicted",
                                determinant_root(each.stated) / determinant_root(each.predicted)},
                               {"against_stated", json_of(each.against_stated.determinant)},
                               {"coverage", json_of(each.ellipsoid_coverage)}});
  }
  for (const Comparison& each : comparisons) {
    json["ratios"].push_back({{"data", to_string(each.data)},
                              {"design", each.design},
                              {"predicted", each.predicted},
                              {"measured", json_of(each.measured.determinant)}});
  }
  return json;
}

void check(const VerifyArguments& arguments) {
  if (!(arguments.noise > 0.0) || !std::isfinite(arguments.noise)) {
    throw InputError(fmt::format("--noise: must be positive, is {}", arguments.noise));
  }
  if (arguments.output.empty()) throw InputError("-o: needs a folder for rows and tables");
}

int verify(const VerifyArguments& arguments, Invocation& invocation) {
  check(arguments);
  bench::pin_threads(arguments.threads, invocation.arguments);
  RobotModel robot = load_robot(arguments.robot);
  robot.velocity_psd_slope *= arguments.noise;
  const StudyDesigns study = make_designs(arguments, robot);
  const EfficiencyStudy efficiency(robot, {.seed = arguments.seed});
  for (const StudiedDesign& design : study) {
    for (const StudyData data : {StudyData::kResponses, StudyData::kRecordings}) {
      const int count = planned(arguments, design, data);
      const std::size_t d = robot.parameters.size();
      if (count == 0 || static_cast<std::size_t>(count) > d + 1) continue;
      throw InputError(fmt::format(
          "--repetitions, --recordings: {} fits of {} are too few for the covariance of {} "
          "parameters; 0, or more than {}",
          count, design.name, d, design.name == kRandom ? 5 * (d + 2) - 1 : d + 1));
    }
  }
  fs::create_directories(arguments.output);
  Rows rows(fs::path(arguments.output) / "verify_rows.jsonl",
            identity_of(arguments, study, efficiency));
  const std::vector<StudyTask> tasks = open_tasks(arguments, study, rows.all());
  catch_interrupts(OnStop::kLosesNothing);
  if (!run_tasks(efficiency, tasks, arguments.threads, rows)) {
    fmt::print(stderr, "graybox: {} after {} fits; the same command goes on from here\n",
               interrupted() ? "interrupted" : "stopped by the time limit", rows.all().size());
    return kShort;
  }
  std::vector<StudySummary> summaries;
  for (const StudyData data : {StudyData::kResponses, StudyData::kRecordings}) {
    for (const StudiedDesign& design : study) {
      if (planned(arguments, design, data) == 0) continue;
      summaries.push_back(summarise(efficiency, design, data, rows.all()));
    }
  }
  const std::vector<Comparison> comparisons = compare(summaries);
  write_tables(arguments.output, study, summaries, comparisons, robot.parameter_names());
  if (arguments.json) {
    fmt::print("{}\n", json_of(arguments, summaries, comparisons, true).dump());
  } else {
    fmt::print("{}wrote the tables {}/verify_*.csv\n", text_of(summaries, comparisons),
               arguments.output);
  }
  return kDone;
}

}  // namespace

void add_design_verify_command(CLI::App& design, Invocation& invocation) {
  auto* command = design.add_subcommand(
      "verify", "Simulate and fit many times: does a design deliver the covariance it promises?");
  auto arguments = std::make_shared<VerifyArguments>();
  add_robot_options(*command, arguments->robot);
  command->add_option("--design", arguments->design,
                      "graybox-design/1 file of these positions (default: the D-optimum)");
  command->add_option("--experiments", arguments->experiments, "in all, of each design")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  command
      ->add_option("--repetitions", arguments->repetitions,
                   "fits of simulated frequency responses, of each design")
      ->check(CLI::Range(0, 1000000))
      ->capture_default_str();
  command
      ->add_option("--recordings", arguments->recordings,
                   "campaigns simulated in the time domain, of the design itself")
      ->check(CLI::Range(0, 1000000))
      ->capture_default_str();
  command
      ->add_option("--noise", arguments->noise,
                   "factor on C_v of the model file; 1e-6: one optimally placed experiment has a\n"
                   "standard deviation of about 0.1 %")
      ->capture_default_str();
  command->add_option("--seed", arguments->seed, "of noise, phases, starts and random positions")
      ->capture_default_str();
  add_threads(*command, arguments->threads);
  command->add_option("-o,--output", arguments->output, "folder for rows and tables");
  add_time_limit(*command, OnStop::kLosesNothing);
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "Beside the design: the best single position and random positions, with as many "
      "experiments.\n"
      "Ctrl-C keeps the fits that are finished (exit code 1); the same command goes on from "
      "there.\n"
      "Examples:\n"
      "  graybox design verify -o verify\n"
      "  graybox design verify --grid 500 --repetitions 50 --recordings 0 -o quick --json\n"
      "  graybox design verify --design robust.json --noise 1e-2 -o verify_robust");
  command->callback(
      [arguments, &invocation] { invocation.exit_code = verify(*arguments, invocation); });
}

}  // namespace graybox::cli
