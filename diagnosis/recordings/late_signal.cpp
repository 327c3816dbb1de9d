#include "diagnosis/recordings/late_signal.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "diagnosis/recordings/preprocess.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

constexpr double kCutOff = 0.1;  // of the sample rate
constexpr int kOrder = 4;
constexpr Index kMostSamples = 20000;
constexpr Index kMargin = 64;  // samples: the longest delay either way, and where lags settle
constexpr Index kBlocks = 20;
constexpr int kSteps = 12;
constexpr double kShift = 1e-3;  // samples, for derivatives
constexpr double kPlainer = 1.1;
constexpr double kTold = 1.2;

// x at k - delay, by the cubic through four samples. In samples.
VectorXd delayed(const VectorXd& x, double delay) {
  const double whole = std::floor(delay);
  const double f = 1.0 - (delay - whole);  // position after the sample before, in (0, 1]
  const auto shift = static_cast<Index>(whole);
  const double w0 = -f * (f - 1.0) * (f - 2.0) / 6.0, w1 = (f + 1.0) * (f - 1.0) * (f - 2.0) / 2.0;
  const double w2 = -(f + 1.0) * f * (f - 2.0) / 2.0, w3 = (f + 1.0) * f * (f - 1.0) / 6.0;
  const Index last = x.size() - 1;
  const auto at = [&](Index k) { return x(std::clamp<Index>(k, 0, last)); };
  VectorXd result(x.size());
  for (Index k = 0; k < x.size(); ++k) {
    const Index before = k - shift - 1;
    result(k) = w0 * at(before - 1) + w1 * at(before) + w2 * at(before + 1) + w3 * at(before + 2);
  }
  return result;
}

// First-order lag of a signal that is linear between samples, in rest at first. T in samples.
VectorXd lagged(const VectorXd& x, double lag) {
  if (lag < 1e-6) return x;
  const double decay = std::exp(-1.0 / lag), rise = lag * (1.0 - decay);
  VectorXd result(x.size());
  result(0) = x(0);
  for (Index k = 1; k < x.size(); ++k) {
    const double step = x(k) - x(k - 1);
    result(k) = decay * result(k - 1) + (1.0 - decay) * x(k - 1) + (1.0 - rise) * step;
  }
  return result;
}

struct Regression {
  double gain, squares;
  VectorXd rest;
};

// y = gain x + offset in the middle.
Regression regression_of(const VectorXd& x, const VectorXd& y) {
  const Index size = y.size() - 2 * kMargin;
  const VectorXd inputs = x.segment(kMargin, size).array() - x.segment(kMargin, size).mean();
  const VectorXd outputs = y.segment(kMargin, size).array() - y.segment(kMargin, size).mean();
  const double gain = inputs.dot(outputs) / std::max(inputs.squaredNorm(), 1e-300);
  VectorXd rest = outputs - gain * inputs;
  const double squares = rest.squaredNorm();
  return {gain, squares, std::move(rest)};
}

VectorXd model(const VectorXd& x, const Vector2d& p) { return lagged(delayed(x, p(0)), p(1)); }

class Fitter {
 public:
  Fitter(VectorXd x, VectorXd y) : x_(std::move(x)), y_(std::move(y)) {
    longest_ = static_cast<double>(half_period());
  }

  [[nodiscard]] double squares(const Vector2d& p) const {
    return regression_of(model(x_, p), y_).squares;
  }

  // The best whole number of samples, within half a period of the swing. Of the shifts that
  // explain nearly as much as the best, and more than those beside them, the smallest.
  [[nodiscard]] double coarse_delay() const {
    constexpr double kNearly = 0.9;  // of what the best explains
    const Index most = std::min(kMargin / 2, static_cast<Index>(longest_));
    VectorXd explained(2 * most + 1);
    const double whole = regression_of(VectorXd::Zero(x_.size()), y_).squares;
    for (Index k = 0; k < explained.size(); ++k) {
      explained(k) = whole - squares({static_cast<double>(k - most), 0.0});
    }
    Index best = 0;
    const double enough = kNearly * explained.maxCoeff(&best);
    for (Index k = 0; k < explained.size(); ++k) {
      const bool is_peak = (k == 0 || explained(k) >= explained(k - 1)) &&
                           (k + 1 == explained.size() || explained(k) >= explained(k + 1));
      if (is_peak && explained(k) >= enough && std::abs(k - most) < std::abs(best - most)) best = k;
    }
    return static_cast<double>(best - most);
  }

