#include "diagnosis/evidence/kept_out_change.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

namespace graybox {
namespace {

constexpr double kTaken = 0.5;  // of the squared error kept out
constexpr double kShare = 0.1;  // of the larger size

void add_changes(std::span<const LawParameterEstimate> in_fit,
                 std::span<const LawParameterEstimate> kept_out, std::optional<std::size_t> law,
                 std::vector<ChangedSize>& sizes) {
  for (std::size_t p = 0; p < std::min(in_fit.size(), kept_out.size()); ++p) {
    const LawParameterEstimate &a = in_fit[p], &b = kept_out[p];
    const double error = std::hypot(a.standard_error, b.standard_error);
    const double apart = std::abs(a.value - b.value);
    if (!(error > 0.0) || !(apart > kChangeErrors * error)) continue;
    if (!(apart > kShare * std::max(std::abs(a.value), std::abs(b.value)))) continue;
    sizes.push_back({law, a, b, apart / error});
  }
}

}  // namespace

std::optional<KeptOutChange> kept_out_change(const ExtendedFit& fit, double error_predicted,
                                             const ExtendedFit& own, double error_fitted) {
  if (!fit.usable || !own.usable || fit.laws.size() != own.laws.size()) return {};
  if (!(error_fitted * error_fitted <= (1.0 - kTaken) * error_predicted * error_predicted)) {
    return {};
  }
  KeptOutChange change{error_predicted, error_fitted, {}};
  add_changes(fit.model_parameters, own.model_parameters, {}, change.sizes);
  for (std::size_t l = 0; l < fit.laws.size(); ++l) {
    add_changes(fit.laws[l].parameters, own.laws[l].parameters, l, change.sizes);
  }
  if (change.sizes.empty()) return {};
  std::ranges::sort(change.sizes, std::greater{}, &ChangedSize::z);
  return change;
}

void widen_errors(const KeptOutChange& change, ExtendedFit& fit) {
  for (const ChangedSize& size : change.sizes) {
    auto& list = size.law ? fit.laws[*size.law].parameters : fit.model_parameters;
    const auto own = std::ranges::find(list, size.in_fit.name, &LawParameterEstimate::name);
    if (own == list.end()) continue;
    const double apart = std::abs(size.in_fit.value - size.kept_out.value);
    own->standard_error = std::max(own->standard_error, apart / std::numbers::sqrt2);
  }
}

}  // namespace graybox
