#include "problems/information/information_set.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <set>
#include <vector>

#include "problems/base/error.hpp"
#include "problems/base/packed_matrix.hpp"
#include "problems/base/random.hpp"
#include "problems/information/semidefinite_projection.hpp"
#include "problems/kernels/kernels.hpp"

namespace graybox {
namespace {

InformationSet make_set(std::size_t dimension, const std::vector<double>& values) {
  AlignedArray information(values.size());
  std::ranges::copy(values, information.begin());
  return InformationSet(dimension, std::move(information), {}, {}, "test.h5");
}

std::string error_of(const InformationSet& set) {
  try {
    set.validate();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(InformationSet, MayUseSomebodyElsesMemory) {
  const std::vector<double> packed{1.0, 0.0, 0.0, 0.0, 0.0, 1.0};
  InformationSet set(2, AlignedArray::borrowed(packed.data(), packed.size()));
  EXPECT_EQ(set.data(), packed.data());
  const InformationSet moved = std::move(set);
  EXPECT_EQ(moved.data(), packed.data());
  const InformationSet copy = moved;
  EXPECT_NE(copy.data(), packed.data());
  EXPECT_EQ(copy.content_hash(), moved.content_hash());
}

TEST(InformationSet, AcceptsTwoOrthogonalCandidates) {
  const InformationSet set = make_set(2, {1, 0, 0, 0, 0, 1});
  EXPECT_EQ(set.candidate_count(), 2U);
  EXPECT_NO_THROW(set.validate());
}

TEST(InformationSet, NamesTheCandidateThatIsNotFinite) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(error_of(make_set(2, {1, 0, 1, 1, nan, 1})).find("test.h5: candidate 1: entry 1"),
            std::string::npos);
}

TEST(InformationSet, NamesTheCandidateThatIsIndefinite) {
  EXPECT_NE(
      error_of(make_set(2, {1, 0, 1, 1, 2, 1})).find("candidate 1: the information matrix is"),
      std::string::npos);
  EXPECT_NE(error_of(make_set(2, {-1, 0, 1})).find("candidate 0"), std::string::npos);
}

TEST(InformationSet, RefusesASingularSum) {
  EXPECT_NE(error_of(make_set(2, {1, 0, 0, 2, 0, 0})).find("no candidate informs"),
            std::string::npos);
  EXPECT_NE(error_of(make_set(2, {1, 1, 1, 2, 2, 2})).find("is singular"), std::string::npos);
}

// Finding S3: what is missing is named, with the way out.
TEST(InformationSet, NamesTheCombinationThatNoCandidateInforms) {
  const std::string error = error_of(make_set(2, {1, 1, 1, 2, 2, 2}));
  EXPECT_NE(error.find("0.71 parameter 0 - 0.71 parameter 1"), std::string::npos) << error;
  EXPECT_NE(error.find("T H T'"), std::string::npos) << error;
}

// Finding S3.
TEST(InformationSet, NearlySemidefiniteMatricesAreReplacedByTheNearest) {
  const auto near = [](double x) {  // eigenvalues 2 and -x
    return make_set(2, {1 - x / 2, 1 + x / 2, 1 - x / 2, 1, 0, 1});
  };
  const ProjectedSet changed = project_semidefinite(near(1e-7));
  EXPECT_EQ(changed.changed.candidates, 1U);
  EXPECT_NEAR(changed.changed.smallest_eigenvalue, -0.5e-7, 1e-12);
  for (const double entry : changed.set.information(0)) EXPECT_NEAR(entry, 1.0, 1e-12);
  EXPECT_EQ(project_semidefinite(near(1e-10)).changed.candidates, 0U);
  EXPECT_THROW((void)project_semidefinite(near(1e-5)), InputError);
  EXPECT_EQ(project_semidefinite(near(1e-5), 1e-4).changed.candidates, 1U);
  EXPECT_THROW((void)project_semidefinite(make_set(1, {-1.0}), 1e-2), InputError);
}

TEST(InformationSet, UnitsOfTheParametersDoNotMatterToValidation) {
  EXPECT_NO_THROW(make_set(2, {1e-12, 0, 0, 0, 0, 1e12}).validate());
}

TEST(InformationSet, WrongShapesThrow) {
  EXPECT_THROW(make_set(2, {1, 0, 1, 1}), InputError);
  EXPECT_THROW(make_set(0, {1}), InputError);
  EXPECT_THROW(make_set(2, {}), InputError);
}

TEST(InformationSet, HashIsTheStatedSha256) {
  // printf of the 8 little-endian bytes of Q = 1, of d = 1, and of the double 1.0, by sha256sum.
  EXPECT_EQ(make_set(1, {1.0}).content_hash(),
            "7b7c534f75278483fc012dbb043b0f033e3e2a04c9e970020d17336ea0f2ef4d");
}

TEST(InformationSet, NestedSubsetsAreNestedAndDistinct) {
  const auto small = nested_subset(1000, 50, 7);
  const auto large = nested_subset(1000, 1000, 7);
  EXPECT_TRUE(std::ranges::equal(small, std::span(large).first(50)));
  EXPECT_EQ(std::set<std::size_t>(large.begin(), large.end()).size(), 1000U);
  EXPECT_NE(nested_subset(1000, 50, 8), small);
}

TEST(Kernels, AgreeWithPlainLoopsForEveryShape) {
  Random random(3);
  for (std::size_t p : {1UL, 3UL, 6UL, 10UL, 78UL, 171UL, 820UL}) {
    for (std::size_t count : {1UL, 2UL, 3UL, 4UL, 5UL, 9UL}) {
      std::vector<double> data(p * count), dual(p), out(count), sum(p, 1.0), weights(count);
      for (double& x : data) x = random.normal();
      for (double& x : dual) x = random.normal();
      for (double& x : weights) x = random.uniform();
      kernels().price(data.data(), count, p, dual.data(), out.data());
      kernels().accumulate(data.data(), count, p, weights.data(), sum.data());
      double total = 0.0;
      for (std::size_t i = 0; i < count; ++i) {
        double expected = 0.0;
        for (std::size_t k = 0; k < p; ++k) expected += data[i * p + k] * dual[k];
        EXPECT_NEAR(out[i], expected, 1e-12 * static_cast<double>(p));
      }
      for (std::size_t k = 0; k < p; ++k) {
        double expected = 1.0;
        for (std::size_t i = 0; i < count; ++i) expected += data[i * p + k] * weights[i];
        EXPECT_NEAR(sum[k], expected, 1e-13 * static_cast<double>(count));
      }
      for (double x : data) total += x;
      EXPECT_NEAR(kernels().sum(data.data(), data.size()), total, 1e-11);
    }
  }
}

}  // namespace
}  // namespace graybox