  [[nodiscard]] double coarse_lag() const {
    double best = std::numeric_limits<double>::infinity(), lag = 0.5;
    const double longest = std::min(0.5 * static_cast<double>(kMargin), longest_);
    for (double trial = 0.25; trial < longest; trial *= 1.5) {
      const double here = squares({0.0, trial});
      if (here < best) {
        best = here;
        lag = trial;
      }
    }
    return lag;
  }

  // Gauss-Newton over delay and lag as far as they are free; lags stay positive.
  [[nodiscard]] Vector2d refined(Vector2d p, bool delay_free, bool lag_free) const {
    double cost = squares(p);
    for (int step = 0; step < kSteps; ++step) {
      Vector2d change = direction(p, delay_free, lag_free);
      double scale = 1.0;
      Vector2d next = p;
      double lower = cost;
      for (; scale > 1e-3; scale *= 0.5) {
        next = p + scale * change;
        next(1) = std::clamp(next(1), 0.0, longest_);
        if (delay_free && lag_free) next(0) = std::max(next(0), 0.0);  // neither undoes the other
        if (std::abs(next(0)) < static_cast<double>(kMargin) &&
            next(1) < static_cast<double>(kMargin) && (lower = squares(next)) < cost) {
          break;
        }
      }
      if (!(lower < cost)) return p;
      const bool settled = cost - lower < 1e-8 * cost;
      p = next;
      cost = lower;
      if (settled) return p;
    }
    return p;
  }

  [[nodiscard]] LateFit fit_at(const Vector2d& p, bool delay_free, bool lag_free,
                               double sample_time) const {
    const Regression here = regression_of(model(x_, p), y_);
    const MatrixXd jacobian = jacobian_at(p, here.gain, delay_free, lag_free);
    const MatrixXd covariance = sandwich(jacobian, here.rest);
    LateFit fit{.gain = here.gain,
                .gain_error = std::sqrt(covariance(0, 0)),
                .late = (p(0) + p(1)) * sample_time,
                .delay = p(0) * sample_time,
                .lag = p(1) * sample_time};
    const Index free = jacobian.cols() - 2;
    fit.late_error =
        std::sqrt(std::max(0.0, covariance.bottomRightCorner(free, free).sum())) * sample_time;
    const auto middle = y_.segment(kMargin, here.rest.size());
    const double deviation = std::sqrt((middle.array() - middle.mean()).square().sum());
    fit.misfit = std::sqrt(here.squares) / deviation;
    return fit;
  }

 private:
  // Half the period of the swing, in samples: by the first peak of the autocorrelation behind its
  // first fall below zero. The margin where there is no such peak.
  [[nodiscard]] Index half_period() const {
    constexpr double kSwings = 0.3;  // of the squares
    const Index size = y_.size() - 2 * kMargin;
    const VectorXd here = y_.segment(kMargin, size).array() - y_.segment(kMargin, size).mean();
    VectorXd alike(2 * kMargin);
    for (Index lag = 0; lag < alike.size(); ++lag) {
      if (lag >= size) return kMargin;
      alike(lag) = here.head(size - lag).dot(here.tail(size - lag));
    }
    bool fell = false;
    for (Index lag = 1; lag + 1 < alike.size(); ++lag) {
      fell = fell || alike(lag) < 0.0;
      if (!fell || alike(lag) < kSwings * alike(0)) continue;
      if (alike(lag) >= alike(lag - 1) && alike(lag) >= alike(lag + 1)) {
        return std::max<Index>(1, lag / 2);
      }
    }
    return kMargin;
  }

