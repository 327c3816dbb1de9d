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

// log Phi of designs (certificate.hpp), all criteria. E and G are taken as they are, not smoothed.
// What is handed out for them as G is a bound, as in dual_bound.hpp: of tr(G M) >= 1, with
//
//   Phi(N) / Phi(M) <= tr(G N)                          for every N >= 0,
//
// from the barrier of criterion_frame.hpp at M. A sharpness that does not suit M loosens it. A
// compound criterion has the mean of those of its parts, by the inequality of weighted means.
class DesignValue {
 public:
  // Keeps references. G needs its region.
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
  // After a call: G, with E and G made smooth so far, and tr(G P).
  [[nodiscard]] std::span<const double> trace_dual(double sharpness = 1.0);
  [[nodiscard]] double prior_gain() const;
  // After trace_dual(): what rounding does to log tr(G N), relative: d eps times the condition of
  // M with unit diagonal, of which sum_k M_kk (M^-1)_kk is the size.
  [[nodiscard]] double rounding() const { return rounding_; }
  [[nodiscard]] std::span<const double> matrix() const { return matrix_; }

 private:
  // One of the criteria that make up Phi, and its share.
  struct Part {
    double share;
    CriterionFrame frame;
  };

  void start();

  const InformationSet& set_;
  const DesignConstraints& constraints_;
  bool is_determinant_;
  std::vector<Part> parts_;
  InverseCholesky inverse_;
  std::vector<double> matrix_, dual_;
  double rounding_ = 0.0;
};

// Whether whole numbers obey all rows and limits, to a relative 1e-9.
[[nodiscard]] bool obeys(const DesignConstraints& constraints,
                         std::span<const std::int64_t> counts);

// Improves `counts` by exchanges among the candidates in `pool` and those that are run, until none
// gains or stop.hpp says so. Returns log Phi.
double improve_by_exchange(const DesignConstraints& constraints, std::span<const std::size_t> pool,
                           DesignValue& value, std::span<std::int64_t> counts);

}  // namespace graybox
