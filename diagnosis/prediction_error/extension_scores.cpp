#include "diagnosis/prediction_error/extension_scores.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <exception>
#include <optional>

#include "diagnosis/predictor/residual_whitener.hpp"
#include "problems/base/stop.hpp"

namespace graybox {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kImitated = 1e-6;                            // of the direction's square
constexpr double kFirstAmplitude = 1e-3;                      // of the law's unit
constexpr double kLargestChange = 0.1, kWantedChange = 0.02;  // of the residuals' rms
constexpr int kAmplitudes = 4;

// Residuals beside the space of the fit's own parameters.
class Projection {
 public:
  Projection(const MatrixXd& jacobian, const VectorXd& residuals) {
    if (jacobian.cols() > 0) {
      const VectorXd size = jacobian.colwise().norm().cwiseMax(1e-300);
      const MatrixXd scaled = jacobian * size.cwiseInverse().asDiagonal();
      Eigen::ColPivHouseholderQR<MatrixXd> qr(scaled);
      basis_ = qr.householderQ() * MatrixXd::Identity(jacobian.rows(), qr.rank());
    }
    rest_ = beside(residuals);
  }
  [[nodiscard]] VectorXd beside(const VectorXd& values) const {
    if (basis_.cols() == 0) return values;
    return values - basis_ * (basis_.transpose() * values);
  }
  [[nodiscard]] const VectorXd& rest() const { return rest_; }

 private:
  MatrixXd basis_;
  VectorXd rest_;
};

struct Taken {
  double share = 0.0, amplitude = 0.0, deviation = 0.0;
  bool imitated = false;
};

Taken taken(const Projection& projection, const VectorXd& direction) {
  Taken result;
  const VectorXd a = projection.beside(direction);
  const double square = a.squaredNorm(), rest = projection.rest().squaredNorm();
  if (!(square > kImitated * direction.squaredNorm()) || !(rest > 0.0)) {
    result.imitated = true;
    return result;
  }
  const double product = a.dot(projection.rest());
  result.share = product * product / (square * rest);
  result.amplitude = -product / square;
  result.deviation = std::sqrt(rest / static_cast<double>(a.size()) / square);
  return result;
}

// d, at an amplitude that changes the residuals enough to be told from rounding and too little to
// leave the straight line; none where nothing comes of it.
std::optional<VectorXd> direction_of(const PredictionFitter& fitter, const PredictionFit& fit,
                                     const VectorXd& weights, const LawExtension& law) {
  double amplitude = law.is_secant ? 1.0 : kFirstAmplitude * law.unit;
  const double size = fit.residuals.norm();
  VectorXd moved;
  for (int trial = 0; trial < kAmplitudes; ++trial) {
    const ExtendedLumpedModel model = extended(fit.model, law, amplitude);
    if (!fitter.residuals(model, weights, fit.initials, fit.gain, moved)) {
      amplitude *= 0.1;
      continue;
    }
    moved -= fit.residuals;
    const double change = moved.norm();
    if (law.is_secant) return change > 0.0 ? std::optional(moved) : std::nullopt;
    if (!(change > 0.0)) {
      amplitude *= 10.0;
    } else if (change > kLargestChange * size && trial + 1 < kAmplitudes) {
      amplitude *= kWantedChange * size / change;
    } else {
      return moved / amplitude;
    }
  }
  return {};
}

}  // namespace

std::vector<ExtensionScore> extension_scores(const PredictionFitter& fitter,
                                             const PredictionFit& fit, const VectorXd& weights,
                                             const std::vector<LawExtension>& extensions) {
  const Projection plain(fit.jacobian, fit.residuals);
  const ResidualWhitener whitener(fitter.task(), fitter.data().output_count(), fit.residuals);
  MatrixXd whitened_jacobian(fit.jacobian.rows(), fit.jacobian.cols());
  for (Index c = 0; c < fit.jacobian.cols(); ++c) {
    whitened_jacobian.col(c) = whitener.apply(fit.jacobian.col(c));
  }
  const Projection whitened(whitened_jacobian, whitener.apply(fit.residuals));
  std::vector<std::optional<ExtensionScore>> found(extensions.size());
  const auto count = static_cast<std::ptrdiff_t>(extensions.size());
  const auto score_of = [&](std::size_t at) -> std::optional<ExtensionScore> {
    const LawExtension& law = extensions[at];
    const std::optional<VectorXd> direction = direction_of(fitter, fit, weights, law);
    if (!direction) return {};
    const Taken raw = taken(plain, *direction);
    const Taken white = taken(whitened, whitener.apply(*direction));
    const bool is_possible = !raw.imitated && !(law.one_sided && raw.amplitude < 0.0);
    return ExtensionScore{at, is_possible ? raw.share : 0.0, is_possible ? white.share : 0.0,
                          raw.amplitude, raw.deviation};
  };
  const StopClock clock;
  std::exception_ptr trouble;
#pragma omp parallel for num_threads(fitter.threads()) schedule(dynamic) if (fitter.threads() > 1)
  for (std::ptrdiff_t k = 0; k < count; ++k) {
    if (clock.stops()) continue;
    try {
      found[static_cast<std::size_t>(k)] = score_of(static_cast<std::size_t>(k));
    } catch (...) {  // none may leave the parallel region
#pragma omp critical
      trouble = std::current_exception();
    }
  }
  if (trouble) std::rethrow_exception(trouble);
  stop_if_requested();
  std::vector<ExtensionScore> scores;
  for (const auto& score : found) {
    if (score) scores.push_back(*score);
  }
  std::ranges::stable_sort(scores, std::greater{}, &ExtensionScore::share);
  return scores;
}

std::vector<ExtensionScore> shortlist(const std::vector<ExtensionScore>& scores,
                                      const std::vector<LawExtension>& extensions,
                                      std::size_t plain, std::size_t whitened) {
  std::vector<ExtensionScore> list;
  const auto take = [&](const std::vector<ExtensionScore>& ranking, std::size_t most,
                        double ExtensionScore::*share) {
    std::size_t taken = 0;
    std::vector<std::size_t> seen;
    for (const ExtensionScore& score : ranking) {
      if (taken == most || !(score.*share > 0.0)) return;
      const std::size_t hypothesis = extensions[score.extension].hypothesis;
      if (std::ranges::count(seen, hypothesis) > 0) continue;
      seen.push_back(hypothesis);
      ++taken;
      const bool is_there = std::ranges::any_of(list, [&](const ExtensionScore& other) {
        return extensions[other.extension].hypothesis == hypothesis;
      });
      if (!is_there) list.push_back(score);
    }
  };
  take(scores, plain, &ExtensionScore::share);
  std::vector<ExtensionScore> second = scores;
  std::ranges::stable_sort(second, std::greater{}, &ExtensionScore::whitened_share);
  take(second, whitened, &ExtensionScore::whitened_share);
  // Late here or there, by a lag or a delay, may be one thing: all of them, or none.
  const auto is_late = [&](const ExtensionScore& score) {
    const std::string& law = extensions[score.extension].law;
    return score.share > 0.0 && (law == "lag" || law == "delay");
  };
  if (std::ranges::any_of(list, is_late)) {
    for (const ExtensionScore& score : scores) {
      const bool is_there = std::ranges::any_of(
          list, [&](const ExtensionScore& other) { return other.extension == score.extension; });
      if (is_late(score) && !is_there) list.push_back(score);
    }
  }
  return list;
}

}  // namespace graybox
