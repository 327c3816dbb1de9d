#include "tests/hostile_sets/hostile_run.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <optional>

#include "problems/base/error.hpp"
#include "problems/information/semidefinite_projection.hpp"
#include "tests/hostile_sets/hostile_sets.hpp"

namespace graybox::testing_sets {
namespace {

constexpr std::array kGaps{1e-6, 1e-9};
constexpr std::string_view kDefault = "column_generation";

// Enough for most, and the same on every machine; the clock is for what does not count iterations.
SolveOptions options_for(double gap) {
  return {.duality_gap = gap, .time_limit = 2.0, .iteration_limit = 20000};
}

std::optional<InformationSet> accepted(InformationSet set) {
  try {
    return project_semidefinite(std::move(set)).set;
  } catch (const InputError&) {
    return {};
  }
}

HostileVerdict run(const InformationSet& set, const Solver& solver, double gap,
                   HostileTally& tally) {
  const SolveOptions options = options_for(gap);
  const Solution solution = solver.solve(set, options);
  const SolveReport report = judge(set, solver.name(), options, solution);
  const Certificate& certificate = report.certificate;
  HostileVerdict verdict{.kind = set.name(),
                         .solver = std::string(solver.name()),
                         .asked = gap,
                         .status = report.status,
                         .checked_gap = certificate.duality_gap,
                         .rounding_bound = certificate.rounding_bound,
                         .true_gap = true_gap(set, solution.design)};
  const bool solved = report.status == ReportStatus::kSolved;
  ++tally.verdicts;
  tally.seconds += solution.counters.seconds;
  tally.solved += solved ? 1U : 0U;
  tally.falsely_solved += solved && !(verdict.true_gap <= gap) ? 1U : 0U;
  tally.withdrawn_claims += !solved && solution.status == SolveStatus::kSolved ? 1U : 0U;
  if (certificate.status == CertificateStatus::kCertified &&
      !(std::abs(verdict.true_gap - certificate.duality_gap) <= certificate.rounding_bound)) {
    ++tally.outside_bound;
  }
  return verdict;
}

}  // namespace

HostileDraw run_hostile_sets(std::uint64_t seed, std::size_t verdicts,
                             const std::function<void(const HostileVerdict&)>& each) {
  const SolverRegistry registry = make_registry();
  Random random(seed);
  HostileDraw draw;
  for (std::size_t n = 0; draw.verdicts < verdicts; ++n) {
    const auto set = accepted(hostile_set(n % hostile_kinds().size(), random));
    ++draw.sets;
    if (!set) {
      ++draw.refused;
      continue;
    }
    for (const double gap : kGaps) {
      bool solvable = false, by_default = false;
      for (const auto& entry : registry.entries()) {
        if (entry.solver == nullptr) continue;
        HostileVerdict verdict = run(*set, *entry.solver, gap, draw.tally[{entry.name, gap}]);
        verdict.set = n;
        ++draw.verdicts;
        if (each) each(verdict);
        const bool solved = verdict.status == ReportStatus::kSolved;
        solvable = solvable || solved;
        by_default = by_default || (solved && entry.name == kDefault);
      }
      draw.solvable += solvable ? 1U : 0U;
      draw.solved_by_default += by_default ? 1U : 0U;
    }
  }
  return draw;
}

std::string describe(const HostileDraw& draw) {
  std::string text = fmt::format(
      "{} sets, {} refused, {} verdicts; {} of set and gap solved by some back-end, {} by {}\n"
      "{:<30} {:>6} {:>9} {:>7} {:>6} {:>8} {:>10} {:>8}\n",
      draw.sets, draw.refused, draw.verdicts, draw.solvable, draw.solved_by_default, kDefault,
      "back-end", "gap", "verdicts", "solved", "false", "outside", "withdrawn", "seconds");
  for (const auto& [key, tally] : draw.tally) {
    text += fmt::format("{:<30} {:>6.0e} {:>9} {:>7} {:>6} {:>8} {:>10} {:>8.1f}\n", key.first,
                        key.second, tally.verdicts, tally.solved, tally.falsely_solved,
                        tally.outside_bound, tally.withdrawn_claims, tally.seconds);
  }
  return text;
}

}  // namespace graybox::testing_sets
