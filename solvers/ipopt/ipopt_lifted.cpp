#include "solvers/ipopt/ipopt_lifted.hpp"

#include <Eigen/Dense>
#include <algorithm>

#include "problems/base/packed_matrix.hpp"
#include "solvers/core/sensitivity.hpp"
#include "solvers/ipopt/ipopt_run.hpp"

namespace graybox {
namespace {

using Ipopt::Index;
using Ipopt::Number;

// Variables: x_1 .. x_Q, then M packed. Constraints: M - sum_i x_i B_i / Q = 0 (p rows), and
// sum_i x_i = Q.
class LiftedForm final : public ipopt::Form {
 public:
  explicit LiftedForm(const NormalizedSet& normalized)
      : Form(normalized),
        count_(normalized.candidate_count()),
        dimension_(normalized.dimension()),
        entries_(normalized.packed_size()),
        start_(count_ + entries_),
        factors_(count_),
        packed_(entries_) {}

  void start_from(std::span<const double> weights, double duality_gap, double barrier) override;
  void weights_of(const double* x, const double*, std::span<double> weights) const override {
    std::copy_n(x, count_, weights.begin());
  }

  bool get_nlp_info(Index& n, Index& m, Index& jacobian_size, Index& hessian_size,
                    IndexStyleEnum& style) override;
  bool get_bounds_info(Index n, Number* x_lower, Number* x_upper, Index m, Number* g_lower,
                       Number* g_upper) override;
  bool get_starting_point(Index n, bool, Number* x, bool, Number*, Number*, Index, bool,
                          Number*) override;
  bool eval_f(Index n, const Number* x, bool new_x, Number& value) override;
  bool eval_grad_f(Index n, const Number* x, bool new_x, Number* gradient) override;
  bool eval_g(Index n, const Number* x, bool new_x, Index m, Number* g) override;
  bool eval_jac_g(Index n, const Number* x, bool new_x, Index m, Index size, Index* rows,
                  Index* columns, Number* values) override;
  bool eval_h(Index n, const Number* x, bool new_x, Number objective_factor, Index m,
              const Number* multipliers, bool new_multipliers, Index size, Index* rows,
              Index* columns, Number* values) override;

 private:
  // packed_ = sum_i x_i B_i / Q.
  void sum_weighted(const Number* x);
  bool invert_variable(const Number* x) {
    return invert({x + count_, entries_}, dimension_, inverse_);
  }

