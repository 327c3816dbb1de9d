#include "solvers/ipopt/ipopt_dual.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "problems/base/packed_matrix.hpp"
#include "solvers/core/sensitivity.hpp"
#include "solvers/ipopt/ipopt_run.hpp"

namespace graybox {
namespace {

using Ipopt::Index;
using Ipopt::Number;

// Variables: L column by column (l_11, l_21, .., l_d1, l_22, ..). Constraints: tr(L L^T B_i) <= d.
class DualForm final : public ipopt::Form {
 public:
  explicit DualForm(const NormalizedSet& normalized)
      : Form(normalized),
        count_(normalized.candidate_count()),
        dimension_(normalized.dimension()),
        entries_(normalized.packed_size()),
        start_(entries_),
        factor_(Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(dimension_),
                                      static_cast<Eigen::Index>(dimension_))),
        work_(factor_),
        product_(factor_),
        packed_(entries_) {}

  void start_from(std::span<const double> weights, double duality_gap, double barrier) override;
  void weights_of(const double*, const double* multipliers,
                  std::span<double> weights) const override {
    std::copy_n(multipliers, count_, weights.begin());
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
  void read_factor(const Number* x);

  // Calls visit(row, column) for the lower triangle, column by column.
  template <typename Visit>
  void for_each_entry(Visit visit) const {
    const auto d = static_cast<Eigen::Index>(dimension_);
    for (Eigen::Index column = 0; column < d; ++column) {
      for (Eigen::Index row = column; row < d; ++row) visit(row, column);
    }
  }

  std::size_t count_;
  std::size_t dimension_;
  std::size_t entries_;  // p
  std::vector<double> start_;
  Eigen::MatrixXd factor_;  // L
  Eigen::MatrixXd work_;
  Eigen::MatrixXd product_;
  std::vector<double> packed_;
};

// W = M^-1 / (1 + gap) is feasible, with max_i tr(W B_i) = d; a little less is strictly so.
void DualForm::start_from(std::span<const double> weights, double duality_gap, double barrier) {
  sum_candidates(weights, packed_);
  InverseFactor inverse;
  factor_.setIdentity();
  if (invert(packed_, dimension_, inverse)) {
    for_each_entry([&](Eigen::Index row, Eigen::Index column) {
      const auto k = packed_index(static_cast<std::size_t>(row), static_cast<std::size_t>(column));
      work_(row, column) = (row == column ? 1.0 : 0.5) * inverse.trace_dual[k];
    });
    const Eigen::LLT<Eigen::MatrixXd> cholesky(work_);
    if (cholesky.info() == Eigen::Success) factor_ = cholesky.matrixL();
  }
  const double margin = std::min(0.5, barrier * static_cast<double>(count_));
  factor_ *= std::sqrt((1.0 - margin) / (1.0 + duality_gap));
  auto entry = start_.begin();
  for_each_entry([&](Eigen::Index row, Eigen::Index column) { *entry++ = factor_(row, column); });
}

void DualForm::read_factor(const Number* x) {
  for_each_entry([&](Eigen::Index row, Eigen::Index column) { factor_(row, column) = *x++; });
}

bool DualForm::get_nlp_info(Index& n, Index& m, Index& jacobian_size, Index& hessian_size,
                            IndexStyleEnum& style) {
  n = static_cast<Index>(entries_);
  m = static_cast<Index>(count_);
  jacobian_size = n * m;
  const auto d = static_cast<Index>(dimension_);
  hessian_size = d * (d + 1) * (d + 2) / 6;
  style = C_STYLE;
  return true;
}

bool DualForm::get_bounds_info(Index n, Number* x_lower, Number* x_upper, Index m, Number* g_lower,
                               Number* g_upper) {
  std::fill_n(x_upper, n, 2e19);
  for_each_entry(
      [&](Eigen::Index row, Eigen::Index column) { *x_lower++ = row == column ? 0.0 : -2e19; });
  std::fill_n(g_lower, m, -2e19);
  std::fill_n(g_upper, m, static_cast<double>(dimension_));
  return true;
}

bool DualForm::get_starting_point(Index, bool, Number* x, bool, Number*, Number*, Index, bool,
                                  Number*) {
  std::ranges::copy(start_, x);
  return true;
}

bool DualForm::eval_f(Index, const Number* x, bool, Number& value) {
  read_factor(x);
  if (!(factor_.diagonal().minCoeff() > 0.0)) return false;
  value = -2.0 * factor_.diagonal().array().log().sum();
  return true;
}

bool DualForm::eval_grad_f(Index, const Number* x, bool, Number* gradient) {
  for_each_entry([&](Eigen::Index row, Eigen::Index column) {
    *gradient++ = row == column ? -2.0 / *x : 0.0;
    ++x;
  });
  return true;
}

bool DualForm::eval_g(Index, const Number* x, bool, Index, Number* g) {
  read_factor(x);
  work_.noalias() = factor_ * factor_.transpose();
  pack_trace_dual(work_.data(), dimension_, packed_.data());
  price_candidates(packed_, g);
  return true;
}

bool DualForm::eval_jac_g(Index n, const Number* x, bool, Index m, Index, Index* rows,
                          Index* columns, Number* values) {
  if (values == nullptr) {
    for (Index i = 0; i < m; ++i) {
      for (Index k = 0; k < n; ++k) {
        *rows++ = i;
        *columns++ = k;
      }
    }
    return true;
  }
  if (interrupted()) return false;
  read_factor(x);
  count_pass();
  for (std::size_t i = 0; i < count_; ++i) {
    unpack(set().row(i).data(), dimension_, work_.data());
    product_.noalias() = 2.0 * (work_ * factor_);
    for_each_entry(
        [&](Eigen::Index row, Eigen::Index column) { *values++ = product_(row, column); });
  }
  return true;
}

bool DualForm::eval_h(Index, const Number* x, bool, Number objective_factor, Index,
                      const Number* multipliers, bool, Index, Index* rows, Index* columns,
                      Number* values) {
  const auto d = static_cast<Index>(dimension_);
  const bool structure = values == nullptr;
  if (!structure) {
    sum_candidates({multipliers, count_}, packed_);
    unpack(packed_.data(), dimension_, work_.data());
  }
  // Column j of L owns the variables first .. first + d - j - 1, and one dense block.
  for (Index j = 0, first = 0; j < d; first += d - j, ++j) {
    for (Index a = j; a < d; ++a) {
      for (Index b = j; b <= a; ++b) {
        if (structure) {
          *rows++ = first + a - j;
          *columns++ = first + b - j;
        } else {
          const double log_term = a == j && b == j ? 2.0 / (x[first] * x[first]) : 0.0;
          *values++ = objective_factor * log_term + 2.0 * work_(a, b);
        }
      }
    }
  }
  return true;
}

}  // namespace

SolverTraits IpoptDual::traits() const { return {.reachable_gap = 1e-6}; }

Solution IpoptDual::solve(const InformationSet& set, const SolveOptions& options,
                          SolveObserver* observer) const {
  return ipopt::run(set, options, observer, [](const NormalizedSet& normalized) -> ipopt::Form* {
    return new DualForm(normalized);
  });
}

}  // namespace graybox