  // Columns: model, 1, and d(gain model)/d(delay, lag) as far as they are free.
  [[nodiscard]] MatrixXd jacobian_at(const Vector2d& p, double gain, bool delay_free,
                                     bool lag_free) const {
    const Index size = y_.size() - 2 * kMargin;
    MatrixXd jacobian(size, 2 + (delay_free ? 1 : 0) + (lag_free ? 1 : 0));
    jacobian.col(0) = model(x_, p).segment(kMargin, size);
    jacobian.col(1).setOnes();
    Index column = 2;
    for (Index k = 0; k < 2; ++k) {
      if (!(k == 0 ? delay_free : lag_free)) continue;
      Vector2d up = p, down = p;
      up(k) += kShift;
      down(k) = k == 1 ? std::max(down(k) - kShift, 0.0) : down(k) - kShift;
      jacobian.col(column++) =
          gain / (up(k) - down(k)) * (model(x_, up) - model(x_, down)).segment(kMargin, size);
    }
    return jacobian;
  }

  [[nodiscard]] Vector2d direction(const Vector2d& p, bool delay_free, bool lag_free) const {
    const Regression here = regression_of(model(x_, p), y_);
    const MatrixXd jacobian = jacobian_at(p, here.gain, delay_free, lag_free);
    const MatrixXd normal = jacobian.transpose() * jacobian;
    const VectorXd change = normal.ldlt().solve(jacobian.transpose() * here.rest);
    Vector2d result = Vector2d::Zero();
    Index column = 2;
    if (delay_free) result(0) = change(column++);
    if (lag_free) result(1) = change(column);
    return result.allFinite() ? result : Vector2d::Zero();
  }

  [[nodiscard]] static MatrixXd sandwich(const MatrixXd& jacobian, const VectorXd& rest) {
    const MatrixXd identity = MatrixXd::Identity(jacobian.cols(), jacobian.cols());
    const MatrixXd bread = (jacobian.transpose() * jacobian).ldlt().solve(identity);
    MatrixXd meat = MatrixXd::Zero(jacobian.cols(), jacobian.cols());
    const Index length = rest.size() / kBlocks;
    for (Index b = 0; b < kBlocks; ++b) {
      const VectorXd score =
          jacobian.middleRows(b * length, length).transpose() * rest.segment(b * length, length);
      meat += score * score.transpose();
    }
    return bread * meat * bread;
  }

  VectorXd x_, y_;
  double longest_ = 0.0;  // samples: half a period of the swing, also of a lag
};

VectorXd middle_of(const Eigen::Ref<const VectorXd>& values) {
  const Index size = std::min(values.size(), kMostSamples);
  return zero_phase_low_pass(values.segment((values.size() - size) / 2, size), kCutOff, kOrder);
}

}  // namespace

const LateFit& LateComparison::best() const {
  const double least =
      kPlainer * std::min({in_time.misfit, delayed.misfit, lagged.misfit, both.misfit});
  if (in_time.misfit <= least) return in_time;
  const LateFit& one = delayed.misfit <= lagged.misfit ? delayed : lagged;
  return one.misfit <= least ? one : both;
}

bool LateComparison::tells_delay_from_lag() const {
  return std::max(delayed.misfit, lagged.misfit) > kTold * std::min(delayed.misfit, lagged.misfit);
}

LateComparison compare_late(const Eigen::Ref<const VectorXd>& x,
                            const Eigen::Ref<const VectorXd>& y, double sample_time) {
  const Fitter fitter(middle_of(x), middle_of(y));
  const Vector2d none = Vector2d::Zero();
  const Vector2d delay = fitter.refined({fitter.coarse_delay(), 0.0}, true, false);
  const Vector2d lag = fitter.refined({0.0, fitter.coarse_lag()}, false, true);
  const Vector2d one = fitter.squares(delay) <= fitter.squares(lag) ? delay : lag;
  Vector2d both = fitter.refined({std::max(one(0), 0.0), std::max(one(1), 0.1)}, true, true);
  if (fitter.squares(both) > fitter.squares(one)) both = one;  // never worse than its part
  return {.in_time = fitter.fit_at(none, false, false, sample_time),
          .delayed = fitter.fit_at(delay, true, false, sample_time),
          .lagged = fitter.fit_at(lag, false, true, sample_time),
          .both = fitter.fit_at(both, true, true, sample_time)};
}

}  // namespace graybox
