#include "tests/hostile_sets/hostile_sets.hpp"

#include <Eigen/Core>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <boost/multiprecision/cpp_bin_float.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <utility>

#include "tests/support/design_sets.hpp"

namespace graybox::testing_sets {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Matrices = std::vector<MatrixXd>;

Index whole(Random& random, Index from, Index to) {
  return from + static_cast<Index>(random.below(static_cast<std::uint64_t>(to - from + 1)));
}

double power(Random& random, double from, double to) {
  return std::pow(10.0, random.uniform(from, to));
}

MatrixXd wishart_matrix(Index d, Index rank, Random& random) {
  const MatrixXd g = gaussian(d, rank, random);
  return g * g.transpose();
}

Matrices wisharts(Index d, Index count, Index rank, Random& random) {
  Matrices all;
  for (Index i = 0; i < count; ++i) all.push_back(wishart_matrix(d, rank, random));
  return all;
}

// About as many candidates as the slow back-ends bear.
Index some_candidates(Random& random) { return whole(random, 8, 48); }
Index some_parameters(Random& random) { return whole(random, 2, 7); }

Matrices plain(Random& random) {
  const Index d = some_parameters(random);
  return wisharts(d, some_candidates(random), whole(random, 1, d), random);
}

// H -> T H T^T
void transform(Matrices& all, const MatrixXd& t) {
  for (MatrixXd& h : all) h = (t * h * t.transpose()).eval();
}

void scale_parameters(Matrices& all, Random& random, double decades) {
  VectorXd scale(all.front().rows());
  for (double& x : scale) x = power(random, -decades, decades);
  transform(all, scale.asDiagonal());
}

void scale_candidates(Matrices& all, Random& random, double decades) {
  for (MatrixXd& h : all) h *= power(random, -decades, decades);
}

void round_to_single(Matrices& all) {
  for (MatrixXd& h : all) h = h.cast<float>().cast<double>();
}

// Copies of a few different matrices, each up to a relative disturbance.
Matrices copies(Random& random, double disturbance) {
  const Index d = some_parameters(random), different = whole(random, 3, 8);
  const Matrices few = wisharts(d, different, whole(random, 1, d), random);
  Matrices all;
  const Index count = some_candidates(random);
  for (Index i = 0; i < count; ++i) {
    const auto of = static_cast<std::size_t>(i < different ? i : whole(random, 0, different - 1));
    all.push_back(few[of] * (1.0 + disturbance * random.normal()));
  }
  return all;
}

// f(x) f(x)^T over a grid of [from, to].
template <class Function>
Matrices curve(Index d, Index count, double from, double to, const Function& function) {
  Matrices all;
  for (Index i = 0; i < count; ++i) {
    const double x = from + (to - from) * static_cast<double>(i) / static_cast<double>(count - 1);
    VectorXd f(d);
    for (Index k = 0; k < d; ++k) f(k) = function(k, x);
    all.emplace_back(f * f.transpose());
  }
  return all;
}

// Sees one direction only through few candidates, and weakly.
Matrices weak_direction(Random& random, double from, double to) {
  const Index d = whole(random, 2, 7), count = some_candidates(random);
  const MatrixXd q = gaussian(d, d, random).householderQr().householderQ();
  Matrices all;
  for (Index i = 0; i < count; ++i) {
    MatrixXd g = gaussian(d, whole(random, 1, d), random);
    g.row(d - 1) *= i % 4 == 0 ? std::sqrt(power(random, from, to)) : 0.0;
    all.emplace_back(q * g * g.transpose() * q.transpose());
  }
  return all;
}

Matrices blocks(Random& random) {
  const Index first = whole(random, 1, 4), second = whole(random, 1, 4);
  Matrices all;
  const Index count = some_candidates(random);
  for (Index i = 0; i < count; ++i) {
    MatrixXd h = MatrixXd::Zero(first + second, first + second);
    if (i % 2 == 0) {
      h.topLeftCorner(first, first) = wishart_matrix(first, first, random);
    } else {
      h.bottomRightCorner(second, second) = wishart_matrix(second, second, random);
    }
    all.push_back(h);
  }
  return all;
}

// 2^k points, main effects and, where asked for, products of two.
Matrices factorial(Index factors, bool products) {
  Matrices all;
  for (Index point = 0; point < (Index{1} << factors); ++point) {
    std::vector<double> f{1.0};
    for (Index k = 0; k < factors; ++k) f.push_back(((point >> k) & 1) == 1 ? 1.0 : -1.0);
    for (Index a = 1; products && a <= factors; ++a) {
      for (Index b = a + 1; b <= factors; ++b) {
        f.push_back(f[static_cast<std::size_t>(a)] * f[static_cast<std::size_t>(b)]);
      }
    }
    const VectorXd v = Eigen::Map<const VectorXd>(f.data(), static_cast<Index>(f.size()));
    all.emplace_back(v * v.transpose());
  }
  return all;
}

// Images of one matrix under the cyclic permutations of the parameters: ties everywhere.
Matrices cyclic(Random& random) {
  const Index d = whole(random, 3, 6);
  Matrices all;
  for (Index orbit = whole(random, 1, 4); orbit > 0; --orbit) {
    const MatrixXd h = wishart_matrix(d, whole(random, 1, d), random);
    for (Index shift = 0; shift < d; ++shift) {
      Eigen::PermutationMatrix<Eigen::Dynamic> p(d);
      for (Index k = 0; k < d; ++k) p.indices()(k) = static_cast<int>((k + shift) % d);
      all.emplace_back(p * h * p.transpose());
    }
  }
  return all;
}

Matrices diagonal(Random& random) {
  const Index d = some_parameters(random), count = some_candidates(random);
  Matrices all;
  for (Index i = 0; i < count; ++i) {
    MatrixXd h = MatrixXd::Zero(d, d);
    h(i % d, i % d) = 1.0 + random.uniform();
    h(whole(random, 0, d - 1), whole(random, 0, d - 1)) += 0.0;
    all.push_back(h);
  }
  return all;
}

// Second differences of a log likelihood: symmetric noise of 1e-8 in every entry.
Matrices finite_differences(Random& random) {
  Matrices all = plain(random);
  for (MatrixXd& h : all) {
    const MatrixXd noise = gaussian(h.rows(), h.rows(), random);
    h += 1e-8 * h.diagonal().maxCoeff() / static_cast<double>(h.rows()) *
         (noise + noise.transpose());
  }
  return all;
}

// Sums of exponentials with different rates, where neighbours look alike.
Matrices exponentials(Random& random) {
  const Index d = whole(random, 2, 4);
  const double spread = random.uniform(0.3, 2.0);
  return curve(d, some_candidates(random), 0.0, 5.0, [&](Index k, double x) {
    return std::exp(-(0.3 + spread * static_cast<double>(k)) * x);
  });
}

Matrices saturation(Random& random) {  // Michaelis and Menten, by both parameters
  const double half = power(random, -3, 3);
  return curve(2, some_candidates(random), 1e-3, 10.0, [&](Index k, double x) {
    return k == 0 ? x / (half + x) : -x / ((half + x) * (half + x));
  });
}

Matrices hats(Random& random) {  // linear splines: each candidate sees two neighbours
  const Index d = whole(random, 3, 8);
  return curve(
      d, some_candidates(random) + 2 * d, 0.0, static_cast<double>(d - 1),
      [](Index k, double x) { return std::max(0.0, 1.0 - std::abs(x - static_cast<double>(k))); });
}

Matrices monomials(Random& random, double from) {
  return curve(whole(random, 3, 9), whole(random, 20, 60), from, 1.0,
               [](Index k, double x) { return std::pow(x, static_cast<double>(k)); });
}

Matrices chebyshev(Random& random) {
  return curve(whole(random, 3, 12), whole(random, 30, 60), -1.0, 1.0, [](Index k, double x) {
    return std::cos(static_cast<double>(k) * std::acos(std::clamp(x, -1.0, 1.0)));
  });
}

Matrices correlated(Random& random, Index rank, double decades) {
  const Index d = some_parameters(random);
  Matrices all = wisharts(d, some_candidates(random), rank, random);
  const MatrixXd q = gaussian(d, d, random).householderQr().householderQ();
  VectorXd stretch(d);
  for (double& x : stretch) x = power(random, -decades / 2, decades / 2);
  transform(all, q * stretch.asDiagonal() * q.transpose());
  return all;
}

Matrices with_zeros(Random& random) {
  Matrices all = plain(random);
  for (std::size_t i = 0; i < all.size(); i += 3) all[i].setZero();
  return all;
}

Matrices dominated(Random& random) {
  Matrices all = plain(random);
  all.front() *= 1e12;
  return all;
}

Matrices nearly_flat(Random& random) {
  const Index d = some_parameters(random);
  Matrices all = wisharts(d, some_candidates(random), d, random);
  const double size = power(random, -12, -3);
  for (MatrixXd& h : all) h = (MatrixXd::Identity(d, d) + size * h).eval();
  return all;
}

Matrices two_scales(Random& random) {
  Matrices all = blocks(random);
  for (std::size_t i = 0; i < all.size(); i += 2) all[i] *= 1e10;
  return all;
}

Matrices mostly_tiny(Random& random) {
  const Index d = some_parameters(random);
  Matrices all = wisharts(d, some_candidates(random), 1, random);
  for (MatrixXd& h : all) h += 1e-9 * wishart_matrix(d, d, random);
  return all;
}

Matrices hilbert(Random& random) {
  const Index d = whole(random, 2, 5);
  Matrices all;
  const Index count = some_candidates(random);
  for (Index i = 0; i < count; ++i) {
    const double shift = random.uniform(0.1, 4.0);
    MatrixXd h(d, d);
    for (Index a = 0; a < d; ++a) {
      for (Index b = 0; b < d; ++b) h(a, b) = 1.0 / (static_cast<double>(a + b) + shift);
    }
    all.push_back(h);
  }
  return all;
}

Matrices on_sphere(Random& random) {
  const Index d = some_parameters(random);
  Matrices all;
  const Index count = some_candidates(random) + d;
  for (Index i = 0; i < count; ++i) {
    const VectorXd v = gaussian(d, 1, random).col(0).normalized();
    all.emplace_back(v * v.transpose());
  }
  return all;
}

Matrices few_candidates(Random& random) {
  const Index d = whole(random, 4, 8), count = whole(random, 2, d - 1);
  return wisharts(d, count, whole(random, (d + count - 1) / count, d), random);
}

Matrices single_candidate(Random& random) {
  const Index d = some_parameters(random);
  return wisharts(d, 1, d, random);
}

template <class Change>
Matrices changed(Matrices all, const Change& change) {
  change(all);
  return all;
}

struct Kind {
  std::string_view name;
  Matrices (*make)(Random& random);
};

constexpr double kRoot = std::numbers::sqrt2;

const std::array kKinds{
    Kind{"plain", plain},
    Kind{"scaled_parameters",
         [](Random& r) { return changed(plain(r), [&](auto& a) { scale_parameters(a, r, 12); }); }},
    Kind{"scaled_candidates",
         [](Random& r) { return changed(plain(r), [&](auto& a) { scale_candidates(a, r, 12); }); }},
    Kind{"mixed_scales",
         [](Random& r) {
           return changed(plain(r), [&](auto& a) {
             scale_parameters(a, r, 6);
             scale_candidates(a, r, 6);
           });
         }},
    Kind{"weak_direction", [](Random& r) { return weak_direction(r, -8, -2); }},
    Kind{"nearly_singular", [](Random& r) { return weak_direction(r, -14, -8); }},
    Kind{"copies", [](Random& r) { return copies(r, 0.0); }},
    Kind{"near_copies", [](Random& r) { return copies(r, power(r, -14, -8)); }},
    Kind{"monomials_half", [](Random& r) { return monomials(r, 0.0); }},
    Kind{"monomials", [](Random& r) { return monomials(r, -1.0); }},
    Kind{"chebyshev", chebyshev},
    Kind{"exponentials", exponentials},
    Kind{"saturation", saturation},
    Kind{"hats", hats},
    Kind{"single_precision",
         [](Random& r) { return changed(plain(r), [](auto& a) { round_to_single(a); }); }},
    Kind{"single_precision_rank_one",
         [](Random& r) { return changed(on_sphere(r), [](auto& a) { round_to_single(a); }); }},
    Kind{"finite_differences", finite_differences},
    Kind{"zeros", with_zeros},
    Kind{"blocks", blocks},
    Kind{"two_scales", two_scales},
    Kind{"factorial", [](Random& r) { return factorial(whole(r, 1, 6), false); }},
    Kind{"factorial_products", [](Random& r) { return factorial(whole(r, 2, 5), true); }},
    Kind{"factorial_scaled",
         [](Random& r) {
           return changed(factorial(whole(r, 1, 5), true),
                          [&](auto& a) { scale_parameters(a, r, 6); });
         }},
    Kind{"cyclic", cyclic},
    Kind{"diagonal", diagonal},
    Kind{"on_sphere", on_sphere},
    Kind{"few_candidates", few_candidates},
    Kind{"single_candidate", single_candidate},
    Kind{"one_parameter",
         [](Random& r) {
           return changed(wisharts(1, some_candidates(r), 1, r),
                          [&](auto& a) { scale_candidates(a, r, 12); });
         }},
    Kind{"dominated", dominated},
    Kind{"nearly_flat", nearly_flat},
    Kind{"correlated", [](Random& r) { return correlated(r, 2, 6); }},
    Kind{"correlated_rank_one", [](Random& r) { return correlated(r, 1, kRoot * 4); }},
    Kind{"mostly_tiny", mostly_tiny},
    Kind{"hilbert", hilbert},
};

using Digits60 = boost::multiprecision::number<boost::multiprecision::cpp_bin_float<60>,
                                               boost::multiprecision::et_off>;

// Cholesky factor in place, packed, of the matrix scaled to unit diagonal by `scale`. False where a
// pivot is not positive.
bool factorise(std::vector<Digits60>& m, std::vector<Digits60>& scale, std::size_t d) {
  for (std::size_t i = 0; i < d; ++i) {
    if (!(m[packed_index(i, i)] > 0)) return false;
    scale[i] = 1 / sqrt(m[packed_index(i, i)]);
  }
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      Digits60 value = m[packed_index(i, j)] * scale[i] * scale[j];
      for (std::size_t k = 0; k < j; ++k) {
        value -= m[packed_index(i, k)] * m[packed_index(j, k)];
      }
      if (i == j && !(value > 0)) return false;
      m[packed_index(i, j)] = i == j ? sqrt(value) : value / m[packed_index(j, j)];
    }
  }
  return true;
}

