#include "solvers/constrained/multiplier_bound.hpp"

namespace graybox {
namespace {

// y with the signs that the rows' bounds ask for.
template <class Real>
std::vector<Real> admissible(const DesignConstraints& constraints, std::span<const double> y) {
  std::vector<Real> out(constraints.rows.size(), Real(0));
  for (std::size_t j = 0; j < out.size(); ++j) {
    const LinearConstraint& row = constraints.rows[j];
    Real value(y[j]);
    if (!std::isfinite(row.lower)) value = std::max(value, Real(0));
    if (!std::isfinite(row.upper)) value = std::min(value, Real(0));
    out[j] = value;
  }
  return out;
}

// rest_k -= a_k . y, and size_k += sum_j |a_jk y_j|. Stretch by stretch, so that what is added to
// stays in the cache while the rows come by.
template <class Real>
void price_rows(const std::vector<LinearConstraint>& rows, std::span<const std::size_t> candidates,
                const std::vector<Real>& y, std::vector<Real>& rest, std::vector<Real>& size) {
  constexpr std::size_t kStretch = 1024;
  for (std::size_t first = 0; first < rest.size(); first += kStretch) {
    const std::size_t last = std::min(first + kStretch, rest.size());
    for (std::size_t j = 0; j < rows.size(); ++j) {
      if (y[j] == 0) continue;
      const Real multiplier = y[j];
      const double* a = rows[j].coefficients.data();
      const auto subtract = [&](std::size_t k, double coefficient) {
        const Real term = multiplier * coefficient;
        rest[k] -= term;
        size[k] += std::abs(term);
      };
      if (candidates.empty()) {
        for (std::size_t k = first; k < last; ++k) subtract(k, a[k]);
      } else {
        for (std::size_t k = first; k < last; ++k) subtract(k, a[candidates[k]]);
      }
    }
  }
}

}  // namespace

template <class Real>
MultiplierBound<Real> multiplier_bound(const DesignConstraints& constraints,
                                       std::span<const std::size_t> candidates,
                                       std::span<const double> gains,
                                       std::span<const double> multipliers,
                                       std::span<double> reduced) {
  const std::vector<LinearConstraint>& rows = constraints.rows;
  const std::vector<double>& total = rows.front().coefficients;
  const Real unit = std::numeric_limits<Real>::epsilon() / 2;
  const Real row_unit = unit * static_cast<Real>(rows.size() + 4);
  const auto candidate = [&](std::size_t k) { return candidates.empty() ? k : candidates[k]; };
  const bool has_upper = !constraints.upper.empty(), has_lower = !constraints.lower.empty();
  MultiplierBound<Real> bound{.multipliers = admissible<Real>(constraints, multipliers)};
  std::vector<Real>& y = bound.multipliers;
  std::vector<Real> rest(gains.begin(), gains.end()), size(gains.size());
  for (std::size_t k = 0; k < rest.size(); ++k) size[k] = std::abs(rest[k]);
  price_rows<Real>(rows, candidates, y, rest, size);
  Real raise = 0;
  for (std::size_t k = 0; k < rest.size(); ++k) {
    if (!(rest[k] > 0)) continue;
    const std::size_t i = candidate(k);
    if (has_upper && std::isfinite(constraints.upper[i])) continue;
    raise = std::max<Real>(raise, rest[k] / total[i]);
  }
  y[0] += raise;
  Real magnitude = 0;
  for (std::size_t j = 0; j < rows.size(); ++j) {
    if (y[j] == 0) continue;
    const Real term = y[j] * (y[j] > 0 ? rows[j].upper : rows[j].lower);
    bound.value += term;
    magnitude += std::abs(term);
  }
  Real largest = -std::numeric_limits<Real>::infinity();
  for (std::size_t k = 0; k < rest.size(); ++k) {
    const std::size_t i = candidate(k);
    if (!reduced.empty()) reduced[k] = static_cast<double>(rest[k]);
    if (rest[k] > largest) {
      largest = rest[k];
      bound.best = k;
    }
    const Real raised = raise * total[i];
    const Real r = rest[k] - raised + row_unit * (size[k] + raised);
    if (r <= 0 && !has_lower) continue;  // run not at all
    const Real effort(r > 0 ? constraints.largest_effort(i) : constraints.lower_of(i));
    bound.value += r * effort;
    magnitude += std::abs(r * effort);
  }
  bound.rounding = unit * static_cast<Real>(rest.size() + rows.size() + 4) * magnitude;
  return bound;
}

template MultiplierBound<double> multiplier_bound(const DesignConstraints&,
                                                  std::span<const std::size_t>,
                                                  std::span<const double>, std::span<const double>,
                                                  std::span<double>);
template MultiplierBound<long double> multiplier_bound(const DesignConstraints&,
                                                       std::span<const std::size_t>,
                                                       std::span<const double>,
                                                       std::span<const double>, std::span<double>);

}  // namespace graybox
