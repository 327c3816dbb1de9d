// Solvers that behave and misbehave in one known way each, shared by the tests of the study and the
// worker it starts (study_worker.cpp).
#pragma once

#include <unistd.h>

#include <cstdlib>
#include <memory>
#include <new>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "solvers/core/sensitivity.hpp"
#include "solvers/core/tracer.hpp"
#include "solvers/registry.hpp"

namespace graybox::testing {

using Behaviour = Solution (*)(const InformationSet&, const SolveOptions&, SolveObserver*);

class BehavingSolver : public Solver {
 public:
  BehavingSolver(std::string name, Behaviour behaviour)
      : name_(std::move(name)), behaviour_(behaviour) {}
  [[nodiscard]] std::string_view name() const override { return name_; }
  [[nodiscard]] std::string_view description() const override { return "for tests"; }
  [[nodiscard]] Solution solve(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer) const override {
    return behaviour_(set, options, observer);
  }

 private:
  std::string name_;
  Behaviour behaviour_;
};

inline std::vector<double> uniform(const InformationSet& set) {
  return std::vector<double>(set.candidate_count(),
                             1.0 / static_cast<double>(set.candidate_count()));
}

// lambda_i <- lambda_i w_i / d until the gap is reached: slow and right.
inline Solution solve_honestly(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer) {
  Tracer tracer(set, options, observer);
  std::vector<double> weights = uniform(set), packed(set.packed_size()),
                      sensitivity(weights.size());
  const auto d = static_cast<double>(set.dimension());
  SolveStatus status = SolveStatus::kTimeLimit;
  std::int64_t iteration = 0;
  while (!tracer.out_of_time()) {
    information_matrix(set, weights, packed);
    InverseFactor factor;
    if (!invert(packed, set.dimension(), factor)) std::abort();
    sensitivities(set, factor.trace_dual, sensitivity);
    tracer.count_passes(2.0);
    double largest = 0.0;
    for (const double w : sensitivity) largest = w > largest ? w : largest;
    tracer.record(largest / d - 1.0, ++iteration);
    if (largest / d - 1.0 <= options.duality_gap) {
      status = SolveStatus::kSolved;
      break;
    }
    for (std::size_t i = 0; i < weights.size(); ++i) weights[i] *= sensitivity[i] / d;
  }
  return tracer.finish({weights}, status, iteration);
}

inline Solution answer_at_once(const InformationSet& set, const SolveOptions& options,
                               SolveObserver* observer, SolveStatus status) {
  Tracer tracer(set, options, observer);
  tracer.record(0.0, 1);
  return tracer.finish({uniform(set)}, status, 1, "answered at once");
}

inline Solution lie(const InformationSet& set, const SolveOptions& options,
                    SolveObserver* observer) {
  return answer_at_once(set, options, observer, SolveStatus::kSolved);
}

inline Solution give_up(const InformationSet& set, const SolveOptions& options,
                        SolveObserver* observer) {
  return answer_at_once(set, options, observer, SolveStatus::kNumericalFailure);
}

inline Solution crash(const InformationSet&, const SolveOptions&, SolveObserver*) { std::abort(); }

// Reaches a gap of 0.5 at once, then never comes back.
inline Solution sleep_on(const InformationSet& set, const SolveOptions& options,
                         SolveObserver* observer) {
  Tracer tracer(set, options, observer);
  tracer.record(0.5, 1);
  for (;;) pause();
}

inline Solution eat(const InformationSet&, const SolveOptions&, SolveObserver*) {
  std::vector<std::unique_ptr<std::vector<char>>> meals;
  for (;;) {
    meals.push_back(std::make_unique<std::vector<char>>(std::size_t{8} << 20, 'x'));
    usleep(500);
  }
}

inline Solution run_short(const InformationSet&, const SolveOptions&, SolveObserver*) {
  throw std::bad_alloc();
}

inline SolverRegistry study_registry(const std::vector<std::string>& names = {}) {
  const std::vector<std::pair<std::string, Behaviour>> all{
      {"honest", solve_honestly}, {"liar", lie},    {"quitter", give_up}, {"crasher", crash},
      {"sleeper", sleep_on},      {"glutton", eat}, {"short", run_short}};
  SolverRegistry registry;
  for (const auto& [name, behaviour] : all) {
    bool wanted = names.empty();
    for (const std::string& each : names) wanted = wanted || each == name;
    if (wanted) registry.add(std::make_unique<BehavingSolver>(name, behaviour));
  }
  return registry;
}

}  // namespace graybox::testing
