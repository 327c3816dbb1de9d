// `graybox ellipsoid`: the smallest ellipsoid around points, with proof.
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "bench/pin_threads.hpp"
#include "cli/arguments/threads_argument.hpp"
#include "cli/commands/commands.hpp"
#include "cli/ellipsoid/ellipsoid_text.hpp"
#include "cli/process/interrupt.hpp"
#include "problems/files/atomic_file.hpp"
#include "solvers/ellipsoid/ellipsoid_file.hpp"
#include "solvers/ellipsoid/outlier_peeling.hpp"
#include "solvers/report/solve_report.hpp"

namespace graybox::cli {
namespace {

struct EllipsoidArguments {
  std::string points;
  std::string checked;
  EllipsoidOptions options;
  std::size_t drop = 0;
  std::string output;
  bool json = false;
};

PointSet read_points(const EllipsoidArguments& arguments) {
  const ReadingLimit limit(arguments.options.time_limit, arguments.points);
  return point_set(read_number_table(arguments.points), arguments.options.centred);
}

int solve_ellipsoid(const EllipsoidArguments& arguments) {
  const PointSet points = read_points(arguments);
  if (!arguments.output.empty()) require_writable(arguments.output);
  catch_interrupts();
  const PeeledEllipsoid found = peeled_ellipsoid(points, arguments.options, arguments.drop);
  nlohmann::ordered_json file = ellipsoid_json(points, arguments.options, found);
  if (!arguments.output.empty()) write_text_file(arguments.output, file.dump(1) + "\n");
  if (arguments.json) {
    file["peak_memory_bytes"] = peak_memory_bytes();
    fmt::print("{}\n", file.dump());
  } else {
    fmt::print("{}: {}\n{}{}{}", points.path, describe_points(points),
               describe_ellipsoid(points, arguments.options, found.solution),
               describe_dropped(points, found.dropped), describe_contact(points, found.solution));
    if (!arguments.output.empty()) fmt::print("wrote {}\n", arguments.output);
  }
  return found.solution.status == EllipsoidStatus::kSolved ? kDone : kShort;
}

// What the file says was dropped is left out of the points, and the support counts the others.
void leave_out_dropped(PointSet& points, EllipsoidFile& file) {
  if (file.dropped.empty()) return;
  RemainingPoints rest = points_without(points, file.dropped);
  for (std::size_t& i : file.support.indices) {
    i = static_cast<std::size_t>(std::ranges::lower_bound(rest.indices, i) - rest.indices.begin());
  }
  points = std::move(rest.points);
}

// Where the file has no weights, the bound comes from those of the smallest ellipsoid found here.
int check_ellipsoid(const EllipsoidArguments& arguments) {
  EllipsoidOptions options = arguments.options;
  PointSet points = read_points(arguments);
  EllipsoidFile file = read_ellipsoid(arguments.checked, points);
  leave_out_dropped(points, file);
  options.centred = options.centred || file.centred;
  catch_interrupts();
  const bool own_weights = file.support.indices.empty();
  if (own_weights) file.support = smallest_ellipsoid(points, options).support;
  const EllipsoidCertificate certificate =
      certify_ellipsoid(points, file.ellipsoid, file.support, options.centred, options.threads);
  if (arguments.json) {
    fmt::print("{}\n", nlohmann::ordered_json{{"contains_all", certificate.contains_all()},
                                              {"largest_distance", certificate.largest_distance},
                                              {"farthest", certificate.farthest},
                                              {"dropped", file.dropped.size()},
                                              {"log_volume", certificate.log_volume},
                                              {"volume_bound", certificate.volume_bound},
                                              {"rounding_bound", certificate.rounding_bound},
                                              {"asked_gap", options.gap}}
                           .dump());
  } else {
    fmt::print("{}: {}\n{}", points.path, describe_points(points),
               describe_check(points, options.gap, certificate));
    if (!file.dropped.empty()) {
      fmt::print("  dropped       {}, as the file says; not counted here\n", file.dropped.size());
    }
    if (own_weights) fmt::print("  weights       of 'graybox ellipsoid', for the file has none\n");
  }
  return certificate.contains_all() && certificate.volume_bound <= options.gap ? kDone : kShort;
}

}  // namespace

void add_ellipsoid_command(CLI::App& app, Invocation& invocation) {
  auto* command =
      app.add_subcommand("ellipsoid", "The smallest ellipsoid around points, with a bound");
  auto arguments = std::make_shared<EllipsoidArguments>();
  EllipsoidOptions& options = arguments->options;
  command
      ->add_option("points", arguments->points,
                   "points: a CSV file, one a line, with or without header; or .npy [Q x n]")
      ->required();
  command->add_flag("--centred", options.centred, "hold the centre at the origin");
  command
      ->add_option("--gap", options.gap,
                   "proven: volume at most 1 + gap times that of the smallest")
      ->capture_default_str();
  command->add_option(
      "--drop", arguments->drop,
      "leave out this many points, each time the one that holds the ellipsoid most");
  command->add_option("--check", arguments->checked,
                      "certify this ellipsoid: graybox-ellipsoid/1 JSON, whoever wrote it");
  command->add_option("--time-limit", options.time_limit, "wall seconds (default: none)");
  add_threads(*command, options.threads);
  command->add_option("--seed", options.seed, "of the samples to start from")
      ->capture_default_str();
  command->add_option("-o,--output", arguments->output, "write the ellipsoid as JSON");
  command->add_flag("--json", arguments->json, "print one machine-readable line");
  command->footer(
      "The ellipsoid contains every point, rounding included, whatever the status. Exit code 1: "
      "the\n"
      "bound on its volume is above --gap (time was up, or rounding); with --check also where a\n"
      "point is outside. Ctrl-C stops and keeps the best ellipsoid.\n"
      "Examples:\n"
      "  graybox ellipsoid points.csv -o ellipsoid.json\n"
      "  scripts/ellipsoid_plot points.csv ellipsoid.json ellipsoid.svg\n"
      "  graybox ellipsoid points.npy --gap 1e-9 --json\n"
      "  graybox ellipsoid residuals.csv --centred\n"
      "  graybox ellipsoid points.csv --drop 2\n"
      "  graybox ellipsoid points.csv --check ellipsoid.json");
  command->callback([arguments, &invocation] {
    bench::pin_threads(arguments->options.threads, invocation.arguments);
    invocation.exit_code =
        arguments->checked.empty() ? solve_ellipsoid(*arguments) : check_ellipsoid(*arguments);
  });
}

}  // namespace graybox::cli
