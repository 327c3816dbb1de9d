#include "cli/output/exact_table.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "cli/process/interrupt.hpp"
#include "problems/base/error.hpp"
#include "problems/files/atomic_file.hpp"
#include "solvers/exact/exact_certificate.hpp"

namespace graybox::cli {
namespace {

std::int64_t parse_count(std::string_view text) {
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || value < 1 ||
      value > kMostExperiments) {
    throw InputError(
        fmt::format("experiments: '{}' is no whole number from 1 to {}", text, kMostExperiments));
  }
  return value;
}

std::string cell(double value) { return std::isfinite(value) ? fmt::format("{:.9g}", value) : ""; }

struct Row {
  std::string covariances, efficiencies;  // of the methods, in order
  ExactCertificate best;                  // of branch_and_bound
  ExactSolution tree;
};

Row solve_row(const InformationSet& set, const Relaxation& relaxation, const ExactOptions& options,
              ExactObserver& observer) {
  Row row;
  std::vector<ExactSolution> solutions;
  for (const auto& method : exact_methods()) {
    solutions.push_back(method->solve(set, relaxation, options, &observer));
  }
  row.tree = solutions.back();
  // Held to the best bound there is, which is the tree's.
  for (const ExactSolution& solution : solutions) {
    row.best = certify_exact(set, solution.design, options.experiments, relaxation,
                             row.tree.log_det_bound);
    row.covariances += fmt::format(",{}", cell(row.best.covariance));
    row.efficiencies += fmt::format(",{}", cell(row.best.proven_efficiency));
  }
  return row;
}

std::string line(const Row& row, const Relaxation& relaxation, std::int64_t experiments) {
  const double relaxed =
      std::exp(-relaxation.log_det_bound(experiments) / static_cast<double>(relaxation.dimension));
  return fmt::format(
      "{},{}{},{}{},{},{},{},{},{:.4g},{},{}\n", experiments, cell(relaxed), row.covariances,
      cell(row.best.covariance_bound), row.efficiencies, cell(relaxed / row.best.covariance),
      row.tree.status == ExactStatus::kOptimal ? "yes" : "no", row.tree.survivors, row.tree.nodes,
      row.tree.seconds, cell(row.tree.seconds_to_mark), row.best.support_size);
}

std::string header() {
  std::string covariances, efficiencies;
  for (const auto& method : exact_methods()) {
    covariances += fmt::format(",{}", method->name());
    efficiencies += fmt::format(",{}_efficiency", method->name());
  }
  return "experiments,relaxed" + covariances + ",bound" + efficiencies +
         ",relaxed_efficiency,proven_optimal,survivors,nodes,seconds,seconds_to_99.5,support\n";
}

}  // namespace

std::vector<std::int64_t> parse_experiments(std::string_view text) {
  std::vector<std::int64_t> all;
  for (std::size_t from = 0; from <= text.size();) {
    const std::size_t comma = std::min(text.find(',', from), text.size());
    const std::string_view item = text.substr(from, comma - from);
    const std::size_t colon = item.find(':');
    const std::int64_t first = parse_count(item.substr(0, colon));
    const std::int64_t last =
        colon == std::string_view::npos ? first : parse_count(item.substr(colon + 1));
    for (std::int64_t value = first; value <= last; ++value) all.push_back(value);
    if (last < first) {
      throw InputError(fmt::format("experiments: the range '{}' is empty", item));
    }
    from = comma + 1;
  }
  return all;
}

bool write_exact_table(const std::string& path, const InformationSet& set,
                       const std::vector<std::int64_t>& experiments, ExactOptions options,
                       ExactObserver& observer) {
  options.experiments = experiments.front();
  require_exact_options(options);
  const Relaxation relaxation =
      solve_relaxation(set, {.seed = options.seed, .threads = options.threads});
  for (const std::int64_t m : experiments) {
    options.experiments = m;
    require_exact_problem(set, relaxation, options);
  }
  std::string text = header();
  for (const std::int64_t m : experiments) {
    options.experiments = m;
    const Row row = solve_row(set, relaxation, options, observer);
    if (interrupted()) break;
    text += line(row, relaxation, m);
    write_text_file(path, text);
  }
  return !interrupted();
}

}  // namespace graybox::cli
