#include "solvers/cholmod/sparse_range_system.hpp"

#include <cholmod.h>

#include <algorithm>
#include <cmath>
#include <new>
#include <numeric>
#include <vector>

#include "problems/base/stop.hpp"

namespace graybox {
namespace {

using Long = SuiteSparse_long;

Long* starts(cholmod_sparse* matrix) { return static_cast<Long*>(matrix->p); }
Long* indices(cholmod_sparse* matrix) { return static_cast<Long*>(matrix->i); }
double* values(cholmod_sparse* matrix) { return static_cast<double*>(matrix->x); }

class SparseRangeSystem final : public RangeSystem {
 public:
  explicit SparseRangeSystem(const NormalizedSet& normal)
      : normal_(normal),
        scale_(symmetric_scale(normal.dimension())),
        diagonal_(normal.packed_size()) {
    cholmod_l_start(&common_);
    common_.print = 0;
    if (!allocate()) {
      release();
      throw std::bad_alloc();
    }
  }
  SparseRangeSystem(const SparseRangeSystem&) = delete;
  SparseRangeSystem& operator=(const SparseRangeSystem&) = delete;
  ~SparseRangeSystem() override { release(); }

  bool factorise(const Eigen::MatrixXd& inverse_scaling, std::span<const double> ratios) override {
    fill_rows(ratios);
    fill_barrier(inverse_scaling);
    cholmod_sparse* sum = sum_of_rows_and_barrier();
    const bool done = sum != nullptr && factorise_scaled(sum);
    cholmod_l_free_sparse(&sum, &common_);
    return done;
  }

  void solve(std::span<double> x, std::size_t columns) override {
    const std::size_t p = diagonal_.size();
    for (std::size_t column = 0; column < columns; ++column) solve_one(x.subspan(column * p, p));
  }

 private:
  bool allocate() {
    const std::size_t count = normal_.candidate_count(), p = normal_.packed_size();
    const auto non_zero = [](double x) { return x != 0.0; };
    const auto entries = static_cast<std::size_t>(
        std::count_if(normal_.rows(), normal_.rows() + count * p, non_zero));
    rows_ = cholmod_l_allocate_sparse(p, count, entries, 1, 1, 0, CHOLMOD_REAL, &common_);
    barrier_ = cholmod_l_allocate_sparse(p, p, p * p, 1, 1, 0, CHOLMOD_REAL, &common_);
    right_side_ = cholmod_l_allocate_dense(p, 1, p, CHOLMOD_REAL, &common_);
    if (rows_ == nullptr || barrier_ == nullptr || right_side_ == nullptr) return false;
    fill_patterns();
    barrier_->stype = -1;  // symmetric, from its lower triangle
    factor_ = cholmod_l_analyze(barrier_, &common_);
    barrier_->stype = 0;
    return factor_ != nullptr;
  }

  void fill_patterns() {
    const std::size_t count = normal_.candidate_count(), p = normal_.packed_size();
    Long entry = 0;
    for (std::size_t i = 0; i < count; ++i) {
      starts(rows_)[i] = entry;
      for (std::size_t k = 0; k < p; ++k) {
        if (normal_.row(i)[k] != 0.0) indices(rows_)[entry++] = static_cast<Long>(k);
      }
    }
    starts(rows_)[count] = entry;
    for (std::size_t column = 0; column <= p; ++column) {
      starts(barrier_)[column] = static_cast<Long>(column * p);
    }
    for (std::size_t k = 0; k < p * p; ++k) {
      indices(barrier_)[k] = static_cast<Long>(k % p);
      values(barrier_)[k] = 1.0;
    }
  }

  // A D A^T + N, some candidates at a time: between them it asks whether to stop. Null where it
  // does, or where memory does not do.
  cholmod_sparse* sum_of_rows_and_barrier() {
    constexpr std::size_t kWork = 100'000'000;  // multiplications, were the rows dense
    const std::size_t count = normal_.candidate_count(), p = normal_.packed_size();
    const std::size_t chunk = std::max<std::size_t>(16, kWork / (p * p));
    cholmod_sparse* sum = nullptr;
    for (std::size_t begin = 0; begin < count; begin += chunk) {
      std::vector<Long> columns(std::min(chunk, count - begin));
      std::iota(columns.begin(), columns.end(), static_cast<Long>(begin));
      cholmod_sparse* product =
          stop_requested() ? nullptr
                           : cholmod_l_aat(rows_, columns.data(), columns.size(), 1, &common_);
      cholmod_sparse* next = added(sum == nullptr ? barrier_ : sum, product);
      cholmod_l_free_sparse(&product, &common_);
      cholmod_l_free_sparse(&sum, &common_);
      sum = next;
      if (sum == nullptr) return nullptr;
    }
    return sum;
  }

  cholmod_sparse* added(cholmod_sparse* a, cholmod_sparse* b) {
    double one[2] = {1.0, 0.0};
    return b == nullptr ? nullptr : cholmod_l_add(b, a, one, one, 1, 0, &common_);
  }

