// Exchanges between designs of whole numbers that obey constraints: one run is replaced by one of
// another candidate, added or left out, where that raises Phi most and breaks no row and no limit.
//
// Cost of a sweep: s n d^3 / 3 for s candidates that are run and n in the pool.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "problems/information/information_set.hpp"
#include "solvers/constrained/design_constraints.hpp"
#include "solvers/core/criterion.hpp"
#include "solvers/core/inverse_cholesky.hpp"
#include "solvers/restricted_problem/criterion_frame.hpp"

namespace graybox {

// log Phi of designs (certificate.hpp).
class DesignValue {
 public:
  // Keeps references.
  DesignValue(const InformationSet& set, const DesignConstraints& constraints,
              const Criterion& criterion);

  // Minus infinity where M is singular. Any numbers, whole or not.
  template <typename Number>
  [[nodiscard]] double operator()(std::span<const Number> counts) {
    start();
    for (std::size_t i = 0; i < counts.size(); ++i) {
      if (counts[i] != 0) add(i, static_cast<double>(counts[i]), matrix_);
    }
    return of(matrix_);
  }
  [[nodiscard]] double of(std::span<const double> packed);
  void add(std::size_t candidate, double count, std::span<double> packed) const;
  // After a call: G, and tr(G P).
  [[nodiscard]] std::span<const double> trace_dual();
  [[nodiscard]] double prior_gain() const;
  [[nodiscard]] std::span<const double> matrix() const { return matrix_; }

 private:
  void start();

  const InformationSet& set_;
  const DesignConstraints& constraints_;
  bool is_determinant_;
  CriterionFrame frame_;
  InverseCholesky inverse_;
  std::vector<double> matrix_;
};

// Whether whole numbers obey all rows and limits, to a relative 1e-9.
[[nodiscard]] bool obeys(const DesignConstraints& constraints,
                         std::span<const std::int64_t> counts);

// Improves `counts` by exchanges among the candidates in `pool` and those that are run, until none
// gains or stop.hpp says so. Returns log Phi.
double improve_by_exchange(const DesignConstraints& constraints, std::span<const std::size_t> pool,
                           DesignValue& value, std::span<std::int64_t> counts);

}  // namespace graybox
