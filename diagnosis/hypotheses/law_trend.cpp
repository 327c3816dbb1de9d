#include "diagnosis/hypotheses/law_trend.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace graybox {

using Eigen::Index;
using Eigen::VectorXd;

ToldRange::ToldRange(const VectorXd& covariate, const VectorXd& told) {
  constexpr double kTold = 0.01;  // of what the sample tells that tells most
  const double all = told.sum(), most = told.maxCoeff();
  if (!(all > 0.0)) return;
  range_ = covariate.maxCoeff() - covariate.minCoeff();
  mean_ = covariate.dot(told) / all;
  deviation_ = std::sqrt((covariate.array() - mean_).square().matrix().dot(told) / all);
  least_ = most_ = mean_;
  for (Index k = 0; k < covariate.size(); ++k) {
    if (told(k) < kTold * most) continue;
    least_ = std::min(least_, covariate(k));
    most_ = std::max(most_, covariate(k));
  }
}

bool ToldRange::is_wide() const {
  constexpr double kWide = 0.1;
  return deviation_ > kWide * range_;
}

ToldRange::Ends ToldRange::ends(double value, double slope) const {
  return {value + slope * (least_ - mean_), value + slope * (most_ - mean_)};
}

void append_position_covariates(const VectorXd& position, std::vector<TrendCovariate>& covariates) {
  const double low = position.minCoeff(), range = position.maxCoeff() - low;
  if (!(range > 0.0)) return;
  const Eigen::ArrayXd share = (position.array() - low) / range;
  const Eigen::ArrayXd angle = 2.0 * std::numbers::pi * share;
  covariates.push_back({LawTrend::On::kPosition, share.matrix()});
  covariates.push_back({LawTrend::On::kPosition, (0.5 * angle.cos()).matrix()});
  covariates.push_back({LawTrend::On::kPosition, (0.5 * angle.sin()).matrix()});
}

double lesser_way(const VectorXd& rate) {
  return std::min(rate.cwiseMax(0.0).squaredNorm(), rate.cwiseMin(0.0).squaredNorm()) /
         std::max(rate.squaredNorm(), 1e-300);
}

void append_rate_covariates(const VectorXd& rate, std::vector<TrendCovariate>& covariates) {
  constexpr double kSlow = 0.3;       // of the rms
  constexpr double kBothWays = 0.05;  // of the squared velocity, in the direction that has less
  const double scale = kSlow * std::sqrt(rate.squaredNorm() / static_cast<double>(rate.size()));
  if (!(scale > 0.0)) return;
  const Eigen::ArrayXd share = rate.array() / scale;
  covariates.push_back({LawTrend::On::kSpeed, (-share.abs()).exp().matrix()});
  if (lesser_way(rate) < kBothWays) return;
  covariates.push_back({LawTrend::On::kDirection, (0.5 * share.tanh()).matrix()});
}

VectorXd time_covariate(const std::vector<Index>& samples) {
  Index longest = 1;
  for (const Index count : samples) longest = std::max(longest, count);
  VectorXd times(std::accumulate(samples.begin(), samples.end(), Index{0}));
  Index at = 0;
  for (const Index count : samples) {
    const double middle = 0.5 * static_cast<double>(count - 1);
    for (Index k = 0; k < count; ++k) {
      times(at++) = (static_cast<double>(k) - middle) / static_cast<double>(longest);
    }
  }
  return times;
}

}  // namespace graybox
