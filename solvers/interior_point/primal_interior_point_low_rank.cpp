#include "solvers/interior_point/primal_interior_point_low_rank.hpp"

#include <algorithm>

#include "solvers/interior_point/augmented_system.hpp"

namespace graybox {
namespace {

// (A N^-1 A^T + D^-1) b' = b with N = P^-1 (x) P^-1 is the augmented system with r = 0, t = b and
// y = -b'.
class LowRankPrimalSystem final : public PrimalSystem {
 public:
  LowRankPrimalSystem(const NormalizedSet& normal, int threads)
      : system_(normal, make_dense_range_system(normal, threads), threads),
        entries_(normal.packed_size()),
        solution_(normal.candidate_count()),
        image_(normal.candidate_count()) {}

  bool factorise(const Eigen::MatrixXd& inverse_scaling, std::span<const double> ratios) override {
    return system_.factorise(inverse_scaling, ratios);
  }

  void solve(std::span<double> x) override {
    std::ranges::fill(entries_, 0.0);
    system_.solve(entries_, x, solution_, image_);
    for (std::size_t i = 0; i < x.size(); ++i) x[i] = -solution_[i];
  }

  [[nodiscard]] double factorise_passes() const override { return 1.0; }
  [[nodiscard]] double solve_passes() const override { return 2.0; }

 private:
  AugmentedSystem system_;
  std::vector<double> entries_;
  std::vector<double> solution_;
  std::vector<double> image_;
};

}  // namespace

std::unique_ptr<PrimalSystem> make_low_rank_primal_system(const NormalizedSet& normal,
                                                          int threads) {
  return std::make_unique<LowRankPrimalSystem>(normal, threads);
}

Solution PrimalInteriorPointLowRank::solve(const InformationSet& set, const SolveOptions& options,
                                           SolveObserver* observer) const {
  return solve_primal(set, options, observer, make_low_rank_primal_system);
}

}  // namespace graybox
