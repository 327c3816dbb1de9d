#include "solvers/ipopt/ipopt_primal.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "problems/base/packed_matrix.hpp"
#include "solvers/core/sensitivity.hpp"
#include "solvers/ipopt/ipopt_run.hpp"

namespace graybox {
namespace {

using Ipopt::Index;
using Ipopt::Number;

constexpr std::size_t kLargestCandidateCount = 30000;
constexpr Eigen::Index kHessianRowsAtOnce = 64;

class PrimalForm final : public ipopt::Form {
 public:
  explicit PrimalForm(const NormalizedSet& normalized)
      : Form(normalized),
        count_(normalized.candidate_count()),
        start_(count_),
        factors_(count_),
        packed_(normalized.packed_size()) {}

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
  // M = sum_i x_i B_i / Q and its inverse; false where M is not positive definite.
  bool evaluate_matrix(const Number* x);
  // Columns vec(R^-1 B_i R^-T) / Q with M = R R^T, entries off the diagonal times sqrt(2), so that
  // the Hessian is their Gram matrix.
  bool whiten_candidates();

  std::size_t count_;
  std::vector<double> start_;
  std::vector<double> factors_;
  std::vector<double> packed_;
  InverseFactor inverse_;
  Eigen::MatrixXd columns_;
};

void PrimalForm::start_from(std::span<const double> weights, double, double barrier) {
  // On the central path x_i z_i = mu and z_i is about d / Q off the support.
  const auto q = static_cast<double>(count_);
  const double floor = std::min(1.0, barrier * q / static_cast<double>(set().dimension()));
  for (std::size_t i = 0; i < count_; ++i) start_[i] = std::max(q * weights[i], floor);
}

bool PrimalForm::get_nlp_info(Index& n, Index& m, Index& jacobian_size, Index& hessian_size,
                              IndexStyleEnum& style) {
  n = static_cast<Index>(count_);
  m = 1;
  jacobian_size = n;
  hessian_size = n * (n + 1) / 2;
  style = C_STYLE;
  return true;
}

bool PrimalForm::get_bounds_info(Index n, Number* x_lower, Number* x_upper, Index, Number* g_lower,
                                 Number* g_upper) {
  std::fill_n(x_lower, n, 0.0);
  std::fill_n(x_upper, n, 2e19);
  g_lower[0] = g_upper[0] = static_cast<double>(n);
  return true;
}

bool PrimalForm::get_starting_point(Index, bool, Number* x, bool, Number*, Number*, Index, bool,
                                    Number*) {
  std::ranges::copy(start_, x);
  return true;
}

bool PrimalForm::evaluate_matrix(const Number* x) {
  for (std::size_t i = 0; i < count_; ++i) factors_[i] = x[i] / static_cast<double>(count_);
  sum_candidates(factors_, packed_);
  return invert(packed_, set().dimension(), inverse_);
}

bool PrimalForm::eval_f(Index, const Number* x, bool, Number& value) {
  if (!evaluate_matrix(x)) return false;
  value = -inverse_.log_det;
  return true;
}

bool PrimalForm::eval_grad_f(Index, const Number* x, bool, Number* gradient) {
  if (!evaluate_matrix(x)) return false;
  price_candidates(inverse_.trace_dual, gradient);
  for (std::size_t i = 0; i < count_; ++i) gradient[i] /= -static_cast<double>(count_);
  return true;
}

bool PrimalForm::eval_g(Index n, const Number* x, bool, Index, Number* g) {
  g[0] = Eigen::Map<const Eigen::VectorXd>(x, n).sum();
  return true;
}

bool PrimalForm::eval_jac_g(Index n, const Number*, bool, Index, Index, Index* rows, Index* columns,
                            Number* values) {
  for (Index i = 0; i < n; ++i) {
    if (values == nullptr) {
      rows[i] = 0;
      columns[i] = i;
    } else {
      values[i] = 1.0;
    }
  }
  return true;
}

bool PrimalForm::whiten_candidates() {
  const std::size_t dimension = set().dimension();
  const auto d = static_cast<Eigen::Index>(dimension);
  Eigen::MatrixXd matrix(d, d);
  unpack(packed_.data(), dimension, matrix.data());
  const Eigen::LLT<Eigen::MatrixXd> cholesky(matrix);
  if (cholesky.info() != Eigen::Success) return false;
  columns_.resize(static_cast<Eigen::Index>(packed_.size()), static_cast<Eigen::Index>(count_));
  count_pass();
  for (std::size_t i = 0; i < count_; ++i) {
    unpack(set().row(i).data(), dimension, matrix.data());
    cholesky.matrixL().solveInPlace(matrix);
    cholesky.matrixU().solveInPlace<Eigen::OnTheRight>(matrix);
    matrix /= static_cast<double>(count_);
    double* column = columns_.col(static_cast<Eigen::Index>(i)).data();
    for (Eigen::Index a = 0; a < d; ++a) {
      for (Eigen::Index b = 0; b < a; ++b) *column++ = std::numbers::sqrt2 * matrix(a, b);
      *column++ = matrix(a, a);
    }
  }
  return true;
}

bool PrimalForm::eval_h(Index n, const Number* x, bool, Number objective_factor, Index,
                        const Number*, bool, Index, Index* rows, Index* columns, Number* values) {
  if (values == nullptr) {
    for (Index i = 0; i < n; ++i) {
      for (Index j = 0; j <= i; ++j) {
        *rows++ = i;
        *columns++ = j;
      }
    }
    return true;
  }
  if (interrupted() || !evaluate_matrix(x) || !whiten_candidates()) return false;
  Eigen::MatrixXd block;
  for (Eigen::Index first = 0; first < n; first += kHessianRowsAtOnce) {
    const Eigen::Index count = std::min<Eigen::Index>(kHessianRowsAtOnce, n - first);
    block.noalias() = columns_.leftCols(first + count).transpose() *
                      columns_.middleCols(first, count) * objective_factor;
    for (Eigen::Index i = 0; i < count; ++i) {
      values = std::copy_n(block.col(i).data(), first + i + 1, values);
    }
  }
  return true;
}

}  // namespace

SolverTraits IpoptPrimal::traits() const { return {.reachable_gap = 1e-6, .memory_exponent = 2}; }

Solution IpoptPrimal::solve(const InformationSet& set, const SolveOptions& options,
                            SolveObserver* observer) const {
  if (set.candidate_count() > kLargestCandidateCount) {
    Solution solution;
    solution.status = SolveStatus::kUnsupported;
    solution.message = fmt::format("the dense Hessian of {} candidates is too large; at most {}",
                                   set.candidate_count(), kLargestCandidateCount);
    return solution;
  }
  return ipopt::run(set, options, observer, [](const NormalizedSet& normalized) -> ipopt::Form* {
    return new PrimalForm(normalized);
  });
}

}  // namespace graybox