  void fill_rows(std::span<const double> ratios) {
    for (std::size_t i = 0; i < ratios.size(); ++i) {
      const double root = std::sqrt(ratios[i]);
      const std::span<const double> row = normal_.row(i);
      for (Long entry = starts(rows_)[i]; entry < starts(rows_)[i + 1]; ++entry) {
        const auto k = static_cast<std::size_t>(indices(rows_)[entry]);
        values(rows_)[entry] = root * scale_[k] * row[k];
      }
    }
  }

  // N = R (x) R: its entry for the pairs (i, j) and (k, l) is R_ik R_jl + R_il R_jk, times
  // 1/sqrt(2) for each pair with equal indices.
  void fill_barrier(const Eigen::MatrixXd& inverse_scaling) {
    const auto d = static_cast<Eigen::Index>(normal_.dimension());
    r_.noalias() = inverse_scaling.transpose() * inverse_scaling;
    double* value = values(barrier_);
    for (Eigen::Index k = 0, column = 0; k < d; ++k) {
      for (Eigen::Index l = 0; l <= k; ++l, ++column) {
        const double column_scale = 0.5 * scale_[static_cast<std::size_t>(column)];
        std::size_t row = 0;
        for (Eigen::Index i = 0; i < d; ++i) {
          for (Eigen::Index j = 0; j <= i; ++j, ++row) {
            *value++ = scale_[row] * column_scale * (r_(i, k) * r_(j, l) + r_(i, l) * r_(j, k));
          }
        }
      }
    }
  }

  // Factor of the sum scaled to unit diagonal, with a small shift where it is not positive
  // definite.
  bool factorise_scaled(cholmod_sparse* sum) {
    const std::size_t p = diagonal_.size();
    for (std::size_t k = 0; k < p; ++k) {
      for (Long entry = starts(sum)[k]; entry < starts(sum)[k + 1]; ++entry) {
        if (indices(sum)[entry] == static_cast<Long>(k)) {
          diagonal_[k] = 1.0 / std::sqrt(values(sum)[entry]);
        }
      }
    }
    for (std::size_t k = 0; k < p; ++k) {
      for (Long entry = starts(sum)[k]; entry < starts(sum)[k + 1]; ++entry) {
        values(sum)[entry] *=
            diagonal_[k] * diagonal_[static_cast<std::size_t>(indices(sum)[entry])];
      }
    }
    sum->stype = -1;  // symmetric, from its lower triangle
    double shift[2] = {0.0, 0.0};
    for (int attempt = 0; attempt < 5; ++attempt) {
      if (stop_requested()) return false;
      const bool done = cholmod_l_factorize_p(sum, shift, nullptr, 0, factor_, &common_) != 0;
      if (done && common_.status == CHOLMOD_OK && factor_->minor == factor_->n) return true;
      shift[0] = shift[0] == 0.0 ? 1e-15 * static_cast<double>(p) : 100.0 * shift[0];
    }
    return false;
  }

  void solve_one(std::span<double> x) {
    auto* right_side = static_cast<double*>(right_side_->x);
    for (std::size_t k = 0; k < x.size(); ++k) right_side[k] = diagonal_[k] * x[k];
    cholmod_l_solve2(CHOLMOD_A, factor_, right_side_, nullptr, &solution_, nullptr, &work_y_,
                     &work_e_, &common_);
    const auto* solution = static_cast<const double*>(solution_->x);
    for (std::size_t k = 0; k < x.size(); ++k) x[k] = diagonal_[k] * solution[k];
  }

  void release() {
    cholmod_l_free_dense(&work_e_, &common_);
    cholmod_l_free_dense(&work_y_, &common_);
    cholmod_l_free_dense(&solution_, &common_);
    cholmod_l_free_dense(&right_side_, &common_);
    cholmod_l_free_factor(&factor_, &common_);
    cholmod_l_free_sparse(&barrier_, &common_);
    cholmod_l_free_sparse(&rows_, &common_);
    cholmod_l_finish(&common_);
  }

  const NormalizedSet& normal_;
  std::vector<double> scale_;     // 1 or sqrt(2)
  std::vector<double> diagonal_;  // of S, to the power -1/2
  Eigen::MatrixXd r_;
  cholmod_common common_{};
  cholmod_sparse* rows_ = nullptr;     // columns sqrt(D_i) a_i
  cholmod_sparse* barrier_ = nullptr;  // N, all p^2 entries
  cholmod_factor* factor_ = nullptr;
  cholmod_dense* right_side_ = nullptr;
  cholmod_dense* solution_ = nullptr;
  cholmod_dense* work_y_ = nullptr;
  cholmod_dense* work_e_ = nullptr;
};

}  // namespace

std::unique_ptr<RangeSystem> make_sparse_range_system(const NormalizedSet& normal,
                                                      int /*threads*/) {
  return std::make_unique<SparseRangeSystem>(normal);
}

}  // namespace graybox
