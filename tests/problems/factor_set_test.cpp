// Information sets in factor form: what they hold, their matrices, files and hash.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "problems/families/families.hpp"
#include "problems/formats/hdf5_file.hpp"
#include "problems/formats/information_set_file.hpp"
#include "problems/information/jacobian_information.hpp"
#include "problems/information/semidefinite_projection.hpp"
#include "tests/support/command_runner.hpp"
#include "tests/support/factor_sets.hpp"
#include "tests/support/refusal.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

using testing::expect_refused;
using testing::TemporaryFolder;
using namespace testing_sets;

std::vector<double> numbers_of(const InformationSet& set) {
  return {set.factors(), set.factors() + set.bytes() / sizeof(double)};
}

std::vector<double> matrices_as_numbers(const InformationSet& set) {
  return {set.data(), set.data() + set.candidate_count() * set.packed_size()};
}

TEST(FactorSet, HoldsFactorsAndMakesMatricesWhenAsked) {
  const InformationSet set = gaussian_factors(7, 3, 4, 1);
  const InformationSet copy = set;
  EXPECT_EQ(set.rank(), 3U);
  EXPECT_EQ(set.candidate_count(), 7U);
  EXPECT_EQ(set.bytes(), 7U * 3 * 4 * sizeof(double));
  const InformationSet matrices = as_matrices(set);
  EXPECT_EQ(set.content_hash(), matrices.content_hash());
  std::vector<double> buffer(set.packed_size());
  for (std::size_t i = 0; i < 7; ++i) {
    const auto packed = set.packed(i, buffer);
    EXPECT_EQ(packed.data(), buffer.data());
    for (std::size_t k = 0; k < packed.size(); ++k) {
      EXPECT_EQ(packed[k], matrices.information(i)[k]);
    }
  }
  EXPECT_FALSE(set.has_matrices());
  EXPECT_EQ(matrices_as_numbers(set), matrices_as_numbers(matrices));
  EXPECT_TRUE(set.has_matrices());
  EXPECT_TRUE(copy.has_matrices());  // they are shared
  EXPECT_EQ(copy.data(), set.data());
  EXPECT_EQ(set.content_hash(), matrices.content_hash());
  const std::vector<std::size_t> kept{5, 0, 5};
  const InformationSet subset = set.subset(kept);
  EXPECT_EQ(subset.rank(), 3U);
  EXPECT_EQ(subset.content_hash(), matrices.subset(kept).content_hash());
}

TEST(FactorSet, LongHashesAreThoseOfTheMatrices) {
  for (const std::size_t count : {255U, 256U, 257U, 1000U}) {
    const InformationSet set = gaussian_factors(count, 1, 3, count);
    EXPECT_EQ(set.content_hash(), as_matrices(set).content_hash()) << count;
  }
}

TEST(FactorSet, WhatIsNoSetIsRefused) {
  expect_refused([] { return InformationSet::of_factors(2, 0, AlignedArray(4, 1.0)); }, "one row");
  expect_refused([] { return InformationSet::of_factors(2, 3, AlignedArray(7, 1.0)); },
                 "7 numbers do not divide into factors of 3 x 2");
  const auto with = [](double entry) {
    return factor_set(4, 2, 2, [=](std::size_t i, std::size_t r, std::size_t j) {
      return i == 2 && r == 1 && j == 0 ? entry : 1.0 + static_cast<double>(r * j);
    });
  };
  with(0.5).validate();
  expect_refused([&] { with(std::numeric_limits<double>::quiet_NaN()).validate(); },
                 "candidate 2: entry (1, 0) of the factor is nan");
  expect_refused([&] { with(1e200).validate(); }, "candidate 2: the factor's square overflows");
  expect_refused(
      [] {
        return project_semidefinite(factor_set(
            9, 1, 2,
            [](std::size_t i, std::size_t, std::size_t) { return static_cast<double>(i); }));
      },
      "singular");
  // No memory is touched: the numbers are only promised.
  const InformationSet large = InformationSet::of_factors(1000, 1, AlignedArray(100'000'000));
  expect_refused([&] { static_cast<void>(large.data()); }, "works on matrices, not factors");
}

