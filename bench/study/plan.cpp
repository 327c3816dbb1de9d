#include "bench/study/plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <span>
#include <string_view>
#include <utility>

#include "problems/base/error.hpp"
#include "problems/base/random.hpp"

namespace graybox::bench {
namespace {

constexpr std::array<std::size_t, 8> kSizes{50, 100, 200, 500, 1000, 2000, 4000, kFullSize};
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::size_t kGigabyte = 1'000'000'000;
// The pair that shows what scaling is worth.
constexpr std::array kNormalisationFamilies{"robot", "robot_units"};
constexpr std::array kNormalisationPair{"dual_interior_point_unscaled", "dual_interior_point"};

// Solvers of the ablation experiments stay out of the comparison of back-ends.
bool is_ablation(const std::string& name) { return name == kNormalisationPair.front(); }

bool is_available(const SolverRegistry& registry, const std::string& name) {
  return std::ranges::any_of(registry.entries(), [&](const SolverRegistry::Entry& entry) {
    return entry.name == name && entry.solver != nullptr;
  });
}

std::vector<std::string> chosen_solvers(const StudyOptions& options,
                                        const SolverRegistry& registry) {
  std::vector<std::string> names;
  if (!options.solvers.empty()) {
    for (const std::string& name : options.solvers) {
      (void)registry.at(name);  // throws
      if (std::ranges::find(names, name) == names.end()) names.push_back(name);
    }
    for (const NamedProgram& program : options.programs) {
      if (std::ranges::find(names, program.name) == names.end()) names.push_back(program.name);
    }
    return names;
  }
  for (const auto& entry : registry.entries()) {
    if (entry.solver != nullptr && !is_ablation(entry.name)) names.push_back(entry.name);
  }
  return names;
}

void check(const StudyOptions& options) {
  const auto positive = [](const char* name, double value) {
    if (!(value > 0.0)) throw InputError(fmt::format("--{} {} must be positive", name, value));
  };
  positive("gap", options.duality_gap);
  if (options.time_limit) positive("time-limit", *options.time_limit);
  if (options.threads < 1) throw InputError("--threads must be at least 1");
  if (options.max_candidates < kSizes.front()) {
    throw InputError(fmt::format("--max-candidates {} is below the smallest set of {}",
                                 options.max_candidates, kSizes.front()));
  }
}

std::vector<StudyPoint> plan_of_own_sets(const StudyOptions& options,
                                         const std::vector<std::string>& solvers,
                                         const std::vector<OwnSetSize>& own) {
  std::vector<StudyPoint> plan;
  for (const OwnSetSize& set : own) {
    for (const std::string& solver : solvers) {
      plan.push_back({"own", set.path, set.candidates, solver, options.duality_gap,
                      limits_of(options).run_seconds, true, ""});
    }
  }
  return plan;
}

// Experiments that are visited solver after solver. If time runs out, whole solvers are missing,
// not sets of all.
bool is_by_solver(const std::string& experiment) {
  return experiment == "families" || experiment == "draws" || experiment == "dimensions";
}

// Every solver on these sets of about `size` candidates.
void add_by_solver(const std::string& experiment, const std::vector<std::string>& sets,
                   std::size_t size, const std::vector<std::string>& solvers,
                   const StudyOptions& options, const SolverRegistry& registry,
                   std::vector<StudyPoint>& plan) {
  const double limit = limits_of(options).family_run_seconds;
  const bool is_repeated = experiment == "families";  // a draw repeats another draw
  for (const std::string& solver : solvers) {
    for (const std::string& set : sets) {
      StudyPoint point{experiment, set, size, solver, kFamilyGap, limit, is_repeated, ""};
      if (registry.at(solver).traits().memory_exponent > 1 && size > kDrawSize) {
        point.skipped_because = "memory and time grow faster than Q; see the robot's subsets";
      }
      plan.push_back(std::move(point));
    }
  }
}

// The first draws of all families before the second ones.
std::vector<std::string> names_of_draws(const std::vector<std::string>& families,
                                        std::size_t draws) {
  std::vector<std::string> names;
  for (std::size_t k = 1; k <= draws; ++k) {
    for (const std::string& family : families)
      names.push_back(fmt::format("{}_draw_{}", family, k));
  }
  return names;
}

std::vector<std::string> names_of_ladder(const std::vector<std::string>& families,
                                         std::size_t largest) {
  std::vector<std::string> names;
  for (const std::string& family : families) {
    for (const std::size_t d : kDimensions) {
      if (d <= largest) names.push_back(fmt::format("{}_{}", family, d));
    }
  }
  return names;
}

// Points whose solvers are shuffled together.
bool same_block(const StudyPoint& a, const StudyPoint& b) {
  if (a.experiment != b.experiment) return false;
  return is_by_solver(a.experiment) || (a.family == b.family && a.candidates == b.candidates);
}

// The names of a block's solvers, in random order.
std::vector<std::string> shuffled_solvers(std::span<const StudyPoint> block, Random& random) {
  std::vector<std::string> names;
  for (const StudyPoint& point : block) {
    if (std::ranges::find(names, point.solver) == names.end()) names.push_back(point.solver);
  }
  for (std::size_t k = names.size(); k > 1; --k) std::swap(names[k - 1], names[random.below(k)]);
  return names;
}

}  // namespace

StudyLimits limits_of(const StudyOptions& options) {
  StudyLimits limits;
  switch (options.mode) {
    case StudyMode::kQuick:
      limits = {2.0, 0.5, 4 * kGigabyte, 3, 1.0, 100.0, 0, 0};
      break;
    case StudyMode::kStandard:
      limits = {10.0, 4.0, 4 * kGigabyte, 9, 20.0, 840.0, 3, 48};
      break;
    case StudyMode::kFull:
      limits = {1800.0, 60.0, 8 * kGigabyte, 9, 20.0, kInfinity, kMostDraws, kDimensions.back()};
      break;
  }
  if (options.time_limit) {
    limits.run_seconds = *options.time_limit;
    limits.family_run_seconds = std::min(limits.family_run_seconds, *options.time_limit);
  }
  if (options.memory_limit) limits.memory_bytes = *options.memory_limit;
  return limits;
}

double kill_after(double time_limit) { return time_limit + std::max(1.0, 0.25 * time_limit); }

std::vector<std::size_t> study_sizes(std::size_t max_candidates) {
  std::vector<std::size_t> sizes;
  for (const std::size_t size : kSizes) {
    if (size <= max_candidates) sizes.push_back(size);
  }
  return sizes;
}

std::vector<StudyPoint> make_plan(const StudyOptions& options, const SolverRegistry& registry,
                                  const StudyFamilies& families,
                                  const std::vector<OwnSetSize>& own) {
  check(options);
  const StudyLimits limits = limits_of(options);
  const std::vector<std::string> solvers = chosen_solvers(options, registry);
  if (!own.empty()) return plan_of_own_sets(options, solvers, own);
  const std::vector<std::size_t> sizes = study_sizes(options.max_candidates);
  std::vector<StudyPoint> plan;
  for (const std::size_t size : sizes) {
    for (const std::string& solver : solvers) {
      plan.push_back(
          {"scaling", "robot", size, solver, options.duality_gap, limits.run_seconds, true, ""});
    }
  }
  if (!options.families) return plan;
  const bool pair = std::ranges::all_of(
      kNormalisationPair, [&](const char* name) { return is_available(registry, name); });
  const bool compared = pair && options.solvers.empty();
  for (const char* family : kNormalisationFamilies) {
    for (const std::size_t size : compared ? sizes : std::vector<std::size_t>{}) {
      for (const char* solver : kNormalisationPair) {
        plan.push_back({"normalisation", family, size, solver, options.duality_gap,
                        limits.family_run_seconds, false, ""});
      }
    }
  }
  std::vector<std::string> all{"robot"};
  all.insert(all.end(), families.whole.begin(), families.whole.end());
  add_by_solver("families", all, sizes.back(), solvers, options, registry, plan);
  const std::size_t size = std::min(kDrawSize, sizes.back());
  add_by_solver("draws", names_of_draws(families.drawn, limits.draws), size, solvers, options,
                registry, plan);
  add_by_solver("dimensions", names_of_ladder(families.dimensions, limits.dimension), size, solvers,
                options, registry, plan);
  return plan;
}

StudySetName study_set_name(const std::string& name) {
  constexpr std::string_view kDraw = "_draw";
  const std::size_t line = name.rfind('_');
  const std::string digits = line == std::string::npos ? std::string() : name.substr(line + 1);
  const bool is_number = !digits.empty() && digits.size() <= 6 && digits.front() != '0' &&
                         digits.find_first_not_of("0123456789") == std::string::npos;
  if (!is_number) return {name, 0, 0};
  const std::string stem = name.substr(0, line);
  if (!stem.ends_with(kDraw)) return {stem, 0, std::stoul(digits)};
  return {stem.substr(0, stem.size() - kDraw.size()), std::stoul(digits), 0};
}

std::vector<std::size_t> visiting_order(const std::vector<StudyPoint>& plan, std::uint64_t seed,
                                        int round) {
  Random random(seed * 1'000'003 + static_cast<std::uint64_t>(round));
  std::vector<std::size_t> order;
  for (std::size_t from = 0, to = 0; from < plan.size(); from = to) {
    while (to < plan.size() && same_block(plan[from], plan[to])) ++to;
    const std::span block(plan.begin() + static_cast<std::ptrdiff_t>(from), to - from);
    for (const std::string& solver : shuffled_solvers(block, random)) {
      for (std::size_t k = from; k < to; ++k) {
        if (plan[k].solver == solver) order.push_back(k);
      }
    }
  }
  return order;
}

}  // namespace graybox::bench
