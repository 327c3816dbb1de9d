#include "solvers/registry.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <utility>

#include "problems/base/error.hpp"
#include "solvers/cholmod/dual_interior_point_sparse.hpp"
#include "solvers/column_generation/column_generation.hpp"
#include "solvers/core/claim.hpp"
#include "solvers/core/tracer.hpp"
#include "solvers/core/warm_start.hpp"
#include "solvers/exchange/cocktail.hpp"
#include "solvers/exchange/fedorov_wynn.hpp"
#include "solvers/exchange/randomized_exchange.hpp"
#include "solvers/exchange/vertex_exchange.hpp"
#include "solvers/external/external_solver.hpp"
#include "solvers/interior_point/dual_interior_point.hpp"
#include "solvers/interior_point/dual_interior_point_unscaled.hpp"
#include "solvers/interior_point/primal_interior_point.hpp"
#include "solvers/interior_point/primal_interior_point_low_rank.hpp"
#include "solvers/ipopt/ipopt_dual.hpp"
#include "solvers/ipopt/ipopt_lifted.hpp"
#include "solvers/ipopt/ipopt_primal.hpp"
#include "solvers/multiplicative/multiplicative.hpp"
#include "solvers/multiplicative/multiplicative_accelerated.hpp"
#include "solvers/nlopt/nlopt_slsqp.hpp"
#include "solvers/nlopt/nlopt_weights.hpp"

namespace graybox {
namespace {

// A back-end as the registry hands it out: criteria that its traits do not list are answered with
// `unsupported` here, so that no back-end has to.
class CheckedSolver final : public Solver {
 public:
  explicit CheckedSolver(std::unique_ptr<Solver> solver) : solver_(std::move(solver)) {}

  [[nodiscard]] std::string_view name() const override { return solver_->name(); }
  [[nodiscard]] std::string_view description() const override { return solver_->description(); }
  [[nodiscard]] SolverTraits traits() const override { return solver_->traits(); }
  [[nodiscard]] Solution solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer) const override {
    options.criterion.require_fits(set);
    if (!options.start.empty()) require_start(options.start, set, *solver_);
    const CriterionKind asked = options.criterion.kind();
    const std::vector<CriterionKind> known = solver_->traits().criteria;
    if (std::ranges::find(known, asked) != known.end()) {
      // Others ask for matrices: they are made, or refused, before threads start.
      const bool takes_factors =
          solver_->traits().takes_factors && options.criterion.is_solved_as_d();
      if (!takes_factors && !set.has_matrices()) {
        const TimeLimit limit(options.time_limit);
        static_cast<void>(set.data());
      }
      Solution solution = solver_->solve(set, options, observer);
      withdraw_unknowable_claim(set.dimension(), options.duality_gap, solution);
      return solution;
    }
    Tracer tracer(set, options, observer);
    return tracer.finish({}, SolveStatus::kUnsupported, 0,
                         fmt::format("{} does not solve criterion {}; 'graybox solvers' shows "
                                     "which do",
                                     name(), to_string(asked)));
  }

 private:
  std::unique_ptr<Solver> solver_;
};

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substitute = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = std::exchange(row[j], std::min({row[j] + 1, row[j - 1] + 1, substitute}));
    }
  }
  return row[b.size()];
}

constexpr bool kWithCholmod = GRAYBOX_REGISTRY_WITH_CHOLMOD;
constexpr bool kWithIpopt = GRAYBOX_REGISTRY_WITH_IPOPT;
constexpr bool kWithNlopt = GRAYBOX_REGISTRY_WITH_NLOPT;

// Back-ends on an optional library, listed with the reason where the library was not built in.
template <bool kBuilt, typename... BackEnds>
void add_optional(SolverRegistry& registry, const char* unavailable_because) {
  if constexpr (kBuilt) {
    (registry.add(std::make_unique<BackEnds>()), ...);
  } else {
    (registry.add_unavailable(std::string(BackEnds::kName), std::string(BackEnds::kDescription),
                              unavailable_because),
     ...);
  }
}

}  // namespace

void SolverRegistry::add(std::unique_ptr<Solver> solver) {
  const std::string name(solver->name());
  const auto same = [&](const Entry& entry) { return entry.name == name; };
  if (std::ranges::any_of(entries_, same)) {
    throw InputError(fmt::format("solver {} is registered already", name));
  }
  std::string description(solver->description());
  entries_.push_back(
      {name, std::move(description), std::make_unique<CheckedSolver>(std::move(solver)), ""});
}

void SolverRegistry::add_unavailable(std::string name, std::string description,
                                     std::string reason) {
  entries_.push_back({std::move(name), std::move(description), nullptr, std::move(reason)});
}

const Solver& SolverRegistry::at(std::string_view name) const {
  if (name.starts_with(ExternalSolver::kPrefix)) {
    for (const auto& solver : external_) {
      if (solver->name() == name) return *solver;
    }
    return *external_.emplace_back(
        std::make_unique<CheckedSolver>(std::make_unique<ExternalSolver>(std::string(name))));
  }
  const Entry* nearest = nullptr;
  std::size_t nearest_distance = name.size();
  for (const Entry& entry : entries_) {
    if (entry.name == name) {
      if (entry.solver != nullptr) return *entry.solver;
      throw InputError(
          fmt::format("solver {} is not available: {}", name, entry.unavailable_because));
    }
    const std::size_t distance = edit_distance(entry.name, name);
    if (distance < nearest_distance) {
      nearest = &entry;
      nearest_distance = distance;
    }
  }
  throw InputError(fmt::format(
      "unknown solver '{}'{}; 'graybox solvers' lists all", name,
      nearest == nullptr ? std::string() : fmt::format(", did you mean {}?", nearest->name)));
}

SolverRegistry make_registry() {
  SolverRegistry registry;
  registry.add(std::make_unique<ColumnGeneration>());
  registry.add(std::make_unique<DualInteriorPoint>());
  add_optional<kWithCholmod, DualInteriorPointSparse>(
      registry, "built without CHOLMOD (GRAYBOX_WITH_CHOLMOD)");
  registry.add(std::make_unique<DualInteriorPointUnscaled>());
  registry.add(std::make_unique<PrimalInteriorPoint>());
  registry.add(std::make_unique<PrimalInteriorPointLowRank>());
  registry.add(std::make_unique<Multiplicative>());
  registry.add(std::make_unique<MultiplicativeAccelerated>());
  registry.add(std::make_unique<FedorovWynn>());
  registry.add(std::make_unique<VertexExchange>());
  registry.add(std::make_unique<RandomizedExchange>());
  registry.add(std::make_unique<Cocktail>());
  add_optional<kWithIpopt, IpoptPrimal, IpoptLifted, IpoptDual>(
      registry, "built without Ipopt (GRAYBOX_WITH_IPOPT)");
  add_optional<kWithNlopt, NloptSlsqp, NloptMma, NloptCcsa, NloptLbfgs>(
      registry, "built without NLopt (GRAYBOX_WITH_NLOPT)");
  return registry;
}

}  // namespace graybox
