// Closed forms and symmetries of the distributions.
#include "problems/base/distributions.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "problems/base/error.hpp"

namespace graybox {
namespace {

TEST(Distributions, ChiSquareHasItsClosedFormsAtOneAndTwoDegrees) {
  for (const double x : {0.1, 1.0, 3.0, 12.0}) {
    EXPECT_NEAR(chi_square_tail(x, 2.0), std::exp(-0.5 * x), 1e-14);
    EXPECT_NEAR(chi_square_tail(x, 1.0), 2.0 * normal_tail(std::sqrt(x)), 1e-14);
  }
}

TEST(Distributions, QuantilesInvertTails) {
  for (const double p : {0.01, 0.3, 0.95, 0.999}) {
    EXPECT_NEAR(normal_tail(normal_quantile(p)), 1.0 - p, 1e-12);
    EXPECT_NEAR(chi_square_tail(chi_square_quantile(p, 7.0), 7.0), 1.0 - p, 1e-12);
    EXPECT_NEAR(fisher_tail(fisher_quantile(p, 3.0, 9.0), 3.0, 9.0), 1.0 - p, 1e-12);
  }
}

TEST(Distributions, FisherTendsToChiSquareAndSwapsWithItsInverse) {
  EXPECT_NEAR(fisher_tail(2.5, 4.0, 1e9), chi_square_tail(10.0, 4.0), 1e-7);
  EXPECT_NEAR(fisher_tail(2.5, 4.0, 9.0), 1.0 - fisher_tail(0.4, 9.0, 4.0), 1e-13);
}

TEST(Distributions, PowerIsTheLevelWithoutAnEffectAndThatOfANormalForOneDegree) {
  const double threshold = chi_square_quantile(0.95, 1.0);
  EXPECT_NEAR(noncentral_chi_square_tail(threshold, 1.0, 0.0), 0.05, 1e-12);
  const double shift = 3.24;
  const double root = std::sqrt(threshold);
  EXPECT_NEAR(noncentral_chi_square_tail(threshold, 1.0, shift * shift),
              normal_tail(root - shift) + normal_tail(root + shift), 1e-12);
}

TEST(Distributions, RefuseWhatIsNoProbability) {
  EXPECT_THROW((void)chi_square_quantile(1.0, 3.0), InputError);
  EXPECT_THROW((void)chi_square_tail(1.0, 0.0), InputError);
  EXPECT_THROW((void)normal_quantile(-0.1), InputError);
}

}  // namespace
}  // namespace graybox
