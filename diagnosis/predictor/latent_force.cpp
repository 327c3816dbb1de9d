#include "diagnosis/predictor/latent_force.hpp"

#include <Eigen/Cholesky>
#include <array>
#include <cmath>
#include <limits>

#include "problems/base/stop.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kMostStates = 60;  // a sensor that is late by many samples has as many
constexpr Index kSettling = 100;   // samples of a run, from its first, that do not count
constexpr Index kStart = 100;      // for the force: a wrong start is a push at first
constexpr double kLeastShare = 1e-5, kMostShare = 3.0;  // of the forces that act
constexpr double kLongestMemory = 0.25;                 // of the shortest run

// How far the filter is off, and the disturbance: a linear model with noise of one kind.
struct ErrorModel {
  MatrixXd a, c, corrected;  // z_(k+1) = a z_k - corrected e_k + noise, e_k = c z_k + v_k
  MatrixXd covariance, gain, innovation;
  double log_determinant = 0.0;
};

ErrorModel error_model(const LinearPredictor& linear, const MatrixXd& gain, const VectorXd& noise,
                       const DisturbanceForce& disturbance, double sample_time) {
  const Index n = linear.a.rows(), outputs = linear.c.rows();
  const double kept = std::exp(-sample_time / disturbance.memory);
  ErrorModel model;
  // In units of the disturbance's deviation and the outputs' noise.
  model.a = MatrixXd::Zero(n + 1, n + 1);
  model.a.topLeftCorner(n, n) = linear.a;
  model.a.topRightCorner(n, 1) = linear.b * disturbance.deviation;
  model.a(n, n) = kept;
  model.c = MatrixXd::Zero(outputs, n + 1);
  model.c.leftCols(n) = noise.cwiseInverse().asDiagonal() * linear.c;
  model.corrected = MatrixXd::Zero(n + 1, outputs);
  model.corrected.topRows(n) = linear.a * gain * noise.asDiagonal();
  MatrixXd q = MatrixXd::Zero(n + 1, n + 1);
  q(n, n) = 1.0 - kept * kept;
  q.topLeftCorner(n, n) = disturbance.white * disturbance.white * linear.b * linear.b.transpose();
  model.covariance = stationary_covariance(model.a, model.c, q, VectorXd::Ones(outputs));
  const MatrixXd s =
      model.c * model.covariance * model.c.transpose() + MatrixXd::Identity(outputs, outputs);
  const Eigen::LLT<MatrixXd> factor(s);
  model.innovation = factor.solve(MatrixXd::Identity(outputs, outputs));
  model.gain = model.covariance * model.c.transpose() * model.innovation;
  model.log_determinant = 2.0 * MatrixXd(factor.matrixL()).diagonal().array().log().sum();
  return model;
}

// Errors of errors: v of each sample; what they say of the likelihood. `errors` in units of noise.
double filter(const ErrorModel& model, const MatrixXd& errors, MatrixXd* innovations,
              VectorXd* predicted) {
  VectorXd z = VectorXd::Zero(model.a.rows()), next = z, v(errors.rows());
  double sum = 0.0;
  for (Index k = 0; k < errors.cols(); ++k) {
    v.noalias() = errors.col(k) - model.c * z;
    if (k >= kSettling) {
      sum -= 0.5 * (model.log_determinant + v.dot(model.innovation.lazyProduct(v)));
    }
    if (innovations != nullptr) {
      innovations->col(k) = v;
      (*predicted)(k) = z(z.size() - 1);
    }
    z.noalias() += model.gain * v;
    next.noalias() = model.a * z;
    next.noalias() -= model.corrected * errors.col(k);
    z.swap(next);
  }
  return sum;
}

double log_likelihood(const ErrorModel& model, const std::vector<MatrixXd>& runs) {
  if (!model.covariance.allFinite() || !std::isfinite(model.log_determinant)) {
    return -std::numeric_limits<double>::infinity();
  }
  double sum = 0.0;
  for (const MatrixXd& errors : runs) sum += filter(model, errors, nullptr, nullptr);
  return std::isfinite(sum) ? sum : -std::numeric_limits<double>::infinity();
}