// M^-1 in trace-dual packing, from the factor.
std::vector<Digits60> trace_dual(const std::vector<Digits60>& factor,
                                 const std::vector<Digits60>& scale, std::size_t d) {
  std::vector<Digits60> inverse(factor.size(), Digits60(0)), dual(factor.size(), Digits60(0));
  for (std::size_t j = 0; j < d; ++j) {
    for (std::size_t i = j; i < d; ++i) {
      Digits60 value = i == j ? 1 : 0;
      for (std::size_t k = j; k < i; ++k) {
        value -= factor[packed_index(i, k)] * inverse[packed_index(k, j)];
      }
      inverse[packed_index(i, j)] = value / factor[packed_index(i, i)];
    }
  }
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      Digits60 value = 0;
      for (std::size_t k = i; k < d; ++k) {
        value += inverse[packed_index(k, i)] * inverse[packed_index(k, j)];
      }
      dual[packed_index(i, j)] = value * scale[i] * scale[j] * (i == j ? 1 : 2);
    }
  }
  return dual;
}

}  // namespace

const std::vector<std::string_view>& hostile_kinds() {
  static const std::vector<std::string_view> names = [] {
    std::vector<std::string_view> all;
    for (const Kind& kind : kKinds) all.push_back(kind.name);
    return all;
  }();
  return names;
}