// A NumPy file made by hand.
template <typename Number>
void write_npy_array(const std::string& path, const std::string& descr, bool fortran,
                     const std::string& shape, const std::vector<double>& values) {
  std::string header = "{'descr': '" + descr +
                       "', 'fortran_order': " + (fortran ? "True" : "False") +
                       ", 'shape': " + shape + ", }";
  header.append(117 - header.size(), ' ');
  header += '\n';
  std::string bytes =
      std::string("\x93NUMPY\x01", 7) + '\0' + static_cast<char>(header.size()) + '\0' + header;
  for (const double value : values) {
    const auto number = static_cast<Number>(value);
    bytes.append(reinterpret_cast<const char*>(&number), sizeof number);
  }
  testing::write_text(path, bytes);
}

TEST(FactorSet, NumpyArraysInEveryLayout) {
  const TemporaryFolder folder;
  const std::string path = folder.file("factors.npy");
  constexpr std::size_t kQ = 5, kK = 2, kD = 3;
  const InformationSet set =
      factor_set(kQ, kK, kD, [](std::size_t i, std::size_t r, std::size_t j) {
        return static_cast<double>(i * i + 3 * r) - 1.25 * static_cast<double>(j * r + i * j);
      });
  std::vector<double> fortran;
  for (std::size_t j = 0; j < kD; ++j) {
    for (std::size_t r = 0; r < kK; ++r) {
      for (std::size_t i = 0; i < kQ; ++i) fortran.push_back(set.factor(i)[r * kD + j]);
    }
  }
  const ReadOptions options{.variable = {}, .factors = true};
  const auto expect_read = [&](std::size_t rank) {
    const InformationSet read = read_information_set(path, options);
    EXPECT_EQ(read.rank(), rank);
    EXPECT_EQ(read.dimension(), kD);
    EXPECT_EQ(numbers_of(read), numbers_of(set));
  };
  write_npy_array<double>(path, "<f8", false, "(5, 2, 3)", numbers_of(set));
  expect_read(2);
  write_npy_array<float>(path, "<f4", false, "(5, 2, 3)", numbers_of(set));
  expect_read(2);
  write_npy_array<double>(path, "<f8", true, "(5, 2, 3)", fortran);
  expect_read(2);
  write_npy_array<float>(path, "<f4", true, "(5, 2, 3)", fortran);
  expect_read(2);
  write_npy_array<double>(path, "<f8", false, "(10, 3)", numbers_of(set));
  expect_read(1);
  write_npy_array<double>(path, "<f8", false, "(30,)", numbers_of(set));
  expect_refused([&] { return read_information_set(path, options); }, "expected factors [Q x d]");
  write_npy_array<double>(path, "<f8", false, "(11, 3)", numbers_of(set));
  expect_refused([&] { return read_information_set(path, options); }, "truncated");
  write_npy_array<double>(path, "<f8", false, "(5, 2, 3)", numbers_of(set));
  expect_refused([&] { return read_information_set(path); }, "--factors");
}

TEST(FactorSet, TextHasOneVectorALine) {
  const TemporaryFolder folder;
  const std::string path = folder.file("vectors.csv");
  testing::write_text(path, "constant,dose\n1,0\n1,0.5\n1,1\n");
  const InformationSet set = read_information_set(path, {.variable = {}, .factors = true});
  EXPECT_EQ(set.rank(), 1U);
  EXPECT_EQ(set.parameters(), (std::vector<std::string>{"constant", "dose"}));
  EXPECT_EQ(numbers_of(set), (std::vector<double>{1, 0, 1, 0.5, 1, 1}));
}