// The disturbance of one run, smoothed, in units of its deviation.
VectorXd smoothed(const ErrorModel& model, const MatrixXd& errors) {
  const Index n = model.a.rows(), samples = errors.cols();
  MatrixXd innovations(errors.rows(), samples);
  VectorXd disturbance(samples);
  filter(model, errors, &innovations, &disturbance);
  const MatrixXd kept = model.a * (MatrixXd::Identity(n, n) - model.gain * model.c);
  const MatrixXd back = kept.transpose(), weighted = model.c.transpose() * model.innovation;
  VectorXd r = VectorXd::Zero(n);
  for (Index k = samples - 1; k >= 0; --k) {
    r = weighted * innovations.col(k) + back * r;
    disturbance(k) += model.covariance.row(n - 1).dot(r);
  }
  return disturbance;
}

// Its standard deviation.
double smoothing_error(const ErrorModel& model) {
  const Index n = model.a.rows();
  MatrixXd f = model.a * (MatrixXd::Identity(n, n) - model.gain * model.c);
  MatrixXd information = model.c.transpose() * model.innovation * model.c;
  for (int doubling = 0; doubling < 40; ++doubling) {
    const MatrixXd change = f.transpose() * information * f;
    information += change;
    f = (f * f).eval();
    if (!(change.norm() > 1e-9 * information.norm())) break;
  }
  const VectorXd p = model.covariance.col(n - 1);
  return std::sqrt(std::max(0.0, p(n - 1) - p.dot(information * p)));
}

class LatentForceFit {
 public:
  LatentForceFit(const LinearPredictor& linear, const MatrixXd& gain, const VectorXd& noise,
                 std::vector<MatrixXd> runs, double sample_time, Index coordinate)
      : linear_(linear),
        gain_(gain),
        noise_(noise),
        runs_(std::move(runs)),
        sample_time_(sample_time) {
    best_.coordinate = coordinate;
  }

  // Coordinate by coordinate in the logarithms of deviations and memory, in steps that shrink.
  void maximise(double scale, double longest, bool with_white) {
    constexpr double kShortest = 3.0;  // samples: else it is white
    likelihood_ = -std::numeric_limits<double>::infinity();
    const double least = kLeastShare * scale, most = kMostShare * scale;
    const double shortest = (with_white ? kShortest : 1.0) * sample_time_;
    low_ = {least, shortest, with_white ? least : 0.0};
    high_ = {most, std::max(longest, 2.0 * shortest), with_white ? most : 0.0};
    for (const double share : {1e-3, 1e-2, 1e-1}) {
      for (const double samples : {5.0, 30.0, 200.0}) {
        for (const double white : {1e-3, 1e-1}) {
          try_at({share * scale, samples * sample_time_, with_white ? white * scale : 0.0});
          if (!with_white) break;
        }
      }
    }
    for (double step = 3.0; step > 1.1; step = std::sqrt(step)) {
      while (try_steps(step)) stop_if_requested();
    }
  }

  [[nodiscard]] const DisturbanceForce& best() const { return best_; }
  [[nodiscard]] double log_likelihood() const { return likelihood_; }
  [[nodiscard]] ErrorModel model() const {
    return error_model(linear_, gain_, noise_, best_, sample_time_);
  }
  [[nodiscard]] const std::vector<MatrixXd>& runs() const { return runs_; }

 private:
  bool try_steps(double step) {
    bool better = false;
    for (std::size_t i = 0; i < low_.size(); ++i) {
      if (!(high_[i] > 0.0)) continue;
      for (const double factor : {step, 1.0 / step}) {
        std::array<double, 3> next = at_;
        next[i] *= factor;
        better |= try_at(next);
      }
    }
    return better;
  }