  std::size_t count_;
  std::size_t dimension_;
  std::size_t entries_;  // p
  std::vector<double> start_;
  std::vector<double> factors_;
  std::vector<double> packed_;
  InverseFactor inverse_;
};

void LiftedForm::start_from(std::span<const double> weights, double, double barrier) {
  // On the central path x_i z_i = mu and z_i is about d / Q off the support.
  const auto q = static_cast<double>(count_);
  const double floor = std::min(1.0, barrier * q / static_cast<double>(dimension_));
  for (std::size_t i = 0; i < count_; ++i) start_[i] = std::max(q * weights[i], floor);
  sum_weighted(start_.data());
  std::copy(packed_.begin(), packed_.end(), start_.begin() + static_cast<std::ptrdiff_t>(count_));
}

void LiftedForm::sum_weighted(const Number* x) {
  for (std::size_t i = 0; i < count_; ++i) factors_[i] = x[i] / static_cast<double>(count_);
  sum_candidates(factors_, packed_);
}

bool LiftedForm::get_nlp_info(Index& n, Index& m, Index& jacobian_size, Index& hessian_size,
                              IndexStyleEnum& style) {
  const auto p = static_cast<Index>(entries_);
  const auto q = static_cast<Index>(count_);
  n = q + p;
  m = p + 1;
  jacobian_size = q * (p + 1) + p;
  hessian_size = p * (p + 1) / 2;
  style = C_STYLE;
  return true;
}

bool LiftedForm::get_bounds_info(Index n, Number* x_lower, Number* x_upper, Index m,
                                 Number* g_lower, Number* g_upper) {
  std::fill_n(x_lower, count_, 0.0);
  std::fill_n(x_lower + count_, entries_, -2e19);
  std::fill_n(x_upper, n, 2e19);
  std::fill_n(g_lower, m, 0.0);
  g_lower[m - 1] = static_cast<double>(count_);
  std::copy_n(g_lower, m, g_upper);
  return true;
}

bool LiftedForm::get_starting_point(Index, bool, Number* x, bool, Number*, Number*, Index, bool,
                                    Number*) {
  std::ranges::copy(start_, x);
  return true;
}

bool LiftedForm::eval_f(Index, const Number* x, bool, Number& value) {
  if (!invert_variable(x)) return false;
  value = -inverse_.log_det;
  return true;
}

bool LiftedForm::eval_grad_f(Index, const Number* x, bool, Number* gradient) {
  if (!invert_variable(x)) return false;
  std::fill_n(gradient, count_, 0.0);
  std::ranges::transform(inverse_.trace_dual, gradient + count_, std::negate<>());
  return true;
}

bool LiftedForm::eval_g(Index, const Number* x, bool, Index, Number* g) {
  sum_weighted(x);
  for (std::size_t k = 0; k < entries_; ++k) g[k] = x[count_ + k] - packed_[k];
  g[entries_] = Eigen::Map<const Eigen::VectorXd>(x, static_cast<Eigen::Index>(count_)).sum();
  return true;
}

bool LiftedForm::eval_jac_g(Index, const Number*, bool, Index, Index, Index* rows, Index* columns,
                            Number* values) {
  const auto q = static_cast<Index>(count_);
  const auto p = static_cast<Index>(entries_);
  if (values == nullptr) {
    for (Index i = 0; i < q; ++i) {
      for (Index k = 0; k <= p; ++k) {
        *rows++ = k;
        *columns++ = i;
      }
    }
    for (Index k = 0; k < p; ++k) {
      *rows++ = k;
      *columns++ = q + k;
    }
    return true;
  }
  count_pass();
  const double factor = -1.0 / static_cast<double>(count_);
  for (std::size_t i = 0; i < count_; ++i) {
    for (const double entry : set().row(i)) *values++ = factor * entry;
    *values++ = 1.0;
  }
  std::fill_n(values, entries_, 1.0);
  return true;
}

// With V = M^-1 and E_k = e_a e_b^T + e_b e_a^T (halved on the diagonal), the Hessian of
// -log det M is tr(V E_k V E_l) = 2 (V_ac V_be + V_ae V_bc), halved for each of k, l on the
// diagonal.
bool LiftedForm::eval_h(Index, const Number* x, bool, Number objective_factor, Index, const Number*,
                        bool, Index, Index* rows, Index* columns, Number* values) {
  const auto q = static_cast<Index>(count_);
  if (values == nullptr) {
    for (Index k = 0; k < static_cast<Index>(entries_); ++k) {
      for (Index l = 0; l <= k; ++l) {
        *rows++ = q + k;
        *columns++ = q + l;
      }
    }
    return true;
  }
  if (interrupted() || !invert_variable(x)) return false;
  const auto inverse = [&](std::size_t i, std::size_t j) {
    return (i == j ? 1.0 : 0.5) * inverse_.trace_dual[packed_index(i, j)];
  };
  for (std::size_t a = 0, k = 0; a < dimension_; ++a) {
    for (std::size_t b = 0; b <= a; ++b, ++k) {
      for (std::size_t c = 0, l = 0; c < dimension_ && l <= k; ++c) {
        for (std::size_t e = 0; e <= c && l <= k; ++e, ++l) {
          const double halves = (a == b ? 0.5 : 1.0) * (c == e ? 0.5 : 1.0);
          *values++ = 2.0 * objective_factor * halves *
                      (inverse(a, c) * inverse(b, e) + inverse(a, e) * inverse(b, c));
        }
      }
    }
  }
  return true;
}

}  // namespace

SolverTraits IpoptLifted::traits() const { return {.reachable_gap = 1e-6}; }

Solution IpoptLifted::solve(const InformationSet& set, const SolveOptions& options,
                            SolveObserver* observer) const {
  return ipopt::run(set, options, observer, [](const NormalizedSet& normalized) -> ipopt::Form* {
    return new LiftedForm(normalized);
  });
}

}  // namespace graybox
