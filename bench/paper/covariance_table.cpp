#include "bench/paper/covariance_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "problems/base/error.hpp"
#include "solvers/core/inverse_cholesky.hpp"
#include "solvers/core/sensitivity.hpp"

namespace graybox::bench {
namespace {

std::string row_name(CovarianceRow::Kind kind, std::size_t number) {
  switch (kind) {
    case CovarianceRow::Kind::kSupport:
      return fmt::format("{}", number);
    case CovarianceRow::Kind::kMinimum:
      return "Min";
    case CovarianceRow::Kind::kMedian:
      return "Med";
    case CovarianceRow::Kind::kMaximum:
      return "Max";
  }
  return {};
}

}  // namespace

std::vector<double> single_candidate_covariances(const InformationSet& set) {
  const double d = static_cast<double>(set.dimension());
  InverseCholesky factor(set.dimension());
  std::vector<double> covariances(set.candidate_count());
  for (std::size_t i = 0; i < covariances.size(); ++i) {
    covariances[i] = std::exp(-factor.log_det_of(set.information(i)) / d);
  }
  return covariances;
}

double design_covariance(const InformationSet& set, const Design& design) {
  if (design.weights.size() != set.candidate_count()) {
    throw InputError(fmt::format("{}: the design has {} weights, the set {} candidates", set.name(),
                                 design.weights.size(), set.candidate_count()));
  }
  const double log_det = log_det_information(set, design.weights);
  if (!std::isfinite(log_det)) {
    throw InputError(
        fmt::format("{}: the design's information matrix is singular, so that its covariance is "
                    "infinite; take a design that certifies",
                    set.name()));
  }
  return std::exp(-log_det / static_cast<double>(set.dimension()));
}

CovarianceTable covariance_table(const InformationSet& set, const Design& design) {
  CovarianceTable table;
  table.design_covariance = design_covariance(set, design);
  const std::vector<double> single = single_candidate_covariances(set);
  const auto add = [&](CovarianceRow::Kind kind, std::size_t i) {
    table.rows.push_back({kind, i, single[i] / table.design_covariance, design.weights[i]});
  };
  for (std::size_t i = 0; i < single.size(); ++i) {
    if (design.weights[i] > 0.0) add(CovarianceRow::Kind::kSupport, i);
  }
  std::vector<std::size_t> order(single.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return single[i]; });
  add(CovarianceRow::Kind::kMinimum, order.front());
  add(CovarianceRow::Kind::kMedian, order[(order.size() - 1) / 2]);
  add(CovarianceRow::Kind::kMaximum, order.back());
  return table;
}

std::string to_csv(const InformationSet& set, const CovarianceTable& table) {
  std::string text = "row,candidate";
  const CandidateTable& candidates = set.candidates();
  for (std::size_t c = 0; c < candidates.names.size(); ++c) {
    text += fmt::format(",{}_{}", candidates.names[c], candidates.units[c]);
  }
  text += ",covariance,weight\n";
  std::size_t number = 0;
  for (const CovarianceRow& row : table.rows) {
    text += fmt::format("{},{}", row_name(row.kind, ++number), row.candidate);
    for (const double value : set.coordinates(row.candidate)) text += fmt::format(",{}", value);
    text += fmt::format(",{:.17g},{:.17g}\n", row.covariance, row.weight);
  }
  return text;
}

}  // namespace graybox::bench