  bool try_at(const std::array<double, 3>& values) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (values[i] < low_[i] || values[i] > high_[i]) return false;
    }
    const DisturbanceForce each{best_.coordinate, values[0], values[1], values[2]};
    const double value =
        graybox::log_likelihood(error_model(linear_, gain_, noise_, each, sample_time_), runs_);
    if (!(value > likelihood_)) return false;
    likelihood_ = value;
    best_ = each;
    at_ = values;
    return true;
  }

  LinearPredictor linear_;
  MatrixXd gain_;
  VectorXd noise_;
  std::vector<MatrixXd> runs_;
  double sample_time_;
  std::array<double, 3> low_{}, high_{}, at_{};  // deviation, memory, white
  DisturbanceForce best_;
  double likelihood_ = -std::numeric_limits<double>::infinity();
};

}  // namespace

double LatentForce::rms() const {
  double squares = 0.0, count = 0.0;
  for (std::size_t k = 0; k < settled.size(); ++k) {
    if (settled[k] == 0) continue;
    squares += force(static_cast<Index>(k)) * force(static_cast<Index>(k));
    count += 1.0;
  }
  return std::sqrt(squares / std::max(count, 1.0));
}

LatentForce latent_force(const PredictionData& data, ExperimentRole role,
                         const ExtendedLumpedModel& model, double intensity, Index coordinate,
                         int threads) {
  LatentForce result;
  PredictionTask task = data.windows(1, role);
  for (PredictionRun& run : task.runs) {
    run.first = 0;
    run.standing.clear();
  }
  const PredictionFitter fitter(data, task, intensity, threads);
  const PredictionFit fit = fitter.fit(model, data.noise(), {}, 0, false);
  if (!fit.usable || fit.gain.rows() > kMostStates || task.runs.empty()) return result;
  Predictor predictor(model.model, data.sample_time(), data.steps_per_sample());
  const LinearPredictor linear = linear_predictor(predictor, coordinate);
  std::vector<MatrixXd> runs;
  Index next = 0, shortest = std::numeric_limits<Index>::max();
  const Index outputs = data.output_count();
  for (const PredictionRun& run : task.runs) {
    runs.emplace_back(
        Eigen::Map<const MatrixXd>(fit.residuals.data() + next, outputs, run.samples));
    next += outputs * run.samples;
    shortest = std::min(shortest, run.samples);
  }
  LatentForceFit search(linear, fit.gain, data.noise(), std::move(runs), data.sample_time(),
                        coordinate);
  const double longest = kLongestMemory * static_cast<double>(shortest) * data.sample_time();
  search.maximise(data.force_scale(), longest, false);
  if (!std::isfinite(search.log_likelihood())) return result;
  const ErrorModel coloured = search.model();
  const double deviation = search.best().deviation;
  result.force.resize(task.rows(1));
  Index first = 0;
  for (const MatrixXd& errors : search.runs()) {
    result.force.segment(first, errors.cols()) = deviation * smoothed(coloured, errors);
    for (Index k = 0; k < errors.cols(); ++k) {
      result.settled.push_back(k >= std::min(kStart, errors.cols() / 10) ? 1 : 0);
    }
    first += errors.cols();
  }
  result.band = deviation * smoothing_error(coloured);
  search.maximise(data.force_scale(), longest, true);
  result.disturbance = search.best();
  result.log_likelihood = search.log_likelihood();
  result.motion = fitter.motion(fit);
  result.usable = result.force.allFinite();
  return result;
}

std::optional<LatentForce> likeliest_force(const PredictionData& data,
                                           const ExtendedLumpedModel& model, double intensity,
                                           int threads) {
  std::optional<LatentForce> likeliest;
  if (!std::isfinite(data.largest_force()) || !(intensity > 0.0)) return likeliest;
  for (std::size_t i = 0; i < model.model.imposed.size(); ++i) {
    if (model.model.imposed[i]) continue;
    LatentForce force = latent_force(data, ExperimentRole::kEstimation, model, intensity,
                                     static_cast<Index>(i), threads);
    const bool is_likelier =
        force.usable && (!likeliest || force.log_likelihood > likeliest->log_likelihood);
    if (is_likelier) likeliest = std::move(force);
  }
  return likeliest;
}

}  // namespace graybox
