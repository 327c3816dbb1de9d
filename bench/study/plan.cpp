#include "bench/study/plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <span>
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

// Points whose solvers are shuffled together.
bool same_block(const StudyPoint& a, const StudyPoint& b) {
  if (a.experiment != b.experiment) return false;
  return a.experiment == "families" || (a.family == b.family && a.candidates == b.candidates);
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
      limits = {2.0, 0.5, 4 * kGigabyte, 3, 1.0, 100.0};
      break;
    case StudyMode::kStandard:
      limits = {10.0, 4.0, 4 * kGigabyte, 9, 20.0, 840.0};
      break;
    case StudyMode::kFull:
      limits = {1800.0, 60.0, 8 * kGigabyte, 9, 20.0, kInfinity};
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
                                  const std::vector<std::string>& families,
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
  all.insert(all.end(), families.begin(), families.end());
  // Solver after solver: if time runs out, whole solvers are missing, not families of all.
  for (const std::string& solver : solvers) {
    for (const std::string& family : all) {
      StudyPoint point{"families", family,     sizes.back(),
                       solver,     kFamilyGap, limits.family_run_seconds,
                       false,      ""};
      if (registry.at(solver).traits().memory_exponent > 1 && sizes.back() > 2000) {
        point.skipped_because = "memory and time grow faster than Q; see the robot's subsets";
      }
      plan.push_back(std::move(point));
    }
  }
  return plan;
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
