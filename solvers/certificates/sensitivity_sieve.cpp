#include "solvers/certificates/sensitivity_sieve.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "problems/base/packed_matrix.hpp"

namespace graybox {
namespace {

constexpr std::size_t kLanes = 8;
constexpr double kUnit = std::numeric_limits<double>::epsilon() / 2;
constexpr double kRoom = 2.0 * 1.001;  // for extended precision, and for computing the bound itself
constexpr double kUnderflow = 1e-290;  // more than products lost to underflow can sum up to
constexpr double kLargest = 1e140;     // of X; its reciprocal is the smallest

// Plain doubles of what extended precision has, or none if that loses more than rounding.
std::vector<double> rounded(std::span<const Extended> values, Extended largest) {
  std::vector<double> out(values.size());
  for (std::size_t k = 0; k < values.size(); ++k) {
    const Extended size = std::abs(values[k]);
    if (size != 0 && !(size <= largest && size >= 1 / largest)) return {};
    out[k] = static_cast<double>(values[k]);
  }
  return out;
}

// Eight numbers, one a candidate: as many vectors of the processor as that takes.
using Lanes = double __attribute__((vector_size(kLanes * sizeof(double))));

class FactorSieve {
 public:
  FactorSieve(const InformationSet& set, const ExtendedInformation& information)
      : set_(set),
        d_(set.dimension()),
        x_(rounded(information.inverse_factor(), kLargest)),
        diagonal_(information.diagonal()),
        rows_(d_) {
    for (std::size_t j = 0; usable() && j < d_; ++j) {
      columns_.push_back(d_);
      while (columns_[j] > 0 && x_[j * d_ + columns_[j] - 1] == 0.0) --columns_[j];
    }
    const auto chain = static_cast<double>(4 * (set.rank() * d_ + 2 * d_ + 4));
    error_ = kRoom * chain * kUnit * static_cast<double>(d_);
  }
  [[nodiscard]] bool usable() const { return !x_.empty(); }

  // Candidates from .. from + count - 1, count at most kLanes: traces and bounds of their errors.
  void price(std::size_t from, std::size_t count, Lanes& traces, Lanes& errors) {
    traces = errors = Lanes{};
    for (std::size_t r = 0; r < set_.rank(); ++r) {
      gather(from, count, r);
      for (std::size_t j = 0; j < d_; ++j) add_square(x_.data() + j * d_, columns_[j], traces);
      for (std::size_t a = 0; a < d_; ++a) errors += diagonal_[a] * rows_[a] * rows_[a];
    }
    errors = error_ * errors + kUnderflow;
  }

 private:
  void gather(std::size_t from, std::size_t count, std::size_t row) {
    for (std::size_t l = 0; l < kLanes; ++l) {
      const double* f = set_.factor(from + std::min(l, count - 1)).data() + row * d_;
      for (std::size_t a = 0; a < d_; ++a) rows_[a][l] = f[a];
    }
  }
  void add_square(const double* x, std::size_t columns, Lanes& traces) const {
    Lanes y{};
    for (std::size_t a = 0; a < columns; ++a) y += x[a] * rows_[a];
    traces += y * y;
  }

  const InformationSet& set_;
  std::size_t d_;
  std::vector<double> x_;             // d x d, row-major
  std::vector<std::size_t> columns_;  // of each row, without the zeros at its end
  std::span<const double> diagonal_;
  std::vector<Lanes> rows_;  // one row of each candidate's factor, by columns
  double error_ = 0.0;       // of the sum over a of W_aa f_a^2
};

class MatrixSieve {
 public:
  MatrixSieve(const InformationSet& set, const ExtendedInformation& information)
      : set_(set),
        d_(set.dimension()),
        dual_(rounded(information.dual(), Extended{kLargest} * kLargest)),
        diagonal_(information.diagonal()) {
    const auto chain = static_cast<double>(set.packed_size() + 2 * d_ + 5);
    error_ = kRoom * chain * kUnit * static_cast<double>(d_);
  }
  [[nodiscard]] bool usable() const { return !dual_.empty(); }

  void price(std::size_t from, std::size_t count, Lanes& traces, Lanes& errors) const {
    for (std::size_t l = 0; l < count; ++l) {
      const double* h = set_.information(from + l).data();
      traces[l] = trace(h);
      double magnitude = 0.0;
      for (std::size_t a = 0; a < d_; ++a) magnitude += diagonal_[a] * h[packed_index(a, a)];
      errors[l] = error_ * magnitude + kUnderflow;
    }
  }

 private:
  [[nodiscard]] double trace(const double* h) const {
    Lanes part{};
    const std::size_t p = dual_.size(), whole = p / kLanes * kLanes;
    for (std::size_t k = 0; k < whole; k += kLanes) {
      Lanes dual, numbers;
      std::memcpy(&dual, dual_.data() + k, sizeof dual);
      std::memcpy(&numbers, h + k, sizeof numbers);
      part += dual * numbers;
    }
    double sum = 0.0;
    for (std::size_t k = whole; k < p; ++k) sum += dual_[k] * h[k];
    for (std::size_t l = 0; l < kLanes; ++l) sum += part[l];
    return sum;
  }

  const InformationSet& set_;
  std::size_t d_;
  std::vector<double> dual_;
  std::span<const double> diagonal_;
  double error_ = 0.0;  // of the sum over a of W_aa H_aa
};

template <class Sieve>
double sieve(Sieve pricer, std::size_t candidates, std::span<double> upper) {
  double floor = -std::numeric_limits<double>::infinity();
  if (!pricer.usable()) return floor;
  Lanes traces{}, errors{};
  for (std::size_t from = 0; from < candidates; from += kLanes) {
    const std::size_t count = std::min(kLanes, candidates - from);
    pricer.price(from, count, traces, errors);
    for (std::size_t l = 0; l < count; ++l) {
      upper[from + l] = traces[l] + errors[l];
      if (std::isfinite(upper[from + l])) floor = std::max(floor, traces[l] - errors[l]);
    }
  }
  return floor;
}

}  // namespace

double sieve_sensitivities(const InformationSet& set, const ExtendedInformation& information,
                           std::span<double> upper) {
  if (set.has_factors()) return sieve(FactorSieve(set, information), upper.size(), upper);
  return sieve(MatrixSieve(set, information), upper.size(), upper);
}

}  // namespace graybox
