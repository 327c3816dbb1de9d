// ExactMethod: the interface of the methods for exact designs (exact_design.hpp).
//
//   const Relaxation relaxation = solve_relaxation(set);
//   const ExactSolution answer =
//       exact_method("branch_and_bound").solve(set, relaxation, {.experiments = 20});
//   const ExactCertificate proof = certify_exact(set, answer.design, 20, relaxation,
//                                                answer.log_det_bound);
//   // proof.proven_efficiency: a lower bound of (det M(m) / det M(m*))^(1/d)
//
//   rounding             the paper's footnote 3                                     (rounding.hpp)
//   efficient_rounding   Pukelsheim and Rieder 1992                       (efficient_rounding.hpp)
//   exchange             Fedorov's exchange from many starts                       (exchange.hpp)
//   branch_and_bound     until proven                                      (branch_and_bound.hpp)
//
// Bad problems and options throw InputError; everything numerical is a status.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/exact/exact_design.hpp"
#include "solvers/exact_bounds/relaxation.hpp"

namespace graybox {

inline constexpr std::int64_t kMostExperiments = 1'000'000;

enum class ExactStatus : std::int8_t {
  kOptimal = 0,       // D-efficiency >= 1 / (1 + gap) is proven
  kFeasible = 1,      // a design; the method promises no more than the bound it states
  kTimeLimit = -1,    // branch and bound: time was up or the observer asked to stop
  kMemoryLimit = -2,  // branch and bound: too many open nodes
  kSingular = -3,     // no regular design of M experiments was found
};
[[nodiscard]] std::string_view to_string(ExactStatus status);  // "optimal", "feasible", ...

struct ExactOptions {
  std::int64_t experiments = 0;  // M >= 1
  double gap = 1e-6;             // proven when max det^(1/d) / det^(1/d) - 1 <= gap; >= 1e-9
  double time_limit = std::numeric_limits<double>::infinity();  // wall seconds of this run
  std::uint64_t seed = 1;
  int threads = 1;              // the answer does not depend on it, unless time runs out
  std::string checkpoint = {};  // branch and bound: file for its state; empty: none
  bool resume = false;          // continue from the checkpoint
  double memory_limit = 4e9;    // bytes of open nodes
};

struct ExactProgress {
  double seconds = 0.0;
  std::int64_t nodes = 0;
  std::size_t open = 0;
  std::size_t survivors = 0;
  double log_det = 0.0;            // of the best design
  double log_det_bound = 0.0;      // of all designs
  double proven_efficiency = 0.0;  // of the best design
};

class ExactObserver {
 public:
  virtual ~ExactObserver() = default;
  virtual bool on_progress(const ExactProgress& progress) = 0;  // false: stop
};

// Efficiency whose time of proof is recorded.
inline constexpr double kMarkedEfficiency = 0.995;

struct ExactSolution {
  ExactDesign design;
  ExactStatus status = ExactStatus::kSingular;
  double log_det_bound = std::numeric_limits<double>::infinity();  // proven, over all designs
  std::int64_t iterations = 0;  // exchanges, or Newton steps in the tree
  std::int64_t nodes = 0;
  std::size_t open_nodes = 0;
  std::size_t survivors = 0;  // candidates that were left after screening
  double seconds = 0.0;       // with the relaxation; over all runs if resumed
  double seconds_to_mark = std::numeric_limits<double>::infinity();  // kMarkedEfficiency proven
  std::string message = {};
};

class ExactMethod {
 public:
  virtual ~ExactMethod() = default;
  [[nodiscard]] virtual std::string_view name() const = 0;
  [[nodiscard]] virtual std::string_view description() const = 0;
  [[nodiscard]] virtual ExactSolution solve(const InformationSet& set, const Relaxation& relaxation,
                                            const ExactOptions& options,
                                            ExactObserver* observer = nullptr) const = 0;
};

[[nodiscard]] const std::vector<std::unique_ptr<ExactMethod>>& exact_methods();
// Throws InputError naming those there are.
[[nodiscard]] const ExactMethod& exact_method(std::string_view name);

// Throws InputError for options out of range.
void require_exact_options(const ExactOptions& options);
// Also where M experiments can't make a regular design: the rank of a sum is at most the sum of the
// ranks, so at least d / max_i rank H_i are needed. (For candidates of rank one or full rank that
// many are also enough.)
void require_exact_problem(const InformationSet& set, const Relaxation& relaxation,
                           const ExactOptions& options);

// kOptimal if the proven efficiency is at least 1 / (1 + gap), else kFeasible; kSingular for a
// singular design. Also fills seconds_to_mark where the mark is reached and was not before.
void judge_exact(const InformationSet& set, const Relaxation& relaxation,
                 const ExactOptions& options, ExactSolution& solution);

}  // namespace graybox