InformationSet hostile_set(std::size_t kind, Random& random) {
  return from_matrices(kKinds.at(kind).make(random)).renamed(std::string(kKinds[kind].name));
}

double true_gap(const InformationSet& set, const Design& design) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const std::size_t d = set.dimension(), p = set.packed_size();
  if (design.weights.size() != set.candidate_count()) return kInfinity;
  std::vector<Digits60> m(p, Digits60(0)), scale(d);
  Digits60 total = 0;
  for (std::size_t i = 0; i < design.weights.size(); ++i) {
    if (!(design.weights[i] > 0.0)) continue;
    const Digits60 weight(design.weights[i]);
    total += weight;
    for (std::size_t k = 0; k < p; ++k) m[k] += weight * set.information(i)[k];
  }
  if (!(total > 0)) return kInfinity;
  for (Digits60& x : m) x /= total;
  if (!factorise(m, scale, d)) return kInfinity;
  const std::vector<Digits60> dual = trace_dual(m, scale, d);
  Digits60 largest = 0;
  for (std::size_t i = 0; i < set.candidate_count(); ++i) {
    Digits60 w = 0;
    for (std::size_t k = 0; k < p; ++k) w += dual[k] * set.information(i)[k];
    largest = std::max(largest, w);
  }
  return static_cast<double>(largest / d - 1);
}

std::uint64_t fresh_seed() {
  std::random_device entropy;
  return (std::uint64_t{entropy()} << 32) | entropy();
}

}  // namespace graybox::testing_sets