TEST(FactorSet, Hdf5KeepsFactorsAndTheOthersMatrices) {
  const TemporaryFolder folder;
  const std::string path = folder.file("set.h5");
  for (const std::size_t rank : {1U, 3U}) {
    const InformationSet set = gaussian_factors(20, rank, 4, rank);
    const InformationSet named = InformationSet::of_factors(
        4, rank, AlignedArray::borrowed(set.factors(), 20 * rank * 4),
        {{"x"}, {"deg"}, std::vector<double>(20, 1.5)}, {"a", "b", "c", "d"});
    write_information_set(path, named);
    EXPECT_FALSE(named.has_matrices());
    const InformationSet read = read_information_set(path);
    EXPECT_EQ(read.rank(), rank);
    EXPECT_EQ(numbers_of(read), numbers_of(set));
    EXPECT_EQ(read.parameters(), named.parameters());
    EXPECT_EQ(read.candidates().values, named.candidates().values);
    EXPECT_EQ(read.content_hash(), set.content_hash());
    EXPECT_FALSE(read.has_matrices());
    const InformationSlice slice = read_hdf5_slice(path, 1, 3);
    EXPECT_EQ(slice.first, 6U);
    EXPECT_EQ(slice.total, 20U);
    EXPECT_EQ(slice.problem_hash, set.content_hash());
    std::vector<std::size_t> expected(7);
    std::iota(expected.begin(), expected.end(), std::size_t{6});
    EXPECT_EQ(numbers_of(slice.set), numbers_of(set.subset(expected)));
    expect_refused([&] { return read_hdf5_slice(path, 0, 21); }, "can't be shared");
    for (const char* other : {"set.npy", "set.csv", "set.mat"}) {
      write_information_set(folder.file(other), read);
      const InformationSet matrices = read_information_set(folder.file(other));
      EXPECT_FALSE(matrices.has_factors());
      EXPECT_EQ(matrices.content_hash(), set.content_hash());
    }
  }
  expect_refused([&] { return read_information_set(path, {.variable = {}, .factors = true}); },
                 "leave it out");
}

TEST(FactorSet, FamiliesAndJacobiansGiveTheSameProblem) {
  for (const char* name : {"r1g", "r1l"}) {
    const InformationSet factors = make_family(name, 50, 5, 3, SetForm::kFactors);
    EXPECT_EQ(factors.rank(), 1U);
    EXPECT_EQ(factors.content_hash(), make_family(name, 50, 5, 3).content_hash());
  }
  expect_refused([] { return make_family("wis", 50, 5, 3, SetForm::kFactors); }, "no factors");
  const InformationSet source = gaussian_factors(30, 2, 3, 8);
  const Jacobians jacobians{.candidates = 30,
                            .outputs = 2,
                            .parameters = 3,
                            .values = numbers_of(source),
                            .names = {"a", "b", "c"},
                            .table = {{"x"}, {""}, std::vector<double>(30, 0.5)}};
  const std::vector<double> covariance{4.0, 1.0, 1.0, 2.0};
  const JacobianNoise noise = JacobianNoise::covariance(covariance, 2);
  const InformationSet matrices = information_set_from_jacobians(jacobians, noise);
  const InformationSet factors =
      information_set_from_jacobians(jacobians, noise, SetForm::kFactors);
  EXPECT_EQ(factors.rank(), 2U);
  EXPECT_EQ(factors.parameters(), matrices.parameters());
  EXPECT_EQ(factors.candidates().values, matrices.candidates().values);
  const std::vector<double> theta{0.1, -0.2, 0.3};
  const auto expect_equal = [](const InformationSet& one, const InformationSet& two) {
    for (std::size_t k = 0; k < 30 * 6; ++k) {
      EXPECT_NEAR(one.data()[k], two.data()[k], 1e-14 * (1.0 + std::abs(two.data()[k])));
    }
  };
  expect_equal(factors, matrices);
  for (const auto model : {GeneralisedLinearModel::kLogistic, GeneralisedLinearModel::kPoisson}) {
    expect_equal(generalised_linear_set(jacobians, model, theta, SetForm::kFactors),
                 generalised_linear_set(jacobians, model, theta));
  }
}

}  // namespace
}  // namespace graybox
