#include "solvers/core/tiled_cholesky.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "problems/base/stop.hpp"
#include "solvers/core/lapack.hpp"

extern "C" {
void dtrsm_(const char* side, const char* uplo, const char* trans, const char* diag, const int* m,
            const int* n, const double* alpha, const double* a, const int* lda, double* b,
            const int* ldb, std::size_t, std::size_t, std::size_t, std::size_t);
void dgemm_(const char* trans_a, const char* trans_b, const int* m, const int* n, const int* k,
            const double* alpha, const double* a, const int* lda, const double* b, const int* ldb,
            const double* beta, double* c, const int* ldc, std::size_t, std::size_t);
}

namespace graybox {
namespace {

constexpr std::size_t kTile = 192;

class Tiles {
 public:
  Tiles(std::size_t n, double* a) : n_(n), leading_(static_cast<int>(n)), a_(a) {}

  [[nodiscard]] std::size_t count() const { return (n_ + kTile - 1) / kTile; }
  [[nodiscard]] const int* leading() const { return &leading_; }
  [[nodiscard]] double* at(std::size_t i, std::size_t j) const {
    return a_ + j * kTile * n_ + i * kTile;
  }
  [[nodiscard]] int size(std::size_t i) const {
    return static_cast<int>(std::min(kTile, n_ - i * kTile));
  }
  // Of the lower triangle from tile `first` on, the costliest order first.
  [[nodiscard]] std::vector<std::pair<std::size_t, std::size_t>> below(std::size_t first) const {
    std::vector<std::pair<std::size_t, std::size_t>> pairs;
    for (std::size_t j = first; j < count(); ++j) {
      for (std::size_t i = j; i < count(); ++i) pairs.emplace_back(i, j);
    }
    return pairs;
  }

 private:
  std::size_t n_;
  int leading_;
  double* a_;
};

bool factorise_diagonal(const Tiles& tiles, std::size_t k) {
  const int size = tiles.size(k);
  int info = 0;
  dpotrf_("L", &size, tiles.at(k, k), tiles.leading(), &info, 1);
  return info == 0;
}

// The column of tiles below the diagonal, times L_kk^-T.
void solve_column(const Tiles& tiles, std::size_t k, int threads) {
  const double one = 1.0;
#pragma omp parallel for num_threads(threads) schedule(dynamic) if (threads > 1)
  for (std::size_t i = k + 1; i < tiles.count(); ++i) {
    const int rows = tiles.size(i), columns = tiles.size(k);
    dtrsm_("R", "L", "T", "N", &rows, &columns, &one, tiles.at(k, k), tiles.leading(),
           tiles.at(i, k), tiles.leading(), 1, 1, 1, 1);
  }
}

// A_ij -= L_ik L_jk^T for all tiles that are left.
void update_rest(const Tiles& tiles, std::size_t k, int threads) {
  const auto pairs = tiles.below(k + 1);
  const double minus = -1.0, one = 1.0;
#pragma omp parallel for num_threads(threads) schedule(dynamic) if (threads > 1)
  for (std::size_t pair = 0; pair < pairs.size(); ++pair) {
    const auto [i, j] = pairs[pair];
    const int rows = tiles.size(i), columns = tiles.size(j), depth = tiles.size(k);
    if (i == j) {
      dsyrk_("L", "N", &rows, &depth, &minus, tiles.at(i, k), tiles.leading(), &one, tiles.at(i, i),
             tiles.leading(), 1, 1);
    } else {
      dgemm_("N", "T", &rows, &columns, &depth, &minus, tiles.at(i, k), tiles.leading(),
             tiles.at(j, k), tiles.leading(), &one, tiles.at(i, j), tiles.leading(), 1, 1);
    }
  }
}

}  // namespace

bool factorise_cholesky_tiled(std::size_t n, double* a, int threads) {
  lapack::require_room(threads);
  const Tiles tiles(n, a);
  for (std::size_t k = 0; k < tiles.count(); ++k) {
    if (stop_requested() || !factorise_diagonal(tiles, k)) return false;
    solve_column(tiles, k, threads);
    update_rest(tiles, k, threads);
  }
  return true;
}

bool gram_tiled(std::size_t n, std::size_t k, const double* a, double* c, int threads) {
  lapack::require_room(threads);
  const Tiles tiles(n, c);
  const auto pairs = tiles.below(0);
  const int depth = static_cast<int>(k);
  const double one = 1.0, zero = 0.0;
  const StopClock clock;
#pragma omp parallel for num_threads(threads) schedule(dynamic) if (threads > 1)
  for (std::size_t pair = 0; pair < pairs.size(); ++pair) {
    if (clock.stops()) continue;
    const auto [i, j] = pairs[pair];
    const int rows = tiles.size(i), columns = tiles.size(j);
    const double* left = a + i * kTile * k;
    const double* right = a + j * kTile * k;
    if (i == j) {
      dsyrk_("L", "T", &rows, &depth, &one, left, &depth, &zero, tiles.at(i, i), tiles.leading(), 1,
             1);
    } else {
      dgemm_("T", "N", &rows, &columns, &depth, &one, left, &depth, right, &depth, &zero,
             tiles.at(i, j), tiles.leading(), 1, 1);
    }
  }
  return !clock.stops();
}

}  // namespace graybox
